"""Suggestions of `check`: needless costs, and what to write instead."""

from collections.abc import Callable, Iterator
from math import inf
from typing import Any

import numpy as np

from karamelo_py.advice.basics import is_zero
from karamelo_py.advice.facts import SceneFacts
from karamelo_py.language.rules import Advice
from karamelo_py.output.rhythm import ByTime
from karamelo_py.points.kinematics import free_from
from karamelo_py.points.laws import parameter
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import plural

Words = Iterator[tuple[str, str]]

AXES = "xyz"
NEARLY_INCOMPRESSIBLE = 0.4  # Poisson's ratio above which a linear basis locks
LARGE = 100_000  # points that no longer fit in caches
RESOLVED = 1000  # least motion per step over the spacing of single-precision numbers
# Core seconds (Intel Xeon): a point per step (linear), log line, picture, first picture, file of
# points, number in it.
POINT, LINE, PICTURE, DRAWING, FILE, NUMBER = 1e-7, 5e-4, 0.02, 0.5, 3e-4, 3e-7
WORTHWHILE = 10.0  # seconds of output worth a suggestion


def seconds_of_step(hub: Hub, count: int) -> float:
    return POINT * count + sum(fix.seconds() for fix in hub.fixes.values())


def suggestions(hub: Hub, simulation: Simulation) -> list[Advice]:
    rules = _unread, _of_parts, _averaging, _flat, _round, _mirrored, _precision, _output
    return [Advice("", *words) for rule in rules for words in rule(hub, simulation)]


def _of_parts(hub: Hub, simulation: Simulation) -> Words:
    advice = SceneFacts(hub, simulation, inf).advice("suggestion")
    return ((each.reason, each.cure) for each in advice)


def _unread(hub: Hub, simulation: Simulation) -> Words:
    for catalogue in (hub.computes, hub.fixes):
        for ID, item in catalogue.items():
            measures = catalogue is hub.computes or not (item.hooks() or item.for_method)
            names = [f"{ID}_{suffix}" if suffix else ID for suffix in item.published]
            if measures and "(" not in ID and names and hub.asked.isdisjoint(names):
                yield (
                    f"{catalogue.kind} {ID} ({item.style}) is measured at each output and shown "
                    "nowhere",
                    f"leave it out, or name {names[0]} in log_modify",
                )


def _averaging(hub: Hub, simulation: Simulation) -> Words:
    if not hub.update.anti_locking:
        return
    for solid in hub.solids.values():
        law = solid.material.whole
        moduli = (parameter(law, "lam", None), parameter(law, "G", None))
        if None in moduli or moduli[0] / (2 * sum(moduli)) >= NEARLY_INCOMPRESSIBLE:
            return
    yield (
        "anti_volumetric_locking(true): a visit of the points more, and nothing is nearly "
        "incompressible or flows",
        "leave it out",
    )


def _acting(hub: Hub) -> list[Fix]:
    return [fix for fix in hub.fixes.values() if fix.hooks() or fix.for_method]


def _given(fix: Fix) -> tuple:
    """NaN without formulas: it may do anything."""
    return tuple(fix.formulas) or (np.nan,) * 3


def _depends(formula: Any, axes: str) -> bool:
    if formula is None:
        return False
    if not hasattr(formula, "names"):
        return True
    return any(name in formula.names for axis in axes for name in (axis, axis + "0"))


def _alike(hub: Hub, fix: Fix, key: Callable[[np.ndarray], np.ndarray]) -> bool:
    """A group has all or no points (nodes) of equal `key`."""
    group = fix.group
    if group is None or group.all:
        return group is not None
    if isinstance(group, NodeGroup):
        groups = [(lattice.first, lattice.positions()) for lattice in hub.lattices]
        members = fix.nodes
    else:
        groups = [(solid.first_id, solid.x0) for solid in hub.solids.values() if solid.count]
        members = group.members
    for first, x in groups:
        keys = np.rint(key(x) * (1e6 / hub.domain.h)).astype(np.int64)
        _, cell = np.unique(keys, axis=0, return_inverse=True)
        selected = np.bincount(cell, np.isin(first + np.arange(len(x)), members))
        if ((selected > 0) & (selected < np.bincount(cell))).any():
            return False
    return True


