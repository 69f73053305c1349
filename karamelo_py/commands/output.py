"""Commands dump, log, plot and their options."""

import re
from pathlib import Path
from typing import Annotated, Literal

from karamelo_py.language import registry, signature
from karamelo_py.language.arguments import NUMBER
from karamelo_py.language.kinds import StyleOf
from karamelo_py.language.signature import Argument, OutputFile
from karamelo_py.output.files import picture_format
from karamelo_py.output.plots import PlottedCurve
from karamelo_py.output.quantity import Logged, Quantity
from karamelo_py.output.rhythm import ByTime, Every
from karamelo_py.output.units import LENGTHS, MASSES, TIMES, Units
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


def dump(
    hub: Hub,
    ID: str,
    group: Literal["all"],
    style: Annotated[str, StyleOf("dump")],
    *arguments: Argument,
) -> None:
    """Write snapshots of points or nodes to files at intervals.

    Parameters
    ----------
    group
        Always the word ``all``.
    style
        The content and format of the files.
    arguments
        The interval, the file name, then the arguments of the style (see its page). The interval is
        a number of steps, or ``time(T)``: the first step at or after each multiple of the time T.

    Notes
    -----
    File names are relative to the folder where the program was started; ``~`` is the home folder.
    Folders must exist. Files are overwritten, but later snapshots of a longer run remain.

    Example
    -------
    dump(d1, all, particle, 100, dump_p.*.LAMMPS, x, y, z, vx, vy, vz)

    See Also
    --------
    delete_dump
    """
    target = registry.called("dump", ID, style)
    _check_order(hub, arguments)
    new = signature.call(target, hub, list(arguments), f"dump {style}")
    new.style = style
    hub.dumps.refuse(ID)
    try:
        hub.output.claim(new.file, f"dump '{ID}'")
    except ScriptError as error:
        error.mark = arguments[1].mark
        raise
    hub.asked.update(new.columns)
    hub.dumps.add(ID, new)


def _check_order(hub: Hub, arguments: tuple[Argument, ...]) -> None:
    if len(arguments) < 2:
        return
    first, second = arguments[:2]
    variable = hub.interpreter.variables.get(first.text, "")
    word = first.word() if isinstance(variable, str) else None
    if word and (re.search(r"[.*/]", word) or NUMBER.fullmatch(second.text)):
        message = "argument 1 'every' must be a whole number; the file comes second"
        expected = "the steps between two snapshots, then the file"
        hint = f"{second.text}, {first.text}" if NUMBER.fullmatch(second.text) else None
        raise ScriptError(message, mark=first.mark, expected=expected, hint=hint)


dump.syntax = "ID, all, style, every, file[, ...]"


def delete_dump(hub: Hub, ID: str) -> None:
    """Stop a dump. The files of the dump remain.

    Example
    -------
    delete_dump(d1)

    See Also
    --------
    dump
    """
    old = hub.dumps[ID]
    hub.dumps.remove(ID)
    if old.one_file_per_step:
        # A file with several snapshots stays reserved: another dump would overwrite it.
        hub.output.files.pop(old.file, None)


def set_output(
    hub: Hub, every: Annotated[int | ByTime, Every], form: Literal["mpm", "csv"] = "mpm"
) -> None:
    """Set how often a line is written to the log, and in which format.

    Lines appear on the terminal and in log.mpm in the current folder. By default every step is
    logged; the first and last state of each run always are.

    Parameters
    ----------
    every
        Steps between two lines, counted over all runs, or ``time(T)``: the first step at or after
        each multiple of the time T.
    form
        ``csv``: write log.csv, with commas between the columns, instead of log.mpm.

    Example
    -------
    set_output(100)
    set_output(time(1e-3), csv)

    See Also
    --------
    log_modify
    """
    hub.output.log.every = every
    if form == "csv" and hub.output.log.file.suffix != ".csv":
        if hub.begun:
            message = "the format of the log cannot change after the first run"
            expected = "set_output(..., csv) before the first run"
            raise ScriptError(message, argument="form", expected=expected, code="too-late")
        hub.output.log.file = hub.output.log.file.with_suffix(".csv")


