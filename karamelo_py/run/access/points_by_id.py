"""Points in the order of their ids: all of a scene, or a piece of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from math import inf
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import Block, Control, Setup, arrays_of
from karamelo_py.kernels.totals import LIMBS, add_all, add_rows, rounded
from karamelo_py.output.fields import PIECE, SUMMED, Fields
from karamelo_py.run.lower.build import chosen
from karamelo_py.run.mpi.partition import joined
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

LAST = 2**62  # behind all numbers of points


class ById:
    """`count` points of a scene by their ids (from 0), from `first` on; of a piece, some are there.

    Attributes
    ----------
    setup : Setup
        Arrays with these points, in any order.
    present : ndarray (count,)
        False for points that were deleted.
    """

    hub: Hub
    comm = SerialComm()
    setup: Setup
    control: Control
    first = 0
    count: int
    present: np.ndarray

    @property
    def kin(self) -> NamedTuple:
        """The kinematics."""
        return self.setup.kin

    @property
    def ids(self) -> np.ndarray:
        """(N,) the numbers of the points."""
        return self.first + np.arange(self.count)

    @property
    def now(self) -> int:
        """Which of the two position arrays is the present one."""
        return int(self.control.clock[0].now)

    def by_id(self, field: Callable) -> np.ndarray:
        """A field of all points in the order of their ids; `field` takes it from `Points`.

        It is zero for points that were deleted.
        """
        own = [(block.points.id, field(block.points)) for block in self.setup.blocks]
        first = own[0][1]
        out = np.zeros((*first.shape[:-1], self.count), first.dtype)
        for ids, rows in self._of_all_blocks(own):
            out[..., ids - self.first] = rows
        return out

    def _of_all_blocks(self, own: list[tuple]) -> Iterator[tuple]:
        """Numbers and rows of the points of blocks, those of all processes."""
        return (one for of_rank in self.comm.allgather(own) for one in of_rank)

    def declared(self, kind: type) -> np.ndarray | None:
        """A declared field (N, components) by id, None where the scene does not have it.

        Where only some laws have it, the others show what it starts from.
        """
        blocks = self.setup.blocks
        if all(field(block.points.fields, kind) is None for block in blocks):
            return None
        out = fields.at_points(kind, self.kin, self.count, float).array
        found = ((block.points.id, field(block.points.fields, kind)) for block in blocks)
        for ids, rows in self._of_all_blocks([one for one in found if one[1] is not None]):
            out[:, ids - self.first] = rows
        return out.T

    def members(self, group: Any) -> np.ndarray:
        """Ids (0-based) of a particle group, without deleted points."""
        ids = np.arange(self.count) if group.all else group.ids
        return ids if self.present.all() else ids[self.present[ids]]

    @property
    def x(self) -> np.ndarray:
        """(N, d) present positions by id."""
        d = self.kin.dimension
        return self.by_id(lambda points: points.x[self.now][:d]).T

    @property
    def v(self) -> np.ndarray:
        """(N, d) velocities by id."""
        return self.by_id(lambda points: points.v).T

    @property
    def mass(self) -> np.ndarray:
        """(N,) masses by id."""
        return self.by_id(lambda points: points.mass)

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The kinds of points, with those that are at hand."""
        return self.setup.blocks

    def total(self, name: str, group: Any = None) -> float:
        """What all points, or those of a group, have together of `SUMMED`; without rounding."""
        limbs = np.zeros((1, LIMBS), np.int64)
        for block in self.setup.blocks:
            values = SUMMED[name](self.setup, block)
            if values is not None and not (group is None or group.all):
                values = values[group.has(block.points.id)]
            if values is not None:
                add_all(limbs, 0, values)
        return rounded(self.comm.allreduce(limbs)[0])

    def rows_of(self, group: Any) -> Iterator[tuple[Block, np.ndarray]]:
        """The points of a group that are at hand, so many at a time: a block, and rows of it."""
        for block in self.setup.blocks:
            ids = block.points.id
            for first in range(0, len(ids), PIECE):
                rows = np.arange(first, min(first + PIECE, len(ids)))
                if not (group is None or group.all):
                    rows = rows[group.has(ids[rows])]
                if len(rows):
                    yield block, rows

    def some(self, group: Any) -> Iterator[Some]:
        """The points of a group that are at hand, so many at a time, and at last none."""
        for block, rows in self.rows_of(group):
            yield Some(self, block, rows)
        yield Some(self, self.setup.blocks[0], np.empty(0, np.int64))

    def added_up(self, part: Any, name: str, *arguments: Any) -> np.ndarray:
        """Sums over the points of a part's group of what its method `name` says; no rounding.

        The method is called with `Fields` of some of the points, and the `arguments`. It returns
        rows of terms (k, n), or the number of sums, to which of them (n,) a term goes, and terms.
        """
        limbs = np.empty((0, LIMBS), np.int64)
        for some in self.some(part.group):
            found = getattr(part, name)(Fields(self.hub, some), *arguments)
            count, rows, terms = found if isinstance(found, tuple) else (len(found), None, found)
            if not len(limbs):
                limbs = np.zeros((count, LIMBS), np.int64)
            if rows is not None:
                add_rows(limbs, rows, terms)
                continue
            for k in range(count):
                add_all(limbs, k, np.ascontiguousarray(terms[k], float))
        return np.array([rounded(total) for total in self.comm.allreduce(limbs)])

    def summed(self, terms: np.ndarray) -> np.ndarray:
        """Sums of terms (n,) or (n, k) of what is at hand over all, rounded once."""
        columns = terms.reshape(len(terms), int(np.prod(terms.shape[1:]))).T
        limbs = np.zeros((len(columns), LIMBS), np.int64)
        for k, column in enumerate(columns):
            add_all(limbs, k, np.ascontiguousarray(column))
        of_all = sum(self.everyone("a total", limbs))
        return np.array([rounded(of) for of in of_all]).reshape(terms.shape[1:])

    def column(self, name: str, block: Block, rows: np.ndarray) -> np.ndarray:
        """A column of the dumps for points that are at hand."""
        return Fields(self.hub, Some(self, block, rows)).particle(name)

    def each(self, part: Any, name: str, *arguments: Any) -> list:
        """What a method of a part says of some points of its group after others, where it does."""
        own = list(self._said(part, name, *arguments))
        return [one for of_rank in self.comm.allgather(own) for one in of_rank]

    def _said(self, part: Any, name: str, *arguments: Any) -> Iterator[Any]:
        say = getattr(part, name)
        found = (say(Fields(self.hub, some), *arguments) for some in self.some(part.group))
        return (one for one in found if one is not None)

    def seen(self, say: Callable, *arguments: Any) -> list:
        """What a function says of the points at hand, of each process."""
        return self.comm.allgather(say(self, *arguments))

    def largest(self, of: Callable[[Fields], np.ndarray]) -> tuple[float, int]:
        """The largest number that a function says of all points, and the first point with it."""
        value, number = max(self.seen(_largest, of))
        return value, -number

    def everyone(self, what: str, thing: Any) -> list:
        """What each process has, where all ask for the same (in words).

        Raises
        ------
        ScriptError
            If a function in Python asks on one process for what it does not on another.
        """
        asked, found = zip(*self.comm.allgather((what, thing)), strict=True)
        if other := next((one for one in asked if one != asked[0]), None):
            raise ScriptError(
                f"a function in Python comes to {asked[0]} on one process, and to {other} on "
                "another",
                hint="points.total(terms) and nodes.total(terms) have to be asked for by all "
                "processes, those without points too",
            )
        return list(found)

    def at_first(self, make: Callable[[list], list], thing: Any) -> Any:
        """What the first process makes of what each has: for each its own."""
        found = self.comm.gather(thing)
        return self.comm.scatter(None if found is None else make(found))

    def counts(self) -> list[int]:
        """How many points each block has."""
        own = [len(block.points.id) for block in self.setup.blocks]
        return self.comm.allreduce(np.array(own)).tolist()

    def of_all(self, numbers: np.ndarray) -> np.ndarray:
        """Sums over all processes that have some of the points."""
        return self.comm.allreduce(numbers)

    def most(self, numbers: np.ndarray) -> np.ndarray:
        """The largest of each number of all processes."""
        return self.comm.allreduce_max(numbers)

    @cached_property
    def solid_of(self) -> np.ndarray:
        """(N,) the number of the solid of each point, from 0."""
        return self._of_solids(
            lambda solid, own: np.full(own.stop - own.start, solid.index, np.int32)
        )

    @cached_property
    def x0(self) -> np.ndarray:
        """(N, d) positions before the first step."""
        return self._of_solids(lambda solid, own: solid.places[own])

    def x0_of(self, ids: np.ndarray) -> np.ndarray:
        """(n, d) positions of some points before the first step, without those of the others."""
        found = np.empty((len(ids), self.kin.dimension))
        order = np.argsort(ids)
        for solid, rows, own in self._own(ids[order]):
            found[order[rows]] = solid.x0_of(own)
        return found

    def volume0_of(self, ids: np.ndarray) -> np.ndarray:
        """(n,) volumes of some points before the first step."""
        found = np.empty(len(ids))
        order = np.argsort(ids)
        for solid, rows, own in self._own(ids[order]):
            found[order[rows]] = solid.volume0[own]
        return found

    def _own(self, ids: np.ndarray) -> Iterator[tuple[Any, slice, np.ndarray]]:
        """Solids with some of these points (ascending): which of them, and their numbers there."""
        for solid in self.hub.solids.values():
            rows = slice(*np.searchsorted(ids, (solid.first_id, solid.first_id + solid.count)))
            if rows.start < rows.stop:
                yield solid, rows, ids[rows] - solid.first_id

    @property
    def volume0(self) -> np.ndarray:
        """(N,) volumes before the first step."""
        return self._of_solids(lambda solid, own: solid.volume0[own])

    def _of_solids(self, of: Callable) -> np.ndarray:
        """What `of(solid, slice of its points)` says of each point."""
        last = self.first + self.count
        found = []
        for solid in self.hub.solids.values():
            begin = max(self.first - solid.first_id, 0)
            end = min(last - solid.first_id, solid.count)
            if begin < end or not found:
                found.append(of(solid, slice(begin, max(begin, end))))
        return found[0] if len(found) == 1 else np.concatenate(found)

    def ranges(self) -> Iterator[tuple[int, int]]:
        """The ids of pieces, from and to, one after another."""
        for first in range(0, self.count, PIECE):
            yield first, min(first + PIECE, self.count)

    def pieces(self, *, to_first: bool = False) -> Iterator[ById]:
        """All points, so many at a time; `to_first`, of several processes the first gets them."""
        s, ordered = self.setup, list(map(Ordered, self.setup.blocks))
        gather = self.comm.gather if to_first else self.comm.allgather
        for first, end in self.ranges():
            blocks = [one.between(first, end) for one in ordered]
            if self.comm.size > 1:
                own = [[array for _, array in arrays_of(block.points)] for block in blocks]
                found = gather(own)
                if found is None:
                    continue
                blocks = [
                    block._replace(points=joined(block.points, parts))
                    for block, parts in zip(blocks, zip(*found, strict=True), strict=True)
                ]
            yield Piece(self, first, end, s, blocks)


