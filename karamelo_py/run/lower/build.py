"""Lowering: the smallest set of arrays and tags that can run a scene.

Fields exist if the method, laws or fixes need them; `karamelo-py check` lists them.
"""

import copy
import os
from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.compiler.tuples import flat
from karamelo_py.kernels import arrays
from karamelo_py.kernels.equations.fbar import NodalMean
from karamelo_py.kernels.equations.loss import EnergyLoss, FrictionalHeat
from karamelo_py.kernels.free_bodies import NoBodies
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.laws import law_in, law_on, law_table
from karamelo_py.kernels.table import Insulated, NoAdditions
from karamelo_py.kernels.twist import rotating
from karamelo_py.language import registry
from karamelo_py.language.rules import Feature, Restrictions, compare
from karamelo_py.language.scene import Scene
from karamelo_py.output.point_table import owners_of_fields
from karamelo_py.points import laws
from karamelo_py.points.basis import carried, deformed, walled
from karamelo_py.points.grid import ReflectingGrid
from karamelo_py.points.kinematics import Line
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.points.laws.eos import taken_heat
from karamelo_py.points.laws.further import with_rate, without_rate
from karamelo_py.points.laws.placed import with_directions
from karamelo_py.points.laws.temperatures import initial_heat
from karamelo_py.points.laws.viscosity import diffuses_energy
from karamelo_py.points.transfers import flip_coefficient, lost_fractions, stores_moment
from karamelo_py.run import periodic
from karamelo_py.run.boxes import no_nodes
from karamelo_py.run.implicit import check as implicit
from karamelo_py.run.lower import solved_pressure
from karamelo_py.run.lower.bodies import lower_bodies
from karamelo_py.run.lower.walls import with_walls
from karamelo_py.run.mpi.partition import SharedTiles
from karamelo_py.run.stable_step import sparse
from karamelo_py.run.step_size import Carried, set_up
from karamelo_py.run.tiles import Tiles
from karamelo_py.scene import boundary
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.domain import THIN, TWIST
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import table
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import Mark, ScriptError, render_message
from karamelo_py.styles.methods.base import CORRECTED

PRECISIONS = {"double": np.float64, "single": np.float32}
SERIAL_UP_TO = 20_000  # points up to which threads cost more time than they save


class State(NamedTuple):
    """State of all points after a run, ordered by id; arrays (components, N)."""

    count: int  # type: ignore[assignment]  # number of points, N
    present: np.ndarray  # (N,) bool, False for deleted points
    places: np.ndarray
    v: np.ndarray
    laws: dict[tuple, np.ndarray]
    fields: dict[type | str, np.ndarray]  # by family or class
    grids: NamedTuple
    node_fields: dict[type, np.ndarray]  # (nodes of `grids`, components)
    contact: NamedTuple
    clock: Carried


def check_scene(hub: Hub) -> None:
    missing = (
        (hub.domain, "no domain is defined", "dimension(2, xmin, xmax, ymin, ymax, h)"),
        (hub.update.method, "no method is defined", "method(ulmpm, FLIP, linear, 0.99)"),
        (hub.solids or None, "there is no solid to move",
         "solid(ID, region, regionID, points per cell, material, h, T0)"),
    )  # fmt: skip
    for item, message, command in missing:
        if item is None:
            raise ScriptError(message, hint=f"put {command} before run")
    method = hub.update.method
    try:
        method.check(hub)
        materials = [solid.material.law for solid in hub.solids.values()]
        warm = any(laws.can(law, initial_heat) or diffuses_energy(law) for law in materials)
        if hub.update.thermal and not warm:
            raise ScriptError(
                "the method is thermo-mechanical, and no solid has a temperature",
                hint="give a material one: material(ID, linear, rho, E, nu, cp, kappa), or "
                "temperature(...) with eos-strength",
            )
        if hub.update.thermal:
            _refuse_other_heat(hub)
    except ScriptError as error:
        if error.mark is None:
            error.mark, error.command = method.mark, "method"
        raise
    _check_restrictions(hub)
    if hub.update.scheme.traits.implicit:
        implicit.check(hub)
    if hub.update.scheme.traits.solves_pressure:
        solved_pressure.check(hub)
    basis = type(method.basis)
    if not method.frame.moves or not (deformed.defined(basis) or carried.defined(basis)):
        return
    for solid in hub.solids.values():
        if solid.rigid:
            raise ScriptError(
                f"solid '{solid.id}' is rigid, and the domains of its points would deform",
                mark=solid.mark,
                hint="a basis without domains that deform: linear, a spline, or ugimp",
            )


