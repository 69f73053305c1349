"""Columns of nodes for output."""

from collections.abc import Callable, Iterator
from functools import partial
from math import frexp
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import MASS, TIME, Block, OnGrids, matter_of, of_force, of_momentum
from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.export import EXPORTED, JACOBIAN, export_state, export_to_nodes
from karamelo_py.kernels.hooks import CompiledHook
from karamelo_py.language.scene import Scene
from karamelo_py.output.point_table import AXES, declared_columns, volumes_before
from karamelo_py.points.laws import can, constrained_velocity


class NodeTable(NamedTuple):
    """Columns of nodes with consecutive numbers. Nodes without mass are at rest."""

    hub: Scene
    ids: np.ndarray
    kin: Any
    arrays: dict[str, np.ndarray]  # arrays by name, as in restart files
    brought: dict[str, np.ndarray]  # sums over points, by the names in `BROUGHT`
    loaded: dict[str, int]  # number of nodes with mass, by ID of the fixes with a total force

    def node(self, name: str) -> np.ndarray:
        if name == "T" and self.hub.update.thermal:
            mass = self.arrays["heat/sums"][:, MASS]
            return np.where(mass > 0, self.arrays["heat/velocity"][:, 0], 0.0)
        if (show := COLUMNS.get(name)) is not None:
            return show(self)
        if name in (shown := declared_columns(self.hub, "node_fields")):
            kind, k = shown[name]
            array = self.arrays.get(f"nodes/{fields.name_of(kind)}")
            if array is not None and k < kind.shape(self.kin):
                return array[:, k].astype(float)
        return np.zeros(len(self.ids))

    def positions(self) -> np.ndarray:
        return places_of(self.hub, self.ids)


def by_lattice(hub: Scene, nodes: np.ndarray) -> Iterator[tuple[Any, slice]]:
    for lattice in hub.lattices:
        ends = lattice.first, lattice.first + lattice.node_count
        yield lattice, slice(*np.searchsorted(nodes, ends))


def places_of(hub: Scene, nodes: np.ndarray) -> np.ndarray:
    positions = np.empty((len(nodes), 3))
    for lattice, rows in by_lattice(hub, nodes):
        positions[rows] = lattice.positions(nodes[rows])
    return positions


def mask(nodes: NodeTable) -> np.ndarray:
    """Return Karamelo's group bits: 1 for all nodes, 2 for the first group, 4 for the next ..."""
    bits = np.ones(len(nodes.ids))
    for k, group in enumerate(nodes.hub.groups.values(), 1):
        if group.kind == "nodes":
            bits[_among(group.nodes, nodes)] += 2.0**k
    return bits


def _among(members: np.ndarray, nodes: NodeTable) -> np.ndarray:
    first = nodes.ids[0]
    return members[slice(*np.searchsorted(members, (first, nodes.ids[-1] + 1)))] - first


def kind_of_node(axis: int, nodes: NodeTable) -> np.ndarray:
    """Return the kind of each node along one axis, as in Karamelo.

    With splines, the kind is -2 at the lower edge and -1 next to it, 2 at the upper edge and 1 next
    to it. With Bernstein polynomials, it is 1 in the middle of a cell. With other bases, the kind
    is 0.
    """
    basis = nodes.hub.update.method.basis
    splines = type(basis).__name__ in ("QuadraticSpline", "CubicSpline")
    kinds = np.zeros(len(nodes.ids))
    if axis >= nodes.hub.domain.dimension:
        return kinds
    for lattice, rows in by_lattice(nodes.hub, nodes.ids):
        i, last = lattice.places(nodes.ids[rows])[:, axis], lattice.shape[axis] - 1
        if splines:
            kinds[rows] = np.minimum(2, i) - np.minimum(2, last - i)
        elif basis.traits.nodes_per_cell == 2:
            kinds[rows] = i % 2
    return kinds


def load(axis: int, nodes: NodeTable) -> np.ndarray:
    """Return the loads of fixes on nodes, and the loads on points mapped to nodes by the basis."""
    hub = nodes.hub
    out = nodes.brought[f"b{AXES[axis]}"].copy()
    if axis >= hub.domain.dimension:
        return out
    mass, positions = nodes.node("mass"), nodes.positions()
    dt = float(hub.values.array[TIME + 2])
    momentum = nodes.arrays["nodes/sums"][:, of_momentum(nodes.kin) + axis]
    for ID, count in nodes.loaded.items():
        fix = hub.fixes[ID]
        if fix.formulas[axis] is None:
            continue
        members = np.arange(len(out)) if fix.group.all else _among(fix.nodes, nodes)
        members = members[mass[members] > 0]
        value = fix.formulas[axis].evaluate_points(hub.values, positions[members])
        v = momentum[members] / mass[members]
        act = fix.hooks()[LOADS].function
        for n, b, u in zip(members, value, v, strict=True):
            out[n] += act(mass[n], u, u, 0.0, b, b, dt, 1 / max(count, 1))[2]
    return out


