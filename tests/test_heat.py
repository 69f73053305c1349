"""Heat that flows between points, against solutions of the heat equation."""

import os
import subprocess
import sys
from math import erfc, exp, log, sqrt
from textwrap import dedent

import numpy as np
import pytest
from states import same_bits

from comparisons.results import read_dump
from karamelo_py.points.bodies import face
from karamelo_py.points.frames import Total, pulled_back
from karamelo_py.points.kinematics import Axisymmetric, Line, PlaneStrain, Space, tensor, vector

# Heat capacity per volume and conductivity are one: the diffusivity is.
SLAB = """
    N = 10
    h = 1/N
    kind = "ulmpm"
    method(kind, FLIP, linear, 1, thermo-mechanical)
    dimension(1, 0, 1, h)
    region(slab, block, 0, 1)
    material(m, linear, 2, 1, 0, 0.5, 1)
    solid(slab, region, slab, 2, m, h, 300)
    compute(T, average_temperature, all)
    region(end, block, 0, h/2)
    set_output(1)
    {lines}
    log_modify(custom, step, dt, time, T{columns})
    dump(d, all, particle, 100000, d.*.txt, x, T, gamma)
    dump(g, all, grid, 100000, g.*.txt, x, T)
    {run}
"""
HOT = "group(end, nodes, region, end, all)\n    fix(hot, temperature_nodes, end, {})"
FIRST = "group(first, particles, region, end, all)\n    "


def slab(lines: str = "", columns: str = "", run: str = "run_time(0.02)") -> str:
    return SLAB.format(lines=lines, columns=columns, run=run)


def last(result, name="d"):
    files = sorted(result.folder.glob(f"{name}.*.txt"), key=lambda f: int(f.name.split(".")[1]))
    return read_dump(files[-1])[-1]


@pytest.mark.parametrize("kind", ["ulmpm", pytest.param("tlmpm", marks=pytest.mark.full)])
def test_slab(run_interpreted, kind):
    """Half space whose face is heated at once (Carslaw & Jaeger 1959, 2.4): second order."""
    errors = []
    for N in (10, 20):
        text = slab(HOT.format(301), ", hot_s")
        words = ("-var", "N", str(N), "-var", "kind", kind)
        result = run_interpreted(text, *words, folder=f"run{N}")
        points = last(result)
        exact = [300 + erfc(x / (2 * sqrt(0.02))) for x in points.x]
        errors.append(sqrt(np.mean((points["T"] - exact) ** 2)))
        # The heat through the face: conductivity times its gradient there.
        assert result.log.hot_s[-1] == pytest.approx(1 / sqrt(np.pi * 0.02), rel=0.01)
        # What the nodes show is the same curve.
        nodes = last(result, "g")
        assert nodes["T"][0] == 301
        assert nodes["T"][1] == pytest.approx(300 + erfc(1 / N / (2 * sqrt(0.02))), abs=0.5 / N)
    assert errors[0] < 0.008
    assert errors[1] < errors[0] / 3


def test_ramp(run_interpreted):
    """A temperature that rises from the start (Carslaw & Jaeger 1959, 2.5)."""
    result = run_interpreted(slab(HOT.format("300 + 10*time")))
    points = last(result)
    t = 0.02

    def exact(x):
        # i^2 erfc, Carslaw & Jaeger 1959, 2.5 (4) with n = 2.
        z = x / (2 * sqrt(t))
        part = (1 + 2 * z**2) * erfc(z) - 2 / sqrt(np.pi) * z * exp(-(z**2))
        return 300 + 10 * t * part

    # Values of fixes are of the beginning of a step: up to 10 dt = 0.02 behind at the face.
    assert points["T"] == pytest.approx([exact(x) for x in points.x], abs=0.02)


def test_step_of_conduction(run_interpreted):
    """h^2 / (4 d) times capacity over conductivity, where waves allow more."""
    result = run_interpreted(slab("dt_factor(1)", run="run(1)"))
    assert result.log.dt[0] == pytest.approx(1 / 10**2 / 4)
    warned = run_interpreted(slab("set_dt(0.01)", run="run(1)"))
    assert "above the stability limit" in warned.err + warned.out