def _refuse_other_heat(hub: Hub) -> None:
    """Raise ScriptError for Qh next to solids with a temperature: nodes conduct only one."""
    solids = hub.solids.values()
    for solid in solids:
        warm = [one for one in solids if laws.can(one.material.law, initial_heat)]
        if warm and diffuses_energy(solid.material.law):
            raise ScriptError(
                f"Qh of material '{solid.material.id}' diffuses energy per mass, and solid "
                f"'{warm[0].id}' conducts heat by temperature: both would mix at nodes",
                mark=solid.mark,
                expected="no Qh, or no solid with a temperature",
            )


def features(hub: Hub) -> Iterator[Feature]:
    update, settings, method = hub.update, hub.settings, hub.update.method
    kin = method.kinematics(hub)
    mark, name = method.mark, registry.name_of("method", type(method))
    transfer = registry.name_of("transfer", type(update.transfer))
    scheme = registry.name_of("scheme", type(update.scheme))
    basis, marks = method.basis_name, dict.fromkeys(("method", "basis", "transfer"), mark)
    marks |= method.marks
    yield Feature("method", name, f"method {name}", mark=marks["method"])
    yield Feature("basis", basis, f"the basis {basis}", mark=marks["basis"])
    yield Feature("transfer", transfer, f"transfer {transfer}", mark=marks["transfer"])
    yield Feature("scheme", scheme, f"scheme {scheme}", mark=update.scheme_mark)
    if update.scheme.traits.implicit and update.scheme.traits.inertia:
        words = f"scheme {scheme}, which has no inertia of rotation around an axis"
        instead = "scheme(quasi-static) or scheme(musl)"
        yield Feature("newmark", "", words, instead, update.scheme_mark)
    yield Feature("kinematics", kin.word, f"{kin.word} scenes")
    if not method.frame.moves:
        yield Feature("grids of solids", "", f"method {name}", "method(ulmpm, ...)", mark)
    if carried(method.basis, kin) > 0:
        words = f"{type(method.basis).__name__} domains"
        yield Feature("corners", "", words, "another basis", mark)
    if update.transfer.traits.series:
        yield Feature("series", "", f"transfer {transfer}", "APIC or FLIP", mark)
    if update.thermal:
        yield Feature("heat", "", "heat conduction", "a mechanical method", mark)
    if any(solid.rigid for solid in hub.solids.values()):
        yield Feature("rigid", "", "a rigid solid", "a stiff solid")
    if update.anti_locking:
        yield Feature("F-bar", "", "anti_volumetric_locking", "anti_volumetric_locking(false)")
    if settings.precision != "double":
        yield Feature("single", "", f"precision({settings.precision})", "precision(double)")
    if settings.comm.size > 1:
        yield Feature("ranks", "", "--ranks", "--threads, which divides the points in one process")
    if settings.engine == "gpu":
        yield Feature("gpu", "", "--gpu", "processors, which run the same script: no --gpu")
    for fix in hub.fixes.values():
        if (fix.held_directions and not fix.prescribes_velocity) or fix.wall_friction is not None:
            words = f"fix {fix.style} with a bound or friction"
            yield Feature(
                "yielding walls", "", words, "velocities without geq, leq and mu", fix.mark
            )
        if (fix.solids and fix.friction is None) or fix.follows_points:
            words, instead = f"fix {fix.style}", f"no fix {fix.style}"
            yield Feature("tools", "", words, instead, fix.mark)
            if not all(map(fix.is_endless, hub.domain.periodic)):
                yield Feature("ending tools", "", words, instead, fix.mark)


