"""Edges through which waves leave."""

import pytest
from test_gpu_runs import alike

ROCK = """
    h = 1
    method({way})
    dimension(1, 0, 100, h)
    region(bar, block, 0, 100)
    material(rock, linear, 2500, 50e9, 0.25)
    {water}
    solid(rock, region, bar, 2, rock, h, 0)
    region(right, block, 100 - 1e-6, INF)
    region(left, block, -INF, 1e-6)
    group(right, nodes, region, right, all)
    group(left, nodes, region, left, all)
    fix(right, absorbing, right, rock, xhi)
    fix(left, absorbing, left, rock, xlo)
    compute(k, kinetic_energy, all)
    compute(e, strain_energy, all)
    E = k + e
"""
# A pulse of ten cells to either side; lambda is a third of the P-wave modulus, 60 GPa.
PULSE = """
    c = sqrt(60e9/2500)
    fix(v, initial_velocity_particles, all, exp(-((x0 - 60)/5)^2))
    fix(s, initial_stress, all, {p}, {p}/3, {p}/3, 0, 0, 0)
    log_modify(custom, time, E)
    set_output(1000)
    run_time(80/c)
"""


@pytest.mark.xdist_group("absorbing")
@pytest.mark.parametrize("way", ["tlmpm, FLIP, linear, 1", "ulmpm, FLIP, quadratic-spline, 1"])
def test_a_wave_leaves(run_script, way):
    """Lysmer & Kuhlemeyer 1969: exact at normal incidence; here 0.16 and 0.09 % of the energy."""
    pulse = PULSE.format(p="-2500*c*exp(-((x0 - 60)/5)^2)")
    energy = run_script(ROCK.format(way=way, water="") + pulse).log["E"]
    assert energy[-1] < 0.002 * energy[0]


def test_ground_with_its_stress_stays(run_interpreted):
    """The edge takes over the force that holds it: weight does not push it away."""
    script = ROCK.format(way="tlmpm, FLIP, linear, 1", water="").replace("h = 1", "h = 10")
    at_rest = """
        fix(weight, body_force, all, -9.81)
        fix(s, initial_stress, all, 2500*9.81*(x0 - 100), 0, 0, 0, 0, 0)
        log_modify(custom, time, k, left_x)
        run(30)
    """
    log = run_interpreted(script.replace("fix(right, abs", "# ") + at_rest).log
    assert log["k"].max() < 1e-12
    assert abs(log["left_x"][-1] - 2500 * 9.81 * 100) < 1


def test_a_side_that_is_not_there_is_refused(run_interpreted):
    script = ROCK.format(way="ulmpm, FLIP, linear, 1", water="").replace("xhi", "yhi")
    err = run_interpreted(script + "run(1)", status=1).err
    assert "the scene has no direction y" in err
    assert err.count("error:") == 1


@pytest.mark.xdist_group("pore water")
def test_a_wave_leaves_saturated_ground(run_script):
    """rho c of soil and water together, which move as one."""
    water = "pore_water(rock, n=0.3, permeability=1e-7)"
    pulse = """
        fix(v, initial_velocity_particles, all, exp(-((x0 - 60)/5)^2))
        log_modify(custom, time, k)
        set_output(1000)
        run_time(80/sqrt((60e9 + 2.2e9/0.3)/2800))
    """
    way = "tlmpm, FLIP, linear, 1"
    energy = run_script(ROCK.format(way=way, water=water) + pulse).log["k"]
    assert energy[-1] < 0.003 * energy[0]


@pytest.mark.xdist_group("absorbing")
def test_on_a_gpu(run_script):
    """Compiled, as hooks called by address are bound to loops then."""
    script = (
        ROCK.format(way="tlmpm, FLIP, linear, 1", water="").replace("100", "9")
        + """
    fix(v, initial_velocity_particles, all, x0^2)
    log_modify(custom, time, E, left_x, right_x)
    set_output(1)
    run(8)
    """
    )
    alike(run_script(script, folder="here"), run_script(script, "--gpu", folder="there"), 1e-11)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("right, rock, xhi", "right, rock, xlo"),
        ("right, rock, xhi", "all, rock, xhi"),
        ("left, rock, xlo", "left, rock, xhi"),
    ],
)
def test_nodes_that_are_not_at_the_side_are_refused(run_interpreted, right, wrong):
    script = ROCK.format(way="ulmpm, FLIP, linear, 1", water="").replace(right, wrong)
    err = run_interpreted(script + "run(1)", status=1).err
    assert f"on the side {wrong[-3:]} of the bodies" in err


