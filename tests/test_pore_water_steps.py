"""Water in the pores in load steps (u-p), against exact solutions."""

from math import cos, pi, radians

import numpy as np
import pytest
from conftest import INPUTS

from comparisons.results import read_dump

scipy = pytest.importorskip("scipy")
from scipy.integrate import solve_ivp  # noqa: E402
from scipy.optimize import brentq  # noqa: E402
from scipy.special import ellipk  # noqa: E402
from test_pore_water import last, terzaghi  # noqa: E402

pytestmark = pytest.mark.xdist_group("pore water in load steps")
E, N0, K, SLOW = 1e7, 0.4, 2.2e9, 1e-9
COLUMN = """
    N = 16
    method(tlmpm, FLIP, linear, 1)
    scheme(quasi-static)
    dimension(1, 0, 1, 1/N)
    region(layer, block, 0, 1)
    material(clay, {law})
    pore_water(clay, n=0.4, permeability=1e-9{kozeny})
    solid(clay, region, layer, 2, clay, 1/N, 0)
    region(bottom, block, -INF, 1e-6)
    region(top, block, 1 - 1e-6, INF)
    group(bottom, nodes, region, bottom, all)
    group(top, nodes, region, top, all)
    fix(base, velocity_nodes, bottom, 0)
    compute(rho, probe, all, rho)
    compute(s, probe, all, s11)
    compute(p, probe, all, pore_pressure, x=0)
    {fixes}
    set_output(1)
    log_modify(custom, step, time, rho, s, p, {more}, base_x)
    {steps}
"""
LOADED = """fix(load, force_nodes, top, -{0!r})
    fix(drain, pore_pressure, top, 0)
    fix(start, initial_pore_pressure, all, {0!r})"""


def how_to():
    page = (INPUTS.parent / "docs/howto/soil-and-water.md").read_text("utf-8")
    return [part.split("```")[0] for part in page.split("```karamelo\n")[1:]]


def column(fixes, steps, *, law="linear, 1590, 1e7, 0", kozeny="", more="drain_s"):
    """The layer with fixes and `steps`, (duration, count) of load steps or a text."""
    if not isinstance(steps, str):
        steps = "".join(f"set_dt({time / n!r})\n    run({n})\n    " for time, n in steps)
    return COLUMN.format(law=law, kozeny=kozeny, more=more, fixes=fixes, steps=steps)


def test_consolidation_over_years_is_that_of_terzaghi(run_script):
    """Clay of 1e-9 m/s, a year to Tv = 30: 110 steps with errors of the first order in the step."""
    cv = SLOW / 9810 * E * (K / N0) / (E + K / N0)
    parts = [(0.01 / cv, 10), (0.09 / cv, 40), (0.9 / cv, 60)]
    log = run_script(column(LOADED.format(1000.0), parts)).log
    for T, U_within, p_within in ((0.1, 0.003, 0.005), (0.55, 0.005, 0.007), (1.0, 0.005, 0.006)):
        at = np.argmin(abs(log["Time"] * cv - T))
        U, p = terzaghi(log["Time"][at] * cv, 1 - 1 / 64)
        assert abs(-log["s"][at] / 1000 - U) < U_within
        assert abs(log["p"][at] / 1000 - p) < p_within
    assert np.abs(log["base_x"][1:] - 1000).max() < 1e-5
    settled = 1590 / log["rho"][0] - 1590 / log["rho"][-1]
    relieved = N0 * (1000 - 2 / pi * log["p"][-1]) / K
    left = np.sum(np.diff(log["Time"]) * log["drain_s"][1:]) / 1000
    assert abs(left / (settled + relieved) - 1) < 1e-5


