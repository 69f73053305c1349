"""Where the program begins: it also ends with a word when it is interrupted at once.

An interrupt in the midst of an import can come out as any error; while nothing is open yet, the
program just ends.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

INTERRUPTED = 130  # as a shell reports a program that SIGINT ended


def _leave(number: int, frame: Any) -> None:
    os.write(2, b"error: interrupted\n")
    os._exit(INTERRUPTED)


@contextmanager
def leaving_at_once() -> Iterator[None]:
    """Let Ctrl-C end the program on the spot: for imports."""
    try:
        before = signal.signal(signal.SIGINT, _leave)
    except ValueError:  # not in the main thread, which gets the signals
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def main() -> int:
    """Run the command line; returns the exit status."""
    with leaving_at_once():
        from karamelo_py.app.cli import main as command
    return command()


if __name__ == "__main__":
    sys.exit(main())
