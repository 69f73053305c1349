"""The energy balance of a run: whether it is tracked, its growth, its losses."""

from __future__ import annotations

import numpy as np

from karamelo_py.kernels.hooks import HEAT_STAGES, CompiledHook
from karamelo_py.kernels.totals import agree_on_heat
from karamelo_py.kernels.watch import (
    BORNE,
    COARSE,
    FEW,
    LOOKS,
    ROUND_OFF,
    WITHIN,
    begin_to_look,
    growth,
    keeps,
    measure_heat,
    sum_energies,
    unit_of,
)
from karamelo_py.points.laws import can, constrained_velocity
from karamelo_py.points.laws.temperatures import initial_heat
from karamelo_py.run.lower.build import warms_by_friction
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub

TOLD = 2  # consecutive windows of growth before a warning


def unknown_work(hub: Hub) -> str:
    """Name the source of work that is not tracked; empty if there is none.

    Loops sum the work of compiled hooks. Python fixes declare by `Fix.conserves` that they do no
    other work.
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
    return warms_by_friction(hub) or any(
        name in HEAT_STAGES and not isinstance(hook, CompiledHook)
        for fix in hub.fixes.values()
        for name, hook in fix.hooks().items()
    )


class EnergyWatch:
    """Monitors the energy balance and the range of temperatures.

    Besides the kernels, only this class writes them to the clock.
    """

    def __init__(self, simulation: SceneState):
        self.simulation, self.clock = simulation, simulation.control.clock[0]
        self.followed = False  # the balance is up to date
        self.told_of_growth = False  # since tracking began
        self.told_of_loss = False

    def begin(self, *, set_anew: bool) -> None:
        """Begin, or continue unless fields were `set_anew` since the last step."""
        simulation, clock = self.simulation, self.clock
        update = simulation.hub.update
        clock.watch_energy = int(not unknown_work(simulation.hub) and simulation.moves)
        anew = not self.followed or set_anew
        self.followed = simulation.moves  # load steps are not in the balance
        if anew:
            self.told_of_growth = self.told_of_loss = False
        if clock.watch_energy:
            # Velocities are half a step old, stresses by the fraction strained before.
            self._begin_to_look(0.25 + 0.5 * update.scheme.traits.strained_before, anew)
        known = simulation.notes_temperatures and not unknown_heat(simulation.hub)
        clock.watch_heat = int(update.thermal and known)
        if clock.watch_heat and anew:
            measure_heat(simulation.setup)
            agree_on_heat(simulation.control.ranks, simulation.control)
            clock.coldest, clock.hottest = clock.T_low, clock.T_high

    def _begin_to_look(self, level: float, anew: bool) -> None:
        simulation, clock = self.simulation, self.clock
        points = simulation.points
        strain = COARSE * float(np.finfo(simulation.setup.nodes.sums.dtype).eps)
        clock.energy_floor = (
            max(ROUND_OFF, strain**2) * points.total("mass") * float(clock.rate) ** 2
        )
        clock.born_with = points.total("born with")
        if anew:
            clock.to_and_fro = 2 * self._length() / max(float(clock.wave or clock.rate), 1e-300)
        # Energies are summed by tile.
        if not simulation.in_tiles():
            simulation.sort()
            simulation.mapped = False
        begin_to_look(simulation.setup, simulation.mode, level, anew)

    def _length(self) -> float:
        simulation = self.simulation
        d = simulation.kin.dimension
        ends = np.full(2 * d, -np.inf)
        for block in simulation.setup.blocks:
            x = block.points.x[simulation.now][:d]
            extremes = [x.max(axis=1, initial=-np.inf), (-x).max(axis=1, initial=-np.inf)]
            ends = np.maximum(ends, np.concatenate(extremes))
        ends = simulation.comm.allreduce_max(ends)
        return float((ends[:d] + ends[d:]).max())

    def energy(self) -> float:
        """Sum kinetic, stored and dissipated energy minus work; NaN if not tracked."""
        simulation, clock = self.simulation, self.simulation.control.clock
        if not simulation.in_tiles() or not clock[0].watch_energy:
            return np.nan
        present = clock.copy()
        sum_energies(simulation.setup, simulation.mode)
        energy = float(clock[0].kinetic + clock[0].stored - clock[0].work)
        clock[:] = present
        return energy

    def has_grown(self) -> bool:
        clock = self.clock
        return bool(clock.watch_energy and (clock.windows >= TOLD or clock.grown > WITHIN))

    def has_lost(self, within: float) -> bool:
        clock = self.clock
        return bool(clock.watch_energy and clock.looks > LOOKS and self.share_lost() > within)

    def share_lost(self) -> float:
        """Fraction of the largest energy lost since the first step; negative: a gain."""
        clock = self.clock
        mean = (clock.balance + clock.last_balance + clock.last_but_one) / FEW
        return -growth(clock.first_balance, mean, max(clock.largest_energy, clock.energy_floor))

    def grown_little(self) -> bool:
        """Return True if energy and last step show no fault in the present state."""
        clock = self.clock
        swings = clock.watch_heat and clock.last_dt > BORNE * clock.heat_limit
        if swings or self.has_grown():
            return False
        if not clock.watch_energy:
            return True
        # Include the last window: noise that grows by half in 100 steps is in the state.
        before = clock.first_mean if clock.looks >= FEW else clock.first_balance
        return bool(keeps(before, clock.balance, unit_of(clock)))

    def growth_since(self, before: float) -> float:
        """Return energy growth relative to `before`; NaN if not tracked."""
        unit = max(abs(before), float(self.clock.energy_floor), 1e-300)
        return growth(before, self.energy(), unit)

    def change(self) -> float | None:
        if not self.clock.watch_energy or self.clock.looks <= FEW:
            return None
        # From the first balance, not `first_few`, which `forget_growth` changes.
        return -100 * self.share_lost()

    def forget_growth(self) -> None:
        """Measure growth from the present state, after a warning."""
        clock = self.clock
        clock.first_few = clock.first_mean = clock.largest_mean
        clock.windows, clock.grown = 0, 0.0

    def without(self, stored: float) -> None:
        self.clock.stored_before -= stored
        self.clock.moving_before += stored
