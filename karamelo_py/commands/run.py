"""Commands that run, and that write and read restart files."""

from math import inf, isnan
from pathlib import Path
from typing import Annotated, Any, Literal

from karamelo_py.advice import known_failures
from karamelo_py.advice.choosing import AtFirstRun
from karamelo_py.advice.narrator import Narrator
from karamelo_py.advice.report import report
from karamelo_py.language import registry
from karamelo_py.language.kinds import kind_of
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import Argument, NonNegative, OutputFile, Positive
from karamelo_py.output.rhythm import ByTime, Every
from karamelo_py.output.schedule import RESTART
from karamelo_py.run.checkpoint import restart_file
from karamelo_py.run.condition import RunCondition
from karamelo_py.run.loop import RunLoop
from karamelo_py.run.lower.build import check_scene
from karamelo_py.run.lower.card import refuse, take_card
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Pause, Quit, ScriptError
from karamelo_py.script.expressions import POINT_SEEDS, Expression

OnTrouble = Literal["stop", "halve"]
_STEPS_OR_NEVER = kind_of(Annotated[int, NonNegative])


def carry_out(hub: Hub, **length: Any) -> None:
    """Run for `length` (see `RunLoop`), unless the script is only read or resumed.

    In a rehearsal the run is only recorded; ``check`` prints a report instead of running, and a
    Python program pauses before the run (`Pause`). A resumed script skips runs that were complete.
    """
    run = RunLoop(hub, **length, advice=Narrator(hub))
    check_scene(hub)
    if hub.scouting:
        raise AtFirstRun(run)
    if hub.rehearsing:
        hub.begun += 1
        if hub.settings.card:
            refuse(hub)
        span = run.end_time - hub.update.time, inf if run.steps is None else run.steps
        if not hub.update.scheme.traits.implicit:
            hub.later.append(known_failures.step_of(hub, run.rollback.point.halve, span))
        hub.in_runs += hub.lasting()
        return
    if hub.pausing:
        raise Pause
    hub.begun += 1
    hub.rehearse()
    if hub.checking:
        report(hub, run.end_time)
        run.tell(lambda to: to.begun(run, hub.simulation))
        hub.simulation.refuse()
        raise Quit
    if hub.settings.card:
        take_card(hub)
    replay = hub.interpreter.replay
    if replay is None or replay.at_end:
        run.run()
        return
    after = hub.restart.content["runs"][len(hub.runs)]
    for name, value in after.items():
        if name in hub.values:
            hub.values.set(name, value)
    hub.runs.append(after)


def set_dt(hub: Hub, dt: Annotated[float, Positive] | None) -> None:
    """Set a constant time step, or return to the step that the program chooses.

    Parameters
    ----------
    dt
        The time step, or NULL: the step again follows the fastest point. A run warns if the step is
        above the stable one, which is the cell size divided by (wave speed + velocity), less with
        usl. A run stops at once if the step is above four times the limit of heat conduction.

    Example
    -------
    set_dt(0.001)
    set_dt(NULL)

    See Also
    --------
    dt_factor
    """
    hub.update.fixed_dt, hub.update.dt_mark = dt, hub.mark
    if dt is None:
        return
    hub.values.set("dt", dt)
    if hub.update.dt_factor is not None and not hub.begun:
        _warn_of_factor(hub)


def dt_factor(hub: Hub, factor: Annotated[float, Positive]) -> None:
    """Set the time step as a fraction of the stable step.

    Parameters
    ----------
    factor
        Step / stable step. The default is 0.9, or 0.4 (0.2 with one point per cell) where a
        drifting body would otherwise gain energy: with a linear basis in ulmpm, a FLIP coefficient
        above 0.99, and scheme musl or usf. Until a point has moved a quarter of a cell, the default
        is 0.9, and more with splines. A factor set here always refers to the stable step of moving
        bodies; a run warns if it is unstable.

    Example
    -------
    dt_factor(0.5)

    See Also
    --------
    set_dt
    """
    hub.update.dt_factor = factor
    if hub.update.fixed_dt is None:
        hub.update.dt_mark = hub.mark
    else:
        _warn_of_factor(hub)


