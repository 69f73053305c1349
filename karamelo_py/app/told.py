"""Values and errors between Python and a scene, which speaks as a script does."""

import re
import sys
import warnings
from argparse import ArgumentTypeError
from collections.abc import Iterator
from contextlib import contextmanager
from os import PathLike
from typing import Any

import numpy as np

from karamelo_py.app.options import threads_option
from karamelo_py.output.console import Console
from karamelo_py.run.mpi.comm import launched
from karamelo_py.script.errors import ScriptError


class SimulationError(ScriptError):
    """An error of a script or a command: the whole message, with its place.

    Attributes
    ----------
    message, place, expected, hint
        The parts of the message; `place` has file, line, column and the line itself.
    """

    def __str__(self) -> str:
        return self.render()


class KarameloWarning(UserWarning):
    """A warning as the command line shows it."""


class Quiet(Console):
    """Shows nothing; warnings are those of Python."""

    def __init__(self) -> None:
        super().__init__(quiet=True)

    def warn(self, text: str) -> None:
        warnings.warn(text, KarameloWarning, stacklevel=2)


@contextmanager
def told() -> Iterator[None]:
    """Raise errors as those whose text is the whole message."""
    try:
        yield
    except ScriptError as error:
        whole = SimulationError.__new__(SimulationError)
        whole.__dict__.update(vars(error))
        whole.args = error.args
        raise whole from error.__cause__


def refuse_copies() -> None:
    """Of several processes that were started, the first tells that none shares a scene here."""
    size, rank = launched()
    if size == 1:
        return
    if rank > 0:
        sys.exit()
    raise SimulationError(
        f"{size} processes were started, and a scene in Python is of one: they would do the same",
        expected=f"mpiexec -n {size} karamelo-py SCRIPT, by which they share a scene",
        hint="Simulation(..., alone=True) where each is to have a scene of its own",
    )


def threads_of(given: Any) -> int | None:
    """The number of threads, as `--threads` takes it; None for auto."""
    try:
        return None if given is None else threads_option(str(given))
    except ArgumentTypeError:
        raise ScriptError(
            f"threads={given!r} is not a number of threads",
            expected="1, 2, ..., or None: all cores where the scene is large enough",
        ) from None


def said(value: Any) -> str:
    """Write a value of Python as a script would."""
    if value is None:
        return "NULL"
    if isinstance(value, (bool, np.bool_)):
        return str(bool(value)).lower()
    if isinstance(value, PathLike):
        return f'"{value}"'
    if isinstance(value, (int, np.integer)):
        return str(int(value))
    if isinstance(value, (float, np.floating)):
        return repr(float(value))
    if isinstance(value, str):
        words = value.split()
        texts = len(words) > 1 and all(re.fullmatch(r"[\w.:'-]+", word) for word in words)
        # Words with nothing but blanks between them are no formula.
        return f'"{value}"' if texts and not {"and", "or", "not"} & set(words) else value
    raise TypeError(f"{value!r} is no number, text, True, False, None or function")
