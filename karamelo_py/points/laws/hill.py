"""Material hill: plasticity with directions (Hill 1948)."""

from collections import namedtuple
from itertools import product
from math import sqrt
from typing import Any, ClassVar, NamedTuple

import numpy as np

from karamelo_py.compiler import any_lane, implements, round_off, shared, where
from karamelo_py.compiler.powers import logarithm_near_one as log
from karamelo_py.compiler.slopes import Dual, value_of
from karamelo_py.language.arguments import Argument
from karamelo_py.language.scene import Scene
from karamelo_py.points import laws
from karamelo_py.points.kinematics import (
    I,
    det,
    inv,
    nothing,
    stretch,
    sym,
    symmetric_tensor,
    total,
    tr,
    unit,
)
from karamelo_py.points.laws.elastic import OfDeformation
from karamelo_py.points.laws.eos_strength import Strength
from karamelo_py.points.laws.linear import LinearElastic
from karamelo_py.points.laws.oriented import Axes, oriented
from karamelo_py.points.laws.orthotropic import (
    INDEX,
    OUT_OF_SCENE,
    STIFFNESS,
    VOIGT,
    Directional,
    fastest,
    rotated,
    warn_of_axes,
)
from karamelo_py.points.laws.orthotropic import axes as rotation
from karamelo_py.points.laws.parameters import ByName, MaterialArgument
from karamelo_py.points.laws.strengths import initial_memory
from karamelo_py.points.laws.strengths.hardening import (
    LinearHardening,
    Plastic,
    before_flow,
    flow_stress,
    updated_memory,
)
from karamelo_py.script.errors import ScriptError

COUPLED = 1e-9  # relative out-of-plane part that counts as 0
FACTORS = np.array([1.0, 1.0, 1.0, sqrt(2), sqrt(2), sqrt(2)])  # Mandel's notation


class ElasticBase(MaterialArgument):
    script_kind = "the ID of a material linear, orthotropic or transverse"

    @classmethod
    def refusal(cls, law: Any) -> tuple[str, str] | None:
        fits = isinstance(law, LinearElastic | Directional)
        return None if fits else ("has no constant stiffness", cls.script_kind)


class Ratios:
    """Script argument: numbers above 0 in parentheses."""

    script_kind: ClassVar[str]
    size: ClassVar[int]

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> tuple[float, ...]:
        values = [one.value(hub) for one in argument.listed()]
        numbers = tuple(one for one in values if isinstance(one, float))
        if not len(values) == len(numbers) == cls.size or not min(numbers) > 0:
            message = f"'{argument.text}' is not {cls.script_kind}"
            raise ScriptError(
                message, mark=argument.mark, expected=f"{cls.script_kind}, all above 0"
            )
        return numbers


class Lankford(Ratios):
    script_kind = "R-values (R0, R45, R90)"
    size = 3


class YieldRatios(Ratios):
    script_kind = "ratios of yield stresses (r11, r22, r33, r12, r13, r23)"
    size = 6


def of_lankford(R: tuple[float, ...]) -> tuple[float, ...]:
    """Return F, G, H, L, M, N of a sheet, relative to the yield stress of direction 1."""
    r0, r45, r90 = R
    shear = (r0 + r90) * (1 + 2 * r45) / (2 * r90 * (1 + r0))
    return r0 / (r90 * (1 + r0)), 1 / (1 + r0), r0 / (1 + r0), 1.5, 1.5, shear


def of_ratios(ratios: tuple[float, ...]) -> tuple[float, ...]:
    """Return F, G, H, L, M, N for yield ratios, which are all 1 for an isotropic body."""
    r11, r22, r33, r12, r13, r23 = ratios
    a, b, c = 1 / r11**2, 1 / r22**2, 1 / r33**2
    shears = 1.5 / r23**2, 1.5 / r13**2, 1.5 / r12**2
    return 0.5 * (b + c - a), 0.5 * (c + a - b), 0.5 * (a + b - c), *shears