def _warn_of_factor(hub: Hub) -> None:
    """Warn, unless method(auto) has written the factor."""
    chosen = hub.update.chosen
    if chosen is not None and f"dt_factor({hub.update.dt_factor:g})" in chosen.lines:
        return
    hub.warn("dt_factor has no effect: set_dt fixes the step", hint="leave one of them out")


def run(hub: Hub, steps: Annotated[int, NonNegative], *, on_trouble: OnTrouble = "stop") -> None:
    """Run a number of steps.

    Parameters
    ----------
    steps
        Exact number of steps.
    on_trouble
        ``stop`` (default), or ``halve``: if a point fails, the step becomes unstable, or energy
        appears that no load supplied (only a warning with ``stop``), the run returns to its last
        good state and halves the step, at most five times. Log, dumps, curves and computes also
        return to this state. If points leave the domain although the step is stable and no energy
        was gained, the run stops, because a smaller step would not help.

    Example
    -------
    run(1000)
    run(1000, on_trouble=halve)

    Notes
    -----
    The log shows positions and stresses at the end of a step, and velocities half a step earlier:
    after n steps of free fall, the kinetic energy is too low by the fraction 1/(n + 1). With
    ``scheme(musl, start=half)`` all values belong to the logged time.

    See Also
    --------
    run_time, run_until, run_while
    """
    carry_out(hub, steps=steps, halve=on_trouble == "halve")


def run_time(
    hub: Hub, time: Annotated[float, NonNegative], *, on_trouble: OnTrouble = "stop"
) -> None:
    """Run for a given time; the last two steps are shortened to end there exactly.

    Parameters
    ----------
    time
        Duration, from now.
    on_trouble
        ``halve``: after a failure, return to the last good state and halve the step, as in run.

    Example
    -------
    run_time(3.5)

    Notes
    -----
    Kinetic energies in the log belong to a time half a step earlier (see `run`).

    See Also
    --------
    run, run_until, run_while
    """
    carry_out(hub, end_time=hub.update.time + time, halve=on_trouble == "halve")


def run_until(hub: Hub, condition: Expression, *, on_trouble: OnTrouble = "stop") -> None:
    """Run until a condition holds; it is checked before every step.

    Parameters
    ----------
    condition
        Formula of time, timestep, dt and published values; a value other than 0 ends the run. NaN
        is an error.
    on_trouble
        ``halve``: after a failure, return to the last good state and halve the step, as in run.

    Example
    -------
    run_until(Ek < 0.01 && time > 1)

    See Also
    --------
    run, run_time, run_while
    """
    _check("run_until", condition)
    carry_out(hub, condition=RunCondition(condition, until=True), halve=on_trouble == "halve")


def run_while(hub: Hub, condition: Expression, *, on_trouble: OnTrouble = "stop") -> None:
    """Run as long as a condition holds; it is checked before every step.

    Parameters
    ----------
    condition
        Formula of time, timestep, dt and published values; 0 ends the run. NaN is an error.
    on_trouble
        ``halve``: after a failure, return to the last good state and halve the step, as in run.

    Example
    -------
    run_while(time < 2)

    See Also
    --------
    run, run_time, run_until
    """
    _check("run_while", condition)
    carry_out(hub, condition=RunCondition(condition, until=False), halve=on_trouble == "halve")


def _check(command: str, condition: Expression) -> None:
    if per_point := condition.names & set(POINT_SEEDS):
        message = f"the condition depends on {min(per_point)}, which differs from point to point"
        expected = "a formula of time, timestep, dt and values of fixes and computes"
        raise ScriptError(message, argument="condition", expected=expected)
    if condition.is_constant:
        compare = ">=" if command == "run_until" else "<"
        number = 1.0 if isnan(condition.constant) else condition.constant
        message = "the condition never changes"
        expected = "a formula of time, timestep, dt or values of fixes and computes"
        hint = f"{command}(time {compare} {number:g}), or run_time({number:g})"
        raise ScriptError(message, argument="condition", expected=expected, hint=hint)


class EveryOrNever(Every):
    script_kind = "a whole number of steps, time(T), or 0 for never"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> int | ByTime:
        if argument.text.startswith("time"):
            return super().from_script(hub, argument)
        return _STEPS_OR_NEVER.convert(hub, argument)


