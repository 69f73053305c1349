"""The exact solutions themselves: body forces derived again, tables found again."""

import re
from math import atan, pi, radians

import fem
import numpy as np
import pytest
from conftest import INPUTS

from comparisons import exact

# Sixth-order differences with steps of 4e-3 and 2e-3 on fields whose scale is 0.25 or more leave
# about 1e-8 (truncation) and 1e-16/4e-3^2 = 1e-11 (round-off), relative to the largest force.
TOLERANCE = 3e-7


def distance(one, other):
    return np.abs(one - other).max() / np.abs(other).max()


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("G", [0.01, 0.1])
def test_axis_aligned_body_force(d, G):
    solution = exact.AxisAligned(d=d, G=G, phases=(0, pi, 0.4))
    X = np.random.default_rng(1).uniform(0.05, 0.95, (40, d))
    for t in (0.03, 0.11):
        derived = exact.derived_body_force(
            solution.displacement, X, t, solution.E, solution.nu, solution.rho
        )
        assert distance(solution.body_force(X, t), derived) < TOLERANCE
        F = exact.gradient(solution.displacement, X, t)
        assert np.diagonal(F, axis1=-2, axis2=-1) == pytest.approx(solution.stretches(X, t))
        assert distance(2 * derived, derived) > 0.1  # the measure sees an error


def ring(n=60):
    rng = np.random.default_rng(2)
    R, angle = rng.uniform(0.78, 1.22, n), rng.uniform(0, 2 * pi, n)
    return np.stack([R * np.cos(angle), R * np.sin(angle)], axis=-1)


@pytest.mark.parametrize("t", [0.1, 0.37, 0.8])
def test_vortex_body_force_and_the_sign_of_two_codes(t):
    """b_t with minus in its last term, as derived; with plus, the error is as large as b."""
    solution = exact.Vortex()
    X = ring()
    derived = exact.derived_body_force(
        solution.displacement, X, t, solution.E, solution.nu, solution.rho
    )
    assert distance(solution.body_force(X, t), derived) < TOLERANCE
    assert distance(solution.body_force(X, t, last_sign=+1), derived) > 0.05
    assert np.linalg.det(exact.gradient(solution.displacement, X, t)) == pytest.approx(1)


def test_vortex_body_force_at_the_present_place():
    """Without sines and cosines of the angle, at x = X + u."""
    solution = exact.Vortex()
    X, t = ring(), 0.3
    x = X + solution.displacement(X, t)
    spatial = solution.spatial_body_force(x, t)
    assert spatial == pytest.approx(solution.body_force(X, t), rel=1e-12, abs=1e-12)


def test_vortex_is_at_rest_outside_the_ring():
    solution = exact.Vortex()
    X = np.array([[0.5, 0.1], [1.3, 0.2], [1.0, 1.0]])
    assert (solution.displacement(X, 0.5) == 0).all()
    assert (solution.body_force(X, 0.5) == 0).all()
    edge = np.array([[0.75 + 1e-9, 0.0], [0, 1.25 - 1e-9]])
    F = exact.gradient(solution.displacement, edge, 0.5)
    assert pytest.approx(np.broadcast_to(np.eye(2), F.shape), abs=1e-6) == F


@pytest.mark.parametrize(
    ("load", "v", "u"),
    [(1, 0.30172, 0.05643), (2, 0.49346, 0.16064), (3, 0.60325, 0.25442), (5, 0.71379, 0.38763)],
)
def test_elastica(load, v, u):
    """The table of Mattiasson (1981), five digits."""
    assert exact.elastica(load) == pytest.approx((v, u), abs=6e-6)


def test_elastica_bends_as_a_stiff_beam_under_a_small_load():
    assert exact.elastica(1e-3)[0] == pytest.approx(1e-3 / 3, rel=1e-5)  # P L^3 / (3 E I)