def gibson(load, times, cells=100):
    """Settlements of a clay of height 1 (Gibson, England & Hussey 1967), by finite differences.

    In material coordinates, J' = (k(J) / (J gamma) u_a)_a with u = load + s(J), Kozeny's k and
    the effective stress s = E/2 (J - 1/J) of a neo-Hookean skeleton.
    """

    def kozeny(J):
        n = 1 - (1 - N0) / J
        return n**3 / (1 - n) ** 2 / (N0**3 / (1 - N0) ** 2) * SLOW / 9810

    def stress(J):
        return E / 2 * (J - 1 / J)

    end, h = brentq(lambda J: load + stress(J), 0.3, 1), 1 / cells

    def rate(t, J):
        u, flux = load + stress(J), np.zeros(cells + 1)
        mean, top = (J[1:] + J[:-1]) / 2, (J[-1] + end) / 2
        flux[1:-1] = kozeny(mean) / mean * np.diff(u) / h
        flux[-1] = -kozeny(top) / top * u[-1] / (h / 2)
        return np.diff(flux) / h

    run = solve_ivp(rate, (0, times[-1]), np.ones(cells), "BDF", times, rtol=1e-8, atol=1e-10)
    return 1 - run.y.mean(0), 1 - end


def test_large_strains_settle_as_gibson_has_it(run_script):
    """30 % of strain, within 0.2 % of the final settlement: k falls to 5 % where it is dry."""
    cv, load = SLOW * E / 9810, 3.64e6
    parts = [(0.001 / cv, 10), (0.009 / cv, 10), (0.09 / cv, 20), (0.9 / cv, 20)]
    law, kozeny = "neo-hookean, 1590, 1e7, 0", ", kozeny=true"
    log = run_script(column(LOADED.format(load), parts, law=law, kozeny=kozeny)).log
    times = np.array([0.1, 0.55, 1.0]) / cv
    exact, final = gibson(load, times)
    assert abs(final - 0.2998) < 1e-3
    for time, settled in zip(times, exact, strict=True):
        at = np.argmin(abs(log["Time"] - time))
        assert abs(log["Time"][at] / time - 1) < 1e-6
        assert abs(1 - 1590 / log["rho"][at] - settled) < 0.0025 * final


def test_the_head_of_a_permeameter_falls_exponentially(run_script):
    """A standpipe of a tenth of the area: h = h0 exp(-k A t / (a L)); its water flows through."""
    ratio, rate = 0.1, SLOW / 0.1
    fixes = f"""fix(lid, velocity_nodes, all, 0)
    fix(drain, pore_pressure, top, 0)
    fix(pipe, pore_pressure, bottom, 9810*exp(-{rate}*time))"""
    log = run_script(column(fixes, [(1 / rate, 50)], more="drain_s, pipe_s")).log
    t, through = log["Time"], -log["pipe_s"]
    flowed = np.cumsum(through[5:] * np.diff(t)[0]) / 1000 / ratio
    fell = np.exp(-rate * (t[5:] - np.diff(t)[0])) - np.exp(-rate * t[5:])
    assert abs(flowed[-1] / fell.sum() - 1) < 0.015
    assert abs(log["drain_s"][-1] / through[-1] - 1) < 0.01


def mandel(nu, k, force, a, b):
    """Pressure p(x, t), settlements' terms, diffusivity (Mandel 1953; Cheng & Detournay 1988)."""
    G = E / 2 / (1 + nu)
    soil = 2 * G * (1 + nu) / 3 / (1 - 2 * nu)
    whole = soil + K / N0
    B, nuu = K / N0 / whole, (3 * whole - 2 * G) / 2 / (3 * whole + G)
    c = 2 * k / 9810 * B**2 * G * (1 - nu) * (1 + nuu) ** 2 / 9 / (1 - nuu) / (nuu - nu)
    r = (1 - nu) / (nuu - nu)
    ends = [(pi * i + (1e-9 if i else 1e-3), pi * i + pi / 2 - 1e-12) for i in range(40)]
    roots = np.array([brentq(lambda z: np.sin(z) - r * z * np.cos(z), *end) for end in ends])
    A = np.sin(roots) / (roots - np.sin(roots) * np.cos(roots))
    rates = roots**2 * c / a**2
    p0 = force * B * (1 + nuu) / 3 / a
    centre = lambda t: 2 * p0 * np.sum(A * (1 - np.cos(roots)) * np.exp(-rates * t))  # noqa: E731
    terms = b * force * (1 - nuu) / G / a * A * np.cos(roots)
    return centre, -b * force * (1 - nu) / 2 / G / a, terms, rates, c, p0


