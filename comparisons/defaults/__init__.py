"""What the defaults do: scenes with exact answers, run with the program's own choices.

Each case is a module here with a `CASE`, and a script `inputs/defaults/in.NAME`. The script chooses
nothing that the program would choose: no step, no scheme, no averaging, no weights. It has the
variable `refine`: cells are h / refine.
"""

import re
import subprocess
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import NamedTuple

from comparisons.results import Result

INPUTS = Path(__file__).parent.parent.parent / "inputs" / "defaults"


class Case(NamedTuple):
    """A scene with an exact answer.

    `measure` finds the number of a finished run that should be `exact`; `source` says whose that
    is. `within` is the error that is allowed in silence.
    The scene is run with each of `refine`, coarsest first, the last of which is judged; and that
    one with half the step. `advice` names what the scene should be told where it errs by more: a
    part of a warning.
    """

    quantity: str
    exact: float
    measure: Callable[[Result], float]
    source: str
    refine: tuple[float, ...] = (1, 2)
    within: float = 0.05
    advice: str = ""
    half_step: bool = True

    def error(self, computed: float) -> float:
        """The error as a share of the exact number; the number itself where that is 0."""
        return (computed - self.exact) / (abs(self.exact) or 1.0)


def names() -> list[str]:
    """Names of the cases."""
    return sorted(module.name for module in iter_modules(__path__) if module.name != "__main__")


def case(name: str) -> Case:
    """The case of a name."""
    return import_module(f"comparisons.defaults.{name}").CASE


def run(
    name: str, folder: Path, refine: float, dt: float | None = None, *, auto: bool = False
) -> Result:
    """Run the script of a case in a separate folder, with another step or ``method(auto)``."""
    place = folder / f"{name}_{refine:g}_{dt or 0:g}{'_auto' * auto}"
    place.mkdir(parents=True)
    text = (INPUTS / f"in.{name}").read_text(encoding="utf-8")
    if dt is not None:
        head, line, tail = text.rpartition("\nrun")
        text = f"{head}\nset_dt({dt!r}){line}{tail}"
    for part in INPUTS.glob("*.block"):  # that scripts include
        block = place / part.name
        block.write_text(chosen(part.read_text(encoding="utf-8"), auto), encoding="utf-8")
    script = place / f"in.{name}"
    script.write_text(chosen(text, auto), encoding="utf-8")
    command = [sys.executable, "-m", "karamelo_py.app.cli", str(script)]
    command += ["-var", "refine", f"{refine:g}"]
    done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
    return Result(done.returncode, done.stdout, done.stderr, place)


def chosen(text: str, auto: bool) -> str:
    """A script as it is, or with ``method(auto)``."""
    return re.sub(r"^method\(.*$", "method(auto)", text, flags=re.M) if auto else text


def step_of(result: Result) -> float:
    """The step that a run has begun with, from its banner."""
    (dt,) = re.findall(r"^  dt +(\S+)$", result.out, re.M)[:1]
    return float(dt)


def said(result: Result) -> list[str]:
    """Warnings and errors of a run, one line each."""
    lines = [*result.out.splitlines(), *result.err.splitlines()]
    found = [line.partition("warning: ")[2] for line in lines if "warning: " in line]
    return found + [line.partition("error: ")[2] for line in lines if "error: " in line]
