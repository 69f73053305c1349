"""Scripts with --gpu on an emulated card, interpreted: logs and dumps as of the processor."""

import numpy as np
import pytest

# Two squares that meet; of 2 x 2 points each.
SQUARES = """
precision({precision})
method({method})
scheme({scheme})
dimension(2, 0, 0.4, 0, 0.4, 0.1)
region(lower, block, 0.1, 0.2, 0.1, 0.2)
region(upper, block, 0.2, 0.3, 0.2, 0.3)
material(rubber, neo-hookean, 1000, 1000, 0.3)
solid(a, region, lower, 2, rubber, 0.1, 0)
solid(b, region, upper, 2, rubber, 0.1, 0)
group(a, particles, region, lower, solid, a)
group(b, particles, region, upper, solid, b)
fix(v1, initial_velocity_particles, a, {v}, {v})
fix(v2, initial_velocity_particles, b, -0.1, -0.1)
compute(Ek, kinetic_energy, all)
compute(Es, strain_energy, all)
log_modify(custom, step, dt, time, Ek, Es)
set_output(2)
dump(points, all, particle, 5, d.*.LAMMPS, x, y, vx, vy, s11, s22, s12)
dump(nodes, all, grid, 5, g.*.LAMMPS, mass, vx, vy)
"""
USUAL = {"method": "ulmpm, FLIP, linear, 0.99", "scheme": "musl", "precision": "double", "v": 0.1}


def squares(*lines, **changes):
    return SQUARES.format(**(USUAL | changes)) + "\n".join(lines)


def alike(one, other, error=1e-12):
    """Sums have another order: some round-off errors of the largest number of a column."""
    assert sorted(f.name for f in one.folder.iterdir()) == sorted(
        f.name for f in other.folder.iterdir()
    )
    tables = [one.log, *one.snapshots("d"), *one.snapshots("g")]
    others = [other.log, *other.snapshots("d"), *other.snapshots("g")]
    for mine, theirs in zip(tables, others, strict=True):
        assert list(mine) == list(theirs)
        for name, column in mine.items():
            assert np.abs(column - theirs[name]).max() <= error * np.abs(column).max(), name


def same_files(one, other, but=()):
    """Every byte of logs and dumps."""
    names = {f.name for f in one.folder.iterdir() if f.suffix in (".LAMMPS", ".mpm")}
    assert names
    for name in names - set(but):
        assert (one.folder / name).read_bytes() == (other.folder / name).read_bytes(), name


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({}, 1e-12),
        ({"method": "ulmpm, MLS, quadratic-spline", "scheme": "usl"}, 1e-12),
        ({"method": "tlmpm, FLIP, linear, 0.99", "scheme": "usf", "precision": "single"}, 2e-4),
    ],
)
def test_same_as_processor(run_interpreted, changes, error):
    script = squares("run(7)", "run(3)", **changes)
    here = run_interpreted(script, folder="here")
    there = run_interpreted(script, "--gpu", folder="there")
    assert "gpu                 emulated" in there.out
    alike(here, there, error)
