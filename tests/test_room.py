"""Scenes that do not fit into the memory of the machine: told before, and never what would run."""

import gc
import os
import re
import subprocess
import sys
import weakref
from contextlib import nullcontext, suppress
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from conftest import INPUTS
from scenes import block
from selection import few

from karamelo_py import Simulation
from karamelo_py.app.cli import main
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.lower.memory import check_room, least_bytes, memory_of, point_fields
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.machine_memory import SLACK, MachineMemory, machine_memory
from karamelo_py.script.errors import Quit, ScriptError

MIB = 2**20


# --- what a machine has --------------------------------------------------------------------------

# MiB
MACHINE = {"MemTotal:": 1000, "MemFree:": 100, "MemAvailable:": 500}
MACHINE |= {"SwapTotal:": 80, "SwapFree:": 50}


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """``machine(groups, {file: text}, processes)``: what it has free, and in all, in MiB."""

    def told(
        groups: str | None = None, files: dict[str, str] | None = None, processes: int = 1
    ) -> MachineMemory:
        text = "".join(f"{name} {size * 1024} kB\n" for name, size in MACHINE.items())
        files = {"proc/meminfo": text, **(files or {})}
        if groups is not None:
            files["proc/self/cgroup"] = groups
        for name, text in files.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        monkeypatch.setattr(psutil, "PROCFS_PATH", str(tmp_path / "proc"))
        found = machine_memory(processes, root=tmp_path)
        return MachineMemory(*(size / MIB for size in found))

    return told


def test_what_the_system_can_give_is_free_swap_too(machine):
    assert machine() == pytest.approx((550 + SLACK * 1000, 1080))


def test_a_system_that_does_not_tell_is_not_asked(tmp_path, monkeypatch):
    monkeypatch.setattr(psutil, "PROCFS_PATH", str(tmp_path))
    assert machine_memory(root=tmp_path) is None


def test_the_limit_of_a_batch_job_counts_wherever_it_stands(machine):
    """Version 2: of a group above, with files in memory that can be dropped."""
    job = "sys/fs/cgroup/job"
    files = {
        f"{job}/memory.max": str(200 * MIB), f"{job}/memory.current": str(150 * MIB),
        f"{job}/memory.stat": f"anon 5\ninactive_file {30 * MIB}\nactive_file {10 * MIB}\n",
        f"{job}/memory.swap.max": str(30 * MIB), f"{job}/memory.swap.current": str(10 * MIB),
        f"{job}/step/memory.max": "max", f"{job}/step/memory.current": str(150 * MIB),
    }  # fmt: skip
    assert machine("0::/job/step\n", files) == pytest.approx((90 + 20 + SLACK * 200, 230))
    files[f"{job}/memory.max"] = "max"
    assert machine("0::/job/step\n", files) == pytest.approx((550 + SLACK * 1000, 1080))


def test_the_limit_of_a_container_of_the_older_kind(machine):
    """Version 1: its path is that outside, and its own limit stands at the top."""
    top = "sys/fs/cgroup/memory"
    files = {
        f"{top}/memory.limit_in_bytes": str(300 * MIB),
        f"{top}/memory.usage_in_bytes": str(100 * MIB),
        f"{top}/memory.stat": f"cache 7\ntotal_inactive_file {20 * MIB}\n",
    }
    groups = "9:cpu:/docker/12ab\n4:memory:/docker/12ab\n0::/\n"
    assert machine(groups, files) == pytest.approx((220 + 50 + SLACK * 300, 380))


def test_the_limit_of_each_process_counts_for_those_of_the_machine(machine, monkeypatch):
    """Of addresses (ulimit -v), of which 30 MiB are taken."""
    taken = SimpleNamespace(memory_info=lambda: SimpleNamespace(vms=30 * MIB))
    monkeypatch.setattr(psutil, "Process", lambda: taken)
    monkeypatch.setattr("resource.getrlimit", lambda _: (200 * MIB, -1))
    assert machine() == pytest.approx((170 + SLACK * 200, 200))
    assert machine(processes=2) == pytest.approx((340 + SLACK * 400, 400))
    monkeypatch.setattr("resource.getrlimit", lambda _: (-1, -1))
    assert machine() == pytest.approx((550 + SLACK * 1000, 1080))


@pytest.mark.skipif(not os.path.exists("/proc/self/limits"), reason="needs /proc")
def test_a_process_finds_its_own_limit(starts_are_cheap):
    code = (
        "import resource; resource.setrlimit(resource.RLIMIT_AS, (3 << 30, -1)); "
        "from karamelo_py.scene.machine_memory import machine_memory; print(*machine_memory())"
    )
    done = subprocess.run([sys.executable, "-c", code], text=True, check=True, capture_output=True)
    free, whole = map(float, done.stdout.split())
    assert whole <= 3 << 30 and free < 1.03 * whole


# --- what a scene needs ---------------------------------------------------------------------------


