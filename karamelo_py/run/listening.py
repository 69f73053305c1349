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
        """The first step is chosen, nothing is compiled; `resumed`: from a restart file."""

    def ready(self, simulation: Any, *, resumed: bool) -> None:
        """Compilation is done."""

    def stepped(self, simulation: Any) -> None:
        """Some steps have succeeded."""

    def wrong(self, simulation: Any, status: int, too_large: bool) -> Trouble | None:
        """Explain `status` (DONE: an energy gain); return None if this listener cannot.

        `too_large`: the step was too large from the start of the run.
        """

    def ended(self, run: Any, simulation: Any, first_step: int, wall: float) -> None:
        """The run has ended; steps from `first_step` on took `wall` seconds."""

    def signalled(self, number: int) -> None:
        """A signal has arrived; the run ends after the present steps."""
