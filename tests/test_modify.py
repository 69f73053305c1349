"""Command modify: numbers of materials change between runs, and points keep their state."""

import re
import shutil

import numpy as np
import pytest
from going_on import same_files
from test_contact_points import bodies

# A block of clay between smooth plates: the limit load is 2 c times its width.
BLOCK = """
    method(ulmpm, FLIP, linear, 0.9)
    dimension(2, 0, 1, 0, 1, 0.25)
    region(b, block, 0, 0.5, 0, 0.5)
    eos(e, linear, 1000, 1e6)
    strength(s, mohr-coulomb, 5e5, 1e3, 0)
    material(m, eos-strength, e, s)
    solid(b, region, b, 2, m, 0.25, 0)
    region(top, block, INF, INF, 0.5, INF)
    region(base, block, INF, INF, INF, 0)
    region(left, block, INF, 0, INF, INF)
    group(top, nodes, region, top, all)
    group(base, nodes, region, base, all)
    group(left, nodes, region, left, all)
    fix(p, velocity_nodes, top, NULL, -0.005)
    fix(q, velocity_nodes, base, NULL, 0)
    fix(r, velocity_nodes, left, 0, NULL)
    log_modify(custom, step, time, p_y)
    set_output(5)
"""
RUNS = BLOCK + (
    "    run({0})\n    modify(strength, s, cohesion=2e3, phi=0)\n    run({0})\n"
    "    modify(material, m, cohesion=500)\n    run({0})\n"
)


@pytest.mark.xdist_group("modify")
def test_cohesion_changes_between_runs(run_script):
    """The load follows 2 c b, and no loop is compiled anew."""
    said = run_script(RUNS.format(400))
    log = said.log
    loads = [
        -log.p_y[(log.Step > end - 100) & (log.Step <= end)].mean() for end in (400, 800, 1200)
    ]
    assert loads == pytest.approx([1000, 2000, 500], rel=0.03)  # sound dies out
    assert (np.diff(log.Time) >= 0).all()
    assert said.out.count("Compiling") <= 1


@pytest.mark.parametrize("line", ["modify(strength, s, G=5e5, cohesion=500)", ""])
def test_a_run_goes_on_behind_a_change(run_interpreted, line):
    """From a file of the second run everything is the same."""
    script = RUNS.format(6).replace("run(6)", "restart(4, r.*.h5)\n    run(6)", 1) + f"    {line}\n"
    whole = run_interpreted(script, folder="whole").folder
    again = whole.with_name("again")
    shutil.copytree(whole, again)
    assert (
        "continued from step" in run_interpreted(script, "-restart", "r.8.h5", folder="again").out
    )
    same_files(whole, again)


def test_the_same_on_a_card(run_interpreted):
    """Emulated: the arrays of the card have the new numbers."""
    here = run_interpreted(RUNS.format(6), folder="here")
    there = run_interpreted(RUNS.format(6), "--gpu", folder="there")
    assert there.log.p_y == pytest.approx(here.log.p_y, rel=1e-9)


def test_stress_of_the_whole_deformation_follows_at_once(run_interpreted):
    """Twice the modulus of a body that is held is twice its stress; that of rates stays."""
    for law, factor in (("neo-hookean", 2), ("linear", 1)):
        script = f"""
            method(tlmpm, FLIP, linear, 1)
            dimension(2, 0, 1, 0, 1, 0.5)
            region(b, block, 0, 1, 0, 1)
            material(m, {law}, 1000, 1e6, 0.3)
            solid(b, region, b, 2, m, 0.5, 0)
            region(every, block, INF, INF, INF, INF)
            group(every, nodes, region, every, all)
            fix(v, velocity_nodes, every, if(timestep < 4, x0, 0), 0)
            compute(s, average_stress, all)
            log_modify(custom, step, s_11)
            set_output(1)
            set_dt(1e-3)
            run(8)
            modify(material, m, E=2e6)
            run(3)
        """
        log = run_interpreted(script).log
        assert log.s_11[-1] / log.s_11[8] == pytest.approx(factor, rel=1e-3)


@pytest.mark.parametrize(
    ("line", "word", "said"),
    [
        ("modify(strength, s, cohesion=-1)", "-1", "'cohesion' must be a number of at least 0"),
        ("modify(strength, s, cohesin=1)", "cohesin=1", "did you mean 'cohesion'?"),
        ("modify(strength, s, 1e3)", "1e3", "'1e3' has no name"),
        ("modify(strength, s)", "s", "no number changes"),
        ("modify(strength, q, phi=1)", "q", "unknown strength 'q'"),
        ("modify(strenght, s, phi=1)", "strenght", "unknown kind 'strenght'"),
        ("modify(strength, s, psi=30)", "30", "psi = 30 is impossible with phi = 0"),
        ("modify(eos, e, rho0=1200)", "rho0=1200", "the density of material 'm' cannot change"),
        ("modify(material, m, rho0=1200)", "rho0=1200", "the density of material 'm'"),
        ("modify(material, m, strain=logarithmic)", "strain=logarithmic", "change the law"),
        ("modify(material, m, q=1)", "q=1", "no argument is named 'q'"),
    ],
)
@pytest.mark.parametrize("place", ["before", "behind"])
def test_what_cannot_change_is_said(run_interpreted, line, word, said, place):
    """Behind a run, too, where the rehearsal finds it before the run."""
    done = run_interpreted(
        BLOCK + ("    run(1)\n" if place == "behind" else "") + f"    {line}\n", status=1
    )
    assert done.err.count("error:") == 1 and said in done.err
    marked = re.search(r"^ +\d+ \| (.*)\n +\| ( *)(\^+)$", done.err, re.M)
    begin = len(marked[2])
    assert marked[1][begin : begin + len(marked[3])] == word
    assert "Step " not in done.out


