"""Hyperelastic laws from a stored energy, differentiated when the law is defined.

Formulas of invariants are computed in lanes. Formulas of principal stretches, or with functions in
`ONE_BY_ONE`, are computed point by point (`karamelo_py.points.laws.formulas`).
"""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from itertools import combinations, product
from math import exp, isfinite, isnan, nan, sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np

from karamelo_py.compiler import point_function, where
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, det, inner, total, tr
from karamelo_py.points.kinematics.principal import PairLimits, from_principal, real_principal
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.elastic import OfDeformation
from karamelo_py.points.laws.formulas import (
    COMPARED,
    KNOWN,
    Code,
    ProgramWriter,
    check_operations,
    evaluated,
    in_lanes,
)
from karamelo_py.points.laws.thermoelastic import warmed_elastic
from karamelo_py.script import terms
from karamelo_py.script.derivatives import derivative, plus, replaced, times, to_power
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.script.terms import Term

INVARIANTS = ("I1", "I2", "J")
FIBRES = ("I4", "I6")  # squared stretches of two fibre families
STRETCHES = ("l1", "l2", "l3")


class ByEnergy(OfDeformation):
    __slots__ = ()
    traits = LawTraits(rebounds=True)
    in_lanes = True
    along: ClassVar[tuple[Code, ...]] = ()  # derivatives with respect to I4, I6
    start: ClassVar[int]  # index of the formula's first number
    energy: ClassVar[Code]
    first: ClassVar[tuple[Code, ...]]  # derivatives with respect to a, b, c
    second: ClassVar[tuple[Code, ...]]  # derivatives with respect to aa, ab, ac, bb, bc, cc


@warmed_elastic.on(ByEnergy)
def _warmed_elastic_by_energy(law, T):
    return law._replace(T=T) if "T" in law._fields else law


class OfInvariants(ByEnergy):
    __slots__ = ()


class OfStretches(ByEnergy):
    __slots__ = ()
    scalarised = ("kirchhoff_stress", "wave_speed_squared", "shear_part", "energy_density")


FIELDS = ("specific_volume", "lam", "G", "at_rest")

_L = [Expression.seed(name) for name in STRETCHES]
_A, _B, _C = [to_power(one, 2) for one in _L]
IN_STRETCHES = {
    "I1": plus(plus(_A, _B), _C),
    "I2": plus(plus(times(_A, _B), times(_B, _C)), times(_C, _A)),
    "J": times(times(_L[0], _L[1]), _L[2]),
    **dict.fromkeys(FIBRES, Expression(1.0)),  # a matrix without fibres
}


def law_of(
    rho: float,
    energy: Expression,
    directions: tuple = (),
    T: float = 293.0,
    kind: type[ByEnergy] = OfInvariants,
) -> NamedTuple:
    """Build the law with this stored energy per reference volume.

    `directions` are :class:`~karamelo_py.points.laws.fibres.Fibres` if the formula has I4 or I6,
    `T` is the temperature at rest, `kind` the class of a law of invariants. Raises ScriptError for
    operations without a derivative, for stress at rest, for no stiffness at rest, and for
    anisotropic formulas.
    """
    term = replaced(energy, {"I3": to_power(Expression.seed("J"), 2)})
    check_operations(term, "energy", KNOWN - {*COMPARED, "if"})
    stretched = replaced(term, {**IN_STRETCHES, "T": Expression(T)})
    slopes = [derivative(stretched, name) for name in STRETCHES]
    curves = [derivative(slopes[0], name) for name in STRETCHES[:2]]
    lam, G, at_rest = _judged(stretched, slopes, curves)
    names = INVARIANTS
    if energy.names.intersection(STRETCHES):
        if directions:
            raise ScriptError(
                f"{min(energy.names.intersection(FIBRES))} cannot be combined with l1, l2 and l3",
                argument="energy",
                expected="an energy of the fibres and I1, I2 and J",
                hint="l1^2 + l2^2 + l3^2 is I1, l1*l2*l3 is J",
            )
        names, kind, term = STRETCHES, OfStretches, replaced(term, IN_STRETCHES)
    writer = ProgramWriter((*names, *FIBRES))
    first = [derivative(term, name) for name in names]
    second = [derivative(first[names.index(a)], b) for k, a in enumerate(names) for b in names[k:]]
    codes: dict[str, Any] = {
        "energy": writer.code(term),
        "first": tuple(map(writer.code, first)),
        "second": tuple(map(writer.code, second)),
    }
    if directions:
        codes |= _along_fibres(term, writer, T)
    codes["in_lanes"] = kind.in_lanes and in_lanes(codes["energy"])
    fields: dict[str, Any] = dict(zip(FIELDS, (1 / rho, lam, G, at_rest), strict=True))
    if directions:
        fields["directions"] = directions
    law = writer.law(kind, fields, codes, T=T)
    for family, path in _fibre_paths(law):
        if not (stiffness := stiffness_along_fibre(law, family, path, 1.0)) > 0:
            what, name = "energy" if isnan(stiffness) else "stiffness", FIBRES[family]
            raise ScriptError(
                f"the body has no {what} in {path} near rest",
                argument="energy",
                expected=f"an energy that grows with {name}, such as k*({name} - 1)^2 with k > 0, "
                f"or with max({name} - 1, 0) if slack",
            )
    return law


