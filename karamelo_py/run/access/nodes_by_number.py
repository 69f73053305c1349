"""Nodes in the order of their numbers, so many at a time, for output."""

from collections.abc import Iterable, Iterator

import numpy as np

from karamelo_py.kernels.arrays import MASS, Setup
from karamelo_py.output.fields import PIECE
from karamelo_py.output.node_columns import NodeRows, brought, loaded
from karamelo_py.run.checkpoint.arrays import of_nodes
from karamelo_py.run.tiles.boxes import numbers


class ByNumber:
    """The nodes of a scene."""

    setup: Setup
    stepped: Setup

    def node_pieces(self, names: Iterable[str]) -> Iterator[NodeRows]:
        """All nodes, so many at a time, with the sums over points that have these names."""
        self.show_on_nodes()
        whole = dict(of_nodes(self.setup))
        self.bring(names)
        for first, end in self.node_ranges():
            arrays = {name: array[first:end] for name, array in whole.items()}
            sums = {name: of[first:end] for name, of in self._brought.items()}
            yield self._rows(first, end, arrays, sums)
        self.bring(())

    def bring(self, names: Iterable[str]) -> None:
        """Keep the sums over the points at hand that have these names."""
        self._brought = {name: brought(self, name) for name in names}
        self._loaded = loaded(self.hub, self) if self._brought else {}

    def _rows(self, first: int, end: int, arrays: dict, sums: dict) -> NodeRows:
        sums = {name: of.sum(axis=1) for name, of in sums.items()}
        return NodeRows(first, end, self.kin, arrays, sums, self._loaded)

    def node_ranges(self) -> Iterator[tuple[int, int]]:
        """The numbers of pieces, from and to, one after another."""
        count = self.hub.fields.node_count
        for first in range(0, count, PIECE):
            yield first, min(first + PIECE, count)

    def counted(self) -> np.ndarray:
        """The numbers of the nodes in use, of each at one process."""
        return numbers(self.stepped.spans)

    def nodes_with_mass(self) -> np.ndarray:
        """The numbers of those with mass."""
        nodes = self.counted()
        return nodes[self.stepped.nodes.sums[nodes, MASS] > 0]

    def mass_at_nodes(self, ID: str) -> np.ndarray:
        """(4,) the mass of the nodes of a group, and this times x, y and z; rounded once."""
        nodes = np.intersect1d(
            self.nodes_with_mass(), self.hub.groups[ID].members, assume_unique=True
        )
        mass = self.stepped.nodes.sums[nodes, MASS].astype(float)
        ones = np.ones(len(nodes))
        return self.summed(mass[:, None] * np.column_stack([ones, self.places_of(nodes)]))

    def places_of(self, nodes: np.ndarray) -> np.ndarray:
        """(n, 3) positions of nodes, of ascending numbers."""
        x = np.empty((len(nodes), 3))
        for lattice in self.hub.lattices:
            ends = lattice.first, lattice.first + lattice.node_count
            rows = slice(*np.searchsorted(nodes, ends))
            x[rows] = lattice.positions(nodes[rows])
        return x

    def occupied_nodes(self) -> tuple[int, int]:
        """How many nodes have mass, and the last of them."""
        there = self.nodes_with_mass()
        count = self.of_all(np.array([len(there)]))
        return int(count[0]), int(self.most(np.array([there.max(initial=-1)], float))[0])