def log(hub: Hub, every: Every) -> None:
    """Set how often a line is written to the log (older form; see set_output).

    In an expression, log(x) is the natural logarithm.

    Parameters
    ----------
    every
        Steps between two lines, counted over all runs, or ``time(T)``.

    Example
    -------
    log(100)

    See Also
    --------
    set_output
    """
    set_output(hub, every)


def log_modify(hub: Hub, style: Literal["default", "custom"], *keys: Logged) -> None:
    """Choose the columns of the log.

    Parameters
    ----------
    style
        ``default``: step, dt and time. ``custom``: the columns that follow.
    keys
        ``step``, ``dt``, ``time``, a variable, a value of a fix or compute, or a formula of these.

    Notes
    -----
    Between two runs, the command changes the columns of the following rows. In log.mpm, a line
    beginning with ``#`` then lists the new columns.

    Example
    -------
    log_modify(custom, step, dt, time, Ek_s, Es_s)

    See Also
    --------
    set_output
    """
    if style == "default" and keys:
        message = "default takes no columns"
        expected = "log_modify(default) or log_modify(custom, step, ...)"
        raise ScriptError(message, argument="keys", expected=expected)
    if style == "custom" and not keys:
        message = "custom needs at least one column"
        raise ScriptError(message, expected="log_modify(custom, step, dt, time, ...)")
    hub.output.log.columns = list(keys)


def plot(
    hub: Hub,
    ID: str,
    every: Every,
    x: Quantity,
    y: Quantity,
    *,
    axis: Literal["left", "right"] = "left",
    scale: Literal["linear", "log"] = "linear",
    label: str | None = None,
) -> None:
    """Plot one quantity against another; save_plot draws the curves to a file.

    Curves with the same x are drawn in one diagram, with a legend of their IDs.

    Parameters
    ----------
    ID
        Name of the curve, shown in the legend.
    every
        Steps between two points of the curve, or ``time(T)``.
    x, y
        ``step``, ``dt``, ``time``, a variable, a value of a fix or compute, or a formula of these.
    axis
        ``right``: use a second y axis, on the right, with separate limits.
    scale
        ``log``: use a logarithmic y axis, which omits numbers that are not positive.
    label
        Label of the y axis, such as "energy (J)". Default: the name of y with its unit.

    Example
    -------
    plot(kinetic, 10, time, Ek_s)
    plot(force, 10, time, piston_y, axis=right)

    See Also
    --------
    save_plot
    """
    plots = hub.output.plots
    if ID in plots:
        raise ScriptError(
            f"ID '{ID}' is already used",
            argument="ID",
            expected="another ID",
            code="already-used",
            kind="plot",
        )
    curve = PlottedCurve(every, x, y, axis, scale, label)
    curve.mark = hub.mark
    plots.add(ID, curve)


def save_plot(hub: Hub, file: Annotated[Path, OutputFile]) -> None:
    """Draw the curves of all plot commands to a file at the end of each run, even if it failed.

    After a run, the command draws the file at once.

    Parameters
    ----------
    file
        File name ending in .png, .pdf or .svg; an existing file is overwritten.

    Example
    -------
    save_plot(energies.pdf)

    See Also
    --------
    plot
    """
    picture_format(file)
    hub.output.check_file(file)
    plots = hub.output.plots
    hub.output.files.pop(plots.file, None)
    hub.output.claim(file, "save_plot")
    plots.file, plots.mark = file, hub.mark
    if not hub.rehearsing:
        plots.finish()


def units(
    hub: Hub,
    length: Annotated[str, Literal[*LENGTHS]],
    mass: Annotated[str, Literal[*MASSES]],
    time: Annotated[str, Literal[*TIMES]],
    temperature: Literal["K", "C"] = "K",
) -> None:
    """Name the consistent units, for labels in pictures, plots, dumps and the banner.

    No number is converted. A scene in mm, g, ms has forces in N, stresses in MPa and energies in
    mJ. Before the first step, densities outside 10 (gases: 0.001) to 100000 kg/m^3 and wave
    speeds outside 1 m/s to 50 km/s give a warning.

    Parameters
    ----------
    length, mass, time, temperature
        Units of the numbers in the script.

    Example
    -------
    units(mm, g, ms)

    See Also
    --------
    dump, plot
    """
    hub.output.units = Units(length, mass, time, temperature)


registry.may_differ(dump, delete_dump, set_output, log, log_modify, plot, save_plot, units)
