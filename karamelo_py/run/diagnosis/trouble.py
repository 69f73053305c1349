"""Troubles of a run as the user sees them: what was seen, the likely cause, a fix."""

from typing import Any, NamedTuple

from karamelo_py.script.errors import Place


class Trouble(NamedTuple):
    """Trouble of a run, a fix, the kind for programs (`code`) and the likely cause, if known.

    `place` is the line of the script at fault, if there is one.
    """

    message: str
    fix: str
    code: str
    cause: str = ""
    place: Place | None = None


def when(simulation: Any, later: int = 0) -> str:
    """Write the step (or one some steps `later`) and the time of a simulation."""
    return f"step {simulation.step + later}, t = {simulation.time:.6g}"