PLATES = """
dimension(2, 0, 1, 0, 0.5, 1/N)
region(layer, block, 0, 1, 0, 0.5)
material(clay, linear, 1590, 1e7, 0.2)
pore_water(clay, n=0.4, permeability={k})
solid(clay, region, layer, 2, clay, 1/N, 0)
region(bottom, block, -INF, INF, -INF, 1e-6)
region(top, block, -INF, INF, 0.5 - 1e-6, INF)
region(left, block, -INF, 1e-6, -INF, INF)
region(right, block, 1 - 1e-6, INF, -INF, INF)
group(bottom, nodes, region, bottom, all)
group(top, nodes, region, top, all)
group(left, nodes, region, left, all)
group(right, nodes, region, right, all)
fix(base, velocity_nodes, bottom, NULL, 0)
fix(axis, velocity_nodes, left, 0, NULL)
"""


@pytest.mark.parametrize("cells", [8, pytest.param(16, marks=pytest.mark.full)])
def test_the_pressure_rises_first_as_mandel_and_cryer_found(run_script, cells):
    """Between plates, the pressure at the centre rises by 11 % before it falls."""
    centre, settled, terms, rates, c, p0 = mandel(0.2, 1e-8, 1e4, 1.0, 0.5)
    first, now, before = 1e-4 / c, "exp(-{1!r}*time)", "exp(-{1!r}*max(time - dt, 0))"
    sums = [f"({one})*({now} - {before})" for one in ["{0!r}"] * 12]
    pairs = zip(sums, terms.tolist(), rates.tolist(), strict=False)
    plate = " + ".join(text.format(term, rate) for text, term, rate in pairs)
    at_once = settled + terms[:12].sum()
    log = run_script(
        f"""
        N = {cells}
        method(tlmpm, FLIP, linear, 1)
        scheme(quasi-static)
        {PLATES.format(k=1e-8)}
        fix(plate, velocity_nodes, top, NULL, ({plate} + {at_once}*(time < {1.5 * first}))/dt)
        fix(drain, pore_pressure, right, 0)
        compute(centre, probe, all, pore_pressure, x=0, y=0)
        set_output(1)
        log_modify(custom, step, time, centre, plate_y)
        set_dt({first})
        run(1)
        set_dt({0.005 / c})
        run(20)
        """
    ).log
    exact = np.array([centre(t) for t in log["Time"][1:]])
    assert 1.1 < exact.max() / p0 < 1.12
    # Errors of 8 cells and of the steps cancel in part: 0.1 % with 8 cells, 0.3 % with 16.
    assert abs(log["centre"].max() / exact.max() - 1) < 0.004
    assert np.abs(log["centre"][2:] / exact[1:] - 1).max() < 0.006
    assert np.abs(log["plate_y"][2:] / -1e4 - 1).max() < 0.005