def test_an_edge_is_not_taken_for_another_direction(run_interpreted):
    script = """
        method(tlmpm, FLIP, linear, 1)
        dimension(2, 0, 10, 0, 10, 1)
        region(bar, block, 0, 10, 0, 10)
        material(rock, linear, 2500, 50e9, 0.25)
        solid(rock, region, bar, 2, rock, 1, 0)
        region(right, block, 9.9, INF, INF, INF)
        group(right, nodes, region, right, all)
        fix(out, absorbing, right, rock, SIDE)
        run(1)
    """
    assert "lie at y = 0 to 10" in run_interpreted(script.replace("SIDE", "yhi"), status=1).err
    run_interpreted(script.replace("SIDE", "xhi"))


# Between rollers, cos(kx x) is a pair of waves at an angle; 16 cells long, in a packet of 40.
OBLIQUE = """
    W = {wide}
    L = 200
    method(tlmpm, FLIP, linear, 1)
    dimension(2, 0, W, 0, L, 1)
    region(ground, block, 0, W, 0, L)
    material(rock, linear, 2500, 50e9, 0.25)
    {water}
    solid(rock, region, ground, 2, rock, 1, 0)
    region(sides, block, 1e-6, W - 1e-6, -INF, INF, exterior)
    region(top, block, -INF, INF, L - 1e-6, INF)
    region(base, block, -INF, INF, -INF, 1e-6)
    group(sides, nodes, region, sides, all)
    group(top, nodes, region, top, all)
    group(base, nodes, region, base, all)
    fix(sides, velocity_nodes, sides, 0, NULL)
    fix(top, absorbing, top, rock, yhi)
    fix(base, absorbing, base, rock, ylo)
    fix(damp, mass_damping, all, {rate}*(max(abs(y0 - L/2) - L/2 + 20, 0)/20)^2)
    kx = PI/W
    ky = kx/tan(radians({angle}))
    s = y0 - L/2
    f = cos(ky*s)*exp(-(s/40)^2)
    df = -(ky*sin(ky*s) + s/800*cos(ky*s))*exp(-(s/40)^2)
    S = {S}
    vx = if(S, sin(kx*x0)*df, -kx*sin(kx*x0)*f)
    vy = if(S, -kx*cos(kx*x0)*f, cos(kx*x0)*df)
    fix(v, initial_velocity_particles, all, vx, vy)
    compute(k, kinetic_energy, all)
    set_output(10000)
    log_modify(custom, time, k)
    c = sqrt(if(S, 20e9, 60e9 + {stiffer})/{rho})
    run_time(190/c/cos(radians({angle})))
"""
DRY = {"water": "", "stiffer": 0, "rho": 2500}
WET = {"water": "pore_water(rock, n=0.3, permeability=1e-7)", "stiffer": "2.2e9/0.3", "rho": 2800}


@pytest.mark.xdist_group("absorbing")
@pytest.mark.parametrize(
    ("S", "angle", "wide", "soil", "edge"),
    [
        (1, 30, 16, DRY, 0.05),
        *(
            pytest.param(*case, marks=pytest.mark.full)
            for case in [
                (0, 15, 31, DRY, 0.003), (0, 30, 16, DRY, 0.005), (0, 45, 11, DRY, 0.015),
                (1, 15, 31, DRY, 0.01), (1, 45, 11, DRY, 0.04), (0, 45, 11, WET, 0.012),
                (1, 30, 16, WET, 0.025), (1, 45, 11, WET, 0.026),
            ]
        ),
    ],
)  # fmt: skip
def test_oblique_waves_leave_through_a_layer_with_damping(run_script, S, angle, wide, soil, edge):
    """Plane waves: dashpots alone reflect 0.15 to 4.7 % (S, 30 degrees), a layer below 0.2 %."""
    left = {}
    for rate in (0, 1500):
        script = OBLIQUE.format(S=S, angle=angle, wide=wide, rate=rate, **soil)
        energy = run_script(script).log["k"]
        left[rate] = energy[-1] / energy[0]
    assert left[1500] < min(0.002, left[0]) and left[0] < edge


def test_a_negative_rate_of_damping_is_refused(run_interpreted):
    script = ROCK.format(way="ulmpm, FLIP, linear, 1", water="") + "fix(d, mass_damping, all, -1)"
    err = run_interpreted(script + "\nrun(1)", status=1).err
    assert "of at least 0" in err and err.count("error:") == 1
