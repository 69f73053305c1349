"""Base of fixes between two solids."""

from functools import partial
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels import pairs
from karamelo_py.kernels.arrays import Block
from karamelo_py.kernels.p2g import Force
from karamelo_py.language.rules import gain
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError

SENT = 350  # bytes that the process that looks for pairs needs of each point


def check_pair(solid1: Solid, solid2: Solid) -> None:
    """Refuse a pair that is one solid twice."""
    if solid1 is solid2:
        raise ScriptError(
            f"'{solid2.id}' is named twice",
            argument="solid2",
            expected="another solid than the first",
        )


class PairContact(Fix):
    """Base of the fixes by which the points of two solids push each other.

    Of many processes the first looks for pairs among the points of all that may touch.
    """

    published = ("x", "y", "z")
    point_fields = (Force,)
    point_by_point = True

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
        ranges = [(solid.first_id, solid.first_id + solid.count) for solid in self.solids]
        self._ranges = (*ranges[0], *ranges[1])
        self._reach = max(solid.h for solid in self.solids)

    def law(self) -> NamedTuple:
        """The tag of :mod:`karamelo_py.points.pairs` that gives the force between two points."""
        raise NotImplementedError

    def initial_integrate(self, points: PointsView) -> None:
        """Find the pairs that touch and give the points their forces."""
        simulation, total = self.hub.simulation, np.zeros(3)
        kin, corners = simulation.kin, self._where_both_are(simulation)
        if corners is not None:
            blocks = simulation.setup.blocks
            rows = [self._picked(simulation, block, *corners) for block in blocks]
            own = [self._known(simulation, *one) for one in zip(blocks, rows, strict=True)]
            push = partial(self._push, kin, points.dt, points.kick)
            force, total = simulation.at_first(push, np.concatenate(own))
            for block, some in zip(blocks, rows, strict=True):
                field(block.points.fields, Force)[: kin.dimension, some] += force[: len(some)].T
                force = force[len(some) :]
        self.publish_components(total)

    def sent(self, simulation: Any) -> int:
        """Count the points that may touch others now: one process looks at all of them."""
        corners = self._where_both_are(simulation)
        blocks = simulation.setup.blocks if corners is not None else ()
        return sum(len(self._picked(simulation, block, *corners)) for block in blocks)

    def _where_both_are(self, simulation: Any) -> tuple[np.ndarray, np.ndarray] | None:
        """The corners of the place where points of both solids may touch; None where that is none.

        Each solid is in a box, and reaches beyond it as far as two points touch.
        """
        s, d = simulation.setup, simulation.kin.dimension
        extents = np.full((2, 7), -np.inf)
        for block in s.blocks:
            x = block.points.x[simulation.now]
            pairs.extend(s.kin, x, block.points, block.laws, *self._ranges, extents)
        extents = simulation.comm.allreduce_max(extents)
        width = min(extents[:, 6].sum(), self._reach)
        low, high = -extents[:, :d].min(axis=0) - width, extents[:, 3 : 3 + d].min(axis=0) + width
        return (low, high) if (low <= high).all() else None

    def _picked(self, simulation: Any, block: Block, *corners: np.ndarray) -> np.ndarray:
        """Rows of the points of a block that lie between two corners."""
        points, rows = block.points, np.empty(block.points.id.size, np.int64)
        x = points.x[simulation.now]
        return rows[: pairs.pick(simulation.kin, x, points, *self._ranges, *corners, rows)].copy()

    @staticmethod
    def _known(simulation: Any, block: Block, rows: np.ndarray) -> np.ndarray:
        """Numbers, masses, radii, positions and velocities of some points."""
        kin, x = simulation.kin, block.points.x[simulation.now]
        found = np.empty((len(rows), 3 + 2 * kin.dimension))
        pairs.collect(kin, x, block.points, block.laws, rows, found)
        return found

    def _push(self, kin: Any, dt: float, kick: float, found: list[np.ndarray]) -> list[tuple]:
        """Forces on the points that each process has found, and the sum of those on the first."""
        of_all, d = np.concatenate(found), kin.dimension
        begin, end = self._ranges[:2]
        second = (of_all[:, 0] < begin) | (of_all[:, 0] >= end)
        order = np.lexsort((of_all[:, 0], second))
        n, total = len(order), np.zeros(3)
        _, mass, radius, *both = np.ascontiguousarray(of_all[order].T)
        x, v = (np.stack(part, axis=1) for part in (both[:d], both[d:]))
        bodies = pairs.TwoBodies(x, v, mass, radius, np.zeros((n, d)), n - int(second.sum()))
        pairs.push_apart(self.law(), kin, bodies, pairs.cells_for(n), self._reach, dt, kick, total)
        force = np.empty((n, d))
        force[order] = bodies.force
        ends = np.cumsum([len(one) for one in found])[:-1]
        return [(own, total) for own in np.split(force, ends)]


gain(
    PairContact,
    when=lambda fix, scene: True,
    cause="contact between points",
    cure="a smaller step, or method ulmpm/contacts",
)
