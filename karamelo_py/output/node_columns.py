"""Fields of nodes for output, in the order of their numbers."""

from collections.abc import Callable
from functools import partial
from math import frexp
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import MASS, TIME, known_to_laws, of_force, of_momentum
from karamelo_py.kernels.export import EXPORTED, JACOBIAN, export_state, export_to_nodes
from karamelo_py.kernels.hooks import CompiledHook
from karamelo_py.kernels.p2g import Force
from karamelo_py.language.scene import Scene
from karamelo_py.output.point_table import volumes_before
from karamelo_py.points.laws import can, constrained_velocity

AXES = "xyz"
NODE_NAMES = (
    ["id", "type"]
    + list(AXES)
    + ["v" + axis for axis in AXES]
    + ["v" + axis + "_update" for axis in AXES]
    + ["f" + axis for axis in AXES]
    + ["mass", "vol", "mask", "rigid", "T", "bx", "by", "bz", "ntypex", "ntypey", "ntypez"]
)
ABSENT_AT_NODES = ("T",)


class NodeRows(NamedTuple):
    """The nodes with numbers from `first` to before `end`: their rows in the arrays of nodes.

    Attributes
    ----------
    arrays
        By name, as in a file to go on from.
    brought
        Sums over the points that were asked for (`BROUGHT`).
    loaded
        Number of nodes with mass that each fix acts on, by ID.
    """

    first: int
    end: int
    kin: Any
    arrays: dict[str, np.ndarray]
    brought: dict[str, np.ndarray]
    loaded: dict[str, int]


class NodeFields:
    """Named fields of some nodes, one number after another; nodes without mass are at rest."""

    def __init__(self, hub: Scene, rows: NodeRows):
        self.hub, self.rows = hub, rows
        self.ids = np.arange(rows.first, rows.end)

    def node(self, name: str) -> np.ndarray:
        """Return a field of the nodes, (n,)."""
        arrays = self.rows.arrays
        if name == "mass":
            return arrays["nodes/sums"][:, MASS].astype(float)
        if name in AXES:
            return self.positions()[:, AXES.index(name)]
        if name == "T" and self.hub.update.thermal:
            mass = arrays["heat/sums"][:, MASS]
            return np.where(mass > 0, arrays["heat/velocity"][:, 0], 0.0)
        if name in COLUMNS:
            return COLUMNS[name](self)
        if name in ABSENT_AT_NODES or (axis := AXES.index(name[1])) >= self.hub.domain.dimension:
            return np.zeros(len(self.ids))
        field = {
            "v": arrays["nodes/velocity"][:, axis],
            "u": arrays["nodes/update"][:, axis],
            "f": arrays["nodes/sums"][:, of_force(self.rows.kin) + axis],
        }["u" if name.endswith("_update") else name[0]]
        return np.where(self.node("mass") > 0, field, 0.0)

    def positions(self) -> np.ndarray:
        """Return where they are, (n, 3)."""
        found = np.empty((len(self.ids), 3))
        for lattice, own in self.lattices():
            found[own] = lattice.positions(self.ids[own])
        return found

    def lattices(self) -> list[tuple[Any, slice]]:
        """List the grids that they belong to, and which of them do."""
        ends = ((one, one.first + one.node_count) for one in self.hub.lattices)
        return [
            (one, slice(*np.searchsorted(self.ids, (one.first, end)).tolist()))
            for one, end in ends
            if one.first < self.rows.end and end > self.rows.first
        ]


def kind_of_grid(nodes: NodeFields) -> np.ndarray:
    """Return the number of the grid, from 1."""
    begins = [lattice.first for lattice in nodes.hub.lattices]
    return np.searchsorted(begins, nodes.ids, side="right")


def mask(nodes: NodeFields) -> np.ndarray:
    """Karamelo's bits: 1 for all nodes, 2 for those of the first group, 4 of the second, ..."""
    bits = np.ones(len(nodes.ids))
    for k, group in enumerate(nodes.hub.groups.values(), 1):
        if group.kind == "nodes":
            bits[_among(group.nodes, nodes)] += 2.0**k
    return bits


def _among(members: np.ndarray, nodes: NodeFields) -> np.ndarray:
    """Find the nodes that are among ascending numbers."""
    first, end = nodes.rows.first, nodes.rows.end
    return members[slice(*np.searchsorted(members, (first, end)))] - first


def kind_of_node(axis: int, nodes: NodeFields) -> np.ndarray:
    """Karamelo's type of a node along one axis.

    Splines: -2 and -1 at the lower edge and beside it, 2 and 1 at the upper one, 0 within.
    Bernstein: 1 in the middle of a cell. Else 0.
    """
    basis = nodes.hub.update.method.basis
    splines = type(basis).__name__ in ("QuadraticSpline", "CubicSpline")
    found = np.zeros(len(nodes.ids))
    for lattice, own in nodes.lattices() if axis < nodes.hub.domain.dimension else ():
        i, last = lattice.places(nodes.ids[own])[:, axis], lattice.shape[axis] - 1
        if splines:
            found[own] = np.minimum(2, i) - np.minimum(2, last - i)
        elif basis.nodes_per_cell == 2:
            found[own] = i % 2
    return found


