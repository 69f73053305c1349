"""Numbers with slopes go through all laws as they are: their tangents are those of differences."""

import math
from itertools import cycle, product
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import config
from selection import parameters

from karamelo_py.compiler import kernel, on_numbers, shared
from karamelo_py.compiler.slopes import Dual, NoSlope, seeded, slopes_of
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space, large
from karamelo_py.points.laws import advance, initial_state, kirchhoff_stress
from karamelo_py.points.laws.cam_clay import CamClayConstants
from karamelo_py.points.laws.eos import LinearPressure
from karamelo_py.points.laws.eos_strength import EosStrength
from karamelo_py.points.laws.hencky import Hencky
from karamelo_py.points.laws.linear import LinearElastic
from karamelo_py.points.laws.logarithmic import Logarithmic
from karamelo_py.points.laws.neo_hookean import NeoHookean
from karamelo_py.points.laws.parameters import lame_parameters
from karamelo_py.points.laws.strengths.drucker_prager import DruckerPrager
from karamelo_py.points.laws.strengths.hardening import LinearHardening, Plastic
from karamelo_py.points.laws.strengths.metals import JohnsonCookConstants
from karamelo_py.points.laws.strengths.mohr_coulomb import MohrCoulomb


class Far(NamedTuple):
    """A law in load steps, whose increments may be large."""

    law: Any


E, NU = 1e6, 0.3
MODULI = lame_parameters(E, NU)
K, G = E / 3 / (1 - 2 * NU), E / 2 / (1 + NU)
EOS = LinearPressure.given(1000.0, K)
COOK = JohnsonCookConstants(G, 2e4, 3e4, 0.3, 1.0, 0.02, 0.0, 0.0, 1.0).checked()
LAWS = {
    "linear": (LinearElastic(1e-3, *MODULI), 0.05),
    "neo-hookean": (NeoHookean(1e-3, *MODULI), 0.05),
    "plastic": (EosStrength(EOS, Plastic(G, 2e4)), 0.03),
    "hardening": (EosStrength(EOS, LinearHardening(G, 2e4, 1e5)), 0.03),
    "johnson_cook": (
        EosStrength(
            EOS, JohnsonCookConstants(G, 2e4, 3e4, 0.3, 1.0, 0.02, 0.0, 0.0, 1.0).checked()
        ),
        0.03,
    ),
    "drucker_prager": (EosStrength(EOS, DruckerPrager.given(G, 1e4, 30.0, 10.0)), 0.02),
    "mohr_coulomb": (EosStrength(EOS, MohrCoulomb.given(G, 1e4, 30.0, 10.0)), 0.02),
    "hencky": (Hencky(1e-3, *MODULI), 0.05),
    "cam-clay": (CamClayConstants(1000.0, G, 1.0, 0.1, 0.02, 1e4).checked(), 0.01),
    "logarithmic": (EosStrength(EOS, LinearHardening(G, 2e4, 1e5), strain=Logarithmic()), 0.03),
}
LAWS |= {f"{name}, far": (Far(LAWS[name][0]), LAWS[name][1]) for name in ("linear", "hardening")}
KINEMATICS = {"line": Line(), "plane": PlaneStrain(), "axis": Axisymmetric(), "space": Space()}


@shared
def stress(law, kin, state, dl, dt):
    """Kirchhoff stress after an increment."""
    if isinstance(law, Far):
        return kirchhoff_stress(law.law, kin, advance(law.law, kin, state, large(dl), dt))
    return kirchhoff_stress(law, kin, advance(law, kin, state, dl, dt))


@shared
def tangent(law, kin, state, dl, dt):
    """Kirchhoff stress, and its derivatives by the increment."""
    made = stress(law, kin, state, seeded(dl), dt)
    values = tuple([x.value for x in made])
    return values, tuple([tuple([0.0 + s for s in slopes_of(x, len(dl))]) for x in made])


def differences(law, kin, state, dl, dt, e):
    """Derivatives by central differences of fourth order."""
    columns = []
    for k in range(len(dl)):

        def at(s, k=k):
            moved = dl._make([x + s * e * (i == k) for i, x in enumerate(dl)])
            return np.array(stress(law, kin, state, moved, dt))

        columns.append((8 * (at(1) - at(-1)) - (at(2) - at(-2))) / (12 * e))
    return np.array(columns).T


def error(found, law, kin, state, dl, size):
    """The largest error over Young's modulus; of kinks, where differences are smallest."""
    steps = (size * s for s in (1e-4, 1e-6, 1e-7))
    errors = [
        abs(np.array(found) - differences(law, kin, state, dl, 1e-2, e)).max() / E for e in steps
    ]
    return errors[0] if errors[0] < 1e-6 else min(errors)


