"""Base of pressure-dependent strengths: cohesion and friction, optional softening; memory.

The memory is the equivalent plastic strain ep, the plastic volume ratio Jp, and the volume ratio Js
of separation.

Beyond the largest sustainable tension, points separate: the volume that they gain is not bulk, and
is closed before they sustain pressure again (Dunatunga & Kamrin 2015, "Continuum modelling and
simulation of granular flows through their many phases", J. Fluid Mech. 779, section 3.3; Tampubolon
et al. 2017, "Multi-species simulation of porous sand and water mixtures", ACM Trans. Graph. 36(4),
section 4.3.4). The volume gained by plastic shear (dilatancy) remains.
"""

from math import asin, ceil, degrees, inf, log, radians, sqrt

from karamelo_py.compiler.compile import point_function, where
from karamelo_py.language.rules import known_failure
from karamelo_py.points.kinematics import inner
from karamelo_py.points.laws import parameter
from karamelo_py.points.laws.eos import bulk_modulus, initial_energy, pressure, ratio_at_pressure
from karamelo_py.points.laws.strengths import (
    elastic_ratio,
    pressure_response,
    remembers,
    respond,
    share_beside,
)
from karamelo_py.points.laws.strengths.hardening import elastic_trial
from karamelo_py.points.laws.temperatures import thermal_pressure
from karamelo_py.script.errors import ScriptError


def surface(strength, strain):
    """Cohesion, friction and dilation of the yield surface after a plastic strain.

    They change linearly from the peak to the residual; a step uses the values at its beginning.
    """
    share = min(strain * strength.softening, 1)
    kept = 1 - share
    cohesion = kept * strength.cohesion + share * strength.residual_cohesion
    friction = kept * strength.friction + share * strength.residual_friction
    return cohesion, friction, min(strength.dilation, friction)


def lowest_pressure(strength, strain):
    """The pressure below which nothing is sustained, -cohesion / friction or a given bound."""
    cohesion, friction, _ = surface(strength, strain)
    return tension_bound(strength, -cohesion / friction if friction > 0 else -inf)


@point_function(otherwise=True)
def tension_bound(strength, lowest):
    """The lowest pressure, for a strength whose yield surface ends at `lowest`."""
    return lowest


def share_of_average(strength, memory):
    """Return the fraction b of the averaged pressure that the yield surface uses, with F-bar.

    Averaging multiplies waves by the factor a (1 for long waves, 0.1 to 0.5 for waves of two or
    three cells). Their stiffness in plastic flow is

        (a - f (1 - b + b a)) (a - d) times a positive number,

    with f and d the sines of friction and dilatancy. Without b it is negative for a between d and
    f: pressure grows in stripes, and strength falls. With b = (f - d)/(f (1 - d)) it is a square.
    """
    f, d = sines_after(strength, memory.ep)
    # The sine of a steep cone in plane strain may be above 1.
    return where(f > d, min((f - d) / (where(f > d, f, 1) * max(1 - d, 1e-3)), 1), 0)


def sines_after(strength, strain):
    """Return the sines of friction and dilatancy in plane strain after a plastic strain."""
    _, friction, dilation = surface(strength, strain)
    return sines(strength, friction, dilation)


@point_function(otherwise=True)
def sines(strength, friction, dilation):
    """Return the sines of friction and dilatancy in plane strain of a yield surface."""
    return friction, dilation


def elastic_part(strength, memory, j):
    """Return the elastic part of the volume ratio j."""
    return j / (memory.Jp * memory.Js)


