"""Material cam-clay, in logarithmic strains."""

from math import sqrt
from typing import Any, NamedTuple

from karamelo_py.compiler import implements, real, shared, where
from karamelo_py.compiler.powers import exponential as exp
from karamelo_py.compiler.powers import logarithm as log
from karamelo_py.compiler.slopes import Dual, value_of
from karamelo_py.points import laws
from karamelo_py.points.kinematics import (
    I,
    det,
    dev,
    inner,
    nothing,
    symmetric_tensor,
    tr,
    von_mises,
)
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.logarithmic import Logarithmic, elastic_trial
from karamelo_py.points.laws.parameters import AboveZero, ByName
from karamelo_py.script.errors import ScriptError


class CamClayConstants(NamedTuple):
    """Modified Cam-clay with consolidation, an elliptic yield surface and a critical state.

    Parameters
    ----------
    rho
        Initial density.
    G
        Shear modulus.
    M
        Critical state ratio q/p; 6 sin(phi)/(3 - sin(phi)) in triaxial compression.
    lam
        Slope of -ln(volume) against ln(p) in virgin consolidation: about lambda/(1 + e).
    kappa
        Slope in swelling and reloading, below lam.
    p0
        Initial effective pressure.
    pc
        Initial preconsolidation pressure, at least p0; default p0.

    Example
    -------
    material(clay, cam-clay, 1800, 4e6, 1.0, 0.1, 0.02, 100e3)
    material(crust, cam-clay, 1800, 4e6, 1.0, 0.1, 0.02, 50e3, pc=200e3)

    Notes
    -----
    Kirchhoff stress (J times Cauchy): p = p0 exp(-tr(e)/kappa), s = 2 G dev(e), with the
    logarithmic elastic strain e. Yield surface: q^2/M^2 + p (p - pc) = 0, with associated flow. pc
    grows with plastic compression v as exp(v/(lam - kappa)) (Roscoe & Burland 1968; in logarithmic
    strains and volumes Borja & Tamagnini 1998, "Cam-Clay plasticity part III", Comput. Methods
    Appl. Mech. Eng. 155).

    Undrained clay that starts at p0 = pc has p = p0 ((M^2 + eta^2)/M^2)^-(1 - kappa/lam) with eta =
    q/p. At the critical state: p0 2^-(1 - kappa/lam). Dump columns: equivalent plastic strain ep,
    and pc. Tension is not sustained. A stress of fix initial_stress outside the surface raises pc.

    At a free surface, a load must balance p0, which otherwise is released in the first step:
    ``fix(cover, edge_traction, all, b, yhi, 0, -100e3)`` at the top of the solid's region b with
    the other sides held, or ``fix(cell, edge_pressure, all, b, 100e3)`` all around. With fix
    initial_stress, the load must be its normal component.

    With anti_volumetric_locking, overconsolidated clay has the same peak strength but softens more:
    by 4 % with an overconsolidation ratio of 8, by 13 % with 16 (biaxial tests).

    See Also
    --------
    hencky, strength drucker-prager, strength mohr-coulomb, fix initial_stress, fix edge_traction
    """

    rho: AboveZero
    G: AboveZero
    M: AboveZero
    lam: AboveZero
    kappa: AboveZero
    p0: AboveZero
    pc: ByName[AboveZero | None] = None

    def checked(self):
        rho, G, M, lam, kappa, p0, pc = self
        if kappa >= lam:
            raise ScriptError(
                f"swelling is as soft as virgin consolidation: kappa {kappa:g}, lam {lam:g}",
                argument="kappa",
                expected=f"a number below lam, {lam:g}",
            )
        if pc is not None and pc < p0:
            raise ScriptError(
                f"the preconsolidation pressure {pc:g} is below the pressure {p0:g}",
                argument="pc",
                expected=f"a pressure of at least p0 = {p0:g}",
            )
        return CamClay(1 / rho, G, M, lam, kappa, p0, p0 if pc is None else pc)


class CamClay(NamedTuple):
    style = "cam-clay"
    in_lanes = True
    traits = LawTraits(flows=True, rings=False)

    specific_volume: float
    G: float
    M: float
    lam: float
    kappa: float
    p0: float
    pc: float


class State(NamedTuple):
    J: Any
    e: Any  # logarithmic elastic strain
    pc: Any
    ep: Any  # equivalent plastic strain
    loss: Any  # dissipated energy per reference volume


def pressure(law, e):
    return law.p0 * exp(-tr(e) / law.kappa)


@laws.initial_state.on(CamClay)
def _initial_state_cam_clay(law, kin, template):
    return State(1, nothing(kin), law.pc, 0, 0)


@laws.advance.on(CamClay)
def _advance_cam_clay(law, kin, state, dl, dt):
    trial = elastic_trial(Logarithmic(), state.e, dl)
    p, q = pressure(law, trial), 2 * law.G * von_mises(dev(trial))
    y, w = plastic_flow(law, q, p, state.pc)
    scale = 1 / (1 + w)
    e = scale * dev(trial) + (tr(trial) + y) / 3 * I
    slip = (1 - scale) * q / (3 * law.G)
    work = pressure(law, e) * y + scale * q * slip
    return State(
        state.J * det(I + dl),
        e,
        state.pc * exp(y / (law.lam - law.kappa)),
        state.ep + slip,
        state.loss + work,
    )


# The return to the surface has the plastic compression y and w = 6 G / M^2 times the plastic
# multiplier: q becomes q / (1 + w), p gets the factor exp(-y / kappa), pc exp(y / (lam - kappa)).


