"""Options of the command line that say where the files of a run go."""

import argparse
from pathlib import Path

from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


def add_output_options(parser: argparse.ArgumentParser) -> None:
    """Add -log and -out."""
    parser.add_argument(
        "-log", "--log", type=Path, metavar="FILE",
        help="where the log goes (default: log.mpm); with the ending .csv it has commas",
    )  # fmt: skip
    parser.add_argument(
        "-out", "--out", type=Path, metavar="FOLDER",
        help="where all files go; it is made if need be (default: the current folder)",
    )  # fmt: skip


def direct(hub: Hub, options: argparse.Namespace) -> None:
    """Send the files of a scene where the options say.

    Raises
    ------
    ScriptError
        If the folder cannot be made, or that of the log is not there.
    """
    if options.out is not None:
        try:
            if not hub.checking:
                options.out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ScriptError(
                f"cannot write to {options.out}: {error.strerror}",
                expected="a folder, or the name of one that can be made",
                hint=f"-out {options.out.name or 'run'} is a folder in this one",
            ) from error
        hub.folder = options.out.absolute()
    if options.log is not None:
        hub.output.log.file = options.log
        hub.output.log.is_asked_for = True
        if not hub.output.log.path.parent.is_dir() or hub.output.log.path.is_dir():
            raise ScriptError(
                f"the log cannot be written to {options.log}",
                expected="the name of a file in a folder that exists",
            )
