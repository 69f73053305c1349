"""Motions with exact solutions: free flight, uniform strain, turning.

Every pair of dimension, transfer, scheme and law; with ``-m full`` every combination.

Tiny scenes, interpreted: what is compiled is the same source (test_identical.py).
"""

from itertools import product

import numpy as np
import pytest
from scenes import LAWS, SCHEMES, TRANSFERS, block
from selection import covering, few, parameters

from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.schemes.usl import USL

VELOCITY = (0.7, -0.4, 0.3)
WAY = {1: 0.34, 2: 0.19, 3: 0.19}  # time of a flight
SMALL = (0.2, 0.1, 0.1)
every_dimension = pytest.mark.parametrize("d", [1, 2, 3])
every_law = pytest.mark.parametrize("law", [law for law in LAWS if law != "soft"])


def flight(d, transfer, scheme, law):
    """Result of free flight through 2.4 cells in 34 steps or, with usl's shorter ones, more.

    In the plane and in space through 1.3, by which all points come over an edge of cells.
    """
    one_point = d == 3
    courant = {"usl": USL.traits.courant[one_point]}.get(scheme, 1)
    formulas = ", ".join(f"{v}*time" for v in VELOCITY[:d])
    return block(
        d,
        f"fix(v, initial_velocity_particles, all, {', '.join(map(str, VELOCITY[:d]))})",
        f"fix(error, check_solution, all, {formulas})",
        "compute(Es, strain_energy, all)",
        "compute(v, average_velocity, all)",
        "log_modify(custom, step, time, error_s, Es, v_x)",
        "set_output(100)",
        f"set_dt({0.01 * courant})",
        f"run_time({WAY[d]})",
        transfer=transfer,
        scheme=scheme,
        law=law,
        ppc=1 if one_point else 2,
        # Of two points in space alone rounding grows with MLS and TPIC.
        size=(0.3, 0.2, 0.1) if one_point else SMALL,
    )


FLIGHTS = parameters(*covering(product([1, 2, 3], TRANSFERS, SCHEMES, ["soft", "linear"])))


@pytest.mark.parametrize("d, transfer, scheme, law", FLIGHTS)
def test_free_flight_is_exact(run_interpreted, d, transfer, scheme, law):
    """x = x0 + v t through several cells, without stress: weights add to 1, gradients to 0.

    Round-off of some tens of steps: 1e-16 each in place and velocity; 1e-14 of E in stress, whose
    energy is its square. With the soft law the step is a tenth of the stable one, else 0.82 of it.
    There the acceleration f/m of a node that a point has barely reached (weight N) feeds back on
    the point's stress by (c dt/h)^2 / N a step where its velocity is not averaged away: rounding
    would grow at every new cell (benchmark C6). USL limits the velocity of light nodes in the
    gradient, MUSL maps a second time; affine transfers with linear functions stay unstable with the
    other schemes, and are refused (test_combinations.py).
    """
    log = run_interpreted(flight(d, transfer, scheme, law)).log
    assert log.Time[-1] == pytest.approx(WAY[d], rel=1e-12)
    assert log.error_s[-1] < 1e-14
    assert log.v_x[-1] == pytest.approx(0.7, rel=1e-10)  # ten digits are logged
    if law == "soft":
        assert log.Es[-1] < 1e-24


# A velocity gradient A for each dimension; A X at the nodes is exact everywhere.
GRADIENTS = {
    1: [[0.2]],
    2: [[0.2, -0.1], [0.3, 0.15]],
    3: [[0.2, -0.1, 0.1], [0.3, 0.15, 0.05], [-0.2, 0.1, -0.25]],
}


def linear_field(a) -> str:
    """Components of A X as formulas of the node's place."""
    terms = [[f"({value})*{axis}0" for value, axis in zip(row, "xyz", strict=False)] for row in a]
    return ", ".join(" + ".join(row) for row in terms)


