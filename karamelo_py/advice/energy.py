"""Limits of a run's energy balance, and the causes of a gain or loss."""

import numpy as np

from karamelo_py.advice import step_size
from karamelo_py.advice.facts import SceneFacts
from karamelo_py.language import registry
from karamelo_py.output.point_table import PointTable
from karamelo_py.points.transfers import flip_coefficient
from karamelo_py.run import stable_step
from karamelo_py.run.energy import GROWING
from karamelo_py.run.listening import Trouble, when
from karamelo_py.run.lower.hooks import is_wet
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub

LOSS = 0.05  # lost fraction for a warning at the end of a run; WITHIN: before the end
LEAST = 5e-4  # fraction of the largest energy below which losses by contact are not shown
WATER = (
    "pore pressures that change within a cell, which explicit steps with splines smooth",
    "linear, or scheme(semi-implicit)",
)
WHOLE = "more points per cell, a finer grid, cpgimp or ulcpdi, or method tlmpm"


def not_watched(why: str) -> str:
    return f"not monitored: the work of {why} is not tracked"


def cause_of_gain(hub: Hub, simulation: Simulation) -> tuple[str, str]:
    update, method = hub.update, hub.update.method
    transfer = registry.name_of("transfer", type(update.transfer))
    scheme = registry.name_of("scheme", type(update.scheme))
    basis = f"a {method.basis_name} basis"
    moves, jumps = method.frame.moves, method.basis.traits.gradient_jumps
    if simulation.implicit:
        return _gain_of_implicit_steps(hub)
    fraction = simulation.dt / step_size.stable_step(simulation, simulation.steps.limit)
    conserving = stable_step.conserving_fraction(hub)
    smooth = "a basis with smooth gradients (quadratic-spline), or method tlmpm"
    if fraction > 1 + 1e-9:
        above = f"time step is {fraction:.3g} x the stability limit"
        return above, step_size.own_step_instead(simulation)
    if update.boundary == "reflect" and simulation.bounces:
        pressed = "points pressed against an edge of the domain with boundary(reflect)"
        return pressed, "fix velocity_nodes along walls instead of boundary(reflect)"
    courant, _ = stable_step.own_step_of_waves(hub, still=False)
    # The wave speed is of undeformed bodies, which may have softened since.
    fastest = stable_step.fastest_wave(simulation)
    across = float(simulation.control.step[0].spacing) / fastest if fastest > 0 else np.inf
    stable = courant * across
    if update.fixed_dt is not None and simulation.dt > stable * (1 + 1e-9):
        alone = " of an isolated point" * (courant == stable_step.lone_point(hub))
        return (
            f"time step is {simulation.dt / stable:.3g} x the stability limit{alone} in the "
            f"undeformed state ({stable:.4g})",
            f"set_dt({stable_step.DEFAULT_FRACTION * stable:.3g}) or less, or remove set_dt",
        )
    if smooths_water(hub):
        return WATER
    if moves and jumps and update.transfer.traits.inverts_spread:
        return f"{transfer} with {basis} in the updated frame", f"FLIP, or {smooth}"
    gradients = SceneFacts(hub, simulation, simulation.time).moments
    if jumps and gradients and not update.transfer.traits.retains:
        return f"{transfer} with {basis} in a body that moves through the grid", smooth
    if update.anti_locking and moves:
        return "F-bar in the updated frame", "remove anti_volumetric_locking"
    if conserving < stable_step.DEFAULT_FRACTION and fraction > conserving * (1 + 1e-9):
        points = " with one point per cell" if stable_step.sparse(hub) else ""
        return (
            f"points crossing cells: {transfer} and {scheme} with {basis}{points} at "
            f"{fraction:.2g} x the stability limit",
            f"{_step_of(hub, simulation, conserving)}, scheme(usavg), or {smooth}",
        )
    if moves and simulation.points.largest(swelling)[0] > 1.5:  # neighbouring points are apart
        return "points more than a cell apart (numerical fracture)", WHOLE
    causes = SceneFacts(hub, simulation, simulation.time).advice("gain")
    largest = max(causes, key=lambda advice: advice.share, default=None)
    if largest is not None and largest.share > 0:
        return largest.reason, largest.cure
    if moves and jumps:
        return f"points crossing cells: the gradient of {basis} is discontinuous", smooth
    if fraction > 0.3 and (hub.update.fixed_dt or hub.update.dt_factor):
        return "time step too large", f"{_step_of(hub, simulation, 0.3)} or less"
    return "", "compare with another basis, transfer or scheme"


def _gain_of_implicit_steps(hub: Hub) -> tuple[str, str]:
    method, smaller = hub.update.method, "smaller steps (set_dt)"
    if method.fields_per_solid:
        return "contact that opens and closes from step to step", smaller
    if method.frame.moves and method.basis.traits.gradient_jumps:
        jumps = f"the gradient of a {method.basis_name} basis is discontinuous"
        return f"points crossing cells: {jumps}", f"quadratic-spline, method tlmpm, or {smaller}"
    return "large strains or rotations within a step", smaller


def _step_of(hub: Hub, simulation: Simulation, fraction: float) -> str:
    if hub.update.fixed_dt is not None:
        return f"set_dt({fraction * simulation.steps.limit:.3g})"
    return f"dt_factor({fraction:g})"


def swelling(points: PointTable) -> np.ndarray:
    return points.particle("volume") / points.reference_volume


