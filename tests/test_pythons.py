"""The program in each Python that it is for, as far as one is at hand."""

import os
import re
import shutil
import subprocess
import sys
import tomllib
from importlib.metadata import version
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
NUMBERS = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["classifiers"]))
THIS = ".".join(map(str, sys.version_info[:2]))
SCENE = """
method(ulmpm, AFLIP, quadratic-spline, 0.9)
dimension(3, 0, 4, 0, 4, 0, 4, 1)
region(block, block, 1.1, 2.7, 1.2, 2.9, 1, 2.5)
material(rubber, neo-hookean, 2, 100, 0.3)
solid(block, region, block, 1, rubber, 1, 0)
fix(v, initial_velocity_particles, all, sin(7*x0), y0, 0.3*z0)
compute(E, energy_balance, all)
log_modify(custom, step, E)
restart(8, state.*.h5)
run(8)
"""


IMPORT_ALL = """
import importlib, pkgutil, karamelo_py
for one in pkgutil.walk_packages(karamelo_py.__path__, "karamelo_py."):
    importlib.import_module(one.name)
    print(one.name)
"""


def test_every_module_imports_without_a_warning():
    """What the next Python or library takes away is announced as a warning by this one."""
    command = [sys.executable, "-W", "error", "-c", IMPORT_ALL]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) > 300


def test_no_python_is_refused_for_being_new():
    """README, the page of installing and the classifiers name the same versions."""
    assert PROJECT["requires-python"] == f">={NUMBERS[0]}"
    first, *_, last = NUMBERS
    assert f"`python3` ({first} to {last})" in (ROOT / "README.md").read_text("utf-8")
    start = (ROOT / "docs" / "getting-started.md").read_text("utf-8")
    assert f"Python {', '.join(NUMBERS[:-1])} or {last}" in start


def python_of(number: str) -> str | None:
    """Find a Python of this version on the path, or among those of pyenv."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for one in (shutil.which(f"python{number}"), *sorted(pyenv.glob(f"{number}.*/bin/python3"))):
        # Of pyenv's that is chosen by a file, one on the path may lead nowhere.
        if (
            one
            and not subprocess.run([one, "-c", "import ensurepip"], capture_output=True).returncode
        ):
            return str(one)
    return None


def state(python: str | Path, folder: Path, interpreted: bool) -> dict[str, np.ndarray]:
    """Run the scene; every number of its restart file."""
    folder.mkdir()
    (folder / "in.scene").write_text(SCENE, "utf-8")
    environment = {"PYTHONPATH": str(ROOT), "NUMBA_DISABLE_JIT": str(int(interpreted))}
    command = [python, "-m", "karamelo_py.app.cli", "in.scene", "--threads", "1"]
    environment |= {"KARAMELO_PY_CACHE": str(folder / "cache")}
    subprocess.run(command, cwd=folder, env={**os.environ, **environment}, check=True)
    found = {}

    def keep(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if isinstance(item, h5py.Dataset):
            found[name] = item[()]

    with h5py.File(folder / "state.8.h5") as file:
        file.visititems(keep)
    return found


@pytest.mark.full
@pytest.mark.parametrize("number", [number for number in NUMBERS if number != THIS])
def test_another_python_finds_the_same(tmp_path, number):
    """Compiled and interpreted, with the same versions of what computes: the same bits."""
    python = python_of(number)
    if python is None:
        pytest.skip(f"no Python {number} on the path or under pyenv")
    subprocess.run([python, "-m", "venv", tmp_path / "venv"], check=True)
    python = tmp_path / "venv" / ("Scripts" if os.name == "nt" else "bin") / "python"
    same = [f"{name}=={version(name)}" for name in ("numpy", "numba", "llvmlite", "h5py")]
    install = [python, "-m", "pip", "install", "--quiet", *PROJECT["dependencies"], *same]
    subprocess.run(install, check=True)
    for way in (True, False):
        ours = state(sys.executable, tmp_path / f"ours {way}", way)
        others = state(python, tmp_path / f"others {way}", way)
        assert ours.keys() == others.keys()
        for name, numbers in ours.items():
            assert np.array_equal(numbers, others[name]), name
