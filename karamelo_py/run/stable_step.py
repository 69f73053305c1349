"""The stable step / (h/c), and its default fraction."""

from math import inf, sqrt

import numpy as np

from karamelo_py.kernels.arrays import DT, Tag
from karamelo_py.kernels.clock import STRIDE
from karamelo_py.kernels.laws import law_on
from karamelo_py.points.kinematics import Space, total
from karamelo_py.points.laws import (
    Absent,
    can,
    conductivity,
    constrained_velocity,
    heat_capacity,
    initial_state,
    law_traits,
    parameter,
    specific_volume,
    wave_speed_squared,
)
from karamelo_py.points.laws.eos import taken_heat
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.points.laws.viscosity import inviscid
from karamelo_py.points.transfers import flip_coefficient, stores_moment
from karamelo_py.run.body_motion import motions
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.schemes.traits import DEFAULT_FRACTION, SchemeTraits

BOX_WEIGHT = 6.0  # weight of the common velocity, for domains that are boxes
SLOWED = 1.2  # viscous / elastic wave speed above which viscosity limits the step
LONE = 0.9  # fraction of an isolated point's stable step; expanded points are stiffer
# With mass=corrected in the total frame, blocks with one point per cell gain energy at 0.73 times
# the stable step.
CORRECTED_TOTAL = 0.7
# Replaces LONE if mass=corrected. In splashes of a dam break with two points per cell, energy grew
# at 0.43 h/c, but not at 0.38 h/c.
CORRECTED_LONE = 0.55
DAMPED = 0.5  # smallest default fraction with one point per cell, if the transfer damps


def one_a_cell(solid: Solid) -> bool:
    return 2 * np.max(solid.half_size) > 0.75 * solid.h


def sparse(hub: Hub) -> bool:
    return any(map(one_a_cell, hub.solids.values()))


def conserving_fraction(hub: Hub) -> float:
    """Return the largest fraction of the stable step at which a drifting body gains no energy.

    With FLIP and similar transfers, jumps of gradients add energy to points that cross cells; the
    gain is about proportional to dt^3. With these fractions (docs/energy.md), the gain is at most
    10 % in 50 periods.
    """
    update = hub.update
    alpha = flip_coefficient(update.transfer)
    if not update.method.frame.moves or not alpha > 0.9:
        return DEFAULT_FRACTION
    basis = update.method.basis.traits
    kind = basis.nodes_per_cell if basis.gradient_jumps else 0
    conserving = update.scheme.traits.conserving or ((DEFAULT_FRACTION, DEFAULT_FRACTION),) * 3
    fraction = conserving[kind][sparse(hub)]
    if alpha > 0.99:
        return fraction
    return max(fraction, DAMPED) if sparse(hub) else DEFAULT_FRACTION


def _retains_velocities(hub: Hub) -> bool:
    """Return True for FLIP-like transfers, except in usl: points retain unresolved velocities."""
    update = hub.update
    return (
        update.method.frame.moves
        and flip_coefficient(update.transfer) > 0.9
        and not stores_moment(hub.update.transfer)
        and min(update.scheme.traits.courant) >= 1
    )


def _deforming(hub: Hub) -> list[Tag]:
    laws = [solid.material.whole for solid in hub.solids.values()]
    return [law for law in laws if not can(law, constrained_velocity)]


def _flows(law: Tag) -> bool:
    strength = parameter(inviscid(law), "strength", None)
    return strength is not None and (law_traits(strength).flows or not shear_modulus(strength) > 0)


