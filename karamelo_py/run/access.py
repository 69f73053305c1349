"""Points by id and nodes by number: all of a scene, or a limited number at a time."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from math import inf
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import MASS, Block, Setup, arrays_of, some_of
from karamelo_py.kernels.totals import LIMBS, add_all, add_rows, rounded
from karamelo_py.output.fields import PIECE, SUMMED
from karamelo_py.output.node_columns import NodeRows, brought, loaded, places_of
from karamelo_py.output.point_table import Part, PointTable, Rows
from karamelo_py.run.boxes import numbers
from karamelo_py.run.checkpoint.arrays import kept_at_nodes, of_nodes, rows_at
from karamelo_py.run.mpi.partition import joined
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.hub import Hub

LAST = 2**62  # above all numbers of points


class PointsById:
    """The points of a simulation: by their ids (from 0), in pieces, and sums over them."""

    def __init__(self, simulation: Any):
        self.simulation = simulation

    @property
    def hub(self) -> Hub:
        return self.simulation.hub

    @property
    def setup(self) -> Setup:
        return self.simulation.setup

    @property
    def comm(self) -> SerialComm:
        return self.simulation.comm

    def rows(self) -> Rows:
        """Return all points, in the order of their ids, for a table."""
        parts = [Part(block, None, block.points.id) for block in self.setup.blocks]
        comm = self.comm if self.comm.size > 1 else None
        present = self.simulation.present
        return Rows(self.setup, parts, np.arange(len(present)), present, comm)

    def members(self, group: Any) -> np.ndarray:
        """List the ids (0-based) of a particle group, without deleted points."""
        present = self.simulation.present
        ids = np.arange(len(present)) if group.all else group.ids
        return ids if present.all() else ids[present[ids]]

    def total(self, name: str, group: Any = None) -> float:
        """Sum a quantity of `SUMMED` over all points, or over a group; without rounding."""
        limbs = np.zeros((1, LIMBS), np.int64)
        for block in self.setup.blocks:
            values = SUMMED[name](self.setup, block)
            if values is not None and not (group is None or group.all):
                values = values[group.has(block.points.id)]
            if values is not None:
                add_all(limbs, 0, values)
        return rounded(self.comm.allreduce(limbs)[0])

    def rows_of(self, group: Any) -> Iterator[tuple[Block, np.ndarray]]:
        """Yield the local points of a group in pieces: a block, and rows of it."""
        for block in self.setup.blocks:
            ids = block.points.id
            for first in range(0, len(ids), PIECE):
                rows = np.arange(first, min(first + PIECE, len(ids)))
                if not (group is None or group.all):
                    rows = rows[group.has(ids[rows])]
                if len(rows):
                    yield block, rows

    def some(self, group: Any) -> Iterator[PointTable]:
        """Yield the local points of a group in pieces, and finally an empty table."""
        for block, rows in self.rows_of(group):
            yield self._some(block, rows)
        yield self._some(self.setup.blocks[0], np.empty(0, np.int64))

    def _some(self, block: Block, rows: np.ndarray) -> PointTable:
        parts, ids = [Part(block, rows, slice(None))], block.points.id[rows]
        return PointTable(self.hub, Rows(self.setup, parts, ids, np.ones(len(ids), np.bool_)))

    def added_up(self, part: Any, name: str, *arguments: Any) -> np.ndarray:
        """Sum the terms of a part's method `name` over the points of its group; no rounding.

        Called with tables of some of the points, and the `arguments`, it returns rows of terms
        (k, n), or the number of sums, the sum (n,) of each term, and terms.
        """
        limbs = np.empty((0, LIMBS), np.int64)
        for some in self.some(part.group):
            found = getattr(part, name)(some, *arguments)
            count, rows, terms = found if isinstance(found, tuple) else (len(found), None, found)
            if not len(limbs):
                limbs = np.zeros((count, LIMBS), np.int64)
            if rows is not None:
                add_rows(limbs, rows, terms)
                continue
            for k in range(count):
                add_all(limbs, k, np.ascontiguousarray(terms[k], float))
        totals = self.comm.allreduce(limbs)
        there = totals.any(axis=1)  # few of the thousands for a quantile
        return np.array([rounded(t) if one else 0.0 for t, one in zip(totals, there, strict=True)])

    def summed(self, terms: np.ndarray) -> np.ndarray:
        """Sum local terms (n,) or (n, k) over all processes, rounded once."""
        columns = terms.reshape(len(terms), int(np.prod(terms.shape[1:]))).T
        limbs = np.zeros((len(columns), LIMBS), np.int64)
        for k, column in enumerate(columns):
            add_all(limbs, k, np.ascontiguousarray(column))
        of_all = sum(self.comm.everyone("a total", limbs))
        return np.array([rounded(of) for of in of_all]).reshape(terms.shape[1:])

    def each(self, part: Any, name: str, *arguments: Any) -> list:
        """Collect the results of a part's method for its group, piece by piece."""
        found = (getattr(part, name)(some, *arguments) for some in self.some(part.group))
        own = [one for one in found if one is not None]
        return [one for of_rank in self.comm.allgather(own) for one in of_rank]

    def seen(self, say: Callable, *arguments: Any) -> list:
        """Collect a function's result for the points of each process."""
        return self.comm.allgather(say(self.simulation, *arguments))

    def largest(self, of: Callable[[PointTable], np.ndarray]) -> tuple[float, int]:
        """Return the largest value of a function of points, and the first point with it."""

        def own() -> tuple[float, int]:
            found = -inf, 0
            for some in self.some(None):
                values = of(some)
                value = np.fmax.reduce(values, initial=-inf)
                first = some.numbers[values == value].min(initial=LAST)
                found = max(found, (float(value), -int(first)))
            return found

        value, number = max(self.comm.allgather(own()))
        return value, -number

    def pieces(self, *, to_first: bool = False) -> Iterator[PointTable]:
        """Yield all points in pieces; `to_first`: only to the first of several processes."""
        s = self.setup
        orders = [np.argsort(block.points.id) for block in s.blocks]
        known = [block.points.id[order] for block, order in zip(s.blocks, orders, strict=True)]
        gather = self.comm.gather if to_first else self.comm.allgather
        present = self.simulation.present
        for first, end in _ranges(len(present)):
            blocks = [
                some_of(block, order[slice(*np.searchsorted(ids, (first, end)))])
                for block, order, ids in zip(s.blocks, orders, known, strict=True)
            ]
            if self.comm.size > 1:
                own = [[array for _, array in arrays_of(block.points)] for block in blocks]
                found = gather(own)
                if found is None:
                    continue
                blocks = [
                    block._replace(points=joined(block.points, parts))
                    for block, parts in zip(blocks, zip(*found, strict=True), strict=True)
                ]
            parts = [Part(block, None, block.points.id - first) for block in blocks]
            ids = np.arange(first, end)
            yield PointTable(self.hub, Rows(s, parts, ids, present[first:end]))


