"""What kernels ask of the other processes that share a scene (karamelo_py.kernels.ranks)."""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from karamelo_py.compiler.addresses import address_of_python
from karamelo_py.compiler.formula import GLOBAL, UNIFORM
from karamelo_py.kernels import ranks
from karamelo_py.kernels.arrays import DT, Control
from karamelo_py.kernels.totals import WORK, rounded
from karamelo_py.run.mpi.crew import Crew
from karamelo_py.run.mpi.load import Work


class Answers:
    """Gives them.

    Attributes
    ----------
    address
        Of the function that kernels call.
    part
        The points of this process.
    at_once
        Whether what fixes publish is added up in each step.
    due
        Otherwise: which of these values are, when the last is over.
    """

    part: Any
    at_once = False

    def __init__(self, crew: Crew, control: Control, work: Work):
        self.crew, self.control, self.work = crew, control, work
        self.due: set[int] = set()
        self.address = address_of_python(self.answer, ranks.CALL)

    def answer(self, what: int, a: int, b: int) -> int:
        """What kernels ask of the other processes (karamelo_py.kernels.ranks)."""
        try:
            self.work.note()
            found = self._answers[what](self, a, b) or 0
            if what == ranks.NEXT:
                self.work.next_block()
            else:
                self.work.resume(0 if what in {ranks.SWEEP, ranks.GIVE} else None)
            return found
        except BaseException as error:
            # Nothing can be raised through a kernel, and the others wait.
            self.crew.fail(error)
            raise

    def _go_on(self, *_: int) -> None:
        """Only the time is taken."""

    def _give(self, number: int, what: int) -> None:
        self.part.tiles.give(self.part.setup, number, what)

    def _take(self, *_: int) -> None:
        self.part.tiles.take()

    def _totals(self, first: int, count: int) -> None:
        rows = slice(first, first + count)
        if WORK < first < len(self.control.values) and not self.at_once:
            self.due.update(range(first, first + count))
            self.control.answer[:count] = self.control.values[rows]
            return
        of_all = self.crew.added(self.control.totals[rows])
        for k in range(count):
            self.control.answer[k] = rounded(of_all[k])

    def publish(self) -> None:
        """Values of the last step become those of all: their totals are kept until the next."""
        rows, values = sorted(self.due), self.control.values
        self.due.clear()
        if rows:
            for row, total in zip(rows, self.crew.added(self.control.totals[rows]), strict=True):
                values[row] = rounded(total)
            for of, to in getattr(self.part.setup.contact, "copies", ()):
                values[to : to + 3] = values[of : of + 3]

    def _largest(self, count: int, _: int) -> None:
        self.crew.largest(self.control.answer[:count])

    def _number(self, number: int, _: int) -> int:
        return int(self.crew.added(np.array([number]))[0])

    _answers: ClassVar[dict[int, Callable]] = {
        ranks.SWEEP: _go_on, ranks.NEXT: _go_on, ranks.GIVE: _give, ranks.TAKE: _take,
        ranks.TOTALS: _totals, ranks.LARGEST: _largest, ranks.NUMBER: _number,
    }  # fmt: skip


def reads_totals(hooks: Any) -> bool:
    """Whether formulas read within steps what fixes publish."""
    code = getattr(hooks, "code", np.empty((0, 2), np.int64))
    return bool(((code[:, 0] % UNIFORM == GLOBAL) & (code[:, 1] > DT)).any())