def strained(d, law, *, scheme="musl", transfer="FLIP", steps=10, dt=0.01, **options):
    """A block whose nodes all move with v = A X."""
    columns = "x, y, z, vx, vy, vz, s11, s22, s33, s12, s13, s23, volume"
    return block(
        d,
        "group(nodes, nodes, region, everywhere, all)",
        f"fix(v, velocity_nodes, nodes, {linear_field(GRADIENTS[d])})",
        f"dump(end, all, particle, 1000, end.*.LAMMPS, {columns})",
        "set_output(1000)",
        f"set_dt({dt})",
        f"run({steps})",
        law=law,
        scheme=scheme,
        transfer=transfer,
        size=SMALL,
        **options,
    ).replace("material(", f"region(everywhere, block, {', '.join(['INF, INF'] * d)})\nmaterial(")


def stress_of(law, f_steps):
    """(3, 3) Cauchy stress after the increments dl, by the laws' definitions, in NumPy."""
    e, nu = 100.0, 0.3
    lam, g = e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))
    f, stress = np.eye(3), np.zeros((3, 3))
    for dl in f_steps:
        f = (np.eye(3) + dl) @ f
        strain = (dl + dl.T) / 2
        if law == "linear":
            w = (dl - dl.T) / 2
            # exp(w) to its fifth power: angles of 0.003 leave 1e-17
            turn = sum((np.linalg.matrix_power(w, n) / m for n, m in
                        [(1, 1), (2, 2), (3, 6), (4, 24), (5, 120)]), np.eye(3))  # fmt: skip
            stress = turn @ stress @ turn.T
        stress = stress + 2 * g * strain + lam * np.trace(strain) * np.eye(3)
    if law == "neo-hookean":
        inverse, j = np.linalg.inv(f).T, np.linalg.det(f)
        stress = (g * (f - inverse) + lam * np.log(j) * inverse) @ f.T / j
    return f, stress


@every_dimension
@every_law
@pytest.mark.parametrize("scheme", ["musl", "usl", "usf"])  # usavg strains in two halves
def test_uniform_strain_is_exact(run_interpreted, d, law, scheme):
    """Where v = A X at all nodes, F = (I + dt A)^n at all points, and stress follows from it.

    A field that stays at the nodes is not that of points that go on as they are: with usf the
    product differs, of first order in dt, and is (I - dt A)^-n.

    Dumps carry nine digits, so numbers agree to 1e-8 of their size; stresses are of the size of
    E e = 10.
    """
    steps, dt = 10, 0.01
    options = {"ppc": 1} if d == 3 else {}
    result = run_interpreted(strained(d, law, scheme=scheme, steps=steps, dt=dt, **options))
    first, last = result.dump("end.0.LAMMPS"), result.dump("end.10.LAMMPS")
    a = np.zeros((3, 3))
    a[:d, :d] = GRADIENTS[d]
    f, _ = stress_of(law, [dt * a] * steps)
    shown, stress = f, stress_of(law, [dt * a] * steps)[1]
    if scheme == "usf":
        # Strained up to the places that the last step began with, by the same nodal velocities at
        # the places where points have come to: I + dt A is (I - dt A)^-1 there.
        behind = np.linalg.inv(np.eye(3) - dt * a) - np.eye(3)
        shown, stress = stress_of(law, [behind] * (steps - 1))
    x0 = np.array([first.x, first.y, first.z])
    x = np.array([last.x, last.y, last.z])
    assert x == pytest.approx(f @ x0, abs=2e-9)
    assert last.volume == pytest.approx(np.linalg.det(shown) * first.volume, rel=1e-8)
    for name, (i, j) in {"s11": (0, 0), "s22": (1, 1), "s33": (2, 2),
                         "s12": (0, 1), "s13": (0, 2), "s23": (1, 2)}.items():  # fmt: skip
        assert last[name] == pytest.approx(np.full(len(last.id), stress[i, j]), abs=1e-7)


SPIRAL = 0.8, 0.9, -0.5  # stretching and turning in the plane, and stretching along z