def _restricted(hub: Hub) -> Iterator[tuple[Restrictions | None, str, Mark | None]]:
    update, box = hub.update, hub.domain
    if update.method.corrected:
        yield CORRECTED, "mass=corrected", update.method.mark
    if box.periodic:
        yield boundary.PERIODIC, "boundary(periodic)", None
    if box.shear:
        yield boundary.SHEARED, "boundary(periodic, shear=...)", None
    if update.boundary != "error":
        words = f"boundary({update.boundary})"
        yield boundary.RESTRICTIONS[update.boundary], words, update.boundary_mark
    if isinstance(box.kin, Twisted):
        yield TWIST, "twist=true", None
    if box.thin:
        yield THIN, "plane_stress" if box.dimension == 2 else "uniaxial_stress", None
    if box.across is not None:
        yield box.across.restrictions, "plane_strain(ezz=...)", box.across.mark
    for solid in hub.solids.values():
        if solid.material.fluid is not None:
            fluid = solid.material.fluid
            yield fluid.restrictions, fluid.words, solid.mark
    for fix in hub.fixes.values():
        yield fix.restrictions, f"fix {fix.style}", fix.mark
    for compute in hub.computes.values():
        yield compute.restrictions, f"compute {compute.style}", compute.mark
    for family, item, mark in (
        ("scheme", update.scheme, update.scheme_mark),
        ("transfer", update.transfer, update.method.mark),
    ):
        name = registry.name_of(family, type(item))
        yield item.traits.restrictions, f"{family} {name}", mark


def _check_restrictions(hub: Hub) -> None:
    declared = {
        Feature(restrictions.option, "", words, restrictions.instead, mark): restrictions
        for restrictions, words, mark in _restricted(hub)
        if restrictions is not None
    }
    if declared:
        compare(declared, features(hub))


