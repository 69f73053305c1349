"""strength mu-i: dense granular flow, whose friction grows with the rate of shear."""

from math import sqrt
from typing import Annotated, NamedTuple

from karamelo_py.compiler.compile import where
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import Positive
from karamelo_py.points.kinematics import inner
from karamelo_py.points.laws.eos import pressure
from karamelo_py.points.laws.strengths import elastic_ratio, remembers, respond, share_beside
from karamelo_py.points.laws.strengths.hardening import elastic_trial
from karamelo_py.points.laws.temperatures import thermal_pressure
from karamelo_py.script.errors import ScriptError


class MuI(NamedTuple):
    """Friction of grains that flow: it grows with the rate of shear, mu(I).

    Parameters
    ----------
    G
        Shear modulus of the grains while they hold together.
    mu_s
        Friction of slow flow, the tangent of the angle of repose.
    mu_2
        Friction of fast flow, above mu_s.
    I0
        Inertial number at which friction is half way between.
    d
        Diameter of a grain.
    rho_s
        Density of a grain.

    Example
    -------
    eos(beads, linear, 1500, 1e6)
    strength(beads, mu-i, 4e5, 0.382, 0.643, 0.279, 0.5e-3, 2450)
    material(beads, eos-strength, beads, beads)

    Notes
    -----
    sqrt(s:s/2) = mu(I) p in flow, with mu = mu_s + (mu_2 - mu_s)/(I0/I + 1) (Jop, Forterre &
    Pouliquen 2006). I = gamma' d sqrt(rho_s/p), with the plastic shear rate gamma'. Below mu_s p
    the response is elastic. Steps of any size solve a quadratic equation for the shear stress at
    their end (Dunatunga & Kamrin 2015). Grains below the initial density are apart. They bear
    nothing until the density is back. Flow keeps the volume. The column ``inertial`` of dumps is I.

    See Also
    --------
    drucker-prager, mohr-coulomb, eos linear, material eos-strength
    """

    in_lanes = True
    flows = True
    rings = False

    G: Annotated[float, Positive]
    mu_s: Annotated[float, Positive]
    mu_2: Annotated[float, Positive]
    I0: Annotated[float, Positive]
    d: Annotated[float, Positive]
    rho_s: Annotated[float, Positive]

    def checked(self):
        """The law, unless friction falls with the rate: such flow is not stable."""
        if self.mu_2 < self.mu_s:
            raise ScriptError(
                f"the friction of fast flow, {self.mu_2:g}, is below that of slow flow",
                argument="mu_2",
                expected=f"a number of at least mu_s = {self.mu_s:g}",
            )
        return self


def _jumps(strength, scene):
    rough = scene.moves and scene.linear and scene.kept > 0.9 and scene.d > 1
    return {"place": scene.method.place} if rough else None


known_failure(
    MuI,
    "pressure of grains",
    when=_jumps,
    reason="points of grains that flow past each other cross cells, and with {scene.transfer_name} "
    "and linear functions their pressure, and so their friction, is anything from 0 to twice "
    "what it should be (flow down a plane, any size of cells)",
    cure="method(ulmpm, TPIC, quadratic-spline), or APIC: within a tenth, but for the surface and "
    "the cell on the floor; speeds there are up to a sixth too low",
)
remembers(MuI, ep=0.0, inertial=0.0)


@elastic_ratio.on(MuI)
def _elastic_ratio_mu_i(strength, memory, j):
    return min(j, 1)  # grains that are apart are not stretched


@share_beside.on(MuI)
def _share_beside_mu_i(strength, memory):
    return 1  # flow keeps the volume


@respond.on(MuI)
def _respond_mu_i(strength, law, kin, s, strain, j, memories, dt, beside):
    memory = memories.strength
    elastic = elastic_ratio(strength, memory, j)
    p = pressure(law.eos, elastic, memories.energy, memories.heat)
    p += sum(thermal_pressure(law.temperature, memories.heat))
    p += share_beside(strength, memory) * beside
    together = p > 0
    trial = elastic_trial(strength.G, s, strain)
    shear = sqrt(0.5 * inner(trial, trial))
    flows = together & (shear > strength.mu_s * p)
    p = where(together, p, 1)
    slow, fast = strength.mu_s * p, strength.mu_2 * p
    # (shear - tau)/(G dt) is the shear rate that tau = mu(I) p asks for: a quadratic equation.
    grain = strength.d * sqrt(strength.rho_s / p)
    viscous = strength.I0 * strength.G * dt / grain
    b = fast + shear + viscous
    c = fast * shear + slow * viscous
    tau = 2 * c / (b + sqrt(b * b - 4 * c))
    slip = where(flows, (shear - tau) / strength.G, 0)
    share = where(together, where(flows, tau / where(flows, shear, 1), 1), 0)
    ep = memory.ep + slip * sqrt(1 / 3)
    return share * trial, memory._replace(ep=ep, inertial=slip / dt * grain), tau * slip
