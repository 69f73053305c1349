"""A scene stepped by several processes, with the bits of one.

All processes carry out the script, up to a run. There the first leads: it does what a single
process does, and has the others step with it. Each has the points of its tiles. What is to be seen
between two steps by what knows nothing of parts (most computes, pictures, files to go on from) the
first gathers into the arrays of a whole scene, and hands out anew where something has changed them.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import Setup, arrays_of
from karamelo_py.output.fields import PIECE
from karamelo_py.run.checkpoint.arrays import of_nodes
from karamelo_py.run.mpi.callbacks import reads_totals
from karamelo_py.run.mpi.holding import Held, Holding
from karamelo_py.run.mpi.leading import Abandoned, At, HandedOutAnew, by_all
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.tiles.boxes import numbers
from karamelo_py.script.errors import ScriptError

FIRST, LAST = -(2**63), 2**63 - 1  # before all keys of points, and behind them
SAMPLES = 256  # keys of all processes, by which a piece of points is cut
CHANGING = ("advance", "set_initial", "remove")  # what changes the points


class Ranks(Holding):
    """A scene that several processes step together."""

    # --- before steps -----------------------------------------------------------------------------

    def prepare(self, begun: list[str]) -> None:
        """Make ready for the steps of a run: the hooks of the fixes that are left to act."""
        self.begun = begun
        self._make_ready()

    def _see_prepared(self) -> None:
        """Have all that follow made ready."""
        if self._at is At.LEADING:
            self._tell("prepare", self.begun)
            self._at = At.READY

    # --- steps ------------------------------------------------------------------------------------

    def _all_do(self, name: str, *arguments: Any) -> Any:
        """Have each process call one of its methods for its part; what the first finds."""
        self._see_parts()
        clock = self.control.clock.view(np.ndarray)
        found = self._together("do", name, self.control.values, clock, arguments)
        if name in CHANGING:
            self._handed_out = self.version
        return found

    def do(self, name: str, values: np.ndarray, clock: np.ndarray, arguments: tuple) -> Any:
        """Call a method for the part of this process, with these values and this clock."""
        self.control.values[:] = values
        self.control.clock.view(np.ndarray)[:] = clock
        with self._steps():
            found = getattr(self, name)(*arguments)
        if name in CHANGING:
            self._let_go()
        return found

    def advance(self, count: int) -> int:
        """Take up to `count` steps, all processes together; DONE, or why it stopped."""
        if self._stepping:
            part = self.part
            from_python = self._python.by_stage or self._first is not None
            part.answers.at_once = bool(from_python) or reads_totals(self.hooks)
            part.begin()
            status = super().advance(count)
            part.account()
            part.answers.publish()
            # What is written shows steps that no process has failed in.
            self.signal = int(self.most(np.array([self.crew.signal]))[0])
            return status
        self._see_prepared()
        return self._all_do("advance", count)

    def set_initial(self, ID: str) -> None:
        """Let the fix `ID` set the state that a run begins with."""
        if self._stepping or not self.hub.fixes[ID].point_by_point:
            super().set_initial(ID)
        else:
            self._all_do("set_initial", ID)

    @by_all
    def leaving(self) -> np.ndarray | None:
        """Ids of the points whose new places lie beyond the edge, of all for the first."""
        found = super().leaving()
        if self._stepping:
            of_all = self.crew.gathered(found)
            found = np.sort(np.concatenate(of_all)) if of_all is not None else None
        return found

    remove = by_all(Simulation.remove)

    begin_to_look = by_all(Simulation.begin_to_look)
    energy = by_all(Simulation.energy)
    measure = by_all(Simulation.measure)
    measure_heat = by_all(Simulation.measure_heat)
    fastest = by_all(Simulation.fastest)
    motions = by_all(Simulation.motions)

    @by_all
    def counts(self) -> list[int]:
        """How many points each block has."""
        return self.of_all(np.array(super().counts())).tolist()

    def total(self, name: str, group: Any = None) -> float:
        """What all points, or those of a group, have together; without rounding."""
        return self.total_of(name, None if group is None or group.all else group.id)

    @by_all
    def total_of(self, name: str, ID: str | None) -> float:
        """The same, by the ID of the group."""
        return super().total(name, None if ID is None else self.hub.groups[ID])

    def added_up(self, part: Any, name: str, *arguments: Any) -> np.ndarray:
        """Sums over the points of a part's group of what its method `name` says."""
        if self._at_hand:
            return super().added_up(part, name, *arguments)
        return self._all_do("ask", "added_up", *self._named(part), name, *arguments)

    def each(self, part: Any, name: str, *arguments: Any) -> list:
        """What a method of a part says of some points of its group after others."""
        if self._at_hand:
            found = super().each(part, name, *arguments)
            return self.crew.gathered(found) if self._stepping else found
        found = self._all_do("ask", "each", *self._named(part), name, *arguments)
        return [one for of_rank in found for one in of_rank]

    def seen(self, say: Callable, *arguments: Any) -> list:
        """What a function says of the points at hand, of each process."""
        if self._at_hand:
            found = super().seen(say, *arguments)
            return self.crew.gathered(found[0]) if self._stepping else found
        return self._all_do("seen", say, *arguments)

    def counted_of(self, part: Any, name: str, size: int, *arguments: Any) -> np.ndarray:
        """How many points of a part's group have each of `size` numbers, which its method says."""
        if self._at_hand:
            return super().counted_of(part, name, size, *arguments)
        return self._all_do("ask", "counted_of", *self._named(part), name, size, *arguments)

    def in_order(self, part: Any, name: str, *arguments: Any) -> Iterator[np.ndarray]:
        """Rows of the points of a part's group in the order of keys; none has those of all."""
        if self._at_hand:
            yield from super().in_order(part, name, *arguments)
            return
        found = self._all_do("ask", "keep_in_order", *self._named(part), name, *arguments)
        some = np.sort(np.concatenate(found))[SAMPLES::SAMPLES]
        for first, end in pairwise([FIRST, *some.tolist(), LAST]):
            keys, rows = zip(*self._together("give_in_order", first, end), strict=True)
            yield np.concatenate(rows, axis=1)[:, np.argsort(np.concatenate(keys))]

    def keep_in_order(self, part: Any, name: str, *arguments: Any) -> list | None:
        """Put own points in order; some of their keys, of all processes for the first."""
        self._in_order = keys, _ = self.ordered(part, name, *arguments)
        return self.crew.gathered(keys[:: max(PIECE // SAMPLES, 1)])

    def give_in_order(self, first: int, end: int) -> list | None:
        """Own keys from `first` to before `end` and their rows, for the first those of all."""
        keys, rows = self._in_order
        own = slice(*np.searchsorted(keys, (first, end)))
        if end == LAST:
            del self._in_order
        return self.crew.gathered((keys[own], rows[:, own]))

    def ask(self, what: str, family: str, ID: str, *arguments: Any) -> Any:
        """Call a method with a part of the scene."""
        return getattr(self, what)(self._catalogues[family][ID], *arguments)

    def _named(self, part: Any) -> tuple[str, str]:
        """What a part is called at other processes."""
        found = (kind for kind, all in self._catalogues.items() if all.get(part.id) is part)
        return next(found), part.id

    @property
    def _catalogues(self) -> dict[str, Any]:
        return {catalogue.kind: catalogue for catalogue in self.hub.catalogues}

    def of_all(self, numbers: np.ndarray) -> np.ndarray:
        """Sums over all processes, where each looks at its part."""
        return self.crew.added(numbers) if self._stepping else numbers

    def most(self, numbers: np.ndarray) -> np.ndarray:
        """The largest of each number of all processes, where each looks at its part."""
        return self.crew.largest(numbers) if self._stepping else numbers

    def everyone(self, what: str, thing: Any) -> list:
        """What each process has, where all ask for the same (in words).

        Raises
        ------
        ScriptError
            If a function in Python asks on one process for what it does not on another.
        """
        if not self._stepping:
            return [thing]
        asked, found = zip(*self.crew.everyone((what, thing)), strict=True)
        if other := next((one for one in asked if one != asked[0]), None):
            raise ScriptError(
                f"a function in Python comes to {asked[0]} on one process, and to {other} on "
                "another",
                hint="points.total(terms) and nodes.total(terms) have to be asked for by all "
                "processes, those without points too",
            )
        return list(found)

    def at_first(self, make: Callable[[list], list], thing: Any) -> Any:
        """What the first process makes of what each has: for each its own."""
        if not self._stepping:
            return make([thing])[0]
        found = self.crew.gathered(thing)
        return self.crew.handed_out(None if found is None else make(found))

    def waits(self) -> np.ndarray:
        """Seconds that each process has waited for others in steps so far."""
        return np.array(self._together("tell_of_waiting"))

    def tell_of_waiting(self) -> list | None:
        """The same, of all processes for the first."""
        return self.crew.gathered(self.crew.waited)

    def compile(self) -> None:
        """Have the loop over the steps compiled now, by all processes."""
        self._see_prepared()
        self._see_parts()
        self.compile_part()
        self._tell("compile_part")  # and find on disk what has been compiled

    def compile_part(self) -> None:
        """Compile the loop of this process."""
        with self._steps():
            super().compile()

    def _advance(self, count: int) -> int:
        target = self.step + count
        while True:
            try:
                return super()._advance(target - self.step)
            except HandedOutAnew:
                self.taken_up = True

    def act(self, function: Callable[[Setup], None], _: Setup) -> None:
        """In the midst of a step: the first acts on the whole, and all take over what it did."""
        self.gather()
        crew, control = self.crew, self.control
        if crew.leads:
            told = self._act(function)
            crew.told(told)
        elif (told := crew.told()) is None:
            raise Abandoned
        what, values, clock, *arguments = told
        control.values[:] = values
        control.clock.view(np.ndarray)[:] = clock
        getattr(self, what)(*arguments, shares=self._shares() if crew.leads else None)
        if what == "take":
            raise HandedOutAnew

    def _act(self, function: Callable[[Setup], None]) -> tuple:
        """Act on the whole; what the others are to do then, and with what."""
        self._stepping, sorts = False, self.tiles.sorts
        try:
            function(self._whole)
        except BaseException:
            self.crew.told(None)
            self._at = At.LEADING  # the others know
            raise
        self._stepping = True
        now = self.control.values, self.control.clock.view(np.ndarray)
        if self.tiles.sorts > sorts:
            return "take", *now, *self._cut()
        nodes = numbers(self._whole.spans)
        return "take_back", *now, nodes, [array[nodes] for _, array in of_nodes(self._whole)]

    def take_back(self, nodes: np.ndarray, rows: list, shares: list | None = None) -> None:
        """Put what the first has changed into the arrays that a step is at work on."""
        s, found = self.part.setup, self.crew.handed_out(shares)
        here = np.isin(nodes, numbers(s.spans))
        for (_, array), own in zip(of_nodes(s), rows, strict=True):
            array[nodes[here]] = own[here]
        for k, block in enumerate(s.blocks):
            for name, array in arrays_of(block.points):
                array[...] = found[f"points/{k}/{name}"]

    @contextmanager
    def _steps(self) -> Iterator[None]:
        self._stepping = True
        try:
            yield
        finally:
            self._stepping = False

    # --- state that can be returned to ------------------------------------------------------------

    def snapshot(self, before: Any = None) -> dict[str, np.ndarray]:
        """Have every process keep its present state; what the first keeps."""
        self._see_parts()
        return self._together("keep")

    def keep(self) -> dict[str, np.ndarray]:
        """Copy every array of the part that a step changes."""
        return self.part.keep()

    def restore(self, snapshot: dict[str, np.ndarray]) -> None:
        """Return to a snapshot, all processes together."""
        self._together("go_back")
        self._held = Held.PARTS
        self.version += 1
        self._handed_out = self.version

    def go_back(self) -> None:
        """Put back what was kept."""
        self.part.restore(self.part.kept)
