"""Seconds of compilation, steps and output."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from karamelo_py.compiler import compilation, files
from karamelo_py.scene.hub import Hub

COMPILING = "Compiling the loops of this kind of scene, once (the next run starts at once) ..."
ANOTHER_FOLDER = "the environment variable KARAMELO_PY_CACHE names another folder"


def _clocks() -> np.ndarray:
    return np.array([time.perf_counter(), time.process_time()])


class Timings:
    """Seconds (2,): elapsed time, and CPU time of all threads."""

    def __init__(self, hub: Hub):
        self.hub = hub
        self.on = {name: np.zeros(2) for name in ("compilation", "steps", "output")}
        self._depth = 0  # depth of nested compilation
        self._begun = np.zeros(2)

    @contextmanager
    def counted(self, name: str) -> Iterator[None]:
        begun = _clocks() - self.on["compilation"]
        yield
        self.on[name] += _clocks() - self.on["compilation"] - begun

    @contextmanager
    def telling_of_compilation(self) -> Iterator[None]:
        self._says = True
        telling = files.telling(partial(self.hub.warn, hint=ANOTHER_FOLDER))
        with compilation.told_to(self), telling:
            yield

    def on_start(self, _: str) -> None:
        """Note that this process compiles a kernel, or waits for another one that does."""
        self._depth += 1
        if self._depth == 1:
            self._begun = _clocks()
            if self._says:
                self.hub.console.say(COMPILING)
            self._says = False

    def on_end(self) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.on["compilation"] += _clocks() - self._begun