def test_heat_flux(run_interpreted):
    """What flows in is in the body: T0 + q t / (rho cp L), to the last digits."""
    lines = FIRST + "fix(lamp, heat_flux_particles, first, 7)"
    result = run_interpreted(slab(lines, ", lamp_s"))
    assert result.log["T"][-1] == pytest.approx(300 + 7 * 0.02, rel=1e-12)
    assert result.log.lamp_s[-1] == pytest.approx(7)
    points = last(result)
    assert points["gamma"][0] == 7 and not points["gamma"][1:].any()
    # Carslaw & Jaeger 1959, 2.9: 2 q sqrt(t/pi) at the face of a half space.
    z = points.x[0] / (2 * sqrt(0.02))
    rise = 2 * 7 * sqrt(0.02) * (exp(-(z**2)) / sqrt(np.pi) - z * erfc(z))
    # The heat enters at points, a quarter of a cell behind the face, which is a tenth of the rise.
    assert points["T"][0] == pytest.approx(300 + rise, abs=0.15 * rise)


def test_convection(run_interpreted):
    """A fluid cools a body that conducts well: exp(-h t / (rho cp L)) (Biot number 0.01)."""
    lines = FIRST + "fix(air, convection_particles, first, 0.01, 200)"
    result = run_interpreted(slab(lines, ", air_s", "run_time(2)"), "-var", "N", "4")
    assert result.log["T"][-1] == pytest.approx(200 + 100 * exp(-0.02), abs=0.01)
    assert result.log.air_s[-1] == pytest.approx(-0.01 * 100 * exp(-0.02), rel=0.01)


def test_strong_convection(run_interpreted):
    """However large the coefficient, a body is not cooled below the fluid."""
    lines = FIRST + "fix(air, convection_particles, first, 1e9, 200)"
    result = run_interpreted(slab(lines, run="run(20)"))
    T = last(result)["T"]
    assert (T[1:] > 200 - 1e-6).all() and (T <= 300 + 1e-9).all() and T[0] < 215
    said = run_interpreted(slab(lines.replace("1e9", "-1")), status=1, folder="wrong").err
    assert "of at least 0" in said


def test_temperatures_that_nobody_gives_or_takes(run_interpreted):
    """A solid without T0 starts at 0; a material without temperature has none: both are told."""
    said = run_interpreted(slab(run="run(0)").replace("m, h, 300)", "m, h)")).err
    assert "starts at the temperature 0" in said
    cold = "material(n, linear, 1, 1, 0)\n    solid(cold, region, slab, 2, n, h, 300)"
    said = run_interpreted(slab(cold, run="run(0)"), folder="cold").err
    assert "T0 = 300 has no effect" in said


def test_temperature_of_points(run_interpreted):
    """Points have what they are told, and heat the others."""
    lines = FIRST + "fix(hot, temperature_particles, first, 301)"
    result = run_interpreted(slab(lines))
    points = last(result)
    assert points["T"][0] == 301
    centre = points.x[0]
    exact = [300 + erfc((x - centre) / (2 * sqrt(0.02))) for x in points.x[1:]]
    # First order: what is held is a point, and not the face of a half space. No points swing.
    assert points["T"][1:] == pytest.approx(exact, abs=0.12)
    assert (np.diff(points["T"]) < 0).all()


@pytest.mark.parametrize("scheme", ["musl", "usl", "usf", "usavg"])
def test_two_bodies(run_interpreted, scheme):
    """Bodies that touch share their heat, whatever the scheme; none is lost, nor motion made."""
    steps = 200 if scheme == "musl" else 5
    text = f"""
    method(ulmpm, FLIP, linear, 0.9, thermo-mechanical)
    scheme({scheme})
    dimension(1, 0, 1, 0.25)
    region(left, block, 0, 0.5)
    region(right, block, 0.5, 1)
    material(copper, neo-hookean, 2, 1, 0.3, 0.5, 1)
    material(iron, linear, 4, 1, 0.3, 0.75, 0.5)
    material(wood, linear, 1, 1, 0.3)
    solid(left, region, left, 2, copper, 0.25, 10)
    solid(right, region, right, 2, iron, 0.25, 20)
    group(left, particles, region, left, solid, left)
    group(right, particles, region, right, solid, right)
    compute(left, average_temperature, left)
    compute(right, average_temperature, right)
    compute(Ek, kinetic_energy, all)
    log_modify(custom, step, time, left, right, Ek)
    set_output(100)
    run({steps})
    """
    log = run_interpreted(text).log
    heat = 1.0 * log.left + 3.0 * log.right
    assert heat == pytest.approx(70, rel=1e-9)  # the log has ten digits
    assert not log.Ek.any()
    if scheme == "musl":
        assert log.left[-1] == pytest.approx(17.5, rel=0.01)
    else:  # the same as with musl: bodies at rest conduct once per step
        other = run_interpreted(text.replace(f"scheme({scheme})", "scheme(musl)"), folder="musl")
        assert log.left[-1] == other.log.left[-1]


