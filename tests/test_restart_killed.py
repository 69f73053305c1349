"""Programs that are killed or told to end while they run: files are whole, and the run goes on."""

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import h5py
import pytest
from going_on import arrays, same_files
from scenes import block

LONG = block(
    2, "fix(v, initial_velocity_particles, all, 0.1*sin(9*x0), 0)", "set_output(20)",
    "compute(E, energy_balance, all)", "log_modify(custom, step, time, E, E_drift)",
    "dump(d1, all, particle, 50, all.txt, x, y, s11)", "dump(d2, all, hdf5, 50, p.h5, x, s11)",
    "dump(d3, all, particle/gz, 100, d.*.gz, x)", "set_dt(0.0001)", "restart(40, r.h5)", "run({})",
    law="neo-hookean", size=(0.2, 0.1),
)  # fmt: skip
STEPS = 6000


def started(folder: Path, *options: str) -> subprocess.Popen:
    folder.mkdir(exist_ok=True)
    (folder / "in.script").write_text(LONG.format(STEPS), encoding="utf-8")
    return subprocess.Popen(
        [sys.executable, "-m", "karamelo_py.app.cli", "in.script", *options],
        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.full
@pytest.mark.skipif(sys.platform == "win32", reason="Windows ends processes otherwise")
@pytest.mark.xdist_group("neo-hookean")
@pytest.mark.parametrize("kills", [3, 100])
def test_killed_at_any_moment(tmp_path, kills):
    """SIGKILL: every file is readable, and what goes on is as if nothing had happened."""
    whole = tmp_path / "whole"
    assert started(whole).wait(timeout=300) == 0
    folder = tmp_path / "killed"
    restart: list[str] = []
    chance = random.Random(kills)
    killed = 0
    while True:
        process = started(folder, *restart)
        if killed < kills:
            begun = (folder / "log.mpm").stat().st_mtime_ns if (folder / "log.mpm").exists() else 0
            for _ in range(3000):
                log = folder / "log.mpm"
                if (log.exists() and log.stat().st_mtime_ns != begun) or process.poll() is not None:
                    break
                time.sleep(0.01)
            time.sleep(chance.uniform(0, 0.6))
            process.kill()
            killed += 1
        process.wait(timeout=300)
        process.communicate()
        if (folder / "r.h5").exists():
            restart = ["-restart", "r.h5"]
            json.loads(arrays(folder / "r.h5")["content"].tobytes())
        if (folder / "log.mpm").exists():
            lines = (folder / "log.mpm").read_text().splitlines()
            assert all(len(line.split()) == 4 for line in lines)
        if (folder / "p.h5").exists():
            assert len(arrays(folder / "p.h5")["step"]) > 0
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL
    for rest in folder.glob("*.part"):
        rest.unlink()
    same_files(whole, folder)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such signals")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGHUP"])
@pytest.mark.xdist_group("neo-hookean")
def test_signals_of_batch_systems(tmp_path, name):
    """As Ctrl-C: the last state, whole files, 128 + the number; and the run can go on."""
    number = getattr(signal, name)
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("this signal is ignored by all that is started here, as under nohup")
    process = started(tmp_path / "run")
    for _ in range(3000):
        if (tmp_path / "run" / "d.100.gz").exists() or process.poll() is not None:
            break
        time.sleep(0.02)
    process.send_signal(number)
    _, err = process.communicate(timeout=120)
    assert process.returncode == 128 + number, err
    assert "Traceback" not in err
    assert "interrupted: the log and the dumps are complete" in err
    folder = tmp_path / "run"
    last = h5py.File(folder / "r.h5").attrs["step"]
    assert (folder / "log.mpm").read_text().splitlines()[-1].split()[0] == str(last)
    assert (folder / f"d.{last}.gz").exists()
