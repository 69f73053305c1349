"""What is compiled, listened to."""

from collections.abc import Iterator
from contextlib import contextmanager

from karamelo_py.compiler import compilation


class Compiled:
    """The names of the functions that are compiled."""

    def __init__(self):
        self.names = []

    def on_start(self, name):
        self.names.append(name)

    def on_end(self):
        """Nothing more."""


@contextmanager
def listening() -> Iterator[list[str]]:
    """The names of what is compiled meanwhile."""
    listener = Compiled()
    with compilation.told_to(listener):
        yield listener.names