def cases(name, kin, count, seed=1):
    """States that were loaded before, and increments: any, diagonal, with two alike."""
    law, size = LAWS[name]
    law = getattr(law, "law", law)
    rng = np.random.default_rng(seed)
    n = len(kin.tensor_names)
    diagonal = np.array([i == j for i, j in kin.Tensor.places])
    for trial in range(count):
        scale = size * 10 ** rng.uniform(-2, 0.7)
        state = initial_state(law, kin, 1.0)
        kind = trial % 3
        if kind == 0:
            for _ in range(rng.integers(0, 4)):
                dl = kin.Tensor._make([float(x) for x in rng.normal(0, scale, n)])
                state = advance(law, kin, state, dl, 1e-2)
        numbers = rng.normal(0, scale, n)
        if kind > 0:
            numbers *= diagonal
        if kind == 2 and diagonal.sum() > 1:
            alike = np.flatnonzero(diagonal)[:2]
            numbers[alike] = numbers[alike[0]]
        yield state, kin.Tensor._make([float(x) for x in numbers])


@pytest.mark.parametrize("kin", KINEMATICS.values(), ids=KINEMATICS)
@pytest.mark.parametrize("name", LAWS)
def test_tangents_are_those_of_differences(name, kin):
    law, size = LAWS[name]
    errors = []
    for state, dl in cases(name, kin, 9):
        values, slopes = on_numbers(tangent)(law, kin, state, dl, 1e-2)
        assert values == tuple(stress(law, kin, state, dl, 1e-2))
        errors.append(error(slopes, law, kin, state, dl, size))
    # Differences err by 1e-8; one of these cases may have a kink of the surface within their reach.
    assert sorted(errors)[-2] < 1e-6, errors


def in_floats(thing):
    """The same tuples, with floats in the place of whole numbers."""
    if not isinstance(thing, tuple):
        return float(thing)
    items = tuple(map(in_floats, thing))
    return thing._make(items) if hasattr(thing, "_make") else items


# Each law in one of them by turns; interpreted, above, in all.
COMPILED = list(
    zip(LAWS, cycle(("plane", "line", "axis", "plane", "line", "axis", "plane", "space")))
)
OTHERS = [way for way in product(LAWS, KINEMATICS) if way not in COMPILED]


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("name, kind", parameters(COMPILED, OTHERS))
def test_kernels_know_them(name, kind):
    (law, _), kin = LAWS[name], KINEMATICS[kind]

    @kernel
    def compiled(law, kin, state, dl, dt):
        return tangent(law, kin, state, dl, dt)

    for state, dl in cases(name, kin, 9):
        state = in_floats(state)
        values, slopes = compiled(law, kin, state, dl, 1e-2)
        expected, tangents = on_numbers(tangent)(law, kin, state, dl, 1e-2)
        assert np.allclose(values, expected, rtol=1e-12, atol=1e-12 * E)
        assert np.allclose(slopes, tangents, rtol=1e-9, atol=1e-9 * E)


OF_ONE = "log log1p exp expm1 exp2 log2 log10 sin cos tan sinh cosh tanh asin acos atan asinh atanh"
OF_ONE += " sqrt cbrt fabs erf erfc degrees radians"


@shared
def of_two(x, y):
    """Functions of two numbers, and powers of numbers below 0."""
    a, b = -x, -y
    powers = a**0, a**-1, a**5, a**-2, a**2.0, a**3.0, b**-3.0, x**y, math.pow(a, 3.0), 2.0**x
    distances = math.atan2(a, y), math.atan2(x, b), math.hypot(a, y), math.copysign(x, b)
    return (*powers, *distances, math.fmod(y, x), math.floor(y) * x)


def test_functions_of_laws_know_slopes():
    """What laws may call in explicit steps, against central differences (error 1e-10)."""

    def difference(f, x, h=1e-5):
        return (f(x + h) - f(x - h)) / (2 * h)

    for name in OF_ONE.split():
        function = getattr(math, name)
        made = on_numbers(function)(Dual(0.4, (1,)))
        assert made.value == function(0.4), name
        assert made.slopes[0] == pytest.approx(difference(function, 0.4), rel=1e-8), name
    x, y = 0.7, 1.9
    made = on_numbers(of_two)(*seeded((x, y)))
    for k, (number, value) in enumerate(zip(made, of_two(x, y), strict=True)):
        assert number.value == value, k
        exact = (
            difference(lambda x, k=k: of_two(x, y)[k], x),
            difference(lambda y, k=k: of_two(x, y)[k], y),
        )
        assert number.slopes == pytest.approx(exact, rel=1e-8, abs=1e-9), k
    zero = Dual(0.0, (1,))
    assert [(zero**n).slopes[0] for n in (0, 0.5, 1.0, 2.0, 5)] == [0, 0, 1, 0, 0]
    with pytest.raises(NoSlope, match=r"math\.gamma"):
        on_numbers(math.gamma)(Dual(0.4, (1,)))


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_kernels_know_slopes_of_functions():
    @kernel
    def compiled(x, y):
        made = of_two(*seeded((x, y)))
        return tuple([tuple([0.0 + s for s in slopes_of(one, 2)]) for one in made])

    expected = [number.slopes for number in on_numbers(of_two)(*seeded((0.7, 1.9)))]
    assert np.allclose(compiled(0.7, 1.9), expected, rtol=1e-13, atol=1e-14)
