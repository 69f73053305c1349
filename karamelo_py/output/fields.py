"""Fields of points and nodes for output, in the order of their ids."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import MASS, known_to_laws
from karamelo_py.kernels.averaging import FBar
from karamelo_py.kernels.export import (
    ENERGY,
    EXPORTED,
    JACOBIAN,
    STRAIN,
    export,
    export_state,
    export_velocity_moment,
)
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.laws import elastic_law
from karamelo_py.language.scene import Scene
from karamelo_py.output.node_columns import ABSENT_AT_NODES, BROUGHT, NODE_NAMES, NodeFields
from karamelo_py.points.boundary import Bounces, ReflectingGrid
from karamelo_py.points.laws import can, columns_of, dissipated_energy, energy_density
from karamelo_py.points.laws.eos import initial_energy, taken_heat
from karamelo_py.points.laws.plastic_rate import has_rate
from karamelo_py.points.transfers import Moment

PIECE = 1 << 17  # points that are looked at together
AXES = "xyz"
COMPONENTS = ("11", "22", "33", "12", "13", "23")
PARTICLE_NAMES = (
    ["id", "type"]
    + list(AXES)
    + [axis + "0" for axis in AXES]
    + ["v" + axis for axis in AXES]
    + ["s" + c for c in COMPONENTS]
    + ["e" + c for c in COMPONENTS]
    + ["seq", "volume", "mass", "damage", "damage_init", "bx", "by", "bz", "ep", "epdot"]
    + ["T", "ienergy", "gamma"]
)

# Columns of Karamelo that are zero here: nothing keeps them apart, or only some materials do.
ABSENT_AT_POINTS = (
    "damage", "damage_init", "bx", "by", "bz", "ep", "epdot", "T", "gamma",
)  # fmt: skip


class Fields:
    """Named fields of the running scene; arrays are copies that are safe to keep.

    N counts all points there have ever been: deleted ones (boundary delete) have zeros. `members`
    and `particle` leave them out. Those of a `piece` are some of the points, one id after another.
    """

    def __init__(self, hub: Scene, piece: Any = None):
        self.hub = hub
        self._piece = piece
        self._key: Any = None
        self._cache: dict[str, Any] = {}

    @property
    def _simulation(self):
        """The simulation; the cache of derived fields is forgotten when it has gone on."""
        if self._piece is not None:
            return self._piece
        simulation = self.hub.simulation
        key = (id(simulation), simulation.step, simulation.version)
        if key != self._key:
            self._key = key
            self._cache.clear()
        return simulation

    def pieces(self, *, to_first: bool = False) -> Iterator["Fields"]:
        """The fields of all points, so many points at a time, in the order of their ids.

        With `to_first`, of several processes the first alone gets them.
        """
        for piece in self._simulation.pieces(to_first=to_first):
            yield Fields(self.hub, piece)

    def _cached(self, name: str, make) -> Any:
        simulation = self._simulation
        if name not in self._cache:
            self._cache[name] = make(simulation)
        return self._cache[name]

    @property
    def count(self) -> int:
        """Number of points."""
        return self._simulation.count

    @property
    def present(self) -> np.ndarray:
        """(N,) False for points that were deleted."""
        return self._simulation.present

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return sum(lattice.node_count for lattice in self.hub.lattices)

    @property
    def position(self) -> np.ndarray:
        """(N, d) positions."""
        return self._cached("x", lambda s: s.x)

    @property
    def velocity(self) -> np.ndarray:
        """(N, d) velocities."""
        return self._cached("v", lambda s: s.v)

    @property
    def mass(self) -> np.ndarray:
        """(N,) masses."""
        return self._cached("mass", lambda s: s.mass)

    @property
    def reference_position(self) -> np.ndarray:
        """(N, d) positions before the first step."""
        return self._simulation.x0

    @property
    def reference_volume(self) -> np.ndarray:
        """(N,) volumes before the first step."""
        return self._simulation.volume0

    @property
    def velocity_moment(self) -> np.ndarray | None:
        """(N, d d) moment of velocity, sum N v (X - x), of transfers that keep it, or None."""
        simulation = self._simulation
        if simulation.declared(Moment) is None:
            return None
        return simulation.by_id(self._velocity_moment).T

    def _velocity_moment(self, points: Any) -> np.ndarray:
        s = self._simulation.setup
        kept = fields.field(points.fields, Moment)
        if not getattr(s.transfer, "keeps_gradient", False):
            return kept
        where = points.x[self._simulation.now] if points.home is None else points.home
        moment = np.zeros_like(kept)
        export_velocity_moment(s.basis, s.kin, s.grids, points.grid, where, kept, moment)
        return moment

    def declared_columns(self) -> dict[str, tuple[type, int]]:
        """Column -> the declared field of the points that shows it, and the component."""
        update = self.hub.update
        basis = getattr(update.method, "basis", None)
        owners = [*self.hub.fixes.values(), update.method, update.transfer, basis, update.scheme]
        owners += [getattr(update.method, "frame", None)]
        owners += [Conducting] if update.thermal else []
        owners += [ReflectingGrid] if update.boundary == "reflect" else []
        owners += [FBar] if update.anti_locking else []
        found: dict[str, tuple[type, int]] = {}
        for kind in fields.declared(owners, "point_fields"):
            for k, column in enumerate(fields.columns_of(kind)):
                found.setdefault(column, (kind, k))
        return found

    def members(self, group: Any) -> np.ndarray:
        """Ids (0-based) of a particle group."""
        return self._simulation.members(group)

    def kinetic_energy(self, group: Any) -> float:
        """sum m v^2 / 2 of a particle group."""
        return self._simulation.total("kinetic", group)

    def strain_energy(self, group: Any) -> float:
        """Stored energy of a particle group."""
        return self._simulation.total("stored", group)

    def dissipated_energy(self, group: Any) -> float:
        """Dissipated energy of a particle group."""
        return self._simulation.total("dissipated", group)

    def added_up(self, part: Any, name: str = "terms", *arguments: Any) -> np.ndarray:
        """Sums (k,) over the points of a part's group, rounded once: of processes and of one alike.

        Parameters
        ----------
        part
            A compute or fix, as it stands in the scene.
        name
            Of its method that is called with fields of some of the points after others, and the
            `arguments`, and returns terms (k, n).
        """
        return self._simulation.added_up(part, name, *arguments)

    def each(self, part: Any, name: str, *arguments: Any) -> list:
        """List what a method of a part says of fields of some points of its group after others.

        Which points are together, and in what order they come, depends on processes and steps.
        """
        return self._simulation.each(part, name, *arguments)

    def particle_names(self) -> list[str]:
        """Names that `particle` knows."""
        own = [*sorted(self.columns_of_laws()), *self.declared_columns()]
        return list(dict.fromkeys([*PARTICLE_NAMES, *own]))

    def node_names(self) -> list[str]:
        """Names that `node` knows."""
        return list(NODE_NAMES)

    def columns_of_laws(self) -> set[str]:
        """Names of what the laws of the materials declare."""
        laws = [material.law for material in self.hub.materials.values()]
        return {name for law in laws for name in columns_of(law)}

    def rate_is_asked_for(self) -> bool:
        """Tell whether a dump or a compute has the column ``epdot``, which points keep for it."""
        askers = [*self.hub.dumps.values(), *self.hub.computes.values()]
        return any("epdot" in getattr(asker, "columns", ()) for asker in askers)

    def absent_at_points(self) -> list[str]:
        """Names that `particle` knows, but that are 0 because no material has them."""
        present = self.columns_of_laws() | set(self.declared_columns())
        if any(has_rate(material.law) for material in self.hub.materials.values()):
            present.add("epdot")
        return [name for name in ABSENT_AT_POINTS if name not in present]

    def absent_at_nodes(self) -> list[str]:
        """Names that `node` knows, but that are 0 in this scene."""
        present = {"T"} if self.hub.update.thermal else set()
        return [name for name in ABSENT_AT_NODES if name not in present]

    def particle(self, name: str) -> np.ndarray:
        """A field of the points that there are, (n,), by id.

        What the scene does not have is zero, as in Karamelo. Deleted points are left out.
        """
        values = self._particle(name)
        present = self._simulation.present
        return values if present.all() else values[present]

    def _particle(self, name: str) -> np.ndarray:
        simulation = self._simulation
        if name == "id":
            return simulation.ids + 1
        if name == "type":
            return simulation.solid_of + 1
        if name in AXES:
            return _column(self.position, AXES.index(name))
        if name[:1] in AXES and name[1:] == "0":
            return _column(self.reference_position, AXES.index(name[0]))
        if name in ("vx", "vy", "vz"):
            return _column(self.velocity, AXES.index(name[1]))
        if name == "mass":
            return self.mass.astype(float)
        if name == "volume":
            return self.reference_volume * self._exported[:, JACOBIAN]
        if name == "ienergy":
            return self._exported[:, ENERGY].copy()
        if name in self.columns_of_laws() or name == "epdot":
            return self._cached(name, lambda s: _shown(s, name)).copy()
        if name == "seq":
            return _von_mises(self._exported[:, :STRAIN])
        if name[:1] in "se" and name[1:] in COMPONENTS:
            first = 0 if name[0] == "s" else STRAIN
            return self._exported[:, first + COMPONENTS.index(name[1:])].copy()
        if name in (shown := self.declared_columns()):
            kind, k = shown[name]
            if (array := simulation.declared(kind)) is not None:
                return _column(array, k)
        return np.zeros(simulation.count)

    def node_pieces(self, names: Sequence[str], *, to_first: bool = False) -> Iterator[NodeFields]:
        """Fields of all nodes, of which `names` are asked for, so many nodes at a time.

        With `to_first`, of several processes the first alone gets them.
        """
        brought = [name for name in names if name in BROUGHT]
        for rows in self._simulation.node_pieces(brought, to_first=to_first):
            yield NodeFields(self.hub, rows)

    def mass_at_nodes(self, group: Any) -> np.ndarray:
        """(4,) the mass of the nodes of a group, and this times x, y and z; rounded once."""
        self._simulation.show_on_nodes()
        return self._simulation.mass_at_nodes(group.id)

    @property
    def occupied_nodes(self) -> tuple[int, int]:
        """The number of nodes with mass, and the last of them."""
        self._simulation.show_on_nodes()
        return self._simulation.occupied_nodes()

    def node(self, name: str) -> np.ndarray:
        """A field of all nodes, (n,); nodes without mass are at rest."""
        return np.concatenate([piece.node(name) for piece in self.node_pieces([name])])

    @property
    def _exported(self) -> np.ndarray:
        return self._cached("exported", _exported_state)


def _of_points(simulation: Any, filler: Callable, *columns: int) -> np.ndarray:
    """Collect what `filler(laws)(kin, like, points, laws, rows)` says of all points, (N, *columns).

    Points are left at 0 where their laws do not have it, and `filler(laws)` is false.
    """
    s = simulation.setup
    out = np.zeros((simulation.count, *columns))
    for block in s.blocks:
        points = known_to_laws(block.points)
        # Arrays without points are of another type, for which all would be compiled once more.
        if len(points.id) and (fill := filler(block.laws)):
            rows = np.zeros((len(points.id), *columns))
            fill(s.kin, s.nodes.sums[0, MASS], points, block.laws, rows)
            out[points.id - simulation.first] = rows
    return out


def _exported_state(simulation: Any) -> np.ndarray:
    # A kinematics fills its own components: in the plane the fourth is 12, as in space.
    return _of_points(simulation, lambda laws: export_state, EXPORTED)


def _kinetic(s: Any, block: Any) -> np.ndarray:
    points = block.points
    return 0.5 * points.mass.astype(float) * (points.v.astype(float) ** 2).sum(axis=0)


def _of_law(density: Callable) -> Callable:
    """Energy of each point, from its density."""

    def energies(s: Any, block: Any) -> np.ndarray | None:
        if not can(block.laws, density):
            return None
        points, like = known_to_laws(block.points), s.nodes.sums[0, MASS]
        rows = np.zeros(len(points.id))
        if len(rows):
            export(density.tag, True, s.kin, like, points, block.laws, rows)
        return rows

    return energies


def _bounces(s: Any, block: Any) -> np.ndarray | None:
    counts = fields.field(block.points.fields, Bounces)
    return None if counts is None else counts.astype(float).ravel()


def _born_with(s: Any, block: Any) -> np.ndarray | None:
    """Internal energy of a gas as it was made.

    The stored energy counts from there; beside it alone, all that a gas does would be much.
    """
    law = elastic_law(block.laws)
    if not can(law, taken_heat):
        return None
    of_eos = np.array(initial_energy(law.eos, 1.0)[0]) * law.eos.specific_volume
    return (block.points.mass * of_eos[block.points.material]).astype(float)


# What the points of a block have that can be added up; None where their law does not have it.
SUMMED = {
    "mass": lambda s, block: block.points.mass.astype(float),
    "kinetic": _kinetic,
    "stored": _of_law(energy_density),
    "dissipated": _of_law(dissipated_energy),
    "born with": _born_with,
    "bounces": _bounces,
}


def _shown(simulation: Any, name: str) -> np.ndarray:
    """A number of each point that its law declares, 0 of laws that do not."""

    def fill(laws: Any) -> Callable | None:
        what = columns_of(laws).get(name)
        return None if what is None else partial(export, what, False)

    return _of_points(simulation, fill)


def _column(field: np.ndarray, k: int) -> np.ndarray:
    if k >= field.shape[1]:
        return np.zeros(len(field))
    return field[:, k].astype(float)


def _von_mises(s: np.ndarray) -> np.ndarray:
    xx, yy, zz, xy, xz, yz = s.T
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return np.sqrt(0.5 * normal + 3 * (xy**2 + xz**2 + yz**2))
