"""The start of the program."""

import gc
import os
import sys

from karamelo_py.app.leaving import leaving_at_once


def main() -> int:
    """Run the command line; returns the exit status.

    While the program begins, Python does not look for cycles of objects to throw away: its search
    went through all modules again and again, half of what a small scene takes.
    """
    gc.disable()
    # Threads of OpenBLAS, in load steps, wait for each other more than they do.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with leaving_at_once():
        from karamelo_py.app.cli import main as command
    return command()


if __name__ == "__main__":
    sys.exit(main())