@pytest.mark.parametrize("cells", [8, pytest.param(16, marks=pytest.mark.full)])
def test_semi_implicit_steps_have_the_pressure_of_mandel_and_cryer(run_script, cells):
    """From the undrained state on, between plates whose velocity is the exact one."""
    centre, _, terms, rates, c, p0 = mandel(0.2, 1e-3, 1e4, 1.0, 0.5)
    pairs = zip(terms.tolist(), rates.tolist(), strict=True)
    velocity = " + ".join(f"({-t * r!r})*exp(-{r!r}*(time + dt/2))" for t, r in pairs)
    # p0 is the mean effective stress that the soil has lost, and sxx = p0
    G = E / 2.4
    strain = p0 / (K / N0)
    exx = (p0 + E * 0.2 / 1.2 / 0.6 * strain) / 2 / G
    stress = [f"{E * 0.2 / 1.2 / 0.6 * -strain + 2 * G * e!r}" for e in (exx, -strain - exx, 0.0)]
    log = run_script(
        f"""
        N = {cells}
        method(tlmpm, FLIP, linear, 1)
        scheme(semi-implicit)
        {PLATES.format(k=1e-3)}
        fix(plate, velocity_nodes, top, NULL, {velocity})
        fix(drain, pore_pressure, right, 0)
        fix(p, initial_pore_pressure, all, {p0})
        fix(s, initial_stress, all, {", ".join(stress)}, 0, 0, 0)
        compute(centre, probe, all, pore_pressure, x=0, y=0)
        set_output(20)
        log_modify(custom, step, time, centre, plate_y)
        run_time({0.5 / c})
        """
    ).log
    late = log["Time"] * c > 0.05
    exact = np.array([centre(t) for t in log["Time"]])
    assert abs(log["centre"].max() / exact.max() - 1) < (0.01 if cells == 8 else 0.005)
    assert np.abs(log["centre"] - exact)[late].max() < (0.016 if cells == 8 else 0.006) * p0
    assert np.abs(log["plate_y"][late] / -1e4 - 1).max() < 0.009


@pytest.mark.parametrize("refine", [1, pytest.param(4, marks=pytest.mark.full)])
def test_water_seeps_below_a_dam_as_harr_has_it(run_script, refine):
    """q = k h K' / (2 K); the edges of the floor make the order one."""
    m = np.tanh(pi / 4)
    exact = ellipk(1 - m * m) / 2 / ellipk(m * m)
    assert abs(exact - 0.5332) < 1e-4
    result = run_script(INPUTS / "in.seepage", "-var", "refine", str(refine))
    log = last(result)
    assert 0.02 < (log["flux"] / exact - 1) * refine < 0.026
    assert abs(log["drain_s"] / log["lake_s"] + 1) < 1e-7
    points = read_dump(result.folder / "seepage.1.LAMMPS")[-1]
    # By symmetry, half of the head is left at the centre.
    middle = abs(points["x"] - 40) < 1
    head = points["pore_pressure"] / 9810 + points["y"] - 10
    assert abs(head[middle].mean() / 2 - 0.5) < 1e-3


@pytest.mark.parametrize("cells", [10, pytest.param(20, marks=pytest.mark.full)])
def test_a_footing_bears_more_if_water_has_time_to_leave(run_script, cells):
    """Prandtl 1920, undrained: (2 + pi) c cos phi. Drained: with the friction and cohesion of
    Drescher & Detournay (1993) for soil without dilatancy."""
    phi = radians(20)
    slope = np.sin(phi)  # tan of the friction along the slip surfaces
    N_q = np.exp(pi * slope) * np.tan(pi / 4 + np.arctan(slope) / 2) ** 2
    drained = (N_q - 1) / slope * cos(phi)
    assert abs(drained - 13.0) < 0.05
    words = ["-var", "refine", str(cells / 20), "-var", "steps"]
    fast = run_script(INPUTS / "in.wet_footing", *words, "4").log
    assert abs(fast["load"][-1] / ((2 + pi) * cos(phi)) - 1) < 0.05
    slow = run_script(
        INPUTS / "in.wet_footing", *words, "5", "-var", "T", "1e9", "-var", "v", "0.1"
    ).log
    assert abs(slow["load"].max() / drained - 1) < 0.06  # a peak; 3.5 % at the end on 20 cells


def test_a_restart_and_threads_change_no_bit(run_script):
    steps = """set_dt(3e5)
    run(3)
    write_restart(half.h5)
    run(2)
    dump(d, all, particle, 1, d.*.txt, x, wx, s11, pore_pressure)
    run(1)"""
    text = column(LOADED.format(1000.0), steps)
    kept = (run_script(text, folder="run").folder / "d.6.txt").read_text("utf-8")
    again = run_script(text, "-restart", "half.h5", folder="run")
    assert (again.folder / "d.6.txt").read_text("utf-8") == kept
    threads = run_script(text, "--threads", "2", folder="threads")
    assert (threads.folder / "d.6.txt").read_text("utf-8") == kept


