"""The second run of a script compiles nothing: each run is a process of its own."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import INPUTS
from test_identical import crossing
from verification import LINEAR

from karamelo_py.compiler import files

# Each scene compiles what other tests of its group compile too.
SCENES = {
    # Formulas on points and values at nodes: hooks that the loops call.
    "neo-hookean": (INPUTS / "in.axis_aligned", "1", {**LINEAR.variables, "refine": 0.25}),
    "identical": (crossing(2, "run(2)"), "2", {}),
    "heat_slab": (INPUTS / "in.heat_slab", "1", {"refine": 0.25}),
}


def lend(source: Path, target: Path) -> None:
    """Give the kernels in one folder to another one, which runs beside it do not write to."""
    target.mkdir(parents=True, exist_ok=True)
    for path in source.iterdir():
        if path.suffix in (".kernel", ".code") and not (target / path.name).exists():
            shutil.copy(path, target)


def kernels(folder: Path) -> set[str]:
    return {path.name for path in folder.glob("*.kernel")}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param("neo-hookean", marks=pytest.mark.xdist_group("neo-hookean")),
        pytest.param("identical", marks=pytest.mark.full),
        pytest.param("heat_slab", marks=pytest.mark.full),
    ],
)
def test_the_second_run_compiles_nothing(tmp_path, name):
    script, threads, variables = SCENES[name]
    if isinstance(script, Path):
        script = re.sub(r"(?m)^(plot|save_plot)\(.*$", "", script.read_text("utf-8"))
    (tmp_path / "in.script").write_text(script, encoding="utf-8")
    words = [part for key, value in variables.items() for part in ("-var", key, str(value))]
    command = [sys.executable, "-m", "karamelo_py.app.cli", "in.script", "--threads", threads]
    own = tmp_path / "cache"
    environment = {**os.environ, "KARAMELO_PY_CACHE": str(own), "NUMBA_NUM_THREADS": "2"}

    def run() -> str:
        done = subprocess.run(
            [*command, *words], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        return done.stdout + done.stderr

    lend(files.folder(), own / "kernels")
    run()
    lend(own / "kernels", files.folder())
    kept = kernels(own / "kernels")
    assert kept
    said = run()
    assert "ompil" not in said
    assert kernels(own / "kernels") == kept
