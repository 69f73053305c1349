"""Entry point of the program."""

import gc
import os
import sys

from karamelo_py.app.leaving import STUDY, end_with, leaving_at_once


def main() -> int:
    """Run the command line without the garbage collector, which halves the time of small scenes."""
    gc.disable()
    _open_what_is_closed()
    if study := os.environ.pop(STUDY, ""):
        end_with(int(study))
    # In load steps, threads of OpenBLAS would wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with leaving_at_once():
        from karamelo_py.app.cli import main as command
    return command()


def _open_what_is_closed() -> None:
    """Open closed standard streams, whose descriptors later files would get."""
    while (handle := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(handle)
    for at, name in ((1, "stdout"), (2, "stderr")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(at, "w", encoding="utf-8", closefd=False))  # noqa: SIM115


if __name__ == "__main__":
    sys.exit(main())
