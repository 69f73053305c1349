"""Commands that write the whole scene to a file, and go on from one."""

from pathlib import Path

from karamelo_py.language.signature import Argument, OutputFile
from karamelo_py.output.rhythm import ByTime, Every
from karamelo_py.output.schedule import RESTART
from karamelo_py.run.checkpoint import restart_file
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


class EveryOrNever(Every):
    """As `Every`, or 0."""

    script_kind = "a whole number of steps, time(T), or 0 for never"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> int | ByTime:
        """Return the interval of an argument; 0 for never."""
        return 0 if argument.text == "0" else super().from_script(hub, argument)


def restart(hub: Hub, every: EveryOrNever, file: OutputFile | None = None) -> None:
    """Write files from which the run can go on, again and again while the scene runs.

    Parameters
    ----------
    every
        Steps between two files, or ``time(T)``; 0 writes no more.
    file
        File name. The first ``*`` becomes the step number; without ``*`` each file takes the place
        of the one before.

    Notes
    -----
    ``karamelo-py SCRIPT -restart FILE`` goes on: the statements of the script are gone through,
    runs that were over are passed over, and the one that was in progress goes on behind the step of
    the file. Its results are those of a run that was never interrupted, bit for bit, with any
    number of threads; the log and the dumps go on in their files, whose later lines are cut off.
    Up to there the script has to be the same, except for commands that only say how a run
    goes on or what it writes (set_dt, dt_factor, set_output, dump, plot and the like); how long the
    last run is may change, as a number in its own line: variables stay what they were, and those
    that ``-var`` had set are taken from the file. A longer ``run(n)`` has the bits of one that was
    as long from the beginning. The last two steps of ``run_time(T)`` are shortened alike: a longer
    one has the bits of one that was as long from the beginning where the file was written before
    those two.

    A file holds everything that points and nodes carry, what fixes, computes, dumps and plots have
    seen or added up, and the values that the script has read. It is in HDF5, and whole or not
    there: a run that is killed leaves the one before. The last state of each run is written, too;
    that of a run that goes wrong is in last_good.<step>.h5 instead: of one whose energy has grown,
    the last state in which it had not (to ten steps); of one whose step was above the stable limit
    from its start on, the state before its first step (none with boundary(delete), or where the run
    went on from a file with that step). Dumps show the state in which a run was interrupted or went
    wrong (with such a step: where that is within a hundred steps); a run that goes on takes that
    out of their files again, but leaves snapshots that have a file of their own (with a ``*`` in
    the name).

    Example
    -------
    restart(1000, restart.*.h5)
    restart(time(0.1), latest.h5)

    See Also
    --------
    write_restart, read_restart
    """
    if file is None and every != 0:
        raise ScriptError("a file is missing", expected="restart(N, file), or restart(0)")
    hub.output.last.clear()
    if every == 0:
        return
    new = restart_file.Restarts(hub, every, Path(file))
    new.place = hub.place
    hub.output.check_file(new.file)
    hub.output.claim(new.file, RESTART)
    hub.output.last.append(new)


def write_restart(hub: Hub, file: OutputFile) -> None:
    """Write a file from which the script, or another one, can go on.

    Parameters
    ----------
    file
        File name. The first ``*`` becomes the step number.

    Notes
    -----
    ``karamelo-py SCRIPT -restart FILE`` goes on behind this line.

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
    """Put the scene into the state that a file holds.

    Parameters
    ----------
    file
        Name of a file that restart or write_restart has written. With a ``*`` it is the one with
        the largest number in its place.

    Notes
    -----
    The set-up stands before: domain, method and solids as in the script that wrote the file, and
    the fixes and computes that shall go on. Those that have the ID and style that they had there
    keep what they have seen, and initial velocities do not act once more. Everything else may be
    another: materials' constants, fixes, the time step, what is written. Time and step go on from
    those of the file. Files are begun anew, but for one thing: a picture or movie with the ID and
    style that it had there, of the same field, goes on with the colours of the pictures before.

    Example
    -------
    read_restart(settled.h5)

    See Also
    --------
    write_restart, restart
    """
    if hub.rehearsing or hub.checking or hub.interpreter.replay is not None:
        return
    if hub.update.method is None or not hub.solids:
        raise ScriptError(
            "there is no scene yet", expected="domain, method and solids before read_restart"
        )
    restart_file.Restart(Path(file).expanduser()).take(hub, outputs=False)


restart.may_differ = True
