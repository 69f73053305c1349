"""The interface of what takes the steps: CPU, GPU, MPI rank, Newton's method."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np

from karamelo_py.kernels.arrays import Control, Hooks, NoHooks, Setup, Tag
from karamelo_py.output.fields import Fields
from karamelo_py.run.boxes import numbers
from karamelo_py.run.tiles import Tiles
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix


class NodeAccess(Protocol):
    def counted(self) -> np.ndarray: ...
    def with_mass(self) -> np.ndarray: ...


class Backend(Protocol):
    """A scene that can be stepped: `Simulation`, or a subclass for a GPU or an implicit scheme.

    The loop calls `begin` or `go_on`, `compile`, `advance`; `snapshot` and `restore` return to a
    state.
    """

    hub: Hub
    comm: SerialComm
    control: Control
    setup: Setup
    tiles: Tiles
    domain: WholeDomain
    hooks: Hooks | NoHooks
    present: np.ndarray  # (N,) bool by id, False for deleted points
    begun: set[Fix]  # fixes of the first step that have acted
    mode: Tag
    threads: int
    count: int  # of points
    points: Fields
    mapped: bool  # nodes show the present state
    moved_in_step: bool  # a step replaces the arrays after its first stage
    implicit: bool
    states_every: int  # steps between states to return to
    repeats_steps: bool  # to return to a state
    remedy: str  # changes that may prevent a failed step
    notes_temperatures: bool
    flags: tuple[bool, ...]  # state besides the arrays, for restart files

    @property
    def nodes(self) -> NodeAccess: ...
    @property
    def kin(self) -> Tag: ...
    @property
    def now(self) -> int: ...
    @property
    def dt(self) -> float: ...
    @property
    def time(self) -> float: ...
    @property
    def step(self) -> int: ...
    @property
    def moves(self) -> bool: ...
    @property
    def light_nodes(self) -> float: ...

    def begin(self, end_time: float) -> None: ...
    def go_on(self, end_time: float, halvings: int) -> None: ...
    def refuse(self) -> None: ...
    def compile(self) -> None: ...
    def advance(self, count: int, between: Callable[[str], bool] | None = None) -> int: ...
    def bring(self) -> None: ...
    def snapshot(self, before: dict[str, np.ndarray] | None = None) -> dict[str, np.ndarray]: ...
    def restore(self, snapshot: dict[str, np.ndarray]) -> None: ...
    def fastest(self, common: Any = (0.0, 0.0, 0.0)) -> float: ...
    def in_tiles(self) -> bool: ...
    def sort(self) -> None: ...
    def sort_if_due(self) -> None: ...
    def show_on_nodes(self) -> None: ...
    def clear_forces(self) -> None: ...
    def changed(self) -> None: ...


class WholeDomain:
    """The whole scene, on a single process (`mpi.subdomain`: one of several)."""

    parted = False

    def __init__(self, simulation: Backend):
        self.simulation = simulation

    def migrate(self, s: Setup) -> Setup:
        """Hand over the points that left the own tiles; sort afterwards."""
        return s

    def share_memory(self) -> None:
        """Send contact memory and kept fields of the own nodes to all processes."""

    def share_kept(self) -> None:
        """Send the kept fields of the own nodes to all processes."""

    def counted(self) -> np.ndarray:
        """Return the used nodes that no other process counts."""
        return numbers(self.simulation.setup.spans)

    def act(self, function: Callable[[Setup], None], s: Setup) -> None:
        function(s)

    def begin(self, hooks: Hooks | NoHooks, *, from_python: bool) -> None:
        """Prepare for steps."""

    def end(self) -> None:
        """Finish the last steps."""

    def state(self) -> dict[str, np.ndarray]:
        """Return arrays of a state besides points and nodes."""
        return {}

    def own_part(self, state: Mapping[str, Any]) -> Mapping[str, Any]:
        """Select this process's part of a saved state."""
        return state
