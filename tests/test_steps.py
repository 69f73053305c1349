"""Time steps: the stable step, fixed steps, exact ends of runs, runs that follow each other."""

import re
from math import sqrt

import numpy as np
import pytest
from scenes import SCHEMES, block
from selection import parameters

from karamelo_py.kernels.arrays import TIME, TIMESTEP, new_control
from karamelo_py.kernels.clock import choose_dt, finish

# E 100, nu 0.3, rho 2: lambda + 2 G = E (1 - nu) / ((1 + nu)(1 - 2 nu))
SPEED = sqrt(100 * 0.7 / (1.3 * 0.4) / 2)
H = 0.1
LOG = "log_modify(custom, step, dt, time)"


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("law", ["linear", "neo-hookean"])
@pytest.mark.parametrize("factor", [0.9, 0.5])
def test_first_step_follows_the_fastest_point(run_interpreted, d, law, factor):
    """dt = f h / (c + max |v_i|) with c = sqrt((lambda + 2 G) / rho) (reference, 3.7)."""
    velocity = ", ".join(["-2", "3*x0/x0", "1"][:d])
    start = f"fix(v, initial_velocity_particles, all, {velocity})"
    lines = [f"dt_factor({factor})", start, LOG, "run(1)"]
    log = run_interpreted(block(d, *lines, law=law, ppc=1)).log
    fastest = 2 if d == 1 else 3
    assert log.dt[0] == pytest.approx(factor * H / (SPEED + fastest), rel=1e-9)
    assert log.Time[1] == pytest.approx(log.dt[0], rel=1e-9)


@pytest.mark.parametrize("basis", ["linear", "quadratic-spline", "cubic-spline"])
@pytest.mark.parametrize("factor", [0.9, 1.1])
def test_a_body_at_rest_steps_at_its_wave_speed(run_interpreted, basis, factor):
    """A dt_factor is a share of h/c (as Karamelo has it) whatever the basis.

    Warnings begin above h/c, with cubic splines above 1.4 h/c, as the program's own step does.
    The program's own step at rest is 0.9 of 1.25 h/c with quadratic splines, of 1.4 with cubic
    ones (docs/studies.md): the banner says so.
    """
    script = block(2, f"dt_factor({factor})", LOG, "run(3)", ppc=1)
    result = run_interpreted(script.replace("FLIP, linear", f"FLIP, {basis}"))
    step = H / SPEED
    assert result.log.dt == pytest.approx(np.full(4, factor * step), rel=1e-9)
    warned = f"time step {factor * step:.4g} of dt_factor is above the stability limit {step:.4g}"
    warns = factor > 1 and basis != "cubic-spline"
    assert (warned in result.err) == warns == ("stability limit" in result.err)
    follows = (
        "the run may become unstable" if basis == "linear" else "up to {:.4g} is stable at rest"
    )
    assert (follows.format(1.25 * step) in result.err) == warns
    own = {"linear": 0.9, "quadratic-spline": 0.9 * 1.25, "cubic-spline": 0.9 * 1.4}[basis]
    said = re.search(r"^  own dt +([\d.e-]+)", result.out, re.M)
    assert float(said[1]) == pytest.approx(own * step, rel=1e-5)


def test_what_a_hint_recommends_is_not_warned_of(run_interpreted):
    """Of cubic splines the program bears 1.4 h/c in moving bodies, and so it judges `set_dt`."""
    asked, step = re.compile(r"fix: set_dt\((\S+)\)"), H / SPEED
    scene = block(2, f"set_dt({1.45 * step})", LOG, "run(1)")
    scene = scene.replace("FLIP, linear", "FLIP, cubic-spline")
    said = run_interpreted(scene).err
    assert f"is above the stability limit {1.4 * step:.4g}" in said
    recommended = scene.replace(f"set_dt({1.45 * step})", f"set_dt({asked.search(said)[1]})")
    result = run_interpreted(recommended)
    share = re.search(r"set_dt; (\S+) of the stable step", result.out)
    assert not result.err and float(share[1]) == pytest.approx(0.9, rel=5e-3)  # of three digits


def test_a_later_step_of_the_script_is_named_as_it_is_taken(run_interpreted):
    """While points are at rest, and after a run with the program's own step, which is longer."""
    lines = [LOG, "run(1)", "dt_factor(1.1)", "run(2)"]
    result = run_interpreted(block(2, *lines, transfer="FLIP quadratic", ppc=1))
    step = H / SPEED
    assert result.log.dt[[0, -1]] == pytest.approx([0.9 * 1.25 * step, 1.1 * step], rel=1e-6)
    assert f"time step {1.1 * step:.4g} of dt_factor is above the stability limit {step:.4g}" in (
        result.err
    )
    assert "dt_factor(0.9) or less" in result.err


