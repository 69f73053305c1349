"""Eos p-alpha."""

from typing import Any, NamedTuple

from karamelo_py.compiler import any_lane, round_off, where
from karamelo_py.compiler.powers import logarithm, power
from karamelo_py.points.laws import LawTraits, column, shown, specific_volume
from karamelo_py.points.laws.eos import (
    at_pressure,
    bulk_modulus,
    compressed,
    compression_energy,
    crush_work,
    crushed_strain,
    initial_energy,
    initial_loss,
    pressure,
    ratio_at_pressure,
)
from karamelo_py.points.laws.eos_strength import Eos
from karamelo_py.points.laws.parameters import AboveZero
from karamelo_py.script.errors import ScriptError

MOST_PASSES = 60  # Newton's method with bisection; small steps take two or three


class PAlphaConstants(NamedTuple):
    """Porous solid that can be crushed: foam, powder, concrete, rubble.

    Parameters
    ----------
    solid
        ID of the equation of state of the material without voids.
    alpha0
        Initial distension: density of the solid / density with voids.
    pe
        Pressure at which voids begin to be crushed.
    ps
        Pressure at which all voids are closed.
    n
        Exponent of the crush curve.

    Example
    -------
    eos(quartz, shock, 2650, 37e9, 3750, 1.8, 1, 730, 293, 1.5, 0.06)
    eos(sandstone, p-alpha, quartz, 1.25, 50e6, 1.2e9)
    strength(sandstone, plastic, 8e9, 40e6)
    material(rock, eos-strength, sandstone, sandstone)

    Notes
    -----
    p = ps(J_s)/alpha, with the pressure ps of the solid at its volume ratio J_s = J alpha0/alpha
    (Herrmann 1969, J. Appl. Phys. 40, 2490-2499; Carroll & Holt 1972). In loading beyond pe, alpha
    = 1 + (alpha0 - 1) ((ps - p)/(ps - pe))^n; alpha never increases. Each step solves for the
    pressure on the crush curve. Unloading and reloading are elastic, at constant alpha. Dump column
    ``alpha``. The work of crushing is dissipated; with a temperature, it heats the solid.

    See Also
    --------
    linear, shock, material eos-strength
    """

    solid: Eos
    alpha0: float
    pe: AboveZero
    ps: float
    n: AboveZero = 2.0

    def checked(self):
        solid, alpha0, pe, ps, _ = self
        if not alpha0 > 1:
            raise ScriptError(
                f"a distension of {alpha0:g} leaves no pores",
                argument="alpha0",
                expected="density of the solid over density with pores, above 1",
            )
        if not ps > pe:
            raise ScriptError(
                f"all pores are closed at ps = {ps:g}, but crushing begins at pe = {pe:g}",
                argument="ps",
                expected="a pressure above pe",
            )
        inner = solid.laws["eos"]
        if len(initial_energy(inner, 1.0)):
            raise ScriptError(
                f"eos '{solid.id}' is not an equation of state of a solid",
                argument="solid",
                expected="an eos linear, shock or fluid",
            )
        made = PAlpha(specific_volume(inner) * alpha0, inner, *self[1:])
        return {**solid.laws, "eos": made}


class PAlpha(NamedTuple):
    style = "p-alpha"
    in_lanes = True
    traits = LawTraits(of_solids=True)

    specific_volume: float
    solid: Any
    alpha0: float
    pe: float
    ps: float
    n: float


class Pores(NamedTuple):
    alpha: Any


class Distension(NamedTuple):
    pass


column(PAlpha, "alpha", Distension())


@shown.on(Distension)
def _shown_distension(tag, law, kin, state):
    return state.m.energy.alpha


@initial_loss.on(PAlpha)
def _initial_loss_p_alpha(eos, template):
    return (0.0,)


@initial_energy.on(PAlpha)
def _initial_energy_p_alpha(eos, template):
    return Pores(eos.alpha0)


def on_curve(eos, p):
    left = min(max((eos.ps - p) / (eos.ps - eos.pe), 0), 1)
    open_pores = (eos.alpha0 - 1) * power(left, eos.n)
    some = left > 0
    return 1 + open_pores, -eos.n * open_pores / where(some, left * (eos.ps - eos.pe), 1)


def solid_pressure(eos, j, alpha, heat):
    return pressure(eos.solid, j * eos.alpha0 / alpha, (), heat)


@compressed.on(PAlpha)
def _compressed_p_alpha(eos, memory, step, heating):
    # The solution is unique: ps(j alpha0/alpha(p))/alpha(p) falls with p. Heat shifts it slightly.
    old = memory.alpha
    low = eos.ps - (eos.ps - eos.pe) * power((old - 1) / (eos.alpha0 - 1), 1 / eos.n)
    crushing = (solid_pressure(eos, step.j, old, ()) > low * old) & (old > 1)
    high, p, moves = eos.ps, low, crushing
    for _ in range(MOST_PASSES):
        alpha, slope = on_curve(eos, p)
        solid = solid_pressure(eos, step.j, alpha, ())
        K = bulk_modulus(eos.solid, step.j * eos.alpha0 / alpha, (), ())
        excess = p - solid / alpha
        low, high = where(excess < 0, p, low), where(excess < 0, high, p)
        new = p - excess / (1 - (K - solid) * slope / (alpha * alpha))
        new = where((low < new) & (new < high), new, 0.5 * (low + high))
        settled = abs(new - p) <= 4 * round_off(p) * eos.ps
        p = where(moves, new, p)  # makes the number of passes the same in all lanes
        moves = moves & (not settled)
        if not any_lane(moves):
            break
    alpha, _ = on_curve(eos, p)
    return Pores(where(crushing, max(min(alpha, old), 1), old))


@crush_work.on(PAlpha)
def _crush_work_p_alpha(eos, before, after, step):
    # The elastic energy changes by -p dj minus the work of crushing.
    work = 0.5 * (step.before - step.j)
    work *= pressure(eos, step.before, before, ()) + pressure(eos, step.j, after, ())
    stored = compression_energy(eos, step.j, after) - compression_energy(eos, step.before, before)
    return where(after.alpha < before.alpha, max(work - stored, 0), 0)


@crushed_strain.on(PAlpha)
def _crushed_strain_p_alpha(eos, before, after):
    return logarithm(before.alpha / after.alpha)


@pressure.on(PAlpha)
def _pressure_p_alpha(eos, j, memory, heat):
    return solid_pressure(eos, j, memory.alpha, heat) / memory.alpha


@bulk_modulus.on(PAlpha)
def _bulk_modulus_p_alpha(eos, j, memory, heat):
    K = bulk_modulus(eos.solid, j * eos.alpha0 / memory.alpha, (), heat)
    return K / memory.alpha


@compression_energy.on(PAlpha)
def _compression_energy_p_alpha(eos, j, memory):
    # p dj = ps dJ_s/alpha0 at constant alpha
    return compression_energy(eos.solid, j * eos.alpha0 / memory.alpha, ()) / eos.alpha0


@ratio_at_pressure.on(PAlpha)
def _ratio_at_pressure_p_alpha(eos, p, heat):
    return at_pressure(eos, 1, Pores(eos.alpha0), p, heat)[0]


@at_pressure.on(PAlpha)
def _at_pressure_p_alpha(eos, j, memory, p, heat):
    alpha = min(on_curve(eos, p)[0], memory.alpha)
    return ratio_at_pressure(eos.solid, p * alpha, heat) * alpha / eos.alpha0, Pores(alpha)
