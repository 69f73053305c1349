"""The modules of the package that some statements run through, counted in a small scene.

    NUMBA_DISABLE_JIT=1 python tests/journeys.py

prints, for each statement, the modules whose functions are called while it is carried out. The
scene runs once before, so that nothing of the first run in a process is counted.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path

SCENE = """
dimension(2, 0, 1, 0, 1, 0.1)
method(ulmpm, FLIP, linear, 1)
region(disk, cylinder, 0.5, 0.5, 0.2)
material(m, linear, 1000, 1e6, 0.3)
solid(s, region, disk, 2, m, 0.1, 0)
dump(d, all, particle, 2, d.*.txt, x, vy, s11)
"""
STATEMENTS = "fix(gravity, ...)", "run(5)", "a dump"
GRAVITY = "fix(gravity, body_force, all, 0, -9.81)"
ARITHMETIC = ("compiler", "kernels", "points")


@contextmanager
def entered(seen: set[str]):
    """Collect the names of the modules of the package whose functions are called."""
    before = sys.getprofile()
    sys.setprofile(lambda frame, *_: seen.add(frame.f_globals.get("__name__", "")))
    try:
        yield
    finally:
        sys.setprofile(before)


def _within(seen: set[str], act: Callable[[], None]) -> None:
    with entered(seen):
        act()


def journeys() -> dict[str, list[str]]:
    from karamelo_py.app.simulation import Simulation

    for _ in range(2):
        found = {name: set() for name in STATEMENTS}
        with Simulation(SCENE, out=tempfile.mkdtemp()) as simulation:
            with entered(found[STATEMENTS[0]]):
                simulation.command(GRAVITY)
            (dump,) = simulation.hub.dumps.values()
            dump.write = partial(_within, found["a dump"], dump.write)
            with entered(found["run(5)"]):
                simulation.command("run(5)")
    return {
        name: sorted(one for one in seen if one.startswith("karamelo_py."))
        for name, seen in found.items()
    }


def modules(statement: str) -> list[str]:
    """Names of the modules of a statement, without the arithmetic of points and nodes."""
    return [name for name in _counted()[statement] if name.split(".")[1] not in ARITHMETIC]


@cache
def _counted() -> dict[str, list[str]]:
    words = [sys.executable, __file__]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parent.parent))
    print(json.dumps(journeys()))
