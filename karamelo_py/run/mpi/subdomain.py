"""What one of several processes has of a scene: its points, and the nodes that they reach."""

from typing import Any

import numpy as np

from karamelo_py.compiler.fields import records
from karamelo_py.kernels.arrays import TIMESTEP, Block, Nodes, Setup, arrays_of
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.ranks import Linked
from karamelo_py.run.access.points_by_id import Ordered
from karamelo_py.run.checkpoint.arrays import (
    changing,
    copied,
    of_nodes,
    remembered_at,
    restore,
    take_points,
    take_tiling,
    touched,
)
from karamelo_py.run.checkpoint.part_state import points_of_tiles
from karamelo_py.run.mpi.callbacks import Answers
from karamelo_py.run.mpi.crew import Crew
from karamelo_py.run.mpi.load import Work
from karamelo_py.run.mpi.pack import by_tile, join_tilings, share_of, stripped
from karamelo_py.run.mpi.partition import SharedTiles, nodes_of, occupied, work_of
from karamelo_py.run.tiles.boxes import numbers
from karamelo_py.run.tiles.buffers import no_nodes
from karamelo_py.run.tiles.tiles import in_use
from karamelo_py.run.timestep import sparse
from karamelo_py.scene.hub import Hub

LEARN_EVERY = 100  # steps from output to output, after which it is seen how work is shared


