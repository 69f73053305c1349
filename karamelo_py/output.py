"""Output: what is written when. The log, the dumps and the plots share one rhythm."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from karamelo_py.log import Log
from karamelo_py.plots import Plots

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class Periodic(Protocol):
    """Something written every so many steps; `last_step` is the step it last wrote."""

    every: int
    last_step: int | None

    def write(self) -> None:
        """Write the state now."""


class Output:
    """Writes log, dumps and plots when they are due.

    Each of them is due at the first and the last state of every run and at the multiples of its
    `every`, counted in absolute steps, so that a further run goes on in the same rhythm. No state
    is written twice to the same file. In a rehearsal nothing is written.

    A run calls ``begin``, then again and again ``next_step`` and ``write``, then ``end``;
    ``abort`` stands in for ``end`` when the run breaks off.
    """

    def __init__(self, hub: Hub):
        self.hub = hub
        self.log = Log(hub)
        self.plots = Plots(hub)
        # Which dump a file belongs to.
        self.files: dict[Path, str] = {}

    def begin(self, run: Any = None) -> None:
        """Write the headers and the first state of a run."""
        if self.hub.rehearsing:
            return
        self.log.begin()
        self.write(last=True)

    def next_step(self, step: int) -> int:
        """The first step after `step` at which something is due."""
        return min((step // item.every + 1) * item.every for item in self._items())

    def write(self, last: bool = False) -> None:
        """Write what is due at the present step; with `last`, everything not yet written."""
        if self.hub.rehearsing:
            return
        step = self.hub.update.step
        due = [i for i in self._items() if i.last_step != step and (last or step % i.every == 0)]
        if any(item is self.log or item in self.plots for item in due):
            # Computes and energy fixes only work when somebody looks.
            self.hub.refresh_values()
        for item in due:
            item.write()
            item.last_step = step

    def end(self, last: bool = True) -> None:
        """Write the last state of a run (unless `last` is false) and draw the plots."""
        if self.hub.rehearsing:
            return
        if last:
            self.write(last=True)
        self.plots.save()

    def abort(self) -> None:
        """Draw the plots and close the log of a run that breaks off.

        Writes no
        further state.

        A caller that holds a sound state calls ``write(last=True)`` before.
        """
        if self.hub.rehearsing:
            return
        try:
            self.plots.save()
        finally:
            self.log.close()

    def _items(self) -> list[Periodic]:
        return [self.log, *self.hub.dumps.values(), *self.plots]
