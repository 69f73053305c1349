"""The start of the program."""

import gc
import os
import sys

from karamelo_py.app.leaving import STUDY, end_with, leaving_at_once


def main() -> int:
    """Run the command line; returns the exit status.

    While the program begins, Python does not look for cycles of objects to throw away: its search
    went through all modules again and again, half of what a small scene takes.
    """
    gc.disable()
    _open_what_is_closed()
    if study := os.environ.pop(STUDY, ""):
        end_with(int(study))
    # Threads of OpenBLAS, in load steps, wait for each other more than they do.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with leaving_at_once():
        from karamelo_py.app.cli import main as command
    return command()


def _open_what_is_closed() -> None:
    """Have input, output and errors go nowhere where they are closed, as by >&- in a shell.

    The next file that is opened would take the place of one.
    """
    while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(handle)
    for at, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(at, "w", encoding="utf-8", closefd=False))  # noqa: SIM115


if __name__ == "__main__":
    sys.exit(main())
