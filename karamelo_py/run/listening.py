"""Events of a run."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from karamelo_py.script.errors import Mark


class Trouble(NamedTuple):
    """A failure: message, fix, code for programs, likely cause, and line of the script."""

    message: str
    fix: str
    code: str
    cause: str = ""
    mark: Mark | None = None


def when(simulation: Any, later: int = 0) -> str:
    return f"step {simulation.step + later}, t = {simulation.time:.6g}"


def where(x: Iterable[float]) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in x) + ")"


class Listener:
    """Receives the events of a run; subclasses override what they need."""

    def begun(self, run: Any, simulation: Any, *, resumed: bool = False) -> None:
        """Handle the start, before compilation; `resumed` is True for a restart file."""

    def ready(self, simulation: Any, *, resumed: bool) -> None:
        """Handle the end of compilation."""

    def stepped(self, simulation: Any) -> None:
        """Handle steps that have succeeded."""

    def wrong(self, simulation: Any, status: int, too_large: bool) -> Trouble | None:
        """Explain `status` (DONE for an energy gain), or return None.

        `too_large`: the step was already too large at the start of the run.
        """

    def ended(self, run: Any, simulation: Any, first_step: int, wall: float) -> None:
        """Handle the end of a run whose steps, from `first_step` on, took `wall` seconds."""

    def signalled(self, number: int) -> None:
        """Handle a signal; the run ends after the present steps."""
