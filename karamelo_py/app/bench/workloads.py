"""The scenes that karamelo-py bench times."""

from typing import NamedTuple

DISKS = """
h = 1/N
dimension(2, -0.5, 0.5, -0.5, 0.5, h)
region(lower, cylinder, -0.3, -0.3, 0.2)
region(upper, cylinder, 0.3, 0.3, 0.2)
material(rubber, law, 1000, 1000, 0.3)
solid(disk1, region, lower, 2, rubber, h, 0)
solid(disk2, region, upper, 2, rubber, h, 0)
group(disk1, particles, region, lower, solid, disk1)
group(disk2, particles, region, upper, solid, disk2)
fix(v1, initial_velocity_particles, disk1, 0.1, 0.1)
fix(v2, initial_velocity_particles, disk2, -0.1, -0.1)
set_dt(0.02*h)
"""
FORMULA = """
fix(load, body_force, all, 1e-3*sin(x0)*cos(time), 1e-3*y0*time)
"""
BLOCK = """
h = 1/N
dimension(3, 0, 2, 0, 2, 0, 2, h)
region(cube, block, 0.5, 1.5, 0.5, 1.5, 0.5, 1.5)
material(rubber, law, 1000, 1000, 0.3)
solid(cube, region, cube, 2, rubber, h, 0)
fix(v, initial_velocity_particles, all, 0.1*y0, 0.1*z0, 0.1*x0)
set_dt(0.02*h)
"""
# The copper bar of Taylor's test in three dimensions, with one point a cell (de Vaucorbeil et al.
# 2020): 74052 points in tlmpm, 74664 in ulmpm.
BAR = """
L0 = 25.4e-3
R0 = 3.8e-3
rho = 8940
E = 115e9
nu = 0.31
h = 0.25e-3*coarser
dimension(3, -10e-3, 10e-3, -10e-3, 10e-3, 0, L0 + 2*h, h)
region(bar, cylinder, z, 0, 0, R0, 0, L0)
eos(compression, shock, rho, E/(3*(1 - 2*nu)), 3933, 1.5, 0, 385, 298, 0, 0)
strength(copper, johnson_cook, E/(2*(1 + nu)), 65e6, 356e6, 0.37, 1, 0, 0, 298, 1356)
material(copper, eos-strength, compression, copper)
solid(bar, region, bar, 1, copper, h, 298)
fix(v0, initial_velocity_particles, all, 0, 0, -190)
region(wall, block, INF, INF, INF, INF, -h/4, h/4)
group(wall, nodes, region, wall, all)
fix(wall, velocity_nodes, wall, NULL, NULL, 0)
set_dt(0.2*h/3933)
"""
# A column of water in a tank with slippery walls; sound is ten times as fast as sqrt(2 g H).
DAM = """
H = 0.6
g = 9.81
h = H/N
c = 10*sqrt(2*g*H)
dimension(2, 0, 1.61, 0, 0.9, h)
region(column, block, 0, H, 0, H)
eos(water, fluid, 1000, 1000*c^2/7, 7)
strength(water, fluid, 1e-3)
material(water, eos-strength, water, water)
solid(water, region, column, 2, water, h, 0)
region(sides, block, -h/4, h/4, INF, INF)
region(base, block, INF, INF, -h/4, h/4)
group(sides, nodes, region, sides, all)
group(base, nodes, region, base, all)
fix(sides, velocity_nodes, sides, 0, NULL)
fix(base, velocity_nodes, base, NULL, 0)
fix(gravity, body_force, all, 0, -g)
set_dt(0.1*h/c)
"""
MOST_STEPS = 2500  # in these scenes nothing leaves the domain before


class Workload(NamedTuple):
    """A scene to be timed."""

    title: str
    script: str
    # Steps before the measuring begins.
    lead: int = 3
    # Published million particle-steps a second of Karamelo (C++) on one core of a small AMD EPYC.
    karamelo: float | None = None


def _workload(
    title: str,
    scene: str,
    method: str = "ulmpm, FLIP, linear, 1",
    scheme: str = "musl",
    precision: str = "double",
    lead: int = 3,
    karamelo: float | None = None,
    **variables: str | int,
) -> Workload:
    lines = [f"precision({precision})", f"method({method})", f"scheme({scheme})"]
    for name, value in variables.items():
        lines.append(f'{name} = "{value}"' if isinstance(value, str) else f"{name} = {value}")
    return Workload(title, "\n".join(lines) + scene, lead, karamelo)


def _disks(N: int, title: str = "", scene: str = DISKS, law: str = "linear", **rest) -> Workload:
    return _workload(f"two disks, {N} cells a side{title}", scene, N=N, law=law, **rest)


def _block(title: str = "", law: str = "linear", **rest) -> Workload:
    return _workload(f"cube in 3D, 23 cells a side{title}", BLOCK, N=23, law=law, **rest)


# The single pass of the fastest rivals.
SINGLE_PASS = {"method": "ulmpm, MLS, quadratic-spline", "scheme": "usl", "law": "neo-hookean"}
QUADRATIC = "ulmpm, FLIP, quadratic-spline, 1"
CUBIC = "ulmpm, FLIP, cubic-spline, 1"
# The first wave of the impact has gone through most of the bar by then.
IMPACT = 400

WORKLOADS = {
    "disks-20": _disks(20, karamelo=2.6),
    "disks-80": _disks(80, karamelo=2.0),
    "disks-320": _disks(320, karamelo=1.1),
    "disks-320-usl": _disks(320, ", usl", scheme="usl"),
    "disks-320-quadratic": _disks(320, ", quadratic splines", method=QUADRATIC),
    "disks-320-cubic": _disks(320, ", cubic splines", method=CUBIC),
    "disks-320-q4": _disks(320, ", CPDI-Q4", method="ulcpdi, FLIP, linear, 1, Q4"),
    "disks-320-mls": _disks(320, ", MLS in a single pass", **SINGLE_PASS),
    "disks-320-mls-single": _disks(
        320, ", MLS in a single pass, single precision", precision="single", **SINGLE_PASS
    ),
    "disks-80-formula": _disks(80, ", a body force by formula", DISKS + FORMULA),
    "block-3d": _block(),
    "block-3d-quadratic": _block(", quadratic splines", method=QUADRATIC),
    "block-3d-mls": _block(", MLS in a single pass", **SINGLE_PASS),
    "block-3d-mls-single": _block(
        ", MLS in a single pass, single precision", precision="single", **SINGLE_PASS
    ),
    "bar-3d-ul": _workload(
        "Taylor's bar of copper in 3D", BAR, "ulmpm, FLIP, linear, 0.99",
        lead=IMPACT, karamelo=0.49, coarser=1,
    ),
    "bar-3d-tl": _workload(
        "Taylor's bar of copper in 3D, total Lagrangian", BAR, "tlmpm, FLIP, linear, 0.99",
        lead=IMPACT, karamelo=0.48, coarser=1,
    ),
    "dam-break": _workload(
        "a column of water breaks down, cubic splines", DAM, CUBIC, karamelo=0.41, N=149
    ),
}  # fmt: skip