def _along_fibres(term: Term, writer: ProgramWriter, T: float) -> dict[str, Any]:
    rest = {**dict(zip(INVARIANTS, (3.0, 3.0, 1.0), strict=True)), **dict.fromkeys(FIBRES, 1.0)}
    slopes = [derivative(term, name) for name in FIBRES]
    for name, slope in zip(FIBRES, slopes, strict=True):
        tension = terms.evaluated(slope, {**rest, "T": T}.__getitem__)
        if abs(tension) > 0:
            raise ScriptError(
                f"the energy changes by {tension:.4g} {name} at rest: the fibres have a stress",
                argument="energy",
                expected=f"an energy that is least for {name} = 1, such as ({name} - 1)^2",
            )
    curves = [derivative(slopes[i], FIBRES[j]) for i, j in ((0, 0), (1, 1), (0, 1))]
    mixed = [[derivative(slope, name) for name in INVARIANTS] for slope in slopes]
    return {
        "along": tuple(map(writer.code, slopes)),
        "twice_along": tuple(map(writer.code, curves)),
        "mixed": tuple(tuple(map(writer.code, row)) for row in mixed),
    }


def value_at(root: Term, stretches: Sequence[float]) -> float:
    return terms.evaluated(root, dict(zip(STRETCHES, stretches, strict=True)).__getitem__)


def _judged(energy: Term, slopes: list[Term], curves: list[Term]) -> tuple[float, float, float]:
    """Return Lame's parameters and the energy at rest; refuse an anisotropic or unstable energy."""
    rest = (1.0, 1.0, 1.0)
    at_rest, stress = value_at(energy, rest), value_at(slopes[0], rest)
    stiffness, lam = (value_at(curve, rest) for curve in curves)
    if not all(map(isfinite, (at_rest, stress, stiffness, lam))):
        raise ScriptError("the energy has no value at rest", argument="energy")
    if abs(stress) > 1e-9 * (abs(stiffness) + abs(lam)):
        raise ScriptError(
            f"the body has a stress of {stress:.4g} at rest",
            argument="energy",
            expected="an energy that is least for I1 = I2 = 3, J = 1 and l1 = l2 = l3 = 1",
            hint="I1*J^(-2/3) - 3 instead of I1 - 3, or an additional term -mu*log(J)",
        )
    some = (1.1, 0.8, 1.3)
    others = [value_at(energy, (some[i], some[j], some[k])) for i, j, k in ((1, 0, 2), (2, 1, 0))]
    if not np.allclose(others, value_at(energy, some), rtol=1e-9):
        raise ScriptError(
            "the energy changes if l1, l2 and l3 are exchanged",
            argument="energy",
            expected="the same term for each of l1, l2 and l3",
        )
    G = 0.5 * (stiffness - lam)
    K = lam + 2 / 3 * G
    if not (G > 0 and K > 1e-9 * G):
        raise ScriptError(
            f"the shear modulus at rest is {G:.4g} and the bulk modulus {K:.4g}",
            argument="energy",
            expected="an energy that grows with every strain",
            hint="+ K/2*(J - 1)^2 resists a change of volume" if G > 0 else None,
        )
    return lam, G, at_rest