@pytest.fixture
def small(monkeypatch):
    """``small(free, whole)``: so many bytes a machine has, and no scene is too small to look at."""

    def set_to(free: float, whole: float | None = None) -> None:
        there = MachineMemory(free, free if whole is None else whole)
        for module in ("run.lower.memory", "scene.machine_memory"):
            monkeypatch.setattr(f"karamelo_py.{module}.machine_memory", lambda *_: there)
        for module in ("run.lower.memory", "scene.placement"):
            monkeypatch.setattr(f"karamelo_py.{module}.FITS_EVERYWHERE", 0)

    return set_to


@pytest.fixture
def least(monkeypatch):
    """What was found to be the least that scenes need, one after the other."""
    found = []

    def noted(*of):
        found.append(least_bytes(*of))
        return found[-1]

    monkeypatch.setattr("karamelo_py.run.lower.memory.least_bytes", noted)
    return found


def test_scenes_of_few_points_do_not_ask(tmp_path, monkeypatch):
    """Of the system, which takes a millisecond for each solid."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.script").write_text(block(2, "run(1)"), encoding="utf-8")
    for module in ("run.lower.memory", "scene.machine_memory"):
        monkeypatch.setattr(f"karamelo_py.{module}.machine_memory", None)
    assert main(["in.script"]) == 0


SCRIPTS = "two_disks", "heat_slab", "tensile_bar", "hertz"


@pytest.mark.parametrize("script", few(SCRIPTS, "two_disks", "hertz"))
def test_it_is_never_more_than_check_says_and_most_of_it(run_interpreted, monkeypatch, script):
    """Of what would run nothing is refused: check counts the arrays as they are."""
    hub = Hub(Console(quiet=True))
    hub.checking = True
    monkeypatch.setattr("karamelo_py.commands.run.report", lambda *_: None)
    monkeypatch.setattr("karamelo_py.commands.run.known_failures.warn", lambda *_: None)
    monkeypatch.setattr(
        "karamelo_py.commands.run.known_failures.warn_about_length", lambda *_: None
    )
    hub.interpreter = Interpreter(hub)
    with suppress(Quit):
        hub.interpreter.run_file(str(INPUTS / f"in.{script}"))
    said = run_interpreted(INPUTS / f"in.{script}", command="check").out
    whole = float(re.search(r"memory +([\d.]+) MiB in a run", said)[1]) * MIB
    assert 0.6 * whole < least_bytes(hub, np.float64, True) < 1.006 * whole  # of three digits


SOLID = "solid(body{}, region, box, 2, rubber, 0.1, 0)"


def made(*lines: str, method: str = "ulmpm") -> Hub:
    """A scene of a block in the plane, and more lines, which does not run."""
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(block(2, *lines).replace("ulmpm", method))
    return hub


@pytest.mark.parametrize(("method", "grids"), [("ulmpm", 1), ("tlmpm", 5)])
def test_solids_in_the_same_cells_need_their_nodes_once_where_they_share_a_grid(method, grids):
    """24 points each in 6 cells, with the record of a node in each: 8, 4 and 2 numbers."""
    one, five = made(method=method), made(*(SOLID.format(k) for k in range(4)), method=method)
    least = [least_bytes(hub, np.float64, False) for hub in (one, five)]
    points = 24 * sum(size for *_, size in point_fields(one.simulation.setup.blocks[0]))
    assert least == [points + 6 * 14 * 8, 5 * points + grids * 6 * 14 * 8]


@pytest.mark.parametrize("real", ["double", "single"])
def test_the_copy_is_that_of_a_run(real):
    """Places are there twice, before and after a step, and the copy has one of them."""
    hub = made(f"precision({real})", "material(other, neo-hookean, 2, 100, 0.3)",
               SOLID.format(2).replace("rubber", "other"))  # fmt: skip
    kind = {"double": np.float64, "single": np.float32}[real]
    with_copy, without = (least_bytes(hub, kind, copied) for copied in (True, False))
    simulation = hub.simulation
    simulation.sort()
    assert with_copy - without == memory_of(simulation, simulation.setup, 0).copied > 0


def test_a_scene_that_does_not_fit_is_refused_in_one_message(small, tmp_path, capsys, monkeypatch):
    """48 points in space of 160 bytes, 112 more in the copy, and 6 nodes: more than 13 kB."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.large").write_text(block(3, "run(1)"), encoding="utf-8")
    small(13_000)
    assert main(["in.large"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("in.large:6:1: error: solid: the scene has 48 points, which take at ")
    assert said.count("error") == 1 and "cells 1.1 times as large" in said
    assert "; this machine has 1.21e-05 GiB in all" in said
    assert "precision(single)" in said and "several machines" in said


def test_what_is_not_free_but_there_is_warned_of(small, tmp_path, capsys, monkeypatch):
    """What the system gives back when it has to it does not always tell."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.large").write_text(block(2, "run(1)"), encoding="utf-8")
    small(3_000, 20_000)
    assert main(["in.large"]) == 0
    said = capsys.readouterr().err
    assert said.startswith("in.large:6:1: warning: the scene has 24 points, which take at least ")
    assert said.count("warning") == 1 and "cells 1.4 times as large" in said
    assert "this machine has 2.79e-06 GiB free: it may not fit" in said


def test_scenes_of_before_that_nobody_holds_are_let_go(tmp_path, capsys, monkeypatch):
    """They point to themselves, and Python's collector comes seldom."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("karamelo_py.run.lower.memory.FITS_EVERYWHERE", 0)
    held = []

    def there(*_) -> MachineMemory:
        free = 1e3 if any(hub() is not None for hub in held) else 1e9
        return MachineMemory(free, 1e3 if held else 1e9)

    monkeypatch.setattr("karamelo_py.run.lower.memory.machine_memory", there)
    gc.disable()
    try:
        for _ in range(2):
            simulation = Simulation(block(2, "run(1)"))
            simulation.run()
            held.append(weakref.ref(simulation.hub))
            del simulation
        assert [hub() is None for hub in held] == [True, False]
    finally:
        gc.enable()


def test_a_later_run_has_room_for_its_copy_where_the_first_had(
    small, tmp_path, capsys, monkeypatch, least
):
    """Its fix adds a field; arrays of before, which are not free then, go before the copy is made.

    16 bytes more of a point, and 16 more in its copy.
    """
    monkeypatch.chdir(tmp_path)
    lines = "group(its, particles, region, box, all)", "fix(push, force_particles, its, 1, 0)"
    (tmp_path / "in.script").write_text(block(2, "run(1)", *lines, "run(1)"), encoding="utf-8")
    small(1e9)
    assert main(["in.script"]) == 0 and len(least) == 2
    capsys.readouterr()
    small(least[0], 1e9)
    assert main(["in.script"]) == 0
    assert "may not fit" not in capsys.readouterr().err
    small(0.999 * least[0], 1e9)
    assert main(["in.script"]) == 0
    assert capsys.readouterr().err.count("may not fit") == 1


@pytest.mark.parametrize(("share", "status"), [(1.001, 0), (0.999, 1)])
def test_what_just_fits_runs(small, tmp_path, capsys, monkeypatch, least, share, status):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.script").write_text(block(2, "run(1)"), encoding="utf-8")
    small(1e9)
    assert main(["in.script"]) == 0
    capsys.readouterr()
    small(share * least[0])
    assert main(["in.script"]) == status


def test_check_needs_no_copy_and_says_what_is_free(small, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.script").write_text(block(2, "run(1)"), encoding="utf-8")
    small(5000)
    assert main(["in.script"]) == 1
    assert main(["check", "in.script"]) == 0
    assert re.search(r"0\.00477 MiB are free on this machine", capsys.readouterr().out)
    small(1000)
    assert main(["check", "in.script"]) == 1


def test_points_are_not_counted_to_the_end_where_none_fits(small, tmp_path, capsys, monkeypatch):
    """In the plane a point of this law has 64 bytes, whatever its fields."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.script").write_text(block(2, "run(1)"), encoding="utf-8")
    small(64 * 10)
    assert main(["in.script"]) == 1
    assert "with these, the scene has some 24 points" in capsys.readouterr().err


def test_a_grid_that_no_machine_has_room_for(tmp_path, capsys, monkeypatch):
    """2e9 nodes of 96 bytes; and where the system promises all, that is to be seen in the run."""
    monkeypatch.chdir(tmp_path)
    text = block(2, "run(1)").replace("0, 1.2, 0.1)", "0, 1.2, 0.00003)", 1)
    text = text.replace("0.3, 0.6, 0.3, 0.5", "0.3, 0.3003, 0.3, 0.3002")
    text = text.replace("rubber, 0.1", "rubber, 0.00003")
    (tmp_path / "in.script").write_text(text, encoding="utf-8")

    def refuse(*_):
        raise MemoryError("Unable to allocate 95.4 GiB")

    monkeypatch.setattr("karamelo_py.run.lower.build.fields.records", refuse)
    assert main(["in.script"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("in.script:3:1: error: dimension: the arrays of 1600080001 nodes and 2")
    assert "Unable to allocate 95.4 GiB" in said and "larger cells" in said


@pytest.mark.parametrize(
    ("on_machine", "refused"), [pytest.param(2, False, marks=pytest.mark.full), (4, True)]
)
def test_of_processes_those_of_one_machine_count(small, on_machine, refused):
    """Of four with equal shares; half of the scene fits."""
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(block(2))
    whole = least_bytes(hub, np.float64, True)
    hub.settings.comm = comm = SerialComm()
    comm.size, comm.on_machine = 4, on_machine
    small(0.6 * whole)
    with pytest.raises(ScriptError, match="24 points") if refused else nullcontext():
        check_room(hub, copied=True)
    small(0.4 * whole)
    with pytest.raises(ScriptError, match="for 2 of 4 processes;" if not refused else "24 points"):
        check_room(hub, copied=True)