@pytest.mark.parametrize(
    "scheme, transfer, ppc, still, share",
    [
        ("musl", "FLIP", 2, 0.9, 0.4),
        ("musl", "FLIP", 1, 0.9, 0.2),
        ("usf", "FLIP", 2, 0.9, 0.4),
        ("usf", "FLIP quadratic", 1, 0.9 * 1.25, 0.6),
        ("usavg", "FLIP", 2, 0.9, 0.9),
        ("usavg", "FLIP", 1, 0.9, 0.5),
        ("musl", "FLIP quadratic", 1, 0.9 * 1.25, 0.9),
        ("musl", "FLIP 0.9", 2, 0.9, 0.9),
        ("musl", "PIC", 1, 0.9, 0.9),
        ("musl", "APIC", 2, 0.9, 0.9),
    ],
)
def test_the_programs_own_step(run_interpreted, scheme, transfer, ppc, still, share):
    """Where gradients jump, points keep their velocities and no dt_factor is given, it is smaller.

    The shares are those of docs/energy.md, whose table shows that bodies keep their energy by them.
    At rest it is that of the highest frequency (docs/studies.md).
    """
    words = {"scheme": scheme, "transfer": transfer, "ppc": ppc}
    log = run_interpreted(block(2, LOG, "run(1)", **words), folder="still").log
    assert log.dt[0] == pytest.approx(still * H / SPEED, rel=1e-9)
    v = 0.01 * SPEED
    start = f"fix(v, initial_velocity_particles, all, {v!r}, NULL)"
    log = run_interpreted(block(2, start, LOG, "run(1)", **words), folder="moving").log
    assert log.dt[0] == pytest.approx(share * H / (SPEED + v), rel=1e-9)


@pytest.mark.parametrize(
    "transfer, still, share",
    parameters([("FLIP", 0.9, 0.4), ("FLIP quadratic", 1.125, 0.9)], [("APIC", 0.9, 0.9)]),
)
def test_the_step_of_rest_ends_with_a_quarter_of_a_cell(run_interpreted, transfer, still, share):
    """Also where a second run begins on the way, and where the scene is made anew for it."""
    v = 0.0022 * SPEED
    start = f"fix(v, initial_velocity_particles, all, {v!r}, NULL)"
    lines = [start, LOG, "run(30)", "compute(Ek, kinetic_energy, all)", "run(110)"]
    log = run_interpreted(block(2, *lines, transfer=transfer, size=(0.1, 0.1))).log
    dt = np.where(v * log.Time < 0.25 * H, still, share) * H / (SPEED + v)
    assert np.abs(log.dt / dt - 1).max() < 1e-6
    assert (log.dt[-1] < log.dt[0]) == (share < still)


def test_set_dt(run_interpreted):
    log = run_interpreted(block(1, "set_dt(0.003)", LOG, "run(4)")).log
    assert log.Time == pytest.approx([0, 0.003, 0.006, 0.009, 0.012], rel=1e-9)
    assert (log.Step == range(5)).all()


def test_the_program_chooses_the_step_again_after_set_dt(run_interpreted):
    fixed = ("set_dt(0.003)", LOG, "run(2)", "set_dt(NULL)", "run(2)")
    log = run_interpreted(block(1, *fixed)).log
    own = run_interpreted(block(1, LOG, "run(1)")).log.dt[0]
    assert log.dt == pytest.approx([0.003, 0.003, 0.003, own, own], rel=1e-6)


def test_set_dt_after_a_run_does_not_warn_of_the_factor_of_that_run(run_interpreted):
    factor, fixed = "dt_factor(0.5)", ("set_dt(0.003)", "run(1)")
    assert "has no effect" in run_interpreted(block(1, factor, *fixed)).err
    assert "has no effect" not in run_interpreted(block(1, factor, "run(1)", *fixed)).err


def test_as_many_steps_as_fit():
    """17500 additions of 2e-4 are not quite 3.5; there is no step more for that."""
    control = new_control(np.zeros(3))
    step = control.step[0]
    step.fixed_dt, step.end_time = 2e-4, 3.5
    choose_dt(control)
    while control.values[TIME] < 3.5:
        finish(control)
    assert control.values[TIMESTEP] == 17500
    assert control.values[TIME] == 3.5