def directional_stiffness(law: NamedTuple, stretches: Sequence[float], a: int) -> float:
    """Return l_a^2 d2W/dl_a^2 at principal stretches: rho c^2 of a wave along direction `a`."""
    if isinstance(law, OfStretches):
        return stretches[a] ** 2 * evaluated(law.second[(0, 3, 5)[a]], law, stretches)
    at, x = invariants_of(stretches), stretches[a] ** 2
    return along_direction(law, at, x, at[0] - x)


def invariants_of(stretches: Sequence[float]) -> tuple[float, float, float]:
    squares = [x * x for x in stretches]
    first = sum(squares)
    second = 0.5 * (first * first - sum(x * x for x in squares))
    return first, second, stretches[0] * stretches[1] * stretches[2]


def stiffness_of_path(law: NamedTuple, stretches: Callable, x: float) -> float:
    """Return the second derivative of the energy in ln x along a path (Drucker's stability)."""
    ends = [tuple(map(float, stretches(x * exp(h)))) for h in (-NEAR, 0, NEAR)]
    if not isinstance(law, OfStretches):
        ends = [(*invariants_of(end), 1.0, 1.0) for end in ends]
    W = [evaluated(law.energy, law, end) for end in ends]
    return W[0] + W[2] - 2 * W[1]


ISOCHORIC = {
    "uniaxial stretching at constant volume": lambda x: (x, x**-0.5, x**-0.5),
    "biaxial stretching at constant volume": lambda x: (x, x, x**-2),
    "shear at constant volume": lambda x: (x, 1 / x, 1.0),
}
PATHS = ISOCHORIC | {
    "uniaxial strain": lambda x: (x, 1.0, 1.0),
    "swelling": lambda x: (x, x, x),
}
ALONG_FIBRES = {
    "stretching along the fibres at constant volume": lambda x: (x, x**-0.5),
    "stretching along the fibres alone": lambda x: (x, 1.0),
}
NEAR = 1e-3
ANGLES = 1.0, 0.75, 0.5, 0.25, 0.0  # squared cosines between two families of fibres


def _fibre_paths(law: NamedTuple) -> list[tuple[int, str]]:
    return list(product([k for k, code in enumerate(law.along) if code], ALONG_FIBRES))


def aligned(law: NamedTuple) -> float:
    """Return the squared cosine of the angle between two families of fibres."""
    return sum(p * q for p, q in zip(law.directions[:3], law.directions[3:], strict=True)) ** 2


def stiffness_along_fibre(
    law: NamedTuple, family: int, path: str, x: float, cosine2: float | None = None
) -> float:
    """Return l^2 d2W/dl^2 of a stretch l = x along a family of fibres, times NEAR^2.

    `cosine2` replaces the squared cosine between the families. At constant volume the result is the
    curvature in ln l. The result is NaN where the energy has no value.
    """
    along = aligned(law) if cosine2 is None else cosine2
    W = []
    for h in (-NEAR, 0, NEAR):
        stretch, side = ALONG_FIBRES[path](x * exp(h))
        squares = [stretch**2, along * stretch**2 + (1 - along) * side * side]
        if family:
            squares.reverse()
        try:
            W.append(evaluated(law.energy, law, (*invariants_of((stretch, side, side)), *squares)))
        except (ValueError, ZeroDivisionError, OverflowError):
            return nan
    if np.iscomplexobj(W):
        return nan
    curvature = W[0] + W[2] - 2 * W[1]
    return curvature if side != 1 else curvature - 0.5 * NEAR * (W[2] - W[0])


def least_stiffness(law: NamedTuple, path: str, x: float) -> float:
    """Return the smallest stiffness along a principal direction or a path at constant volume."""
    at = PATHS[path](x)
    stiffness = [directional_stiffness(law, at, a) for a in {*map(at.index, at)}]
    if path in ISOCHORIC:
        stiffness.append(stiffness_of_path(law, PATHS[path], x))
    return min(stiffness) if all(map(isfinite, stiffness)) else nan


