"""What fixes between two solids share."""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.p2g import Force
from karamelo_py.kernels.pairs import Bodies, Cells, collect, distribute, push_apart
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError


def check_pair(solid1: Solid, solid2: Solid) -> None:
    """Refuse a pair that is one solid twice."""
    if solid1 is solid2:
        raise ScriptError(
            f"'{solid2.id}' is named twice",
            argument="solid2",
            expected="another solid than the first",
        )


class PairContact(Fix):
    """Base of the fixes by which the points of two solids push each other."""

    published = ("x", "y", "z")
    point_fields = (Force,)
    needs_all_points = True  # they are searched by ranges of ids

    def __init__(self, hub: Hub, solid1: Solid, solid2: Solid):
        super().__init__(hub, ParticleGroup(hub, everything=True))
        check_pair(solid1, solid2)
        self.solids = (solid1, solid2)
        method = hub.update.method
        if not method.own_grids:
            hub.warn(
                "solids that share a grid touch there already; "
                "the forces of this fix come on top of that",
                hint="method(tlmpm, ...) gives every solid a grid of its own"
                + (
                    "; fix contact/friction is for the contact on the grid"
                    if method.fields_per_solid
                    else "; method(ulmpm/contacts, ...) lets them slide and separate"
                ),
            )
        first, second = (solid.count for solid in self.solids)
        count, d = first + second, hub.domain.dimension
        self._bodies = Bodies(
            x=np.zeros((count, d)),
            v=np.zeros((count, d)),
            mass=np.zeros(count),
            radius=np.zeros(count),
            force=np.zeros((count, d)),
            first2=first,
        )
        self._cells = Cells(
            start=np.zeros(2 * count + 65, np.int64),
            cell=np.zeros(count, np.int64),
            order=np.zeros(count, np.int64),
            corner=np.zeros(3),
            length=np.zeros(3),
            count=np.ones(3, np.int64),
        )
        self._total = np.zeros(3)
        ranges = [(solid.first_id, solid.first_id + solid.count) for solid in self.solids]
        self._ranges = (*ranges[0], *ranges[1])
        self._reach = max(solid.h for solid in self.solids)

    def law(self) -> NamedTuple:
        """The tag of :mod:`karamelo_py.points.pairs` that gives the force between two points."""
        raise NotImplementedError

    def initial_integrate(self, points: PointsView) -> None:
        """Find the pairs that touch and give the points their forces."""
        s = self.hub.simulation.setup
        now = self.hub.simulation.now
        for block in s.blocks:
            x = block.points.x[now]
            collect(s.kin, x, block.points, block.laws, *self._ranges, self._bodies)
        if self._push(s.kin, points.dt, points.kick):
            for block in s.blocks:
                distribute(s.kin, block.points, *self._ranges, self._bodies)
        self.publish_components(self._total)

    def _push(self, kin: Any, dt: float, kick: float) -> int:
        bodies, cells = self._bodies, self._cells
        return push_apart(self.law(), kin, bodies, cells, self._reach, dt, kick, self._total)
