"""Points in the order of their ids: all of a scene, or a piece of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from typing import Any

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import Block, Setup
from karamelo_py.output.fields import PIECE
from karamelo_py.run.lowering import chosen
from karamelo_py.scene.hub import Hub


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
    setup: Setup
    first = 0
    count: int
    present: np.ndarray

    @property
    def now(self) -> int:
        """Which of the two position arrays is the present one."""
        return int(self.setup.control.clock[0].now)

    def by_id(self, field: Callable) -> np.ndarray:
        """A field of all points in the order of their ids; `field` takes it from `Points`.

        It is zero for points that were deleted.
        """
        blocks = self.setup.blocks
        first = field(blocks[0].points)
        out = np.zeros((*first.shape[:-1], self.count), first.dtype)
        for block in blocks:
            out[..., block.points.id - self.first] = field(block.points)
        return out

    def declared(self, kind: type) -> np.ndarray | None:
        """A declared field (N, components) by id, None where the scene does not have it.

        Where only some laws have it, the others show what it starts from.
        """
        blocks = self.setup.blocks
        if all(field(block.points.fields, kind) is None for block in blocks):
            return None
        out = fields.at_points(kind, self.setup.kin, self.count, float).array
        for block in blocks:
            array = field(block.points.fields, kind)
            if array is not None:
                out[:, block.points.id - self.first] = array
        return out.T

    def members(self, group: Any) -> np.ndarray:
        """Ids (0-based) of a particle group, without deleted points."""
        ids = np.arange(self.count) if group.all else group.ids
        return ids if self.present.all() else ids[self.present[ids]]

    @property
    def x(self) -> np.ndarray:
        """(N, d) present positions by id."""
        d = self.setup.kin.dimension
        return self.by_id(lambda points: points.x[self.now][:d]).T

    @property
    def v(self) -> np.ndarray:
        """(N, d) velocities by id."""
        return self.by_id(lambda points: points.v).T

    @property
    def mass(self) -> np.ndarray:
        """(N,) masses by id."""
        return self.by_id(lambda points: points.mass)

    @cached_property
    def solid_of(self) -> np.ndarray:
        """(N,) the number of the solid of each point, from 0."""
        return self._of_solids(
            lambda solid, own: np.full(own.stop - own.start, solid.index, np.int32)
        )

    @cached_property
    def x0(self) -> np.ndarray:
        """(N, d) positions before the first step."""
        return self._of_solids(lambda solid, own: solid.x0[own])

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

    def pieces(self) -> Iterator[ById]:
        """All points, so many at a time."""
        s = self.setup
        ordered = list(map(Ordered, s.blocks))
        for first, end in self.ranges():
            yield Piece(self, first, end, s, (one.between(first, end) for one in ordered))


class Piece(ById):
    """The points with ids from `first` to before `end`, in blocks of their own."""

    def __init__(self, whole: ById, first: int, end: int, s: Setup, blocks: Iterable[Block]):
        self.hub = whole.hub
        self.setup = s._replace(blocks=tuple(blocks))
        self.first, self.count = first, end - first
        self.present = whole.present[first:end]


class Ordered:
    """The points of a block, to be had by id."""

    def __init__(self, block: Block):
        self.block = block
        self._order = np.argsort(block.points.id)
        self._ids = block.points.id[self._order]

    def between(self, first: int, end: int) -> Block:
        """The points with ids from `first` to before `end`, in a block."""
        return chosen(self.block, self._order[slice(*np.searchsorted(self._ids, (first, end)))])