def _largest(points: ById, of: Callable[[Fields], np.ndarray]) -> tuple[float, int]:
    """As `largest` of the points at hand: (value, -number), -infinity without a number."""
    found = -inf, 0
    for some in points.some(None):
        values = of(Fields(points.hub, some))
        value = np.fmax.reduce(values, initial=-inf)
        first = some.ids[values == value].min(initial=LAST)
        found = max(found, (float(value), -int(first)))
    return found


class Piece(ById):
    """The points with ids from `first` to before `end`, in blocks of their own."""

    def __init__(self, whole: ById, first: int, end: int, s: Setup, blocks: Iterable[Block]):
        self.hub = whole.hub
        self.setup = s._replace(blocks=tuple(blocks))
        self.control = s.control
        self.first, self.count = first, end - first
        self.present = whole.present[first:end]


class Some(ById):
    """Some points of a block, in the order in which they are stored."""

    kin: Any = None
    ids: Any = None

    def __init__(self, whole: ById, block: Block, rows: np.ndarray):
        self.hub, self.control, self.kin = whole.hub, whole.control, whole.kin
        self._stepped, self._block, self._rows = whole.setup, block, rows
        self.ids, self.count = block.points.id[rows], len(rows)
        self.present = np.ones(self.count, np.bool_)

    @cached_property
    def setup(self) -> Setup:
        """Arrays with copies of these points, which are numbered from 0."""
        block = chosen(self._block, self._rows)
        points = block.points._replace(id=np.arange(self.count))
        return self._stepped._replace(blocks=(block._replace(points=points),))

    def _taken(self, array: np.ndarray) -> np.ndarray:
        return fields.some_points(array, self._rows).T

    @property
    def x(self) -> np.ndarray:
        """(n, d) present positions."""
        return self._taken(self._block.points.x[self.now][: self.kin.dimension])

    @property
    def v(self) -> np.ndarray:
        """(n, d) velocities."""
        return self._taken(self._block.points.v)

    @property
    def mass(self) -> np.ndarray:
        """(n,) masses."""
        return self._taken(self._block.points.mass)

    @property
    def x0(self) -> np.ndarray:
        """(n, d) positions before the first step."""
        return self.x0_of(self.ids)

    @property
    def volume0(self) -> np.ndarray:
        """(n,) volumes before the first step."""
        return self.volume0_of(self.ids)

    @property
    def solid_of(self) -> np.ndarray:
        """(n,) the number of the solid of each point, from 0."""
        firsts = [solid.first_id for solid in self.hub.solids.values()]
        return np.searchsorted(firsts, self.ids, side="right") - 1


class Ordered:
    """The points of a block, to be had by id."""

    def __init__(self, block: Block):
        self.block = block
        self._order = np.argsort(block.points.id)
        self._ids = block.points.id[self._order]

    def between(self, first: int, end: int) -> Block:
        """The points with ids from `first` to before `end`, in a block."""
        return chosen(self.block, self._order[slice(*np.searchsorted(self._ids, (first, end)))])
