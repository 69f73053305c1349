"""Who has the present state of a scene that processes share; handing it out and gathering it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from enum import Enum, auto
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import Block, Setup
from karamelo_py.kernels.totals import WORK
from karamelo_py.output.node_columns import NodeRows
from karamelo_py.run.access.points_by_id import ById, Piece
from karamelo_py.run.checkpoint.arrays import Stored, check_points, of_nodes, opened, take_known
from karamelo_py.run.checkpoint.part_state import own_share, stored, take_nodes, tilings_of
from karamelo_py.run.lower.build import State, lower
from karamelo_py.run.mpi.gather import join, lined_up, spread
from karamelo_py.run.mpi.leading import Leading, by_all
from karamelo_py.run.mpi.partition import joined, sized, work_of
from karamelo_py.run.mpi.subdomain import Part
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.tiles.boxes import numbers
from karamelo_py.run.tiles.tiles import DIRECT_UP_TO, Tiles, in_tiles
from karamelo_py.scene.hub import Hub


class Held(Enum):
    """Who has the present state."""

    NOBODY = auto()  # there are no points yet: each process makes those of a share in a run
    PARTS = auto()
    WHOLE = auto()  # and perhaps the parts, too


class Holding(Leading):
    """The arrays of a scene that several processes share: the whole at the first, or parts."""

    def __init__(self, hub: Hub, previous: Holding | None = None):
        self._whole: Setup | None = None
        self._held = Held.WHOLE
        self._handed_out = -1  # the version of the whole that the parts have
        self._stepping = False  # arrays are those of the part
        super().__init__(hub, previous)
        if previous is None:
            self._held = Held.NOBODY
        self.part = Part(self.crew, hub, self._whole, self.count)
        self.part.tiles.threads, self.part.tiles.mode = self.threads, self.mode

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

    @stepped.setter
    def stepped(self, s: Setup) -> None:
        if self._stepping:
            self.part.setup = s
        else:
            self.setup = s

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
    def _at_hand(self) -> bool:
        """Whether the points that are asked about are at hand: own ones in steps, or all."""
        return self._stepping or self._held is Held.WHOLE or not self._leading

    @property
    def processes(self) -> dict[str, str]:
        """What a banner says of those that share the scene."""
        alone = f", one has all points: up to {DIRECT_UP_TO} are not shared out"
        return {"processes": f"{self.crew.size}{alone if self.tiles.direct else ''}"}

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
    mass_at_nodes = by_all(Simulation.mass_at_nodes)

    def counted(self) -> np.ndarray:
        """The numbers of the nodes in use, of each at one process."""
        return self.part.counted() if self._stepping else super().counted()

    def give_nodes(self, first: int, end: int) -> list | None:
        """Own nodes with numbers from `first` to before `end`, for the first those of all."""
        return self.crew.gathered(self.part.node_rows(first, end, self._brought))

    def stored_snapshot(self, snapshot: dict[str, np.ndarray]) -> Iterator[Stored]:
        """What such a file holds of the state that each process has kept."""
        return stored(self, kept=True)

    def take_snapshot(self, path: Path) -> dict[str, np.ndarray]:
        """Keep the state that a file holds beside the present one; what the first keeps."""
        with opened(path, "good") as found:
            owner = self._owner_in(found)
        return self._together("read_snapshot", path, owner)

    def read_snapshot(self, path: Path, owner: np.ndarray) -> dict[str, np.ndarray]:
        """Keep the own share of it."""
        with opened(path, "good") as found:
            self.part.kept = own_share(self.part, found, owner)
        return self.part.kept

    def stored(self) -> Iterator[Stored]:
        """What a file to go on from holds: not even the first needs the memory of all."""
        return stored(self) if self.apart else super().stored()

    def take_stored(self, path: Path) -> None:
        """Take the state that a file holds: each process reads its own share.

        In a run the first has the others do it; between two runs all come to it.
        """
        with opened(path) as state:
            take_known(self, state)
            for k, block in enumerate(self.part.setup.blocks):
                check_points(block.points, state, f"points/{k}/")
            owner = self._owner_in(state)
        if self._leading:
            self._together("read", path, owner)
        else:
            with self.crew.joint():
                self.read(path, owner)
        self._handed_out = self.version

    def _owner_in(self, state: Mapping) -> np.ndarray:
        """Who is to have each tile of the points that a file holds."""
        tiles, blocks = self.part.tiles, self.part.setup.blocks
        tilings = tilings_of(tiles, len(blocks), state)
        whole = [b._replace(tiling=of) for b, of in zip(blocks, tilings, strict=True)]
        before = tiles.owner
        tiles.share_out(work_of(tiles.loads(whole), self.part.work.costs))
        owner, tiles.owner = tiles.owner, before
        return owner

    def read(self, path: Path, owner: np.ndarray) -> None:
        """Take the own share of the state that a file holds."""
        with opened(path) as state:
            self.part.restore(own_share(self.part, state, owner))
            take_nodes(self.part, state)
            self.present[:] = state["present"][()]
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
