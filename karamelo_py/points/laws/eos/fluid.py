"""Eos fluid, ideal-gas and jwl."""

from math import inf, sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import round_off, where
from karamelo_py.compiler.powers import exponential, logarithm, power
from karamelo_py.language.rules import known_failure
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.eos import (
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    ignited,
    initial_energy,
    pressure,
    ratio_at_pressure,
    stored_heat,
    taken_heat,
)  # fmt: skip
from karamelo_py.points.laws.parameters import AboveZero, ByName, FromZero
from karamelo_py.points.laws.viscosity import artificial_viscosity
from karamelo_py.script.errors import ScriptError

# Longest run / time to fall by the liquid's size (dam breaks: 4); longest path / this size.
LONG = 6.0, 0.5
FRONT = 1.5  # cells that the front moves while a point burns
STEP, STRONG = 2.0, 20.0  # pressure ratio above which there is a shock, and a strong shock


class Tait(NamedTuple):
    """Pressure of a liquid from a power of its density (Tait).

    Parameters
    ----------
    rho0
        Density at zero pressure.
    K
        Reference pressure; the bulk modulus is K gamma.
    gamma
        Exponent, 7 for water.
    tension
        Largest tension (0: none). By default the formula limits it to K.

    Example
    -------
    eos(water, fluid, 1000, 2.2e9/7, 7)
    eos(spray, fluid, 1000, 1e5, 7, tension=0)

    Notes
    -----
    p = K ((rho/rho0)^gamma - 1) (Cole 1948; Monaghan 1994). The speed of sound is sqrt(K
    gamma/rho0) at zero pressure. A lower K allows longer steps: density changes by less than 1 % if
    speeds are below 10 % of the speed of sound. Use ``tension=0`` for splashes, where tension makes
    drops swell and stick together.

    See Also
    --------
    strength fluid, ideal-gas, material eos-strength
    """

    in_lanes = True
    traits = LawTraits(any_speed=True, fluid=True)
    scalarised = ("compression_energy",)

    specific_volume: float
    K: float  # bulk modulus / gamma
    gamma: float
    tension: float = inf  # largest tension; the formula itself limits tension to K

    @classmethod
    def given(cls, rho0: AboveZero, K: AboveZero, gamma: AboveZero, *, tension: FromZero = inf):
        if gamma > 100 > K:  # such constants are swapped: exponents of liquids are below 15
            raise ScriptError(
                f"K = {K:g} and gamma = {gamma:g} are swapped: gamma is an exponent",
                argument="gamma",
                expected="the reference pressure K, then the exponent gamma (7 for water)",
                hint=f"eos(ID, fluid, {rho0:g}, {gamma:g}, {K:g})",
            )
        return cls(1 / rho0, K, gamma, tension)


def _swings(eos, scene):
    rough = scene.moves and scene.linear and scene.d > 1
    long = scene.kept > 0.9 and (scene.falls > LONG[0] or scene.passes > LONG[1])
    long = long or (scene.moments and scene.falls > 2 * LONG[0])
    return {"mark": scene.method.mark} if rough and long else None


def _whirls(eos, scene):
    loose = scene.moves and not scene.linear and scene.kept > 0.9 and scene.d > 1
    return {"mark": scene.method.mark} if loose and scene.passes > LONG[1] else None


known_failure(
    Tait,
    "liquids with a linear basis",
    when=_swings,
    reason="a liquid sloshes or rotates for a long time, and {scene.transfer_name} with a linear "
    "basis gives spurious forces where points cross cells: waves in a tank are 8 % too slow and "
    "lose 20 % of their height in two periods (FLIP), velocities in a vortex are wrong by 25 %, "
    "and the level of a liquid at rest falls by 4 % in 15 sqrt(L/g), 15 % in 30",
    cure="method(ulmpm, APIC, quadratic-spline): 1 % and 3 % for waves, 6 % for vortices",
)
known_failure(
    Tait,
    "vortices with FLIP",
    when=_whirls,
    reason="in a vortex, {scene.transfer_name} retains velocity noise in the null space of the "
    "grid: velocities are wrong by 16 to 24 % with 20 cells across, and 8 to 18 % with 40, once "
    "it has moved by its size",
    cure="APIC instead of {scene.transfer_name} (6 %)",
)


