"""Fixes inflow and outflow."""

from math import floor, fsum
from typing import Annotated

import numpy as np

from karamelo_py.kernels.arrays import Points
from karamelo_py.language.rules import Restrictions
from karamelo_py.language.signature import Positive
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import NodeGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, per_direction
from karamelo_py.scene.region import Region
from karamelo_py.scene.replacing import chosen_of, refuse_chosen, replace_points
from karamelo_py.scene.solid import Solid, named
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.fixes.erosion import Erosion
from karamelo_py.styles.fixes.velocity_nodes import Velocity, VelocityNodes

MOST = 20_000_000  # largest number of points that have not entered yet
ALIKE = 1e-6  # round-off of positions, in cells


class Inlet(Region):
    """All positions in a box of cells."""

    id = "inlet"

    def contains(self, x: np.ndarray) -> np.ndarray:
        d = self.dimension
        lo, hi = self.box_lo[:d] - self.tolerance, self.box_hi[:d] + self.tolerance
        outside: np.ndarray = (x[:, :d] < lo) | (x[:, :d] > hi)
        return np.logical_not(outside.any(axis=1))


class Inflow(VelocityNodes):
    """Feed material into the scene, at a prescribed velocity, through an inlet that a solid fills.

    Parameters
    ----------
    solid
        The solid that fills the inlet, at least one cell long. The layers of points in the inlet
        enter first.
    velocity
        vx, vy, vz, one per dimension; exactly one of them is not 0.
    until
        Time at which the last layer enters.

    Example
    -------
    fix(feed, inflow, s1, 1, 0, until=0.5)

    Notes
    -----
    Nodes of the inlet have the prescribed velocity. A layer of points enters at the upstream end of
    the inlet whenever the previous layer has moved by the layer spacing, so that the inflow of mass
    is exact. The layers of the solid are repeated in order, and ids follow the order of entry. All
    points up to the time `until` are created before the first run. The energy balance counts the
    energy of entering points as work.

    Publishes the force on the nodes of the inlet as ID_x, ID_y, ID_z, and the number and mass of
    the points that have entered as ID_points and ID_mass.

    See Also
    --------
    outflow, velocity_nodes, activate
    """

    syntax = "solidID, vx[, vy[, vz]], until=T"
    published = ("x", "y", "z", "points", "mass")
    conserves = True
    every = 1
    remembers = ("entered", "looked")
    looked = False
    restrictions = Restrictions(
        "inflow", "no inflow", only={"method": ("ulmpm",)},
        without=("implicit", "periodic", "pore_water", "ezz"),
    )  # fmt: skip

    def __init__(
        self,
        hub: Hub,
        solid: Solid,
        *velocity: float,
        until: Annotated[float, Positive],
    ):
        v = np.array(per_direction(hub, "v", [Velocity(x) for x in velocity], all_given=True))
        self.velocity = np.array([formula.constant for formula in v])
        if np.count_nonzero(self.velocity) != 1:
            message = f"{np.count_nonzero(self.velocity)} components of the velocity are not 0"
            expected = "a velocity along one axis of the grid, such as 2, 0"
            raise ScriptError(message, argument="velocity", expected=expected)
        if hub.has_run:
            message = f"the points of solid '{solid.id}' have been in a run"
            expected = "fix inflow before the first run"
            raise ScriptError(message, argument="solid", expected=expected, code="too-late")
        refuse_chosen(hub, solid, "fix inflow")
        self.solid, self.axis = solid, int(np.flatnonzero(self.velocity)[0])
        self.speed, self.sign = abs(self.velocity[self.axis]), np.sign(self.velocity[self.axis])
        group = NodeGroup(hub)
        group.id = f"inlet of {solid.id}"
        group.add(self._inlet(hub), None)
        self.entered = 0
        self._fill(hub, until)
        super().__init__(hub, group, *v)
        self.held_directions = ()  # the inlet is not a wall: splines are not modified there

    def _inlet(self, hub: Hub) -> Inlet:
        """Return the cells of the solid, and the upstream cells that its points reach."""
        solid, lattice = self.solid, hub.lattices[0]
        d, h, far = hub.domain.dimension, lattice.h, hub.update.method.basis.traits.cells // 2
        corner = lattice.lo[:d]
        lo = np.floor((solid.lo[:d] - corner) / h + ALIKE) - far
        hi = np.ceil((solid.hi[:d] - corner) / h - ALIKE) + far
        if self.sign > 0:
            hi[self.axis] -= far
        else:
            lo[self.axis] += far
        return Inlet(hub, corner + lo * h, corner + hi * h)

    def _fill(self, hub: Hub, until: float) -> None:
        solid, axis, h = self.solid, self.axis, hub.lattices[0].h
        along = np.rint(self.sign * solid.x0[:, axis] / (ALIKE * h)).astype(np.int64)
        places, layer = np.unique(along, return_inverse=True)
        gaps = np.diff(places) if len(places) > 1 else 2 * solid.half_size[:1, axis] / (ALIKE * h)
        if np.ptp(gaps) > 2:
            raise ScriptError(
                f"the points of solid '{solid.id}' are not in equally spaced layers across the "
                f"velocity: distances from {gaps.min() * ALIKE:.4g} to {gaps.max() * ALIKE:.4g} "
                "cells",
                argument="solid",
                expected="points=regular, in a region whose ends are across the velocity",
            )
        self.distance = float(np.mean(gaps) * ALIKE * h)
        self.layers = floor(until * self.speed / self.distance + ALIKE)
        rows = [np.flatnonzero(layer == k) for k in range(len(places))][::-1]
        count = sum(len(rows[k % len(rows)]) for k in range(self.layers))
        if count > MOST:
            raise ScriptError(
                f"{count} points would be needed", argument="until", expected=f"at most {MOST}"
            )
        if not self.layers:
            message = (
                f"no layer enters by then: the first one enters at {self.distance / self.speed:g}"
            )
            raise ScriptError(message, argument="until", expected="a later time")
        initial = solid.count
        entering = [rows[k % len(rows)] for k in range(self.layers)]
        self.ends = initial + np.cumsum([0, *map(len, entering)])
        self.masses = [fsum(solid.mass[some].tolist()) for some in entering[: len(rows)]]
        made = chosen_of(solid, np.concatenate([np.arange(initial), *entering]))
        made.x0[initial:, axis] = solid.x0[rows[-1][0], axis]
        replace_points(hub, solid, made)
        hub.waiting = np.union1d(hub.waiting, solid.first_id + np.arange(initial, self.ends[-1]))
        columns = zip(("vx", "vy", "vz"), self.velocity, strict=False)
        solid.initial |= {name: np.full(solid.count, v) for name, v in columns}

    def defined(self) -> None:
        super().defined()
        self._refuse_others()

    def _refuse_others(self) -> None:
        inner = self.solid.half_size[0] / 2
        lo, hi = self.solid.lo + inner, self.solid.hi - inner
        for other in self.hub.solids.values():
            if other is not self.solid:
                inside = ((other.x0 > lo) & (other.x0 < hi)).all(axis=1)
                self._refuse(other.first_id + np.flatnonzero(inside))

    def _refuse(self, numbers: np.ndarray) -> None:
        if len(numbers):
            raise ScriptError(
                f"fix '{self.id}' would put points into other material: "
                f"{named(self.hub, int(numbers[0]))} is in the inlet",
                mark=self.mark,
                expected=f"an inlet with points of solid '{self.solid.id}' alone",
            )

    def between_steps(self) -> bool:
        before = self.entered
        if not self.looked:
            self.looked = True
            self._refuse_others()  # solids may have been added since
        while self.entered < self.layers:
            gone = self.hub.update.time - (self.entered + 1) * self.distance / self.speed
            if gone < 0:
                break
            self._enter(gone * self.velocity)
        if self.entered > before:
            self.publish("points", self.ends[self.entered] - self.ends[0])
            turns, rest = divmod(self.entered, len(self.masses))
            whole = [mass for mass in self.masses for _ in range(turns)]
            self.publish("mass", fsum([*whole, *self.masses[:rest]]))
        return self.entered > before

    def _enter(self, way: np.ndarray) -> None:
        solid, first = self.solid, self.entered
        ids = solid.first_id + np.arange(*self.ends[first : first + 2])
        rows = ids - solid.first_id
        self._refuse(self.hub.fields.near(solid.x0_of(rows) + way, solid.half_size[rows] / 2))

        def move(points: Points) -> None:
            points.v[:] = self.velocity[:, None]
            points.x[:, self.axis] += way[self.axis]

        self.hub.simulation.insert(ids, move)
        self.entered += 1


class Outflow(Erosion):
    """Remove points that have entered a region.

    Parameters
    ----------
    region
        ID of the region in which points are removed.
    every
        Number of steps between checks.

    Example
    -------
    fix(out, outflow, all, wall)

    Notes
    -----
    Publishes sums since the start: ID_points, ID_mass and ID_energy, as in fix erosion.

    See Also
    --------
    inflow, erosion, boundary
    """

    syntax = "group, regionID, every=10"

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        region: Region,
        *,
        every: Annotated[int, Positive] = 10,
    ):
        Fix.__init__(self, hub, group)
        self.region, self.every = region, every

    def meeting(self, points: PointTable) -> np.ndarray | None:
        return points.numbers[self.region.inside(points.position)] if points.count else None
