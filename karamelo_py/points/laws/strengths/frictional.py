"""Base of pressure-dependent strengths: cohesion and friction with optional softening.

The history variables are the equivalent plastic strain ep, the plastic volume ratio Jp and the
separation volume ratio Js. Beyond the largest tension points separate; the volume of gaps must
close before points sustain pressure again (Dunatunga & Kamrin 2015, "Continuum modelling and
simulation of granular flows through their many phases", J. Fluid Mech. 779, section 3.3; Tampubolon
et al. 2017, "Multi-species simulation of porous sand and water mixtures", ACM Trans. Graph. 36(4),
section 4.3.4). The volume gained by plastic shear (dilatancy) remains.
"""

from collections.abc import Callable
from functools import partial
from math import asin, ceil, degrees, inf, log, radians, sqrt
from typing import NamedTuple

from karamelo_py.compiler import point_function, where
from karamelo_py.language.rules import known_failure
from karamelo_py.points.kinematics import inner
from karamelo_py.points.laws import parameter
from karamelo_py.points.laws.eos import (
    VolumeStep,
    at_pressure,
    bulk_modulus,
    compressed,
    initial_energy,
    pressure,
)
from karamelo_py.points.laws.strengths import (
    FrictionTrial,
    elastic_ratio,
    fbar_fraction,
    inelastic_ratio,
    pressure_response,
    remembers,
    respond,
)
from karamelo_py.points.laws.strengths.hardening import elastic_trial
from karamelo_py.points.laws.temperatures import thermal_pressure
from karamelo_py.script.errors import ScriptError


def surface(strength, strain):
    """Return cohesion, friction and dilation, from peak to residual, at the start of a step."""
    weakened = min(strain * strength.softening, 1)
    intact = 1 - weakened
    cohesion = intact * strength.cohesion + weakened * strength.residual_cohesion
    friction = intact * strength.friction + weakened * strength.residual_friction
    return cohesion, friction, min(strength.dilation, friction)


def lowest_pressure(strength, strain):
    cohesion, friction, _ = surface(strength, strain)
    return tension_bound(strength, -cohesion / friction if friction > 0 else -inf)


@point_function(otherwise=True)
def tension_bound(strength, lowest):
    """Return the lowest pressure of a yield surface that ends at `lowest`."""
    return lowest


def fraction_by_dilatancy(strength, memory):
    """Return the fraction b of F-bar's averaged pressure that the yield surface uses.

    Averaging multiplies volume waves by a factor a (1 for long waves, 0.1 to 0.5 for wave lengths
    of two or three cells). In plastic flow, their stiffness is (a - f (1 - b + b a)) (a - d) times
    a positive number, where f and d are the sines of friction and dilatancy. With b = 0 it is
    negative for a between d and f, so that pressure grows in stripes and strength is lost. With b =
    (f - d)/(f (1 - d)) it is a square and never negative.
    """
    f, d = sines_after(strength, memory.ep)
    # The sine of a steep cone in plane strain may exceed 1.
    return where(f > d, min((f - d) / (where(f > d, f, 1) * max(1 - d, 1e-3)), 1), 0)


def sines_after(strength, strain):
    _, friction, dilation = surface(strength, strain)
    return sines(strength, friction, dilation)


@point_function(otherwise=True)
def sines(strength, friction, dilation):
    """Return the sines of friction and dilatancy in plane strain."""
    return friction, dilation


def plastic_and_gaps(strength, memory):
    return (memory.Jp * memory.Js,)