def lone_point(hub: Hub) -> float:
    """Return the stable step / (h/c) of an isolated point that stores a moment.

    The pressure accelerates the stored velocity gradient L by dL/dt = -p / (rho D). This is an
    oscillator of frequency c sqrt(d / D), stable up to dt = 2 sqrt(D / d) / c. If points store
    gradients, sums of |grad N|^2 / N replace 1 / D. Points of flowing material may become isolated;
    points of gases then store no moments (`kernels.equations.loss.retained_moment`).
    """
    update = hub.update
    keeps = stores_moment(hub.update.transfer) and update.method.frame.moves
    stiff = update.method.basis.traits.lone
    flowing = any(_flows(law) and not can(law, taken_heat) for law in _deforming(hub))
    if not (keeps and stiff and flowing):
        return inf
    by_gradient = not update.transfer.traits.inverts_spread
    usl = min(update.scheme.traits.courant) < 1 and not by_gradient
    factor = CORRECTED_LONE if update.method.corrected else LONE
    factor *= update.transfer.traits.lone_fractions[usl]
    return factor * 2 / sqrt(stiff[2 if usl else by_gradient] * hub.domain.dimension)


def allows_drift(hub: Hub) -> bool:
    """Return True if a drifting body is as stable and conservative as a body at rest.

    With cubic splines, the energy hardly depends on the position in the cells; usavg adds none with
    smooth bases (50 periods at 0.05 to 0.5 of the wave speed, in 2D). Colliding disks fracture
    sooner with these steps.
    """
    basis, scheme = hub.update.method.basis.traits, hub.update.scheme
    laws = _deforming(hub)
    return (
        _retains_velocities(hub)
        and len(laws) == 1  # a single elastic or metallic solid
        and not _flows(laws[0])
        and not basis.gradient_jumps
        and (basis.allows_drift or scheme.traits.allows_drift)
        and conserving_fraction(hub) == DEFAULT_FRACTION
    )


def own_weight_of_drift(hub: Hub) -> float:
    """Return the weight of the common velocity in the default step.

    The standard rule h/(c + |v|) has weight 1; if drift is harmless, the weight is 0. The weight is
    larger for two or more boxes (ugimp, cpgimp) per cell: at edges of vibrating bars and blocks
    that drift at 0.05 to 0.5 of the wave speed, the energy gain increases with speed.
    """
    if allows_drift(hub):
        return 0.0
    basis = hub.update.method.basis.traits
    boxes = basis.steep_edge and basis.cells > 1
    fed = boxes and _retains_velocities(hub) and not hub.update.scheme.traits.allows_drift
    return BOX_WEIGHT if fed and hub.update.transfer.alpha > 0.99 and not sparse(hub) else 1.0


def common_velocity(simulation: SceneState, weight: float) -> np.ndarray:
    bodies = motions(simulation) if weight != 1 else []
    common = np.zeros(3)
    if bodies:
        mass = total([one.mass for one in bodies])
        common[: simulation.kin.dimension] = sum(one.mass * one.velocity for one in bodies) / mass
    return (1 - weight) * common


def courant_number(hub: Hub, *, longer: bool) -> float:
    """Return the stable step / (h/c); `longer`: for points that remain in their cells.

    In the total frame, if points have moments, light nodes of thin and round bodies limit the step.
    """
    update = hub.update
    total = not (update.scheme.traits.implicit or update.method.frame.moves)
    courant = _courant_of_scheme(hub, longer=longer)
    if stores_moment(update.transfer) and total:
        courant = min(courant, hub.simulation.light_nodes)
        if update.scheme.traits.maps_velocity_again:
            courant *= update.transfer.traits.fraction_in_total
    return courant * corrected_fraction(hub)


def corrected_fraction(hub: Hub) -> float:
    """Return the factor by which mass=corrected changes the stable step."""
    method = hub.update.method
    if not method.corrected:
        return 1.0
    return method.basis.traits.corrected_fraction if method.frame.moves else CORRECTED_TOTAL


def courant_of(hub: Hub, scheme: Tag) -> tuple[float, float]:
    """Return the stable step / (h/c) of a scheme with two points per cell, and with one."""
    traits: SchemeTraits = scheme.traits
    of_dry = traits.courant_of_dry
    return traits.courant if of_dry is None or _is_all_wet(hub) else of_dry


def _is_all_wet(hub: Hub) -> bool:
    """Return True if water at least as stiff as the soil fills all solids."""
    kin = Space()
    for solid in hub.solids.values():
        law, fluid = solid.material.whole, solid.material.fluid
        square = wave_speed_squared(law, kin, initial_state(law, kin, 1.0))
        if fluid is None or fluid.stiffness * specific_volume(law) < square:
            return False
    return True