@pytest.mark.parametrize("time", ["0.0471", "1e-7", "PI/50"])
def test_run_time_ends_exactly(run_interpreted, time):
    """The last steps are shortened, for any magnitude of the time."""
    script = block(1, "set_dt(0.01)", "log_modify(custom, step, time, dt, time - (" + time + "))",
                   f"run_time({time})")  # fmt: skip
    log = run_interpreted(script).log
    rest = list(log.values())[-1]
    assert rest[-1] == 0


def test_the_last_two_steps_are_shortened_alike(run_interpreted):
    log = run_interpreted(block(1, "set_dt(0.01)", "set_output(1)", LOG, "run_time(0.0302)")).log
    assert np.diff(log.Time) == pytest.approx([0.01, 0.01, 0.0051, 0.0051], rel=1e-9)


def test_the_last_reaction_of_a_run(run_interpreted):
    """A piston that presses a bar: its load goes on evenly to the end of the run.

    Nodes at rest or driven take the momentum that points map to them, in every step the same; over
    a last step of a fiftieth of dt that would be a force fifty times as large.
    """
    script = """
        method(ulmpm, FLIP, linear, 0.9)
        dimension(1, 0, 1.2, 0.2)
        region(bar, block, 0, 1)
        material(m, neo-hookean, 1, 100, 0)
        solid(bar, region, bar, 2, m, 0.2, 0)
        region(low, block, 0, 0)
        region(top, block, 1, 1)
        group(low, nodes, region, low, all)
        group(top, nodes, region, top, all)
        fix(hold, velocity_nodes, low, 0)
        fix(press, velocity_nodes, top, -0.01*min(time/0.5, 1))
        log_modify(custom, step, time, press_x, hold_x)
        set_output(1)
        set_dt(0.008)
        run_time(1.20016)
    """
    log = run_interpreted(script).log
    for reaction in (log.press_x, log.hold_x):
        steps = np.abs(np.diff(reaction))
        assert steps[-1] < 3 * steps[-30:-3].max()


@pytest.mark.parametrize("dt", [0.1, 0.01, 1 / 3])
def test_whole_numbers_of_steps_get_no_extra_step(run_interpreted, dt):
    """30 additions of dt need not make 30 dt; the rounding is not a step of its own."""
    script = block(1, f"set_dt({dt!r}/1000)", LOG, f"run_time({dt!r}*30/1000)")
    log = run_interpreted(script).log
    assert log.Step[-1] == 30
    assert log.dt[-2] == pytest.approx(dt / 1000, rel=1e-6)


def test_runs_follow_each_other(run_interpreted):
    """Steps and time go on; the log keeps its rhythm, with the ends of the runs beside it."""
    script = block(1, "set_dt(0.001)", "set_output(7)", LOG, "run(18)", "run(10)",
                   "run_time(0.0045)", "run(0)")  # fmt: skip
    log = run_interpreted(script).log
    assert list(log.Step) == [0, 7, 14, 18, 21, 28, 33]
    assert log.Time[-1] == pytest.approx(0.0325, rel=1e-9)


def test_a_scheme_brings_its_stable_step(run_interpreted):
    """usl with two points per cell takes 0.65 of the steps of the others."""
    lines = ["dt_factor(0.9)", "set_output(1)", LOG, "run(1)", "scheme(usl)", "run(1)"]
    log = run_interpreted(block(1, *lines)).log
    assert log.dt[-1] == pytest.approx(0.65 * log.dt[0], rel=1e-3)


def test_conditions(run_interpreted):
    """run_until and run_while look before every step."""
    script = block(1, "set_dt(0.001)", "set_output(100)", LOG, "run_until(timestep >= 5)",
                   "run_while(time < 0.0075)", "run_while(timestep < 3)")  # fmt: skip
    log = run_interpreted(script).log
    assert list(log.Step) == [0, 5, 8]


@pytest.mark.parametrize(
    ("run", "says"),
    [
        (
            "run_until(Ek)",
            "the condition holds before the first step of this run, which has no steps",
        ),
        ("run_while(Ek < 1e-9)", "the condition does not hold before the first step"),
        ("run_while(Ek > 1 && timestep < 2)\nrun_until(timestep > 3)", ""),
    ],
)
def test_a_condition_that_ends_a_run_at_once_is_told(run_interpreted, run, says):
    """Ek = 0.5 * 2 * 0.3 * 2**2 = 1.2 at first."""
    lines = ["compute(Ek, kinetic_energy, all)", "fix(v, initial_velocity_particles, all, 2)"]
    err = run_interpreted(block(1, *lines, "set_dt(0.001)", run)).err
    assert says in err and ("first step" in err) == bool(says)