def _ranges(count: int) -> Iterator[tuple[int, int]]:
    """Yield the begin and end of consecutive pieces of `count` items."""
    return ((first, min(first + PIECE, count)) for first in range(0, count, PIECE))


class NodesByNumber:
    """The nodes of a simulation that has `points`."""

    def __init__(self, points: PointsById):
        self.points, self.simulation = points, points.simulation

    def pieces(self, names: Iterable[str], *, to_first: bool = False) -> Iterator[NodeRows]:
        """Yield all nodes in pieces, with these sums over points; see `pieces`."""
        simulation, hub, comm = self.simulation, self.points.hub, self.points.comm
        simulation.show_on_nodes()
        s = simulation.setup
        sums = {name: brought(simulation, name) for name in names}
        weights = loaded(hub, simulation) if sums else {}
        kept = kept_at_nodes(s)
        if simulation.subdomain is not None:
            simulation.subdomain.share_kept()
        gather = comm.gather if to_first else comm.allgather
        for first, end in _ranges(hub.fields.node_count):
            if comm.size == 1:
                arrays = {name: array[first:end] for name, array in of_nodes(s)}
                own = {name: of[first:end] for name, of in sums.items()}
            else:
                arrays = rows_at(simulation, np.arange(first, end), gather)
                own = self._sums_between(first, end, sums, gather)
                if arrays is None:
                    continue
                arrays |= {f"nodes/{name}": array[first:end] for name, array in kept}
            own = {name: of.sum(axis=1) for name, of in own.items()}
            yield NodeRows(first, end, s.kin, arrays, own, weights)

    def _sums_between(self, first: int, end: int, sums: dict, gather: Callable) -> dict:
        """Sum over the points of all processes at the nodes from `first` to before `end`."""
        nodes = numbers(self.simulation.setup.spans)
        used = nodes[slice(*np.searchsorted(nodes, (first, end)))]
        own = {name: np.zeros((end - first, 2)) for name in sums}
        for there, given in gather((used, [of[used] for of in sums.values()])) or ():
            for total, of in zip(own.values(), given, strict=True):
                total[there - first] += of
        return own

    def counted(self) -> np.ndarray:
        """Return the numbers of the nodes in use, each on one process only."""
        simulation = self.simulation
        if simulation.subdomain is not None:
            return simulation.subdomain.counted()
        return numbers(simulation.setup.spans)

    def with_mass(self) -> np.ndarray:
        """Return the numbers of those nodes that have mass."""
        nodes = self.counted()
        return nodes[self.simulation.setup.nodes.sums[nodes, MASS] > 0]

    def mass_of(self, group: Any) -> np.ndarray:
        """Sum the nodal mass of a group, and its moments about 0 (4,); rounded once."""
        self.simulation.show_on_nodes()
        hub = self.points.hub
        nodes = np.intersect1d(self.with_mass(), hub.groups[group.id].members, assume_unique=True)
        mass = self.simulation.setup.nodes.sums[nodes, MASS].astype(float)
        places = np.column_stack([np.ones(len(nodes)), places_of(hub, nodes)])
        return self.points.summed(mass[:, None] * places)

    def occupied(self) -> tuple[int, int]:
        """Return the number of nodes with mass, and the last of them."""
        self.simulation.show_on_nodes()
        there, comm = self.with_mass(), self.points.comm
        count = comm.allreduce(np.array([len(there)]))
        last = comm.allreduce_max(np.array([there.max(initial=-1)], float))
        return int(count[0]), int(last[0])