def respond_by_friction(strength, law, kin, step, memories):
    """Return a stress to the yield surface, and store the plastic volume change."""
    memory, heat = memories.strength, memories.heat
    trial = elastic_trial(strength.G, step.s, step.strain)
    elastic = elastic_ratio(strength, memory, step.j)
    warm = sum(thermal_pressure(law.temperature, heat))
    # The pressure includes pores that are crushed in the trial.
    energy = compressed(law.eos, memories.energy, VolumeStep(elastic, elastic, step.dt), 0)
    p_point = pressure(law.eos, elastic, energy, heat) + warm
    extra = fbar_fraction(strength, memory) * step.extra
    if memory.Js > 1 and p_point + extra > 0:
        closed, _ = at_pressure(law.eos, elastic, memories.energy, -warm - extra, heat)
        memory = memory._replace(Js=max(1, step.j / (memory.Jp * closed)))
        elastic = elastic_ratio(strength, memory, step.j)
        energy = compressed(law.eos, memories.energy, VolumeStep(elastic, elastic, step.dt), 0)
        p_point = pressure(law.eos, elastic, energy, heat) + warm
    K = bulk_modulus(law.eos, elastic, energy, heat)
    lowest = lowest_pressure(strength, memory.ep)
    p = p_point + extra
    new, reached = pressure_response(strength, kin, FrictionTrial(trial, p, K), memory.ep)
    plastic = 0.5 / strength.G * (trial - new)
    memory = memory._replace(ep=memory.ep + sqrt(2 / 3 * inner(plastic, plastic)))
    work = inner(new, plastic)
    if reached != p:
        # The volume at the new pressure is elastic; the rest of the change is plastic.
        p_after = p_point + (reached - p) - warm
        after, _ = at_pressure(law.eos, elastic, memories.energy, p_after, heat)
        if p < lowest and reached - lowest <= 1e-6 * (lowest - p):
            memory = memory._replace(Js=step.j / (memory.Jp * after))
        else:
            memory = memory._replace(Jp=step.j / (after * memory.Js))
        work -= reached * log(elastic / after)
    return new, memory, work


def frictional(strength: type) -> None:
    """Give `strength` (with ``G`` and fields of `surface`) its history variables and response."""
    remembers(strength, ep=0.0, Jp=1.0, Js=1.0)
    inelastic_ratio.on(strength)(plastic_and_gaps)
    respond.on(strength)(respond_by_friction)
    fbar_fraction.on(strength)(fraction_by_dilatancy)
    warn = partial(known_failure, strength)
    warn(
        "locking",
        when=_locks,
        reason="plastic flow of soil prescribes volume changes, which the basis {scene.basis_name} "
        "without F-bar cannot follow: limit loads are 10 to 33 % too high, and slopes that "
        "should slide do not (the run-out of flowing heaps is right)",
        cure="quadratic-spline; or anti_volumetric_locking(true), with method tlmpm if dilating "
        "soil does not mix, as below a footing: points that cross cells cost 10 % of such loads",
    )
    warn(
        "soil that vibrates",
        when=_vibrates,
        reason="with Poisson's ratio {nu:.2g} and little dilatancy, yielding soil amplifies "
        "vibrations and loses strength: the active pressure of sand with a friction of 30 degrees "
        "and a ratio of 0.45 drifted from 1/3 of the weight to 0.56, or 0.73 with F-bar, in 4500 "
        "steps",
        cure="psi={psi:.2g} (0.333), or Poisson's ratio {most:.2f} or less",
    )
    warn(
        "F-bar with splines",
        when=_averages_splines,
        reason="in dilating soil the basis {scene.basis_name} needs no F-bar, which makes limit "
        "loads too low: a footing carried 13.7 instead of 14.8 times the cohesion, and without "
        "cohesion 5.6 instead of 6.4 times the surcharge (friction and dilatancy of 20 degrees)",
        cure="anti_volumetric_locking(false) (14.7 and 6.1)",
    )


ENOUGH = 1 / 3  # sine of dilatancy / sine of friction above which soil does not vibrate
# f (f - G/(K + G/3)) above which vibrations grew in walls of sand, with F-bar, and without it if
# friction is steep and there is no cohesion.
FED, FED_ALONE, STEEP = 0.08, 0.095, 0.46


