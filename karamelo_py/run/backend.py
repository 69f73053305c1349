"""Back ends of a run: the CPU, a GPU, one MPI rank, or Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

import numpy as np

from karamelo_py.run.checkpoint.parts import RollbackPoint
from karamelo_py.run.energy import EnergyWatch
from karamelo_py.run.state import SceneState
from karamelo_py.run.step_size import StepSize


class Backend(SceneState, Protocol):
    """A scene in arrays that can take steps.

    A run calls `begin` or `go_on`, then `compile`, then `advance`.
    """

    steps: StepSize
    energy_watch: EnergyWatch
    rollback: RollbackPoint | None
    states_every: int
    repeats_steps: bool
    remedy: str  # changes to the scene that may avoid the failed step

    def begin(self, end_time: float) -> None: ...
    def go_on(self, end_time: float, halvings: int) -> None: ...
    def refuse(self) -> None: ...
    def compile(self) -> None: ...
    def advance(self, count: int, between: Callable[[str], bool] | None = None) -> int: ...
    def leaving(self) -> np.ndarray: ...