@pytest.mark.parametrize("run", ["run_while(0*w >= 0)", "run_until(w < -1)"])
def test_a_condition_that_nobody_can_tell(run_interpreted, run):
    """The root of a number below 0 from step 3 on: neither true nor false."""
    script = block(1, "set_dt(0.001)", LOG, "w = sqrt(0.0025 - time)", run)
    result = run_interpreted(script, status=1)
    assert "step 3: the run condition is not a number" in result.err
    assert result.log.Step[-1] == 3


def test_the_step_follows_a_body_that_gets_faster(run_interpreted):
    """A body force g speeds the body up: dt = 0.9 h / (c + v), with c as it was (no strain).

    v = g t, where the time goes to the middle of the last step and starts half a step before 0.
    """
    script = block(1, "dt_factor(0.9)", "fix(g, body_force, all, 50)", LOG, "run(5)", size=(0.2,))
    log = run_interpreted(script).log
    middle = log.Time[1:] + (log.dt[0] - log.dt[:-1]) / 2
    expected = 0.9 * H / (SPEED + 50 * np.array([0, *middle]))
    assert log.dt == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("scheme", SCHEMES)
def test_half_of_the_first_step(run_interpreted, scheme):
    """A thrown body: x = x0 + v t - g t^2/2 and v - g t (Galilei), exact with any steps.

    A second run and one from a file do not begin again. With a full start it is g dt t/2 further.
    """
    text = block(1, "fix(g, body_force, all, -3)", "fix(v, initial_velocity_particles, all, 0.5)",
                 "compute(x, center_of_mass, all)", "compute(v, average_velocity, all)",
                 "compute(Ek, kinetic_energy, all)",
                 "log_modify(custom, step, time, x_x, v_x, Ek)", "set_output(5)",
                 "set_dt(0.004)", "restart(5, r.*.h5)", "run(5)", "set_dt(0.001)", "run(10)",
                 scheme=scheme)  # fmt: skip
    half = text.replace(f"scheme({scheme})", f"scheme({scheme}, start=half)")
    whole = run_interpreted(half, folder="run").log
    continued = run_interpreted(half, "-restart", "r.10.h5", folder="run").log
    for log in (whole, continued):
        t = log.Time
        assert t[-1] == pytest.approx(0.03)
        assert log.x_x == pytest.approx(0.45 + 0.5 * t - 1.5 * t**2, abs=1e-12)
        assert log.v_x == pytest.approx(0.5 - 3 * t, abs=1e-12)
        assert log.Ek == pytest.approx(0.5 * 2 * 0.3 * log.v_x**2, rel=1e-9)
    log = run_interpreted(text, folder="full").log
    t = log.Time[:2]
    assert log.x_x[:2] == pytest.approx(0.45 + 0.5 * t - 1.5 * t**2 - 1.5 * 0.004 * t, abs=1e-12)


def test_energies_of_one_time(run_interpreted):
    """A vibrating bar: kinetic and stored energy that are shown add up, to second order in dt.

    With a full start they are half a step apart: 13 % of their sum here, instead of 1.8 and 0.7 %.
    """

    def swing(dt, start):
        text = block(1, "fix(v, initial_velocity_particles, all, 0.1*cos(PI*(x0 - 0.3)/0.6))",
                     "compute(Ek, kinetic_energy, all)", "compute(Es, strain_energy, all)",
                     "E = Ek + Es", "log_modify(custom, step, time, E)", "set_output(1)",
                     f"set_dt({dt})", "run_time(0.1)", scheme=f"musl{start}",
                     size=(0.6,))  # fmt: skip
        E = run_interpreted(text.replace("ulmpm", "tlmpm")).log.E
        return np.ptp(E) / E.mean()

    first, second = swing(0.003, ", start=half"), swing(0.0015, ", start=half")
    assert first < 0.2 * swing(0.003, "") and second < 0.4 * first


def test_a_half_start_shows_no_more_than_the_speed_at_a_wall(run_interpreted):
    """A free point keeps its kinetic energy 1/2 m v^2 where the edge of the domain reflects it."""
    text = block(1, "boundary(reflect)", "fix(v, initial_velocity_particles, all, 1)",
                 "compute(Ek, kinetic_energy, all)", "log_modify(custom, step, Ek)",
                 "set_output(1)", "set_dt(0.05)", "run(20)", scheme="musl, start=half", ppc=1,
                 size=(0.1,))  # fmt: skip
    done = run_interpreted(text)
    assert len(done.log.Ek) > 20 and pytest.approx(0.5 * 2 * 0.1) == done.log.Ek


def test_where_there_is_no_half_start(run_interpreted):
    said = run_interpreted(block(1, "run(1)", scheme="newmark, start=half"), status=1).err
    assert "start is for explicit schemes" in said
