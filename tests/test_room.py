"""Scenes that do not fit into the memory of the machine: told before, and never what would run."""

import re
from contextlib import nullcontext, suppress
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import INPUTS
from scenes import block

from karamelo_py.app.cli import main
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.run.room import check_room, least_bytes
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.room import SLACK, free_bytes
from karamelo_py.script.errors import Quit, ScriptError

MIB = 2**20


# --- what a machine has --------------------------------------------------------------------------

MACHINE = {"MemTotal:": 1000, "MemFree:": 100, "MemAvailable:": 500, "SwapFree:": 50}  # MiB


@pytest.fixture
def machine(tmp_path):
    """``machine(groups, {file: text})``: what is free on it, in MiB, without what is slack."""

    def free(groups: str | None = None, files: dict[str, str] | None = None) -> float:
        told = "".join(f"{name} {size * 1024} kB\n" for name, size in MACHINE.items())
        files = {"proc/meminfo": told, **(files or {})}
        if groups is not None:
            files["proc/self/cgroup"] = groups
        for name, text in files.items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        return free_bytes(tmp_path) / MIB

    return free


def test_what_the_system_can_give_is_free_swap_too(machine):
    assert machine() == pytest.approx(550 + SLACK * 1000)


def test_a_system_that_does_not_tell_is_not_asked(tmp_path):
    assert free_bytes(tmp_path) is None


def test_the_limit_of_a_batch_job_counts_wherever_it_stands(machine):
    """Version 2: of a group above, with files in memory that can be dropped."""
    job = "sys/fs/cgroup/job"
    files = {
        f"{job}/memory.max": str(200 * MIB), f"{job}/memory.current": str(150 * MIB),
        f"{job}/memory.stat": f"anon 5\ninactive_file {30 * MIB}\nactive_file {10 * MIB}\n",
        f"{job}/memory.swap.max": "0", f"{job}/memory.swap.current": "0",
        f"{job}/step/memory.max": "max", f"{job}/step/memory.current": str(150 * MIB),
    }  # fmt: skip
    assert machine("0::/job/step\n", files) == pytest.approx(90 + SLACK * 200)
    files[f"{job}/memory.max"] = "max"
    assert machine("0::/job/step\n", files) == pytest.approx(550 + SLACK * 1000)


def test_the_limit_of_a_container_of_the_older_kind(machine):
    """Version 1: its path is that outside, and its own limit stands at the top."""
    top = "sys/fs/cgroup/memory"
    files = {
        f"{top}/memory.limit_in_bytes": str(300 * MIB),
        f"{top}/memory.usage_in_bytes": str(100 * MIB),
        f"{top}/memory.stat": f"cache 7\ntotal_inactive_file {20 * MIB}\n",
    }
    groups = "9:cpu:/docker/12ab\n4:memory:/docker/12ab\n0::/\n"
    assert machine(groups, files) == pytest.approx(220 + 50 + SLACK * 300)
    files[f"{top}/memory.memsw.limit_in_bytes"] = str(300 * MIB)
    files[f"{top}/memory.memsw.usage_in_bytes"] = str(100 * MIB)
    assert machine(groups, files) == pytest.approx(220 + SLACK * 300)


# --- what a scene needs ---------------------------------------------------------------------------


@pytest.fixture
def small(monkeypatch):
    """``small(bytes)``: so much memory is free, and no scene is too small to be looked at."""

    def set_to(free: float) -> None:
        for module in ("run.room", "scene.room", "run.report"):
            monkeypatch.setattr(f"karamelo_py.{module}.free_bytes", lambda *_: free)
        for module in ("run.room", "scene.placement"):
            monkeypatch.setattr(f"karamelo_py.{module}.FEW", 0)

    return set_to


