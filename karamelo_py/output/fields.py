"""Fields of points and nodes for output, in the order of their ids."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import known_to_laws
from karamelo_py.kernels.export import export
from karamelo_py.kernels.laws import elastic_law
from karamelo_py.language.arguments import Argument
from karamelo_py.language.scene import Scene
from karamelo_py.output import node_columns, point_table
from karamelo_py.output.node_columns import BROUGHT, NodeFields
from karamelo_py.output.point_table import PointTable, Rows, absent, declared_columns
from karamelo_py.points.grid import Bounces
from karamelo_py.points.laws import can, dissipated_energy, energy_density
from karamelo_py.points.laws.eos import initial_energy, taken_heat
from karamelo_py.points.laws.further import has_rate
from karamelo_py.script.errors import ScriptError, one_of, table, unknown
from karamelo_py.script.expressions import Expression

PIECE = 1 << 17  # points that are looked at together


class Fields(PointTable):
    """The points and nodes of the running scene: columns of all points, sums over them, names."""

    def __init__(self, hub: Scene):
        self.hub = hub
        self._key: Any = None
        self._cache: dict[str, Any] = {}

    @property
    def _rows(self) -> Rows:
        """All points; the cache of what was made of them is forgotten when they have gone on."""
        simulation = self.hub.simulation
        key = (id(simulation), simulation.step, simulation.version)
        if key != self._key:
            self._key = key
            self._cache.clear()
        return simulation.points.rows()

    def pieces(self, *, to_first: bool = False) -> Iterator[PointTable]:
        """The points, so many at a time, by id; with `to_first` the first process gets them all."""
        return self.hub.simulation.points.pieces(to_first=to_first)

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return sum(lattice.node_count for lattice in self.hub.lattices)

    def members(self, group: Any) -> np.ndarray:
        """Ids (0-based) of a particle group, without deleted points."""
        return self.hub.simulation.points.members(group)

    def energy(self, kind: str, group: Any) -> float:
        """Energy of a particle group: kinetic (sum m v^2 / 2), stored or dissipated."""
        return self.hub.simulation.points.total(kind, group)

    def added_up(self, part: Any, name: str = "terms", *arguments: Any) -> np.ndarray:
        """Sums (k,) over the points of a part's group, rounded once: of processes and of one alike.

        The method `name` of the part, a compute or fix as it stands in the scene, is called with
        fields of some of the points after others, and `arguments`, and returns terms (k, n).
        """
        return self.hub.simulation.points.added_up(part, name, *arguments)

    def each(self, part: Any, name: str, *arguments: Any) -> list:
        """List what a method of a part says of fields of some points of its group after others.

        Which points are together, and their order, depends on processes and steps.
        """
        return self.hub.simulation.points.each(part, name, *arguments)

    def particle_names(self) -> list[str]:
        """Names that `particle` knows."""
        own = [*sorted(self.columns_of_laws()), *declared_columns(self.hub, "point_fields")]
        return list(dict.fromkeys([*point_table.COLUMNS, *own]))

    def shown_names(self) -> list[str]:
        """Names that `particle` knows, then groups of points and solids: 1 for theirs, else 0."""
        return [*self.particle_names(), *point_table.named_sets(self.hub)]

    def node_names(self) -> list[str]:
        """Names that `node` knows."""
        own = declared_columns(self.hub, "node_fields")
        return list(dict.fromkeys([*node_columns.COLUMNS, *own]))

    def rate_is_asked_for(self) -> bool:
        """Tell whether a dump or a compute has the column ``epdot``, which points keep for it."""
        askers = [*self.hub.dumps.values(), *self.hub.computes.values()]
        return any("epdot" in getattr(asker, "columns", ()) for asker in askers)

    def absent_at_points(self) -> list[str]:
        """Names that `particle` knows, but that are 0 because no material has them."""
        present = self.columns_of_laws() | {*declared_columns(self.hub, "point_fields")}
        if any(has_rate(material.law) for material in self.hub.materials.values()):
            present.add("epdot")
        return absent(point_table.COLUMNS, present)

    def absent_at_nodes(self) -> list[str]:
        """Names that `node` knows, but that are 0 in this scene."""
        present = {*declared_columns(self.hub, "node_fields"), *["T"] * self.hub.update.thermal}
        return absent(node_columns.COLUMNS, present)

    def node_pieces(self, names: Sequence[str], *, to_first: bool = False) -> Iterator[NodeFields]:
        """Fields of all nodes, of which `names` are asked for, so many at a time, see `pieces`."""
        brought = [name for name in names if name in BROUGHT]
        for rows in self.hub.simulation.nodes.pieces(brought, to_first=to_first):
            yield NodeFields(self.hub, rows)

    @property
    def occupied_nodes(self) -> tuple[int, int]:
        """The number of nodes with mass, and the last of them."""
        return self.hub.simulation.nodes.occupied()

    def node(self, name: str) -> np.ndarray:
        """A field of all nodes, (n,); nodes without mass are at rest."""
        return np.concatenate([piece.node(name) for piece in self.node_pieces([name])])


def _kinetic(s: Any, block: Any) -> np.ndarray:
    points = block.points
    v = point_table.shown_velocity(s, points).astype(float)
    return 0.5 * points.mass.astype(float) * (v**2).sum(axis=0)


def _of_law(density: Callable) -> Callable:
    """Energy of each point, from its density."""

    def energies(s: Any, block: Any) -> np.ndarray | None:
        if not can(block.laws, density):
            return None
        points = known_to_laws(block.points)
        rows = np.zeros(len(points.id))
        if len(rows):
            export(density.tag, True, s.kin, points, block.laws, rows)
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


class ColumnFormula:
    """For signatures: a formula of columns of dump particle, time and published values.

    The name of a group of points or a solid is a column, too: 1 for its points and 0 for others.
    """

    script_kind = "a condition of columns of dump particle, such as damage > 0.9"
    MOST = 6

    def __init__(self, hub: Scene, argument: Argument):
        columns = hub.fields.particle_names()
        sets = hub.fields.shown_names()[len(columns) :]
        of_both = [name for name in sets if name in columns or argument.knows(name)]
        if clash := set(of_both).intersection(re.findall(r"[^\W\d]\w*", argument.text)):
            what = f"'{min(clash)}' is a group or solid, and a column or another value, too"
            raise ScriptError(what, place=argument.place, hint="rename the group or solid")
        known = [*columns, *(name for name in sets if name not in of_both)]
        self.hub, self.text = hub, argument.text
        self.formula = Expression(argument.value_with(known))
        self.columns = sorted(self.formula.names & set(known))
        for name in self.columns:
            if name in hub.interpreter.variables:
                hub.warn(
                    f"'{name}' is the column here, not the variable of the script",
                    place=argument.part(name).place,
                    hint=f"another name for the variable, such as {name}_0, if it is meant",
                )
        if not self.columns or len(self.columns) > self.MOST:
            many = "no column" if not self.columns else f"{len(self.columns)} columns"
            raise ScriptError(
                f"'{argument.text}' has {many} of dump particle",
                place=argument.place,
                expected=f"1 to {self.MOST} of {', '.join(columns)}",
            )

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> "ColumnFormula":
        """Read the formula that a script's argument stands for."""
        return cls(hub, argument)

    def of(self, points: PointTable) -> np.ndarray:
        """Evaluate the formula for each of the points that there are, (n,)."""
        columns = {name: points.particle(name) for name in self.columns}
        return self.formula.evaluate_columns(self.hub.values, columns)

    def holds(self, points: PointTable) -> np.ndarray:
        """(n,) whether it is not 0 for points that there are."""
        return self.of(points) != 0


