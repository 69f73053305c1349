"""End of a failed run: write its last good state, and the final rows of log and dumps."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from karamelo_py.kernels.step import DONE, GAINED, HEATED, STOPPED
from karamelo_py.kernels.watch import GROWTH, LOOK, WITHIN, unit_of
from karamelo_py.run.backend import Backend
from karamelo_py.run.checkpoint import restart_file
from karamelo_py.run.checkpoint.parts import OUTPUTS, PartStates, RollbackPoint
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError

LAST_GOOD = Path("last_good.*.h5")
MOST_REPEATED = 100  # steps that may be repeated for the final rows of log and dumps


CHANGES = {"left-domain": "boundary(delete)", "body-left": "another fix rigid_body of the same ID"}


class OthersWait(Exception):
    """This process cannot write a file, and other processes wait to send data for it."""


class LastGood(NamedTuple):
    """Ends a failed run at its last good state; methods return the command that resumes."""

    hub: Hub
    simulation: Backend
    good: RollbackPoint

    def keep_start(self, status: int, *, writes: bool) -> str:
        """End outputs after a step that was too large; with `writes`, write the initial state."""
        simulation, good = self.simulation, self.good
        step, present, path = simulation.step, PartStates.of(self.hub, OUTPUTS), None
        good.return_to(simulation)
        if writes:
            path = self._write()
        present.give(self.hub)  # outputs have not written to their files since
        end = step - (status in (GAINED, HEATED))
        if end - simulation.step <= MOST_REPEATED:
            good.again(simulation.advance, end)
            self._end_outputs()
        return self._resume(path)

    def _resume(self, path: Path | None, remark: str = "") -> str:
        if path is None:
            return ""
        names = self.hub.record.script, os.path.relpath(path), os.path.relpath(self.hub.folder)
        script, file, folder = (f'"{name}"' if " " in name else name for name in names)
        out = f" -out {folder}" if folder != os.curdir else ""
        return f"karamelo-py {script} -restart {file}{out}" + (remark and f"  # {remark}")

    def keep(self, status: int, code: str) -> str:
        simulation, good = self.simulation, self.good
        step, present = simulation.step, PartStates.of(self.hub, OUTPUTS)
        watch = simulation.energy_watch
        grown, path = not watch.is_sound(), None
        if grown:
            path = self._write_before_growth(step)
        else:
            good.return_to(simulation)
            if status not in (GAINED, HEATED, STOPPED):
                # Repeat the same calls: nodal values depend on the number of steps per call.
                good.again(simulation.advance, step)
        if status not in (GAINED, HEATED) and step > simulation.step:
            before = watch.energy()
            good.again(simulation.advance, step)
            if path is None and watch.growth_since(before) > WITHIN:
                # The monitor averages over 100 steps, so its reports are late.
                grown, path = True, self._write_before_growth(step)
                good.again(simulation.advance, step)
        path = path or self._write()
        if simulation.step < step:
            present.give(self.hub)
        self._end_outputs()
        change = CHANGES.get(code, simulation.remedy)
        return self._resume(path, f"{'before energy grew; ' * grown}with {change}")

    def _write_before_growth(self, end: int) -> Path | None:
        simulation, good = self.simulation, self.good
        good.return_to(simulation)
        energy = simulation.control.energy[0]
        before = float(energy.balance)
        while energy.watch_energy and simulation.step + LOOK < end:
            look = simulation.step + LOOK - (simulation.step - 1) % LOOK
            healthy = good.again(simulation.advance, look) == DONE
            if not (healthy and simulation.energy_watch.is_sound()):
                break
            if energy.balance - before < GROWTH * unit_of(energy):
                good.keep(simulation, forget=False)
        good.return_to(simulation)
        return self._write()

    def _write(self) -> Path | None:
        hub, path = self.hub, restart_file.path_of(self.hub, LAST_GOOD)
        may_be = hub.settings.comm.bcast(not path.exists() or restart_file.is_restart(path))
        if not (hub.output.takes_part and may_be):
            return None
        with self._as_warnings():
            path = restart_file.write(hub, LAST_GOOD, within=True)
            for item in hub.output.last:
                item.last_step = hub.update.step
            return path
        return None

    def _end_outputs(self) -> None:
        with self._as_warnings():
            self.hub.output.write(last=True)

    @contextmanager
    def _as_warnings(self) -> Iterator[None]:
        try:
            yield
        except ScriptError as error:
            hub = self.hub
            hub.warn(error.message, hint=error.hint, mark=error.mark)
            if hub.settings.comm.size > 1:
                hub.settings.comm.failed_within = True
                raise OthersWait from None