def thread_count(hub: Hub, points: int) -> int:
    from numba import config

    available = int(config.NUMBA_NUM_THREADS)
    if hub.settings.threads is not None:
        if hub.settings.threads > available:
            said = f"--threads {hub.settings.threads}: only {available} threads are available here"
            hub.console.warn(render_message("warning", said))
        return max(1, min(hub.settings.threads, available))
    usable = min(available, os.cpu_count() or 1)
    comm = hub.settings.comm
    usable, points = max(1, usable // comm.beside), points // comm.size
    return usable if points > SERIAL_UP_TO else 1


def lower(
    hub: Hub, previous: State | None = None, *, ids: tuple[int, int] | None = None,
    comm: SerialComm | None = None,
) -> tuple[arrays.Setup, Tiles]:  # fmt: skip
    """Make the arrays of a run from the scene, with the `previous` state of existing points.

    With `ids` (first, end), the arrays contain these points only, and this process's tiles.
    """
    comm = comm or hub.settings.comm
    method = hub.update.method
    real = PRECISIONS[hub.settings.precision]
    kin = method.kinematics(hub)
    lattices = method.lattices(hub)
    transfer = hub.update.transfer_tag(real)
    basis = type(method.basis)(*(real(x) for x in method.basis))
    if fixes := fixes_of_walls(hub):
        basis = with_walls(fixes, lattices, basis)
    cut = lattices, basis, sum(solid.count for solid in hub.solids.values()), sparse(hub)
    if comm.size == 1:
        tiles = Tiles(*cut)
    else:
        tiles = SharedTiles(comm, *cut, one_space=method.fields_per_solid)
    contact = method.contact_between(hub, lattices)
    if previous is not None:
        method.resume(contact, previous.contact)
    firsts = [solid.first_id for solid in hub.solids.values()]
    control = arrays.new_control(hub.values.array, firsts, kin.dimension)
    set_up(control, hub, transfer, previous.clock if previous else None)
    tiles.unsort(control)
    grids = table(lattices, real)
    if hub.update.boundary == "reflect":
        grids = ReflectingGrid(*grids)
    count = sum(lattice.node_count for lattice in lattices)
    heat: Insulated | Conducting = Insulated()
    if hub.update.thermal:
        means = lower_nodes((NodalMean,), Line(), count, real)
        heat = Conducting(means, tiles.empty_buffers(means, len(hub.solids)))
    owners = owners_of_fields(hub, contact)
    of_nodes = [kind for kind in fields.declared(owners, "node_fields") if kind.needed(basis)]
    of_nodes += [EnergyLoss] * returns_loss(hub) + [FrictionalHeat] * warms_by_friction(hub)
    nodes = lower_nodes(of_nodes, kin, count, real)
    if previous is not None:
        resume_nodes(nodes, grids, previous)
    kinds = fields.declared(owners, "point_fields")
    blocks = (
        arrays.Block(*lower_points(hub, solids, kin, kinds, real), tiles.empty_tiling())
        for solids in solids_alike(hub, ids)
    )
    bodies = lower_bodies(hub, lattices) if fixes_of_bodies(hub) else NoBodies()
    fluids = (solid.material.fluid for solid in hub.solids.values())
    traits = hub.update.scheme.traits
    tag = "tag_of_solution" if traits.solves_pressure else "tag"
    tag = "tag_in_load_steps" if traits.implicit else tag
    additions = [getattr(fluid, tag) for fluid in fluids if fluid is not None]
    additions += [*rotating(kin, transfer), NoAdditions()]
    setup = arrays.Setup(
        frame=method.frame, kin=kin, basis=basis, transfer=transfer,
        averaging=method.averaging(hub), contact=contact, bodies=bodies,
        heat=heat, additions=additions[0], grids=grids, nodes=nodes,
        buffers=tiles.empty_buffers(nodes, len(hub.solids)),
        blocks=tuple(resumed(one, previous) if previous else one for one in blocks),
        **no_nodes(), control=control,
    )  # fmt: skip
    if hub.domain.periodic:
        seam = periodic.seam_of(setup, hub.domain)
        setup = setup._replace(control=setup.control._replace(ranks=seam))
    return setup, tiles


def fixes_of_bodies(hub: Hub) -> tuple:
    fixes = [f for f in hub.fixes.values() if f.of_bodies or f.prescribes_velocity]
    return tuple(fixes) if any(fix.of_bodies for fix in fixes) else ()


def solids_alike(hub: Hub, ids: tuple[int, int] | None) -> Iterable[list[Solid]]:
    alike: dict[tuple, list] = {}
    for solid in hub.solids.values():
        points = solid if ids is None else part_of(solid, *ids)
        alike.setdefault(laws.law_kind(solid.material.law), []).append(points)
    return alike.values()


def returns_loss(hub: Hub) -> bool:
    """Return True if the kinetic energy that the transfer dissipates heats the points.

    The loss of FLIP 1 without moments vanishes as the step goes to 0. For XPIC see
    `kernels.equations.loss.reflect`.
    """
    transfer = hub.update.transfer
    keeps_all = flip_coefficient(transfer) == 1 and not stores_moment(transfer)
    if not lost_fractions.defined(type(transfer)) or keeps_all:
        return False
    return any(laws.can(solid.material.law, taken_heat) for solid in hub.solids.values())


def fixes_of_walls(hub: Hub) -> list[Fix]:
    if not walled.defined(type(hub.update.method.basis)):
        return []
    return [fix for fix in hub.fixes.values() if fix.held_directions and not fix.group.all]


def warms_by_friction(hub: Hub) -> bool:
    on_grid = hub.update.method.fields_per_solid
    rubs = any(
        fix.wall_friction is not None or (on_grid and fix.friction) for fix in hub.fixes.values()
    )
    return rubs and any(laws.heat_capacity(s.material.law, 1.0) > 0 for s in hub.solids.values())


def lower_nodes(kinds: Iterable[type], kin: NamedTuple, count: int, real: type) -> arrays.Nodes:
    d = kin.dimension
    return arrays.Nodes(
        sums=fields.records(count, arrays.SUMS_WIDTH[d], real),
        update=fields.records(count, arrays.UPDATE_WIDTH[d], real),
        velocity=fields.records(count, arrays.VELOCITY_WIDTH[d], real),
        fields=tuple(fields.at_nodes(kind, kin, count, real) for kind in kinds),
    )


def resume_nodes(nodes: arrays.Nodes, grids: NamedTuple, previous: State) -> None:
    same = zip(grids, previous.grids, strict=True)
    if all(np.array_equal(now[: len(before)], before) for now, before in same):
        for one in nodes.fields:
            if (before := previous.node_fields.get(type(one))) is not None:
                one.array[: len(before)] = before


def part_of(solid: Solid, first: int, end: int) -> Solid:
    begin, end = (min(max(i - solid.first_id, 0), solid.count) for i in (first, end))
    other = copy.copy(solid)
    for name, value in vars(solid).items():
        if isinstance(value, np.ndarray) and len(value) == solid.count:
            setattr(other, name, value[begin:end])
    other.places = solid.places[begin:end]
    other.first_id += begin
    return other


def points_at_rest(hub: Hub, setup: arrays.Setup, ids: np.ndarray) -> list[arrays.Points]:
    """Return points `ids` (ascending) in their initial state, in blocks as in `setup`."""
    span = int(ids[0]), int(ids[-1]) + 1
    real = PRECISIONS[hub.settings.precision]
    kinds = fields.declared(owners_of_fields(hub, setup.contact), "point_fields")
    by_block = []
    for solids, block in zip(solids_alike(hub, span), setup.blocks, strict=True):
        points, _ = lower_points(hub, solids, setup.kin, kinds, real)
        rows = np.flatnonzero(np.isin(points.id, ids))
        by_block.append(arrays.some_of(block._replace(points=points), rows).points)
    return by_block


def point_kinds(hub: Hub) -> tuple[type, ...]:
    return fields.declared(owners_of_fields(hub), "point_fields")


def lower_points(
    hub: Scene, solids: list, kin: NamedTuple, kinds: tuple[type, ...], real: type
) -> tuple[arrays.Points, NamedTuple]:
    method = hub.update.method
    law_of_solids = [law_on(s.material.law, s.h, s.T0) for s in solids]
    if hub.fields.rate_is_asked_for():
        law_of_solids = [
            with_rate(law, kin, s.h) for law, s in zip(law_of_solids, solids, strict=True)
        ]
    laws_of_solids = list(dict.fromkeys(law_of_solids))
    used = law_table(laws_of_solids, real)
    ends = np.cumsum([s.count for s in solids])
    count = int(ends[-1])

    def joined(values: Iterable, dtype: type) -> np.ndarray:
        """Join values of solids (numbers, columns or per point) into an array (n,) or (k, n)."""
        array = np.empty(0)
        for s, end, value in zip(solids, ends, map(np.asarray, values), strict=True):
            if not array.size:
                array = fields.rows_of_points((*value.shape[:-1], count), dtype)
            array[..., end - s.count : end] = value
        return array

    def at_rest(solid: Solid, law: NamedTuple) -> np.ndarray:
        state = laws.initial_state(law, kin, real(1))
        if solid.T0 is not None:
            state = laws.with_temperature(law, kin, state, real(solid.T0))
        return with_directions(state, np.array(flat(state), real)[:, None], hub.values, solid)

    states = (at_rest(s, law_in(k, real)) for s, k in zip(solids, law_of_solids, strict=True))
    places = joined((method.places(kin, s, real).T for s in solids), real)
    here = places if method.frame.moves else places[: kin.dimension]
    x = fields.rows_of_points((2, *here.shape), real)
    x[:] = here
    stored = [kind for kind in kinds if kind.needed(used)]
    points = arrays.Points(
        x=x, home=None if method.frame.moves else places,
        v=joined((np.zeros((kin.dimension, 1)) for _ in solids), real),
        mass=joined((s.mass for s in solids), real), state=joined(states, real),
        material=joined((laws_of_solids.index(law) for law in law_of_solids), np.int32),
        grid=joined((method.lattice_of(hub, s) for s in solids), np.int32),
        id=joined((np.arange(s.first_id, s.first_id + s.count) for s in solids), np.int64),
        fields=tuple(fields.at_points(kind, kin, count, real) for kind in stored),
    )  # fmt: skip
    return points, used


def resumed(block: arrays.Block, previous: State) -> arrays.Block:
    points = block.points
    old = points.id < previous.count
    ids = points.id[old]

    def take(array: np.ndarray, before: np.ndarray | None) -> None:
        if before is not None:
            rows = min(array.shape[-2], len(before))
            array[..., :rows, old] = before[:rows, ids]

    take(points.x, previous.places)
    take(points.v, previous.v)
    take(points.state, previous.laws.get(without_rate(laws.law_kind(block.laws))))
    for one in points.fields:
        take(one.array, previous.fields.get(one.family or type(one)))
    present = np.ones(len(points.id), np.bool_)
    present[old] = previous.present[ids]
    return block if present.all() else arrays.some_of(block, np.flatnonzero(present))