def test_incline():
    """At the limit of rolling both laws give the same; below it friction does not matter."""
    mu, g = 0.3, 10
    limit = exact.incline_limit(mu)
    assert limit == pytest.approx(atan(3 * mu))
    just_rolls = exact.incline_acceleration(limit * (1 - 1e-9), mu, g)
    just_slides = exact.incline_acceleration(limit * (1 + 1e-9), mu, g)
    assert just_rolls == pytest.approx(just_slides)
    assert exact.incline_acceleration(radians(30), 0.5, g) == pytest.approx(10 / 3)
    assert exact.incline_acceleration(radians(30), 0, g) == pytest.approx(5)


def test_load_of_a_pressed_cylinder():
    """The strain along the axis between contact and centre adds up to the approach.

    Stresses of a disk under two opposite loads, spread as by Hertz (Johnson 1985, section 5.6).
    """
    E, nu, approach = 1.0, 0.3, 0.02
    modulus = E / (1 - nu**2)
    P = exact.hertz_load(approach, 1.0, modulus)
    a = np.sqrt(4 * P / (np.pi * modulus))
    z = np.linspace(0, 1, 100001)
    root = np.sqrt(a**2 + z**2)
    along = P / np.pi * (1 - 2 / (2 - z) - 2 / root)
    across = P / np.pi * (1 - 2 * (a**2 + 2 * z**2) / (a**2 * root) + 4 * z / a**2)
    strain = (along - nu / (1 - nu) * across) / modulus
    # The formula leaves out (a / R)^2.
    assert -np.trapezoid(strain, z) == pytest.approx(approach, rel=a**2)


def test_two_disks_touch_when_published():
    """1.5858 s (Sinaie et al. 2017)."""
    time = exact.contact_time(0.6 * 2**0.5, 0.4, 0.2 * 2**0.5)
    assert time == pytest.approx(1.5858, abs=5e-5)


def test_bar_and_disk():
    """Mean velocity at the start is the mean of the sine; energy of a disk is L omega / 2."""
    x = (np.arange(100000) + 0.5) / 100000 * 25
    assert exact.bar_mean_velocity(0, 25, 100, 1, 0.1) == pytest.approx(
        (0.1 * np.sin(pi * x / 50)).mean(), rel=1e-9
    )
    assert exact.bar_mean_velocity(0, 25, 100, 1, 0.1) == pytest.approx(0.06366, abs=5e-6)
    assert 2 * pi / exact.bar_frequency(25, 100, 1) == pytest.approx(10)
    momentum = exact.disk_angular_momentum(3, 2, 5)
    assert exact.disk_energy(3, 2, 5) == pytest.approx(momentum * 5 / 2)
    assert exact.prandtl_load(1) == pytest.approx(5.14159, abs=1e-5)


@pytest.mark.parametrize(("beta", "N"), [(30, 41.22), (45, 16.16), (60, 10.39), (90, 5.50)])
def test_slopes_slip_on_spirals(beta, N):
    """Critical heights of Chen 1975 for a friction of 20 degrees; the line ends at toe and top."""
    found, line = exact.spiral_slip(np.radians(beta), np.radians(20))
    assert found == pytest.approx(N, rel=1e-3)
    assert np.allclose(line[-1], 0) and line[0, 1] == pytest.approx(1)


def test_published_curve_of_the_cantilever_is_that_of_the_lower_corner():
    """Own finite elements (32 x 8) against the digitised curve: 0.06 m of a swing of 3.3 m.

    The middle of the end sinks by 3.78 m, which the curve excludes. Digitising is good to 0.01 s,
    and the corner moves at up to 6 m/s.
    """
    time, tip = fem.cantilever()
    first = time < 1.5
    moment, depth = exact.minimum(time[first], tip[first])
    assert depth == pytest.approx(-3.29, abs=0.01)  # CPDI2q: -3.310, cpGIMP: -3.319
    assert moment == pytest.approx(1.05, abs=0.02)
    published_time, published = exact.cantilever_curve()
    difference = np.interp(published_time, time, tip) - published
    assert np.sqrt((difference**2).mean()) < 0.15