class ClayStress(NamedTuple):
    q: Any
    p: Any
    pc: Any


def after_flow(law, trial, y, w):
    q, p, pc = trial
    return ClayStress(q / (1 + w), p * exp(-y / law.kappa), pc * exp(y / (law.lam - law.kappa)))


def residuals(law, trial, y, w):
    """Return the residuals of the yield function and of the flow rule y = w M^2/6G (2 p - pc)."""
    q, p, pc = after_flow(law, trial, y, w)
    return q * q / law.M**2 + p * (p - pc), y - w * law.M**2 / (6 * law.G) * (2 * p - pc)


def newton_step(law, trial, y, w, errors):
    f, g = errors
    q, p, pc = after_flow(law, trial, y, w)
    c, slant = law.M**2 / (6 * law.G), 2 * p - pc
    falls, rises = p / law.kappa, pc / (law.lam - law.kappa)
    fy = -slant * falls - p * rises
    fw = -2 * q * q / (law.M**2 * (1 + w))
    gy = 1 + w * c * (2 * falls + rises)
    gw = -c * slant
    k = 1 / (fy * gw - fw * gy)
    return k * (fw * g - gw * f), k * (gy * f - fy * g)


_BISECTIONS = 14  # number of bisections; Newton's method then squares the error in each iteration
_NEWTON = 4


@shared
def plastic_flow(law, q, p, pc):
    """Return the y and w by which a trial with q and p returns to the surface; 0 inside it.

    With (1 + w) = q / q_s, where q_s is on the surface, one equation for y remains. The solution of
    this equation lies between y = 0 (or p = pc, if larger) and the critical state 2 p = pc.
    """
    yields = q * q / law.M**2 + p * (p - pc) > 0
    q = where(yields, q, law.M * pc)  # unused lanes get a value outside the surface
    trial = ClayStress(q, p, pc)
    c, a = law.M**2 / (6 * law.G), law.kappa * (law.lam - law.kappa) / law.lam
    isotropic = a * log(p / pc)
    critical = isotropic + a * log(real(2, p))
    low = where(critical > 0, max(isotropic, 0), critical)
    high = where(critical > 0, critical, 0)
    y, w = 0.5 * (low + high), real(0, p)
    for _ in range(_BISECTIONS):
        _, p_now, pc_now = after_flow(law, trial, y, 0)
        slant, above = 2 * p_now - pc_now, p_now * (pc_now - p_now)
        on_surface = law.M * sqrt(max(above, 0))
        far = on_surface * (y / c + slant) > q * slant
        near_top = on_surface > 0.5 * law.M * abs(slant)
        w = where(
            near_top, q / where(near_top, on_surface, 1) - 1, y / (c * where(near_top, 1, slant))
        )
        low, high = where(far, low, y), where(far, y, high)
        y = 0.5 * (low + high)
    w = max(w, 0)
    for _ in range(_NEWTON):
        dy, dw = newton_step(law, trial, y, w, residuals(law, trial, y, w))
        y, w = y + dy, w + dw
    return where(yields, y, 0), where(yields, w, 0)


@implements(plastic_flow, Dual)
def _plastic_flow_slopes(law, q, p, pc):
    # One Newton correction at the solution has the derivatives of the residual.
    q0, p0, pc0 = value_of((q, p, pc))
    y, w = plastic_flow(law, q0, p0, pc0)
    yields = w > 0
    errors = residuals(law, ClayStress(q, p, pc), y, w)
    at = ClayStress(where(yields, q0, law.M * pc0), p0, pc0)
    changes = newton_step(law, at, y, w, errors)
    return tuple(
        [
            Dual(x, tuple([where(yields, s, 0) for s in change.slopes]))
            for x, change in zip((y, w), changes, strict=True)
        ]
    )


@laws.kirchhoff_stress.on(CamClay)
def _kirchhoff_stress_cam_clay(law, kin, state):
    return 2 * law.G * dev(state.e) - pressure(law, state.e) * I


laws.answers(
    CamClay,
    {
        laws.elastic_strain: "e",
        laws.plastic_strain: "ep",
        laws.dissipated_energy: "loss",
        laws.by_rates: False,
    },
)


laws.column(CamClay, "ep", laws.plastic_strain)
laws.column(CamClay, "pc")


@laws.wave_speed_squared.on(CamClay)
def _wave_speed_squared_cam_clay(law, kin, state):
    # Squared speed of elastic waves along a principal direction; plastic waves are slower.
    modulus = pressure(law, state.e) / law.kappa + 4 / 3 * law.G
    tau = laws.kirchhoff_stress(law, kin, state)
    return (modulus + tau.largest_row_sum()) * law.specific_volume


@laws.energy_density.on(CamClay)
def _energy_density_cam_clay(law, kin, state):
    shear = dev(state.e)
    return law.kappa * (pressure(law, state.e) - law.p0) + law.G * inner(shear, shear)


@laws.with_stress.on(CamClay)
def _with_stress_cam_clay(law, kin, state, stress):
    tau = state.J * symmetric_tensor(kin, stress)
    p = max(-1 / 3 * tr(tau), 1e-6 * law.p0)
    q = von_mises(dev(tau))
    e = 0.5 / law.G * dev(tau) - law.kappa / 3 * log(p / law.p0) * I
    return state._replace(e=e, pc=max(state.pc, p + q * q / (law.M**2 * p)))
