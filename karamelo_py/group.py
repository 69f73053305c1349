"""Groups: sets of points or of nodes that fixes, computes and dumps act on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from karamelo_py.domain import CHUNK, require_grid
from karamelo_py.regions.base import Region, look_up
from karamelo_py.script.errors import Place, ScriptError
from karamelo_py.solid import Solid

if TYPE_CHECKING:
    from karamelo_py.hub import Hub
    from karamelo_py.signature import Argument

ALL = "all"


class Group:
    """What point groups and node groups share. Members are decided once, when they are added.

    Attributes
    ----------
    all : bool
        Whether this is the group of everything, which also takes in what is made later.
    """

    kind = ""
    id: str = ""
    place: Place | None = None

    def __init__(self, hub: Hub, *, everything: bool = False):
        self.hub = hub
        self.all = everything
        if everything:
            self.id = ALL
        self._members = np.empty(0, dtype=np.int64)

    def __len__(self) -> int:
        return len(self.members)

    @property
    def members(self) -> np.ndarray:
        """Numbers (from 0) of the members, ascending: (n,) int64."""
        if self.all:
            return np.arange(self.total(), dtype=np.int64)
        return self._members

    def total(self) -> int:
        """Number of points or nodes that there are."""
        raise NotImplementedError

    def find(self, region: Region, solids: Sequence[Solid]) -> np.ndarray:
        """Numbers, ascending, of what lies in `region` and belongs to `solids`: (n,) int64."""
        raise NotImplementedError

    def add(self, region: Region, solids: Sequence[Solid]) -> int:
        """Add what lies in `region`; returns how many were found."""
        found = np.empty(0, np.int64) if region.unknown else self.find(region, solids)
        self._members = np.union1d(self._members, found) if len(self._members) else found
        return len(found)

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Group:
        """The group that `argument` names; the word ``all`` is the group of everything."""
        if argument.word() == ALL:
            return cls(hub, everything=True)
        group = look_up(hub.groups, argument)
        if not isinstance(group, cls):
            raise ScriptError(
                f"group '{group.id}' is a group of {group.kind}",
                place=argument.place,
                expected=f"a group of {cls.kind}: group(ID, {cls.kind}, region, ...)",
            )
        return group


class ParticleGroup(Group):
    """A set of points, by their reference positions."""

    kind = "particles"

    @property
    def ids(self) -> np.ndarray:
        """Point numbers (id - 1), ascending: (n,) int64."""
        return self.members

    def total(self) -> int:
        """Number of points of all solids."""
        return sum(solid.count for solid in self.hub.solids.values())

    def find(self, region: Region, solids: Sequence[Solid]) -> np.ndarray:
        """Points of `solids` whose reference position lies in `region`."""
        found = [np.empty(0, dtype=np.int64)]
        for solid in sorted(set(solids), key=lambda solid: solid.first_id):
            for start in range(0, solid.count, CHUNK):
                inside = region.inside(solid.x0[start : start + CHUNK])
                found.append(np.flatnonzero(inside) + (solid.first_id + start))
        return np.concatenate(found)


class NodeGroup(Group):
    """A set of nodes, by their positions. Methods decide whether solids share them."""

    kind = "nodes"

    @property
    def nodes(self) -> np.ndarray:
        """Node numbers, ascending: (n,) int64."""
        return self.members

    def total(self) -> int:
        """Number of nodes of all grids."""
        require_grid(self.hub)
        return sum(lattice.node_count for lattice in self.hub.lattices)

    def find(self, region: Region, solids: Sequence[Solid]) -> np.ndarray:
        """Nodes in `region`; where solids have nodes of their own, those of `solids`."""
        require_grid(self.hub)
        method, lattices = self.hub.update.method, self.hub.lattices
        if method is not None and len(lattices) > 1:
            wanted = {method.lattice_of(self.hub, solid) for solid in solids}
            lattices = [lattices[k] for k in sorted(wanted)]
        found = [np.empty(0, dtype=np.int64)]
        for lattice in lattices:
            for number, x in lattice.between(region.box_lo, region.box_hi):
                found.append(number[region.inside(x)])
        return np.concatenate(found)


class AnyGroup:
    """For signatures: a group of points or of nodes. The word ``all`` means all points here."""

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> ParticleGroup | NodeGroup:
        """The group that `argument` names."""
        if argument.word() == ALL:
            return ParticleGroup(hub, everything=True)
        return look_up(hub.groups, argument)


KINDS: dict[str, type[Group]] = {kind.kind: kind for kind in (ParticleGroup, NodeGroup)}
