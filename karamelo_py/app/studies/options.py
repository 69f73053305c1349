"""Options that the subcommands of studies share."""

import argparse
import csv
from pathlib import Path
from typing import Any

from karamelo_py.app.options import VARIABLE, above_zero, positive
from karamelo_py.app.studies.case import Launch
from karamelo_py.app.studies.study import default_jobs
from karamelo_py.app.studies.variables import VALUES, check_script, choices, texts
from karamelo_py.script.errors import ScriptError, nearest
from karamelo_py.script.parser import scripts_in


def new_parser(subparsers: Any, name: str, summary: str, description: str, run: Any) -> Any:
    """A parser of a subcommand; its help keeps the lines of the description."""
    parser = subparsers.add_parser(name, help=summary, description=description)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.allow_abbrev = False
    parser.set_defaults(act=run)
    return parser


def add_family(parser: Any) -> None:
    """Options of a family of runs."""
    parser.add_argument("script", type=Path, help="the script")
    parser.add_argument(
        *VARIABLE, action="append", default=[], metavar="NAME=VALUES",
        help=f"values of a variable of the script: {VALUES}; again for each variable",
    )  # fmt: skip
    parser.add_argument(
        "-jobs", type=positive, help="runs at once (default: as many as there are cores)"
    )
    parser.add_argument(
        "--threads", type=positive, default=None, help="threads of each run (default: 1)"
    )
    parser.add_argument(
        "-limit", type=above_zero, metavar="SECONDS", help="give up a run that takes longer"
    )
    parser.add_argument(
        "-again", action="store_true", help="run also what is known from an earlier study"
    )
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")


def add_axes(parser: Any) -> None:
    """The option of words along the axes of a picture."""
    parser.add_argument(
        "-axes",
        metavar="X,Y",
        help="what to write along them, such as 'time (s),F (N)'; an empty one stays as it is, "
        "one with commas stands in double quotes",
    )


def along(options: Any, x: str, y: str) -> tuple[str, str]:
    """Choose the words along the axes: as the options say, else `x` and `y`."""
    words = split(options.axes or ",")
    if len(words) != 2:
        raise ScriptError(f"-axes {options.axes}", expected="two, such as -axes 'time (s),F (N)'")
    return words[0] or x, words[1] or y


def split(text: str) -> list[str]:
    """Words with commas between them; one in double quotes may have commas of its own."""
    return [word.strip() for word in next(csv.reader([text], skipinitialspace=True), [])]


def add_combinations(parser: Any) -> None:
    """Options of which values go together."""
    parser.add_argument(
        "-zip", action="append", default=[], metavar="A,B",
        help="variables that go in step: the first values together, then the second, ...",
    )  # fmt: skip
    parser.add_argument(
        "-where", action="append", default=[], metavar="CONDITION",
        help="keep the combinations that fulfil it: 'N < 40 || basis == linear'",
    )  # fmt: skip


def zipped(options: Any) -> list[list[str]]:
    """The variables that go in step."""
    groups = getattr(options, "zip", [])  # not every study of a family has it
    return [[name.strip() for name in group.split(",")] for group in groups]


def family(options: Any, *, timed: bool = False, repeat: int = 1) -> tuple[dict, Launch, int]:
    """Values of the variables, how to run, and how many at once.

    Raises
    ------
    ScriptError
        For variables that the script does not read, or none.
    """
    if not options.script.is_file():
        folder = options.script.parent
        close = nearest(options.script.name, scripts_in(folder))
        raise ScriptError(
            f"there is no file {options.script}",
            expected="the name of a script",
            hint=f"did you mean {folder / close}?" if close else None,
        )
    in_step = {name for group in zipped(options) for name in group}
    values = choices(options.var, in_step)
    if not values:
        raise ScriptError("nothing varies", expected=f"-var {VALUES}")
    check_script(options.script, values)
    launch = Launch(
        options.script,
        threads=options.threads or 1,
        repeat=repeat,
        limit=options.limit,
        texts=tuple(texts(options.script)),
    )
    if timed and (options.jobs or 1) > 1:
        raise ScriptError("-time runs one at a time", expected="-time without -jobs")
    jobs = 1 if timed else options.jobs or max(1, default_jobs() // (options.threads or 1))
    return values, launch, jobs


def out_file(path: Path, *suffixes: str) -> Path:
    """A file to write, with one of these endings.

    Raises
    ------
    ScriptError
        If its folder does not exist, or it ends otherwise.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise ScriptError(f"-o {path}: unknown kind of file", expected=", ".join(suffixes))
    if not path.parent.is_dir():
        raise ScriptError(f"the folder {path.parent} does not exist", hint=f"mkdir {path.parent}")
    if path.is_dir():
        raise ScriptError(f"{path} is a folder", expected="the name of a file")
    return path
