"""Access to the nodes of a simulation by their numbers: all at once, or in batches."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np

from karamelo_py.kernels.arrays import MASS
from karamelo_py.output.fields import Fields, ranges
from karamelo_py.output.node_columns import BROUGHT, NodeTable, brought, loaded, places_of
from karamelo_py.run.boxes import numbers
from karamelo_py.run.checkpoint.arrays import kept_at_nodes, of_nodes, rows_at
from karamelo_py.scene.group import NodeGroup


class NodesByNumber:
    def __init__(self, points: Fields):
        self.points, self.simulation = points, points.simulation

    def pieces(self, names: Iterable[str], *, to_first: bool = False) -> Iterator[NodeTable]:
        simulation, hub, comm = self.simulation, self.points.hub, self.points.comm
        simulation.show_on_nodes()
        s = simulation.setup
        sums = {name: brought(simulation, name) for name in names if name in BROUGHT}
        weights = loaded(hub, simulation) if sums else {}
        kept = kept_at_nodes(s)
        simulation.domain.share_kept()
        gather = comm.gather if to_first else comm.allgather
        for first, end in ranges(hub.fields.node_count):
            if comm.size == 1:
                arrays = {name: array[first:end] for name, array in of_nodes(s)}
                totals = {name: of[first:end] for name, of in sums.items()}
            else:
                rows = rows_at(simulation, np.arange(first, end), gather)
                totals = self._sums_between(first, end, sums, gather)
                if rows is None:
                    continue
                arrays = rows | {f"nodes/{name}": array[first:end] for name, array in kept}
            totals = {name: of.sum(axis=1) for name, of in totals.items()}
            yield NodeTable(hub, np.arange(first, end), s.kin, arrays, totals, weights)

    def _sums_between(self, first: int, end: int, sums: dict, gather: Callable) -> dict:
        nodes = numbers(self.simulation.setup.spans)
        used = nodes[slice(*np.searchsorted(nodes, (first, end)))]
        totals = {name: np.zeros((end - first, 2)) for name in sums}
        for used_there, parts in gather((used, [of[used] for of in sums.values()])) or ():
            for total, of in zip(totals.values(), parts, strict=True):
                total[used_there - first] += of
        return totals

    def with_mass(self) -> np.ndarray:
        nodes = self.simulation.domain.counted()
        return nodes[self.simulation.setup.nodes.sums[nodes, MASS] > 0]

    def mass_of(self, group: NodeGroup) -> np.ndarray:
        self.simulation.show_on_nodes()
        hub = self.points.hub
        nodes = np.intersect1d(self.with_mass(), hub.groups[group.id].members, assume_unique=True)
        mass = self.simulation.setup.nodes.sums[nodes, MASS].astype(float)
        places = np.column_stack([np.ones(len(nodes)), places_of(hub, nodes)])
        return self.points.summed(mass[:, None] * places)

    def occupied(self) -> tuple[int, int]:
        self.simulation.show_on_nodes()
        nodes, comm = self.with_mass(), self.points.comm
        count = comm.allreduce(np.array([len(nodes)]))
        last = comm.allreduce_max(np.array([nodes.max(initial=-1)], float))
        return int(count[0]), int(last[0])
