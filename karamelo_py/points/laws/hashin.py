"""Material hashin: failure of fibres and matrix in a lamina."""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import where
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I
from karamelo_py.points.laws.elastic import State as Deformed
from karamelo_py.points.laws.oriented import with_axes_of, without_axes
from karamelo_py.points.laws.orthotropic import (
    STIFFNESS,
    VOIGT,
    Directional,
    axes,
    of_stiffness,
    rotated,
    stress_of,
)
from karamelo_py.points.laws.parameters import AboveZero, ByName
from karamelo_py.points.laws.tsai_hill import (
    DirectionalBase,
    Ply,
    Turn,
    in_axes,
    refuse_whole,
)
from karamelo_py.script.errors import ScriptError


class Hashin(NamedTuple):
    """Elastic solid with fibres, in which fibres and matrix fail by different criteria.

    Parameters
    ----------
    elastic
        ID of a material orthotropic or transverse.
    X, Xc
        Strengths along axis 1, the fibres, in tension and compression.
    Y, Yc
        Strengths normal to the fibres in tension and compression.
    S
        Shear strength along the fibres (of planes that contain them).
    St
        Shear strength in planes normal to the fibres, above Y/2.
    angle, tilt, spin
        Rotation of the axes of strength from x, y, z in degrees: by `angle` about z, by `tilt`
        about the new axis 1, by `spin` about the new axis 3. The angles of the elastic
        material are separate; its `axes` also rotate these axes.
    residual
        Remaining fraction of the stiffness, above 0 and below 1.

    Example
    -------
    material(lamina, orthotropic, 1600, 140e9, 9e9, 9e9, 0.3, 0.3, 0.4, 5e9, 5e9, 3e9, 30)
    material(ply, hashin, lamina, 2000e6, 1200e6, 50e6, 170e6, 80e6, 60e6, 30)

    Notes
    -----
    The four criteria of Hashin (1980, "Failure criteria for unidirectional fiber composites", J.
    Appl. Mech. 47) are, with s = T22 + T33 and t = (T12^2 + T13^2)/S^2: T11^2/X^2 + t = 1 for
    fibres in tension, T11^2/Xc^2 = 1 for fibres in compression; s^2/Y^2 + (T23^2 - T22 T33)/St^2 +
    t = 1 for the matrix in tension, s > 0, and (Yc^2/(4 St^2) - 1) s/Yc + s^2/(4 St^2) + (T23^2 -
    T22 T33)/St^2 + t = 1 in compression. T is the second Piola-Kirchhoff stress. Broken fibres
    leave the fraction `residual` of the stress. A broken matrix leaves this fraction of E2, E3,
    G12, G13 and G23; the fibres retain E1 and nu12. Cracks do not close. Stiffness is reduced at
    the beginning of the next step, and the lost energy is dissipated. Dump columns: the largest
    values of the criteria so far, `fibre_t`, `fibre_c`, `matrix_t` and `matrix_c` (tension,
    compression), their maximum `damage_init`, and `damage`, 0 or 1. If points break one after the
    other, the energy of a crack depends on the cell size.

    See Also
    --------
    tsai-hill, orthotropic, transverse, fix erosion
    """

    elastic: DirectionalBase
    X: AboveZero
    Xc: AboveZero
    Y: AboveZero
    Yc: AboveZero
    S: AboveZero
    St: AboveZero
    angle: float = 0.0
    tilt: float = 0.0
    spin: float = 0.0
    residual: ByName[AboveZero] = 0.01

    syntax = "elastic, X, Xc, Y, Yc, S, St[, angle][, tilt][, spin][, residual=0.01]"

    def checked(self):
        elastic, *strengths, angle, tilt, spin, residual = self
        if not (St := self.St) > (Y := self.Y) / 2:
            raise ScriptError(
                f"with Y = {Y:g} and St = {St:g} a tension T22 = T33 would never break the matrix",
                argument="St",
                expected="a shear strength across the fibres above half of Y",
            )
        refuse_whole(residual)
        R = axes(angle, tilt, spin)
        law = without_axes(elastic.whole)
        cracked, turn = with_cracks(law, R, residual), Turn(*map(float, R.ravel()))
        return with_axes_of(elastic.whole, BreakingApart(law, cracked, *strengths, residual, turn))