@lru_cache(typed=True)
def first_instability(law: NamedTuple, turning: bool = False) -> tuple[str, float] | None:
    """Return the path and stretch, closest to rest, at which the stiffness first vanishes.

    A path ends where the energy is not defined, as at the limit of chains. Fibres whose directions
    differ from point to point (`turning`) may enclose any angle.
    """
    unstable = []
    judged = [(path, partial(least_stiffness, law, path), x) for path in PATHS for x in (0.5, 3.0)]
    for (family, path), end in product(_fibre_paths(law), (0.5, 2.0)):
        for cosine2 in ANGLES if turning else (aligned(law),):
            along = partial(stiffness_along_fibre, law, family, path, cosine2=cosine2)
            judged.append((path, along, end))
    for path, stiffness_at, end in judged:
        for x in np.geomspace(1, end, 60)[1:].tolist():
            try:
                stiffness = stiffness_at(x)
            except (ValueError, ZeroDivisionError, OverflowError):
                break
            if not isfinite(stiffness):
                break
            if not stiffness > 0:
                unstable.append((abs(np.log(x)), path, x))
                break
    return min(unstable)[1:] if unstable else None


def squared(s):
    a = s.at()
    return s._make(
        [
            total([a[i, k] * a[k, j] for k in range(3) if (i, k) in a and (k, j) in a])
            for i, j in s.places
        ]
    )


@point_function()
def variables(law, F, b):
    """Return I1, I2, J, and with fibres I4 and I6."""


@variables.on(OfInvariants)
def _variables_of_invariants(law, F, b):
    return invariants(b, det(F))


def invariants(b, J):
    first = tr(b)
    return first, 0.5 * (first * first - inner(b, b)), J


@laws.kirchhoff_stress.on(OfInvariants)
def _kirchhoff_stress_of_invariants(law, kin, state):
    b = state.F.left_cauchy_green()
    return stress_of_matrix(law, b, variables(law, state.F, b))


def stress_of_matrix(law, b, at):
    # tau = 2 (W_1 + I1 W_2) b - 2 W_2 b b + J W_J I (Holzapfel 2000, equation 6.30)
    W1, W2, WJ = [evaluated(code, law, at) for code in law.first]
    tau = 2 * (W1 + at[0] * W2) * b + at[2] * WJ * I
    return tau - 2 * W2 * squared(b) if len(law.first[1]) else tau


@laws.energy_density.on(OfInvariants)
def _energy_density_of_invariants(law, kin, state):
    at = variables(law, state.F, state.F.left_cauchy_green())
    return evaluated(law.energy, law, at) - law.at_rest


@laws.wave_speed_squared.on(OfInvariants)
def _wave_speed_squared_of_invariants(law, kin, state):
    b = state.F.left_cauchy_green()
    at = variables(law, state.F, b)
    return max(stiffness_of_matrix(law, b, at), 0) * law.specific_volume


def stiffness_of_matrix(law, b, at):
    # Bound each term of l^2 d2W/dl^2 (`along_direction`) and of the shear stiffness, 2 x_a (W_1
    # + x_c W_2): squared stretches x lie within Gershgorin's bounds and above J^2/I2.
    I1, I2, J, *_ = at
    high = b.largest_row_sum()
    W1, W2, _ = [evaluated(code, law, at) for code in law.first]
    W11, W12, W1J, W22, W2J, WJJ = [evaluated(code, law, at) for code in law.second]
    along, shear = 2 * high * max(W1, 0) + J * J * WJJ, 2 * high * max(W1, 0)
    _, second, _ = law.first
    if max(*[len(code) for code in (second, *law.second[:5])]) > 0:
        low = max(J * J / I2, b.smallest_row_difference())
        along += 4 * high * high * max(W11, 0) + 4 * low * low * min(W11, 0)
        along += 4 * J * (high * max(W1J, 0) + low * min(W1J, 0))
    if len(second):
        most = min(0.25 * I1 * I1, high * (I1 - low))  # largest value of x (I1 - x)
        least = max(min(low * (I1 - low), high * (I1 - high)), 0)
        along += 2 * most * max(W2, 0) + 2 * least * min(W2, 0)
        along += 8 * high * most * max(W12, 0) + 4 * most * most * max(W22, 0)
        along += 4 * J * (most * max(W2J, 0) + least * min(W2J, 0))
        shear += 2 * high * high * max(W2, 0)
    return max(along, shear)


