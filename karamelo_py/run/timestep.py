"""The default time step as a fraction of the stable step, and its limits."""

from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import DT
from karamelo_py.kernels.clock import STILL, STRIDE
from karamelo_py.kernels.laws import law_on
from karamelo_py.points.kinematics import total
from karamelo_py.points.laws import (
    Absent,
    can,
    constrained_velocity,
    initial_state,
    law_traits,
    parameter,
    wave_speed_squared,
)
from karamelo_py.points.laws.eos import taken_heat
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.points.transfers import flip_coefficient, stores_moment
from karamelo_py.run.body_motion import motions
from karamelo_py.scene.hub import Hub
from karamelo_py.schemes.traits import USUAL

BOXES = 6.0  # weight of a common drift in the steps of boxes
LOST = 2.05  # times the stable step, beyond which every run that was tried failed
NO_LIMITS = ("set_dt", "end")  # of stability
LONE = 0.9  # of the stable step of a lone point: an expanded point is stiffer
DAMPED = 0.5  # minimum, with one point per cell, if a PIC fraction damps


def one_a_cell(solid: Any) -> bool:
    """Return True if a solid has one point per cell and direction, not two or more."""
    return 2 * np.max(solid.half_size) > 0.75 * solid.h


def sparse(hub: Hub) -> bool:
    """Return True if a solid has about one point per cell and direction."""
    return any(map(one_a_cell, hub.solids.values()))


def keeping_share(hub: Hub) -> float:
    """Return the largest fraction of the stable step with which a drifting body conserves energy.

    If points move from cell to cell and retain their velocities (FLIP and similar), gradient jumps
    add energy to a body, about as the third power of the step. The numbers come from the energy
    table of the documentation: at most 10 % in 50 periods.
    """
    update = hub.update
    alpha = flip_coefficient(update.transfer)
    if not update.method.frame.moves or not alpha > 0.9:
        return USUAL
    basis = update.method.basis.traits
    kind = basis.nodes_per_cell if basis.gradient_jumps else 0
    keeping = update.scheme.traits.keeping or ((USUAL, USUAL),) * 3
    share = keeping[kind][sparse(hub)]
    if alpha > 0.99:
        return share
    return max(share, DAMPED) if sparse(hub) else USUAL


def _keeps_velocities(hub: Hub) -> bool:
    """Return True if FLIP-like points move through the grid, without moments and usl."""
    update = hub.update
    return (
        update.method.frame.moves
        and flip_coefficient(update.transfer) > 0.9
        and not stores_moment(hub.update.transfer)
        and min(update.scheme.traits.courant) >= 1
    )


def _deforming(hub: Hub) -> list[Any]:
    laws = [solid.material.whole for solid in hub.solids.values()]
    return [law for law in laws if not can(law, constrained_velocity)]


def _flows(law: Any) -> bool:
    """Return True if a body of this law has no stable shape, like liquids and soils."""
    strength = parameter(law, "strength", None)
    return strength is not None and (law_traits(strength).flows or not shear_modulus(strength) > 0)


def lone_point(hub: Hub) -> float:
    """Return the stable step over h/c of an isolated point that stores a moment.

    The stored velocity gradient L responds to its pressure by dL/dt = -p / (rho D): an oscillator
    of the frequency c sqrt(d / D), stable up to dt = 2 sqrt(D / d) / c; if gradients are stored,
    sums of |grad N|^2 / N replace 1 / D. Points of flowing materials can become isolated; points of
    a gas then store no moments (`kernels.equations.loss.in_company`).
    """
    update = hub.update
    keeps = stores_moment(hub.update.transfer) and update.method.frame.moves
    stiff = update.method.basis.traits.lone
    flowing = any(_flows(law) and not can(law, taken_heat) for law in _deforming(hub))
    if not (keeps and stiff and flowing):
        return inf
    by_gradient = not update.transfer.traits.inverts_spread
    return LONE * 2 / sqrt(stiff[by_gradient] * hub.domain.dimension)


