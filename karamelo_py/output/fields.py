"""Points and nodes for output, and formulas of their columns."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from math import inf
from typing import Any, Protocol

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.kernels.arrays import Block, Setup, arrays_of, joined_points, matter_of, some_of
from karamelo_py.kernels.equations.internal_force import ContactLoss
from karamelo_py.kernels.equations.transfer_loss import TransferLoss
from karamelo_py.kernels.equations.twist import VelocityAround
from karamelo_py.kernels.export import export
from karamelo_py.kernels.totals import CONTACT_LOSS, LIMBS, add_all, add_rows, values_of
from karamelo_py.language.arguments import Argument
from karamelo_py.language.scene import Scene
from karamelo_py.output import node_columns, point_table
from karamelo_py.output.node_columns import NodeTable
from karamelo_py.output.point_table import Part, PointTable, Rows, absent, declared_columns
from karamelo_py.points.grid import Bounces
from karamelo_py.points.laws import (
    can,
    dissipated_energy,
    elastic_law,
    energy_density,
    law_parts,
    parameter,
)
from karamelo_py.points.laws.eos import initial_energy, taken_heat
from karamelo_py.points.laws.further import has_rate
from karamelo_py.script.errors import ScriptError, one_of, table, unknown
from karamelo_py.script.expressions import Expression

LAST = 2**62
PIECE = 1 << 17


class PointGroup(Protocol):
    all: bool
    ids: np.ndarray

    def has(self, ids: np.ndarray) -> np.ndarray: ...


class Grouped(Protocol):
    group: PointGroup


class Fields(PointTable):
    def __init__(self, hub: Scene, simulation: Any = None):
        self.hub = hub
        self._own = simulation
        self._key: tuple | None = None
        self._cache: dict[str, np.ndarray] = {}

    @property
    def simulation(self) -> Any:
        return self.hub.simulation if self._own is None else self._own

    @property
    def setup(self) -> Setup:
        return self.simulation.setup

    @property
    def comm(self) -> Any:
        return self.simulation.comm

    @property
    def _rows(self) -> Rows:
        simulation = self.simulation
        key = (id(simulation), simulation.step, simulation.version)
        if key != self._key:
            self._key = key
            self._cache.clear()
        return self.rows()

    def rows(self) -> Rows:
        simulation = self.simulation
        setup, present = simulation.setup, simulation.present
        parts = [Part(block, None, block.points.id) for block in setup.blocks]
        comm = simulation.comm if simulation.comm.size > 1 else None
        return Rows(setup, parts, np.arange(len(present)), present, comm)

    def members(self, group: PointGroup) -> np.ndarray:
        """Return the numbers of existing points, from 0."""
        present = self.simulation.present
        ids = np.arange(len(present)) if group.all else group.ids
        return ids if present.all() else ids[present[ids]]

    def total(self, name: str, group: PointGroup | None = None) -> float:
        """Sum a quantity of `SUMMED` exactly over a group or all points."""
        limbs = np.zeros((1, LIMBS), np.int64)
        for block in self.setup.blocks:
            values = SUMMED[name](self.setup, block)
            if values is not None:
                some = slice(None) if group is None or group.all else group.has(block.points.id)
                add_all(limbs, values[None, some])
        return float(values_of(self.comm.allreduce(limbs))[0])

    def lost_by_contact(self) -> float:
        """Return the energy that contact at points and nodes has dissipated since the start."""
        at_nodes = self.comm.allreduce(self.setup.control.totals[CONTACT_LOSS].copy())
        return self.total("contact loss") + float(values_of(at_nodes[None])[0])

    def lost_by_transfer(self) -> float | None:
        """Return the energy lost in the transfer since the start; None if it is not counted."""
        blocks = self.setup.blocks
        if all(fields.field(block.points.fields, TransferLoss) is None for block in blocks):
            return None
        deleted = float(self.setup.control.energy[0].lost_with_deleted)
        return deleted + self.total("transfer loss")

    def rows_of(self, group: PointGroup | None) -> Iterator[tuple[Block, np.ndarray]]:
        for block in self.setup.blocks:
            ids = block.points.id
            for first in range(0, len(ids), PIECE):
                rows = np.arange(first, min(first + PIECE, len(ids)))
                if not (group is None or group.all):
                    rows = rows[group.has(ids[rows])]
                if len(rows):
                    yield block, rows

    def some(self, group: PointGroup | None) -> Iterator[PointTable]:
        for block, rows in self.rows_of(group):
            yield self._some(block, rows)
        yield self._some(self.setup.blocks[0], np.empty(0, np.int64))

    def _some(self, block: Block, rows: np.ndarray) -> PointTable:
        parts, ids = [Part(block, rows, slice(None))], block.points.id[rows]
        return PointTable(self.hub, Rows(self.setup, parts, ids, np.ones(len(ids), np.bool_)))

    def added_up(self, owner: Grouped, name: str = "terms", *arguments: object) -> np.ndarray:
        """Sum terms exactly over the points in the group of `owner`.

        ``owner.name(points, *arguments)`` is called with tables of some points. The method returns
        terms (k, n) of k sums, or three values: the number of sums, the index (n,) of the sum to
        which each term belongs, and terms (n,).
        """
        limbs = np.empty((0, LIMBS), np.int64)
        for some in self.some(owner.group):
            terms, rows = getattr(owner, name)(some, *arguments), None
            if isinstance(terms, tuple):
                count, rows, terms = terms
            else:
                count = len(terms)
            if not len(limbs):
                limbs = np.zeros((count, LIMBS), np.int64)
            if rows is not None:
                add_rows(limbs, rows, terms)
                continue
            add_all(limbs, np.ascontiguousarray(terms, float))
        return values_of(self.comm.allreduce(limbs))

    def summed(self, terms: np.ndarray) -> np.ndarray:
        """Sum terms (n,) or (n, k) over all processes, rounded once."""
        columns = terms.reshape(len(terms), int(np.prod(terms.shape[1:]))).T
        limbs = np.zeros((len(columns), LIMBS), np.int64)
        add_all(limbs, np.ascontiguousarray(columns))
        return values_of(sum(self.comm.everyone("a total", limbs))).reshape(terms.shape[1:])

    def each(self, owner: Grouped, name: str, *arguments: object) -> list:
        results = (getattr(owner, name)(some, *arguments) for some in self.some(owner.group))
        local = [one for one in results if one is not None]
        return [one for of_rank in self.comm.allgather(local) for one in of_rank]

    def near(self, x: np.ndarray, half: np.ndarray) -> np.ndarray:
        """Return the numbers of the points within `half` (n, d) of a position in `x` (n, d)."""
        size, numbers = half.min(axis=0), []
        x = x / size
        lo, hi = x.min(axis=0, initial=inf) - 1, x.max(axis=0, initial=-inf) + 1
        for some in self.some(None):
            scaled = some.position / size
            around = np.flatnonzero(((scaled > lo) & (scaled < hi)).all(axis=1))
            hit = [k for k in around if (np.abs(x - scaled[k]) < 1).all(axis=1).any()]
            numbers.append(some.numbers[hit])
        of_all = self.comm.allgather(np.concatenate([np.empty(0, np.int64), *numbers]))
        return np.sort(np.concatenate(of_all))

    def seen(self, say: Callable, *arguments: object) -> list:
        return self.comm.allgather(say(self.simulation, *arguments))

    def largest(self, of: Callable[[PointTable], np.ndarray]) -> tuple[float, int]:
        """Return the largest value, and the first point with it."""

        def of_rank() -> tuple[float, int]:
            best = -inf, 0
            for some in self.some(None):
                values = of(some)
                value = np.fmax.reduce(values, initial=-inf)
                first = some.numbers[values == value].min(initial=LAST)
                best = max(best, (float(value), -int(first)))
            return best

        value, number = max(self.comm.allgather(of_rank()))
        return value, -number

    def pieces(self, *, to_first: bool = False) -> Iterator[PointTable]:
        s = self.setup
        orders = [np.argsort(block.points.id) for block in s.blocks]
        ordered = [block.points.id[order] for block, order in zip(s.blocks, orders, strict=True)]
        gather = self.comm.gather if to_first else self.comm.allgather
        present = self.simulation.present
        for first, end in ranges(len(present)):
            blocks = [
                some_of(block, order[slice(*np.searchsorted(ids, (first, end)))])
                for block, order, ids in zip(s.blocks, orders, ordered, strict=True)
            ]
            if self.comm.size > 1:
                local = [[array for _, array in arrays_of(block.points)] for block in blocks]
                gathered = gather(local)
                if gathered is None:
                    continue
                blocks = [
                    block._replace(points=joined_points(block.points, parts))
                    for block, parts in zip(blocks, zip(*gathered, strict=True), strict=True)
                ]
            parts = [Part(block, None, block.points.id - first) for block in blocks]
            ids = np.arange(first, end)
            yield PointTable(self.hub, Rows(s, parts, ids, present[first:end]))

    def particle_names(self) -> list[str]:
        of_scene = [*sorted(self.columns_of_laws()), *declared_columns(self.hub, "point_fields")]
        return list(dict.fromkeys([*point_table.COLUMNS, *of_scene]))

    def shown_names(self) -> list[str]:
        """Return the names of columns, then of groups and solids."""
        return [*self.particle_names(), *point_table.named_sets(self.hub)]

    def node_names(self) -> list[str]:
        of_scene = declared_columns(self.hub, "node_fields")
        return list(dict.fromkeys([*node_columns.COLUMNS, *of_scene]))

    def rate_is_asked_for(self) -> bool:
        """Return True if a dump or compute uses ``epdot``, which points then store."""
        askers = [*self.hub.dumps.values(), *self.hub.computes.values()]
        return any("epdot" in asker.columns for asker in askers)

    def absent_at_points(self) -> list[str]:
        present = self.columns_of_laws() | {*declared_columns(self.hub, "point_fields")}
        if any(has_rate(material.law) for material in self.hub.materials.values()):
            present.add("epdot")
        return absent(point_table.COLUMNS, present)

    def absent_at_nodes(self) -> list[str]:
        present = {*declared_columns(self.hub, "node_fields"), *["T"] * self.hub.update.thermal}
        return absent(node_columns.COLUMNS, present)

    def node_pieces(self, names: Sequence[str], *, to_first: bool = False) -> Iterator[NodeTable]:
        return self.simulation.nodes.pieces(names, to_first=to_first)

    @property
    def node_count(self) -> int:
        return sum(lattice.node_count for lattice in self.hub.lattices)

    @property
    def occupied_nodes(self) -> tuple[int, int]:
        return self.simulation.nodes.occupied()

    def node(self, name: str) -> np.ndarray:
        return np.concatenate([piece.node(name) for piece in self.node_pieces([name])])


def ranges(count: int) -> Iterator[tuple[int, int]]:
    return ((first, min(first + PIECE, count)) for first in range(0, count, PIECE))


def _kinetic(s: Setup, block: Block) -> np.ndarray:
    points = block.points
    v = point_table.shown_velocity(s, points).astype(float)
    squared = (v**2).sum(axis=0)
    if (around := fields.field(points.fields, VelocityAround)) is not None:
        squared += around[0].astype(float) ** 2
    return 0.5 * points.mass.astype(float) * squared


def _of_law(density: Any) -> Callable:
    def energies(s: Setup, block: Block) -> np.ndarray | None:
        if not can(block.laws, density):
            return None
        rows = np.zeros(len(block.points.id))
        if len(rows):
            export(density.tag, True, matter_of(s.kin, block), rows)
        return rows

    return energies


def _of_field(kind: type) -> Callable:
    def numbers(_: Setup, block: Block) -> np.ndarray | None:
        array = fields.field(block.points.fields, kind)
        return None if array is None else array.astype(float).ravel()

    return numbers


def _born_with(_: Setup, block: Block) -> np.ndarray | None:
    """Return the initial energy of a gas; stored energies are relative to it, for precision."""
    if not can(elastic_law(block.laws), taken_heat):
        return None
    eos = next(filter(None, (parameter(part, "eos", ()) for part in law_parts(block.laws))))
    of_eos = np.array(initial_energy(eos, 1.0)[0]) * eos.specific_volume
    return (block.points.mass * of_eos[block.points.material]).astype(float)


SUMMED = {
    "mass": lambda s, block: block.points.mass.astype(float),
    "kinetic": _kinetic,
    "stored": _of_law(energy_density),
    "dissipated": _of_law(dissipated_energy),
    "born with": _born_with,
    "bounces": _of_field(Bounces),
    "contact loss": _of_field(ContactLoss),
    "transfer loss": _of_field(TransferLoss),
}


class ColumnFormula:
    """Script argument: a formula of dump columns, groups and solids, time and values.

    The name of a group or solid is 1 for its points, 0 for other points.
    """

    script_kind = "a condition of columns of dump particle, such as damage > 0.9"
    MOST = 6

    def __init__(self, hub: Scene, argument: Argument):
        columns = hub.fields.particle_names()
        sets = hub.fields.shown_names()[len(columns) :]
        of_both = [name for name in sets if name in columns or argument.knows(name)]
        if clash := set(of_both).intersection(re.findall(r"[^\W\d]\w*", argument.text)):
            message = f"'{min(clash)}' names both a group or solid and a column or value"
            raise ScriptError(message, mark=argument.mark, hint="rename the group or solid")
        names = [*columns, *(name for name in sets if name not in of_both)]
        self.hub, self.text = hub, argument.text.strip('"')
        self.formula = Expression(argument.value_with(names))
        self.columns = sorted(self.formula.names & set(names))
        for name in self.columns:
            if name in hub.interpreter.variables:
                hub.warn(
                    f"'{name}' is the column here, not the variable of the script",
                    mark=argument.piece(name).mark,
                    hint=f"another name for the variable, such as {name}_0, if you mean the "
                    "variable",
                )
        if not self.columns or len(self.columns) > self.MOST:
            many = "no column" if not self.columns else f"{len(self.columns)} columns"
            raise ScriptError(
                f"'{argument.text}' has {many} of dump particle",
                mark=argument.mark,
                expected=f"1 to {self.MOST} of {', '.join(columns)}",
            )

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> "ColumnFormula":
        return cls(hub, argument)

    def of(self, points: PointTable) -> np.ndarray:
        columns = {name: points.particle(name) for name in self.columns}
        return self.formula.evaluate_columns(self.hub.values, columns)

    def holds(self, points: PointTable) -> np.ndarray:
        return self.of(points) != 0


class ShownColumn(ColumnFormula):
    """Script argument: a column of dump particle, or a formula of columns."""

    script_kind = "a column of dump particle, or a formula of columns, such as sqrt(vx^2 + vy^2)"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        word = argument.word()
        return word if word is not None and word.isidentifier() else cls(hub, argument)


def check_columns(columns: Sequence[str], names: Sequence[str], *, first: int) -> None:
    for index, name in enumerate(columns):
        if name not in names:
            raise unknown_column(f"unknown column '{name}'", name, names, argument=first + index)


def unknown_column(message: str, name: str, names: Iterable[str], **where: Any) -> ScriptError:
    names = list(names)
    error = unknown(message, name, names, code="unknown-column", **where)
    error.expected = one_of(name, names, page="docs/reference/columns.md")
    others = table()["columns"].items()
    quantity = next((columns for columns, words in others if name.lower() in words), "")
    if meant := [column for column in quantity.split() if column in names]:
        error.hint, error.alike = f"did you mean {', '.join(meant)}?", meant[0]
    component = re.fullmatch(r"(s|sigma|stress|e|eps|strain)_?([xyz123])([xyz123])", name.lower())
    if component is not None:
        i, j = sorted("xyz".find(axis) + 1 or int(axis) for axis in component.groups()[1:])
        tensor = "e" if component[1] in ("e", "eps", "strain") else "s"
        error.alike = f"{tensor}{i}{j}"
        error.hint = f"did you mean '{error.alike}'?"
    if re.fullmatch("displacements?(_?[xyz123])?|(u|disp)(_?[xyz123])?", name.lower()):
        if "ux" not in names:
            error.alike = None
            error.hint = "fix(u, displacement, all), before it, gives the columns ux, uy, uz"
        else:
            last = name[-1].translate(str.maketrans("123", "xyz"))
            error.alike = f"u{last}" if last in "xyz" else "ux"
            error.hint = f"did you mean '{error.alike}'?"
    if error.alike == name:
        error.alike, error.hint = None, f"dump particle writes {name}, a column of points"
    if name in ("pore_pressure", "saturation"):
        error.hint = "only points of a material with pore_water(...) have this column"
    if name[:2] in ("v_", "c_"):  # as in LAMMPS
        error.hint = f"log_modify(custom, step, time, {name[2:]}) writes one number"
    return error