def restart(hub: Hub, every: EveryOrNever, file: OutputFile | None = None) -> None:
    """Write restart files at intervals, from which the run can be resumed.

    Parameters
    ----------
    every
        Steps between two files, or ``time(T)``; 0 stops writing.
    file
        By default ``restart.h5``. The first ``*`` becomes the step number; without ``*`` each file
        replaces the previous one.

    Notes
    -----
    ``karamelo-py SCRIPT -restart FILE`` resumes after the step of the file, bit-identically to an
    uninterrupted run with any number of threads. Log and dumps continue; lines written after that
    step are removed.

    The script must be unchanged up to this run, except for set_dt, dt_factor, set_output, dump,
    plot, an added ``boundary(delete)``, and the length of the last run, as a number in its line.
    Variables set with ``-var`` come from the file. If the last run is lengthened, results are
    bit-identical to one run of the new length; for ``run_time(T)`` only from a file written before
    the last two steps of the shorter run, which end exactly at T.

    A file (HDF5) contains all fields of points and nodes, the state of fixes, computes, dumps and
    plots, and values returned by commands such as ``value``. If a run is killed while writing, the
    previous file remains. The last state of each run is always written. A failed run writes
    last_good.<step>.h5 instead: the initial state if its time step was above the stable limit from
    the start, or, if its energy has grown, a state at most ten steps before the growth. This file
    is not written with boundary(delete), or if the run was resumed from a file at that step.

    Dumps include the state at an interruption or failure. A resumed run removes this snapshot from
    files with several snapshots.

    Example
    -------
    restart(1000, restart.*.h5)
    restart(time(0.1), latest.h5)

    See Also
    --------
    write_restart, read_restart
    """
    hub.output.last.clear()
    if every == 0:
        return
    new = restart_file.Restarts(hub, every, Path(file or "restart.h5"))
    new.mark = hub.mark
    hub.output.check_file(new.file)
    hub.output.claim(new.file, RESTART)
    hub.output.last.append(new)


def write_restart(hub: Hub, file: OutputFile) -> None:
    """Write a file from which this or another script can be resumed.

    Parameters
    ----------
    file
        File name. The first ``*`` becomes the step number.

    Notes
    -----
    ``karamelo-py SCRIPT -restart FILE`` resumes after this line; runs may be added there. Earlier
    runs must have the same length.

    Example
    -------
    write_restart(settled.h5)

    See Also
    --------
    restart, read_restart
    """
    hub.output.check_file(Path(file))
    hub.output.claim(Path(file), RESTART)
    if hub.rehearsing or hub.checking:
        return
    if hub.update.method is None or not hub.solids:
        raise ScriptError("there is nothing to write yet", expected="a method and solids before")
    hub.answered = True
    replay = hub.interpreter.replay
    if replay is None:
        restart_file.write(hub, Path(file), within=False)
    elif replay.at_end:
        hub.restart.take(hub, outputs=True)
        hub.restart = hub.interpreter.replay = None


def read_restart(hub: Hub, file: str) -> None:
    """Set the scene to the state in a restart file.

    Parameters
    ----------
    file
        A file written by restart or write_restart, in the current folder or next to the script.
        With a ``*``, the file with the largest number is read.

    Notes
    -----
    Before this line, repeat the domain, method and solids of the script that wrote the file, and
    the fixes and computes to continue: with the same ID and style they retain their values.
    Everything else may differ. Time and step continue; initial velocities are not applied again.

    The run starts new output files. A picture or movie with the same ID, style and field retains
    the earlier colour scale.

    Example
    -------
    read_restart(settled.h5)

    See Also
    --------
    write_restart, restart
    """
    ahead = hub.rehearsing or hub.checking
    if hub.interpreter.replay is not None or (ahead and RESTART in hub.output.files.values()):
        return
    if hub.update.method is None or not hub.solids:
        raise ScriptError(
            "there is no scene yet", expected="domain, method and solids before read_restart"
        )
    path = Path(file).expanduser()
    ways = [folder / path for folder in hub.interpreter.folders]
    chosen = next((way for way in ways if any(way.parent.glob(way.name))), path)
    restart = restart_file.Restart(chosen)
    if not ahead:
        restart.take(hub, outputs=False)


registry.may_differ(set_dt, dt_factor, restart)