def of_vector(name: str, first: Callable, axis: int, nodes: NodeTable) -> np.ndarray:
    if axis >= nodes.hub.domain.dimension:
        return np.zeros(len(nodes.ids))
    component = nodes.arrays[name][:, first(nodes.kin) + axis]
    return np.where(nodes.node("mass") > 0, component, 0.0)


def vector(name: str, array: str, first: Callable = lambda kin: 0) -> dict[str, Callable]:
    return {
        name.replace("*", axis): partial(of_vector, f"nodes/{array}", first, k)
        for k, axis in enumerate(AXES)
    }


# None: the column exists in some scenes only; in the others it is 0.
COLUMNS: dict[str, Callable[[NodeTable], np.ndarray] | None] = {
    "id": lambda nodes: nodes.ids,
    "type": lambda nodes: np.searchsorted(
        [grid.first for grid in nodes.hub.lattices], nodes.ids, side="right"
    ),
    **{axis: lambda nodes, k=k: nodes.positions()[:, k] for k, axis in enumerate(AXES)},
    **vector("v*", "velocity"),
    **vector("v*_update", "update"),
    **vector("f*", "sums", of_force),
    "mass": lambda nodes: nodes.arrays["nodes/sums"][:, MASS].astype(float),
    "vol": lambda nodes: nodes.brought["vol"],
    "mask": mask,
    "rigid": lambda nodes: (nodes.brought["rigid"] > 0) * 1.0,
    "T": None,
    **{f"b{axis}": partial(load, k) for k, axis in enumerate(AXES)},
    **{f"ntype{axis}": partial(kind_of_node, k) for k, axis in enumerate(AXES)},
}

LOADS = "post_particles_to_grid"


def _volume(simulation: Any, block: Block) -> np.ndarray:
    ids = block.points.id
    rows = np.zeros((len(ids), EXPORTED))
    export_state(matter_of(simulation.setup.kin, block), rows)
    return volumes_before(simulation.hub, ids) * rows[:, JACOBIAN]


def _force(axis: int, _: object, block: Block) -> np.ndarray | None:
    force = fields.field(block.points.fields, Force)
    return None if force is None or axis >= len(force) else force[axis]


BROUGHT: dict[str, Callable[[Any, Block], np.ndarray | None]] = {
    "vol": _volume,
    "rigid": lambda simulation, block: (
        np.ones(len(block.points.id)) if can(block.laws, constrained_velocity) else None
    ),
    **{f"b{axis}": partial(_force, k) for k, axis in enumerate(AXES)},
}


def brought(simulation: Any, name: str) -> np.ndarray:
    """Return sums (nodes, 2) of N times a value over the points of this process.

    A column of multiples of a unit and one of remainders have more digits than one double.
    """
    s = simulation.setup
    out = np.zeros((len(s.nodes.sums), 2))
    terms = [(block, BROUGHT[name](simulation, block)) for block in s.blocks]
    terms = [(block, np.ascontiguousarray(of, float)) for block, of in terms if of is not None]
    largest = max((float(np.abs(of).max(initial=0)) for _, of in terms), default=0.0)
    largest = float(simulation.comm.allreduce_max(np.array([largest]))[0])
    unit = 2.0 ** (frexp(largest)[1] - 36)
    for block, of in terms if largest > 0 else ():
        points = block.points
        where = points.x[simulation.now] if points.home is None else points.home
        at = OnGrids(s.basis, s.kin, s.grids, points.grid, where)
        export_to_nodes(at, of, unit, out)
    return out


def loaded(hub: Scene, simulation: Any) -> dict[str, int]:
    loading = {
        ID: fix for ID, fix in hub.fixes.items() if isinstance(fix.hooks().get(LOADS), CompiledHook)
    }
    with_mass = simulation.nodes.with_mass()
    counts = [
        len(with_mass) if fix.group.all else np.count_nonzero(np.isin(with_mass, fix.nodes))
        for fix in loading.values()
    ]
    return dict(
        zip(loading, simulation.comm.allreduce(np.array(counts, np.int64)).tolist(), strict=True)
    )