class Part:
    """The arrays of this process: as much of a simulation as its state asks for.

    Attributes
    ----------
    setup, tiles, hub
        As of a simulation; of the points there are those in own tiles.
    work
        What points and nodes cost here.
    answers
        What kernels ask for.
    kept
        Copies of a state that can be returned to.
    """

    def __init__(self, crew: Crew, hub: Hub, s: Setup, count: int):
        self.crew, self.hub = crew, hub
        method = hub.update.method
        one_place = method.fields_per_solid
        self.tiles = tiles = SharedTiles(
            crew, method.lattices(hub), s.basis, count, sparse(hub), one_place=one_place
        )
        nodes, heat = _like(s.nodes), s.heat
        buffers = tiles.empty_buffers(nodes, len(s.blocks))
        if isinstance(heat, Conducting):
            at_nodes = _like(heat.nodes)
            heat = Conducting(at_nodes, tiles.empty_buffers(at_nodes, len(s.blocks)))
        self.work = Work(len(s.blocks))
        self.answers = Answers(crew, s.control, self.work)
        self.answers.part = self
        control = s.control._replace(ranks=Linked(self.answers.address, tiles.foreign))
        self.setup = s._replace(
            blocks=tuple(block._replace(tiling=tiles.empty_tiling()) for block in s.blocks),
            nodes=nodes, heat=heat, buffers=buffers, **no_nodes(), control=control,
        )  # fmt: skip
        self.kept: dict[str, np.ndarray] = {}
        self._ordered: list[Ordered] = []  # points by id, while pieces of all are looked at
        self._counted_at = self._learned_at = self.step

    @property
    def step(self) -> int:
        """Number of steps taken."""
        return int(self.setup.control.values[TIMESTEP])

    # --- points -----------------------------------------------------------------------------------

    def fill(self, blocks: tuple[Block, ...]) -> None:
        """Hand over these points to whose tiles they are in, and take those of others."""
        own = zip(self.setup.blocks, blocks, strict=True)
        made = tuple(mine._replace(points=block.points) for mine, block in own)
        self.setup = self.tiles.migrate(self.setup._replace(blocks=made), self.work.costs)
        self.tiles.sort(self.setup)

    def sort(self) -> None:
        """Sort the points by tile, and hand over those that have left the own ones."""
        self.tell_what_touched()
        self.account()
        self.setup = self.tiles.migrate(self.setup, self.learn())
        self.tiles.sort(self.setup)

    def share_of(self, s: Setup, rank: int) -> dict[str, np.ndarray]:
        """The points and tiles that a process is to have of those in `s`, by name."""
        return share_of(s, self.tiles.owner == rank)

    def put(self, found: dict[str, np.ndarray]) -> None:
        """Let the part have these points and tiles."""
        s, tiles = self.setup, self.tiles
        blocks = tuple(
            Block(
                take_points(block.points, found, f"points/{k}/"),
                block.laws,
                take_tiling(block.tiling, found, f"tiling/{k}/"),
            )
            for k, block in enumerate(s.blocks)
        )
        self.setup = s._replace(blocks=blocks)
        tiles.lay_out(self.setup)

    def memory(self) -> list[np.ndarray]:
        """What contact remembers of every node."""
        nodes = len(self.tiles.foreign)
        return remembered_at(self, np.array([[0, nodes]]))

    def tell_what_touched(self) -> None:
        """All learn where contact acted in the last step: other nodes come to be in use."""
        memory = self.memory()
        if memory:
            own = self.counted()
            own = own[
                np.any([(np.abs(one[own]) == self.step).any(axis=1) for one in memory], axis=0)
            ]
            for nodes, *rows in self.crew.everyone((own, *(one[own] for one in memory))):
                for one, found in zip(memory, rows, strict=True):
                    one[nodes] = found

    def counted(self) -> np.ndarray:
        """The numbers of the nodes in use here that no other process counts."""
        nodes = numbers(self.setup.spans)
        return nodes[self.tiles.foreign[nodes] == 0]

    def tilings(self) -> list[dict[str, np.ndarray]]:
        """The tiles of each block."""
        tilings = [block.tiling for block in self.setup.blocks]
        return [{name: getattr(one, name)[:rows] for name, rows in in_use(one)} for one in tilings]

    def shown(self) -> dict:
        """Tiles and nodes that no other process shows, and how many points there are."""
        s, own = self.setup, self.counted()
        return {
            "counts": [block.points.mass.size for block in s.blocks],
            "tiling": [
                tiling | {"report": block.tiling.report[: block.tiling.count[0]]}
                for tiling, block in zip(self.tilings(), s.blocks, strict=True)
            ],
            "nodes": own,
            "at nodes": [array[own] for _, array in of_nodes(s)],
            "memory": [array[own] for array in self.memory()],
        }

    def state(self, kept: bool) -> dict[str, np.ndarray]:
        """Return the arrays of the present state, or of the one that was kept."""
        return self.kept if kept else dict(changing(self)) | touched(self)

    def tell_of_state(self, kept: bool) -> dict:
        """Tiles, the boxes of nodes that they reach, work done, and where contact acted last."""
        state, blocks = self.state(kept), range(len(self.setup.blocks))
        return {
            "tiling": [stripped(state, f"tiling/{k}/") for k in blocks],
            "reached": None if kept else self.tiles.reached_by(self.setup),
            "work": state["work"].copy(), "touched": stripped(state, "touched/"),
        }  # fmt: skip

    def give_points(self, kept: bool, k: int, first: int, end: int) -> dict[str, Any]:
        """Points of the k-th block in tiles with numbers from `first` to before `end`."""
        state = self.kept if kept else dict(changing(self))
        names = [name for name, _ in arrays_of(self.setup.blocks[k].points)]
        arrays = [state[f"points/{k}/{name}"] for name in names]
        return points_of_tiles(stripped(state, f"tiling/{k}/"), arrays, first, end)

    def give_rows(self, first: int, end: int) -> tuple:
        """Own nodes from `first` to before `end`, and their rows."""
        return self.rows([array for _, array in of_nodes(self.setup)], first, end)

    def node_rows(self, first: int, end: int, sums: dict[str, np.ndarray]) -> tuple:
        """The nodes from `first` to before `end`: what of them others do not show, and `sums`."""
        used = _from_to(numbers(self.setup.spans), first, end)
        rows = self.rows([array for _, array in of_nodes(self.setup)], first, end)
        return *rows, used, {name: of[used] for name, of in sums.items()}

    def rows(self, arrays: list[np.ndarray], first: int, end: int) -> tuple:
        """Numbers of nodes from `first` to before `end` that others do not show, and their rows."""
        own = _from_to(self.counted(), first, end)
        return own, [array[own] for array in arrays]

    def piece(self, first: int, end: int, *, last: bool) -> list[list[np.ndarray]]:
        """The points with ids from `first` to before `end`, block by block; the `last` piece."""
        if first == 0:
            self._ordered = list(map(Ordered, self.setup.blocks))
        own = [one.between(first, end) for one in self._ordered]
        if last:
            self._ordered = []
        return [[array for _, array in arrays_of(block.points)] for block in own]

    # --- work -------------------------------------------------------------------------------------

    def begin(self) -> None:
        """Before steps whose work is measured."""
        self.rebalance()
        self._counted_at = self.step
        self.work.pause()

    def account(self) -> None:
        """Take note of the steps so far; what comes before the next is not counted."""
        blocks = self.setup.blocks
        counts = [block.points.mass.size for block in blocks]
        counts.append(sum(int(nodes_of(block.tiling).sum()) for block in blocks))
        self.work.done(counts, self.step - self._counted_at)
        self._counted_at = self.step
        self.work.pause()

    def learn(self) -> np.ndarray:
        """What points and nodes cost."""
        self._learned_at = self.step
        self.work.learn(self.crew)
        return self.work.costs

    def rebalance(self) -> None:
        """Hand over tiles as they are where that is due: points may never be sorted again."""
        s, tiles = self.setup, self.tiles
        clock = s.control.clock[0]
        sorted_next = clock.drift > clock.drift_limit  # and cut anew then
        due = abs(self.step - self._learned_at) >= LEARN_EVERY
        due = due and not (tiles.direct or sorted_next)
        if not due or not tiles.balance(work_of(tiles.loads(s.blocks), self.learn())):
            return
        self.tell_what_touched()
        own = [tiles.owner[occupied(block.tiling)[0]] for block in s.blocks]
        others = tiles.partners(np.bincount(np.concatenate(own), minlength=self.crew.size))
        given = {rank: self.share_of(s, rank) for rank in others}
        shares = [self.share_of(s, self.crew.rank), *self.crew.traded(given).values()]
        tiles.empty_nodes(s)
        blocks = []
        for k, block in enumerate(s.blocks):
            tilings = [stripped(share, f"tiling/{k}/") for share in shares]
            points = [stripped(share, f"points/{k}/") for share in shares]
            order = by_tile(tilings)
            arrays = {
                name: np.take(
                    np.concatenate([one[name] for one in points], axis=-1), order, axis=-1
                )
                for name in points[0]
            }
            join_tilings(block.tiling, tilings)
            blocks.append(block._replace(points=take_points(block.points, arrays, "")))
        self.setup = s._replace(blocks=tuple(blocks))
        tiles.lay_out(self.setup)

    # --- state that can be returned to ------------------------------------------------------------

    def keep(self) -> dict[str, np.ndarray]:
        """Copy every array that a step changes."""
        self.kept = copied(self, self.kept) | {"owner": self.tiles.owner}
        return self.kept

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Return to a state, and to whose the tiles were."""
        self.tiles.owner = state["owner"]
        restore(self, state)


def _from_to(numbers: np.ndarray, first: int, end: int) -> np.ndarray:
    """Those of ascending numbers from `first` to before `end`."""
    return numbers[slice(*np.searchsorted(numbers, (first, end)))]


def _like(nodes: Nodes) -> Nodes:
    """Nodes of the same kind, zero."""
    fields = tuple(type(one)(records(*one.array.shape, one.array.dtype)) for one in nodes.fields)
    return Nodes(*(records(*array.shape, array.dtype) for array in nodes[:-1]), fields)
