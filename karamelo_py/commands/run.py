"""Commands that let time go on."""

from math import isnan
from typing import Annotated, Literal

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.run.runner import carry_out
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression

OnTrouble = Literal["stop", "halve"]


def set_dt(hub: Hub, dt: Annotated[float, Positive]) -> None:
    """Set a constant time step, instead of one that follows the fastest point.

    Parameters
    ----------
    dt
        Time step. Above the stable limit (cell size over wave speed plus velocity; less with scheme
        usl) a run warns; above four times that of conduction it does not begin.

    Example
    -------
    set_dt(0.001)

    See Also
    --------
    dt_factor
    """
    hub.update.fixed_dt, hub.update.dt_place = dt, hub.place
    hub.values.set("dt", dt)
    if hub.update.dt_factor is not None:
        _warn_of_factor(hub)


def dt_factor(hub: Hub, factor: Annotated[float, Positive]) -> None:
    """Set which share of the stable time step is taken.

    Parameters
    ----------
    factor
        Above 0; above 1 a run warns. Without this command the program takes 0.9, and less where a
        body that drifts would gain energy by that: with linear functions in the updated frame,
        FLIP or its kin (share above 0.99), and musl or usf 0.4, or 0.2 with one point a cell. While
        no point has gone a quarter of a cell since the start that is not asked for, and splines
        take a longer step; a factor is a share of the same stable step at rest as after.

    Example
    -------
    dt_factor(0.5)

    See Also
    --------
    set_dt
    """
    hub.update.dt_factor = factor
    if hub.update.fixed_dt is None:
        hub.update.dt_place = hub.place
    else:
        _warn_of_factor(hub)


def _warn_of_factor(hub: Hub) -> None:
    hub.warn("dt_factor has no effect: set_dt fixes the step", hint="leave one of them out")


def run(hub: Hub, steps: Annotated[int, NonNegative], *, on_trouble: OnTrouble = "stop") -> None:
    """Take a number of steps.

    Parameters
    ----------
    steps
        How many; exactly so many are taken.
    on_trouble
        ``stop``, or ``halve``: where a point goes wrong, energy comes from nowhere (from what is
        otherwise a warning on) or the step gets unstable, the run goes back to its last good state
        and tries half the step, at most five times, and says so. Log, dumps, curves, and computes
        that remember (errors, drifts) go back to that state, too: what had been written since is
        written again. Files and pictures of one step are overwritten when it comes again, or stay
        where it does not. Points that leave the domain without a gain of energy are no matter of
        the step: there the run stops (see `boundary`).

    Example
    -------
    run(1000)
    run(1000, on_trouble=halve)

    See Also
    --------
    run_time, run_until, run_while
    """
    carry_out(hub, steps=steps, halve=on_trouble == "halve")


def run_time(
    hub: Hub, time: Annotated[float, NonNegative], *, on_trouble: OnTrouble = "stop"
) -> None:
    """Run for a span of time; the last two steps are shortened to end there exactly.

    Parameters
    ----------
    time
        How long, from now.
    on_trouble
        As in run.

    Example
    -------
    run_time(3.5)

    See Also
    --------
    run, run_until, run_while
    """
    carry_out(hub, end_time=hub.update.time + time, halve=on_trouble == "halve")


def run_until(hub: Hub, condition: Expression, *, on_trouble: OnTrouble = "stop") -> None:
    """Run until a condition holds; it is looked at before every step.

    Parameters
    ----------
    condition
        Formula of time, timestep, dt and published values; anything but 0 ends the run. NaN
        is an error.
    on_trouble
        As in run.

    Example
    -------
    run_until(Ek < 0.01 && time > 1)

    See Also
    --------
    run, run_time, run_while
    """
    _refuse_constant("run_until", condition)
    carry_out(hub, condition=condition, until=True, halve=on_trouble == "halve")


def run_while(hub: Hub, condition: Expression, *, on_trouble: OnTrouble = "stop") -> None:
    """Run as long as a condition holds; it is looked at before every step.

    Parameters
    ----------
    condition
        Formula of time, timestep, dt and published values; 0 ends the run. NaN is an error.
    on_trouble
        As in run.

    Example
    -------
    run_while(time < 2)

    See Also
    --------
    run, run_time, run_until
    """
    _refuse_constant("run_while", condition)
    carry_out(hub, condition=condition, until=False, halve=on_trouble == "halve")


def _refuse_constant(command: str, condition: Expression) -> None:
    """A condition that is one number for ever ends the run at once or never."""
    if condition.is_constant:
        compare = ">=" if command == "run_until" else "<"
        number = 1.0 if isnan(condition.constant) else condition.constant
        raise ScriptError(
            "the condition never changes",
            argument="condition",
            expected="a formula of time, timestep, dt or values of fixes and computes",
            hint=f"{command}(time {compare} {number:g}), or run_time({number:g})",
        )


for _command in (set_dt, dt_factor):
    # Another one does no harm where a run goes on from a file.
    _command.may_differ = True