def test_ring(run_interpreted):
    """Between r = 1 and 2, steady: T = ln(r/2) / ln(1/2), and 2 pi / ln 2 flow through."""
    text = """
    h = 0.25
    method(ulmpm, FLIP, linear, 1, thermo-mechanical)
    dimension(2, 0, 2, 0, h, h)
    axisymmetric(true)
    region(ring, block, 1, 2, 0, h)
    material(m, linear, 1, 1, 0, 1, 1)
    solid(ring, region, ring, 2, m, h, 0)
    region(inside, block, 0.99, 1.01, INF, INF)
    region(outside, block, 1.99, 2.01, INF, INF)
    group(inside, nodes, region, inside, all)
    group(outside, nodes, region, outside, all)
    fix(hot, temperature_nodes, inside, 1)
    fix(cold, temperature_nodes, outside, 0)
    log_modify(custom, step, time, hot_s, cold_s)
    set_output(100000)
    dump(d, all, particle, 100000, d.*.txt, x, T)
    run_time(0.7)
    """
    result = run_interpreted(text)
    # Per radian, for the height h.
    assert result.log.hot_s[-1] == pytest.approx(0.25 / log(2), rel=0.01)
    assert result.log.cold_s[-1] == pytest.approx(-0.25 / log(2), rel=0.01)
    points = last(result)
    assert points["T"] == pytest.approx(np.log(points.x / 2) / log(0.5), abs=0.01)


def test_flux_in_the_total_frame():
    """C^-1 g: with F = R U it does not depend on R, and a stretch s divides by s^2."""
    rng = np.random.default_rng(5)
    for kin, d in ((PlaneStrain(), 2), (Space(), 3)):
        F = np.eye(d) + 0.3 * rng.normal(size=(d, d))
        g = rng.normal(size=d)
        found = pulled_back(Total(), kin, vector(kin, g), tensor(kin, F.ravel()))
        assert found == pytest.approx(np.linalg.inv(F.T @ F) @ g)
    kin = Axisymmetric()
    F = tensor(kin, (2.0, 0.0, 0.0, 0.5, 1.7))  # the last is the stretch around the axis
    assert pulled_back(Total(), kin, vector(kin, (1.0, 1.0)), F) == pytest.approx((0.25, 4.0))


def test_face_of_a_point():
    """The side of a cube of the point's volume; axisymmetric volumes are per radian."""
    assert face(Line(), 0.3, (2.0,)) == 1
    assert face(PlaneStrain(), 0.25, (2.0, 0.0)) == 0.5
    assert face(Axisymmetric(), 2.0 * 0.25, (2.0, 0.0)) == pytest.approx(2.0 * 0.5)
    assert face(Space(), 0.125, (2.0, 0.0, 0.0)) == pytest.approx(0.25)


def test_points_on_nodes(run_interpreted):
    """A point on a node has no weight at the next node, but a gradient: T stays what it is."""
    text = """
    h = 0.25
    method(ulmpm, FLIP, linear, 1, thermo-mechanical)
    dimension(1, 0, 4, h)
    region(bar, block, 0.5, 1.5)
    material(m, linear, 1, 1e-9, 0, 1, 0.1)
    solid(bar, region, bar, 2, m, h, 300)
    fix(v, initial_velocity_particles, all, 1)
    set_dt(h/4)
    dump(d, all, particle, 1, d.*.txt, x, T)
    run(8)
    """
    result = run_interpreted(text)
    for file in result.folder.glob("d.*.txt"):
        assert read_dump(file)[-1]["T"] == pytest.approx(300, rel=1e-9)


