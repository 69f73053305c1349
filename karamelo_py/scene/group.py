"""Groups of points or nodes."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from karamelo_py.kernels.equations.periodic import GHOSTS
from karamelo_py.language.arguments import Named
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument
from karamelo_py.scene.domain import require_grid
from karamelo_py.scene.lattice import CHUNK, Lattice
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError

ALL = "all"
NOTHING_THERE = "fixes of this group have no effect there"


class AnyGroup(Named):
    """A group of points or nodes; `all` includes members that are added later.

    Subclasses have ``total()``, the number of all points or nodes; ``chosen()``, the members of a
    group other than `all`; and ``add(region, solids)``, which returns the number of new members (0
    if the region is not known yet).
    """

    kind = ""
    script_kind = "a group of points or of nodes, or all"
    catalogue = "groups"

    def __init__(self, hub: Scene, *, everything: bool = False):
        self.hub = hub
        self.all = everything
        if everything:
            self.id = ALL

    def __len__(self) -> int:
        return len(self.members)

    @property
    def members(self) -> np.ndarray:
        """Return the numbers of members, ascending from 0: (n,) int64."""
        return np.arange(self.total(), dtype=np.int64) if self.all else self.chosen()

    total: Callable[[], int]
    chosen: Callable[[], np.ndarray]
    add: Callable[[Region, Sequence[Solid] | None], int]

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        if ALL in (argument.text, argument.word()):
            return (ParticleGroup if cls is AnyGroup else cls)(hub, everything=True)
        try:
            group = super().from_script(hub, argument)
        except ScriptError as error:
            asked = f", {cls.kind or 'particles|nodes'},"
            error.hint = error.hint and error.hint.replace(", particles,", asked)
            raise
        if not isinstance(group, cls):
            raise ScriptError(
                f"group '{group.id}' is a group of {group.kind}",
                mark=argument.mark,
                expected=f"a group of {cls.kind}",
                hint=f"all, or group({group.id}_{cls.kind}, {cls.kind}, region, ...)",
            )
        return group


class ParticleGroup(AnyGroup):
    kind = "particles"
    script_kind = "a group of points, or all"
    # One bit per point, from the lowest bit of each byte on, with 64 spare bits at the end.
    _bits = np.zeros(8, np.uint8)

    @classmethod
    def of(cls, hub: Scene, solid: Solid) -> "ParticleGroup":
        group = cls(hub)
        group.id = solid.id
        group.take(_numbers_of(solid))
        return group

    def __len__(self) -> int:
        return sum(map(len, self.pieces()))

    ids = AnyGroup.members  # returns ids - 1

    def total(self) -> int:
        return sum(solid.count for solid in self.hub.solids.values())

    def chosen(self) -> np.ndarray:
        return np.concatenate([np.empty(0, np.int64), *self.pieces()])

    def pieces(self) -> Iterator[np.ndarray]:
        for solid in self.hub.solids.values():
            for ids in _numbers_of(solid):
                yield ids[self.has(ids)]

    def has(self, ids: np.ndarray) -> np.ndarray:
        if self.all:
            return np.ones(len(ids), np.bool_)
        return (self._bits.take(ids >> 3, mode="clip") >> (ids & 7) & 1).astype(np.bool_)

    def touches(self, solid: Solid) -> bool:
        return any(self.has(ids).any() for ids in _numbers_of(solid))

    def bits(self, count: int) -> np.ndarray:
        """Return a bit per point of `count` points, 1 for members, in whole 64-bit words."""
        size = -(-count // 64) * 8
        if self.all:
            return np.full(size, 255, np.uint8)
        whole = np.zeros(size, np.uint8)
        stored = self._bits[:size]
        whole[: len(stored)] = stored
        return whole

    def add(self, region: Region, solids: Sequence[Solid] | None) -> int:
        return self.take(self._found(region, solids))

    def take(self, pieces: Iterable[np.ndarray]) -> int:
        """Add ascending pieces of numbers; return their count."""
        bits, count = self.bits(self.total() + 64), 0
        for ids in pieces:
            if len(ids):
                span = bits[ids[0] >> 3 : (ids[-1] >> 3) + 1]
                members = np.unpackbits(span, bitorder="little")
                members[ids - (ids[0] & ~7)] = 1
                span[:] = np.packbits(members, bitorder="little")
                count += len(ids)
        self._bits = bits
        return count

    def _found(self, region: Region, solids: Sequence[Solid] | None) -> Iterator[np.ndarray]:
        if region.unknown:
            return
        if solids is None:
            solids = tuple(self.hub.solids.values())
        for solid in sorted(set(solids), key=lambda solid: solid.first_id):
            for start, x in solid.pieces():
                yield np.flatnonzero(region.inside(x)) + (solid.first_id + start)


def _numbers_of(solid: Solid) -> Iterator[np.ndarray]:
    end = solid.first_id + solid.count
    for first in range(solid.first_id, end, CHUNK):
        yield np.arange(first, min(first + CHUNK, end))


class NodeGroup(AnyGroup):
    """Nodes by position. The definition is stored, so that nodes of later grids are included."""

    kind = "nodes"
    script_kind = "a group of nodes, or all"
    awaits_solids = False  # True if later solids may bring members

    def __init__(self, hub: Scene, *, everything: bool = False):
        super().__init__(hub, everything=everything)
        self.parts: tuple[tuple[Region, Sequence[Solid] | None], ...] = ()
        self._found: tuple[list[Lattice], np.ndarray] | None = None

    nodes = AnyGroup.members

    def total(self) -> int:
        require_grid(self.hub)
        return sum(lattice.node_count for lattice in self.hub.lattices)

    def chosen(self) -> np.ndarray:
        lattices = self.hub.lattices
        if self._found is None or self._found[0] is not lattices:
            pieces = [
                numbers for definition in self.parts if len(numbers := self._find(*definition))
            ]
            members = [np.unique(np.concatenate(pieces))] if len(pieces) > 1 else pieces
            self._found = lattices, (members or [np.empty(0, np.int64)])[0]
        return self._found[1]

    def add(self, region: Region, solids: Sequence[Solid] | None) -> int:
        self.parts = (*self.parts, (region, solids))
        self._found = None
        return len(self._find(region, solids))

    def refuse_past_domain(self) -> None:
        """Raise ScriptError for a wall at an upper edge whose nodes lie outside the domain."""
        domain, method = self.hub.domain, self.hub.update.method
        if domain.h is None or self.all or method is None or method.own_grids:
            return
        if not len(self.nodes):
            return
        lattice = self.hub.lattices[0]
        first = lattice.first + (self.nodes - lattice.first) % lattice.node_count
        nearest = lattice.positions(first).min(axis=0)
        for k, end in enumerate(domain.hi[: domain.dimension]):
            if nearest[k] > end + domain.tolerance:
                low, h = domain.lo[k], domain.h
                cells = int((end - low) / h)
                raise ScriptError(
                    f"the nodes of group '{self.id}' lie at {'xyz'[k]} = {nearest[k]:g}, past the "
                    f"end of the domain, {end:g}: its side is not a multiple of the cells ({h:g})",
                    argument="group",
                    expected=f"a domain that ends at {low + max(cells, 1) * h:g} or {nearest[k]:g}",
                )

    def _find(self, region: Region, solids: Sequence[Solid] | None) -> np.ndarray:
        if region.unknown:
            return np.empty(0, dtype=np.int64)
        require_grid(self.hub)
        method, lattices = self.hub.update.method, self.hub.lattices
        if solids is not None and len(lattices) > 1:
            wanted = {method.lattice_of(self.hub, solid) for solid in solids}
            lattices = [lattices[k] for k in sorted(wanted)]
        pieces = [np.empty(0, dtype=np.int64)]
        for lattice in lattices:
            for number, x in lattice.between(region.box_lo, region.box_hi):
                pieces.append(number[region.inside(x)])
        nodes = np.concatenate(pieces)
        domain = self.hub.domain
        return with_images(lattices[0], domain, nodes) if domain.periodic else nodes


def with_images(lattice: Lattice, domain: Any, numbers: np.ndarray) -> np.ndarray:
    """Return nodes inside the periodic cell and their images one period away, ascending."""
    places = lattice.places(numbers)
    for k in domain.periodic:
        period = domain.cells_of_period(k)
        inside = (places[:, k] >= GHOSTS) & (places[:, k] < GHOSTS + period)
        shifts = np.arange(-(GHOSTS // period) - 1, GHOSTS // period + 2) * period
        places = np.repeat(places[inside], len(shifts), axis=0)
        places[:, k] += np.tile(shifts, len(places) // len(shifts))
        places = places[(places[:, k] >= 0) & (places[:, k] < lattice.shape[k])]
    return np.unique(lattice.first + np.ravel_multi_index(tuple(places.T), lattice.shape))


KINDS: dict[str, type[AnyGroup]] = {kind.kind: kind for kind in (ParticleGroup, NodeGroup)}