def respond_by_friction(strength, law, kin, s, strain, j, memories, dt, beside):
    """Return an elastic trial to the yield surface, and store the plastic volume change."""
    memory, heat = memories.strength, memories.heat
    trial = elastic_trial(strength.G, s, strain)
    elastic = elastic_part(strength, memory, j)
    warm = sum(thermal_pressure(law.temperature, heat))
    p = pressure(law.eos, elastic, memories.energy, heat) + warm
    beside = share_beside(strength, memory) * beside
    if memory.Js > 1 and p + beside > 0:
        # Separation closes before the point sustains pressure.
        closed = ratio_at_pressure(law.eos, -warm - beside, heat)
        apart = max(1, j / (memory.Jp * closed))
        memory = memory._replace(Js=apart)
        elastic = elastic_part(strength, memory, j)
        p = pressure(law.eos, elastic, memories.energy, heat) + warm
    K = bulk_modulus(law.eos, elastic, memories.energy, heat)
    lowest = lowest_pressure(strength, memory.ep)
    own = p
    p += beside
    new, reached = pressure_response(strength, kin, trial, p, K, memory.ep)
    plastic = 0.5 / strength.G * (trial - new)
    memory = memory._replace(ep=memory.ep + sqrt(2 / 3 * inner(plastic, plastic)))
    work = inner(new, plastic)
    if reached != p:
        # The volume that carries the new pressure is elastic; the rest is plastic.
        after = ratio_at_pressure(law.eos, own + (reached - p) - warm, heat)
        if p < lowest and reached - lowest <= 1e-6 * (lowest - p):
            memory = memory._replace(Js=j / (memory.Jp * after))
        else:
            memory = memory._replace(Jp=j / (after * memory.Js))
        work -= reached * log(elastic / after)
    return new, memory, work


def frictional(strength: type) -> None:
    """Give `strength` (with a field ``G`` and the fields of `surface`) memory and response."""
    remembers(strength, ep=0.0, Jp=1.0, Js=1.0)
    elastic_ratio.on(strength)(elastic_part)
    respond.on(strength)(respond_by_friction)
    share_beside.on(strength)(share_of_average)
    known_failure(
        strength,
        "locking",
        when=lambda strength, scene: (
            scene.locks and not scene.even and {"place": scene.method.place}
        ),
        reason="plastic flow of soil prescribes volume changes, which the basis {scene.basis_name} "
        "without F-bar cannot follow: limit loads are 10 to 33 % too high, and slopes stay up that "
        "should slide (the run-out of flowing heaps is right)",
        cure="quadratic-spline; or anti_volumetric_locking(true), with method tlmpm if dilating "
        "soil does not mix, as below a footing: points that cross cells cost 10 % of such loads",
    )
    known_failure(
        strength,
        "soil that vibrates",
        when=_vibrates,
        reason="with Poisson's ratio {nu:.2g} and little dilatancy, yielding soil amplifies "
        "vibrations and loses strength: the active pressure of sand with a friction of 30 degrees "
        "and a ratio of 0.45 drifted from 1/3 of the weight to 0.56, or 0.73 with F-bar, in 4500 "
        "steps",
        cure="psi={psi:.2g} (0.333), or Poisson's ratio {most:.2f} or less",
    )
    known_failure(
        strength,
        "F-bar in load steps",
        when=_averages_in_load_steps,
        reason="in load steps with F-bar, soil of little dilatancy loses strength: "
        "the active and passive pressures of sand with a friction of 30 degrees were 0.40 and 1.8 "
        "instead of 1/3 and 3 (0.57 and no equilibrium with splines)",
        cure="anti_volumetric_locking(false) (0.333 and 3.04), or psi={psi:.2g} with a linear "
        "basis",
    )
    known_failure(
        strength,
        "F-bar with splines",
        when=_averages_splines,
        reason="in dilating soil the basis {scene.basis_name} needs no F-bar, which makes limit "
        "loads too low: a footing carried 13.7 instead of 14.8 times the cohesion, and without "
        "cohesion 5.6 instead of 6.4 times the surcharge (friction and dilatancy of 20 degrees)",
        cure="anti_volumetric_locking(false) (14.7 and 6.1)",
    )


ENOUGH = 1 / 3  # dilatancy over friction, as sines, from which neither occurred
# f (f - G/(K + G/3)) above which vibrations grew in walls of sand, with F-bar and without; the
# latter need steep friction and no cohesion, too.
FED, FED_ALONE, STEEP = 0.08, 0.095, 0.46