VISCOUS = """
    eos(b, linear, 7850, 160e9)
    strength(s, plastic, 80e9, 4e8)
    material(m, eos-strength, b, s)
    viscosity(newtonian, m, 200)
    material(r, hyperelastic, 1000, mu/2*(I1*J**(-2/3) - 3) + 5e5*(J - 1)**2, mu=1e5)
    viscosity(prony, r, g=0.3, tau=1e9)
    viscosity(newtonian, r, 0)
    load_path(p, 10, exx=0.02, syy=0, szz=0, duration=1)
    load_path(q, 1, exy=1e-3, duration=1)
    element(e, m, p)
    element(g, r, q)
"""


def test_law_and_viscosity_change_apart(run_interpreted):
    """Parts within, and each viscosity: the viscous stress is 2 mu D."""
    script = (
        VISCOUS
        + """
    modify(strength, s, yield_stress=2e8)
    modify(viscosity, m, mu=400)
    element(f, m, p)
    modify(viscosity, r, mu=1e5)
    element(h, r, q)
    modify(viscosity, r, g=0.5, tau=1e-9)
    element(k, r, q)
    print(e_sxx, f_sxx, g_sxy, h_sxy, k_sxy)
    """
    )
    out = run_interpreted(script).out
    found = [float(one) for one in re.findall(r"_s[xy]+ = ([-+.e\d]+)", out)]
    assert found == pytest.approx([4e8, 2e8, 200, 200 + 200, 100 + 200], rel=2e-3)


def test_parts_of_a_viscous_law_change_between_runs(run_interpreted):
    """Held at exx = 4e-3: K exx + 2/3 Y."""
    script = """
        method(tlmpm, FLIP, linear, 1)
        dimension(1, 0, 1, 0.5)
        region(b, block, 0, 1)
        eos(e, linear, 1000, 1e6)
        strength(s, plastic, 5e5, 2e3)
        material(m, eos-strength, e, s)
        viscosity(newtonian, m, 1)
        solid(b, region, b, 2, m, 0.5)
        region(every, block, INF, INF)
        group(every, nodes, region, every, all)
        fix(v, velocity_nodes, every, if(timestep < 4, x0, 0))
        compute(s, average_stress, all)
        log_modify(custom, step, s_11)
        set_output(1)
        set_dt(1e-3)
        run(6)
        modify(strength, s, yield_stress=1e3)
        run(3)
        modify(eos, e, K=2e6)
        run(3)
    """
    log = run_interpreted(script).log
    exact = [4e3 + 2 / 3 * 2e3, 4e3 + 2 / 3 * 1e3, 8e3 + 2 / 3 * 1e3]
    assert log.s_11[[6, -4, -1]] == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize(
    ("line", "word", "said"),
    [
        (
            "modify(material, r, tau=1)",
            "tau=1",
            "tau can change only in the viscosity of material 'r'",
        ),
        ("modify(material, r, mu=1)", "mu=1", "mu can change only in the viscosity of material"),
        ("modify(viscosity, r, E=1)", "E=1", "no viscosity with E\nexpected: bulk=..., g=..., mu"),
        ("modify(viscosity, n, E=1)", "E=1", "material 'n' has no viscosity"),
    ],
)
def test_viscosities_that_cannot_change_are_named(run_interpreted, line, word, said):
    other = "    material(n, neo-hookean, 1000, 1e6, 0.4)\n    "
    err = run_interpreted(VISCOUS + other + line + "\n", status=1).err
    assert said in re.sub(r"\n +.*", "", err) and word in err


def test_numbers_from_which_points_began_cannot_change(run_interpreted):
    script = BLOCK.replace(
        "material(m, eos-strength, e, s)", "material(m, cam-clay, 1800, 4e6, 1.0, 0.1, 0.02, 1e5)"
    )
    said = run_interpreted(script + "    modify(material, m, pc=2e5)\n", status=1).err
    assert "the initial state of the points of material 'm' depends on pc" in said
    run_interpreted(
        script.replace("    solid", "    modify(material, m, pc=2e5)\n    solid") + "    run(1)\n"
    )


@pytest.mark.full
@pytest.mark.parametrize(("F", "stands"), [(1.35, True), (1.45, False)])
def test_factor_of_safety(run_script, F, stands):
    """The slope of docs/howto: 1.380 (Bishop & Morgenstern 1960), 1.4 (Griffiths & Lane 1999)."""
    from test_howto import SCRIPTS

    (script,) = (body for page, body in SCRIPTS if page.stem == "safety-factor")
    log = run_script(script, "-var", "F", str(F), "-var", "N", "80").log
    assert (log.Time[-1] == 15) == stands
    if stands:
        assert np.diff(log.sunk)[-1] < 0.01 * (log.sunk[-1] - log.sunk[5])


def test_contact_of_hertz_follows_the_moduli(run_interpreted):
    """1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2 (Hertz 1882) with the moduli of each run."""
    steps = "set_dt(1e-6)", "run(1)", "modify(material, m, E=1e3)", "run(1)"
    lines = "log_modify(custom, step, c_x)", "set_output(1)", *steps
    log = run_interpreted(bodies(-0.01, "contact/hertz, a, b", *lines, d=2, n=2, v=0)).log
    force = dict(zip(log.Step, log.c_x, strict=True))
    assert force[1] < 0
    assert force[2] == pytest.approx(10 * force[1], rel=1e-6)  # the bodies are at rest