def surface(constants: tuple[float, ...]) -> np.ndarray:
    """Return P (6, 6) of q^2 = T.P.T in Mandel's notation."""
    F, G, H, L, M, N = constants
    P = np.diag([G + H, F + H, F + G, L, M, N])
    P[0, 1] = P[1, 0] = -H
    P[0, 2] = P[2, 0] = -G
    P[1, 2] = P[2, 1] = -F
    return P


def turned(matrix: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return a matrix (6, 6), in Mandel's notation, rotated by R to the body's axes."""
    full = rotated(matrix / np.outer(FACTORS, FACTORS), R)
    return np.array([[full[a + b] for b in VOIGT] for a in VOIGT]) * np.outer(FACTORS, FACTORS)


def stiffness_of(law: Any) -> np.ndarray:
    """Return a law's stiffness (6, 6) in the body's axes, in Mandel's notation."""
    if isinstance(law, Directional):
        C = np.array([[law[STIFFNESS[a][b]] for b in range(6)] for a in range(6)])
        return C * np.outer(FACTORS, FACTORS)
    C = 2 * law.G * np.eye(6)
    C[:3, :3] += law.lam
    return C


def root(C: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(C)
    return (vectors * np.sqrt(values)) @ vectors.T


_MATRIX = tuple(product(range(6), range(6)))
_Fields = namedtuple(
    "_Fields",
    (
        "specific_volume",
        "strength",
        "fastest",
        *(f"rate{k + 1}" for k in range(6)),
        *(f"to{a + 1}{b + 1}" for a, b in _MATRIX),
        *(f"from{a + 1}{b + 1}" for a, b in _MATRIX),
    ),
)
RATES = 3  # index of the first of the fields with rates
TO, FROM = RATES + 6, RATES + 42


class YieldingByHill(OfDeformation, _Fields):
    """Constants of the law in coordinates z of elastic strain, in which flow is diagonal.

    With stiffness C and q^2 = T.P.T: z = V^T C^(1/2) e, where V holds the eigenvectors of C^(1/2) P
    C^(1/2), and the rates are its eigenvalues. The energy is z.z/2, and q^2 is the sum of rate
    z^2. Plastic flow with g = dep/q divides each z by 1 + g rate.
    """

    __slots__ = ()
    in_lanes = True
    traits = laws.LawTraits()


class Hill(NamedTuple):
    """Metal sheet or other solid with an anisotropic yield surface (Hill 1948).

    Parameters
    ----------
    elastic
        ID of a material linear, orthotropic or transverse, with the density.
    strength
        ID of a strength with a flow stress: plastic, swift, tabulated, johnson_cook, formula and
        others. This is the yield stress along axis 1, or the reference stress of `yields`. The
        shear modulus of the strength is not used.
    angle, tilt, spin
        Rotation of the axes of yielding from x, y, z in degrees: by `angle` about z, by `tilt`
        about the new axis 1, by `spin` about the new axis 3. Elastic axes are separate.
    R
        R-values (R0, R45, R90): strain across / strain through a sheet that is pulled at 0, 45 and
        90 degrees to axis 1, the rolling direction; axis 3 is through the sheet.
    yields
        Instead of R: yield stresses (r11, r22, r33) / reference stress and shear yield stresses
        (r12, r13, r23) / (reference stress / sqrt(3)). All ratios are 1 for an isotropic body.
    axes
        As for orthotropic; the axes also apply to the elastic material.

    Example
    -------
    material(elastic, linear, 7850, 210e9, 0.3)
    strength(steel, swift, 80e9, 180e6, 400e6, 0, 0.4)
    material(sheet, hill, elastic, steel, R=(1.8, 1.3, 2.1))
    material(rolled, hill, elastic, steel, 30, yields=(1, 1.05, 1.1, 0.95, 1, 1))

    Notes
    -----
    q^2 = F (T22 - T33)^2 + G (T33 - T11)^2 + H (T11 - T22)^2 + 2 L T23^2 + 2 M T13^2 + 2 N T12^2,
    with q at most the flow stress (Hill 1948, "A theory of the yielding and plastic flow of
    anisotropic metals", Proc. R. Soc. Lond. A 193). T is the Kirchhoff stress R^T tau R in axes
    that rotate by the polar part R of F, and T = C:e with the elastic strain e, which must be
    small. Strain is computed from the stretch U, with exact volume, so rotations of any size cause
    no stress. Flow is associated; ep is the plastic strain conjugate to q (dump column), and
    hardening is isotropic. With R, shear through the sheet is isotropic (L = M = 3/2).

    In 2D, one axis should be z (`tilt` 0 or 90 with `spin` 0).

    See Also
    --------
    orthotropic, transverse, strength plastic, plane_stress
    """

    elastic: ElasticBase
    strength: Strength
    angle: float = 0.0
    tilt: float = 0.0
    spin: float = 0.0
    R: ByName[Lankford | None] = None
    yields: ByName[YieldRatios | None] = None
    axes: ByName[Axes | None] = None

    syntax = "elastic, strength[, angle][, tilt][, spin], R=(R0, R45, R90)"

    def checked(self):
        elastic, strength, *angles, R, yields, axes = self
        if (R is None) == (yields is None):
            raise ScriptError(
                "the yield surface needs either R-values or yield stresses",
                argument="yields" if yields else None,
                expected="R=(R0, R45, R90) or yields=(r11, r22, r33, r12, r13, r23)",
            )
        hard = strength.laws["strength"]
        if not yield_stress(hard) > 0:
            raise ScriptError(
                f"strength '{strength.id}' has no yield stress",
                argument="strength",
                expected="a strength such as plastic, swift, tabulated or johnson_cook",
            )
        constants = of_lankford(R) if R else of_ratios(yields or ())
        F, G, H, *_ = constants
        if not F * G + G * H + H * F > 1e-9 or not F + G + H > 0:
            raise ScriptError(
                "with these yield stresses some shear would never yield",
                argument="yields",
                expected="2/(r11 r22)^2 + 2/(r22 r33)^2 + 2/(r33 r11)^2 above 1/r11^4 + 1/r22^4 + "
                "1/r33^4",
            )
        law = elastic.whole
        P = turned(surface(constants), rotation(*angles))
        return oriented(built(law, hard, P), axes)


def built(law: Any, strength: Any, P: np.ndarray) -> YieldingByHill:
    C = stiffness_of(law)
    half = root(C)
    rates, V = np.linalg.eigh(half @ P @ half)
    to, back = V.T @ half, np.linalg.solve(half, V)
    full = rotated(C / np.outer(FACTORS, FACTORS), np.eye(3))
    numbers = *np.maximum(rates, 0), *to.ravel(), *back.ravel()
    return YieldingByHill(law.specific_volume, strength, fastest(full), *map(float, numbers))


def matrices(law: Any) -> tuple[np.ndarray, np.ndarray]:
    to = np.reshape(law[TO:FROM], (6, 6))
    back = np.reshape(law[FROM:], (6, 6))
    return to.T @ to, back @ np.diag(law[RATES:TO]) @ back.T


def couples(law: Any, scene: Any) -> bool:
    inside, outside = OUT_OF_SCENE[scene.d]
    parts = [np.abs(m[np.ix_(inside, outside)]).max(initial=0) / m.max() for m in matrices(law)]
    return max(parts) > COUPLED


warn_of_axes(YieldingByHill, couples)


@laws.is_round.on(YieldingByHill)
def _is_round_hill(law):
    swap = [0, 2, 1, 3, 5, 4]
    return all(
        np.allclose(m[np.ix_(swap, swap)], m, atol=COUPLED * m.max())
        and np.allclose(m[:3, 3:], 0, atol=COUPLED * m.max())
        for m in matrices(law)
    )


class Hardened(NamedTuple):
    strength: Any


class State(NamedTuple):
    F: Any
    U: Any  # stretch
    e: Any  # elastic strain in axes that rotate by the polar part of F
    m: Hardened
    loss: Any  # dissipated energy per reference volume


@laws.initial_state.on(YieldingByHill)
def _initial_state_hill(law, kin, template):
    m = Hardened(initial_memory(law.strength, template))
    return State(unit(kin), nothing(kin) + I, nothing(kin), m, 0)


def flow(strength, before, increment, dt):
    if isinstance(strength, Plastic | LinearHardening):
        ep = before.memory.ep + increment
        return strength.yield_stress + strength.H * ep, strength.H
    return flow_stress(strength, before, increment, dt)


def yield_stress(strength: Any) -> float:
    has_flow_stress = flow_stress.defined(type(strength))
    if not has_flow_stress and not isinstance(strength, Plastic | LinearHardening):
        return 0.0
    return flow(strength, before_flow(strength, initial_memory(strength, 1.0), ()), 0.0, 1.0)[0]


def coordinates(law, e):
    a = e.at()
    return [
        total(
            [
                law[TO + 6 * row + k] * (a[place] if k < 3 else sqrt(2) * a[place])
                for k, place in enumerate(VOIGT)
                if place in a
            ]
        )
        for row in range(6)
    ]


def in_place(e, numbers):
    """Return a tensor such as `e` with `numbers(k)` in Mandel's notation."""
    indices = [INDEX[i][j] for i, j in e.places]
    return e._make([numbers(k) if k < 3 else sqrt(0.5) * numbers(k) for k in indices])


def strain_from(law, z, e):
    return in_place(e, lambda k: total([law[FROM + 6 * k + c] * z[c] for c in range(6)]))


def stress_of(law, e):
    z = coordinates(law, e)
    return in_place(e, lambda k: total([law[TO + 6 * r + k] * z[r] for r in range(6)]))


def as_tensor(kin, s):
    a = s.at()
    return kin.Tensor._make([a[place] for place in kin.Tensor.places])


laws.answers(YieldingByHill, {laws.elastic_strain: "e", laws.dissipated_energy: "loss"})


def stretching(kin, state, dl, U):
    """Return the strain increment U_m^-1 (C_new - C_old)/2 U_m^-1, U_m being the mean stretch.

    The trace is corrected to the logarithm of the volume ratio, so that volumes do not drift.
    """
    middle = state.F @ inv(as_tensor(kin, 0.5 * (state.U + U)))
    strain = sym(dl + 0.5 * (dl.transposed() @ dl)).carried(middle.transposed() - I)
    return strain + 1 / 3 * (log(det(I + dl)) - tr(strain)) * I


@laws.advance.on(YieldingByHill)
def _advance_hill(law, kin, state, dl, dt):
    F = state.F.after(dl)
    U = stretch(F)
    e = state.e + stretching(kin, state, dl, U)
    z = coordinates(law, e)
    rates = law[RATES:TO]
    squares = tuple([rate * x * x for rate, x in zip(rates, z, strict=True)])
    memory = state.m.strength
    x = plastic_strain_of(law, squares, memory, dt)
    limit, _ = flow(law.strength, before_flow(law.strength, memory, ()), x, dt)
    g = x / limit
    lost = [x * (g * rate / (1 + g * rate)) for rate, x in zip(rates, z, strict=True)]
    m = Hardened(updated_memory(law.strength, memory, x, dt))
    return State(F, U, e - strain_from(law, lost, e), m, state.loss + limit * x)


class Residual(NamedTuple):
    excess: Any  # q_trial - Y q_trial/q(x/Y)
    slope: Any  # derivative of the excess with respect to x
    by_limit: Any  # derivative of the excess with respect to Y
    by_squares: tuple  # derivatives of the excess with respect to rate z^2, where q = Y


def residual(law, squares, before, x, dt):
    """Return the residual at the increment x, linear in x for an isotropic body.

    For a constant or concave flow stress Y, the residual is convex and falls with x, so Newton's
    method from 0 never goes beyond the solution.
    """
    rates = law[RATES:TO]
    limit, hardening = flow(law.strength, before, x, dt)
    g = x / limit
    parts = [1 / (1 + g * rate) for rate in rates]
    trial = sqrt(total(list(squares)))
    left = [w * part * part for w, part in zip(squares, parts, strict=True)]
    squared = total(left)
    falls = total([w * part * r for w, part, r in zip(left, parts, rates, strict=True)])
    ratio = trial / sqrt(squared)
    rise = ratio * falls / squared  # derivative of the ratio with respect to g
    by_limit = g * rise - ratio
    by_squares = tuple([0.5 * trial * part * part / squared for part in parts])
    return Residual(trial - limit * ratio, hardening * by_limit - rise, by_limit, by_squares)


_MOST = 60


@shared
def plastic_strain_of(law, squares, memory, dt):
    """Return the increment of plastic strain at which q is the flow stress; 0 for smaller q.

    Solved by Newton's method, with bisection for flow stresses that are not concave.
    """
    before = before_flow(law.strength, memory, ())
    whole = total(list(squares))
    x = whole - whole
    active = whole > 0
    squares = tuple([where(active, w, 1) for w in squares])
    trial = sqrt(total(list(squares)))
    softest = law[RATES + 1]  # the first rate belongs to pressure
    low, high = x, trial / softest
    for _ in range(_MOST):
        excess, slope, *_ = residual(law, squares, before, x, dt)
        active = active & ((x > 0) | (excess > 0))
        low = where(excess > 0, x, low)
        high = where(excess > 0, high, x)
        new = x - excess / slope
        done = abs(excess) <= 8 * round_off(trial) * trial
        new = where((low <= new) & (new <= high), new, 0.5 * (low + high))
        x = where(active & (not done), new, x)
        active = active & (not (done | (high <= low)))
        if not any_lane(active):
            break
    return x


@implements(plastic_strain_of, Dual)
def _plastic_strain_slopes(law, squares, memory, dt):
    x = plastic_strain_of(law, value_of(squares), value_of(memory), dt)
    yields = x > 0
    at = tuple([where(yields, w, 1) for w in value_of(squares)])
    _, slope, by_limit, by_squares = residual(
        law, at, before_flow(law.strength, value_of(memory), ()), x, dt
    )
    limit, _ = flow(law.strength, before_flow(law.strength, memory, ()), x, dt)
    changes = [a * w for a, w in zip(by_squares, squares, strict=True)]
    return (total(changes) + by_limit * limit).chain(x, where(yields, -1 / slope, 0))


def rotation_of(kin, state):
    return state.F @ inv(as_tensor(kin, state.U))


@laws.kirchhoff_stress.on(YieldingByHill)
def _kirchhoff_stress_hill(law, kin, state):
    return stress_of(law, state.e).carried(rotation_of(kin, state) - I)


@laws.energy_density.on(YieldingByHill)
def _energy_density_hill(law, kin, state):
    return 0.5 * total([x * x for x in coordinates(law, state.e)])


@laws.plastic_strain.on(YieldingByHill)
def _plastic_strain_hill(law, kin, state):
    return state.m.strength.ep


@laws.wave_speed_squared.on(YieldingByHill)
def _wave_speed_squared_hill(law, kin, state):
    T = stress_of(law, state.e).largest_row_sum()  # the bound holds in any axes
    return (law.fastest + T) * law.specific_volume


@laws.with_stress.on(YieldingByHill)
def _with_stress_hill(law, kin, state, stress):
    back = rotation_of(kin, state).transposed()
    T = (det(state.F) * symmetric_tensor(kin, stress)).carried(back - I).at()

    def coordinate(column):
        parts = [
            law[FROM + 6 * k + column] * (T[place] if k < 3 else sqrt(2) * T[place])
            for k, place in enumerate(VOIGT)
            if place in T
        ]
        return total(parts)

    return state._replace(e=strain_from(law, [coordinate(k) for k in range(6)], state.e))
