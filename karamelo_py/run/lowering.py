"""Lowering: the scene becomes the smallest set of arrays and tags that can run it.

Read once at the start of every run: kinematics, basis, transfer, scheme, laws and fixes decide
which fields exist (`karamelo-py check` prints them) and, by their types, what is compiled.
"""

from __future__ import annotations

import os
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import (
    DRIFT,
    GRADIENT,
    HEAT_LIMIT,
    HEAT_REFERENCE,
    KEPT,
    LIGHTEST,
    SPACING,
    Block,
    Control,
    Nodes,
    Points,
    Setup,
)
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.laws import elastic_law, law_in, law_on, law_table
from karamelo_py.kernels.step import FBar, Insulated
from karamelo_py.points.basis import carried, deformed
from karamelo_py.points.boundary import ReflectingGrid
from karamelo_py.points.kinematics import identity, planar
from karamelo_py.points.laws import (
    can,
    conductivity,
    constrained_velocity,
    deformation,
    heat_capacity,
    initial_state,
    law_kind,
    specific_volume,
    with_temperature,
)
from karamelo_py.points.laws.temperatures import initial_heat
from karamelo_py.points.transfers import terms
from karamelo_py.run.tiles import Tiles
from karamelo_py.scene import boundary
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import table
from karamelo_py.scene.modify import puts_force_on_points
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.methods.base import NoContact

PRECISIONS = {"double": np.float64, "single": np.float32}
SERIAL_UP_TO = 20_000  # points; below, waking threads costs more than they save


class State(NamedTuple):
    """Fields of all points in the order of their ids, between two lowerings."""

    count: int  # number of points, N
    x: np.ndarray  # (N, w) places
    v: np.ndarray  # (N, d)
    laws: dict[tuple, np.ndarray]  # (N, s) state for each kind of law
    moment: np.ndarray | None  # (N, t) what the transfer keeps
    deformation: np.ndarray | None  # (N, t) F, where it has an array of its own
    present: np.ndarray  # (N,) bool, False for points that were deleted
    bounces: np.ndarray | None  # (N, d) reflections, where they are counted
    heat: np.ndarray | None  # (N, ...) what points keep of heat, where it flows
    contact: NamedTuple  # how solids touch, with what it remembers


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
    method = hub.update.method
    try:
        method.check(hub)
        check_heat(hub)
    except ScriptError as error:
        if error.place is None:
            error.place, error.command = method.place, "method"
        raise
    boundary.check(hub)
    check_rigid(hub)


