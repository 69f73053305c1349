"""Fixes of point velocities."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

from karamelo_py.kernels.equations.twist import VelocityAround
from karamelo_py.language.rules import known_failure
from karamelo_py.output.point_table import places_before
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, InitialFix, PointsView, per_direction, point_hook
from karamelo_py.script.errors import plural
from karamelo_py.script.expressions import FIRST, Expression
from karamelo_py.styles.fixes.formulas import AXES, unlike

SAMPLE = 1000
ALIKE = 1e-6  # relative difference of velocities below which they count as equal
DIFFERENT = " how they move, the other how they deform"


def start(pt):
    return pt.before, pt.x, 0.0


def carry(pt):
    return pt.value, pt.x_old + pt.dt * pt.value, pt.mass * (pt.value - pt.v) / pt.kick


class VelocityOfPoints(Fix):
    syntax = "group, vx[, vy[, vz]]"

    around: Expression | None = None  # velocity around the axis

    def __init__(self, hub: Hub, group: ParticleGroup, *velocity: Expression | None):
        super().__init__(hub, group)
        if self.first_step_only and isinstance(hub.require_domain().kin, Twisted):
            velocity, self.around = velocity[:2], next(iter(velocity[2:]), None)
        self.formulas = per_direction(hub, "v", velocity)


class VelocityParticles(VelocityOfPoints):
    """Prescribe the velocity of points, such as a grip that moves other points through the grid.

    Parameters
    ----------
    velocity
        vx, vy, vz, one per dimension: functions of x, y, z, x0, y0, z0, time and published values.
        NULL leaves a component free.

    Example
    -------
    fix(grip, velocity_particles, top, 0, 0.01*time)

    Notes
    -----
    Publishes the force on the points as ID_x, ID_y, ID_z. If several such fixes include a point and
    direction, the last one applies. Prescribed velocities of points also override initial
    velocities and held nodes, with a warning before the run.

    A grip should be at least two cells thick: its nodes near other points have a mean velocity, so
    the outer cell of the grip deforms with the body. In ulmpm (linear, quadratic-spline,
    cubic-spline), a solid squeezed by 20 % slips past a grip one cell thick.

    See Also
    --------
    velocity_nodes, initial_velocity_particles
    """

    published = ("x", "y", "z")
    leads_points = exerts = True

    initial_integrate = point_hook(start, publishes=False, uses_before=True)
    post_advance_particles = point_hook(carry, uses_before=True)


class InitialVelocityParticles(InitialFix, VelocityOfPoints):
    """Set the velocity of points once, before the next step.

    Parameters
    ----------
    velocity
        vx, vy, vz: functions of x, y, z, x0, y0, z0. NULL leaves a component unchanged; in 1D and
        2D, omit the last ones or set them to NULL or 0. With axisymmetric(true, twist=true), vz is
        the velocity around the axis.

    Example
    -------
    fix(v1, initial_velocity_particles, ball, 0.1, 0.1, NULL)
    fix(mode, initial_velocity_particles, all, 0.1*sin(PI*x0/50))

    Notes
    -----
    If the transfer stores a velocity gradient or affine velocity (APIC, TPIC ...), points also get
    the gradient of the formulas, so that the first step is exact for an affine motion.

    See Also
    --------
    initial_velocity_nodes, velocity_particles
    """

    def initial_integrate(self, points: PointsView) -> None:
        v = points.velocity
        x = x0 = points.position
        if any(formula is not None and formula.names & FIRST for formula in self.formulas):
            x0 = points.reference_position
        for k, formula in enumerate(self.formulas):
            if formula is not None:
                evaluate = partial(formula.evaluate_points, self.hub.values)
                v[:, k] = evaluate(x, x0)
                points.set_velocity_gradient(k, partial(gradient, evaluate, x, x0))
        points.velocity = v
        if self.around is not None:
            x0 = points.reference_position
            points[VelocityAround][:, 0] = self.around.evaluate_points(self.hub.values, x, x0)


def gradient(
    evaluate: Callable, x: np.ndarray, x0: np.ndarray, moves: bool, step: float
) -> np.ndarray:
    """Return derivatives (n, d) with respect to x (if `moves`) or x0.

    The derivatives are central differences over `step`.

    At points that have not moved, x0 is varied together with x.
    """
    out = np.zeros_like(x, float)
    # The tolerance allows for rounding in single precision.
    unmoved = (np.abs(x - x0) <= 0.01 * step).all(axis=1)
    for k in range(x.shape[1]):
        shift = np.zeros_like(out)
        shift[:, k] = step
        present = shift if moves else shift * unmoved[:, None]
        reference = shift * unmoved[:, None] if moves else shift
        ahead = evaluate(x + present, x0 + reference)
        behind = evaluate(x - present, x0 - reference)
        out[:, k] = (ahead - behind) / (2 * step)
    return out


def _conflicts(fix: Any, simulation: Any) -> Iterator[dict[str, Any]]:
    fixes = list(simulation.hub.fixes.values())
    first = [one for one in simulation.fixes.new if isinstance(one, VelocityOfPoints)]
    if not (fix.leads_points or fix in first):
        return
    led = [one for one in fixes[: fixes.index(fix)] if one.leads_points]
    for other in led if fix.leads_points else ():
        axes, shared = unlike(other, fix), _shared(simulation, other, fix)
        if axes and len(shared):
            yield _said(other, axes, shared)
    # A velocity of all points, followed by another velocity for some of them, is intended.
    for other in first[: first.index(fix)] if fix in first else first:
        axes, shared = unlike(other, fix), _shared(simulation, other, fix)
        if axes and 0 < len(shared) == len(simulation.points.members(other.group)):
            axes = [k for k in axes if _differ(simulation, other, fix, k, shared)]
            if axes:
                yield _said(other, axes, shared)
    for other in fixes if fix.leads_points else ():
        axes = unlike(other, fix) if other.prescribes_velocity else []
        caught = _within(simulation, other, fix) if axes else ()
        if 2 * len(caught) > len(simulation.points.members(fix.group)):
            yield _said(other, axes, caught)


def _said(other: Any, axes: list[int], ids: np.ndarray) -> dict[str, Any]:
    by_nodes = other.prescribes_velocity
    return {
        "other": other,
        "points": "all nodes around " * by_nodes + plural(len(ids), "point"),
        "axes": " and ".join(f"v{AXES[k]}" for k in axes),
        "more": DIFFERENT * by_nodes,
        "apart": ("groups without common points", "nodes that these points do not reach")[by_nodes],
    }


def _shared(simulation: Any, other: Any, fix: Any) -> np.ndarray:
    ids = simulation.points.members(other.group)
    return ids[fix.group.has(ids)]


def _differ(simulation: Any, other: Any, fix: Any, axis: int, ids: np.ndarray) -> bool:
    ids = ids[:: max(1, len(ids) // SAMPLE)]
    x, x0 = simulation.hub.fields.position[ids], places_before(simulation.hub, ids)
    values = simulation.hub.values
    a, b = (one.formulas[axis].evaluate_points(values, x, x0) for one in (other, fix))
    small = ALIKE * max(np.abs(a).max(), np.abs(b).max(), float(simulation.control.motion[0].rate))
    return bool((np.abs(a - b) > small).any())


def _within(simulation: Any, support: Any, driven: Any) -> np.ndarray:
    hub, method = simulation.hub, simulation.hub.update.method
    still = np.zeros(support.group.total(), np.bool_)
    still[support.nodes] = True
    ids = simulation.points.members(driven.group)
    x = hub.fields.position[ids] if method.frame.moves else places_before(hub, ids)
    caught = np.zeros(len(ids), np.bool_)
    for solid in hub.solids.values():
        lattice = hub.lattices[method.lattice_of(hub, solid)]
        rows = np.flatnonzero(hub.fields.solid[ids] == solid.index)
        caught[rows] = still[lattice.around(lattice.cells_of(x[rows]), (0, 1))].all(axis=0)
    return ids[caught]


known_failure(
    VelocityOfPoints,
    "velocities of '{other.id}' and '{part.id}'",
    when=lambda fix, scene: list(_conflicts(fix, scene.simulation)),
    reason="fix '{other.id}' (line {other.mark.line}) gives {points} of this group a different "
    "{axes}: this fix applies{more}",
    cure="{apart}, or NULL for one of the components",
)
