"""Energy that points lose in the transfer of velocity, against the conservation of energy."""

import json
import re

import pytest

# Short and long waves in a bar without loads.
BAR = """
method({})
scheme({})
dimension(1, 0, 20, 1)
region(bar, block, 4, 12)
material(rubber, neo-hookean, 1, 1, 0)
solid(bar, region, bar, 2, rubber, 1)
fix(v, initial_velocity_particles, all, 0.05*sin(x))
compute(L, transfer_loss, all)
set_dt(0.1)
set_output(60)
log_modify(custom, step, L)
run(60)
"""


@pytest.mark.parametrize(
    ("method", "scheme"),
    [
        ("tlmpm, FLIP, linear, 0.9", "musl"),
        ("ulmpm, FLIP, quadratic-spline, 0.9", "usavg"),
        ("tlmpm, PIC, linear", "usf"),
        ("tlmpm, FLIP, linear, 1", "usl"),
        ("ulmpm, APIC, quadratic-spline", "usl"),
        ("ulmpm, AFLIP, linear, 0.9", "musl"),
        ("tlmpm, PolyPIC, linear", "musl"),
        ("tlmpm, XPIC, linear, 2", "musl"),
    ],
)
def test_the_balance_closes_with_the_loss(run_interpreted, method, scheme):
    """Without loads the energy is constant, up to the error of steps of w dt = 0.1."""
    result = run_interpreted(BAR.format(method, scheme))
    (change,) = re.findall(r"  energy +(\S+) % of the largest", result.out)
    (lost,) = re.findall(r"  lost by transfer +(\S+) % of the largest, by", result.out)
    assert abs(float(change)) < 0.15 and abs(float(lost)) > 0.2
    record = json.loads((result.folder / "run.json").read_text("utf-8"))["runs"][-1]
    assert record["lost_by_transfer"] == pytest.approx(result.log.L[-1])


@pytest.mark.parametrize(
    ("method", "scheme"),
    [
        ("tlmpm, FLIP, linear, 0.9", "musl"),
        ("ulmpm, APIC, quadratic-spline", "musl"),
        ("ulmpm, PolyPIC/quadratic, cubic-spline", "musl"),
        ("tlmpm, FLIP, linear, 1", "usl"),
        ("ulmpm, APIC, quadratic-spline", "usl"),
    ],
)
def test_the_balance_of_torsion_closes_with_the_loss(run_script, method, scheme):
    """Waves of torsion in a free round bar, as above."""
    text = BAR.format(method, scheme).replace("(1, 0, 20, 1)", "(2, 0, 5, 0, 8, 1)")
    text = text.replace("region(bar, block, 4, 12)", "region(bar, block, 0, 2, 2, 6)")
    text = text.replace("region(", "axisymmetric(true, twist=true)\nregion(", 1)
    text = text.replace("0.05*sin(x)", "0, 0, 0.05*x*sin(y)")
    result = run_script(text)
    (change,) = re.findall(r"  energy +(\S+) % of the largest", result.out)
    (lost,) = re.findall(r"  lost by transfer +(\S+) % of the largest, by", result.out)
    assert abs(float(change)) < 0.15 and abs(float(lost)) > 2


@pytest.mark.parametrize(
    ("method", "scheme", "words"),
    [("tlmpm, XPIC, linear, 2", "usl", "scheme usl"), ("tlmpm, FLIP, linear, 1", "newmark", "")],
)
def test_what_cannot_be_counted_is_refused(run_interpreted, method, scheme, words):
    said = run_interpreted(BAR.format(method, scheme), status=1).err
    assert re.search(rf"compute transfer_loss does not support .*{words}", said)


LED = """
region(end, block, 11, 12)
group(end, particles, region, end, solid, bar)
fix(led, velocity_particles, end, 0.02*cos(time))
"""


def test_steps_of_usl_with_prescribed_points_are_counted_as_musl(run_interpreted):
    """Steps are those of musl then, and FLIP 1 loses nothing."""
    script = BAR.format("tlmpm, FLIP, linear, 1", "usl").replace("compute(", LED + "compute(", 1)
    result = run_interpreted(script)
    assert abs(result.log.L[-1]) < 1e-12
    (change,) = re.findall(r"  energy +(\S+) % of the largest", result.out)
    assert abs(float(change)) < 0.15


def test_the_loss_goes_on_in_another_scheme(run_interpreted):
    """FLIP 1 with musl loses nothing, so the loss is the one of the steps of usl."""
    script = BAR.format("tlmpm, FLIP, linear, 1", "usl") + "scheme(musl)\nrun(60)\n"
    log = run_interpreted(script).log
    first, last = (log.L[list(log.Step).index(step)] for step in (60, 120))
    assert last == pytest.approx(first) and first > 1e-4


@pytest.mark.parametrize("scheme", ["usl", "usf"])
def test_few_points_that_touch(run_interpreted, scheme):
    """So few scatter directly to the nodal sums, in the pass that counts the loss."""
    touch = """
region(other, block, 13, 15)
solid(other, region, other, 2, rubber, 1)
group(other, particles, region, other, solid, other)
fix(w, initial_velocity_particles, other, -0.2)
fix(c, contact/friction, bar, other, 0.3)
"""
    script = BAR.format("ulmpm/contacts, FLIP, linear, 1", scheme)
    result = run_interpreted(script.replace("compute(", touch + "compute(", 1))
    (change,) = re.findall(r"  energy +(\S+) % of the largest", result.out)
    assert abs(float(change)) < 0.15