def test_single_precision(run_interpreted):
    """The same in single precision, to single precision."""
    double = last(run_interpreted(slab(HOT.format(301)), folder="double"))
    text = "precision(single)\n" + slab(HOT.format(301)).replace("\n    ", "\n")
    single = last(run_interpreted(text, folder="single"))
    assert single["T"] == pytest.approx(double["T"], abs=1e-3)


@pytest.mark.parametrize("final", [0.2, 0.05])
def test_squeezed(run_interpreted, final):
    """The step of conduction follows a body that is squeezed in the total frame."""
    text = f"""
    h = 0.25
    speed = -{1 - final}
    method(tlmpm, FLIP, linear, 1, thermo-mechanical)
    dimension(1, -0.5, 1.5, h)
    region(bar, block, 0, 1)
    material(m, linear, 1, 1e-6, 0, 1, 0.2)
    solid(bar, region, bar, 2, m, h, 0)
    fix(push, velocity_nodes, all, speed*x0)
    region(end, block, 0, h/4)
    group(end, nodes, region, end, all)
    fix(hot, temperature_nodes, end, 1)
    log_modify(custom, step, dt, time)
    set_output(1)
    dump(d, all, particle, 100000, d.*.txt, x, T)
    run_time(1)
    """
    result = run_interpreted(text)
    T = last(result)["T"]
    assert (T > 0).all() and (T < 1.001).all()
    # kappa / (rho cp) in reference coordinates grows by one over the stretch, here that of the step
    # before; the last steps are shortened.
    log = result.log
    stretch = 1 - (1 - final) * log.Time
    assert log.dt[2:-3] == pytest.approx(log.dt[0] * stretch[1:-4], rel=1e-6)


@pytest.mark.parametrize("kind, speed, ppc", [("tlmpm", "x0", 2), ("ulmpm", "x0/(1+time)", 4)])
def test_stretched(run_interpreted, kind, speed, ppc):
    """A bar pulled to twice its length: heat diffuses as far as in a bar at rest in ln 2.

    In reference coordinates dT/dt = kappa/(rho cp (1 + t)) d2T/dX2.
    """
    text = f"""
    h = 0.125
    method({kind}, FLIP, linear, 1, thermo-mechanical)
    dimension(1, 0, 2.25, h)
    region(bar, block, 0, 1)
    material(m, linear, 1, 1e-6, 0, 1, 0.05)
    solid(bar, region, bar, {ppc}, m, h, 0)
    fix(pull, velocity_nodes, all, {speed})
    region(end, block, 0, h/4)
    group(end, nodes, region, end, all)
    fix(hot, temperature_nodes, end, 1)
    dump(d, all, particle, 100000, d.*.txt, x, x0, T)
    dt_factor(0.5)
    run_time(1)
    """
    points = last(run_interpreted(text))
    assert points.x == pytest.approx(2 * points.x0, rel=0.02)
    exact = [erfc(X / (2 * sqrt(0.05 * log(2)))) for X in points.x0]
    assert points["T"] == pytest.approx(exact, abs=0.02)


def test_runs_in_pieces(state_interpreted):
    """A run in pieces is the run as a whole, with fixes that begin in the first."""
    lines = HOT.format("300 + cos(time)")
    whole = state_interpreted(slab(lines, ", hot_s", "run(12)"))
    pieces = state_interpreted(slab(lines, ", hot_s", "run(5)\n    run(7)"))
    assert same_bits(whole, pieces)


@pytest.mark.parametrize(
    "lines, message",
    [
        ("material(n, linear, 1, 1, 0)\n    solid(cold, region, slab, 2, n, h, 0)", None),
        (FIRST + "fix(f, heat_flux_particles, first)", "heat_flux_particles, group, q"),
        (FIRST + "fix(f, temperature_nodes, first, 1)", "node"),
    ],
)
def test_messages(run_interpreted, lines, message):
    """A body without temperature is fine beside one that has it; wrong arguments are told."""
    result = run_interpreted(slab(lines, run="run(1)"), status=int(message is not None))
    if message:
        assert message in result.err


