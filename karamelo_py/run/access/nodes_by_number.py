"""Nodes in the order of their numbers, so many at a time, for output."""

from collections.abc import Iterable, Iterator

import numpy as np

from karamelo_py.kernels.arrays import MASS, Setup
from karamelo_py.output.fields import PIECE
from karamelo_py.output.node_columns import NodeRows, brought, loaded, places_of
from karamelo_py.run.checkpoint.arrays import kept_at_nodes, of_nodes
from karamelo_py.run.tiles.boxes import numbers


class ByNumber:
    """The nodes of a scene."""

    setup: Setup

    def node_pieces(self, names: Iterable[str], *, to_first: bool = False) -> Iterator[NodeRows]:
        """All nodes, so many at a time, with the sums over points that have these names.

        With `to_first`, of several processes the first alone gets them.
        """
        self.show_on_nodes()
        self.bring(names)
        kept = kept_at_nodes(self.setup)
        if self.subdomain is not None:
            self.subdomain.share_kept()
        gather = self.comm.gather if to_first else self.comm.allgather
        for first, end in self.node_ranges():
            if self.comm.size == 1:
                arrays = {name: array[first:end] for name, array in of_nodes(self.setup)}
                sums = {name: of[first:end] for name, of in self._brought.items()}
            else:
                parts = gather(self._rows_between(first, end))
                if parts is None:
                    continue
                arrays, sums = self._joined(first, end, parts)
                arrays |= {f"nodes/{name}": array[first:end] for name, array in kept}
            sums = {name: of.sum(axis=1) for name, of in sums.items()}
            yield NodeRows(first, end, self.kin, arrays, sums, self._loaded)
        self.bring(())

    def _rows_between(self, first: int, end: int) -> tuple:
        """The nodes from `first` to before `end`: what of them others do not show, and sums."""
        own, used = (
            nodes[slice(*np.searchsorted(nodes, (first, end)))]
            for nodes in (self.counted(), numbers(self.setup.spans))
        )
        rows = [array[own] for _, array in of_nodes(self.setup)]
        return own, rows, used, {name: of[used] for name, of in self._brought.items()}

    def _joined(self, first: int, end: int, parts: list[tuple]) -> tuple[dict, dict]:
        """The same of all nodes from those of all processes."""
        kinds = of_nodes(self.setup)
        arrays = {n: np.zeros((end - first, *a.shape[1:]), a.dtype) for n, a in kinds}
        sums = {name: np.zeros((end - first, 2)) for name in self._brought}
        for own, rows, used, given in parts:
            for array, found in zip(arrays.values(), rows, strict=True):
                array[own - first] = found
            for name, of in given.items():
                sums[name][used - first] += of
        return arrays, sums

    def bring(self, names: Iterable[str]) -> None:
        """Keep the sums over the points at hand that have these names."""
        self._brought = {name: brought(self, name) for name in names}
        self._loaded = loaded(self.hub, self) if self._brought else {}

    def node_ranges(self) -> Iterator[tuple[int, int]]:
        """The numbers of pieces, from and to, one after another."""
        count = self.hub.fields.node_count
        for first in range(0, count, PIECE):
            yield first, min(first + PIECE, count)

    def counted(self) -> np.ndarray:
        """The numbers of the nodes in use, of each at one process."""
        if self.subdomain is not None:
            return self.subdomain.counted()
        return numbers(self.setup.spans)

    def nodes_with_mass(self) -> np.ndarray:
        """The numbers of those with mass."""
        nodes = self.counted()
        return nodes[self.setup.nodes.sums[nodes, MASS] > 0]

    def mass_at_nodes(self, ID: str) -> np.ndarray:
        """(4,) the mass of the nodes of a group, and this times x, y and z; rounded once."""
        nodes = np.intersect1d(
            self.nodes_with_mass(), self.hub.groups[ID].members, assume_unique=True
        )
        mass = self.setup.nodes.sums[nodes, MASS].astype(float)
        ones = np.ones(len(nodes))
        return self.summed(mass[:, None] * np.column_stack([ones, places_of(self.hub, nodes)]))

    def occupied_nodes(self) -> tuple[int, int]:
        """Count the nodes that have mass, and find the last of them."""
        there = self.nodes_with_mass()
        count = self.comm.allreduce(np.array([len(there)]))
        return int(count[0]), int(
            self.comm.allreduce_max(np.array([there.max(initial=-1)], float))[0]
        )