def bears_drift(hub: Hub) -> bool:
    """Return True if a drifting body is stable and conserves energy with the steps of one at rest.

    With cubic splines hardly any energy depends on the position in the cells; usavg adds none with
    smooth basis functions (50 periods at 0.05 to 0.5 of the wave speed, in 2D). Colliding disks
    fracture sooner with these steps.
    """
    basis, scheme = hub.update.method.basis.traits, hub.update.scheme
    laws = _deforming(hub)
    return (
        _keeps_velocities(hub)
        and len(laws) == 1  # one elastic or metallic solid
        and not _flows(laws[0])
        and not basis.gradient_jumps
        and (basis.bears_drift or scheme.traits.bears_drift)
        and keeping_share(hub) == USUAL
    )


def own_weight_of_drift(hub: Hub) -> float:
    """Return the weight of the common velocity in the default step.

    1 as in the rule of the language, h/(c + |v|). Drifting boxes (ugimp, cpgimp), two and more per
    cell, gain more energy at higher speed: at edges of shaken bars and blocks at 0.05 to 0.5 of the
    wave speed.
    """
    if bears_drift(hub):
        return 0.0
    basis = hub.update.method.basis.traits
    boxes = basis.steep_edge and basis.cells > 1
    fed = boxes and _keeps_velocities(hub) and not hub.update.scheme.traits.bears_drift
    return BOXES if fed and hub.update.transfer.alpha > 0.99 and not sparse(hub) else 1.0


def common_velocity(simulation: Any, weight: float) -> np.ndarray:
    """Return the reference velocity (3,) for speeds so that the common drift has this weight."""
    bodies = motions(simulation) if weight != 1 else []
    common = np.zeros(3)
    if bodies:
        mass = total([one.mass for one in bodies])
        common[: simulation.kin.dimension] = sum(one.mass * one.velocity for one in bodies) / mass
    return (1 - weight) * common


def courant_number(hub: Hub, *, longer: bool) -> float:
    """Return the stable step over h/c; `longer` is for points that stay at their positions.

    In the total frame the nodes of a thin or round body reduce it for points with moments.
    """
    update = hub.update
    other = update.scheme.traits.implicit or update.method.frame.moves
    if stores_moment(update.transfer) and not other:
        return min(_courant_of_scheme(hub, longer=longer), hub.simulation.light_nodes)
    return _courant_of_scheme(hub, longer=longer)


def _courant_of_scheme(hub: Hub, *, longer: bool) -> float:
    """Return the stable step over h/c of scheme, basis and points per cell."""
    scheme, method = hub.update.scheme, hub.update.method
    two, one = scheme.traits.courant
    if min(two, one) < 1:
        # Nodes between the corners of cells raise the highest frequency.
        nodes = 0.7 if method.basis.traits.nodes_per_cell > 1 else 1
        return (one if sparse(hub) else two) * nodes
    if not method.frame.moves:
        return method.basis.traits.courant_total
    if not longer:
        return 1.0
    basis = method.basis.traits
    if scheme.traits.strained_before == 1:
        return min(basis.courant_still, basis.courant_strained_first)
    return basis.courant_still


def own_step_of_waves(hub: Hub, *, still: bool) -> tuple[float, float]:
    """Return the stable step over h/c, and the default fraction of it.

    `still`: while no point has moved as far as `STILL`. The stable step depends on scheme, basis
    and points per cell.
    """
    method, share = hub.update.method, keeping_share(hub)
    # Transfers of moments are stable up to 1.3 h/c with quadratic splines, 1.5 with cubic ones.
    still &= method.frame.moves and not stores_moment(hub.update.transfer)
    if still:
        # A lone point with a linear basis is stable up to 0.8 h/c in 3D.
        share = max(share, DAMPED if sparse(hub) and hub.domain.dimension == 3 else USUAL)
    courant = courant_number(hub, longer=still or bears_drift(hub))
    return min(courant, lone_point(hub)), share


