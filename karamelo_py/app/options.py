"""Options that several subcommands have."""

import argparse
from pathlib import Path
from typing import Any

from karamelo_py.script.errors import ScriptError

VARIABLE = ("-var", "--var", "-v")
LIVE = ("--live", "-live")


class _Variable(argparse.Action):
    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any,
        option_string: str | None = None,
    ) -> None:  # fmt: skip
        pairs = getattr(namespace, self.dest)
        for name, value in pairs:
            if name == values[0]:
                raise ScriptError(
                    f"-var {name} is given twice, {value} and {values[1]}",
                    expected="each variable once",
                )
        setattr(namespace, self.dest, [*pairs, (values[0], values[1].strip())])


def add_variables(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument(
        *VARIABLE, nargs=2, action=_Variable, default=[], metavar=("NAME", "VALUE"),
        help=text,
    )  # fmt: skip


def threads_option(text: str) -> int | None:
    if text == "auto":
        return None
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of threads (1, 2, ... or auto)")
    return int(text)


def positive(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a whole number of at least 1")
    return int(text)


def above_zero(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0 < value < float("inf"):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number above 0")
    return value


def make_folder(folder: Path, option: str) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        name = "files" if Path(folder.name).exists() else folder.name
        raise ScriptError(
            f"cannot write to {folder}: {'it is a file' if folder.is_file() else error.strerror}",
            expected="a folder, or the name of one that can be made",
            hint=f"{option.format(name)} is a folder in this one",
        ) from error
