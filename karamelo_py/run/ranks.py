"""A scene stepped by several processes, with the bits of one.

All processes carry out the script, up to a run. There the first leads: it does what a single
process does, and has the others step with it. Each has the points of its tiles. What is to be seen
between two steps (by logs, dumps, computes, files to go on from) the first gathers into the arrays
of a whole scene, and hands out anew where something has changed them.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import wraps
from types import SimpleNamespace
from typing import Any, ClassVar, NamedTuple
from zlib import crc32

import numpy as np

from karamelo_py.compiler.addresses import address_of_python
from karamelo_py.compiler.formula import GLOBAL, UNIFORM
from karamelo_py.kernels.arrays import DT, Block, Nodes, Setup, Tiling, arrays_of
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.ranks import (
    CALL,
    GIVE,
    LARGEST,
    NEXT,
    NUMBER,
    SWEEP,
    TAKE,
    TOTALS,
    Linked,
)
from karamelo_py.kernels.totals import WORK, rounded
from karamelo_py.run.by_id import ById, Ordered, Piece
from karamelo_py.run.crew import ENDING, FAILED, Crew
from karamelo_py.run.lowering import State, lower
from karamelo_py.run.shares import SharedTiles, joined, occupied, sized, work_of
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.stable import sparse
from karamelo_py.run.state import changing, of_nodes, remembered_at, take_points, take_tiling
from karamelo_py.run.tiles import (
    DIRECT_UP_TO,
    SHARES,
    Tiles,
    between,
    in_tiles,
    in_use,
    numbers,
    one_after_another,
    shares_of,
    used,
)
from karamelo_py.run.work import Work
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Quit, ScriptError

OVER = "over"
LEARN_EVERY = (
    100  # steps, from one output to another: then it is seen whether the work is shared well
)
CHANGING = ("advance", "set_initial")  # what changes the points
ROWS = ("number", "range", "grid", "box")  # of a tiling


def by_all(method: Callable) -> Callable:
    """A method of each process for its part, where the whole is not there: of all together."""

    @wraps(method)
    def act(self: Ranks, *arguments: Any) -> Any:
        if self._stepping or self._shown or not self._leading:
            return method(self, *arguments)
        return self._all_do(method.__name__, *arguments)

    return act


class Abandoned(Exception):
    """The first process has found a fault in the midst of a step, and tells of it."""


class HandedOutAnew(Exception):
    """A fix in Python has moved points at the start of a step: others have them now."""


class Ranks(Simulation):
    """The arrays of a scene that several processes share."""

    def __init__(self, hub: Hub, previous: Ranks | None = None):
        self.crew: Crew = hub.settings.crew
        self._whole: Setup | None = None
        self._shown = True  # the whole has the present state
        self._handed_out = -1  # the version of the whole that the parts have
        self._leading = False
        self._stepping = False  # arrays are those of the part
        self._joint = False  # all processes do the same, and wait for each other
        self._kept: dict[str, np.ndarray] = {}
        self._ordered: list[Ordered] = []  # own points, while pieces of all are looked at
        self._prepared = False
        self._bare = False
        super().__init__(hub, previous)
        # Nobody has points yet: each makes those of a share when a run begins.
        self._bare = previous is None
        self._shown = not self._bare
        self._call = address_of_python(self._answer, CALL)
        self._parted = self._empty_part()
        self._work = Work(len(self._whole.blocks))
        self._at_once = False  # what fixes publish is added up in each step
        self._due: set[int] = set()  # or these values, when the last is over
        self._counted_at = self._learned_at = self.step

    # --- the whole --------------------------------------------------------------------------------

    @property
    def setup(self) -> Setup:
        """The whole scene. It is gathered first where steps were taken since."""
        if self._bare and self._leading:
            self._see_parts()
        elif self._bare:
            # Before the first run a script asks for the points: of all processes alike.
            whole, self.tiles = lower(self.hub)
            self._whole = whole._replace(control=self.control, contact=self.contact)
            self._bare, self._shown = False, True
        if not self._shown:
            if self._leading:
                self._together("gather")
            else:
                self.gather(everywhere=True)
        return self._whole

    @setup.setter
    def setup(self, s: Setup) -> None:
        self._whole = s
        self._handed_out = -1

    @property
    def stepped(self) -> Setup:
        """The arrays that steps work on."""
        return self._part if self._stepping else self.setup

    @property
    def kin(self) -> NamedTuple:
        """The kinematics."""
        return self._whole.kin

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The kinds of points."""
        return self._whole.blocks

    @property
    def contact(self) -> Any:
        """How solids touch."""
        return self._whole.contact

    def sort(self) -> None:
        """Sort the points by tile."""
        if self._stepping:
            self._tell_what_touched()
            self._account()
            self._part = self._parted.tiles.migrate(self._part, self._learn())
            self._parted.tiles.sort(self._part)
        else:
            super().sort()
            self._handed_out = -1

    def _lowered(self, state: State | None) -> tuple[Setup, Tiles]:
        return lower(self.hub, state, ids=None if state is not None else (0, 1))

    def _empty_part(self) -> SimpleNamespace:
        """The part of this process without points, with nodes and buffers of its own."""
        s, hub = self._whole, self.hub
        method = hub.update.method
        one_place = method.fields_per_solid
        tiles = SharedTiles(
            self.crew, method.lattices(hub), s.basis, self.count, sparse(hub), one_place=one_place
        )
        nodes, heat = _like(s.nodes), s.heat
        buffers = tiles.empty_buffers(nodes)
        if isinstance(heat, Conducting):
            at_nodes = _like(heat.nodes)
            heat = Conducting(at_nodes, tiles.empty_buffers(at_nodes))
        control = s.control._replace(ranks=Linked(self._call, tiles.foreign))
        part = s._replace(
            blocks=tuple(block._replace(tiling=tiles.empty_tiling()) for block in s.blocks),
            nodes=nodes, heat=heat, buffers=buffers, spans=np.zeros((1, 2), np.int64),
            control=control,
        )  # fmt: skip
        # As much of a simulation as its state asks for.
        return SimpleNamespace(setup=part, tiles=tiles, hub=hub)

    @property
    def _part(self) -> Setup:
        """The arrays of this process."""
        return self._parted.setup

    @_part.setter
    def _part(self, s: Setup) -> None:
        self._parted.setup = s

    @property
    def processes(self) -> dict[str, str]:
        """What a banner says of those that share the scene."""
        alone = f", one has all points: up to {DIRECT_UP_TO} are not shared out"
        return {"processes": f"{self.crew.size}{alone if self.tiles.direct else ''}"}

    # --- leading and following --------------------------------------------------------------------

    @property
    def follows(self) -> bool:
        """Another process says what this one does in a run."""
        return not self.crew.leads

    @contextmanager
    def leading(self) -> Iterator[None]:
        """While a run goes on: the others follow."""
        self._meet()
        self._leading, self._prepared = True, False
        well = False
        try:
            yield
            well = True
        finally:
            self._leading = False
            if self._joint:
                # In the midst of what all do together: the others would wait for ever.
                self.crew.amid = True
            else:
                if well and self.hub.interpreter.has_more and not self._bare:
                    self._see_parts()
                deleted = np.flatnonzero(~self.present)
                self.crew.told((OVER, well, deleted, self.hub.values.array))

    def _meet(self) -> None:
        """See that all processes are about to do the same run."""
        hub, crew = self.hub, self.crew
        present = [hub.place and (hub.place.file, hub.place.line), len(hub.runs), self.count]
        words = crew.meet(1 + crc32(repr((present, hub.interpreter.presets)).encode()))
        if (words == words[0]).all():
            return
        crew.parted = True
        # One that has failed tells of it.
        if (words == FAILED).any() or crew.rank != int((words > 0).argmax()):
            raise Quit
        raise ScriptError(
            "the processes do not come to the same run",
            place=hub.place,
            expected="the same script, files and variables for all of them",
        )

    def follow(self) -> None:
        """Do what the first process says, until its run is over."""
        if threading.current_thread() is threading.main_thread():
            for number in ENDING:  # the first hears of them
                signal.signal(number, signal.SIG_IGN)
        self._meet()
        hub = self.hub
        hub.restart = hub.interpreter.replay = None
        while True:
            what, *arguments = self.crew.told()
            if what == OVER:
                well, deleted, values = arguments
                hub.values.array[:] = values
                self.present[deleted] = False
                if not well:
                    raise Quit
                return
            try:
                with suppress(Abandoned):
                    getattr(self, what)(*arguments)
            except BaseException:
                self.crew.amid = True
                raise

    def _tell(self, what: str, *arguments: Any) -> None:
        self.crew.told((what, *arguments))

    def _together(self, what: str, *arguments: Any, **own: Any) -> Any:
        """Have all call a method with these arguments, this process with its `own` ones, too."""
        before, self._joint = self._joint, True
        self._tell(what, *arguments)
        found = getattr(self, what)(*arguments, **own)
        self._joint = before  # not where it failed: then the others wait
        return found

    def prepare(self, begun: list[str]) -> None:
        """Make ready for the steps of a run: the hooks of the fixes that are left to act."""
        import numba

        if self.threads > 1:
            numba.set_num_threads(self.threads)
        self.begun = begun
        self._prepare_hooks()
        self.hub.update.method.begin(self.hub, self.contact)

    def _see_prepared(self) -> None:
        """Have all that follow made ready."""
        if not self._prepared:
            self._tell("prepare", self.begun)
            self._prepared = True

    # --- handing out and gathering ----------------------------------------------------------------

    def _let_go(self) -> None:
        """From here on the parts alone have the present state."""
        self._shown = False
        self._whole = self._whole._replace(
            blocks=tuple(b._replace(points=sized(b.points, 0)) for b in self._whole.blocks)
        )

    def _see_parts(self) -> None:
        """Hand out the whole where the parts do not have its present state."""
        if self._handed_out == self.version:
            return
        if self._bare:
            self._together("fill")
            self._handed_out = self.version
            return
        whole = self.setup
        clock = whole.control.clock[0]
        covered = all(in_tiles(b.tiling) == b.points.mass.size for b in whole.blocks)
        if clock.drift > clock.drift_limit or not covered:
            super().sort()
        self._together("take", *self._cut(), shares=self._shares())
        self._handed_out = self.version

    def _cut(self) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Share the tiles of the whole out: where they are cut; nodes, and what these remember."""
        tiles = self._parted.tiles
        tiles.share_out(work_of(tiles.points_in(self._whole.blocks), self._work.costs))
        nodes = numbers(self._whole.spans)
        return tiles.cuts, nodes, [one[nodes] for one in self._memory()]

    def _shares(self) -> list[dict[str, np.ndarray]]:
        """What each process has of the whole."""
        return [self._share_of(self._whole, rank) for rank in range(self.crew.size)]

    def _share_of(self, s: Setup, rank: int) -> dict[str, np.ndarray]:
        """The points and tiles that a process is to have of those in `s`, by name."""
        own = self._parted.tiles.owner == rank
        found = {}
        for k, block in enumerate(s.blocks):
            found |= _share(k, block, own)
        return found

    def fill(self) -> None:
        """Make the points of a share of the ids, and hand them over to whose tiles they are in."""
        rank, size = self.crew.rank, self.crew.size
        found, _ = lower(self.hub, ids=(self.count * rank // size, self.count * (rank + 1) // size))
        blocks = zip(self._part.blocks, found.blocks, strict=True)
        part = self._part._replace(
            blocks=tuple(own._replace(points=block.points) for own, block in blocks)
        )
        self._part = self._parted.tiles.migrate(part, self._work.costs)
        self._parted.tiles.sort(self._part)
        self._bare = False

    def take(
        self, cuts: np.ndarray, nodes: np.ndarray, memory: list, shares: list | None = None
    ) -> None:
        """Take the own tiles from what the first hands out."""
        found = self.crew.handed_out(shares)
        self._parted.tiles.cut(cuts)
        self._parted.tiles.empty_nodes(self._part)
        for one, rows in zip(self._memory(), memory, strict=True):
            one[nodes] = rows
        if not self.crew.leads:
            self.control.totals[WORK] = 0
        self._put(found)

    def _put(self, found: dict[str, np.ndarray]) -> None:
        """Let the part have these points and tiles."""
        s, tiles = self._part, self._parted.tiles
        blocks = tuple(
            Block(
                take_points(block.points, found, f"points/{k}/"),
                block.laws,
                take_tiling(block.tiling, found, f"tiling/{k}/"),
            )
            for k, block in enumerate(s.blocks)
        )
        self._part = s._replace(blocks=blocks)
        tiles.lay_out(self._part)

    def _memory(self) -> list[np.ndarray]:
        """What contact remembers of every node."""
        nodes = len(self._parted.tiles.foreign)
        return remembered_at(self._parted, np.array([[0, nodes]]))

    def _tell_what_touched(self) -> None:
        """All learn where contact acted in the last step: other nodes come to be in use."""
        memory = self._memory()
        if memory:
            own = self._counted()
            own = own[
                np.any([(np.abs(one[own]) == self.step).any(axis=1) for one in memory], axis=0)
            ]
            for nodes, *rows in self.crew.everyone((own, *(one[own] for one in memory))):
                for one, found in zip(memory, rows, strict=True):
                    one[nodes] = found

    def _counted(self) -> np.ndarray:
        """The numbers of the nodes in use here that no other process counts."""
        nodes = numbers(self._part.spans)
        return nodes[self._parted.tiles.foreign[nodes] == 0]

    def gather(self, *, everywhere: bool = False) -> None:
        """Put the parts of all together, at the first process, or everywhere."""
        s = self._part
        own = self._counted()
        work = self.control.totals[WORK].copy()
        found = {
            "counts": [block.points.mass.size for block in s.blocks],
            "tiling": [
                {name: getattr(b.tiling, name)[:rows] for name, rows in in_use(b.tiling)}
                | {"report": b.tiling.report[: b.tiling.count[0]]}
                for b in s.blocks
            ],
            "nodes": own,
            "at nodes": [array[own] for _, array in of_nodes(s)],
            "memory": [array[own] for array in self._memory()],
            "work": work,
        }
        parts = self.crew.everyone(found) if everywhere else self.crew.gathered(found)
        self.control.totals[WORK] = 0
        if self.crew.leads:
            self.control.totals[WORK] = sum(part["work"] for part in parts)
        self._shown = True
        self._line_up(parts)
        if everywhere:
            self._spread()
        if parts is not None:
            self._join(parts)

    def pieces(self) -> Iterator[ById]:
        """All points, so many at a time: not even the first needs the memory of all."""
        if self._shown or not self._leading:
            yield from super().pieces()
            return
        for first, end in self.ranges():
            parts = self._together("give_piece", first, end)
            blocks = zip(self._part.blocks, zip(*parts, strict=True), strict=True)
            yield Piece(
                self, first, end, self._part,
                (b._replace(points=joined(b.points, found)) for b, found in blocks),
            )  # fmt: skip

    def give_piece(self, first: int, end: int) -> list | None:
        """Own points with ids from `first` to before `end`, for the first process those of all."""
        if first == 0:
            self._ordered = list(map(Ordered, self._part.blocks))
        own = [one.between(first, end) for one in self._ordered]
        if end == self.count:
            self._ordered = []
        return self.crew.gathered([[a for _, a in arrays_of(b.points)] for b in own])

    def _line_up(self, parts: list[dict] | None) -> None:
        """Put the points of all into the whole of the first, tile after tile."""
        whole = []
        for k, (block, own) in enumerate(zip(self._whole.blocks, self._part.blocks, strict=True)):
            counts = [part["counts"][k] for part in parts] if parts is not None else []
            order = _by_tile([part["tiling"][k] for part in parts]) if parts else None
            points = sized(block.points, sum(counts)) if self.crew.leads else block.points
            rows = [array for _, array in arrays_of(points)]
            for row, (_, array) in zip(rows, arrays_of(own.points), strict=True):
                for c in np.ndindex(array.shape[:-1]):
                    self.crew.lined_up(array[c], row[c] if self.crew.leads else None, counts)
                    if self.crew.leads:
                        row[c] = row[c][order]
            whole.append(block._replace(points=points))
        self._whole = self._whole._replace(blocks=tuple(whole))

    def _spread(self) -> None:
        """Give the points of the whole to all."""
        blocks = self._whole.blocks
        own = [[a for _, a in arrays_of(b.points)] for b in blocks] if self.crew.leads else None
        found = self.crew.told(own)
        self._whole = self._whole._replace(
            blocks=tuple(
                block._replace(points=joined(block.points, [arrays]))
                for block, arrays in zip(blocks, found, strict=True)
            )
        )

    def _join(self, parts: list[dict]) -> None:
        """Tiles and nodes of the whole from those of all."""
        whole = self._whole
        for k, block in enumerate(whole.blocks):
            block.tiling.count[1] = 1 if self.tiles.direct else SHARES
            _join_tilings(block.tiling, [part["tiling"][k] for part in parts])
        self.tiles.empty_nodes(whole)
        self.tiles.lay_out(whole)
        nodes = numbers(whole.spans)
        for _, array in of_nodes(whole):
            array[nodes] = 0  # also those that no box reaches: nobody has them
        for part in parts:
            for (_, array), rows in zip(of_nodes(whole), part["at nodes"], strict=True):
                array[part["nodes"]] = rows
            for array, rows in zip(self._memory(), part["memory"], strict=True):
                array[part["nodes"]] = rows

    # --- steps ------------------------------------------------------------------------------------

    def _all_do(self, name: str, *arguments: Any) -> Any:
        """Have each process call one of its methods for its part; what the first finds."""
        self._see_parts()
        clock = self.control.clock.view(np.ndarray)
        found = self._together("do", name, self.control.values, clock, arguments)
        if name in CHANGING:
            self._handed_out = self.version
        return found

    def do(self, name: str, values: np.ndarray, clock: np.ndarray, arguments: tuple) -> Any:
        """Call a method for the part of this process, with these values and this clock."""
        self.control.values[:] = values
        self.control.clock.view(np.ndarray)[:] = clock
        with self._steps():
            found = getattr(self, name)(*arguments)
        if name in CHANGING:
            self._let_go()
        return found

    def advance(self, count: int) -> int:
        """Take up to `count` steps, all processes together; DONE, or why it stopped."""
        if self._stepping:
            if abs(self.step - self._learned_at) >= LEARN_EVERY and not self._parted.tiles.direct:
                self._rebalance()
            self._counted_at = self.step
            self._work.pause()
            self._at_once = self._reads_totals()
            status = super().advance(count)
            self._account()
            self._publish()
            return status
        self._see_prepared()
        return self._all_do("advance", count)

    def set_initial(self, ID: str) -> None:
        """Let the fix `ID` set the state that a run begins with."""
        if self._stepping or not self.hub.fixes[ID].point_by_point:
            super().set_initial(ID)
        else:
            self._all_do("set_initial", ID)

    begin_to_look = by_all(Simulation.begin_to_look)

    measure = by_all(Simulation.measure)
    measure_heat = by_all(Simulation.measure_heat)
    fastest = by_all(Simulation.fastest)
    motions = by_all(Simulation.motions)

    @by_all
    def counts(self) -> list[int]:
        """How many points each block has."""
        return self.of_all(np.array(super().counts())).tolist()

    def total(self, name: str, group: Any = None) -> float:
        """What all points, or those of a group, have together; without rounding."""
        return self.total_of(name, None if group is None or group.all else group.id)

    @by_all
    def total_of(self, name: str, ID: str | None) -> float:
        """The same, by the ID of the group."""
        return super().total(name, None if ID is None else self.hub.groups[ID])

    def of_all(self, numbers: np.ndarray) -> np.ndarray:
        """Sums over all processes, where each looks at its part."""
        return self.crew.added(numbers) if self._stepping else numbers

    def most(self, numbers: np.ndarray) -> np.ndarray:
        """The largest of each number of all processes, where each looks at its part."""
        return self.crew.largest(numbers) if self._stepping else numbers

    def _account(self) -> None:
        """Take note of the steps so far; what comes before the next is not counted."""
        blocks = self._part.blocks
        counts = [block.points.mass.size for block in blocks]
        counts.append(sum(int(block.tiling.count[0]) for block in blocks))
        self._work.done(counts, self.step - self._counted_at)
        self._counted_at = self.step
        self._work.pause()

    def _learn(self) -> np.ndarray:
        """What points and tiles cost."""
        self._learned_at = self.step
        self._work.learn(self.crew)
        return self._work.costs

    def _rebalance(self) -> None:
        """Hand over tiles as they are: points may never be sorted again."""
        s, tiles = self._part, self._parted.tiles
        if not tiles.balance(work_of(tiles.points_in(s.blocks), self._learn())):
            return
        self._tell_what_touched()
        own = [tiles.owner[occupied(block.tiling)[0]] for block in s.blocks]
        others = tiles.partners(np.bincount(np.concatenate(own), minlength=self.crew.size))
        given = {rank: self._share_of(s, rank) for rank in others}
        shares = [self._share_of(s, self.crew.rank), *self.crew.traded(given).values()]
        tiles.empty_nodes(s)
        blocks = []
        for k, block in enumerate(s.blocks):
            tilings = [_stripped(share, f"tiling/{k}/") for share in shares]
            points = [_stripped(share, f"points/{k}/") for share in shares]
            order = _by_tile(tilings)
            arrays = {
                name: np.take(
                    np.concatenate([one[name] for one in points], axis=-1), order, axis=-1
                )
                for name in points[0]
            }
            _join_tilings(block.tiling, tilings)
            blocks.append(block._replace(points=take_points(block.points, arrays, "")))
        self._part = s._replace(blocks=tuple(blocks))
        tiles.lay_out(self._part)

    def waits(self) -> np.ndarray:
        """Seconds that each process has waited for others in steps so far."""
        return np.array(self._together("tell_of_waiting"))

    def tell_of_waiting(self) -> list | None:
        """The same, of all processes for the first."""
        return self.crew.gathered(self.crew.waited)

    def compile(self) -> None:
        """Have the loop over the steps compiled now, by all processes."""
        self._see_prepared()
        self._see_parts()
        self.compile_part()
        self._tell("compile_part")  # and find on disk what has been compiled

    def compile_part(self) -> None:
        """Compile the loop of this process."""
        with self._steps():
            super().compile()

    def _advance(self, count: int) -> int:
        target = self.step + count
        while True:
            try:
                return super()._advance(target - self.step)
            except HandedOutAnew:
                self.taken_up = True

    def act(self, function: Callable[[Setup], None], _: Setup) -> None:
        """In the midst of a step: the first acts on the whole, and all take over what it did."""
        self.gather()
        crew, control = self.crew, self.control
        if crew.leads:
            told = self._act(function)
            crew.told(told)
        elif (told := crew.told()) is None:
            raise Abandoned
        what, values, clock, *arguments = told
        control.values[:] = values
        control.clock.view(np.ndarray)[:] = clock
        getattr(self, what)(*arguments, shares=self._shares() if crew.leads else None)
        if what == "take":
            raise HandedOutAnew

    def _act(self, function: Callable[[Setup], None]) -> tuple:
        """Act on the whole; what the others are to do then, and with what."""
        self._stepping, sorts = False, self.tiles.sorts
        try:
            function(self._whole)
        except BaseException:
            self.crew.told(None)
            self._joint = False  # the others know
            raise
        self._stepping = True
        now = self.control.values, self.control.clock.view(np.ndarray)
        if self.tiles.sorts > sorts:
            return "take", *now, *self._cut()
        nodes = numbers(self._whole.spans)
        return "take_back", *now, nodes, [array[nodes] for _, array in of_nodes(self._whole)]

    def take_back(self, nodes: np.ndarray, rows: list, shares: list | None = None) -> None:
        """Put what the first has changed into the arrays that a step is at work on."""
        s, found = self._part, self.crew.handed_out(shares)
        here = np.isin(nodes, numbers(s.spans))
        for (_, array), own in zip(of_nodes(s), rows, strict=True):
            array[nodes[here]] = own[here]
        for k, block in enumerate(s.blocks):
            for name, array in arrays_of(block.points):
                array[...] = found[f"points/{k}/{name}"]

    @contextmanager
    def _steps(self) -> Iterator[None]:
        self._stepping = True
        try:
            yield
        finally:
            self._stepping = False

    def _answer(self, what: int, a: int, b: int) -> int:
        """What kernels ask of the other processes (karamelo_py.kernels.ranks)."""
        try:
            self._work.note()
            found = self._answers[what](self, a, b) or 0
            if what == NEXT:
                self._work.next_block()
            else:
                self._work.resume(0 if what in {SWEEP, GIVE} else None)
            return found
        except BaseException as error:
            # Nothing can be raised through a kernel, and the others wait.
            self.crew.fail(error)
            raise

    def _go_on(self, *_: int) -> None:
        """Only the time is taken."""

    def _give(self, number: int, what: int) -> None:
        self._parted.tiles.give(self._part, number, what)

    def _take(self, *_: int) -> None:
        self._parted.tiles.take()

    def _totals(self, first: int, count: int) -> None:
        rows = slice(first, first + count)
        if first > WORK and not self._at_once:
            self._due.update(range(first, first + count))
            self.control.answer[:count] = self.control.values[rows]
            return
        of_all = self.crew.added(self.control.totals[rows])
        for k in range(count):
            self.control.answer[k] = rounded(of_all[k])

    def _reads_totals(self) -> bool:
        """Whether what fixes publish is read within steps."""
        if self._python.by_stage or self._first is not None:
            return True
        code = getattr(self.hooks, "code", np.empty((0, 2), np.int64))
        return bool(((code[:, 0] % UNIFORM == GLOBAL) & (code[:, 1] > DT)).any())

    def _publish(self) -> None:
        """Values of the last step become those of all: their totals are kept until the next."""
        rows, values = sorted(self._due), self.control.values
        self._due.clear()
        if rows:
            for row, total in zip(rows, self.crew.added(self.control.totals[rows]), strict=True):
                values[row] = rounded(total)
            for of, to in getattr(self._part.contact, "copies", ()):
                values[to : to + 3] = values[of : of + 3]

    def _largest(self, count: int, _: int) -> None:
        self.crew.largest(self.control.answer[:count])

    def _number(self, number: int, _: int) -> int:
        return int(self.crew.added(np.array([number]))[0])

    _answers: ClassVar[dict[int, Callable]] = {
        SWEEP: _go_on, NEXT: _go_on, GIVE: _give, TAKE: _take, TOTALS: _totals,
        LARGEST: _largest, NUMBER: _number,
    }  # fmt: skip

    # --- state that can be returned to ------------------------------------------------------------

    def snapshot(self, before: Any = None) -> dict[str, np.ndarray]:
        """Have every process keep its present state; what the first keeps.

        Where a file to go on from has to hold it, that is the whole.
        """
        if self.hub.running.halve:
            return super().snapshot(before)
        self._see_parts()
        return self._together("keep")

    def keep(self) -> dict[str, np.ndarray]:
        """Copy every array of the part that a step changes."""
        self._kept = {name: array.copy() for name, array in changing(self._parted)}
        self._kept |= {
            "values": self.control.values.copy(), "cuts": self._parted.tiles.cuts
        }  # fmt: skip
        return self._kept

    def restore(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a snapshot, all processes together."""
        if self.hub.running.halve:
            super().restore(snapshot)
            return
        self._together("go_back")
        self._shown = False
        self.version += 1
        self._handed_out = self.version

    def go_back(self) -> None:
        """Put back what was kept."""
        s, tiles, kept = self._part, self._parted.tiles, self._kept
        spans = used(s.spans)[1:].copy()
        tiles.empty_nodes(s)
        tiles.cut(kept["cuts"])
        self._put({name: array.copy() for name, array in kept.items()})
        for name, array in changing(self._parted):
            array[...] = kept[name]
        self.control.values[:] = kept["values"]
        for marks in remembered_at(self._parted, spans):
            marks[np.abs(marks) > self.step] = 0