def test_published_vertical_bar_sinks_deeper_than_a_clamped_one():
    """Own finite elements, clamped at the top: a lower corner reaches -1.66 m, published -1.7146 m.

    The times agree. With a top face that may slide the corner reaches -1.76 m; the source does not
    say which it is, so 5 % are left.
    """
    moment, depth = exact.minimum(*fem.vertical_bar())
    assert moment == pytest.approx(0.0882, rel=0.02)
    assert depth == pytest.approx(-1.7146, rel=0.05)


def printed(run_script, scene, kind, place, time, *formulas):
    """Values of formulas of inputs/in.`scene` at a node: its assignments alone, with numbers."""
    numbers = {"x0": place[0], "y0": place[1], "z0": place[-1], "time": time, "dt": 0}
    text = (INPUTS / f"in.{scene}").read_text("utf-8")
    lines = [line for line in text.splitlines() if re.match(r"\w+\s*=", line)]
    for name, number in numbers.items():
        # In front of a power a negative number needs its parentheses.
        lines = [re.sub(rf"\b{name}\b", f"({number!r})", line) for line in lines]
    script = "\n".join([*lines, *(f"print({formula})" for formula in formulas)])
    out = run_script(script, "-var", "kind", kind, "-var", "G", "0.1").out
    return [
        float(line.rpartition("=")[2].split()[-1]) for line in out.splitlines()[-len(formulas) :]
    ]


@pytest.mark.parametrize(
    ("left", "right", "pressure", "speed", "densities"),
    [
        ((1.0, 1.0), (0.125, 0.1), 0.30313, 0.92745, (0.42632, 0.26557)),
        ((1.0, 1000.0), (1.0, 0.01), 460.894, 19.5975, (0.57506, 5.99924)),
    ],
)
def test_shock_tubes(left, right, pressure, speed, densities):
    """Toro 2009, table 4.3; density at the ends of the fan is continuous."""
    profiles = exact.riemann(left, right, 1.4)
    for side, density in zip((-1e-4, 1e-4), densities, strict=True):
        found = profiles(np.array([speed * (1 + side)]))
        assert np.ravel(found) == pytest.approx([density, speed, pressure], rel=1e-4)
    s = np.linspace(-1.01 * np.sqrt(1.4 * left[1]), 0.9 * speed, 4001)
    assert abs(np.diff(profiles(s)[0])).max() < 1e-3
    assert profiles(np.array([-1e3, 1e3]))[2].tolist() == [left[1], right[1]]


# At nodes that stay, two Newton steps from a start within (pi G)^2 of X leave about 1e-6.
AT_NODES = {"ulmpm": 1e-5, "tlmpm": 1e-12}


@pytest.mark.parametrize("kind", ["ulmpm", "tlmpm"])
@pytest.mark.parametrize(("scene", "d"), [("axis_aligned", 2), ("axis_aligned_3d", 3)])
def test_axis_aligned_scripts_have_the_exact_source(run_script, kind, scene, d):
    solution = exact.AxisAligned(d=d, G=0.1)
    X, t = np.array([[0.31, 0.77, 0.4][:d]]), 0.11
    place = X + solution.displacement(X, t) if kind == "ulmpm" else X
    found = printed(run_script, scene, kind, place[0].tolist(), t, *("bx", "by", "bz")[:d])
    assert found == pytest.approx(solution.body_force(X, t)[0], rel=AT_NODES[kind])


@pytest.mark.parametrize("kind", ["ulmpm", "tlmpm"])
def test_vortex_script_has_the_exact_source(run_script, kind):
    solution = exact.Vortex(G=0.1)
    X, t = np.array([[0.7, -0.6]]), 0.3
    place = X + solution.displacement(X, t) if kind == "ulmpm" else X
    source = ("br*ex - bt*ey", "br*ey + bt*ex")
    found = printed(run_script, "vortex", kind, place[0].tolist(), t, *source)
    assert found == pytest.approx(solution.body_force(X, t)[0], rel=AT_NODES[kind])