def _flat(hub: Hub, simulation: Simulation) -> Words:
    domain = hub.domain
    d = domain.dimension
    if d == 1 or len(hub.lattices) > 1:
        return
    round_ = domain.kin.hoops > 0
    whole = "thickness" if d == 3 else "length" if round_ else "cross-section"
    for k in range(free_from(domain.kin), d):
        rest = [axis for axis in range(d) if axis != k]
        layers = _layers(hub, k, rest) if _moves_nothing(hub, k, rest) else 0
        # A radial scene costs as much per point: two layers are no waste.
        if layers > (2 if round_ else 0) and _acts_alike(hub, rest):
            ends = [f"{domain.lo[axis]:g}, {domain.hi[axis]:g}" for axis in rest]
            axes = " and ".join(AXES[axis] for axis in rest)
            renamed = "" if k == d - 1 else f", with {axes} called {' and '.join(AXES[: d - 1])}"
            yield (
                f"all solids are the same along {AXES[k]}, in which nothing moves: {layers} times "
                f"the points of {'plane strain' if d == 3 else 'a line'}, which has the forces and "
                f"energies of a {whole} of 1",
                f"dimension({d - 1}, {', '.join(ends)}, {domain.h:g}){renamed}"
                + (", and cylindrical(true)" if round_ else ""),
            )
            return


def _moves_nothing(hub: Hub, k: int, rest: list[int]) -> bool:
    for fix in _acting(hub):
        formulas = _given(fix)
        if len(formulas) <= len(rest) or not is_zero(formulas[k]):
            return False
        if any(_depends(act, AXES[k]) for act in (*(formulas[j] for j in rest), fix.wall_friction)):
            return False
    return True


def _acts_alike(hub: Hub, rest: list[int]) -> bool:
    for fix in _acting(hub):
        smooth_wall = fix.wall_friction is None and all(_given(fix)[j] is None for j in rest)
        if not smooth_wall and not _alike(hub, fix, lambda x: x[:, rest]):
            return False
    return True


def _layers(hub: Hub, k: int, rest: list[int]) -> int:
    """Equal layers across k between held faces; 0 if unequal."""
    most, ends = 0, set()
    for solid in hub.solids.values():
        if not solid.count:
            continue
        cells = np.rint(solid.x0 * (1e6 / solid.h)).astype(np.int64)
        across, counts = np.unique(cells[:, k], return_counts=True)
        columns = np.unique(cells[:, rest], axis=0)
        if len(set(counts)) > 1 or len(columns) * len(across) != len(cells):
            return 0
        most = max(most, len(across))
        first, last = solid.x0[:, k].min(), solid.x0[:, k].max()
        apart = len(across) - 1
        half = (last - first) / apart / 2 if apart else solid.h / (solid.ppc or 1) / 2
        ends.add((round((first - half) / solid.h, 6), round((last + half) / solid.h, 6)))
    return most if len(ends) == 1 and _faces_held(hub, k, *ends.pop()) else 0


def _faces_held(hub: Hub, k: int, low: float, high: float) -> bool:
    """Nodes of the planes `low` and `high` (in cells) are fixed along k."""
    lattice = hub.lattices[0]
    fixed = np.zeros(lattice.shape, np.bool_)
    for fix in hub.fixes.values():
        if fix.prescribes_velocity and len(fix.formulas) > k and fix.formulas[k] is not None:
            fixed.ravel()[fix.nodes - lattice.first] = is_zero(fix.formulas[k])
    if fixed.all():
        return True
    planes = [(end * lattice.h - lattice.lo[k]) / lattice.spacing for end in (low, high)]
    if any(abs(plane - round(plane)) > 1e-4 for plane in planes):
        return False
    numbers = [round(plane) for plane in planes]
    inside = all(0 <= number < lattice.shape[k] for number in numbers)
    return inside and bool(fixed.take(numbers, axis=k).all())


def _round(hub: Hub, simulation: Simulation) -> Words:
    if hub.domain.dimension != 3:
        return
    regions = [solid.region for solid in hub.solids.values() if solid.region is not None]
    axes = {region.axis for region in regions}
    if len(axes) != 1 or None in axes or len(regions) < len(hub.solids):
        return
    along, middle = axes.pop()
    across = [axis for axis in range(3) if axis != along]
    centre = np.zeros(3)
    centre[across] = middle

    def turned(x: np.ndarray) -> np.ndarray:
        r = np.linalg.norm((x - centre)[:, across], axis=1)
        return np.stack([r, x[:, along]], axis=1)

    for fix in _acting(hub):
        act = _given(fix)
        if len(act) < 3 or not all(is_zero(act[axis]) for axis in across):
            return
        if _depends(act[along], "".join(AXES[axis] for axis in across)):
            return
        if not _alike(hub, fix, turned):
            return
    radius = max(region.radius for region in regions)
    lo, hi = hub.domain.lo[along], hub.domain.hi[along]
    h = hub.domain.h
    yield (
        "cylinders about one axis, and nothing acts around it: about "
        f"{np.pi * radius / h:.3g} times the points of the plane of radius and axis",
        f"dimension(2, 0, {max(hub.domain.hi[axis] for axis in across):g}, {lo:g}, {hi:g}, {h:g}) "
        "and axisymmetric(true), y along the axis, and the nodes at x = 0 held in x",
    )