def _little_dilatancy(strength):
    """Return the sine of friction in plane strain, or 0 if there is enough dilatancy."""
    f, d = sines_after(strength, 0.0)
    return f if d < ENOUGH * f * (1 - 1e-9) else 0.0


def _vibrates(strength, scene):
    """Return True if a strain cycle of a point at its limit releases more work than it takes.

    Without dilatancy it releases (f - G/(K + G/3)) (K + G/3) e^2/2, with the sine f of friction.
    """
    f = _little_dilatancy(strength)
    averaged = scene.hub.update.anti_locking
    alone = f < STEEP or strength.cohesion > 0
    if not f or scene.simulation.implicit or scene.d == 1 or (alone and not averaged):
        return None
    least = f - (FED if averaged else FED_ALONE) / f  # G/(K + G/3)
    for solid in scene.hub.solids.values():
        law = solid.material.law
        if parameter(law, "strength") is strength:
            share = bulk_modulus(law.eos, 1.0, initial_energy(law.eos, 1.0), ()) / strength.G
            most = 1 / least - 1 / 3 if least > 0 else inf
            if share > most:
                return {"nu": _poisson(share), "most": _poisson(most), "psi": _angle(f)}
    return None


def _averages_in_load_steps(strength, scene):
    f = _little_dilatancy(strength)
    averaged = scene.hub.update.anti_locking and scene.simulation.implicit
    return {"psi": _angle(f)} if f and averaged else None


def _averages_splines(strength, scene):
    f, _ = sines_after(strength, 0.0)
    smooth = not (scene.hats or scene.simulation.implicit)
    averaged = scene.hub.update.anti_locking and smooth
    return averaged and f > 0 and not _little_dilatancy(strength)


def _angle(f):
    """Return a sufficient angle of dilatancy, in degrees, rounded up."""
    return ceil(degrees(asin(min(ENOUGH * f, 1))))


def _poisson(share):
    """Return Poisson's ratio from K / G."""
    return (3 * share - 2) / (2 * (3 * share + 1))


def peak_and_residual(surface_of, cohesion, phi, psi, to_cohesion, to_phi, over):
    """Cohesion, friction and dilation at the peak; residual cohesion and friction; softening.

    `surface_of` gives cohesion and friction of the yield surface, from the cohesion and the angle
    of friction (in radians) of a soil. None leaves a value unchanged.
    """
    if not 0 <= phi < 90:
        raise ScriptError(
            f"the friction angle phi = {phi:g} is impossible",
            argument="phi",
            expected="an angle in degrees, from 0 to below 90",
        )
    if not 0 <= psi <= phi:
        raise ScriptError(
            f"the angle of dilatancy psi = {psi:g} is impossible with phi = {phi:g}",
            argument="psi",
            expected=f"an angle from 0 to {phi:g} degrees: beyond, flow would make energy",
        )
    if cohesion == 0 and phi == 0:
        raise ScriptError(
            "without cohesion and friction there is no strength",
            argument="cohesion",
            expected="a cohesion or a friction angle above 0, or strength(ID, fluid, 0)",
        )
    softens = to_cohesion is not None or to_phi is not None
    if over is not None and not softens:
        raise ScriptError(
            "softening needs a residual strength",
            argument="softening",
            expected="residual_cohesion=... or residual_phi=..., or both",
        )
    if softens and over is None:
        raise ScriptError(
            "softening needs the plastic strain at which the residual strength is reached",
            argument="residual_cohesion" if to_cohesion is not None else "residual_phi",
            expected="softening=plastic strain",
        )
    for name, peak, value in (("cohesion", cohesion, to_cohesion), ("phi", phi, to_phi)):
        if value is not None and value > peak:
            raise ScriptError(
                f"the residual {name} {value:g} is above its peak, {peak:g}",
                argument=f"residual_{name}",
                expected=f"a number from 0 to {peak:g}",
            )
    left = cohesion if to_cohesion is None else to_cohesion
    end = surface_of(left, radians(phi if to_phi is None else to_phi))
    dilation = surface_of(cohesion, radians(psi))[1]
    return (*surface_of(cohesion, radians(phi)), dilation), (*end, 1 / over if softens else 0.0)
