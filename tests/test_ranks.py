"""Several processes that share a scene: the bits of one.

Here they are threads that talk as processes do, interpreted; the last tests start processes.
"""

from itertools import product

import h5py
import numpy as np
import pytest
from combinations import MESHED, scene, write_mesh
from scenes import SCHEMES, block
from states import same_bits
from test_restart import CURVE, SCENES, same_files, ways, with_files

MOVING = (
    "fix(v, initial_velocity_particles, all, 0.9+sin(40*x0), 0.5*cos(70*y0))",
    "log_modify(custom, step, time)",
    "set_output(1000)",
    "dt_factor(0.4)",
)


def shared(state_interpreted, tmp_path, script: str, ranks: int = 2) -> bool:
    whole = state_interpreted(script, boxes=True, out="whole")
    parts = state_interpreted(script, boxes=True, ranks=ranks, out="parts")
    same_files(tmp_path / "whole", tmp_path / "parts")
    return same_bits(whole, parts)


@pytest.mark.parametrize("scheme, transfer", [*product(SCHEMES, ("FLIP", "APIC"))])
def test_schemes(state_interpreted, tmp_path, scheme, transfer):
    script = block(2, *MOVING, "run(30)", scheme=scheme, transfer=transfer, size=(0.3, 0.2))
    assert shared(state_interpreted, tmp_path, with_files(script, "restart(9, r.*.h5)\n"))


@pytest.mark.parametrize("name", SCENES)
def test_every_part(state_interpreted, tmp_path, name):
    """Contact, heat, damage, edges, tools, computes that look back."""
    (tmp_path / "curve.csv").write_text(CURVE, encoding="utf-8")
    # Without memory: both run in one process here.
    script = SCENES[name].replace("pumps.", "shoves.")
    assert shared(state_interpreted, tmp_path, with_files(script))


@pytest.mark.parametrize("way", ways(), ids=lambda way: " ".join(filter(None, way)))
def test_every_way(state_interpreted, tmp_path, way):
    """Methods, bases, transfers, schemes and kinematics; three ranks."""
    option = way[3]
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    script = with_files(scene(*way, mesh=mesh, steps=4))
    assert shared(state_interpreted, tmp_path, script, ranks=3)


DUMPS = (
    "dump(t, all, particle/gz, 6, t.gz, x, y, vx, s11)",
    "dump(b, all, particle/bin, 6, b.*.bin, x, y, x0, volume, type)",
    "dump(h, all, hdf5, 6, h.h5, x, y, seq)",
)


def test_dumps_in_pieces(state_interpreted, tmp_path, monkeypatch):
    """So many ids after another, with points that are not there any more: the bytes of all at once.

    HDF5 puts its rows into the file in pieces: what it holds is the same.
    """
    script = block(
        2, "boundary(delete)", *DUMPS, MOVING[0].replace("0.9", "9"), *MOVING[1:], "run(34)",
        ppc=3, size=(0.3, 0.2),
    )  # fmt: skip
    state_interpreted(script, boxes=True, out="at once")
    for module in ("run.by_id", "styles.dumps.hdf5"):
        monkeypatch.setattr(f"karamelo_py.{module}.PIECE", 16)
    assert shared(state_interpreted, tmp_path, script)
    one, other = tmp_path / "at once", tmp_path / "parts"
    for path in (*one.glob("*.bin"), one / "t.gz"):
        assert path.read_bytes() == (other / path.name).read_bytes()
    with h5py.File(one / "h.h5") as a, h5py.File(other / "h.h5") as b:
        assert np.isnan(a["x"][-1]).any() and len(a["id"]) > 32
        assert all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)