class StepPolicy(NamedTuple):
    """Choice of the steps of a run, made once at its beginning."""

    still: tuple[float, float]  # stable step over h/c, and the fraction of it, at rest
    moving: tuple[float, float]  # the same once points have moved
    weight: float  # of the common velocity in the default step
    fixed_dt: float  # 0: the step follows the fastest point; implicit steps are 1 by default
    heat_factor: float  # fraction of the limit of conduction

    @classmethod
    def of(cls, hub: Hub) -> "StepPolicy":
        """Return the choice by scheme, basis, points and the script."""
        update = hub.update
        fixed, heat = update.fixed_dt or float(update.scheme.traits.implicit), update.dt_factor
        if update.dt_factor is None and update.fixed_dt is None:
            own = (own_step_of_waves(hub, still=still) for still in (True, False))
            return cls(*own, own_weight_of_drift(hub), fixed, USUAL)
        # Steps requested by a script are fractions of h/(c + |v|), at rest as after.
        given = courant_number(hub, longer=False), update.dt_factor or keeping_share(hub)
        return cls(given, given, 1.0, fixed, heat or USUAL)

    def numbers(self, path: float, halvings: int) -> dict[str, float]:
        """Return what the clock gets after a `path` of the points, in cells."""
        (courant, share), part = self.still if path <= STILL else self.moving, 1 / 2**halvings
        return {
            "courant": courant,
            "courant_moving": self.moving[0],
            "fixed_dt": self.fixed_dt * part,
            "heat_factor": self.heat_factor * part,
            "dt_factor": share * part,
            "dt_factor_moving": self.moving[1] * part,
        }


def own_step(hub: Hub, simulation: Any, *, still: bool = False) -> float:
    """Return the default step now: at rest, or as if points had moved."""
    clock = simulation.control.clock[0]
    courant, share = own_step_of_waves(hub, still=still)
    weight = own_weight_of_drift(hub)
    rate = clock.rate if weight == clock.weight else simulation.rate_with(weight)
    limit = courant * clock.spacing / rate if rate > 0 else inf
    step = min(share * limit, USUAL * clock.heat_limit)
    speed = simulation.fastest() if weight != 1 else 0.0
    return float(min(step, STRIDE * clock.spacing / speed) if speed > 0 else step)


def _borne(hub: Hub, simulation: Any) -> float:
    """Find the largest stable step of points at their positions."""
    clock = simulation.control.clock[0]
    return own_step_of_waves(hub, still=clock.path <= STILL)[0] * clock.spacing / clock.rate


def blows_up(hub: Hub, simulation: Any) -> bool:
    """Return True if the step is so far above the stable one that a run fails."""
    return simulation.dt > LOST * _borne(hub, simulation)


def what_follows(hub: Hub, simulation: Any, step: float) -> str:
    """Describe the known effects of a `step` above the stable one for moving bodies."""
    borne = _borne(hub, simulation)
    if step <= borne:
        return (
            " of bodies that move through the grid (spurious energy gain); up to "
            f"{borne:.4g} is stable at rest"
        )
    if step <= LOST * borne:
        return ": the run may become unstable, depending on where points lie in their cells"
    return ": the run will most likely become unstable"


def own_step_instead_of(hub: Hub, simulation: Any) -> float | None:
    """Return the default step; None if the script does not override it."""
    if hub.update.dt_factor is None and hub.update.fixed_dt is None:
        return None
    still = simulation.control.clock[0].path <= STILL
    return own_step(hub, simulation, still=still)


def words_of_own_step(hub: Hub, simulation: Any, step: float) -> str:
    """Describe the default step, see `own_step_instead_of`, and how long it is that."""
    after = own_step(hub, simulation, still=False)
    far = f", {after:.6g} once points have gone a quarter of a cell"
    return f"{step:.6g}" + (far if after < step else "")


def stable_step(hub: Hub, simulation: Any, limit: float) -> float:
    """Return the stable step if a script sets the step: `limit`, or the default's."""
    return max(limit, own_step(hub, simulation) / USUAL)


def own_step_instead(hub: Hub, command: str = "") -> str:
    """Return the fix for a step that is too large, by the command that set it."""
    if command == "set_dt" or (not command and hub.update.fixed_dt is not None):
        return f"set_dt({own_step(hub, hub.simulation):.3g}) or less, or remove set_dt"
    share = own_step(hub, hub.simulation) / hub.simulation.limit_moving
    given = hub.update.dt_factor is not None
    return f"dt_factor({share:.3g}) or less" + ", or remove dt_factor" * given


