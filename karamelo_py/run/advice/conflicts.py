"""Fixes that give the same points several velocities: which of them decides is told beforehand."""

from collections.abc import Iterator
from itertools import combinations, product
from typing import Any

import numpy as np

from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.fixes.formulas import AXES
from karamelo_py.styles.fixes.initial_velocity_particles import InitialVelocityParticles
from karamelo_py.styles.fixes.velocity_nodes import VelocityNodes
from karamelo_py.styles.fixes.velocity_particles import VelocityParticles

SAMPLE = 1000  # points at which formulas are compared, about
ALIKE = 1e-6  # of a velocity, or of the speed of waves: less is no other velocity
HINT = "groups that have no points in common, or NULL for one of the components"
AWAY = "nodes that these points do not see, or NULL for one of the components"


def warn_about_velocities(hub: Hub, simulation: Simulation) -> None:
    """Say so, once for each two fixes, where one of them has no effect on points of the other."""
    for other, fix, words in _conflicts(hub, simulation):
        name = f"velocities of '{other.id}' and '{fix.id}'"
        if name not in hub.update.foreseen:
            hub.update.foreseen.append(name)
            hub.warn(
                f"fix '{other.id}' (line {other.place.line}) gives {words}",
                place=fix.place,
                hint=AWAY if isinstance(other, VelocityNodes) else HINT,
            )


def _conflicts(hub: Hub, simulation: Simulation) -> Iterator[tuple[Any, Any, str]]:
    """The fix that gives way, the one that decides, and what to say of them."""
    fixes = list(hub.fixes.values())
    driven = [fix for fix in fixes if isinstance(fix, VelocityParticles)]
    first = [fix for fix in simulation.beginning if isinstance(fix, InitialVelocityParticles)]
    held = [fix for fix in fixes if isinstance(fix, VelocityNodes) and not fix.bound]
    for other, fix in combinations(driven, 2):
        names, shared = _names(_unlike(other, fix)), _shared(simulation, other, fix)
        if names and len(shared):
            yield other, fix, f"{_count(shared)} of this group another {names}: this fix decides"
    # What begins with one velocity for all and has another for some is meant so.
    for other, fix in (*combinations(first, 2), *product(first, driven)):
        axes, shared = _unlike(other, fix), _shared(simulation, other, fix)
        if not (axes and 0 < len(shared) == len(simulation.members(other.group))):
            continue
        names = _names([k for k in axes if _differ(simulation, other, fix, k, shared)])
        if names:
            yield other, fix, f"{_count(shared)} of this group another {names}: this fix decides"
    for other, fix in product(held, driven):
        names = _names(_unlike(other, fix))
        caught = _within(hub, simulation, other, fix) if names else ()
        # A tool that passes by a wall is none.
        if 2 * len(caught) > len(simulation.members(fix.group)):
            yield (
                other,
                fix,
                f"all nodes around {_count(caught)} of this group another {names}: this fix "
                "decides how they move, that one how they deform",
            )


def _unlike(other: Any, fix: Any) -> list[int]:
    """The directions in which both have a velocity, by other formulas."""
    pairs = enumerate(zip(other.formulas, fix.formulas, strict=False))
    return [k for k, (a, b) in pairs if None not in (a, b) and not a.is_like(b)]


def _names(axes: list[int]) -> str:
    return " and ".join(f"v{AXES[k]}" for k in axes)


def _count(ids: np.ndarray) -> str:
    return f"{len(ids)} point{'s' if len(ids) > 1 else ''}"


def _shared(simulation: Simulation, other: Any, fix: Any) -> np.ndarray:
    """Ids of the points that both act on."""
    mine = np.zeros(simulation.count, np.bool_)
    mine[simulation.members(fix.group)] = True
    ids = simulation.members(other.group)
    return ids[mine[ids]]


def _differ(simulation: Simulation, other: Any, fix: Any, axis: int, ids: np.ndarray) -> bool:
    """Whether two fixes give some of the points other velocities now."""
    ids = ids[:: max(1, len(ids) // SAMPLE)]
    x, x0 = simulation.x[ids], simulation.x0_of(ids)
    values = simulation.hub.values
    a, b = (one.formulas[axis].evaluate_points(values, x, x0) for one in (other, fix))
    small = ALIKE * max(np.abs(a).max(), np.abs(b).max(), float(simulation.control.clock[0].rate))
    return bool((np.abs(a - b) > small).any())


def _within(hub: Hub, simulation: Simulation, held: Any, driven: Any) -> np.ndarray:
    """Ids of the driven points in cells all of whose corners are held."""
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
