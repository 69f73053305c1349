"""The share of one of several processes in a scene: its work, and points on their way to others."""

from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import TIMESTEP, Block, Setup
from karamelo_py.kernels.ranks import Linked
from karamelo_py.run.checkpoint.arrays import kept_at_nodes, remembered_at, take_points, take_tiling
from karamelo_py.run.mpi.callbacks import Callbacks, reads_totals
from karamelo_py.run.mpi.load import Load
from karamelo_py.run.mpi.pack import by_tile, join_tilings, share_of, stripped
from karamelo_py.run.mpi.partition import SharedTiles, nodes_of, occupied, work_of
from karamelo_py.run.tiles.boxes import numbers

LEARN_EVERY = 100  # steps from output to output, after which it is seen how work is shared


class Subdomain:
    """Keep the share of this process in balance with those of others.

    Attributes
    ----------
    load
        Measured cost of points and nodes.
    callbacks
        Functions that kernels call.
    """

    def __init__(self, simulation: Any):
        self.simulation, self.comm = simulation, simulation.comm
        self.tiles: SharedTiles = simulation.tiles
        s = simulation.setup
        self.load = Load(len(s.blocks))
        self.callbacks = Callbacks(simulation, self.load)
        linked = Linked(self.callbacks.address, self.tiles.foreign)
        simulation.setup = s._replace(control=s.control._replace(ranks=linked))
        self._counted_at = self._learned_at = int(s.control.values[TIMESTEP])

    # --- points -----------------------------------------------------------------------------------

    def migrate(self, s: Setup) -> Setup:
        """Hand over the points that have left the own tiles; they are to be sorted then."""
        self.share_memory()
        self.account()
        return self.tiles.migrate(s, self.learn())

    def put(self, found: dict[str, np.ndarray]) -> None:
        """Take these points and tiles in the place of the own ones."""
        simulation = self.simulation
        blocks = tuple(
            Block(
                take_points(block.points, found, f"points/{k}/"),
                block.laws,
                take_tiling(block.tiling, found, f"tiling/{k}/"),
            )
            for k, block in enumerate(simulation.setup.blocks)
        )
        simulation.setup = simulation.setup._replace(blocks=blocks)
        self.tiles.lay_out(simulation.setup)

    def contact_memory(self) -> list[np.ndarray]:
        """List what contact remembers of every node."""
        return remembered_at(self.simulation, np.array([[0, len(self.tiles.foreign)]]))

    def memory(self) -> list[np.ndarray]:
        """List what is remembered of every node: by contact, and in fields that outlive a step."""
        kept = kept_at_nodes(self.simulation.setup)
        return [*self.contact_memory(), *(array for _, array in kept)]

    def share_memory(self) -> None:
        """Tell all where contact acted in the last step, and kept fields of nodes.

        Other nodes come to be in use.
        """
        own, step, contact = self.counted(), self.simulation.step, self.contact_memory()
        self.share_kept()
        if contact:
            touched = [(np.abs(one[own]) == step).any(axis=1) for one in contact]
            self._share(own[np.any(touched, axis=0)], contact)

    def share_kept(self) -> None:
        """Tell all the fields of the own nodes that outlive a step."""
        if kept := kept_at_nodes(self.simulation.setup):
            self._share(self.counted(), [array for _, array in kept])

    def _share(self, own: np.ndarray, arrays: list[np.ndarray]) -> None:
        for nodes, *rows in self.comm.allgather((own, *(one[own] for one in arrays))):
            for one, found in zip(arrays, rows, strict=True):
                one[nodes] = found

    def counted(self) -> np.ndarray:
        """Number the nodes in use here that no other process counts."""
        nodes = numbers(self.simulation.setup.spans)
        return nodes[self.tiles.foreign[nodes] == 0]

    # --- work -------------------------------------------------------------------------------------

    def begin(self, hooks: Any, *, from_python: bool) -> None:
        """Make ready for steps whose work is measured."""
        self.callbacks.at_once = from_python or reads_totals(hooks)
        self.rebalance()
        self._counted_at = self.simulation.step
        self.load.pause()

    def end(self) -> None:
        """Account for the last steps, and publish what their fixes have added up."""
        self.account()
        self.callbacks.publish()

    def account(self) -> None:
        """Take note of the steps so far; what comes before the next is not counted."""
        blocks, step = self.simulation.setup.blocks, self.simulation.step
        counts = [block.points.mass.size for block in blocks]
        counts.append(sum(int(nodes_of(block.tiling).sum()) for block in blocks))
        self.load.done(counts, step - self._counted_at)
        self._counted_at = step
        self.load.pause()

    def learn(self) -> np.ndarray:
        """Find what points and nodes cost."""
        self._learned_at = self.simulation.step
        self.load.learn(self.comm)
        return self.load.costs

    def rebalance(self) -> None:
        """Hand over tiles as they are where that is due: points may never be sorted again."""
        simulation, tiles = self.simulation, self.tiles
        s = simulation.setup
        clock = s.control.clock[0]
        sorted_next = clock.drift > clock.drift_limit  # and cut anew then
        due = abs(simulation.step - self._learned_at) >= LEARN_EVERY
        due = due and not (tiles.direct or sorted_next)
        if not due or not tiles.balance(work_of(tiles.loads(s.blocks), self.learn())):
            return
        self.share_memory()
        own = [tiles.owner[occupied(block.tiling)[0]] for block in s.blocks]
        others = tiles.partners(np.bincount(np.concatenate(own), minlength=self.comm.size))
        given = {rank: share_of(s, tiles.owner == rank) for rank in others}
        mine = share_of(s, tiles.owner == self.comm.rank)
        shares = [mine, *self.comm.exchange(given).values()]
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
        simulation.setup = s._replace(blocks=tuple(blocks))
        tiles.lay_out(simulation.setup)
