"""The balance of energy of a run: whether it is watched, has grown, and what is lost."""

from typing import Any

from karamelo_py.kernels.hooks import HEAT_STAGES, CompiledHook
from karamelo_py.kernels.watch import BORNE, FEW, WITHIN, growth, keeps, unit_of
from karamelo_py.points.laws import can, constrained_velocity
from karamelo_py.points.laws.temperatures import initial_heat
from karamelo_py.run.lower.build import warms_by_friction
from karamelo_py.scene.hub import Hub

TOLD = 2  # consecutive windows of growth, after which a run warns


def unknown_work(hub: Hub) -> str:
    """Name the source of work that is not tracked; empty if energy can be watched.

    The loops sum the work of compiled hooks on nodes and points. Fixes in Python declare by
    `Fix.conserves` that they do no other work.
    """
    method, implicit = hub.update.method, hub.update.scheme.traits.implicit
    apart = method.own_grids or (implicit and method.fields_per_solid)
    for fix in hub.fixes.values():
        acts = any(not isinstance(hook, CompiledHook) for hook in fix.hooks().values())
        if acts and not fix.first_step_only and not fix.conserves:
            return f"fix {fix.style} '{fix.id}'"
    for solid in hub.solids.values():
        if can(solid.material.law, constrained_velocity) and apart:
            return f"rigid solid '{solid.id}'"
        if hub.update.thermal and can(solid.material.law, initial_heat):
            return "heat"
    return ""


def unknown_heat(hub: Hub) -> bool:
    """Return True if a fix in Python may supply heat, or friction does."""
    return warms_by_friction(hub) or any(
        name in HEAT_STAGES and not isinstance(hook, CompiledHook)
        for fix in hub.fixes.values()
        for name, hook in fix.hooks().items()
    )


def has_grown(simulation: Any) -> bool:
    """Judge, by looks at it, that energy shows a spurious gain."""
    clock = simulation.control.clock[0]
    return bool(clock.watch_energy and (clock.windows >= TOLD or clock.grown > WITHIN))


def share_lost(simulation: Any) -> float:
    """Fraction of the largest energy so far lost since the first step; negative: a gain."""
    clock = simulation.control.clock[0]
    mean = (clock.balance + clock.last_balance + clock.last_but_one) / FEW
    return -growth(clock.first_balance, mean, max(clock.largest_energy, clock.energy_floor))


def grown_little(simulation: Any) -> bool:
    """Return True if the present state is good, judged by its energy and its last step."""
    clock = simulation.control.clock[0]
    swings = clock.watch_heat and clock.last_dt > BORNE * clock.heat_limit
    if swings or has_grown(simulation):
        return False
    if not clock.watch_energy:
        return True
    # The last look, too: noise that grows by half in a hundred steps is already in the state.
    before = clock.first_mean if clock.looks >= FEW else clock.first_balance
    return bool(keeps(before, clock.balance, unit_of(clock)))


def growth_since(simulation: Any, before: float) -> float:
    """Return the energy growth relative to `before`; NaN if energy is not watched."""
    unit = max(abs(before), float(simulation.control.clock[0].energy_floor), 1e-300)
    return growth(before, simulation.energy(), unit)


def change_of_energy(simulation: Any) -> float | None:
    """Return the energy change since the first step, in % of the largest; None if unknown."""
    clock = simulation.control.clock[0]
    if not clock.watch_energy or clock.looks <= FEW:
        return None
    # Since the first balance, not `first_few`, which `forget_growth` changes.
    return -100 * share_lost(simulation)


def forget_growth(simulation: Any) -> None:
    """Measure growth from the present state: a warning has been given."""
    clock = simulation.control.clock[0]
    clock.first_few = clock.first_mean = clock.largest_mean
    clock.windows, clock.grown = 0, 0.0