def _locks(strength, scene):
    return scene.locks and not scene.even and {"mark": scene.method.mark}


def little_dilatancy(strength):
    """Return the sine of friction in plane strain, or 0 with enough dilatancy."""
    f, d = sines_after(strength, 0.0)
    return f if d < ENOUGH * f * (1 - 1e-9) else 0.0


def _vibrates(strength, scene):
    """Return facts if strain cycles of a point at its yield limit release energy.

    Without dilatancy this energy is (f - G/(K + G/3)) (K + G/3) e^2/2, with the sine f of friction.
    """
    f = little_dilatancy(strength)
    averaged = scene.hub.update.anti_locking
    alone = f < STEEP or strength.cohesion > 0
    if not f or scene.simulation.implicit or scene.d == 1 or (alone and not averaged):
        return None
    least = f - (FED if averaged else FED_ALONE) / f  # bound of G/(K + G/3)
    for solid in scene.hub.solids.values():
        law = solid.material.law
        if parameter(law, "strength") is strength:
            K_over_G = bulk_modulus(law.eos, 1.0, initial_energy(law.eos, 1.0), ()) / strength.G
            most = 1 / least - 1 / 3 if least > 0 else inf
            if K_over_G > most:
                psi = ceil(degrees(asin(min(ENOUGH * f, 1))))
                return {"nu": _poisson(K_over_G), "most": _poisson(most), "psi": psi}
    return None


def _averages_splines(strength, scene):
    f, _ = sines_after(strength, 0.0)
    smooth = not (scene.hats or scene.simulation.implicit)
    averaged = scene.hub.update.anti_locking and smooth
    return averaged and f > 0 and not little_dilatancy(strength)


def _poisson(K_over_G):
    return (3 * K_over_G - 2) / (2 * (3 * K_over_G + 1))


class Soil(NamedTuple):
    """Constants as in scripts: angles are in degrees, None means no softening."""

    cohesion: float
    phi: float
    psi: float
    residual_cohesion: float | None
    residual_phi: float | None
    softening: float | None


def peak_and_residual(soil: Soil, surface_of: Callable) -> tuple[float, ...]:
    """Return cohesion, friction, dilation; residual cohesion and friction; softening.

    `surface_of` converts cohesion and friction angle (radians) for the yield surface.
    """
    cohesion, phi, psi, residual_cohesion, residual_phi, softening = soil
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
            expected=f"an angle from 0 to {phi:g} degrees: flow would generate energy beyond",
        )
    if cohesion == 0 and phi == 0:
        raise ScriptError(
            "the strength has neither cohesion nor friction",
            argument="cohesion",
            expected="a cohesion or a friction angle above 0, or strength(ID, fluid, 0)",
        )
    softens = residual_cohesion is not None or residual_phi is not None
    if softening is not None and not softens:
        raise ScriptError(
            "softening needs a residual strength",
            argument="softening",
            expected="residual_cohesion=... or residual_phi=..., or both",
        )
    if softens and softening is None:
        raise ScriptError(
            "softening needs the plastic strain at which the residual strength is reached",
            argument="residual_cohesion" if residual_cohesion is not None else "residual_phi",
            expected="softening=plastic strain",
        )
    for name, most, value in (
        ("cohesion", cohesion, residual_cohesion),
        ("phi", phi, residual_phi),
    ):
        if value is not None and value > most:
            raise ScriptError(
                f"the residual {name} {value:g} is above its peak, {most:g}",
                argument=f"residual_{name}",
                expected=f"a number from 0 to {most:g}",
            )
    left = cohesion if residual_cohesion is None else residual_cohesion
    residual = surface_of(left, radians(phi if residual_phi is None else residual_phi))
    dilation = surface_of(cohesion, radians(psi))[1]
    peak = *surface_of(cohesion, radians(phi)), dilation
    return *peak, *residual, 1 / softening if softening else 0.0
