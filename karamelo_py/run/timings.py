"""Timings of a run, and a word about compilation, which is most of a first one."""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np

from karamelo_py.compiler import cache
from karamelo_py.compiler.loops import compilation
from karamelo_py.output.console import duration
from karamelo_py.scene.hub import Hub

ANOTHER_FOLDER = "the environment variable KARAMELO_PY_CACHE names another folder"


def _kind_of_scene(hub: Hub) -> str:
    """Describe roughly the loops of a scene: for how long they take to compile."""
    parts = {type(material).__name__ for material in hub.materials.values()}
    parts |= {type(fix).__name__ for fix in hub.fixes.values()}
    parts |= {str(hub.settings.precision), f"threads={hub.settings.threads}"}
    return f"{hub.domain.dimension}D {hub.update.words} {' '.join(sorted(parts))}"


def _about(seconds: float) -> str:
    """Estimate the time for so many seconds of work; longer where others want the processor."""
    wanted = 1 + (os.getloadavg()[0] if hasattr(os, "getloadavg") else 0)
    longest = seconds * max(1.0, wanted / (os.cpu_count() or 1))
    if longest < 1.5 * seconds or duration(longest) == duration(seconds):
        return f"about {duration(seconds)}"
    return f"{duration(seconds)} to {duration(longest)}, as others use the processors"


def _clocks() -> np.ndarray:
    """Read the seconds that have passed, and that all threads have worked."""
    return np.array([time.perf_counter(), time.process_time()])


class Timings:
    """Seconds that a run spends: (2,) those that have passed, and those of all threads.

    While it tells of compilation it is told of it.
    """

    def __init__(self, hub: Hub):
        self.hub = hub
        self.on = {name: np.zeros(2) for name in ("compilation", "steps", "output")}
        self._depth = 0  # of compilation in the midst of compilation
        self._begun = np.zeros(2)

    def passed(self) -> dict[str, float]:
        """Return the seconds that have passed so far."""
        return {name: float(seconds[0]) for name, seconds in self.on.items()}

    def since(self, before: dict[str, float], name: str) -> float:
        """Return those that have passed since then, for one thing."""
        return float(self.on[name][0]) - before[name]

    @contextmanager
    def counted(self, name: str) -> Iterator[None]:
        """Count what is done meanwhile, without compilation."""
        begun = _clocks() - self.on["compilation"]
        yield
        self.on[name] += _clocks() - self.on["compilation"] - begun

    @contextmanager
    def telling_of_compilation(self) -> Iterator[None]:
        """Say so when kernels are compiled, how long it may take, and count the time."""
        scene = _kind_of_scene(self.hub)
        expected = cache.time_for(scene)
        about = f": {_about(expected)}" if expected else ""
        self._words = (
            f"Compiling the loops of this kind of scene, once{about}"
            " (the next run starts at once) ..."
        )
        try:
            compilation.listeners.append(self)
            with cache.telling(partial(self.hub.warn, hint=ANOTHER_FOLDER)):
                yield
        finally:
            compilation.listeners.remove(self)
            spent = self.on["compilation"][1]
            # Where most was in the cache already, the time says nothing about the whole.
            if spent > 0.5 * (expected or 0.0):
                cache.keep_time(scene, spent)

    def on_start(self, _: str) -> None:
        """Note that a kernel is compiled, or another process does, and this one waits for it."""
        self._depth += 1
        if self._depth == 1:
            self._begun = _clocks()
            if self._words:
                self.hub.console.say(self._words)
                self._words = ""

    def on_end(self) -> None:
        """It has."""
        self._depth -= 1
        if self._depth == 0:
            self.on["compilation"] += _clocks() - self._begun
