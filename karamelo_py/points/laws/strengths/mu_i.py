"""Strength mu-i."""

from math import sqrt
from typing import NamedTuple

from karamelo_py.compiler import where
from karamelo_py.language.rules import known_failure
from karamelo_py.points.kinematics import inner
from karamelo_py.points.laws import LawTraits, parameter, specific_volume
from karamelo_py.points.laws.eos import pressure
from karamelo_py.points.laws.parameters import AboveZero
from karamelo_py.points.laws.strengths import elastic_ratio, fbar_fraction, remembers, respond
from karamelo_py.points.laws.strengths.frictional import little_dilatancy
from karamelo_py.points.laws.strengths.hardening import elastic_trial
from karamelo_py.points.laws.temperatures import thermal_pressure
from karamelo_py.script.errors import ScriptError


class MuI(NamedTuple):
    """Dense granular flow with rate-dependent friction, mu(I).

    Parameters
    ----------
    G
        Shear modulus of the grains while they are in contact.
    mu_s
        Friction coefficient of slow flow: the tangent of the angle of repose.
    mu_2
        Friction coefficient of fast flow, above mu_s.
    I0
        Inertial number at which friction is (mu_s + mu_2)/2.
    d
        Grain diameter.
    rho_s
        Grain density.

    Example
    -------
    eos(beads, linear, 1500, 1e6)
    strength(beads, mu-i, 4e5, 0.382, 0.643, 0.279, 0.5e-3, 2450)
    material(beads, eos-strength, beads, beads)

    Notes
    -----
    sqrt(s:s/2) = mu(I) p in flow, with mu = mu_s + (mu_2 - mu_s)/(I0/I + 1) (Jop, Forterre &
    Pouliquen 2006). I = gamma' d sqrt(rho_s/p), with the plastic shear rate gamma'. Below mu_s p
    the response is elastic. A step of any size solves a quadratic equation for the shear stress at
    its end (Dunatunga & Kamrin 2015). Below the initial density, grains are separated and sustain
    no stress. Flow conserves the volume. Dump column ``inertial``: I.

    See Also
    --------
    drucker-prager, mohr-coulomb, eos linear, material eos-strength
    """

    in_lanes = True
    traits = LawTraits(flows=True, rings=False)

    G: AboveZero
    mu_s: AboveZero
    mu_2: AboveZero
    I0: AboveZero
    d: AboveZero
    rho_s: AboveZero

    def checked(self):
        """Refuse friction that decreases with the rate, with which flow would be unstable."""
        if self.mu_2 < self.mu_s:
            raise ScriptError(
                f"the friction of fast flow, {self.mu_2:g}, is below the friction of slow flow",
                argument="mu_2",
                expected=f"a number of at least mu_s = {self.mu_s:g}",
            )
        return self


def _jumps(strength, scene):
    rough = scene.moves and scene.linear and scene.kept > 0.9 and scene.d > 1
    return {"mark": scene.method.mark} if rough else None


known_failure(
    MuI,
    "pressure of grains",
    when=_jumps,
    reason="points of flowing grains cross cells; with {scene.transfer_name} and a linear basis "
    "their pressure, and thus friction, varies from 0 to twice the right value (flow down a "
    "plane, any cell size)",
    cure="method(ulmpm, AFLIP, cubic-spline, 0.9) and anti_volumetric_locking(true): pressures "
    "within 5 %, speeds at the floor 7 % too low (APIC and TPIC: 3 % and 19 %)",
)


SLOW = 0.05  # numerical viscosity / viscosity of the grains, for a warning


def _slows(strength, scene):
    """Compare numerical viscosity (PIC) with the viscosity mu p/(rho gamma') of the grains.

    In this estimate, p is taken at half a body's height, and I as I0 / 2.
    """
    added = scene.grid_viscosity
    for solid in scene.hub.solids.values():
        law = solid.material.law
        if parameter(law, "strength") is not strength or not scene.weights:
            continue
        rho = 1 / specific_volume(law)
        p = 0.5 * rho * scene.sag * scene.waves**2
        grains = strength.mu_s * strength.d * sqrt(p * strength.rho_s) / (0.5 * strength.I0 * rho)
        if added > SLOW * grains:
            pic = 1 - scene.kept
            return {"mark": scene.method.mark, "pic": pic, "added": added, "grains": grains}
    return None


known_failure(
    MuI,
    "slow grains",
    when=_slows,
    reason="{scene.transfer_name} takes a fraction {pic:.2g} of velocities from the grid in each "
    "step, which adds a kinematic viscosity of {added:.2g} to the grains' {grains:.2g}: they flow "
    "too slowly (by 6 % with FLIP 0.99 and 46 % with 0.9, in a layer of 6 cells down a plane, "
    "after 3 times its height)",
    cure="TPIC or APIC with quadratic-spline (within 3 %), or FLIP with 1",
)
remembers(MuI, ep=0.0, inertial=0.0)


@elastic_ratio.on(MuI)
def _elastic_ratio_mu_i(strength, memory, j):
    return min(j, 1)  # separated grains are not strained


@fbar_fraction.on(MuI)
def _fbar_fraction_mu_i(strength, memory):
    return 1  # flow conserves the volume


@respond.on(MuI)
def _respond_mu_i(strength, law, kin, step, memories):
    memory, dt = memories.strength, step.dt
    elastic = elastic_ratio(strength, memory, step.j)
    p = pressure(law.eos, elastic, memories.energy, memories.heat)
    p += sum(thermal_pressure(law.temperature, memories.heat))
    p += fbar_fraction(strength, memory) * step.extra
    together = p > 0
    trial = elastic_trial(strength.G, step.s, step.strain)
    shear = sqrt(0.5 * inner(trial, trial))
    flows = together & (shear > strength.mu_s * p)
    p = where(together, p, 1)
    slow, fast = strength.mu_s * p, strength.mu_2 * p
    # (shear - tau)/(G dt) is the shear rate at which tau = mu(I) p: a quadratic equation.
    grain = strength.d * sqrt(strength.rho_s / p)
    viscous = strength.I0 * strength.G * dt / grain
    b = fast + shear + viscous
    c = fast * shear + slow * viscous
    tau = 2 * c / (b + sqrt(b * b - 4 * c))
    slip = where(flows, (shear - tau) / strength.G, 0)
    scale = where(together, where(flows, tau / where(flows, shear, 1), 1), 0)
    ep = memory.ep + slip * sqrt(1 / 3)
    return scale * trial, memory._replace(ep=ep, inertial=slip / dt * grain), tau * slip


def yields_early_with_fbar(strength):
    """Return True for friction with little dilatancy, which yields by the pressure of the point."""
    return isinstance(strength, MuI) or little_dilatancy(strength) > 0