def _like(nodes: Nodes) -> Nodes:
    """Nodes of the same kind, zero."""
    fields = tuple(type(one)(np.zeros_like(one.array)) for one in nodes.fields)
    return Nodes(*(np.zeros_like(array) for array in nodes[:-1]), fields)


def _share(k: int, block: Block, own: np.ndarray) -> dict[str, np.ndarray]:
    """The points and tiles of the k-th block in tiles of which `own` says so, by name."""
    tiling = block.tiling
    which = np.flatnonzero(own[occupied(tiling)[0]])
    ranges = tiling.range[which]
    points = between(*ranges.T)
    found = {
        f"points/{k}/{name}": np.take(array, points, axis=-1)
        for name, array in arrays_of(block.points)
    }
    rows = {name: getattr(tiling, name)[which] for name in ROWS}
    rows["range"] = one_after_another(ranges)
    rows["count"] = np.array([len(which), *tiling.count[1:]])
    rows["share"] = shares_of(rows["range"], int(tiling.count[1]), len(tiling.share))
    return found | {f"tiling/{k}/{name}": array for name, array in rows.items()}


def _stripped(found: dict[str, np.ndarray], stem: str) -> dict[str, np.ndarray]:
    """What has a name that begins so, without that."""
    return {n.removeprefix(stem): array for n, array in found.items() if n.startswith(stem)}


