"""The default step, the stable step, and the step set in the script."""

from math import inf

from karamelo_py.kernels.clock import STILL, STRIDE
from karamelo_py.language import registry
from karamelo_py.run.lower.hooks import is_wet
from karamelo_py.run.lower.solved_pressure import unsupported
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.stable_step import (
    conserving_fraction,
    courant_of,
    fastest_wave,
    own_step_of_waves,
    own_weight_of_drift,
    sparse,
)
from karamelo_py.scene.modify import Fix
from karamelo_py.schemes.semi_implicit import SemiImplicit
from karamelo_py.schemes.traits import DEFAULT_FRACTION

LOST = 2.05  # step / stable step above which every run failed
EXPLAINED = {"light_nodes": " (nodes with little mass)", "lone_points": " (points alone in cells)"}


def own_step(simulation: Simulation, *, still: bool = False) -> float:
    """Return the present default step; if `still`, the default step at rest."""
    control, steps = simulation.control, simulation.steps
    motion, spacing = control.motion[0], control.step[0].spacing
    courant, fraction = own_step_of_waves(simulation.hub, still=still)
    weight = own_weight_of_drift(simulation.hub)
    rate = motion.rate if weight == motion.weight else steps.rate_with(weight)
    limit = courant * spacing / rate if rate > 0 else inf
    step = min(fraction * limit, DEFAULT_FRACTION * control.heat[0].heat_limit)
    speed = simulation.fastest() if weight != 1 else 0.0
    return float(min(step, STRIDE * spacing / speed) if speed > 0 else step)


def _stable_in_place(simulation: Simulation) -> float:
    step, motion = simulation.control.step[0], simulation.control.motion[0]
    courant, _ = own_step_of_waves(simulation.hub, still=motion.path <= STILL)
    return courant * step.spacing / motion.rate


def blows_up(simulation: Simulation) -> bool:
    return simulation.dt > LOST * _stable_in_place(simulation)


def what_follows(simulation: Simulation, step: float) -> str:
    stable = _stable_in_place(simulation)
    if step <= stable:
        return (
            " of bodies that move through the grid (spurious energy gain); up to "
            f"{stable:.4g} is stable at rest"
        )
    if step <= LOST * stable:
        return ": the run may become unstable, depending on where points lie in their cells"
    return ": the run will most likely become unstable"


def own_step_instead_of(simulation: Simulation) -> float | None:
    update = simulation.hub.update
    if update.dt_factor is None and update.fixed_dt is None:
        return None
    return own_step(simulation, still=simulation.control.motion[0].path <= STILL)


def words_of_own_step(simulation: Simulation, step: float) -> str:
    after = own_step(simulation, still=False)
    far = f", {after:.6g} once points have moved a quarter of a cell"
    return f"{step:.6g}" + (far if after < step else "")


def step_after_motion(simulation: Simulation) -> float:
    update, step = simulation.hub.update, simulation.control.step[0]
    if update.fixed_dt is not None or update.dt_factor is not None:
        return 1.0
    return step.dt_factor_moving * step.courant_moving / (step.dt_factor * step.courant)


def stable_step(simulation: Simulation, limit: float) -> float:
    return max(limit, own_step(simulation) / DEFAULT_FRACTION)


def own_step_instead(simulation: Simulation, command: str = "") -> str:
    update = simulation.hub.update
    if command == "set_dt" or (not command and update.fixed_dt is not None):
        return f"set_dt({own_step(simulation):.3g}) or less, or remove set_dt"
    fraction = own_step(simulation) / simulation.steps.limit_moving
    return f"dt_factor({fraction:.3g}) or less" + ", or remove dt_factor" * bool(update.dt_factor)


def step_by_script(fixed_dt: float | None, dt_factor: float | None) -> str:
    return f"set_dt {fixed_dt}" if fixed_dt else f"dt_factor {dt_factor}"


def words_of_limit(simulation: Simulation) -> str:
    limit, scheme = simulation.ruling_limit, simulation.hub.update.scheme
    words = EXPLAINED.get(limit, "")
    lossless = simulation.hub.update.transfer.traits.lossless
    if limit == "light_nodes" and max(scheme.traits.courant) < 1 and not lossless:
        courant = float(simulation.control.step[0].courant)
        name = registry.name_of("scheme", type(scheme))
        words = f" and nodal modes in scheme {name}, stable up to {courant:.2g} h/c"
    return limit + words


def words_of_fraction(simulation: Simulation) -> str:
    hub, steps = simulation.hub, simulation.steps
    asked, conserving = hub.update.dt_factor, conserving_fraction(hub)
    if hub.update.fixed_dt is not None:
        fraction = hub.update.fixed_dt / stable_step(simulation, steps.limit)
        words = f"{fraction:.3g} of the stable step"
    elif asked is None:
        step = simulation.control.step[0]
        of_heat = simulation.ruling_limit == "conduction"
        words = f"{DEFAULT_FRACTION if of_heat else float(step.dt_factor):g} of the stable step, "
        words += "the program's own"
        after = step_after_motion(simulation)
        far = f"; {after:.2g} of that once points have moved a quarter of a cell"
        return words if after == 1 else words + far
    else:
        fraction = asked
        words = f"{fraction:g} of the stable step, by dt_factor"
    # `large_steps` warns of a fraction above 1.
    if max(conserving, 1e-9) * (1 + 1e-9) < fraction <= 1 and conserving < DEFAULT_FRACTION:
        return words + f": above {conserving:g} a body that drifts gains energy"
    return words


def words_of_solution(simulation: Simulation, duration: float) -> str:
    """Return how many steps semi-implicit would take, or "" if it does not support the scene."""
    hub = simulation.hub
    fits = is_wet(hub) and not hub.domain.periodic
    traits = hub.update.scheme.traits
    explicit = not traits.implicit and not traits.solves_pressure
    alone = hub.settings.engine == "processor" and hub.settings.comm.size == 1
    refused = any(map(_is_refused, hub.fixes.values())) or any(unsupported(hub, ""))
    if not (fits and alone and explicit) or refused:
        return ""
    courant = DEFAULT_FRACTION * courant_of(hub, SemiImplicit)[sparse(hub)]
    dt = courant * float(simulation.control.step[0].spacing) / fastest_wave(simulation)
    return f"with scheme(semi-implicit), limited by the dry soil, about {duration / dt:.0f} steps"


def _is_refused(fix: Fix) -> bool:
    yields = fix.wall_friction is not None or (fix.held_directions and not fix.prescribes_velocity)
    return bool(yields or (fix.restrictions and "semi-implicit" in fix.restrictions.without))