def test_water_and_soil_rest_under_gravity(run_script):
    """From nothing: the pressure is hydrostatic, the base carries both weights, in every step."""
    fixes = """fix(weight, body_force, all, -9.81)
    fix(drain, pore_pressure, top, 0)"""
    log = run_script(column(fixes, [(3e10, 3)])).log
    assert abs(log["base_x"][1] / (9.81 * 1990) - 1) < 1e-9
    # The settlement lets water out, 4.8 N in weight.
    assert np.abs(log["base_x"][1:] / (9.81 * 1990) - 1).max() < 3e-4
    assert np.abs(log["p"][1:] / (9810 * (1 - 1 / 64)) - 1).max() < 1e-3


@pytest.mark.parametrize("suction", ["", ", suction=20000"])
def test_total_stress_carries_the_weight_of_soil_and_water(run_script, suction):
    """Of a column that drains at its base, where suction empties some pores (Bishop 1959)."""
    fixes = """fix(weight, body_force, all, -9.81)
    fix(drain, pore_pressure, bottom, 0)
    compute(t, probe, all, t11)
    compute(S, probe, all, saturation)
    compute(water, probe, all, water_content)"""
    log = last(run_script(column(fixes, [(1e12, 2)], kozeny=suction, more="t, S, water")))
    x = (np.arange(1000) + 0.5) / 1000
    S = np.exp(-9810 * x / 20000) if suction else np.ones(1000)
    assert abs(log["base_x"] / (9.81 * (1590 + log["water"])) - 1) < 1e-3
    assert abs(log["t"] / (-9.81 * (1590 / 2 + 400 * np.mean(S * x))) - 1) < 1e-3
    assert abs(log["S"] / np.mean(S) - 1) < 1e-3
    assert abs(log["s"] - log["t"]) > 1000


def test_total_stress_is_the_load_while_water_leaves(run_script):
    log = run_script(
        column(
            LOADED.format(1000) + "\n    compute(t, probe, all, t11)",
            [(1e5, 3)],
            more="t",
        )
    ).log
    assert np.abs(log["t"][1:] / -1000 - 1).max() < 1e-6
    assert abs(log["s"][-1]) > 100


def test_tension_beyond_one_bar_is_doubted(run_script):
    fixes = "fix(up, force_nodes, top, {})"
    for force, count in ((2e5, 1), (5e4, 0)):
        result = run_script(column(fixes.format(force), [(2.0, 2)], more="time"))
        assert result.err.count("in tension beyond 1 bar") == count


