"""Scripts as they are written for Karamelo run, but for what docs/from-karamelo.md lists."""

import re
from pathlib import Path
from textwrap import dedent

import numpy as np
import pytest

from karamelo_py.language import registry
from karamelo_py.script.errors import instead, table

PAGE = Path(__file__).parents[1] / "docs" / "from-karamelo.md"

# The words of both branches of Karamelo, by family.
WORDS = {
    "command": table()["karamelo"],
    "fix": """velocity_nodes velocity_particles initial_velocity_particles initial_velocity_nodes
        initial_stress body_force force_nodes kinetic_energy strain_energy check_solution
        contact/hertz contact/minimize_penetration contact/minimize_penetration/plane cuttingtool
        temperature_nodes temperature_particles neumann_bc_mech heat_flux_particles indent
        convection_particles impenetrablesurface indent/minimize_penetration meldtool""",
    "compute": """kinetic_energy strain_energy average_velocity max_plastic_strain average_stress
        average_temperature max_position angular_momentum""",
    "dump": "particle particle/gz particle/bin grid grid/gz grid/bin pyplot",
    "region": "block cylinder sphere union intersection difference stl",
    "eos": "linear shock fluid",
    "strength": "linear plastic johnson_cook swift fluid",
    "damage": "damage_johnson_cook",
    "temperature": "plastic_work",
    "material": "linear neo-hookean eos-strength rigid",
    "solid": "region mesh",
    "method": "tlmpm ulmpm tlcpdi ulcpdi ulmpm/contacts",
    "scheme": "musl usl usf",
}
REFUSED = {"partition_domain", "quit"}


@pytest.mark.parametrize("family", WORDS)
def test_every_word_of_karamelo_is_known_or_answered(family):
    for word in WORDS[family].split():
        known = registry.knows(family, word)
        assert known or word in REFUSED, word
        if not known and word != "quit":
            assert instead(family, word), word


def test_the_page_has_what_is_refused_and_what_lammps_says_otherwise():
    """Each word with a hint of its own stands in the page."""
    page = PAGE.read_text("utf-8")
    for words in table()["instead"].values():
        for word in words:
            assert f"`{word}`" in page, word


def test_the_scripts_of_the_page_run(run_interpreted):
    """Those that are whole: they begin with method."""
    text = PAGE.read_text("utf-8")
    scripts = [
        s for s in re.findall(r"```karamelo\n(.*?)```", text, re.DOTALL) if s.startswith("method")
    ]
    assert scripts
    for k, script in enumerate(scripts):
        run_interpreted(script, folder=f"page{k}")


def run(run_interpreted, script, **options):
    """A script in Karamelo's manner; nothing is warned of."""
    result = run_interpreted(dedent(script), **options)
    if not options:
        assert "error" not in result.err
    return result


def test_disks_that_are_dropped_and_measured(run_interpreted):
    """Two disks in free fall: forces, centres and energies of groups in variables and the log."""
    log = run(
        run_interpreted,
        """\
        E = 1e+3
        nu = 0.3
        rho = 1000
        L = 1
        N = 10
        cellsize = L/N
        method(ulmpm, FLIP, linear, 1)
        scheme(usl)
        dimension(2, -0.5*L, 0.5*L, -0.5*L, 0.5*L, cellsize)
        region(rdisk1, cylinder, -0.25, 0, 0.15)
        region(rdisk2, cylinder, 0.25, 0, 0.15)
        material(mat1, linear, rho, E, nu)
        solid(solid1, region, rdisk1, 2, mat1, cellsize, 0)
        solid(solid2, region, rdisk2, 2, mat1, cellsize, 0)
        group(gdisk1, particles, region, rdisk1, solid, solid1)
        group(gdisk2, particles, region, rdisk2, solid, solid2)
        fix(v0, initial_velocity_particles, gdisk2, 0, 0.1, NULL)
        fix(grav, body_force, all, 0, -9.81)
        compute(Ek, kinetic_energy, all)
        compute(Es, strain_energy, all)
        Etot = Ek + Es
        y1 = xcm(gdisk1, y)
        y2 = xcm(gdisk2, y)
        F1 = internal_force(gdisk1, y)
        set_output(5)
        log_modify(custom, step, dt, time, y1, y2, F1, Etot)
        set_dt(0.001)
        run(20)
        """,
    ).log
    step, t = log.Step, log.Time
    fall = 9.81e-6 * step * (step + 1) / 2
    assert log.y1 == pytest.approx(-fall, abs=1e-12)
    assert log.y2 == pytest.approx(0.1 * t - fall, abs=1e-12)
    mass = -log.F1[1:] / 9.81
    assert mass == pytest.approx(np.full(4, mass[0]), rel=1e-9)
    # 8 of the 9 points of each quarter of the square around it lie in a disk, 2.5 each.
    assert mass[0] == pytest.approx(4 * 8 * 2.5, rel=1e-9)