def spiral(d, time) -> str:
    """Velocities at places of points that keep theirs: x = (I + t A) X, v = A (I + t A)^-1 x.

    In the plane as complex numbers, z/(1 + t z).
    """
    a, b, c = SPIRAL
    if d == 1:
        return f"{a}/(1 + {time}*{a})*x0"
    size = f"((1 + {time}*{a})^2 + ({time}*{b})^2)"
    real, other = f"({a} + {time}*{a**2 + b**2})/{size}", f"{b}/{size}"
    plane = f"{real}*x0 - {other}*y0, {other}*x0 + {real}*y0"
    return plane + (f", {c}/(1 + {time}*({c}))*z0" if d == 3 else "")


@every_dimension
@pytest.mark.parametrize("averaged", [False, True])
def test_usf_strains_to_where_points_have_come(run_interpreted, d, averaged):
    """By the velocities of points that keep them, at the places after each step: F = I + t A.

    Before the forces the formulas of nodes are taken a step earlier, so they are given for one
    later. With I + dt grad v in the place of (I - dt grad v)^-1, volumes were off by 3 to 5 %.
    """
    steps, dt = 8, 0.05
    script = block(
        d,
        f"region(everywhere, block, {', '.join(['INF, INF'] * d)})",
        "group(nodes, nodes, region, everywhere, all)",
        f"fix(v, velocity_nodes, nodes, {spiral(d, f'(time + {dt})')})",
        "dump(end, all, particle, 1000, end.*.LAMMPS, x, volume, s11, s12)",
        "set_output(1000)",
        f"set_dt({dt})",
        f"run({steps})",
        scheme="usf",
        law="neo-hookean",
        ppc=1 if d == 3 else 2,
        size=SMALL,
    )
    if averaged:
        script = "anti_volumetric_locking(true)\n" + script
    result = run_interpreted(script)
    first, last = result.dump("end.0.LAMMPS"), result.dump(f"end.{steps}.LAMMPS")
    a, b, c = SPIRAL
    rates = np.array([[a, -b, 0], [b, a, 0], [0, 0, c * (d == 3)]]) if d > 1 else np.diag([a, 0, 0])
    f, stress = stress_of("neo-hookean", [dt * (steps - 1) * rates])
    assert last.volume == pytest.approx(np.linalg.det(f) * first.volume, rel=1e-8)
    assert last.s11 == pytest.approx(np.full(len(last.id), stress[0, 0]), abs=1e-6)
    assert last.s12 == pytest.approx(np.full(len(last.id), stress[0, 1]), abs=1e-6)


# The others differ from one of these by their basis alone, or by a share of FLIP.
@pytest.mark.parametrize("transfer", few(TRANSFERS, "PIC", "FLIP", "APIC", "MLS", "TPIC", "XPIC"))
def test_uniform_strain_with_every_transfer(run_interpreted, transfer):
    """Velocities differ between transfers, the strain of prescribed nodes does not."""
    last = run_interpreted(strained(2, "neo-hookean", transfer=transfer)).dump("end.10.LAMMPS")
    a = np.zeros((3, 3))
    a[:2, :2] = GRADIENTS[2]
    _, stress = stress_of("neo-hookean", [0.01 * a] * 10)
    assert last.s11 == pytest.approx(np.full(len(last.id), stress[0, 0]), abs=1e-7)
    assert last.s12 == pytest.approx(np.full(len(last.id), stress[0, 1]), abs=1e-7)


TURNS = [(2, (0, 0, 1), scheme) for scheme in SCHEMES]
TURNS_3D = [(3, (1, 2, 2), scheme) for scheme in SCHEMES]


def turning(scheme, step, steps) -> tuple[float, float, complex]:
    """Strain across the axis and angle after `steps`, and dt times the gradient of velocity.

    Across the axis as complex numbers: dl, and dl/(1 - dl) where it is of the places after a step.
    """
    if scheme == "usf":
        return 0.0, (steps - 1) * step, 1j * step / (1 + 1j * step)
    if scheme == "usavg":  # both halves together do not strain
        half = 0.5j * step
        for _ in range(20):
            half -= (half + half / (1 - half)).real / 2
        before = half / (1 - half)
        return half.real, (steps - 1) * before.imag + steps * half.imag, 2 * half
    return 0.0, steps * step, 1j * step