def load(axis: int, nodes: NodeFields) -> np.ndarray:
    """Add up the loads of fixes on nodes, and on points, whose weights bring them to the nodes."""
    hub, rows = nodes.hub, nodes.rows
    out = rows.brought[f"b{AXES[axis]}"].copy()
    if axis >= hub.domain.dimension:
        return out
    mass, place = nodes.node("mass"), nodes.positions()
    dt = float(hub.values.array[TIME + 2])
    momentum = rows.arrays["nodes/sums"][:, of_momentum(rows.kin) + axis]
    for ID, count in rows.loaded.items():
        fix = hub.fixes[ID]
        if fix.formulas[axis] is None:
            continue
        members = np.arange(len(out)) if fix.group.all else _among(fix.nodes, nodes)
        members = members[mass[members] > 0]
        value = fix.formulas[axis].evaluate_points(hub.values, place[members])
        v = momentum[members] / mass[members]
        act = fix.hooks()[LOADS].function
        for n, b, u in zip(members, value, v, strict=True):
            out[n] += act(mass[n], u, u, 0.0, b, b, dt, 1 / max(count, 1))[2]
    return out


COLUMNS: dict[str, Callable[[NodeFields], np.ndarray]] = {
    "id": lambda nodes: nodes.ids,
    "type": kind_of_grid,
    "vol": lambda nodes: nodes.rows.brought["vol"],
    "rigid": lambda nodes: (nodes.rows.brought["rigid"] > 0) * 1.0,
    "mask": mask,
    **{f"ntype{axis}": partial(kind_of_node, k) for k, axis in enumerate(AXES)},
    **{f"b{axis}": partial(load, k) for k, axis in enumerate(AXES)},
}

# --- what points bring to nodes where it is asked for ---------------------------------------------

LOADS = "post_particles_to_grid"


def _volume(simulation: Any, block: Any) -> np.ndarray:
    s = simulation.setup
    points = known_to_laws(block.points)
    rows = np.zeros((len(points.id), EXPORTED))
    export_state(s.kin, s.nodes.sums[0, MASS], points, block.laws, rows)
    return volumes_before(simulation.hub, points.id) * rows[:, JACOBIAN]


def _rigid(simulation: Any, block: Any) -> np.ndarray | None:
    """1 where a rigid solid takes part, else 0."""
    return np.ones(len(block.points.id)) if can(block.laws, constrained_velocity) else None


def _force(axis: int, simulation: Any, block: Any) -> np.ndarray | None:
    force = fields.field(block.points.fields, Force)
    return None if force is None or axis >= len(force) else force[axis]


# What `of(simulation, block)` says of each point of a block, if anything.
BROUGHT: dict[str, Callable[[Any, Any], np.ndarray | None]] = {
    "vol": _volume,
    "rigid": _rigid,
    **{f"b{axis}": partial(_force, k) for k, axis in enumerate(AXES)},
}


def brought(simulation: Any, name: str) -> np.ndarray:
    """(nodes, 2) sums of N value over the points at hand: whole units of all, and what is left."""
    s = simulation.setup
    out = np.zeros((len(s.nodes.sums), 2))
    found = [(block, BROUGHT[name](simulation, block)) for block in s.blocks]
    found = [(block, np.ascontiguousarray(of, float)) for block, of in found if of is not None]
    largest = max((float(np.abs(of).max(initial=0)) for _, of in found), default=0.0)
    largest = float(simulation.comm.allreduce_max(np.array([largest]))[0])
    unit = 2.0 ** (frexp(largest)[1] - 36)
    for block, of in found if largest > 0 else ():
        points = block.points
        where = points.x[simulation.now] if points.home is None else points.home
        export_to_nodes(s.basis, s.kin, s.grids, points.grid, where, of, unit, out)
    return out


def loaded(hub: Scene, simulation: Any) -> dict[str, int]:
    """Number of nodes with mass that each fix acts on that puts forces on nodes, by ID."""
    loading = {
        ID: fix for ID, fix in hub.fixes.items() if isinstance(fix.hooks().get(LOADS), CompiledHook)
    }
    there = simulation.nodes_with_mass()
    own = [
        len(there) if fix.group.all else np.count_nonzero(np.isin(there, fix.nodes))
        for fix in loading.values()
    ]
    return dict(
        zip(loading, simulation.comm.allreduce(np.array(own, np.int64)).tolist(), strict=True)
    )