def words_of_growth(hub: Hub, simulation: Simulation) -> Trouble:
    energy = simulation.control.energy[0]
    cause, fix = cause_of_gain(hub, simulation)
    gain, since = energy.grown, "since the start"
    if energy.windows >= GROWING:
        gain, since = energy.growth, f"in the last {10 if simulation.implicit else 100} steps"
    message = (
        f"energy balance: spurious gain of {100 * gain:.2g} % of the largest energy {since} "
        f"({when(simulation)})"
    )
    return Trouble(message, fix, "energy-gain", cause)


def taken_by(hub: Hub) -> list[str]:
    takers, transfer, scheme = [], hub.update.transfer, hub.update.scheme
    if damping := scheme.traits.damping(scheme):
        takers.append(f"scheme {registry.name_of('scheme', type(scheme))} with {damping}")
    # Motion within cells is lost, because nodal velocities do not contain this motion.
    if flip_coefficient(transfer) < 1:
        takers.append(f"transfer {words_of_transfer(hub)}")
    return takers


def words_of_transfer(hub: Hub) -> str:
    transfer = hub.update.transfer
    coefficient = f" {transfer.alpha:g}" if transfer.traits.retains else ""
    return f"{registry.name_of('transfer', type(transfer))}{coefficient}"


def words_of_loss(hub: Hub, simulation: Simulation) -> Trouble | None:
    if taken_by(hub):
        return None
    lost, (cause, fix) = simulation.energy_watch.lost_fraction(), cause_of_loss(hub)
    message = (
        f"energy balance: spurious loss of {100 * lost:.2g} % of the largest energy since the "
        f"first step ({when(simulation)})"
    )
    return Trouble(message, fix, "energy-loss", cause)


def smooths_water(hub: Hub) -> bool:
    traits = hub.update.scheme.traits
    explicit = not (traits.implicit or traits.solves_pressure)
    return is_wet(hub) and explicit and not hub.update.method.basis.traits.gradient_jumps


def cause_of_loss(hub: Hub) -> tuple[str, str]:
    update, method = hub.update, hub.update.method
    if update.scheme.traits.damps:
        name = registry.name_of("scheme", type(update.scheme))
        return f"scheme {name} damps vibrations", "scheme(musl)"
    if smooths_water(hub):
        return WATER
    if collision := collides(hub):
        return collision
    if method.frame.moves and method.basis.traits.gradient_jumps:
        return (
            f"points crossing cells (the gradient of a {method.basis_name} basis is "
            "discontinuous), and velocity differences within a cell",
            "quadratic-spline, or method tlmpm for a solid",
        )
    if update.scheme.traits.implicit:
        cause = "vibrations or rotations that cells and time steps do not resolve"
        return cause, "finer cells, or a smaller time step"
    if method.frame.moves:
        return (
            "waves and fronts that the cells do not resolve (velocity differences within a cell "
            "are lost)",
            "finer cells, TPIC or APIC, or method tlmpm for a solid",
        )
    return "waves that the cells do not resolve", "finer cells"


def collides(hub: Hub) -> tuple[str, str] | None:
    if any(fix.impulsive for fix in hub.fixes.values()):
        return (
            "contact that removes penetrations within one step: the grid resolves only a part of "
            "such impulses, less with a shorter time step",
            "impenetrablesurface, indent or contact/hertz, whose forces grow with the depth",
        )
    if hub.update.method.fields_per_solid and hub.update.scheme.traits.implicit:
        cause = "collisions: nodes of a surface lose their velocity of approach"
        return cause, "finer cells, which reduce the loss in a collision"
    return None


def words_of_losses(simulation: Simulation) -> dict[str, str]:
    fields, words = simulation.hub.fields, {}
    largest = float(simulation.energy_watch.watch.largest_energy)
    by_contact, by_transfer = fields.lost_by_contact(), fields.lost_by_transfer() or 0.0
    much = "{:.3g} % of the largest".format
    if by_contact < -LEAST * largest:
        inside = f"{much(-100 * by_contact / largest)}, e.g. by points that begin inside a body"
        words["gained in contact"] = inside
    elif by_contact > LEAST * largest:
        inelastic = "by inelastic contact and friction (in the work above)"
        words["lost by contact"] = f"{much(100 * by_contact / largest)}, {inelastic}"
    if abs(by_transfer) > LEAST * largest:
        name = words_of_transfer(simulation.hub)
        words["lost by transfer"] = f"{much(100 * by_transfer / largest)}, by {name}"
    return words


def words_of_error(hub: Hub, fraction: float, counted: bool) -> str:
    """Describe the error of the balance; `counted`: it includes the loss in the transfer."""
    takers = taken_by(hub)
    dissipated = "dissipated + lost by transfer" if counted else "dissipated"
    words = f"the largest since the first step (kinetic + stored + {dissipated} - work)"
    by, of_transfer = "", f"transfer {words_of_transfer(hub)}"
    if counted:
        takers = [taker for taker in takers if taker != of_transfer]
    if takers and fraction < -1:
        if collides(hub):
            takers.append("collisions")
        by = f"; {' and '.join(takers)} {'dissipates' if len(takers) == 1 else 'dissipate'} energy"
        if of_transfer in takers and any(s.counts_transfer for s in hub.solids.values()):
            by += " (compute transfer_loss measures it)"
    # The sum of losses may exceed the largest energy of the run.
    fraction = round(fraction, 2) + 0.0  # the sum with 0.0 avoids -0.00
    much = f"{fraction:+.2f} % of" if fraction > -100 else f"{fraction / 100:+.2f} times"
    return f"{much} {words}{by}"