@pressure.on(Tait)
def _pressure_tait(eos, j, memory, heat):
    return max(eos.K * (power(j, -eos.gamma) - 1), -eos.tension)


@bulk_modulus.on(Tait)
def _bulk_modulus_tait(eos, j, memory, heat):
    return eos.K * eos.gamma * power(j, -eos.gamma)


@compression_energy.on(Tait)
def _compression_energy_tait(eos, j, memory):
    exponent = 1 - eos.gamma
    whole = j if eos.tension >= eos.K else min(j, ratio_at_pressure(eos, -eos.tension, ()))
    grown = -logarithm(whole) if exponent == 0 else (1 - power(whole, exponent)) / exponent
    energy = eos.K * (grown - (1 - whole))
    return energy + eos.tension * (j - whole) if j > whole else energy


@ratio_at_pressure.on(Tait)
def _ratio_at_pressure_tait(eos, p, heat):
    # A tension of K would need an infinite volume.
    limited = max(p, -eos.tension)
    return power(max(1 + limited / eos.K, round_off(p)), -1 / eos.gamma)


class IdealGas(NamedTuple):
    """Pressure of an ideal gas without heat conduction.

    Parameters
    ----------
    rho0
        Initial density.
    gamma
        Ratio of specific heats, above 1.
    p
        Initial pressure.
    e
        Initial internal energy per unit mass, instead of p.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear, as in eos shock.
    Qh
        Diffusivity of the internal energy over the artificial viscosity: a heat flux in shocks, for
        ``method(..., thermo-mechanical)``.

    Example
    -------
    eos(air, ideal-gas, 1.2, 1.4, p=1e5)

    Notes
    -----
    p = (gamma - 1) rho e, and de = -p dv with the volume v per unit mass. In adiabatic steps e is
    proportional to rho^(gamma - 1), exactly. Viscous work heats the gas, as does kinetic energy
    dissipated by PIC, FLIP, APIC, MLS and TPIC. For shocks, Q1 = 2 and Q2 = 0.2 are usual.

    With Qh, rho de/dt = div(Qh nu rho grad e) is added where the gas is compressed, with the
    artificial viscosity nu (Noh 1987); the step limits Qh nu. Colliding gas then overheats less at
    a wall, an axis or a point, and Q1 = Q2 = 0.1 with Qh = 3 suffice.

    A free surface expands from the first step. Fix initial_stress sets p by changing the energy.

    See Also
    --------
    fluid, shock, strength fluid, material eos-strength
    """

    in_lanes = True
    traits = LawTraits(any_speed=True, fluid=True, least_density=1e-3)

    specific_volume: float
    gamma: float
    energy: float  # initial E per reference volume

    @classmethod
    def given(
        cls,
        rho0: AboveZero,
        gamma: float,
        *,
        p: AboveZero | None = None,
        e: AboveZero | None = None,
        Q1: FromZero = 0.0,
        Q2: FromZero = 0.0,
        Qh: FromZero = 0.0,
    ):
        if not gamma > 1:
            raise ScriptError(
                f"the ratio of specific heats {gamma:g} is impossible",
                argument="gamma",
                expected="a number above 1, such as 1.4",
            )
        if (p is None) == (e is None):
            raise ScriptError(
                "the gas needs a pressure or an energy at the start"
                if p is None
                else "pressure and energy at the start are given; one follows from the other",
                expected="p=pressure or e=energy per mass",
            )
        energy = rho0 * (e or 0.0) if p is None else p / (gamma - 1)
        return {"eos": cls(1 / rho0, gamma, energy), **artificial_viscosity(Q1, Q2, Qh)}


