"""Compute force_on: force, torque and point of action, for every way in which a force can act."""

import numpy as np
import pytest

pytestmark = pytest.mark.xdist_group("force on")
BOX = """
    method({method}, APIC, linear)
    dimension(2, 0, 2, 0, 2, 0.1)
    region(box, block, 0.7, 1, 0.6, 0.8)
    region(mate, block, 0.8, 1.1, 0.4, 0.6)
    region(wall, block, 0, 2, 0, 0.61)
    region(half, block, 0, 2, 0, 0.7)
    region(left, block, 0, 0.8, 0, 0.7)
    region(edge, block, 0, 2, 0.55, 0.6)
    material(rubber, linear, 1000, 1e5, 0.3)
    solid(box, region, box, 2, rubber, 0.1)
    {solids}
    group(box, particles, region, box, solid, box)
    group(low, nodes, region, half, all)
    group(left, nodes, region, left, all)
    group(edge, nodes, region, edge, all)
    group(lower, particles, region, half, solid, box)
    fix(g, force_particles, box, 180, -510*x)
    {lines}
    compute(F, force_on, g, {parts})
    compute(p, linear_momentum, box)
    compute(L, angular_momentum, box)
    set_dt(1e-3)
    set_output(1)
    log_modify(custom, step, F_x, F_y, F_tz, p_x, p_y, L_z)
    run(4)
"""
MATE = "solid(mate, region, mate, 2, rubber, 0.1)\ntranslate_particles(mate, region, mate, 0, 0.004)"
LED = "material(steel, rigid, 1000)\n" + MATE.replace("rubber", "steel")
FREE = LED + "\nfix(m, rigid_body, mate, velocity=(0, 1))"
GRID, PLANE = "ulmpm/contacts", "0, 0.61, 0, 0.1, 1, 0"
# For each way its line, and where others than these: the parts, the further solid, the method.
USUAL = "", "w", "", "ulmpm"
WAYS = {
    "wall": ("velocity_nodes, low, NULL, 0",),
    "bound": ("velocity_nodes, low, NULL, geq0.01",),
    "piston": ("velocity_nodes, low, 0.1, 0.2",),
    "rough wall": ("velocity_nodes, low, NULL, 0, mu=0.2",),
    "two walls": ("velocity_nodes, low, NULL, 0.1)\nfix(v, velocity_nodes, left, 0, 0", "w, v"),
    "weight": ("body_force, all, 1, -10*x0",),
    "nodes": ("force_nodes, low, 3, -10",),
    "traction": ("edge_traction, all, box, xlo, 3e3, 1e3*y",),
    "pressure": ("edge_pressure, lower, box, 1e3",),
    "layer": ("neumann_bc_mech, lower, 3, 4*x",),
    "damping": ("local_damping, all, 0.5",),
    "edge": ("absorbing, edge, rubber, ylo",),
    "cutting tool": ("cuttingtool, all, 1, 0.8, 0.7, 0, 0, 0, 0, 0.7, 0.5, 0.9, 0.5",),
    "surface": ("contact/surface, all, wall, 0.2", "box"),
    "plane": (f"contact/minimize_penetration/plane, box, {PLANE}, 0.2", "box"),
    "hard plane": (f"impenetrablesurface, all, 10, {PLANE}", "box"),
    "ball": ("indent, all, sphere, 1e5, 0.25, 0.8, 0.4, 0", "box"),
    "hard ball": (
        "indent/minimize_penetration, all, sphere, 0.22, 0.8, 0.4, 0, 0, 0, 0, 0.1", "box"),
    "points, first": ("contact/minimize_penetration, box, mate, 0.3", "box", MATE, "tlmpm"),
    "points, second": ("contact/minimize_penetration, mate, box, 0.3", "box", MATE, "tlmpm"),
    "Hertz": ("contact/hertz, mate, box", "box", MATE, "tlmpm"),
    "grid": ("contact/friction, mate, box, 0.3", "box", MATE, GRID),
    "pair": ("contact/friction, box, mate, 0.3", "w", MATE, GRID),
    "led tool": ("contact/friction, box, mate, 0.3", "box", LED, GRID),
    "free body": ("contact/friction, box, mate, 0.3", "box", FREE, GRID),
    "surface of a body": ("contact/rigid_body, all, mate, 0.3", "box", FREE),
}  # fmt: skip


@pytest.mark.parametrize("way", WAYS)
def test_the_force_is_the_change_of_momentum(run_interpreted, way):
    """A body takes the momentum and angular momentum that force_on says (APIC keeps both).

    A log has ten digits. In tlmpm weights belong to reference positions, which differ from the
    present ones by the displacement: 4e-6 of an arm.
    """
    line, parts, solids, method = (*WAYS[way], *USUAL[len(WAYS[way]) :])
    lines = f"fix(w, {line})"
    log = run_interpreted(BOX.format(method=method, lines=lines, parts=parts, solids=solids)).log
    force = np.stack([log.F_x, log.F_y, log.F_tz])[:, 2:]
    momentum = np.stack([log.p_x, log.p_y, log.L_z]) / 1e-3
    change, size = np.diff(momentum)[:, 1:], np.abs(force).max()
    assert np.abs(force - [[180], [-433.5], [-463.0]]).max() > 1
    exact = 1e-9 * max(size, np.abs(momentum).max())
    assert force[:2] == pytest.approx(change[:2], abs=exact)
    assert force[2] == pytest.approx(change[2], abs=4e-6 * size if method == "tlmpm" else exact)


TABLE = """
    method(ulmpm/contacts, FLIP, linear, 0.99)
    dimension(2, 0, 1, 0, 0.6, 0.1)
    region(table, block, 0.1, 0.9, 0.1, 0.2)
    region(block, block, 0.4, 0.7, 0.2, 0.4)
    material(rubber, linear, 1000, 1e5, 0.3)
    solid(table, region, table, 1, rubber, 0.1)
    solid(block, region, block, 1, rubber, 0.1)
    region(low, block, INF, INF, INF, 0.1)
    group(low, nodes, region, low, all)
    group(block, particles, region, block, solid, block)
    fix(low, velocity_nodes, low, 0, 0)
    fix(weight, body_force, all, 0, -10)
    fix(push, force_particles, block, 30, 0)
    fix(rub, contact/friction, block, table, no-slip)
    fix(calm, local_damping, all, 0.8)
    compute(B, force_on, block, x=0.55, y=0.2)
    compute(T, force_on, table)
    compute(S, force_on, low)
    compute(G, force_on, low, weight, push)
    compute(c, center_of_mass, block)
    set_output(1500)
    log_modify(custom, step, B_x, B_y, B_tz, B_px, T_x, T_y, T_tz, S_y, S_px, G_x, G_y, G_tz, c_x, c_y)
    run(1500)
"""


def test_a_block_on_a_table_pushed_above_its_foot(run_script):
    """The table bears m g under the centre, moved by F h/(m g) towards where the push tends."""
    log = run_script(TABLE).log
    print(log)
    b = {name: log[name][-1] for name in log}
    assert (b["B_x"], b["B_y"]) == pytest.approx((-30, 600), rel=1e-9)
    assert (b["T_x"], b["T_y"]) == pytest.approx((30, -600), rel=1e-9)
