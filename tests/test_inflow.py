"""Material that enters and leaves: mass, momentum and ids of layers."""

import numpy as np
import pytest

JET = """
method(ulmpm, FLIP, {basis}, 1)
dimension(2, 0, 1, 0, 0.6, 0.125)
region(nozzle, block, 0, 0.25, {box})
eos(water, fluid, 1024, 1e4, 7)
strength(water, fluid, 0.001)
material(water, eos-strength, water, water)
solid(jet, region, nozzle, 2, water, 0.125)
fix(feed, inflow, jet, 2, 0, until={until})
region(drain, block, 0.5, INF, INF, INF)
fix(out, outflow, all, drain, every=1)
compute(p, linear_momentum, all)
log_modify(custom, step, time, feed_points, feed_mass, out_mass, p_x)
dump(d, all, particle, 20, d.*.LAMMPS, id, x, y, vx, mass)
set_output(1)
{more}run_time(0.25)
"""
USUAL = {"basis": "linear", "box": "0.25, 0.375", "until": 1, "more": ""}


def jet(**changes):
    return JET.format(**USUAL | changes)


@pytest.mark.parametrize("basis", ["linear", "quadratic-spline"])
def test_a_jet_brings_its_mass_and_momentum(run_interpreted, basis):
    """Mass rho A v t of whole layers, to the last digit; a free jet has the momentum m v."""
    result = run_interpreted(jet(basis=basis))
    log = result.log
    layers = np.floor(log["Time"] / (0.0625 / 2) + 1e-9)
    assert (log["feed_mass"] == 1024 * 0.125 * 0.0625 * layers).all() and layers[-1] == 8
    assert (log["feed_points"] == 2 * layers).all()
    there = 1024 * 0.125 * 0.25 + log["feed_mass"] - log["out_mass"]
    assert log["p_x"] == pytest.approx(2 * there, rel=1e-12)
    assert log["out_mass"][-1] == 1024 * 0.125 * 0.25
    assert "spurious" not in result.err
    last = result.snapshots("d")[-1]
    # Earlier ids are further ahead, in layers half a cell long.
    later = last["id"] > 8
    assert (np.diff(last["x"][later]) <= 1e-12).all()
    assert np.diff(np.unique(np.round(last["x"], 9))) == pytest.approx(0.0625)


def test_a_slug_is_repeated_as_it_is(run_interpreted):
    """A triangle is the train of its layers: its mean mass flow."""
    wedge = ("region(box, block, 0, 0.25, 0.125, 0.5)\nregion(cut, plane, 0, 0.125, -1, 1)\n"
             "region(nozzle, intersection, box, cut)")  # fmt: skip
    text = jet().replace("region(nozzle, block, 0, 0.25, 0.25, 0.375)", wedge)
    log = run_interpreted(text).log
    # Four layers of 6, 5, 4 and 3 points, twice; the last one at the inlet first.
    assert log["feed_points"].max() == 2 * (6 + 5 + 4 + 3)
    assert log["feed_points"][np.searchsorted(log["Time"], 0.04)] in (3, 4)


@pytest.mark.parametrize(
    "old, new, says",
    [
        ("jet, 2, 0,", "jet, 2, 1,", "2 components of the velocity are not 0"),
        ("jet, 2, 0,", "jet, 0, 0,", "0 components of the velocity are not 0"),
        ("until=1", "until=0.01", "no layer enters by then"),
        ("jet, 2, 0,", "jet, 2,", "1 component in 2 dimensions"),
        ("fix(feed", "solid(other, region, nozzle, 2, water, 0.125)\nfix(feed",
         "would put points into other material"),
        ("fix(feed", "group(g, particles, region, nozzle, all)\nfix(feed", "group 'g' was"),
        ("fix(feed", "run(1)\nfix(feed", "have been in a run"),
        ("ulmpm,", "tlmpm,", "inflow"),
        ("2, water, 0.125)", "3, water, 0.125, points=gauss)", "not in equally spaced layers"),
    ],
)  # fmt: skip
def test_what_is_refused(run_interpreted, old, new, says):
    result = run_interpreted(jet().replace(old, new, 1), status=1)
    assert says in result.err and "in.script:" in result.err


def test_a_body_in_the_inlet_stops_the_run(run_interpreted):
    body = "solid(b, region, nozzle, 2, water, 0.125)\n"
    result = run_interpreted(jet(more=body), status=1)
    assert "of solid 'b' is in the inlet" in result.err