def with_cracks(law: Directional, R: np.ndarray, residual: float) -> Directional:
    """Return the law with the fraction `residual` of all moduli, except E1 along axis 1 of R."""
    C = np.array([[law[STIFFNESS[a][b]] for b in range(6)] for a in range(6)])
    full = rotated(C, R.T)
    compliance = np.linalg.inv([[full[a + b] for b in VOIGT] for a in VOIGT])
    compliance[1:, 1:] /= residual
    return of_stiffness(law.specific_volume, rotated(np.linalg.inv(compliance), R))


class _Strengths(NamedTuple):
    elastic: Directional
    cracked: Directional  # law with a broken matrix
    X: float
    Xc: float
    Y: float
    Yc: float
    S: float
    St: float
    residual: float
    turn: Turn  # columns: the axes of strength


class BreakingApart(Ply, _Strengths):
    """A ply with the criteria of Hashin."""

    __slots__ = ()


class State(NamedTuple):
    F: Any
    # Largest values of the criteria so far.
    fibre_t: Any
    fibre_c: Any
    matrix_t: Any
    matrix_c: Any
    fibres: Any  # fraction of the stress that remains
    matrix: Any  # 1 if whole, else 0
    loss: Any  # dissipated energy per reference volume


@laws.initial_state.on(BreakingApart)
def _initial_state_hashin(law, kin, template):
    return State(laws.initial_state(law.elastic, kin, template).F, 0, 0, 0, 0, 1, 1, 0)


def matrix_criteria(law, T):
    """Return the criteria in tension and compression; the sign of the stress selects one."""
    _, t22, t33, t12, t13, t23 = in_axes(law.turn, T)
    s, shear = t22 + t33, (t12 * t12 + t13 * t13) / (law.S * law.S)
    across = 1 / (law.St * law.St)
    both = (t23 * t23 - t22 * t33) * across + shear
    pressed = (0.25 * law.Yc * law.Yc * across - 1) / law.Yc * s + 0.25 * s * s * across
    return where(s > 0, s * s / (law.Y * law.Y) + both, 0), where(s < 0, pressed + both, 0)


def fibre_criteria(law, T):
    t11, _, _, t12, t13, _ = in_axes(law.turn, T)
    tension, compression = t11 / law.X, t11 / law.Xc
    shear = (t12 * t12 + t13 * t13) / (law.S * law.S)
    return where(t11 > 0, tension * tension + shear, 0), where(t11 < 0, compression**2, 0)


def piola_stress(law, kin, state):
    E = laws.elastic_strain(law.elastic, kin, Deformed(state.F))
    cracked = (1 - state.matrix) * stress_of(law.cracked, E)
    return state.matrix * stress_of(law.elastic, E) + cracked


@laws.advance.on(BreakingApart)
def _advance_hashin(law, kin, state, dl, dt):
    # Broken parts lose their stress in the next step: a load step with a jump has no equilibrium.
    new = state._replace(
        fibres=where(max(state.fibre_t, state.fibre_c) < 1, 1, law.residual),
        matrix=where(max(state.matrix_t, state.matrix_c) < 1, 1.0, 0.0),
    )
    gone = laws.energy_density(law, kin, state) - laws.energy_density(law, kin, new)
    new = new._replace(F=state.F.after(dl), loss=state.loss + gone)
    T = piola_stress(law, kin, new)
    fibres, matrix = fibre_criteria(law, T), matrix_criteria(law, T)
    most = [max(old, now) for old, now in zip(state[1:5], (*fibres, *matrix), strict=True)]
    return State(new.F, *most, *new[5:])


@laws.kirchhoff_stress.on(BreakingApart)
def _kirchhoff_stress_hashin(law, kin, state):
    return state.fibres * piola_stress(law, kin, state).carried(state.F - I)


@laws.energy_density.on(BreakingApart)
def _energy_density_hashin(law, kin, state):
    at = Deformed(state.F)
    cracked = (1 - state.matrix) * laws.energy_density(law.cracked, kin, at)
    return state.fibres * (state.matrix * laws.energy_density(law.elastic, kin, at) + cracked)


@laws.damage.on(BreakingApart)
def _damage_hashin(law, kin, state):
    return where((state.fibres < 1) | (state.matrix < 1), 1, 0)


@laws.damage_initiation.on(BreakingApart)
def _damage_initiation_hashin(law, kin, state):
    return max(
        max(state.fibre_t, state.fibre_c),
        max(state.matrix_t, state.matrix_c),
    )


for _mode in ("fibre_t", "fibre_c", "matrix_t", "matrix_c"):
    laws.column(BreakingApart, _mode)