def step_by_script(fixed_dt: float | None, dt_factor: float | None) -> str:
    """Name the step set by a script, as a key for messages already given."""
    return f"set_dt {fixed_dt}" if fixed_dt else f"dt_factor {dt_factor}"


def words_of_share(hub: Hub) -> str:
    """Describe the fraction of the stable step, and its meaning."""
    asked, keeping = hub.update.dt_factor, keeping_share(hub)
    if hub.update.fixed_dt is not None:
        share = hub.update.fixed_dt / stable_step(hub, hub.simulation, hub.simulation.limit)
        words = f"{share:.3g} of the stable step"
    elif asked is None:
        clock = hub.simulation.control.clock[0]
        of_heat = ruling_limit(hub.simulation) == "conduction"
        words = f"{USUAL if of_heat else float(clock.dt_factor):g} of the stable step, "
        words += "the program's own"
        after = clock.dt_factor_moving * clock.courant_moving / (clock.dt_factor * clock.courant)
        far = f"; {after:.2g} of that once points have gone a quarter of a cell"
        return words if after == 1 else words + far
    else:
        share = asked
        words = f"{share:g} of the stable step, by dt_factor"
    # `large_steps` warns of a fraction above 1.
    if max(keeping, 1e-9) * (1 + 1e-9) < share <= 1 and keeping < USUAL:
        return words + f": above {keeping:g} a body that drifts gains energy"
    return words


def ruling_limit(simulation: Any) -> str:
    """Return the name of the present limit of the step.

    ``set_dt`` and ``end`` (of the run) are not stability limits. ``conduction`` is the limit of
    heat, ``viscosity`` of waves slowed by viscosity, ``speed`` of points faster than waves,
    ``light_nodes`` of usl and of :mod:`karamelo_py.run.light_nodes`, ``lone_points`` of points with
    moments, and ``waves`` of the rest.
    """
    control = simulation.control
    clock = control.clock[0]
    if clock.fixed_dt > 0:
        return "set_dt"
    waves = clock.courant * clock.spacing / clock.rate if clock.rate > 0 else inf
    of_waves, of_heat = clock.dt_factor * waves, clock.heat_factor * clock.heat_limit
    if clock.weight != 1 and clock.speed * control.values[DT] * (1 + 1e-9) >= STRIDE:
        return "speed"
    if control.values[DT] < min(of_waves, of_heat) * (1 - 1e-9):
        return "end"
    if of_heat < of_waves:
        return "conduction"
    speed = simulation.fastest(clock.common[0])
    if speed > 0.5 * clock.rate:
        return "speed"
    undeformed = [elastic_speed(simulation, solid) for solid in simulation.hub.solids.values()]
    without = max(wave for wave, _ in undeformed)
    slowed = any(viscous for _, viscous in undeformed)
    if slowed and 0 < without < (clock.rate - speed) / 1.2:
        return "viscosity"
    if clock.courant < 1:
        return "lone_points" if clock.courant == lone_point(simulation.hub) else "light_nodes"
    return "waves"


def fastest_wave(simulation: Any) -> float:
    """Find the fastest wave in the undeformed materials, without viscosity."""
    return max(elastic_speed(simulation, solid)[0] for solid in simulation.hub.solids.values())


def elastic_speed(simulation: Any, solid: Any) -> tuple[float, bool]:
    """Find the fastest wave of an undeformed solid without viscosity, and whether it is viscous."""
    law, viscous = law_on(solid.material.whole, solid.h, solid.T0), False
    if not isinstance(parameter(law, "viscosity", Absent()), Absent):
        law, viscous = law._replace(viscosity=Absent()), True
    if parameter(parameter(law, "strength"), "mu") > 0:
        law, viscous = law._replace(strength=law.strength._replace(mu=0.0)), True
    kin = simulation.kin
    return sqrt(float(wave_speed_squared(law, kin, initial_state(law, kin, 1.0)))), viscous
