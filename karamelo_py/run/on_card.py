"""Simulation on a GPU: arrays are sent after changes, and fetched when they are used."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from karamelo_py.kernels.arrays import NoHooks, Setup, Tag
from karamelo_py.kernels.step import DONE, STOPPED
from karamelo_py.run.access import NodesByNumber
from karamelo_py.run.gpu import StepsOnCard, arrays_in, there
from karamelo_py.run.lower.card import check_room_there, missing_told, refuse
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub


def alike(hooks: Tag, others: Tag) -> bool:
    if type(hooks) is not type(others) or isinstance(hooks, NoHooks):
        return type(hooks) is type(others)
    tables = ("table", "programs", "members", "code", "constants", "x0")
    pairs = ((getattr(hooks, name), getattr(others, name)) for name in tables)
    sizes = hooks.holders.shape == others.holders.shape and hooks.loads.shape == others.loads.shape
    whole = [*map(type, hooks.whole)] == [*map(type, others.whole)] and hooks.whole == others.whole
    return sizes and whole and all(np.array_equal(one, other) for one, other in pairs)


class SimulationOnCard(Simulation):
    """A simulation whose steps run on a GPU; everything else runs on the CPU.

    `setup` fetches the arrays after steps. Code on the CPU that changes arrays must call `changed`
    or `sort`, so that they are sent to the GPU again. Fetched points are in the order of the GPU,
    and tiles are not up to date: code that uses tiles must sort the points first.
    """

    states_every = 1000  # steps between stored states, which must be fetched
    notes_temperatures = False
    _steps: StepsOnCard | None = None
    _known: Sequence = ()  # key of the compiled steps
    _ahead = False  # the arrays on the CPU are out of date
    _nodes_ahead = False  # the nodes on the CPU are out of date
    _sent = False  # the arrays of the GPU are up to date

    def __init__(self, hub: Hub, previous: Simulation | None = None):
        check_room_there(hub)
        super().__init__(hub, previous)
        if isinstance(previous, SimulationOnCard):
            previous.leave_card()

    def leave_card(self) -> None:
        self._fetch()
        if self._steps is not None:
            self._steps.images.close()
        self._steps, self._sent = None, False

    @property
    def setup(self) -> Setup:
        self._fetch()
        return self._setup

    @setup.setter
    def setup(self, setup: Setup) -> None:
        self._setup, self._sent = setup, False

    @property
    def nodes(self) -> NodesByNumber:
        """Nodes after the last step, fetched only when used, as there may be many."""
        if self._nodes_ahead:
            self._fetch()
            self._nodes_ahead = False
            self._steps.fetch_nodes()
        return super().nodes

    @property
    def kin(self) -> Tag:
        return self._setup.kin

    def _fetch(self) -> None:
        if self._ahead:
            self._ahead = False
            self._steps.fetch()
            self.tiles.unsort(self.control, limit=0.0)  # tiles are not up to date

    def changed(self) -> None:
        self._sent = False
        super().changed()

    def sort(self) -> None:
        super().sort()
        self._sent = False

    def clear_forces(self) -> None:
        super().clear_forces()
        self._sent = False

    def restore(self, snapshot: dict[str, np.ndarray]) -> None:
        self._ahead = self._nodes_ahead = False
        super().restore(snapshot)

    def sort_if_due(self) -> None:
        self._fetch()
        super().sort_if_due()

    def show_on_nodes(self) -> None:
        self.sort_if_due()
        super().show_on_nodes()

    def bring(self) -> None:
        self.sort_if_due()

    def in_tiles(self) -> bool:
        self.sort_if_due()
        self._sent = False  # the energy check resets the work of forces at points
        return super().in_tiles()

    def refuse(self) -> None:
        refuse(self.hub, self._setup)

    def _make_ready(self) -> None:
        if not self.hub.checking:
            self.refuse()
        super()._make_ready()
        if self._setup.contact or self.hub.update.method.corrected:
            self._sent = False

    def compile(self) -> None:
        self.launches()

    def launches(self) -> StepsOnCard:
        steps, hooks, functions = self._steps, self.hooks, self.fixes.lasting.functions
        if steps is not None and functions == steps.functions and alike(hooks, steps.hooks):
            hooks = steps.hooks
        key = [type(self.visits), *map(id, arrays_in((there(self._setup), hooks)))]
        if steps is None or key != self._known:
            self._fetch()
            if steps is not None:
                steps.images.close()
            program = type(self.scheme), type(self.visits)
            card, acting = self.hub.settings.card, (hooks, functions)
            with missing_told(self.hub):
                steps = StepsOnCard(card, self._setup, program, acting)
            self._steps, self._known, self._sent = steps, key, False
        return steps

    def _advance_to(self, target: int) -> int:
        if self.begins:
            # Fixes of the first step are called from Python.
            self._sent = False
            status = super()._advance_to(self.step + 1)
            if status != DONE or self.step >= target:
                return status
        if self.step >= target or self.time >= self.control.step[0].end_time:
            return DONE
        steps = self.launches()
        if not self._sent:
            self._fetch()
            steps.send()
            self._sent = True
        status = steps.advance(target - self.step)
        self._ahead = self._nodes_ahead = self.mapped = True
        if status == STOPPED:
            self._report(steps.wrong)
        return status

    def _report(self, number: int) -> None:
        for block in self.setup.blocks:
            report = block.tiling.report
            report[:, 2] = 0
            report[0, 2] = 1 + np.argmax(here) if (here := block.points.id == number).any() else 0
