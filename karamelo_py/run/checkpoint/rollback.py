"""The last good state of a run, and what all parts of a scene remembered there and later.

Steps from there on can be taken once more: where a step went wrong, to write a file to go on from.
Files of log, dumps and plots stay as they are then; and whoever goes on from an earlier state than
the last that they show has to find all parts as they were in it, so that no row is there twice and
no sum over time holds what comes later.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from karamelo_py.kernels.step import DONE
from karamelo_py.run.checkpoint.parts import OUTPUTS, PartStates, parts_of
from karamelo_py.scene.hub import Hub


class RollbackPoint:
    """The last good state of a run, and the states of parts there and at later steps.

    Attributes
    ----------
    arrays
        Copies of the arrays of that state, empty before there is one.
    step
        Its step.
    """

    def __init__(self, hub: Hub) -> None:
        self.hub = hub
        self.arrays: dict[str, np.ndarray] = {}
        self.step = -1
        self._parts: dict[int, PartStates] = {}

    @property
    def parts(self) -> PartStates:
        """The states of parts there."""
        return self._parts[self.step]

    def keep(self, simulation: Any) -> None:
        """Let the present state be the last good one; others are forgotten."""
        self.arrays, self.step = simulation.snapshot(self.arrays), simulation.step
        self.forget_later()

    def move(self, simulation: Any) -> None:
        """Let the present state be the last good one; what later ones were is known still."""
        self.arrays, self.step = simulation.snapshot(self.arrays), simulation.step
        self.note(always=True)

    def forget_later(self) -> None:
        """Forget what parts remembered at other states: nobody goes to them any more."""
        self._parts = {self.step: PartStates.of(self.hub)}

    def take(self, arrays: dict[str, np.ndarray], step: int, parts: PartStates) -> None:
        """Take a state that a file holds."""
        self.arrays, self.step, self._parts = arrays, step, {step: parts}

    def note(self, *, always: bool) -> None:
        """Note what parts remember now, `always` or if something has been written of it."""
        step = self.hub.update.step
        outputs = (part for key, part in parts_of(self.hub) if key[0] in OUTPUTS)
        if always or any(part.last_step == step for part in outputs):
            self._parts[step] = PartStates.of(self.hub)

    def return_to(self, simulation: Any, *, cut: bool = False) -> None:
        """Go back there; with `cut` outputs go on from there in their files."""
        simulation.restore(self.arrays)
        self.parts.give(self.hub, cut=cut)

    @contextmanager
    def remembered(self) -> Iterator[None]:
        """Within this, parts remember what they did there."""
        now = PartStates.of(self.hub)
        self.parts.give(self.hub)
        try:
            yield
        finally:
            now.give(self.hub)

    def again(self, advance: Callable[[int], int], end: int) -> int:
        """Take the steps up to `end` once more; parts remember on the way what they did there.

        Returns how the last of them ended.
        """
        update = self.hub.update
        while update.step < end:
            noted = min((step for step in self._parts if update.step < step < end), default=end)
            status = advance(noted - update.step)
            if status != DONE:
                return status
            if update.step in self._parts:
                self._parts[update.step].give(self.hub)
        return DONE
