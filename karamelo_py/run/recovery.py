"""Recovery of a run where a step went wrong, or energy has grown: half the step, or an end."""

from typing import Any

from karamelo_py.kernels.step import DONE, STOPPED
from karamelo_py.run.checkpoint.parts import RollbackPoint
from karamelo_py.run.diagnosis import energy, explain
from karamelo_py.run.timestep import own_step_instead
from karamelo_py.scene import boundary
from karamelo_py.scene.hub import Hub

CHUNK = 100  # steps between two looks at the run, and between two good states, at most
HALVINGS = 5  # at most, in a run
RETURNS = 2  # at most, to one state from where energy grows: what two halves do not mend stays


class RollBack:
    """The last good state of a run (`point`), and the way back to it.

    With `halve` it goes on from there with half the step; else the run ends.
    """

    def __init__(self, hub: Hub, *, halve: bool):
        self.hub, self.halve, self.place = hub, halve, hub.place
        self.point = RollbackPoint(hub)
        self.halvings = self.returns = 0

    def begin(self, simulation: Any, first_step: int, *, ruined: bool, looks_always: bool) -> None:
        """Begin with the present state, or with the good one of the file that a run goes on from.

        A step above the limit may have spoilt the present state (`ruined`); values of parts may be
        looked at between any two steps (`looks_always`).
        """
        self.simulation, self.first_step, self._always = simulation, first_step, looks_always
        too_large = not simulation.control.clock[0].watch_limit
        # Said of the first state: a later one is ruined, and its limit with it.
        self.smaller = "a smaller step" if ruined else own_step_instead(self.hub)
        self.smaller *= too_large
        # Points that are deleted would not come back.
        lost = ruined or self.hub.update.boundary == "delete"
        self.begun_at = -1 if lost else simulation.step
        if not self.point.arrays:
            self._keep()

    def before(self) -> None:
        """Keep the present state where it is due and good; else note what parts remember."""
        if self._keeps_start():  # whose rows are not gone back to
            return
        step = self.simulation.step
        # When states are kept must not depend on how fast steps are: runs go back to them.
        due = step != self.point.step and (step % CHUNK == 0 or step == self.first_step + 1)
        if due and energy.grown_little(self.simulation):
            self._keep()
        else:
            self.point.note(always=self._always)

    def after(self, status: int) -> bool:
        """Judge steps that ended with `status`: go on from there (True), or from where it is."""
        hub, simulation = self.hub, self.simulation
        if status != DONE:
            if status == STOPPED and boundary.delete_leaving(hub, simulation, self.point.arrays):
                self._keep()
            elif not self._halve_step(status=status):
                start = None
                if self.smaller and not simulation.control.clock[0].watch_limit:
                    start = explain.StepTooLarge(self.smaller, self.point.step == self.begun_at)
                explain.stop(hub, simulation, status, self.point, start, self.place)
            return False
        found = None if simulation.told_of_growth else energy.words_of_growth(hub, simulation)
        if found is not None:
            if self.returns < RETURNS and self._halve_step(found[0]):
                self.returns += 1
                energy.forget_growth(simulation)
                return False
            hub.warn(found[0], hint=found[1])
            simulation.told_of_growth = True
        return True

    def _keep(self) -> None:
        self.point.keep(self.simulation)
        self.returns = 0

    def _keeps_start(self) -> bool:
        """Tell whether the first state alone is good: the step was too large from there on."""
        return self.point.step == self.begun_at and not self.simulation.control.clock[0].watch_limit

    def _halve_step(self, message: str = "", status: int = DONE) -> bool:
        """Go back to the last good state with half the step, where the script asks for that."""
        hub, simulation = self.hub, self.simulation
        if not self.halve or self.halvings == HALVINGS:
            return False
        if status == STOPPED and explain.only_leave(hub, simulation, self.point.arrays):
            return False
        message = message or explain.trouble(hub, simulation, status)[0]
        self.halvings += 1
        # Rows of log and dumps that have been written since go with what they show.
        self.point.return_to(simulation, cut=True)
        self.point.forget_later()
        simulation.halve_step(self.halvings)
        while simulation.above_limit() and self.halvings < HALVINGS:
            # What is above the limit would only come back.
            self.halvings += 1
            simulation.halve_step(self.halvings)
        hub.warn(
            f"{message}. Back to step {simulation.step}, time {simulation.time:.6g}, with "
            f"1/{2**self.halvings} of the step",
            place=self.place,
        )
        return True