@pytest.mark.full
@pytest.mark.parametrize("drained", [False, True])
def test_triaxial_compression_of_cam_clay(run_script, drained):
    """Roscoe & Burland 1968: q = M p at the critical state.

    Undrained p = p0 2^-(1 - kappa/lam); drained q = 3 M p0/(3 - M), and ln(J) of the volume is -lam
    ln(J p/p0) - (lam - kappa) ln(2).
    """
    sides = "left", "front", "bottom", "right", "back", "top"
    lines = []
    for k, side in enumerate(sides):
        block = ["-INF, INF"] * 3
        block[k % 3] = "1, INF" if k > 2 else "-INF, 0"
        lines += [f"region({side}, block, {', '.join(block)})"]
        lines += [f"group({side}, nodes, region, {side}, all)"]
    for k, side in enumerate(sides[:3]):
        v = ", ".join("0" if i == k else "NULL" for i in range(3))
        lines += [f"fix({side}, velocity_nodes, {side}, {v})"]
    steps, each, strain = (40, 1e9, 0.6) if drained else (20, 1, 0.3)
    log = last(
        run_script(
            f"""
            v = {strain / (steps * each)}
            method(tlmpm, FLIP, linear, 1)
            scheme(quasi-static)
            dimension(3, 0, 1, 0, 1, 0, 1, 1)
            region(cube, block, 0, 1, 0, 1, 0, 1)
            material(clay, cam-clay, 1590, 4e6, 1.0, 0.1, 0.02, 1e5)
            pore_water(clay, n=0.4, permeability=1e-9)
            solid(clay, region, cube, 2, clay, 1, 0)
            compute(pores, probe, all, porosity)
            J = 0.6/(1 - pores)
            """
            + "\n".join(lines)
            + f"""
            fix(press, velocity_nodes, top, NULL, NULL, -v)
            # 1e5 Pa on sides of the area sqrt(J height)
            fix(cell_x, force_nodes, right, -1e5*sqrt(J*(1 - v*time)), NULL, NULL)
            fix(cell_y, force_nodes, back, NULL, -1e5*sqrt(J*(1 - v*time)), NULL)
            {"fix(drain, pore_pressure, top, 0)" if drained else ""}
            compute(s, probe, all, s11, s22, s33, pore_pressure)
            q = s_s11 - s_s33
            p = -(s_s11 + s_s22 + s_s33)/3
            log_modify(custom, step, time, q, p, s_pore_pressure, J)
            set_dt({each})
            set_output(1)
            run({steps})
            """
        )
    )
    end = 1.5e5 if drained else 1e5 * 2**-0.8
    assert abs(log["p"] / end - 1) < 5e-4
    assert abs(log["q"] / end - 1) < 5e-4
    if drained:
        ln_J = -(0.1 * np.log(1.5) + 0.08 * np.log(2)) / 1.1
        assert abs(log["J"] / np.exp(ln_J) - 1) < 1e-4
        assert abs(log["s_pore_pressure"]) < 1
    else:
        assert abs(log["s_pore_pressure"] / (1e5 + end / 3 - end) - 1) < 2e-3


def test_rain_seeps_to_a_water_table_as_gardner_has_it(run_script):
    """Steady infiltration (1958): k(p)/k = q/k + (1 - q/k) exp(-rho g x/a)."""
    fixes = """fix(still, velocity_nodes, all, 0)
    fix(weight, body_force, all, -9.81)
    fix(table, pore_pressure, bottom, 0)
    fix(start, initial_pore_pressure, all, -9810*x0)
    fix(rain, flux, top, 3e-10, xhi)
    compute(top, probe, all, pore_pressure, x=1)"""
    log = last(
        run_script(
            column(
                fixes, [(4e6, 4), (1e12, 1)], kozeny=", suction=2000", more="top, rain_s, table_s"
            )
        )
    )
    exact = 2000 * np.log(0.3 + 0.7 * np.exp(-9810 * (1 - 1 / 64) / 2000))
    assert abs(log["top"] / exact - 1) < 1e-3
    assert abs(log["table_s"] / 3e-7 - 1) < 1e-3
    assert abs(log["rain_s"] / -3e-7 - 1) < 1e-12


def test_a_dam_of_earth_lets_through_what_dupuit_found(run_script):
    """k (H1^2 - H2^2)/(2 L), exact for a rectangular dam without suction (Charny 1951)."""
    text = next(block for block in how_to() if "seepage_face" in block)
    excess = [last(run_script(text, "-var", "suction", a))["q"] - 1 for a in ("500", "250")]
    assert 0.02 < excess[0] < 0.025
    assert abs(2 * excess[1] - excess[0]) < 0.001


@pytest.mark.parametrize(
    ("scheme", "words"),
    [
        ("quasi-static, solver=amg", "supports water in pores only with a direct solver"),
        ("newmark", "does not support scheme newmark"),
    ],
)
def test_what_has_no_pore_water_is_refused_by_name(run_interpreted, scheme, words):
    text = column(LOADED.format(1000.0), [(1.0, 1)]).replace("quasi-static", scheme)
    err = run_interpreted(text, status=1).err
    assert words in err
    assert err.count("error:") == 1
