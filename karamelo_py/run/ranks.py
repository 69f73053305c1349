"""A scene stepped by several processes, with the bits of one.

All processes carry out the script, up to a run. There the first leads: it does what a single
process does, and has the others step with it. Each has the points of its tiles. What is to be seen
between two steps by what knows nothing of parts (most computes, pictures, files to go on from) the
first gathers into the arrays of a whole scene, and hands out anew where something has changed them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from enum import Enum, auto
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import Block, Setup, arrays_of
from karamelo_py.kernels.totals import WORK
from karamelo_py.output.node_columns import NodeRows
from karamelo_py.run.answers import reads_totals
from karamelo_py.run.by_id import ById, Piece
from karamelo_py.run.gathering import join, lined_up, spread
from karamelo_py.run.leading import Abandoned, At, HandedOutAnew, Leading, by_all
from karamelo_py.run.lowering import State, lower
from karamelo_py.run.part import Part
from karamelo_py.run.shares import joined, sized, work_of
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.state import Stored, check_points, of_nodes, opened, take_known
from karamelo_py.run.storing import own_share, stored, take_nodes, tilings_of
from karamelo_py.run.tiles import DIRECT_UP_TO, Tiles, in_tiles, numbers
from karamelo_py.scene.hub import Hub

CHANGING = ("advance", "set_initial")  # what changes the points


class Held(Enum):
    """Who has the present state."""

    NOBODY = auto()  # there are no points yet: each process makes those of a share in a run
    PARTS = auto()
    WHOLE = auto()  # and perhaps the parts, too


class Ranks(Leading):
    """The arrays of a scene that several processes share."""

    def __init__(self, hub: Hub, previous: Ranks | None = None):
        self._whole: Setup | None = None
        self._held = Held.WHOLE
        self._handed_out = -1  # the version of the whole that the parts have
        self._stepping = False  # arrays are those of the part
        super().__init__(hub, previous)
        if previous is None:
            self._held = Held.NOBODY
        self.part = Part(self.crew, hub, self._whole, self.count)

    # --- the whole --------------------------------------------------------------------------------

    @property
    def setup(self) -> Setup:
        """The whole scene. It is gathered first where steps were taken since."""
        if self._held is Held.NOBODY and self._leading:
            self._see_parts()
        elif self._held is Held.NOBODY:
            # Before the first run a script asks for the points: of all processes alike.
            whole, self.tiles = lower(self.hub)
            self._whole = whole._replace(control=self.control, contact=self.contact)
            self._held = Held.WHOLE
        if self._held is not Held.WHOLE:
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
        return self.part.setup if self._stepping else self.setup

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
            self.part.sort()
        else:
            super().sort()
            self._handed_out = -1

    def _lowered(self, state: State | None) -> tuple[Setup, Tiles]:
        return lower(self.hub, state, ids=None if state is not None else (0, 1))

    @property
    def processes(self) -> dict[str, str]:
        """What a banner says of those that share the scene."""
        alone = f", one has all points: up to {DIRECT_UP_TO} are not shared out"
        return {"processes": f"{self.crew.size}{alone if self.tiles.direct else ''}"}

    # --- before steps -----------------------------------------------------------------------------

    def prepare(self, begun: list[str]) -> None:
        """Make ready for the steps of a run: the hooks of the fixes that are left to act."""
        self.begun = begun
        self._make_ready()

    def _see_prepared(self) -> None:
        """Have all that follow made ready."""
        if self._at is At.LEADING:
            self._tell("prepare", self.begun)
            self._at = At.READY

    @property
    def _at_hand(self) -> bool:
        """Whether the points that are asked about are at hand: own ones in steps, or all."""
        return self._stepping or self._held is Held.WHOLE or not self._leading

    # --- handing out and gathering ----------------------------------------------------------------

    def _settle(self) -> None:
        """See that all processes have the state that the run has ended with."""
        if self._held is not Held.NOBODY:
            self._see_parts()

    def _part_with_whole(self) -> None:
        """From here on no process has what only the first has gathered."""
        if self._held is not Held.NOBODY:
            self._let_go()

    def _let_go(self) -> None:
        """From here on the parts alone have the present state."""
        self._held = Held.PARTS
        self._whole = self._whole._replace(
            blocks=tuple(b._replace(points=sized(b.points, 0)) for b in self._whole.blocks)
        )

    def _see_parts(self) -> None:
        """Hand out the whole where the parts do not have its present state."""
        if self._handed_out == self.version:
            return
        if self._held is Held.NOBODY:
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
        """Share the tiles of the whole out: whose they are; nodes, and what these remember."""
        tiles = self.part.tiles
        tiles.share_out(work_of(tiles.loads(self._whole.blocks), self.part.work.costs))
        nodes = numbers(self._whole.spans)
        return tiles.owner, nodes, [one[nodes] for one in self.part.memory()]

    def _shares(self) -> list[dict[str, np.ndarray]]:
        """What each process has of the whole."""
        return [self.part.share_of(self._whole, rank) for rank in range(self.crew.size)]

    def fill(self) -> None:
        """Make the points of a share of the ids, and hand them over to whose tiles they are in."""
        rank, size = self.crew.rank, self.crew.size
        found, _ = lower(self.hub, ids=(self.count * rank // size, self.count * (rank + 1) // size))
        self.part.fill(found.blocks)
        self._held = Held.PARTS

    def take(
        self, owner: np.ndarray, nodes: np.ndarray, memory: list, shares: list | None = None
    ) -> None:
        """Take the own tiles from what the first hands out."""
        found = self.crew.handed_out(shares)
        self.part.tiles.owner = owner
        self.part.tiles.empty_nodes(self.part.setup)
        for one, rows in zip(self.part.memory(), memory, strict=True):
            one[nodes] = rows
        if not self.crew.leads:
            self.control.totals[WORK] = 0
        self.part.put(found)

    def gather(self, *, everywhere: bool = False) -> None:
        """Put the parts of all together, at the first process, or everywhere."""
        found = self.part.shown() | {"work": self.control.totals[WORK].copy()}
        parts = self.crew.everyone(found) if everywhere else self.crew.gathered(found)
        self.control.totals[WORK] = 0
        if self.crew.leads:
            self.control.totals[WORK] = sum(part["work"] for part in parts)
        self._held = Held.WHOLE
        blocks = lined_up(self.crew, self._whole.blocks, self.part.setup.blocks, parts)
        if everywhere:
            blocks = spread(self.crew, blocks)
        self._whole = self._whole._replace(blocks=blocks)
        if parts is not None:
            join(self._whole, self.tiles, self.part.memory(), parts)

    def pieces(self) -> Iterator[ById]:
        """All points, so many at a time: not even the first needs the memory of all."""
        if self._held is Held.WHOLE or not self._leading:
            yield from super().pieces()
            return
        for first, end in self.ranges():
            parts = self._together("give_piece", first, end)
            blocks = zip(self.blocks, zip(*parts, strict=True), strict=True)
            yield Piece(
                self, first, end, self.part.setup,
                (b._replace(points=joined(b.points, found)) for b, found in blocks),
            )  # fmt: skip

    def give_piece(self, first: int, end: int) -> list | None:
        """Own points with ids from `first` to before `end`, for the first process those of all."""
        return self.crew.gathered(self.part.piece(first, end, last=end == self.count))

    def node_pieces(self, names: Iterable[str]) -> Iterator[NodeRows]:
        """All nodes, so many at a time: not even the first needs the memory of all."""
        if self._held is Held.WHOLE or not self._leading:
            yield from super().node_pieces(names)
            return
        self.show_on_nodes()
        self._all_do("bring", tuple(names))
        kinds = list(of_nodes(self._whole))
        for first, end in self.node_ranges():
            arrays = {n: np.zeros((end - first, *a.shape[1:]), a.dtype) for n, a in kinds}
            sums = {name: np.zeros((end - first, 2)) for name in self._brought}
            for own, rows, used, given in self._together("give_nodes", first, end):
                for array, found in zip(arrays.values(), rows, strict=True):
                    array[own - first] = found
                for name, of in given.items():
                    sums[name][used - first] += of
            yield self._rows(first, end, arrays, sums)
        self._all_do("bring", ())

    map_to_nodes = by_all(Simulation.map_to_nodes)
    occupied_nodes = by_all(Simulation.occupied_nodes)

    def counted(self) -> np.ndarray:
        """The numbers of the nodes in use, of each at one process."""
        return self.part.counted() if self._stepping else super().counted()

    def give_nodes(self, first: int, end: int) -> list | None:
        """Own nodes with numbers from `first` to before `end`, for the first those of all."""
        return self.crew.gathered(self.part.node_rows(first, end, self._brought))

    def stored(self) -> Iterator[Stored]:
        """What a file to go on from holds: not even the first needs the memory of all."""
        return stored(self) if self.apart else super().stored()

    def take_stored(self, path: Path) -> None:
        """Take the state that a file holds: each process reads its own share."""
        if not self._leading:
            super().take_stored(path)
            return
        with opened(path) as state:
            take_known(self, state)
            blocks = self.part.setup.blocks
            for k, block in enumerate(blocks):
                check_points(block.points, state, f"points/{k}/")
            tiles = self.part.tiles
            tilings = tilings_of(tiles, len(blocks), state)
            whole = [b._replace(tiling=of) for b, of in zip(blocks, tilings, strict=True)]
            tiles.share_out(work_of(tiles.loads(whole), self.part.work.costs))
        self._together("read", path, tiles.owner)
        self._handed_out = self.version

    def read(self, path: Path, owner: np.ndarray) -> None:
        """Take the own share of the state that a file holds."""
        part = self.part
        with opened(path) as state:
            part.tiles.owner = owner
            part.tiles.empty_nodes(part.setup)
            part.put(own_share(part, state))
            reached = zip(*self.crew.everyone(part.tiles.reached), strict=True)
            take_nodes(part, state, part.tiles.spans_of(*map(np.concatenate, reached)))
            self.present[:] = state["present"][()]
        if not self.crew.leads:
            self.control.totals[WORK] = 0
        self._let_go()

    @property
    def apart(self) -> bool:
        """Whether the parts alone have the present state, between two runs."""
        return self._held is Held.PARTS

    def together(self, what: str, *arguments: Any) -> Any:
        """What methods of all processes find, for the first."""
        return self._together("tell", what, *arguments)

    def tell(self, what: str, *arguments: Any) -> list | None:
        """What the own part finds, for the first that of all."""
        return self.crew.gathered(getattr(self.part, what)(*arguments))

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
            part = self.part
            from_python = self._python.by_stage or self._first is not None
            part.answers.at_once = bool(from_python) or reads_totals(self.hooks)
            part.begin()
            status = super().advance(count)
            part.account()
            part.answers.publish()
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

    def added_up(self, part: Any, name: str, *arguments: Any) -> np.ndarray:
        """Sums over the points of a part's group of what its method `name` says."""
        if self._at_hand:
            return super().added_up(part, name, *arguments)
        return self._all_do("ask", "added_up", *self._named(part), name, *arguments)

    def each(self, part: Any, name: str) -> list:
        """What a method of a part says of some points of its group after others."""
        if self._at_hand:
            found = super().each(part, name)
            return self.crew.gathered(found) if self._stepping else found
        found = self._all_do("ask", "each", *self._named(part), name)
        return [one for of_rank in found for one in of_rank]

    def ask(self, what: str, family: str, ID: str, *arguments: Any) -> Any:
        """Call `added_up` or `each` with a part of the scene."""
        return getattr(self, what)(self._catalogues[family][ID], *arguments)

    def _named(self, part: Any) -> tuple[str, str]:
        """What a part is called at other processes."""
        found = (kind for kind, all in self._catalogues.items() if all.get(part.id) is part)
        return next(found), part.id

    @property
    def _catalogues(self) -> dict[str, Any]:
        return {catalogue.kind: catalogue for catalogue in self.hub.catalogues}

    def of_all(self, numbers: np.ndarray) -> np.ndarray:
        """Sums over all processes, where each looks at its part."""
        return self.crew.added(numbers) if self._stepping else numbers

    def most(self, numbers: np.ndarray) -> np.ndarray:
        """The largest of each number of all processes, where each looks at its part."""
        return self.crew.largest(numbers) if self._stepping else numbers

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
            self._at = At.LEADING  # the others know
            raise
        self._stepping = True
        now = self.control.values, self.control.clock.view(np.ndarray)
        if self.tiles.sorts > sorts:
            return "take", *now, *self._cut()
        nodes = numbers(self._whole.spans)
        return "take_back", *now, nodes, [array[nodes] for _, array in of_nodes(self._whole)]

    def take_back(self, nodes: np.ndarray, rows: list, shares: list | None = None) -> None:
        """Put what the first has changed into the arrays that a step is at work on."""
        s, found = self.part.setup, self.crew.handed_out(shares)
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
        return self.part.keep()

    def restore(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a snapshot, all processes together."""
        if self.hub.running.halve:
            super().restore(snapshot)
            return
        self._together("go_back")
        self._held = Held.PARTS
        self.version += 1
        self._handed_out = self.version

    def go_back(self) -> None:
        """Put back what was kept."""
        self.part.go_back()
