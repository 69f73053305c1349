"""Functions that kernels call for other processes (:mod:`karamelo_py.kernels.ranks`)."""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from karamelo_py.compiler.formula import GLOBAL, UNIFORM
from karamelo_py.compiler.loops import address_of_python
from karamelo_py.kernels import ranks
from karamelo_py.kernels.arrays import DT
from karamelo_py.kernels.totals import WORK, rounded
from karamelo_py.run.mpi.load import Load


class Callbacks:
    """Functions that kernels call where they need other processes.

    Attributes
    ----------
    address
        Of the function that kernels call.
    at_once
        Whether what fixes publish is added up in each step.
    due
        Otherwise: which of these values are, when the last is over.
    """

    at_once = False

    def __init__(self, simulation: Any, load: Load):
        self.simulation, self.comm, self.load = simulation, simulation.comm, load
        self.control = simulation.setup.control
        self.due: set[int] = set()
        self.address = address_of_python(self.answer, ranks.CALL)

    def answer(self, what: int, a: int, b: int) -> int:
        """Do what kernels ask for."""
        try:
            self.load.note()
            found = self._answers[what](self, a, b) or 0
            if what == ranks.NEXT:
                self.load.next_block()
            else:
                self.load.resume(0 if what in {ranks.SWEEP, ranks.GIVE} else None)
            return found
        except BaseException as error:
            # Nothing can be raised through a kernel, and the others wait.
            self.comm.fail(error)
            raise

    def _go_on(self, *_: int) -> None:
        """Take the time alone."""

    def _give(self, number: int, what: int) -> None:
        self.simulation.tiles.give(self.simulation.setup, number, what)

    def _take(self, *_: int) -> None:
        self.simulation.tiles.take()

    def _totals(self, first: int, count: int) -> None:
        rows = slice(first, first + count)
        if WORK < first < len(self.control.values) and not self.at_once:
            self.due.update(range(first, first + count))
            self.control.answer[:count] = self.control.values[rows]
            return
        of_all = self.comm.allreduce(self.control.totals[rows])
        for k in range(count):
            self.control.answer[k] = rounded(of_all[k])

    def publish(self) -> None:
        """Add up the values of the last step over all: their totals are kept until the next."""
        rows, values = sorted(self.due), self.control.values
        self.due.clear()
        if rows:
            for row, total in zip(
                rows, self.comm.allreduce(self.control.totals[rows]), strict=True
            ):
                values[row] = rounded(total)
            for of, to in getattr(self.simulation.setup.contact, "copies", ()):
                values[to : to + 3] = values[of : of + 3]

    def _largest(self, count: int, _: int) -> None:
        self.comm.allreduce_max(self.control.answer[:count])

    def _number(self, number: int, _: int) -> int:
        return int(self.comm.allreduce(np.array([number]))[0])

    _answers: ClassVar[dict[int, Callable]] = {
        ranks.SWEEP: _go_on, ranks.NEXT: _go_on, ranks.GIVE: _give, ranks.TAKE: _take,
        ranks.TOTALS: _totals, ranks.LARGEST: _largest, ranks.NUMBER: _number,
    }  # fmt: skip


def reads_totals(hooks: Any) -> bool:
    """Tell whether formulas read within steps what fixes publish."""
    code = getattr(hooks, "code", np.empty((0, 2), np.int64))
    return bool(((code[:, 0] % UNIFORM == GLOBAL) & (code[:, 1] > DT)).any())