def along_direction(law, at, x, rest):
    """Return l^2 d2W/dl^2 for a stretch l = sqrt(x); the other two squares sum to `rest`."""
    J, at = at[2], (*at, 1, 1)
    W1, W2, _ = [evaluated(code, law, at) for code in law.first]
    W11, W12, W1J, W22, W2J, WJJ = [evaluated(code, law, at) for code in law.second]
    along = 2 * x * (W1 + rest * W2) + 4 * x * x * (W11 + 2 * rest * W12 + rest * rest * W22)
    return along + 4 * x * J * (W1J + rest * W2J) + J * J * WJJ


@laws.shear_part.on(OfInvariants)
def _shear_part_of_invariants(law, kin, state):
    b = state.F.left_cauchy_green()
    return shear_of_matrix(law, b, variables(law, state.F, b)) * law.specific_volume


def shear_of_matrix(law, b, at):
    x = b.largest_row_sum()
    W1, W2, _ = [evaluated(code, law, at) for code in law.first]
    W11, _, _, W22, _, _ = [evaluated(code, law, at) for code in law.second]
    y = max(at[0] - x, 0)
    stiffer = max(4 * x * x * (W11 + y * y * W22), 0)
    return 2 * (1 + x) * (W1 + y * W2) + stiffer


def stretches_of(b):
    values, directions = real_principal(b)
    return tuple([sqrt(x) for x in values]), directions


@laws.kirchhoff_stress.on(OfStretches)
def _kirchhoff_stress_of_stretches(law, kin, state):
    # tau_a = l_a dW/dl_a (Ogden 1997, section 4.3)
    b = state.F.left_cauchy_green()
    at, directions = stretches_of(b)
    slopes = [evaluated(code, law, at) for code in law.first]
    tau = tuple([x * slope for x, slope in zip(at, slopes, strict=True)])
    return from_principal(b, tau, directions, PairLimits(*limits_of(law, at, slopes)))


PAIRS = tuple(combinations(range(3), 2))
CLOSE = 1e-5  # relative difference of squared stretches that count as equal


def limits_of(law, at, slopes):
    """Return limits of (tau_a - tau_b) / (l_a^2 - l_b^2) for equal stretches."""
    W11, W12, W13, W22, W23, W33 = [evaluated(code, law, at) for code in law.second]
    twice = (W11 + W22 - 2 * W12, W11 + W33 - 2 * W13, W22 + W33 - 2 * W23)
    each = zip(PAIRS, twice, strict=True)
    return [0.25 * (slopes[i] / at[i] + slopes[j] / at[j] + curve) for (i, j), curve in each]


@laws.energy_density.on(OfStretches)
def _energy_density_of_stretches(law, kin, state):
    at, _ = stretches_of(state.F.left_cauchy_green())
    return evaluated(law.energy, law, at) - law.at_rest


@laws.wave_speed_squared.on(OfStretches)
def _wave_speed_squared_of_stretches(law, kin, state):
    at, _ = stretches_of(state.F.left_cauchy_green())
    W11, _, _, W22, _, W33 = [evaluated(code, law, at) for code in law.second]
    l1, l2, l3 = at
    along = max(l1 * l1 * W11, l2 * l2 * W22, l3 * l3 * W33, 0)
    return max(along, shear_between(law, at)) * law.specific_volume


@laws.shear_part.on(OfStretches)
def _shear_part_of_stretches(law, kin, state):
    at, _ = stretches_of(state.F.left_cauchy_green())
    return 2 * shear_between(law, at) * law.specific_volume


def shear_between(law, at):
    """Return the largest rho c^2 of shear waves, l_a^2 (tau_a - tau_b) / (l_a^2 - l_b^2)."""
    slopes = [evaluated(code, law, at) for code in law.first]
    limits = limits_of(law, at, slopes)
    squares = []
    for (i, j), limit in zip(PAIRS, limits, strict=True):
        apart = at[i] * at[i] - at[j] * at[j]
        alike = abs(apart) < CLOSE
        tau = at[i] * slopes[i] - at[j] * slopes[j]
        ratio = where(alike, limit, tau / where(alike, 1, apart))
        squares.append(max(at[i] * at[i], at[j] * at[j]) * ratio)
    return max(*squares, 0)
