"""A scene in arrays, as seen by measurements, checks and files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from karamelo_py.kernels.arrays import Control, Hooks, NoHooks, Setup, Tag
from karamelo_py.output.fields import Fields
from karamelo_py.run.tiles import Tiles, WholeDomain
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix


class NodeAccess(Protocol):
    def with_mass(self) -> np.ndarray: ...


class SceneState(Protocol):
    """The arrays of a scene or subdomain, and the clock."""

    hub: Hub
    comm: SerialComm
    control: Control
    setup: Setup
    tiles: Tiles
    domain: WholeDomain
    present: np.ndarray  # (N,) bool by id, False for deleted points
    begun: set[Fix]  # fixes that act only in the first step, and have acted
    mode: Tag
    threads: int
    count: int
    points: Fields
    mapped: bool  # whether nodes show the present state
    moved_in_step: bool  # whether arrays are replaced after the first stage of a step
    implicit: bool
    notes_temperatures: bool
    flags: tuple[bool, ...]  # stored in restart files, in addition to arrays

    @property
    def hooks(self) -> Hooks | NoHooks: ...
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

    def fastest(self, common: Sequence[float] = (0.0, 0.0, 0.0)) -> float: ...
    def in_tiles(self) -> bool: ...
    def bring(self) -> None: ...
    def sort(self) -> None: ...
    def clear_forces(self) -> None: ...
    def changed(self) -> None: ...
    def snapshot(self, before: dict[str, np.ndarray] | None = None) -> dict[str, np.ndarray]: ...
    def restore(self, snapshot: dict[str, np.ndarray]) -> None: ...
