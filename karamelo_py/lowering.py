"""Lowering: the scene becomes the smallest set of arrays and tags that can run it.

Read once at the start of every run: kinematics, basis, transfer, scheme, laws and fixes decide
which fields exist (`karamelo-py check` prints them) and, by their types, what is compiled.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import (
    DRIFT,
    DRIFT_LIMIT,
    POINT_MASS,
    SPACING,
    Block,
    Control,
    Nodes,
    Points,
    Setup,
)
from karamelo_py.laws import law_in, law_kind, law_table
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.points.materials import initial_state
from karamelo_py.script.errors import ScriptError
from karamelo_py.state.tiles import Tiles

if TYPE_CHECKING:
    from karamelo_py.hub import Hub

PRECISIONS = {"double": np.float64, "single": np.float32}
SERIAL_UP_TO = 20_000  # points; below, waking threads costs more than they save


class State(NamedTuple):
    """Fields of all points in the order of their ids, between two lowerings."""

    count: int  # number of points, N
    x: np.ndarray  # (N, d)
    v: np.ndarray  # (N, d)
    laws: dict[tuple, np.ndarray]  # (N, s) state for each kind of law
    moment: np.ndarray | None  # (N, d d)


def check_scene(hub: Hub) -> None:
    """A scene without domain, method or solids cannot run: say what is missing."""
    if hub.domain is None:
        raise ScriptError(
            "no domain is defined", hint="put dimension(2, xmin, xmax, ymin, ymax, h) before run"
        )
    if hub.update.method is None:
        raise ScriptError(
            "no method is defined", hint="put method(ulmpm, FLIP, linear, 0.99) before run"
        )
    if not hub.solids:
        raise ScriptError(
            "there is no solid to move",
            hint="put solid(ID, region, regionID, points per cell, material, h, T0) before run",
        )


def thread_count(hub: Hub, points: int) -> int:
    """Threads to use: as asked by --threads, else all cores for scenes that are worth it."""
    from numba import config

    available = int(config.NUMBA_NUM_THREADS)
    if hub.settings.threads is not None:
        if hub.settings.threads > available:
            hub.warn(f"only {available} of {hub.settings.threads} threads can be had here")
        return max(1, min(hub.settings.threads, available))
    usable = min(available, os.cpu_count() or 1)
    return usable if points > SERIAL_UP_TO else 1


def lower(hub: Hub, previous: State | None = None) -> tuple[Setup, Tiles]:
    """Make the arrays of a run from the scene, taking over the state of points that exist."""
    check_scene(hub)
    domain = hub.domain
    real = PRECISIONS[hub.settings.precision]
    kin = KINEMATICS[domain.dimension]()
    basis = hub.update.method.make_basis(domain, real)
    transfer = hub.update.transfer_tag(real)
    shape = tuple(int(n) for n in domain.shape)
    tiles = Tiles(shape, domain.dimension, type(basis).width)
    control = Control(hub.values.array, np.zeros(10), np.zeros(4, np.int64))
    control.real[SPACING] = domain.h
    control.real[DRIFT_LIMIT] = tiles.drift_limit
    control.real[DRIFT] = np.inf  # the points are not sorted yet
    setup = Setup(
        kin=kin,
        basis=basis,
        transfer=transfer,
        nodes=lower_nodes(domain, domain.dimension, real),
        blocks=lower_blocks(hub, kin, transfer, tiles, real, previous),
        spans=tiles.empty_spans(),
        shape=shape,
        control=control,
    )
    control.real[POINT_MASS] = max(float(b.points.mass.max()) for b in setup.blocks)
    return setup, tiles


def lower_nodes(domain, d: int, real: type) -> Nodes:
    """Node fields, zero; the system gives memory to pages only when they are touched."""
    count = int(np.prod(domain.shape))
    return Nodes(
        sums=np.zeros((count, 1 + 2 * d), real),
        update=np.zeros((count, 2 * d), real),
        velocity=np.zeros((count, d), real),
    )


def lower_blocks(hub, kin, transfer, tiles: Tiles, real: type, previous: State | None) -> tuple:
    """One block for each kind of law, in the order in which the solids use them."""
    solids: dict[tuple, list] = {}
    for solid in hub.solids.values():
        solids.setdefault(law_kind(solid.material.law), []).append(solid)
    return tuple(
        lower_block(members, kin, transfer, tiles, real, previous) for members in solids.values()
    )


def lower_block(solids, kin, transfer, tiles: Tiles, real: type, previous: State | None) -> Block:
    """The points of all solids whose law is of one kind."""
    d = kin.dimension
    materials = list({id(s.material): s.material for s in solids}.values())
    laws = law_table([m.law for m in materials], real)
    kind = law_kind(laws)
    x0 = np.concatenate([s.x0 for s in solids])
    n = len(x0)
    ids = np.concatenate([np.arange(s.first_id, s.first_id + len(s.x0)) for s in solids])
    fresh = initial_state(law_in(materials[0].law, real), kin, real(1))
    state = np.tile(np.array(fresh, real), (n, 1))
    moment = np.zeros((n, kin.tensor_size), real) if transfer.keeps_moment else None
    x = np.empty((2, n, d), real)
    v = np.zeros((n, d), real)
    x[:] = x0
    if previous is not None:
        old = ids < previous.count
        x[:, old] = previous.x[ids[old]]
        v[old] = previous.v[ids[old]]
        if kind in previous.laws:
            state[old] = previous.laws[kind][ids[old]]
        if moment is not None and previous.moment is not None:
            moment[old] = previous.moment[ids[old]]
    points = Points(
        v=v,
        mass=np.concatenate([s.mass for s in solids]).astype(real),
        state=state,
        moment=moment,
        material=np.concatenate(
            [np.full(len(s.x0), materials.index(s.material), np.int32) for s in solids]
        ),
    )
    return Block(x, points, laws, tiles.empty_tiling(), ids.astype(np.int64))
