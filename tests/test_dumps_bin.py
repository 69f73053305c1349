"""dump particle/bin and grid/bin: read back by the layout in the manual of LAMMPS."""

import struct
from pathlib import Path

import numpy as np
import pytest
from scenes import block


def read(path: Path) -> list[tuple]:
    """Step, time, bounds, names and rows of each snapshot."""
    data, at, found = path.read_bytes(), 0, []

    def take(form: str) -> tuple:
        nonlocal at
        values = struct.unpack_from("<" + form, data, at)
        at += struct.calcsize("<" + form)
        return values

    while at < len(data):
        (length,) = take("q")
        assert take(f"{-length}s") == (b"DUMPCUSTOM",)
        assert take("ii") == (1, 2)
        step, count, skewed = take("qqi")
        assert not skewed
        sides, bounds = take("6i"), take("6d")
        assert sides == (2, 3) * 3
        width, units, timed = take("iib")
        assert (units, timed) == (0, 1)
        (time,) = take("d")
        (length,) = take("i")
        names = take(f"{length}s")[0].decode().split()
        assert len(names) == width
        (pieces,) = take("i")
        rows = [take(f"{take('i')[0]}d") for _ in range(pieces)]
        table = np.concatenate(rows).reshape(count, width)
        found.append((step, time, bounds, names, table))
    return found


@pytest.mark.parametrize("style", ["particle", "grid"])
@pytest.mark.parametrize("name", ["d.*.bin", "d.bin"])
def test_the_same_rows_as_in_text(run_interpreted, style, name):
    result = run_interpreted(
        block(
            2, "fix(v, initial_velocity_particles, all, 1/3, 0)", "set_dt(0.001)",
            f"dump(b, all, {style}/bin, 2, {name}, vx, mass)",
            f"dump(t, all, {style}, 2, t.*.txt, vx, mass)", "run(4)",
        )
    )  # fmt: skip
    files = [result.folder / name.replace("*", str(step)) for step in (0, 2, 4)]
    snapshots = [s for file in dict.fromkeys(files) for s in read(file)]
    assert [s[0] for s in snapshots] == [0, 2, 4]
    for step, time, bounds, names, table in snapshots:
        text = result.dump(f"t.{step}.txt")
        assert time == pytest.approx(0.001 * step, abs=1e-15)
        assert bounds == pytest.approx([0, 1.2, 0, 1.2, -0.05, 0.05], rel=1e-15)
        assert names == ["id", "type", "x", "y", "z", "vx", "mass"]
        for k, column in enumerate(names):
            assert table[:, k] == pytest.approx(text[column], rel=1e-8, abs=1e-300)
    if style == "particle":
        assert (snapshots[0][4][:, 5] == 1 / 3).all()


def test_ovito_reads_them(run_interpreted):
    io = pytest.importorskip("ovito.io", exc_type=ImportError)  # or its graphics libraries
    result = run_interpreted(
        block(
            2, "fix(v, initial_velocity_particles, all, 1/3, 0)", "set_dt(0.001)",
            "dump(b, all, particle/bin, 2, d.bin, vx, mass)", "run(4)",
        )
    )  # fmt: skip
    pipeline = io.import_file(result.folder / "d.bin")
    assert pipeline.source.num_frames == 3
    data = pipeline.compute(2)
    assert data.attributes["Timestep"] == 4
    assert np.asarray(data.particles["Mass"]) == pytest.approx(np.full(24, 0.005), rel=1e-15)
