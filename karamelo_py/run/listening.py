"""Events of a run: the loop sends them, and what shows or explains a run listens."""

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


def where(x: Any) -> str:
    """Write a position."""
    return "(" + ", ".join(f"{value:.6g}" for value in x) + ")"


class Listener:
    """Hears what happens in a run; a subclass overrides what it cares for."""

    def begun(self, run: Any, simulation: Any, *, resumed: bool = False) -> None:
        """The first step is known, and nothing is compiled yet; `resumed` from a file."""

    def ready(self, simulation: Any, *, resumed: bool) -> None:
        """All is compiled: the first step comes next."""

    def stepped(self, simulation: Any) -> None:
        """Some steps were taken, all of them good."""

    def wrong(self, simulation: Any, status: int, too_large: bool) -> Trouble | None:
        """Explain a `status`, DONE for a gain of energy; a step `too_large` from the start."""

    def ended(self, run: Any, simulation: Any, first_step: int, wall: float) -> None:
        """The run is over: it began at `first_step` and has taken `wall` seconds."""

    def signalled(self, number: int) -> None:
        """A signal has come: the run ends after the present steps."""
