"""Fixes that give the same points several velocities: which of them decides is told beforehand."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from karamelo_py.language.rules import known_failure
from karamelo_py.styles.fixes.formulas import AXES

SAMPLE = 1000  # points at which formulas are compared, about
ALIKE = 1e-6  # of a velocity, or of the speed of waves: less is no other velocity
HELD = " how they move, that one how they deform"

_styles: list[type] = []


def register(style: type) -> None:
    """Let a fix that gives points velocities tell which others it overrules."""
    _styles.append(style)
    known_failure(
        style,
        "velocities of '{other.id}' and '{part.id}'",
        when=lambda fix, scene: list(_conflicts(fix, scene.simulation)),
        reason="fix '{other.id}' (line {other.place.line}) gives {points} of this group another "
        "{axes}: this fix decides{more}",
        cure="{apart}, or NULL for one of the components",
    )


def _conflicts(fix: Any, simulation: Any) -> Iterator[dict[str, Any]]:
    """Find the fixes that give way to this one, with what to say of them."""
    fixes = list(simulation.hub.fixes.values())
    first = [one for one in simulation.beginning if isinstance(one, tuple(_styles))]
    if not (fix.leads_points or fix in first):
        return
    led = [one for one in fixes[: fixes.index(fix)] if one.leads_points]
    for other in led if fix.leads_points else ():
        axes, shared = _unlike(other, fix), _shared(simulation, other, fix)
        if axes and len(shared):
            yield _said(other, axes, shared)
    # What begins with one velocity for all and has another for some is meant so.
    for other in first[: first.index(fix)] if fix in first else first:
        axes, shared = _unlike(other, fix), _shared(simulation, other, fix)
        if axes and 0 < len(shared) == len(simulation.members(other.group)):
            axes = [k for k in axes if _differ(simulation, other, fix, k, shared)]
            if axes:
                yield _said(other, axes, shared)
    for other in fixes if fix.leads_points else ():
        axes = _unlike(other, fix) if other.prescribes_velocity else []
        caught = _within(simulation, other, fix) if axes else ()
        # A tool that passes by a wall is none.
        if 2 * len(caught) > len(simulation.members(fix.group)):
            yield _said(other, axes, caught)


def _said(other: Any, axes: list[int], ids: np.ndarray) -> dict[str, Any]:
    """The words on a fix that gives way in these directions, for points with these ids."""
    held = other.prescribes_velocity
    return {
        "other": other,
        "points": f"{'all nodes around ' * held}{len(ids)} point{'s' * (len(ids) > 1)}",
        "axes": " and ".join(f"v{AXES[k]}" for k in axes),
        "more": HELD * held,
        "apart": "nodes that these points do not see"
        if held
        else "groups that have no points in common",
    }


def _unlike(other: Any, fix: Any) -> list[int]:
    """The directions in which both have a velocity, by other formulas."""
    pairs = enumerate(zip(other.formulas, fix.formulas, strict=False))
    return [k for k, (a, b) in pairs if None not in (a, b) and not a.is_like(b)]


def _shared(simulation: Any, other: Any, fix: Any) -> np.ndarray:
    """Ids of the points that both act on."""
    mine = np.zeros(simulation.count, np.bool_)
    mine[simulation.members(fix.group)] = True
    ids = simulation.members(other.group)
    return ids[mine[ids]]


def _differ(simulation: Any, other: Any, fix: Any, axis: int, ids: np.ndarray) -> bool:
    """Tell whether two fixes give some of the points other velocities now."""
    ids = ids[:: max(1, len(ids) // SAMPLE)]
    x, x0 = simulation.x[ids], simulation.x0_of(ids)
    values = simulation.hub.values
    a, b = (one.formulas[axis].evaluate_points(values, x, x0) for one in (other, fix))
    small = ALIKE * max(np.abs(a).max(), np.abs(b).max(), float(simulation.control.clock[0].rate))
    return bool((np.abs(a - b) > small).any())


def _within(simulation: Any, held: Any, driven: Any) -> np.ndarray:
    """Ids of the driven points in cells all of whose corners are held."""
    hub = simulation.hub
    method, d = hub.update.method, hub.domain.dimension
    still = np.zeros(held.group.total(), np.bool_)
    still[held.nodes] = True
    ids = simulation.members(driven.group)
    x = simulation.x[ids] if method.frame.moves else simulation.x0_of(ids)
    caught = np.zeros(len(ids), np.bool_)
    for solid in hub.solids.values():
        lattice = hub.lattices[method.lattice_of(hub, solid)]
        own = np.flatnonzero(hub.fields.solid[ids] == solid.index)
        per_cell = lattice.nodes_per_cell
        cell = np.floor((x[own] - lattice.lo[:d]) / lattice.h).astype(np.int64)
        cell = np.clip(cell, 0, np.array(lattice.cells[:d]) - 1) * per_cell
        corners = [
            lattice.first + np.ravel_multi_index(tuple((cell + corner).T), lattice.shape[:d])
            for corner in product((0, per_cell), repeat=d)
        ]
        caught[own] = still[np.array(corners)].all(axis=0)
    return ids[caught]