@pytest.mark.parametrize("script", ["two_disks", "heat_slab", "tensile_bar", "hertz"])
def test_it_is_never_more_than_check_says_and_most_of_it(run_interpreted, monkeypatch, script):
    """Of what would run nothing is refused: check counts the arrays as they are."""
    hub = Hub(Console(quiet=True))
    hub.checking = True
    monkeypatch.setattr("karamelo_py.run.runner.report", lambda *_: None)
    monkeypatch.setattr("karamelo_py.run.runner.foresight.warn", lambda *_: None)
    monkeypatch.setattr("karamelo_py.run.runner.warn_about_length", lambda *_: None)
    hub.interpreter = Interpreter(hub)
    with suppress(Quit):
        hub.interpreter.run_file(str(INPUTS / f"in.{script}"))
    said = run_interpreted(INPUTS / f"in.{script}", command="check").out
    whole = float(re.search(r"memory +([\d.]+) MiB in a run", said)[1]) * MIB
    assert 0.6 * whole < least_bytes(hub, np.float64, True) < 1.006 * whole  # of three digits


def test_a_scene_that_does_not_fit_is_refused_in_one_message(small, tmp_path, capsys, monkeypatch):
    """48 points in space of 160 bytes, 112 more in the copy, and 6 nodes: 14 kB, 1.4 = 1.13^3."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.large").write_text(block(3, "run(1)"), encoding="utf-8")
    small(10_000)
    assert main(["in.large"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("in.large:6:1: error: solid: the scene has 48 points, which take at ")
    assert said.count("error") == 1 and "cells 1.2 times as large" in said
    assert "precision(single)" in said and "several machines" in said


@pytest.mark.parametrize(("share", "status"), [(1.001, 0), (0.999, 1)])
def test_what_just_fits_runs(small, tmp_path, capsys, monkeypatch, share, status):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.script").write_text(block(2, "run(1)"), encoding="utf-8")
    asked = []

    def least(hub, *rest):
        asked.append(least_bytes(hub, *rest))
        return asked[-1]

    monkeypatch.setattr("karamelo_py.run.room.least_bytes", least)
    small(1e9)
    assert main(["in.script"]) == 0
    capsys.readouterr()
    small(share * asked[0])
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
    """In the plane a point has 44 bytes, whatever its law."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.script").write_text(block(2, "run(1)"), encoding="utf-8")
    small(44 * 10)
    assert main(["in.script"]) == 1
    assert "more than 10 points" in capsys.readouterr().err


def test_a_grid_that_no_machine_has_room_for(tmp_path, capsys, monkeypatch):
    """2e9 nodes of 96 bytes; and where the system promises all, that is to be seen in the run."""
    monkeypatch.chdir(tmp_path)
    text = block(2, "run(1)").replace("0, 1.2, 0.1)", "0, 1.2, 0.00003)", 1)
    text = text.replace("0.3, 0.6, 0.3, 0.5", "0.3, 0.3003, 0.3, 0.3002")
    text = text.replace("rubber, 0.1", "rubber, 0.00003")
    (tmp_path / "in.script").write_text(text, encoding="utf-8")

    def refuse(*_):
        raise MemoryError("Unable to allocate 95.4 GiB")

    monkeypatch.setattr("karamelo_py.run.lowering.fields.records", refuse)
    assert main(["in.script"]) == 1
    said = capsys.readouterr().err
    assert said.startswith("in.script:3:1: error: dimension: the arrays of 1600080001 nodes and 2")
    assert "Unable to allocate 95.4 GiB" in said and "larger cells" in said


@pytest.mark.parametrize(("on_machine", "refused"), [(2, False), (4, True)])
def test_of_processes_those_of_one_machine_count(small, on_machine, refused):
    """Of four with equal shares; half of the scene fits."""
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(block(2))
    whole = least_bytes(hub, np.float64, True)
    hub.settings.crew = SimpleNamespace(size=4, on_machine=on_machine)
    small(0.6 * whole)
    with pytest.raises(ScriptError, match="24 points") if refused else nullcontext():
        check_room(hub, copied=True)
    small(0.4 * whole)
    with pytest.raises(ScriptError, match="for 2 of 4 processes;" if not refused else "24 points"):
        check_room(hub, copied=True)