def test_a_bar_that_is_pulled(run_script):
    """Total Lagrangian, thermo-mechanical word, names that only karamelo-py knows as functions.

    The force of the grip is that inside of the bar: sigma A in the steady part, within the waves.
    """
    log = run(
        run_script,
        """\
        method(tlmpm, FLIP, linear, 0.99, mechanical)
        gamma = 2
        step = 0.1
        dimension(2, 0, 2, 0, 1, step)
        region(bar, block, 0, 1, 0, 0.3)
        region(left, block, INF, 0.01, INF, INF)
        region(right, block, 0.99, INF, INF, INF)
        eos(bulk, linear, 1, 100)
        strength(flow, johnson_cook, 50, 1e+3, 0, 1, 0, 0, 0, 0, 1)
        material(metal, eos-strength, bulk, flow)
        solid(solid1, region, bar, 2, metal, step, 0)
        group(gleft, nodes, region, left, solid, solid1)
        group(gright, nodes, region, right, solid, solid1)
        fix(hold, velocity_nodes, gleft, 0, 0)
        fix(pull, velocity_nodes, gright, 0.001*gamma, NULL)
        compute(s, average_stress, all)
        compute(R, reaction, gright)
        F = internal_force(gleft, x)
        log_modify(custom, step, time, s_11, F, R_x, hold_x)
        dt_factor(0.5)
        run_time(0.5)
        """,
    ).log
    half = slice(len(log.Time) // 2, None)
    # s_11 of the mean over the bar times its section, on both sides, to the waves of the start.
    assert log.R_x[half].mean() == pytest.approx(0.3 * log.s_11[half].mean(), rel=0.1)
    assert log.hold_x[half].mean() == pytest.approx(-log.R_x[half].mean(), rel=0.15)
    # But for what the hundredth of PIC keeps of the momentum of held nodes.
    assert log.F[half] == pytest.approx(-log.hold_x[half], rel=2e-3)


def test_a_plate_with_a_hole_under_a_ball(run_interpreted):
    """Points deleted and moved, tools and walls, dumps in binary form, plots and text variables."""
    result = run(
        run_interpreted,
        """\
        basis = "linear"
        method(ulmpm, FLIP, basis, 1)
        dimension(2, 0, 2, 0, 2, 0.1)
        region(plate, block, 0.5, 1.5, 0.5, 0.7)
        region(hole, cylinder, 1, 0.6, 0.05)
        material(mat, neo-hookean, 1, 100, 0.3)
        solid(solid1, region, plate, 2, mat, 0.1, 0)
        delete_particles(solid1, region, hole)
        translate_particles(all, region, plate, 0, 0.1, 0)
        group(top, particles, region, plate, all)
        fix(ball, indent/minimize_penetration, all, sphere, 0.2, 1, 1 - time, 0, 0, -1, 0, 0.1)
        fix(floor, impenetrablesurface, all, 1, 0, 0.63, 0, 0, 1, 0)
        dump(dump1, all, particle/bin, 10, dump_p.*.bin, x, y, z, seq, bx)
        dump(dump2, all, grid/bin, 10, dump_g.*.bin, x, y, z, vx, mass)
        log_modify(custom, step, dt, time, ball_y, ball_s, floor_y)
        set_output(10)
        set_dt(1e-3)
        run_while(time < 0.03)
        run(5)
        """,
    )
    assert (result.folder / "dump_p.30.bin").exists()
    assert result.log.ball_y[-1] < 0 < result.log.floor_y[-1]


def test_a_wall_that_lets_go(run_interpreted):
    """leq and geq, evaluate, and force of a group in a condition: the run ends at the wall.

    From 0.2 above the first node line, less the cell over which contact begins, at the speed 1.
    """
    log = run(
        run_interpreted,
        """\
        method(ulmpm/contacts, FLIP, linear, 1)
        dimension(2, 0, 1, 0, 1, 0.1)
        region(block1, block, 0.3, 0.5, 0.4, 0.6)
        region(wall, block, INF, INF, INF, 0.101)
        material(mat, linear, 1, 100, 0)
        solid(solid1, region, block1, 2, mat, 0.1, 0)
        group(gwall, nodes, region, wall, all)
        fix(v, initial_velocity_particles, all, 0, -1)
        fix(bc, velocity_nodes, gwall, NULL, geq0)
        y0_ = evaluate(xcm(all, y))
        set_dt(0.004)
        log_modify(custom, step, time, bc_y)
        run_until(bc_y > 0)
        print(y0_)
        """,
    ).log
    assert log.Time[-1] == pytest.approx(0.225, abs=0.0081)  # two steps


def test_formulas_of_the_kokkos_branch(run_interpreted):
    """Normally distributed velocities from positions; the sums of many are near those of nature."""
    result = run(
        run_interpreted,
        """\
        method(ulmpm, FLIP, linear, 1)
        dimension(2, 0, 2, 0, 2, 0.1)
        region(box, block, 0.2, 1.8, 0.2, 1.8)
        material(mat, linear, 1, 100, 0)
        solid(solid1, region, box, 2, mat, 0.1, 0)
        k = 40*x0 + 40*40*y0
        v0 = inv_norm(if(mod(k*PHI, 1) < 1e-5, 0.5, mod(k*PHI, 1)))
        fix(v, initial_velocity_particles, all, v0, EGAMMA*0)
        compute(Ek, kinetic_energy, all)
        compute(V, average_velocity, all)
        log_modify(custom, step, Ek, V_x)
        set_dt(1e-4)
        run(1)
        """,
    )
    # 1024 points of mass 0.0025: variance 1, within four standard deviations of a random sample.
    assert result.log.Ek[0] == pytest.approx(0.5 * 2.56, rel=4 * np.sqrt(2 / 1024))
    assert result.log.V_x[0] == pytest.approx(0, abs=4 / np.sqrt(1024))
