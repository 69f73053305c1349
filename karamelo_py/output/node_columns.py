"""Columns of nodes that no step keeps: made when a dump asks for them."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import MASS, TIME, of_momentum
from karamelo_py.kernels.export import EXPORTED, JACOBIAN, export_state, export_to_nodes
from karamelo_py.kernels.hooks import CompiledHook
from karamelo_py.kernels.p2g import Force
from karamelo_py.language.scene import Scene
from karamelo_py.points.laws import can, constrained_velocity

AXES = "xyz"


def _sum(simulation: Any, value: Callable) -> np.ndarray:
    """Sum of N value(block) over the points, (nodes,)."""
    s = simulation.setup
    out = np.zeros(len(s.nodes.sums))
    for block in s.blocks:
        points = block.points
        values = value(block)
        if values is not None:
            where = points.x[simulation.now] if points.home is None else points.home
            values = np.ascontiguousarray(values, dtype=float)
            export_to_nodes(s.basis, s.kin, s.grids, points.grid, where, values, out)
    return out


def volume(hub: Scene, simulation: Any) -> np.ndarray:
    """Volume of the points by their weights."""
    s = simulation.setup
    first = np.concatenate([solid.volume0 for solid in hub.solids.values()])

    def present(block: Any) -> np.ndarray:
        rows = np.zeros((len(block.points.id), EXPORTED))
        export_state(s.kin, s.nodes.sums[0, MASS], block.points, block.laws, rows)
        return first[block.points.id] * rows[:, JACOBIAN]

    return _sum(simulation, present)


def rigid(hub: Scene, simulation: Any) -> np.ndarray:
    """1 where a rigid solid takes part, else 0."""

    def flags(block: Any) -> np.ndarray | None:
        rigid = can(block.laws, constrained_velocity)
        return np.ones(len(block.points.id)) if rigid else None

    return (_sum(simulation, flags) > 0) * 1.0


def mask(hub: Scene, simulation: Any) -> np.ndarray:
    """Karamelo's bits: 1 for all nodes, 2 for those of the first group, 4 of the second, ..."""
    bits = np.ones(len(simulation.setup.nodes.sums))
    for k, group in enumerate(hub.groups.values(), 1):
        if group.kind == "nodes":
            bits[group.nodes] += 2.0**k
    return bits


def kind_of_node(axis: int, hub: Scene, simulation: Any) -> np.ndarray:
    """Karamelo's type of a node along one axis.

    Splines: -2 and -1 at the lower edge and beside it, 2 and 1 at the upper one, 0 within.
    Bernstein: 1 in the middle of a cell. Else 0.
    """
    basis = simulation.setup.basis
    splines = type(basis).__name__ in ("QuadraticSpline", "CubicSpline")
    parts = []
    for lattice in hub.lattices:
        count = lattice.shape[axis]
        i = np.arange(count)
        along = np.zeros(count)
        if axis < hub.domain.dimension:
            if splines:
                along = np.minimum(2, i) - np.minimum(2, count - 1 - i)
            elif basis.nodes_per_cell == 2:
                along = i % 2
        shape = [1, 1, 1]
        shape[axis] = count
        parts.append(np.broadcast_to(along.reshape(shape), lattice.shape).ravel())
    return np.concatenate(parts).astype(float)


def load(axis: int, hub: Scene, simulation: Any) -> np.ndarray:
    """What fixes put on nodes, and on points, whose weights bring it to the nodes."""
    s = simulation.setup
    out = np.zeros(len(s.nodes.sums))
    if axis >= hub.domain.dimension:
        return out

    def of_points(block: Any) -> np.ndarray | None:
        kinds = [type(one) for one in block.points.fields]
        return fields.field(block.points.fields, Force)[axis] if Force in kinds else None

    out += _sum(simulation, of_points)
    mass = s.nodes.sums[:, MASS].astype(float)
    place = np.concatenate([lattice.positions() for lattice in hub.lattices])
    dt = float(hub.values.array[TIME + 2])
    for fix in hub.fixes.values():
        hook = fix.hooks().get("post_particles_to_grid")
        if not isinstance(hook, CompiledHook) or fix.formulas[axis] is None:
            continue
        members = np.arange(len(out)) if fix.group.all else fix.nodes
        members = members[mass[members] > 0]
        value = fix.formulas[axis].evaluate_points(hub.values, place[members])
        v = s.nodes.sums[members, of_momentum(s.kin) + axis] / mass[members]
        share = 1 / max(len(members), 1)
        for n, b, u in zip(members, value, v, strict=True):
            out[n] += hook.function(mass[n], u, u, 0.0, b, b, dt, share)[2]
    return out


# Functions of the scene and its simulation that give (nodes,).
NODE_COLUMNS: dict[str, Callable[[Scene, Any], np.ndarray]] = {
    "vol": volume,
    "rigid": rigid,
    "mask": mask,
    **{f"ntype{axis}": partial(kind_of_node, k) for k, axis in enumerate(AXES)},
    **{f"b{axis}": partial(load, k) for k, axis in enumerate(AXES)},
}