def test_messages_of_methods(run_interpreted):
    """Heat needs the method and a material."""
    mechanical = slab(FIRST + "fix(f, heat_flux_particles, first, 1)").replace(
        "thermo-mechanical", "mechanical"
    )
    said = run_interpreted(mechanical, status=1).err
    assert "no heat flows" in said and "thermo-mechanical" in said
    said = run_interpreted(slab().replace("0, 0.5, 1)", "0)"), status=1).err
    assert "no solid has a temperature" in said


def test_hooks_in_python(tmp_path, starts_are_cheap):
    """A fix in Python supplies heat and holds a temperature as the built-in ones do."""
    code = """
        from karamelo_py.output.console import Console
        from karamelo_py.scene.hub import Hub
        from karamelo_py.scene.modify import Fix
        from karamelo_py.language.interpreter import Interpreter

        class Lamp(Fix):
            def supply_heat(self, points):
                assert (points.temperature >= 300).all()
                points.heat_supply = points.heat_supply + 7

        class Oven(Fix):
            def post_heat_to_grid(self, nodes):
                nodes.velocity = 300 + 0 * nodes.velocity

            def post_update_grid_heat(self, nodes):
                nodes.velocity_update = 300 + 0 * nodes.velocity

        def temperatures(built_in):
            hub = Hub(Console(quiet=True))
            hub.interpreter = Interpreter(hub)
            hub.interpreter.run_text(SCENE, "scene")
            if built_in:
                hub.interpreter.run_text(FIXES, "fixes")
            else:
                for name, fix in {"lamp": Lamp, "oven": Oven}.items():
                    group = hub.groups["first" if name == "lamp" else "end"]
                    hub.fixes.add(name, fix(hub, group))
                    hub.values.publish_vector(name)
            hub.interpreter.run_text("run(8)", "run")
            return hub.fields.particle("T")

        first, second = temperatures(True), temperatures(False)
        assert first.max() > 300.1, first.max()
        assert abs(first - second).max() < 1e-12, (first, second)
    """
    scene = slab(
        FIRST + "region(other, block, 1 - h/4, 1)\n    group(end, nodes, region, other, all)"
    )
    scene = "\n".join(
        line for line in scene.splitlines() if "run" not in line and "dump" not in line
    )
    fixes = "fix(lamp, heat_flux_particles, first, 7)\nfix(oven, temperature_nodes, end, 300)"
    done = subprocess.run(
        [sys.executable, "-c", f"SCENE = {scene!r}\nFIXES = {fixes!r}\n{dedent(code)}"],
        cwd=tmp_path,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_average_temperature_of_a_ball_around_its_axis(run_interpreted):
    """The mean by mass: of the ball the core r < R/2 has 1 - (3/4)^(3/2), if the grid is fine."""
    text = """
    method(ulmpm, FLIP, linear, 1)
    dimension(2, 0, 2, 0, 2, 0.1)
    axisymmetric(true)
    region(ball, sphere, 0, 1, 0.5)
    region(inner, block, INF, 0.25, INF, INF)
    region(core, intersection, ball, inner)
    region(rim, difference, ball, inner)
    material(a, linear, 2, 1, 0.3, 1, 0)
    solid(core, region, core, 2, a, 0.1, 0)
    solid(rim, region, rim, 2, a, 0.1, 1)
    compute(T, average_temperature, all)
    log_modify(custom, step, T)
    run(1)
    """
    result = run_interpreted(text)
    assert result.log.T[-1] == pytest.approx(0.75**1.5, abs=0.01)
    # The half of the disk at x < 0 is its mirror image.
    assert "outside the domain" not in result.err


COOLING = """
    kind = "ulmpm"
    R = 0.5
    h = R/2
    method(kind, FLIP, linear, 1, thermo-mechanical)
    {domain}
    {body}
    material(m, linear, 2, 1, 0, 3, 1)
    solid(body, region, body, 2, m, h, 300, points={points})
    fix(air, edge_convection, all, body, 0.2, 200)
    compute(T, average_temperature, all)
    log_modify(custom, step, time, T, air_s, air_area)
    {run}
"""
DISK = {
    "domain": "dimension(2, -0.75, 0.75, -0.75, 0.75, h)",
    "body": "region(body, cylinder, 0.01, 0.02, R)",
}
BALL = {
    "domain": "dimension(2, 0, 0.75, -0.75, 0.75, h)\n    axisymmetric(true)",
    "body": "region(body, cylinder, 0, 0.02, R)",
}
BALL_IN_3D = {
    "domain": "dimension(3, -0.75, 0.75, -0.75, 0.75, -0.75, 0.75, h)",
    "body": "region(body, sphere, 0.01, 0.02, 0, R)",
}


@pytest.mark.parametrize(
    "scene, d, points",
    [
        (DISK, 2, "regular"),
        (BALL, 3, "cut"),
        pytest.param(DISK, 2, "cut", marks=pytest.mark.full),
        pytest.param(BALL_IN_3D, 3, "regular", marks=pytest.mark.full),
        pytest.param(BALL_IN_3D, 3, "cut", marks=pytest.mark.full),
    ],
)
def test_a_round_body_cools_through_its_surface(run_interpreted, scene, d, points):
    """T = T_inf + (T0 - T_inf) exp(-t/tau), tau = rho c R (1 + Bi/(d + 2)) / (d h), Bi = h R / k.

    The first eigenvalue of a cylinder (d = 2) and a ball (d = 3) for small Bi, here 0.1: Carslaw &
    Jaeger 1959, 7.7 and 9.4. By points of one layer the rate was 0.66 to 1.44 times that.
    """
    log = run_interpreted(COOLING.format(**scene, points=points, run="run(20)")).log
    whole = {2: 2 * np.pi * 0.5, 3: 4 * np.pi * 0.5**2}[d]
    whole /= 2 * np.pi if "axi" in scene["domain"] else 1
    assert log.air_area[-1] == pytest.approx(whole, rel=2e-3)
    tau = 2 * 3 * 0.5 / (d * 0.2) * (1 + 0.1 / (d + 2))
    fallen, exact = 300 - log["T"][-1], 100 * (1 - np.exp(-log.Time[-1] / tau))
    # Regular points of so few have 2.6 % more mass than the disk.
    assert fallen == pytest.approx(exact, rel=0.03 if points == "regular" else 0.01)


def test_flux_through_an_edge(run_interpreted):
    """A block gets q times its sides, corners and all; q may depend on the place of the edge."""
    block = {
        "domain": "dimension(2, -0.75, 0.75, -0.75, 0.75, h)",
        "body": "region(body, block, -0.5, 0.5, -0.25, 0.25)",
    }
    lines = "fix(sun, edge_heat_flux, all, body, 7*y^2)"
    text = COOLING.format(**block, points="regular", run="run(2)")
    text = text.replace("fix(air, edge_convection, all, body, 0.2, 200)", lines)
    log = run_interpreted(text.replace("air_", "sun_")).log
    # At corners 1/16 of a point's side has the area of its diagonal.
    corners = 4 * (2 - np.sqrt(2)) * 0.125 / 16
    assert log.sun_area[-1] == pytest.approx(2 * (1 + 0.5) - corners, rel=1e-6)
    # Pieces of 1/4 of a point's side: a midpoint rule.
    exact = 2 * 7 * (0.25**2 + 2 * 0.25**3 / 3)
    assert log.sun_s[-1] == pytest.approx(exact, rel=0.02)


def test_an_edge_cools_bit_for_bit(state_interpreted):
    """In pieces of a run as in the whole."""
    whole = state_interpreted(COOLING.format(**DISK, points="cut", run="run(4)"))
    pieces = state_interpreted(COOLING.format(**DISK, points="cut", run="run(1)\n    run(3)"))
    assert same_bits(whole, pieces)


def test_the_area_that_points_cover_is_told(run_interpreted):
    """Of the points of one layer, before the run; the fix by the edge is named."""
    lines = "region(in, cylinder, 0.01, 0.02, R - h/2)\n    region(rim, difference, body, in)\n    group(rim, particles, region, rim, all)\n    fix(air, convection_particles, rim, 0.2, 200)"  # noqa: E501
    text = COOLING.format(**DISK, points="regular", run="run(1)")
    text = text.replace("fix(air, edge_convection, all, body, 0.2, 200)", lines)
    out = run_interpreted(text.replace(", air_area", "")).out
    count = int(out.partition(" points cover an area of ")[0].split()[-1])
    assert f"{count} points cover an area of {count * 0.125:.4g} per thickness" in out
    assert "edge_convection takes the area of the surface" in out