def _mirrored(hub: Hub, simulation: Simulation) -> Words:
    domain, solids = hub.domain, [solid for solid in hub.solids.values() if solid.count]
    if len(hub.lattices) > 1 or not _acting(hub):
        return
    if not all(solid.region for solid in solids):
        return  # they may have velocities
    for k in range(free_from(domain.kin), domain.dimension):
        ends = [(solid.x0[:, k].min(), solid.x0[:, k].max()) for solid in solids]
        middle = (min(low for low, _ in ends) + max(high for _, high in ends)) / 2
        cells = (middle - domain.lo[k]) / domain.h
        rest = [axis for axis in range(domain.dimension) if axis != k]
        if abs(cells - round(cells)) > 1e-6 or not all(_given_alike(hub, k, rest)):
            continue

        def sides(x: np.ndarray, k: int = k, middle: float = middle) -> np.ndarray:
            folded = x.copy()
            folded[:, k] = np.abs(x[:, k] - middle)
            return folded

        if all(_both_sides(solid, sides) for solid in solids) and all(
            _alike(hub, fix, sides) for fix in _acting(hub)
        ):
            yield (
                f"the scene is the same on both sides of {AXES[k]} = {middle:g}: twice the points "
                "(unless it is to buckle or to break unevenly); energies are halved, and bases "
                "wider than linear change results by some per cent on coarse grids",
                f"half of it, and the nodes at {AXES[k]} = {middle:g} held in {AXES[k]}",
            )
            return


def _given_alike(hub: Hub, k: int, rest: list[int]) -> Iterator[bool]:
    """For each fix, whether it neither acts along k nor depends on it."""
    for fix in _acting(hub):
        formulas = _given(fix)
        rest_formulas = [formulas[j] for j in rest if j < len(formulas)]
        yield (len(formulas) <= k or is_zero(formulas[k])) and not any(
            _depends(act, AXES[k]) for act in (*rest_formulas, fix.wall_friction)
        )


def _both_sides(solid: Solid, sides: Callable[[np.ndarray], np.ndarray]) -> bool:
    cells = np.rint(sides(solid.x0) * (1e6 / solid.h)).astype(np.int64)
    return bool((np.unique(cells, axis=0, return_counts=True)[1] == 2).all())


def _precision(hub: Hub, simulation: Simulation) -> Words:
    if (
        sum(solid.count for solid in hub.solids.values()) < LARGE
        or hub.settings.precision != "double"
        or simulation.implicit
    ):
        return
    x = max(float(np.abs(solid.x0).max()) for solid in hub.solids.values() if solid.count)
    if simulation.fastest() * simulation.dt > RESOLVED * np.spacing(np.float32(x)):
        yield (
            "double precision: points in single precision take 0.6 of the memory; errors of scenes "
            "with an exact solution change by less than a twentieth or 2e-4",
            "precision(single)",
        )


def _output(hub: Hub, simulation: Simulation) -> Words:
    span = simulation.control.step[0].end_time - hub.update.time
    steps = span / simulation.dt
    if not np.isfinite(steps):
        return
    count = sum(solid.count for solid in hub.solids.values())

    def times(item: Any) -> float:
        every = item.every
        return span / every.span if isinstance(every, ByTime) else steps / every

    drawn = [dump for dump in hub.dumps.values() if dump.style == "pyplot"]
    files = [dump for dump in hub.dumps.values() if dump not in drawn]
    pictures = sum(map(times, drawn)) + (hub.output.plots.file is not None)
    output = LINE * times(hub.output.log) + PICTURE * pictures + DRAWING * (pictures > 0)
    output += sum(times(dump) * (FILE + NUMBER * count * len(dump.columns)) for dump in files)
    stepping = steps * seconds_of_step(hub, count)
    if output > max(WORTHWHILE, stepping):
        lines, tables = round(times(hub.output.log)), round(sum(map(times, files)))
        yield (
            f"output takes some {output:.1g} s of a core, and the steps {stepping:.1g} s: "
            f"{plural(lines, 'line')} of the log, {plural(tables, 'table')} of points, "
            f"{plural(round(pictures), 'picture')}",
            "less often, or none of it where a study runs the scene many times (errors over the "
            "history are those at outputs)",
        )
