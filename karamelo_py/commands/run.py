"""Commands that let time go on."""

from __future__ import annotations

from math import isnan
from typing import Annotated

from karamelo_py.language.signature import NonNegative, Positive
from karamelo_py.run.runner import Runner
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.update import DEFAULT_DT_FACTOR
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression


def set_dt(hub: Hub, dt: Annotated[float, Positive]) -> None:
    """Set a constant time step, instead of one that follows the fastest point.

    Parameters
    ----------
    dt
        Time step. Above the stable limit (cell size over wave speed plus velocity; less with scheme
        usl) a run warns.

    Example
    -------
    set_dt(0.001)

    See Also
    --------
    dt_factor
    """
    hub.update.fixed_dt = dt
    hub.values.set("dt", dt)
    if hub.update.dt_factor != DEFAULT_DT_FACTOR:
        _warn_of_factor(hub)


def dt_factor(hub: Hub, factor: Annotated[float, Positive]) -> None:
    """Set which share of the stable time step is taken.

    Parameters
    ----------
    factor
        Above 0; 0.9 without this command. Above 1 a run warns.

    Example
    -------
    dt_factor(0.5)

    See Also
    --------
    set_dt
    """
    hub.update.dt_factor = factor
    if hub.update.fixed_dt is not None:
        _warn_of_factor(hub)


def _warn_of_factor(hub: Hub) -> None:
    hub.warn("dt_factor has no effect: set_dt fixes the step", hint="leave one of them out")


def run(hub: Hub, steps: Annotated[int, NonNegative]) -> None:
    """Take a number of steps.

    Parameters
    ----------
    steps
        How many; exactly so many are taken.

    Example
    -------
    run(1000)

    See Also
    --------
    run_time, run_until, run_while
    """
    Runner(hub, steps=steps).run()


def run_time(hub: Hub, time: Annotated[float, NonNegative]) -> None:
    """Run for a span of time; the last two steps are shortened to end there exactly.

    Parameters
    ----------
    time
        How long, from now.

    Example
    -------
    run_time(3.5)

    See Also
    --------
    run, run_until, run_while
    """
    Runner(hub, end_time=hub.update.time + time).run()


def run_until(hub: Hub, condition: Expression) -> None:
    """Run until a condition holds; it is looked at before every step.

    Parameters
    ----------
    condition
        Formula of time, timestep, dt and published values; anything but 0 ends the run.

    Example
    -------
    run_until(Ek < 0.01 && time > 1)

    See Also
    --------
    run, run_time, run_while
    """
    _refuse_constant("run_until", condition)
    Runner(hub, condition=condition, until=True).run()


def run_while(hub: Hub, condition: Expression) -> None:
    """Run as long as a condition holds; it is looked at before every step.

    Parameters
    ----------
    condition
        Formula of time, timestep, dt and published values; 0 ends the run.

    Example
    -------
    run_while(time < 2)

    See Also
    --------
    run, run_time, run_until
    """
    _refuse_constant("run_while", condition)
    Runner(hub, condition=condition, until=False).run()


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