def _courant_of_scheme(hub: Hub, *, longer: bool) -> float:
    update = hub.update
    scheme, method = update.scheme, update.method
    two, one = courant_of(hub, scheme)
    if min(two, one) < 1 and not update.transfer.traits.lossless:
        # Nodes between cell corners increase the highest frequency.
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
    """Return the stable step / (h/c), and the default fraction of the stable step.

    `still`: no point has moved as far as `STILL`.
    """
    method, fraction = hub.update.method, conserving_fraction(hub)
    # Transfers with moments are stable up to 1.3 h/c with quadratic splines, 1.5 with cubic.
    still &= method.frame.moves and not stores_moment(hub.update.transfer)
    if still:
        # With a linear basis in 3D, an isolated point is stable up to 0.8 h/c.
        damps = sparse(hub) and hub.domain.dimension == 3
        fraction = max(fraction, DAMPED if damps else DEFAULT_FRACTION)
    courant = courant_number(hub, longer=still or allows_drift(hub))
    return min(courant, lone_point(hub)), fraction


def fastest_wave(simulation: SceneState) -> float:
    return max(elastic_speed(simulation, solid)[0] for solid in simulation.hub.solids.values())


def elastic_speed(simulation: SceneState, solid: Solid) -> tuple[float, bool]:
    law, kin = law_on(solid.material.whole, solid.h, solid.T0), simulation.kin
    viscous = not isinstance(parameter(law, "viscosity", Absent()), Absent)
    law = law._replace(viscosity=Absent()) if viscous else law
    whole, square = (
        float(wave_speed_squared(one, kin, initial_state(one, kin, 1.0)))
        for one in (law, inviscid(law))
    )
    return sqrt(square), viscous or whole > SLOWED**2 * square


def stable_conduction(hub: Hub) -> float:
    """Return the smallest stable step of conduction in undeformed bodies.

    The step is h^2 / (4 d) capacity / conductivity. This step is half of the bound for lumped
    finite elements, since points may be anywhere in a cell.
    """
    if not hub.update.thermal:
        return inf
    limits = [inf]
    per_cell = hub.update.method.basis.traits.nodes_per_cell
    for solid in hub.solids.values():
        law = solid.material.law
        kappa = conductivity(law, 1.0)
        if kappa > 0:
            capacity = heat_capacity(law, 1.0) / specific_volume(law)
            limits.append((solid.h / per_cell) ** 2 / (4 * hub.domain.dimension) * capacity / kappa)
    return min(limits)


def ruling_limit(state: SceneState) -> str:
    step, motion = state.control.step[0], state.control.motion[0]
    dt, heat = state.control.values[DT], state.control.heat[0]
    if step.fixed_dt > 0:
        return "set_dt"
    rate = max(motion.rate, motion.closing)
    waves = step.courant * step.spacing / rate if rate > 0 else inf
    of_waves, of_heat = step.dt_factor * waves, step.heat_factor * heat.heat_limit
    if motion.weight != 1 and motion.speed * dt * (1 + 1e-9) >= STRIDE:
        return "speed"
    if dt < min(of_waves, of_heat) * (1 - 1e-9):
        return "end"
    if of_heat < of_waves:
        return "conduction"
    speed = state.fastest(motion.common[0])
    if speed > 0.5 * rate:
        return "speed"
    undeformed = [elastic_speed(state, solid) for solid in state.hub.solids.values()]
    without = max(wave for wave, _ in undeformed)
    slowed = any(viscous for _, viscous in undeformed)
    if slowed and 0 < without < (rate - speed) / SLOWED:
        return "viscosity"
    solves_pressure = state.hub.update.scheme.traits.solves_pressure
    if step.courant < corrected_fraction(state.hub) and not solves_pressure:
        return "lone_points" if step.courant == lone_point(state.hub) else "light_nodes"
    return "waves"
