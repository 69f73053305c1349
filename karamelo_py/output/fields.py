"""Fields of points and nodes for output, in the order of their ids."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import MASS, known_to_laws
from karamelo_py.kernels.export import export
from karamelo_py.kernels.laws import elastic_law
from karamelo_py.language.scene import Scene
from karamelo_py.output.node_columns import ABSENT_AT_NODES, BROUGHT, NODE_NAMES, NodeFields
from karamelo_py.output.point_table import AXES, COMPONENTS, PointTable, Rows
from karamelo_py.points.grid import Bounces
from karamelo_py.points.laws import can, dissipated_energy, energy_density
from karamelo_py.points.laws.eos import initial_energy, taken_heat
from karamelo_py.points.laws.further import has_rate

PIECE = 1 << 17  # points that are looked at together
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


class Fields(PointTable):
    """The points and nodes of the running scene: columns of all points, sums over them, names.

    N counts all points there have ever been. `members` leaves deleted ones out.
    """

    def __init__(self, hub: Scene):
        self.hub = hub
        self._key: Any = None
        self._cache: dict[str, Any] = {}

    @property
    def _simulation(self) -> Any:
        return self.hub.simulation

    @property
    def _rows(self) -> Rows:
        """All points; the cache of what was made of them is forgotten when they have gone on."""
        simulation = self.hub.simulation
        key = (id(simulation), simulation.step, simulation.version)
        if key != self._key:
            self._key = key
            self._cache.clear()
        return simulation.rows()

    @property
    def count(self) -> int:
        """Number of points."""
        return self._simulation.count

    @property
    def present(self) -> np.ndarray:
        """(N,) False for points that were deleted."""
        return self._simulation.present

    def pieces(self, *, to_first: bool = False) -> Iterator[PointTable]:
        """The points, so many at a time, in the order of their ids.

        With `to_first`, of several processes the first alone gets them.
        """
        return self._simulation.pieces(to_first=to_first)

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return sum(lattice.node_count for lattice in self.hub.lattices)

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
