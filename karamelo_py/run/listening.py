"""Events of a run, and the base of what listens to them."""

from collections.abc import Iterable
from typing import Any, NamedTuple

from karamelo_py.script.errors import Place


class Trouble(NamedTuple):
    """A failure of a run: message, fix, code for programs, likely cause, line of the script."""

    message: str
    fix: str
    code: str
    cause: str = ""
    place: Place | None = None


def when(simulation: Any, later: int = 0) -> str:
    """Format the step (or `later` steps on) and the time."""
    return f"step {simulation.step + later}, t = {simulation.time:.6g}"


def where(x: Iterable[float]) -> str:
    """Format a position."""
    return "(" + ", ".join(f"{value:.6g}" for value in x) + ")"


class Listener:
    """Receives the events of a run; subclasses override what they need."""

    def begun(self, run: Any, simulation: Any, *, resumed: bool = False) -> None:
        """The first step is known, and nothing is compiled yet; `resumed` from a file."""

    def ready(self, simulation: Any, *, resumed: bool) -> None:
        """All is compiled: the first step comes next."""

    def stepped(self, simulation: Any) -> None:
        """Some steps were taken, all of them good."""

    def wrong(self, simulation: Any, status: int, too_large: bool) -> Trouble | None:
        """Explain a `status`, DONE for an energy gain; a step `too_large` from the start."""

    def ended(self, run: Any, simulation: Any, first_step: int, wall: float) -> None:
        """The run is over; it began at `first_step` and took `wall` seconds."""

    def signalled(self, number: int) -> None:
        """A signal arrived: the run ends after the present steps."""
