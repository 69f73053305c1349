"""First steps, walls, nodes between outputs, hooks that move points: where a run could slip."""

import os
import subprocess
import sys
import textwrap

import numpy as np
import pytest
from scenes import H, block

from comparisons.results import read_dump

MASS = 2 * 0.3 * 0.2  # density times the block's area


@pytest.mark.parametrize("scheme", ["musl", "usl", "usf"])
def test_nodes_show_mass_and_momentum_at_every_output(run_interpreted, scheme):
    """Partition of unity: nodal mass and momentum are the body's, also when points are sorted."""
    result = run_interpreted(
        block(
            2,
            "fix(v, initial_velocity_particles, all, 5, 0)",
            "dump(g, all, grid, 1, grid.dump, x, y, mass, vx)",
            "run(6)",
            scheme=scheme,
            law="soft",
        )
    )
    snapshots = read_dump(result.folder / "grid.dump")
    assert [s.TIMESTEP for s in snapshots] == list(range(7))
    for snapshot in snapshots:  # nine digits are written
        assert snapshot.mass.sum() == pytest.approx(MASS, rel=1e-7)
        assert snapshot.mass @ snapshot.vx == pytest.approx(5 * MASS, rel=1e-7)


def test_fixes_of_the_first_step_wait_for_it(run_interpreted):
    """run(0) takes no step: the velocity given to nodes comes with the first one, and once."""
    log = run_interpreted(
        block(
            2,
            "fix(kick, initial_velocity_nodes, all, 0.25, 0)",
            "compute(v, average_velocity, all)",
            "log_modify(custom, step, v_x)",
            "run(0)",
            "run(4)",
        )
    ).log
    assert log.v_x[0] == 0
    assert log.v_x[1:] == pytest.approx([0.25] * 4, rel=1e-12)


def test_prescribed_velocity_is_not_asked_for_a_time_before_the_start(run_interpreted):
    """v = sqrt(time) has no value at -dt; the body follows the value at the start of the step."""
    log = run_interpreted(
        block(
            2,
            "fix(p, velocity_nodes, all, sqrt(time), 0)",
            "compute(v, average_velocity, all)",
            "log_modify(custom, time, v_x)",
            "set_dt(0.001)",
            "run(4)",
        )
    ).log
    assert log.v_x == pytest.approx([0, 0, *np.sqrt(log.Time[1:-1])], rel=1e-9)


@pytest.mark.parametrize("precision", ["double", "single"])
@pytest.mark.parametrize("top", [1.075, 0.9, 1.4665])
def test_points_on_a_wall_are_in_the_domain(run_interpreted, top, precision):
    """A domain may end on a point, whatever the rounding of its place; none is missing."""
    result = run_interpreted(
        f"""
        method(ulmpm, FLIP, linear, 1)
        precision({precision})
        dimension(1, 0, {top}, {H})
        region(all, block, 0, {top})
        material(m, linear, 1, 1, 0)
        solid(s, region, all, 2, m, {H}, 0)
        dump(d, all, particle, 3, d.*.LAMMPS, x)
        run(3)
        """
    )
    x = result.dump("d.3.LAMMPS").x
    assert x == pytest.approx(0.025 + 0.05 * np.arange(len(x)), abs=1e-6)
    assert top - 0.05 < x[-1] < top + 1e-6


def test_usl_keeps_the_two_disks_together(run_script):
    """40 times below the stable step USL without care of light nodes blows up at step 3290.

    Momentum of the pair is zero; USL dissipates: the total energy falls, but not by much more
    than the tenth that 10 points across a contact leave open.
    """
    log = run_script(
        """
        method(ulmpm, FLIP, linear, 1)
        scheme(usl)
        dimension(2, -0.5, 0.5, -0.5, 0.5, 0.05)
        region(lower, cylinder, -0.3, -0.3, 0.2)
        region(upper, cylinder, 0.3, 0.3, 0.2)
        material(rubber, linear, 1000, 1000, 0.3)
        solid(disk1, region, lower, 2, rubber, 0.05)
        solid(disk2, region, upper, 2, rubber, 0.05)
        group(g1, particles, region, lower, solid, disk1)
        group(g2, particles, region, upper, solid, disk2)
        fix(v1, initial_velocity_particles, g1, 0.1, 0.1)
        fix(v2, initial_velocity_particles, g2, -0.1, -0.1)
        compute(Ek, kinetic_energy, all)
        compute(Es, strain_energy, all)
        set_dt(0.001)
        set_output(500)
        log_modify(custom, time, Ek, Es)
        run_time(3.5)
        """
    ).log
    total = log.Ek + log.Es
    assert total[0] == pytest.approx(2.6)
    assert 0.9 * 2.6 < total[-1] < 2.6


def test_affine_transfer_without_a_second_mapping_is_refused(run_interpreted):
    text = block(2, "run(1)", transfer="FLIP", scheme="usl").replace(
        "FLIP, linear, 1", "APIC, linear"
    )
    err = run_interpreted(text, status=1).err
    line = 1 + text[: text.index("method(")].count("\n")
    assert f"in.script:{line}:" in err and "error: method: APIC with the basis linear" in err
    assert "is unstable" in err
    assert "unstable" not in run_interpreted(text.replace("scheme(usl)", "scheme(musl)")).err


def test_a_hook_that_moves_points_moves_their_mass(tmp_path, starts_are_cheap):
    """Points put elsewhere by initial_integrate give to the nodes there, and leave no trace."""
    code = """
        from karamelo_py.output.console import Console
        from karamelo_py.scene.hub import Hub
        from karamelo_py.scene.modify import Fix, PointsView
        from karamelo_py.language.interpreter import Interpreter

        class Jump(Fix):
            def __init__(self, hub, group):
                super().__init__(hub)
                self.group = group

            def initial_integrate(self, points: PointsView) -> None:
                if hub.update.step == 2:
                    points.position = points.position + 0.4

        hub = Hub(Console(quiet=True))
        hub.interpreter = Interpreter(hub)
        hub.interpreter.run_text(SCENE, "scene")
        jump = Jump(hub, type("All", (), {"all": True, "id": "all"})())
        hub.fixes.add("jump", jump)
        hub.values.publish_vector("jump")
        hub.interpreter.run_text("run(6)", "run")
        v = hub.fields.velocity
        assert abs(v - 0.1).max() < 1e-12, v
        assert abs(hub.fields.node("mass").sum() - MASS) < 1e-12
        print("moved", hub.fields.position.mean() > 0.75)
    """
    scene = block(2, "fix(v, initial_velocity_particles, all, 0.1, 0.1)", law="soft")
    program = f"SCENE = {scene!r}\nMASS = {MASS}\n{textwrap.dedent(code)}"
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "moved True" in done.stdout


def test_a_solid_in_the_place_of_another_is_warned_of(run_interpreted):
    """A line copied with its region would double the mass."""
    twice = run_interpreted(block(2, "solid(twin, region, box, 2, rubber, 0.1, 0)", "run(0)"))
    assert "points of solid 'twin'" in twice.err
    beside = "region(side, block, 0.6, 0.9, 0.3, 0.5)\nsolid(side, region, side, 2, rubber, 0.1)"
    assert "mass there is doubled" not in run_interpreted(block(2, beside, "run(0)")).err
