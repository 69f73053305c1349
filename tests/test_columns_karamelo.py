"""Columns of Karamelo with their values: the rate of plastic strain, and those of nodes."""

from types import SimpleNamespace

import numpy as np
import pytest
from scenes import block

from karamelo_py.styles.fixes.forces import accelerate

SHEAR = """
eos(bulk, linear, 2, 100)
strength(soft, plastic, 40, 1)
material(clay, eos-strength, bulk, soft)
solid(clay, region, box, 2, clay, 0.1)
group(all_nodes, nodes, region, everywhere, all)
fix(pull, velocity_nodes, all_nodes, 0.5*x0, 0)
dump(d, all, particle, 1, d.*.LAMMPS, x, ep{})
set_dt(0.004)
run(15)
{}
"""


def sheared(columns, more=""):
    text = block(2, "region(everywhere, block, INF, INF, INF, INF)")
    return text.replace("solid(body, region, box, 2, rubber, 0.1, 0)", "") + SHEAR.format(
        columns, more
    )


def test_rate_of_plastic_strain_is_smoothed(run_interpreted):
    """rate += (d ep - rate dt)/tau with tau = 1000 h/c, as Karamelo has it, and nothing before."""
    result = run_interpreted(sheared(", epdot"))
    tau = 1000 * 0.1 / np.sqrt((100 + 4 / 3 * 40) / 2)
    ep, rate = np.array([
        [result.dump(f"d.{k}.LAMMPS")[name][0] for k in range(16)] for name in ("ep", "epdot")
    ])  # fmt: skip
    assert ep[-1] > 0.005
    expected = [0.0]
    for change in np.diff(ep):
        expected.append(expected[-1] + (change - 0.004 * expected[-1]) / tau)
    assert rate == pytest.approx(np.array(expected), rel=1e-3, abs=1e-6)


def test_the_rate_may_come_with_a_later_run(run_interpreted):
    """Points keep more from then on, and go on from where they were."""
    more = "dump(r, all, particle, 1, r.*.LAMMPS, x, ep, epdot)\nrun(5)"
    result = run_interpreted(sheared("", more))
    first, last = result.dump("d.15.LAMMPS"), result.dump("r.20.LAMMPS")
    assert (last.ep > first.ep).all()
    # What had flown before does not count: the rate is that of the last steps.
    tau = 1000 * 0.1 / np.sqrt((100 + 4 / 3 * 40) / 2)
    assert (last.epdot > 0).all()
    assert (last.epdot <= 1.01 * (last.ep - first.ep) / tau).all()
    plain = run_interpreted(sheared("", "run(5)"), folder="plain")
    assert plain.dump("d.20.LAMMPS").ep.tolist() == last.ep.tolist()


def nodes(run_interpreted, *lines, method="ulmpm, FLIP, linear, 1", columns=""):
    names = f"x, y, mass, vol, mask, rigid, bx, by, ntypex, ntypey{columns}"
    text = block(2, *lines, f"dump(g, all, grid, 1, g.*.LAMMPS, {names})", "set_dt(1e-4)", "run(1)")
    return run_interpreted(text.replace("ulmpm, FLIP, linear, 1", method))


def test_volume_mask_and_loads_of_nodes(run_interpreted):
    result = nodes(
        run_interpreted,
        "region(left, block, 0.3, 0.3, INF, INF)",
        "group(points, particles, region, left, all)",
        "group(left, nodes, region, left, all)",
        "fix(weight, body_force, all, NULL, -9.81)",
        "fix(pull, edge_traction, all, box, xhi, 3, 0)",
        "fix(push, force_nodes, left, 0, 5)",
    )
    assert "will be 0" not in result.err
    g = result.dump("g.0.LAMMPS")
    g = result.dump("g.1.LAMMPS")
    assert g.vol == pytest.approx(g.mass / 2, rel=1e-4, abs=1e-9)
    assert g.vol.sum() == pytest.approx(0.06, rel=1e-4)
    left = np.abs(g.x - 0.3) < 1e-9
    # The second group of the script; the first one is of points.
    assert g["mask"].tolist() == (1 + 4.0 * left).tolist()
    assert not g.rigid.any()
    assert g.bx.sum() == pytest.approx(3 * 0.2, rel=1e-5)
    heavy = left & (g.mass > 0)
    push = np.where(heavy, 5 / heavy.sum(), 0)
    assert g.by == pytest.approx(-9.81 * g.mass + push, rel=1e-4, abs=1e-6)
    node = SimpleNamespace(mass=2.0, v=0, v_star=0, force=0.0, value=-9.81)
    assert accelerate(node)[2] == -2 * 9.81


def test_nodes_of_rigid_solids(run_interpreted):
    lines = (
        "region(plate, block, 0.3, 0.6, 0.6, 0.7)",
        "material(plate, rigid, 1000)",
        "solid(plate, region, plate, 2, plate, 0.1)",
    )
    g = nodes(run_interpreted, *lines).dump("g.1.LAMMPS")
    inside = (g.x > 0.25) & (g.x < 0.65) & (g.y > 0.55) & (g.y < 0.75)
    assert g.rigid.tolist() == (1.0 * inside).tolist()


@pytest.mark.parametrize("basis", ["quadratic-spline", "cubic-spline", "Bernstein-quadratic"])
def test_types_of_nodes(run_interpreted, basis):
    """Karamelo: min(2, i) - min(2, n - 1 - i) of splines; Bernstein's middles are odd."""
    kind = "tlmpm" if basis.startswith("B") else "ulmpm"
    g = nodes(run_interpreted, method=f"{kind}, FLIP, {basis}, 1").dump("g.1.LAMMPS")
    along = g.x[g.y == g.y[0]]
    found = g.ntypex[g.y == g.y[0]]
    n, i = len(along), np.arange(len(along))
    expected = i % 2 if kind == "tlmpm" else np.minimum(2, i) - np.minimum(2, n - 1 - i)
    assert found.tolist() == expected.tolist()