class ShownColumn(ColumnFormula):
    """For signatures: the name of a column of dump particle, or a formula of columns."""

    script_kind = "a column of dump particle, or a formula of columns, such as sqrt(vx^2 + vy^2)"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        """Read the name, or the formula."""
        word = argument.word()
        return word if word is not None and word.isidentifier() else cls(hub, argument)


# ---- columns that are asked for by name, and may be none ----------------------------------------


def check_columns(columns: Sequence[str], known: Sequence[str], *, first: int) -> None:
    """Refuse names that are not `known`; `first` is the place of the first among the arguments."""
    for index, name in enumerate(columns):
        if name not in known:
            raise unknown_column(f"unknown column '{name}'", name, known, argument=first + index)


def unknown_column(message: str, name: str, known: Iterable[str], **where: Any) -> ScriptError:
    """Make the error for a column that is none of the `known`; `where` it stands."""
    known = list(known)
    error = unknown(message, name, known, code="unknown-column", **where)
    error.expected = one_of(name, known, page="docs/reference/columns.md")
    others = table()["columns"].items()
    quantity = next((columns for columns, words in others if name.lower() in words), "")
    if there := [column for column in quantity.split() if column in known]:
        error.hint, error.alike = f"did you mean {', '.join(there)}?", there[0]
    component = re.fullmatch(r"(s|sigma|stress|e|eps|strain)_?([xyz123])([xyz123])", name.lower())
    if component is not None:
        i, j = sorted("xyz".find(axis) + 1 or int(axis) for axis in component.groups()[1:])
        tensor = "e" if component[1] in ("e", "eps", "strain") else "s"
        error.alike = f"{tensor}{i}{j}"
        error.hint = f"did you mean '{error.alike}'?"
    if name[:2] in ("v_", "c_"):  # as in LAMMPS
        error.hint = f"log_modify(custom, step, time, {name[2:]}) writes one number"
    return error