@pytest.mark.parametrize("d, axis, scheme", parameters([*TURNS, TURNS_3D[0]], TURNS_3D[1:]))
def test_a_stressed_body_keeps_its_stress_when_it_turns(run_interpreted, d, axis, scheme):
    """Turned by 90 degrees about an axis, in its own frame, to 1e-6.

    All nodes move with w x (X - c). Each of the 50 steps turns the stress by 0.03 with an error
    of 0.03^5/120; a point spirals outwards by half the square of that angle, 2.5 % in all. What
    strains before the forces takes velocities for those at the places after a step: nodes have the
    field then whose increments dl do not strain, sym(dl) = 0, in all of a step.
    """
    steps = 50
    unit = np.array(axis) / np.linalg.norm(axis)
    wx, wy, wz = unit
    w = np.array([[0, -wz, wy], [wz, 0, -wx], [-wy, wx, 0]])
    strain, angle, field = turning(scheme, np.pi / 2 / steps, steps)
    w_field = (field.imag * w - field.real * w @ w) * 2 * steps / np.pi
    formulas = ", ".join(
        " + ".join(f"({value!r})*({name}0 - 0.35)" for value, name in zip(row, "xyz", strict=False))
        for row in w_field[:d, :d].tolist()
    )
    stress = np.array([[3.0, 0.5, 0.0], [0.5, -1.0, 0.0], [0.0, 0.0, 2.0]])
    if d == 3:
        stress[0, 2] = stress[2, 0] = 0.7
        stress[1, 2] = stress[2, 1] = -0.4
    given = [stress[i, j] for i, j in [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]]
    script = block(
        d,
        f"fix(turn, velocity_nodes, all, {formulas})",
        f"fix(stress, initial_stress, all, {', '.join(map(str, given))})",
        "dump(end, all, particle, 1000, end.*.LAMMPS, x, s11, s22, s33, s12, s13, s23)",
        "set_output(1000)",
        f"set_dt(PI/2/{steps})",
        f"run({steps})",
        scheme=scheme,
        size=(0.1,) * d,
        ppc=2 if d == 2 else 1,
    )
    result = run_interpreted(script)
    last = result.dump(f"end.{steps}.LAMMPS")
    turn = np.eye(3) + np.sin(angle) * w + (1 - np.cos(angle)) * w @ w  # Rodrigues
    lam, g = 100 * 0.3 / (1.3 * 0.4), 100 / 2.6
    expected = turn @ stress @ turn.T + strain * (2 * lam * np.eye(3) - 2 * g * w @ w)
    for name, (i, j) in {"s11": (0, 0), "s22": (1, 1), "s33": (2, 2),
                         "s12": (0, 1), "s13": (0, 2), "s23": (1, 2)}.items():  # fmt: skip
        assert last[name] == pytest.approx(np.full(len(last.id), expected[i, j]), abs=1e-6)


@pytest.mark.parametrize(
    ("half", "w", "turns", "reach"),
    [
        ((3, 1, 1), (0.2, 0, 0), 0.2, 1),
        ((3, 1, 1), (0, 0.2, 0), 0.2, 3),
        # Across (1, 2, 0): z, and (2, -1, 0), along which it reaches sqrt((4*3^2 + 1)/5).
        ((3, 1, 2), (0.1, 0.2, 0), 0.05**0.5, 7.4**0.5),
        ((3, 0, 0), (0, 0, 0.2), 0.2, 3),  # points in a row
        ((3, 0, 0), (0.2, 0, 0), 0, 0),
        ((3, 1), (0.2,), 0.2, 3),
    ],
)
def test_spin_of_a_body(half, w, turns, reach):
    """An ellipsoid that turns as if rigid: v = w x X, sum m X X = m half^2/5 in its axes."""
    d, half = len(half), np.array(half, float)
    w = np.array([*w, 0, 0, 0][:3]) if d == 3 else np.array([0, 0, *w])
    spread = np.diag(half**2 / 5)
    gradient = np.cross(np.eye(3), w)[:d, :d]  # v_b = gradient_ba X_a
    still = np.zeros(d)
    one = BodyMotion(0, 1.0, still, still, spread, spread @ gradient.T, -half, half, still, still)
    assert one.spin == pytest.approx(turns)
    assert one.reach == pytest.approx(reach)