def _joint(tilings: list[dict[str, np.ndarray]], name: str) -> np.ndarray:
    """Rows of the tiles of all processes, one process after another."""
    return np.concatenate([part[name][: part["count"][0]] for part in tilings])


def _by_tile(tilings: list[dict[str, np.ndarray]]) -> np.ndarray:
    """The order of tiles for points that stand one process after another."""
    ranges = one_after_another(_joint(tilings, "range"))
    return between(*ranges[np.argsort(_joint(tilings, "number"))].T)


def _join_tilings(tiling: Tiling, tilings: list[dict[str, np.ndarray]]) -> None:
    """The tiles of all processes, in the order of their numbers."""
    order = np.argsort(_joint(tilings, "number"))
    tiling.count[0] = len(order)
    names = [name for name in (*ROWS, "report") if name in tilings[0]]
    rows = {name: _joint(tilings, name)[order] for name in names}
    ranges = one_after_another(rows["range"])
    if "report" in rows:
        # Points that went wrong keep their place in their tile.
        wrong = rows["report"][:, 2] > 0
        rows["report"][wrong, 2] += (ranges - rows["range"])[wrong, 0]
    for name, array in (rows | {"range": ranges}).items():
        getattr(tiling, name)[: len(order)] = array
    tiling.share[:] = shares_of(ranges, int(tiling.count[1]), len(tiling.share))