def _shocks(eos, scene):
    ratio = scene.pressure_ratio
    if not scene.moves or ratio < STEP:
        return None
    cubic = scene.moments and scene.basis.traits.allows_drift
    smooth = cubic or scene.scheme.traits.allows_drift
    if scene.linear:
        loss = f"{scene.transfer_name} with a linear basis loses 33 % of the pressure or more"
    elif scene.moments and scene.thins:
        loss = "points that are more than a cell apart lose up to half of the energy"
    elif ratio < STRONG or smooth:
        return None
    else:
        loss = "this scheme loses 3 to 15 % of the energy at the front"
    return {"mark": scene.method.mark, "ratio": ratio, "loss": loss}


known_failure(
    IdealGas,
    "shocks in a gas",
    when=_shocks,
    reason="pressures of 1 and {ratio:.3g} meet, and behind the shock {loss}",
    cure="method(ulmpm, FLIP, quadratic-spline, 1), scheme(usavg), and Q1=2, Q2=0.2 in eos "
    "ideal-gas: within 0.1 % for ratios up to 100000",
)


def _sound(eos, scene):
    jumps = scene.moves and scene.basis.traits.gradient_jumps
    if not jumps or scene.pressure_ratio >= STEP:
        return None
    return {"mark": scene.method.mark, "speed": sqrt(1 - 1 / eos.gamma)}


known_failure(
    IdealGas,
    "sound in a gas",
    when=_sound,
    reason="while points stay in their cells, their volumes change but cell volumes do not: with "
    "the basis {scene.basis_name}, sound travels at {speed:.2g} of its speed",
    cure="ugimp, cpgimp or quadratic-spline, or method tlmpm",
)


class InternalEnergy(NamedTuple):
    E: Any  # internal energy per reference volume


@initial_energy.on(IdealGas)
def _initial_energy_ideal_gas(eos, template):
    return InternalEnergy(eos.energy)


@compressed.on(IdealGas)
def _compressed_ideal_gas(eos, memory, step, heating):
    # dE = -p dJ has the solution E J^(gamma - 1) = const, for any step
    return InternalEnergy(memory.E * power(step.before / step.j, eos.gamma - 1) + heating)


@pressure.on(IdealGas)
def _pressure_ideal_gas(eos, j, memory, heat):
    return (eos.gamma - 1) * memory.E / j


@bulk_modulus.on(IdealGas)
def _bulk_modulus_ideal_gas(eos, j, memory, heat):
    return eos.gamma * (eos.gamma - 1) * memory.E / j


@at_pressure.on(IdealGas)
def _at_pressure_ideal_gas(eos, j, memory, p, heat):
    return j, InternalEnergy(max(p, 0) * j / (eos.gamma - 1))


class JwlConstants(NamedTuple):
    """Pressure of an explosive and its detonation products (Jones, Wilkins, Lee).

    Parameters
    ----------
    rho0
        Density of the explosive.
    A, B, R1, R2, omega
        Constants of the products.
    E0
        Chemical energy per unit volume.
    D
        Detonation speed.
    Q1, Q2
        Coefficients of artificial viscosity, quadratic and linear, as in eos shock.

    Example
    -------
    eos(tnt, jwl, 1630, 371.2e9, 3.231e9, 4.15, 0.95, 0.30, 7e9, 6930, Q1=1.5, Q2=0.06)
    strength(none, fluid, 0)
    material(tnt, eos-strength, tnt, none)

    Notes
    -----
    p = F (A (1 - w/(R1 V)) exp(-R1 V) + B (1 - w/(R2 V)) exp(-R2 V) + w E/V) with V = rho0/rho and
    the energy E per initial volume, dE = -p dV (Lee, Hornig & Kury 1968; Dobratz & Crawford 1985
    for constants). From the time of fix detonation, F, the burnt fraction of a point, grows to 1
    while the front moves 1.5 cells (programmed burn, Wilkins 1964). Viscous work heats the
    products.

    The strain energy, E - E0, decreases as the products do work. Fix initial_stress has no effect.

    See Also
    --------
    fix detonation, ideal-gas, strength fluid, material eos-strength
    """

    rho0: AboveZero
    A: AboveZero
    B: FromZero
    R1: AboveZero
    R2: AboveZero
    omega: AboveZero
    E0: AboveZero
    D: AboveZero
    Q1: ByName[FromZero] = 0.0
    Q2: ByName[FromZero] = 0.0

    def checked(self):
        rho0, *constants, Q1, Q2 = self
        return {"eos": Jwl(1 / rho0, *constants, 0.0), **artificial_viscosity(Q1, Q2)}