def check_rigid(hub: Hub) -> None:
    """Refuse rigid bodies whose points would have domains that deform."""
    method = hub.update.method
    basis = type(method.basis)
    if not method.frame.moves or not (deformed.defined(basis) or carried.defined(basis)):
        return
    for solid in hub.solids.values():
        if can(solid.material.law, constrained_velocity):
            raise ScriptError(
                f"solid '{solid.id}' is rigid, and the domains of its points would deform",
                place=solid.place,
                hint="a basis without domains that deform: linear, a spline, or ugimp",
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


def stable_courant(hub: Hub) -> float:
    """The stable step as a share of cell size over wave speed, by scheme, basis and points."""
    scheme, basis = hub.update.scheme, hub.update.method.basis
    two, one = getattr(scheme, "courant", (1.0, 1.0))  # a plug-in may have nothing to say of it
    if min(two, one) == 1:
        return 1.0
    sparse = any(2 * np.max(solid.half_size) > 0.75 * solid.h for solid in hub.solids.values())
    # Nodes between the corners of cells make the highest frequency higher.
    return (one if sparse else two) * (0.7 if basis.nodes_per_cell > 1 else 1)


def stable_conduction(hub: Hub) -> float:
    """The stable step of conduction in undeformed bodies, of the worst.

    h^2 / (4 d) times capacity over conductivity: half of the bound of lumped finite elements, since
    points stand anywhere in a cell.
    """
    if not hub.update.thermal:
        return np.inf
    limits = [np.inf]
    per_cell = hub.update.method.basis.nodes_per_cell
    for solid in hub.solids.values():
        law = solid.material.law
        kappa = conductivity(law, 1.0)
        if kappa > 0:
            capacity = heat_capacity(law, 1.0) / specific_volume(law)
            limits.append((solid.h / per_cell) ** 2 / (4 * solid.x0.shape[1]) * capacity / kappa)
    return min(limits)


def check_heat(hub: Hub) -> None:
    """Heat needs a body that it can flow in."""
    if hub.update.thermal and not any(
        can(solid.material.law, initial_heat) for solid in hub.solids.values()
    ):
        raise ScriptError(
            "the method is thermo-mechanical, and no solid has a temperature",
            hint="give a material one: material(ID, linear, rho, E, nu, cp, kappa), or "
            "temperature(...) with eos-strength",
        )


def lower(hub: Hub, previous: State | None = None) -> tuple[Setup, Tiles]:
    """Make the arrays of a run from the scene, taking over the state of points that exist."""
    check_scene(hub)
    method = hub.update.method
    real = PRECISIONS[hub.settings.precision]
    kin = method.kinematics(hub)
    lattices = method.lattices(hub)
    transfer = hub.update.transfer_tag(real)
    basis = type(method.basis)(*(real(x) for x in method.basis))
    tiles = Tiles(lattices, basis)
    contact = method.contact_between(hub, lattices)
    if previous is not None:
        method.resume(contact, previous.contact)
    control = Control(hub.values.array, np.zeros(17), np.zeros(4, np.int64))
    control.real[SPACING] = min(lattice.h for lattice in lattices)
    control.real[[HEAT_LIMIT, HEAT_REFERENCE]] = stable_conduction(hub)
    control.real[KEPT] = getattr(transfer, "alpha", 0)
    control.real[DRIFT] = np.inf  # the points are not sorted yet
    needs = Needs(
        moment=transfer.keeps_moment,
        force=puts_force_on_points(hub),
        growth=isinstance(method.averaging(hub), FBar),
        series=terms(transfer) > 1,
        normal=not isinstance(contact, NoContact),
        bounces=hub.update.boundary == "reflect",
        heat=hub.update.thermal,
    )
    count = sum(lattice.node_count for lattice in lattices)
    grids = table(lattices, real)
    setup = Setup(
        frame=method.frame,
        kin=kin,
        basis=basis,
        transfer=transfer,
        averaging=method.averaging(hub),
        contact=contact,
        grids=ReflectingGrid(*grids) if needs.bounces else grids,
        nodes=lower_nodes(count, kin.dimension, needs, real),
        heat=Conducting(lower_nodes(count, 1, OF_HEAT, real)) if needs.heat else Insulated(),
        blocks=lower_blocks(hub, kin, needs, tiles, real, previous),
        spans=tiles.empty_spans(),
        control=control,
    )
    if basis.steep_edge:
        lightest = min(float(s.mass.astype(real).min()) for s in hub.solids.values())
        control.real[LIGHTEST] = lightest
    return setup, tiles


class Needs(NamedTuple):
    """Which fields that not every scene has this one needs."""

    moment: bool
    force: bool
    growth: bool
    series: bool
    normal: bool
    bounces: bool
    heat: bool


# Nodes of heat have levels in the place of volumes.
OF_HEAT = Needs(*(False for _ in Needs._fields))._replace(growth=True)


def lower_nodes(count: int, d: int, needs: Needs, real: type) -> Nodes:
    """Fields of `count` nodes with vectors of `d` components, zero.

    The system gives memory to pages only when they are touched.
    """
    return Nodes(
        sums=np.zeros((count, 1 + 2 * d), real),
        update=np.zeros((count, 2 * d), real),
        velocity=np.zeros((count, d), real),
        normal=np.zeros((count, d), real) if needs.normal else None,
        growth=np.zeros((count, 2), real) if needs.growth else None,
        series=np.zeros((count, 2 * d), real) if needs.series else None,
    )


def lower_blocks(hub, kin, needs: Needs, tiles: Tiles, real: type, previous: State | None) -> tuple:
    """One block for each kind of law, in the order in which the solids use them."""
    solids: dict[tuple, list] = {}
    for solid in hub.solids.values():
        solids.setdefault(law_kind(solid.material.law), []).append(solid)
    return tuple(
        lower_block(hub, members, kin, needs, tiles, real, previous) for members in solids.values()
    )


def start(law, T0: float | None, kin, real: type) -> np.ndarray:
    """The state (s,) of a point at rest."""
    state = initial_state(law, kin, real(1))
    return np.array(state if T0 is None else with_temperature(law, kin, state, real(T0)), real)


def lower_block(
    hub, solids, kin, needs: Needs, tiles: Tiles, real: type, previous: State | None
) -> Block:
    """The points of all solids whose law is of one kind."""
    method = hub.update.method
    known = [law_on(s.material.law, s.h, s.T0) for s in solids]
    laws_of_solids = list(dict.fromkeys(known))
    laws = law_table(laws_of_solids, real)
    kind = law_kind(laws)
    n = sum(len(s.x0) for s in solids)
    d = kin.dimension
    ids = np.concatenate([np.arange(s.first_id, s.first_id + len(s.x0)) for s in solids])
    state = np.concatenate(
        [
            np.tile(start(law_in(k, real), s.T0, kin, real), (len(s.x0), 1))
            for s, k in zip(solids, known, strict=True)
        ]
    )
    moment = np.zeros((n, planar(kin).tensor_size), real) if needs.moment else None
    stores_f = not method.frame.moves and not can(elastic_law(laws), deformation)
    unit = np.array(identity(kin, real(1)), real)
    f = np.tile(unit, (n, 1)) if stores_f else None
    places = np.concatenate([method.places(kin, s, real) for s in solids])
    here = places if method.frame.moves else places[:, :d]
    x = np.stack([here, here])
    v = np.zeros((n, d), real)
    bounces = np.zeros((n, d), real) if needs.bounces else None
    heat = np.zeros((n, GRADIENT + d), real) if needs.heat else None
    present = np.ones(n, np.bool_)
    if previous is not None:
        old = ids < previous.count
        kept = previous.x.shape[1]
        x[:, old, :kept] = previous.x[ids[old]][:, : x.shape[2]]
        v[old] = previous.v[ids[old]]
        if kind in previous.laws:
            state[old] = previous.laws[kind][ids[old]]
        if moment is not None and previous.moment is not None:
            moment[old] = previous.moment[ids[old]]
        if f is not None and previous.deformation is not None:
            f[old] = previous.deformation[ids[old]]
        if bounces is not None and previous.bounces is not None:
            bounces[old] = previous.bounces[ids[old]]
        if heat is not None and previous.heat is not None:
            heat[old] = previous.heat[ids[old]]
        present[old] = previous.present[ids[old]]
    points = Points(
        v=v,
        mass=np.concatenate([s.mass for s in solids]).astype(real),
        state=state,
        moment=moment,
        material=np.concatenate(
            [
                np.full(len(s.x0), laws_of_solids.index(law), np.int32)
                for s, law in zip(solids, known, strict=True)
            ]
        ),
        deformation=f,
        force=np.zeros((n, d), real) if needs.force else None,
        growth=np.ones(n, real) if needs.growth else None,
        echo=np.zeros((n, d), real) if needs.series else None,
        bounces=bounces,
        heat=heat,
    )
    block = Block(
        x=x,
        home=None if method.frame.moves else places,
        points=points,
        laws=laws,
        tiling=tiles.empty_tiling(),
        id=ids.astype(np.int64),
        grid=np.concatenate(
            [np.full(len(s.x0), method.lattice_of(hub, s), np.int32) for s in solids]
        ),
    )
    return block if present.all() else chosen(block, present)


def chosen(block: Block, keep: np.ndarray) -> Block:
    """The block with the points where `keep` (n,) is true; they are to be sorted anew."""
    rows = {
        name: None if field is None else field[keep]
        for name, field in block.points._asdict().items()
    }
    return block._replace(
        x=np.compress(keep, block.x, axis=1),  # contiguous: another layout would be compiled for
        home=None if block.home is None else block.home[keep],
        points=Points(**rows),
        id=block.id[keep],
        grid=block.grid[keep],
    )
