"""Stress and stiffness of fibres in hyperelastic laws."""

from typing import Any, ClassVar, NamedTuple

import numpy as np

from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, inner
from karamelo_py.points.laws.by_energy import (
    OfInvariants,
    invariants,
    shear_of_matrix,
    stiffness_of_matrix,
    stress_of_matrix,
    variables,
)
from karamelo_py.points.laws.formulas import Code, evaluated
from karamelo_py.points.laws.leaning import warn_of_leaning
from karamelo_py.points.laws.placed import DirectionShown, Placed, directions_in

LEANS = 1e-9


class Fibres(NamedTuple):
    """Unit vectors a0 and b0 of two families of fibres at rest."""

    in_lanes = True

    a1: Any
    a2: Any
    a3: Any
    b1: Any
    b2: Any
    b3: Any


class OfFibres(OfInvariants):
    """A law that also depends on I4 = a0.C a0 and I6 = b0.C b0; it has a field `directions`."""

    __slots__ = ()
    twice_along: ClassVar[tuple[Code, ...]]  # derivatives with respect to I4 I4, I6 I6, I4 I6
    mixed: ClassVar[tuple[tuple[Code, ...], ...]]  # derivatives of `along` in I1, I2, J


def _leans(directions: Any, d: int) -> bool:
    a, b = directions[:3], directions[3:]
    pairs = {1: ((0, 1), (0, 2), (1, 2)), 2: ((0, 2), (1, 2)), 3: ()}[d]
    return any(np.max(abs(a[i] * a[j] + b[i] * b[j])) > LEANS for i, j in pairs)


INSTEAD = "a 3D scene, fibres along x, y or z, or two families that mirror each other"
warn_of_leaning(OfFibres, "fibres", lambda law, scene: _leans(law.directions, scene.d), INSTEAD)


def _lean_somewhere(law: Any, scene: Any) -> bool:
    rows = directions_in(law, scene)
    return bool(len(rows)) and _leans(rows.T, scene.d)


def fibre(law, F, family):
    a = law.directions[3 * family : 3 * family + 3]
    made = F.symmetric
    return made._make([a[i] * a[j] for i, j in made.places])


@variables.on(OfFibres)
def _variables_of_fibres(law, F, b):
    C = F.right_cauchy_green()
    return (*invariants(b, det(F)), inner(C, fibre(law, F, 0)), inner(C, fibre(law, F, 1)))


@laws.kirchhoff_stress.on(OfFibres)
def _kirchhoff_stress_of_fibres(law, kin, state):
    # 2 W_4 a a + 2 W_6 b b with a = F a0 (Holzapfel 2000, equation 6.212)
    F = state.F
    b = F.left_cauchy_green()
    at = variables(law, F, b)
    tau = stress_of_matrix(law, b, at)
    for family in (0, 1):
        if len(law.along[family]):
            pull = 2 * evaluated(law.along[family], law, at)
            tau = tau + pull * fibre(law, F, family).carried(F - I)
    return tau


def stiffness_of_fibres(law, b, at):
    """Return bounds of the fibres' stiffness; |a n|^2 <= I4 for a unit vector n."""
    # Slack fibres are included with their stiffness at rest, as the next step may stretch them.
    at = (*at[:3], max(at[3], 1), max(at[4], 1))
    _, _, J, *squares = at
    high = b.largest_row_sum()
    most = min(0.25 * at[0] * at[0], high * at[0])  # largest value of x (I1 - x)
    both = 8 * squares[0] * squares[1] * max(evaluated(law.twice_along[2], law, at), 0)
    for family in (0, 1):
        x = squares[family]
        both += 2 * x * max(evaluated(law.along[family], law, at), 0)
        both += 4 * x * x * max(evaluated(law.twice_along[family], law, at), 0)
        W1, W2, WJ = [abs(evaluated(code, law, at)) for code in law.mixed[family]]
        both += 4 * x * (2 * high * W1 + 2 * most * W2 + J * WJ)
    return both


@laws.wave_speed_squared.on(OfFibres)
def _wave_speed_squared_of_fibres(law, kin, state):
    b = state.F.left_cauchy_green()
    at = variables(law, state.F, b)
    both = max(stiffness_of_matrix(law, b, at), 0) + stiffness_of_fibres(law, b, at)
    return both * law.specific_volume


@laws.shear_part.on(OfFibres)
def _shear_part_of_fibres(law, kin, state):
    b = state.F.left_cauchy_green()
    at = variables(law, state.F, b)
    both = shear_of_matrix(law, b, at) + stiffness_of_fibres(law, b, at)
    return both * law.specific_volume


class PlacedFibre(Placed):
    """One family of fibres, given by formulas of position."""

    __slots__ = ()


class PlacedFibres(PlacedFibre):
    """Two families of fibres, at least one of them given by formulas of position."""

    __slots__ = ()


warn_of_leaning(PlacedFibre, "fibres", _lean_somewhere, INSTEAD)


for _axis, _letter in enumerate("xyz"):
    laws.column(PlacedFibre, f"fibre_{_letter}", DirectionShown(_axis))
    laws.column(PlacedFibres, f"fibre2_{_letter}", DirectionShown(3 + _axis))


laws.answers(OfFibres, {laws.is_round: False})