class Jwl(NamedTuple):
    style = "jwl"
    in_lanes = True
    traits = LawTraits(any_speed=True, fluid=True, burns=True)

    specific_volume: float
    A: float
    B: float
    R1: float
    R2: float
    omega: float
    energy: float  # initial E per reference volume
    D: float
    cell_size: float  # set when the scene is lowered


known_failure(
    Jwl,
    "an explosive without a fuse",
    when=lambda eos, scene: not any(fix.ignites for fix in scene.hub.fixes.values()),
    reason="nothing ignites material '{owner.id}', which has no pressure until then",
    cure="fix(light, detonation, all, x0/D): the ignition time of each point",
)


class Burning(NamedTuple):
    E: Any  # internal energy per reference volume
    since: Any  # time since ignition, negative before


@stored_heat.on(IdealGas)
@stored_heat.on(Jwl)
def _stored_heat_of_gas(eos, loss):
    return loss


@taken_heat.on(IdealGas)
@taken_heat.on(Jwl)
def _taken_heat_of_gas(eos, memory, heat):
    # A moment may remove slightly more energy than a cold gas has.
    return (max(heat, -0.1 * memory.E),)


@compression_energy.on(IdealGas)
@compression_energy.on(Jwl)
def _compression_energy_of_gas(eos, j, memory):
    return memory.E - eos.energy


def burnt(eos, memory):
    way, front = max(memory.since, 0) * eos.D, FRONT * eos.cell_size
    return where(way <= front, way / max(front, 1e-30), 1)


def cold(eos, j):
    """Return the products' pressure at E = 0, and its derivative with respect to J."""
    p = slope = 0
    for C, R in ((eos.A, eos.R1), (eos.B, eos.R2)):
        term, ratio = C * exponential(-R * j), eos.omega / (R * j)
        p += term * (1 - ratio)
        slope += term * (ratio / j - R * (1 - ratio))
    return p, slope


@initial_energy.on(Jwl)
def _initial_energy_jwl(eos, template):
    return Burning(eos.energy, -1e30)


@ignited.on(Jwl)
def _ignited_jwl(eos, memory, since):
    return (memory._replace(since=since),)


@compressed.on(Jwl)
def _compressed_jwl(eos, memory, step, heating):
    # dE = -p dJ with the step's mean pressure, linear in E
    before, j, dt = step
    half, after = 0.5 * (j - before), memory._replace(since=memory.since + dt)
    F = burnt(eos, after)
    explicit = pressure(eos, before, memory, ()) + F * cold(eos, j)[0]
    return after._replace(E=(memory.E - half * explicit + heating) / (1 + half * F * eos.omega / j))


@pressure.on(Jwl)
def _pressure_jwl(eos, j, memory, heat):
    return burnt(eos, memory) * (cold(eos, j)[0] + eos.omega * memory.E / j)


@bulk_modulus.on(Jwl)
def _bulk_modulus_jwl(eos, j, memory, heat):
    # At constant entropy; until all is burnt, waves are not faster than the front.
    p, slope = cold(eos, j)
    gas = eos.omega * memory.E / j
    K = max(gas + eos.omega * (p + gas) - j * slope, 0)
    front = eos.D * eos.D / (eos.specific_volume * j)
    return where(burnt(eos, memory) < 1, max(K, front), K)


@at_pressure.on(Jwl)
def _at_pressure_jwl(eos, j, memory, p, heat):
    return j, memory
