"""The energy balance of a run: whether it is tracked, and gains and losses."""

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
from karamelo_py.points.laws import can
from karamelo_py.points.laws.temperatures import initial_heat
from karamelo_py.points.laws.viscosity import diffuses_energy
from karamelo_py.run.lower.build import warms_by_friction
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import moved

GROWING = 2  # consecutive windows with growth before a warning


def unknown_work(hub: Hub) -> str:
    """Return the source of work that is not tracked, or "".

    Work of compiled hooks is summed; a Python fix that does no work declares `Fix.conserves`.
    """
    method, implicit = hub.update.method, hub.update.scheme.traits.implicit
    apart = method.own_grids or (implicit and method.fields_per_solid)
    if hub.domain.shear:
        return "the sheared edges"
    for fix in hub.fixes.values():
        acts = any(not isinstance(hook, CompiledHook) for hook in fix.hooks().values())
        if acts and not fix.first_step_only and not fix.conserves:
            return f"fix {fix.style} '{fix.id}'"
    for solid in hub.solids.values():
        if solid.rigid and apart and solid not in moved(hub):
            return f"rigid solid '{solid.id}'"
        if hub.update.thermal and can(solid.material.law, initial_heat):
            return "heat"
    return ""


def unknown_heat(hub: Hub) -> bool:
    energies = any(diffuses_energy(solid.material.law) for solid in hub.solids.values())
    return (
        energies
        or warms_by_friction(hub)
        or any(
            name in HEAT_STAGES and not isinstance(hook, CompiledHook)
            for fix in hub.fixes.values()
            for name, hook in fix.hooks().items()
        )
    )


class EnergyWatch:
    def __init__(self, simulation: SceneState):
        self.simulation, self.control = simulation, simulation.control
        self.watch, self.heat = self.control.energy[0], self.control.heat[0]
        self.followed = False
        self.told_of_growth = False
        self.told_of_loss = False

    def begin(self, *, set_anew: bool) -> None:
        simulation, watch, heat = self.simulation, self.watch, self.heat
        update = simulation.hub.update
        watch.watch_energy = int(not unknown_work(simulation.hub) and simulation.moves)
        anew = not self.followed or set_anew
        self.followed = simulation.moves  # load steps are not in the balance
        if anew:
            self.told_of_growth = self.told_of_loss = False
        if watch.watch_energy:
            # Velocities lag by half a step, stresses by the fraction `strained_before` of a step.
            self._begin_to_look(0.25 + 0.5 * update.scheme.traits.strained_before, anew)
        counted = simulation.notes_temperatures and not unknown_heat(simulation.hub)
        heat.watch_heat = int(update.thermal and counted)
        if heat.watch_heat and anew:
            measure_heat(simulation.setup)
            agree_on_heat(simulation.control.ranks, simulation.control)
            heat.coldest, heat.hottest = heat.T_low, heat.T_high

    def _begin_to_look(self, level: float, anew: bool) -> None:
        simulation, watch, motion = self.simulation, self.watch, self.control.motion[0]
        points = simulation.points
        strain = COARSE * float(np.finfo(simulation.setup.nodes.sums.dtype).eps)
        watch.energy_floor = (
            max(ROUND_OFF, strain**2) * points.total("mass") * float(motion.rate) ** 2
        )
        watch.born_with = points.total("born with")
        if anew:
            watch.to_and_fro = 2 * self._length() / max(float(motion.wave or motion.rate), 1e-300)
        # Energies are summed by tile, so points must be sorted into tiles.
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
        """Return kinetic + stored + dissipated energy - work; NaN if it is not tracked."""
        simulation, watch = self.simulation, self.watch
        if not simulation.in_tiles() or not watch.watch_energy:
            return np.nan
        present = self.control.energy.copy()
        sum_energies(simulation.setup, simulation.mode)
        energy = float(watch.kinetic + watch.stored - watch.work)
        self.control.energy[:] = present
        return energy

    def has_grown(self) -> bool:
        watch = self.watch
        return bool(watch.watch_energy and (watch.windows >= GROWING or watch.grown > WITHIN))

    def has_lost(self, within: float) -> bool:
        watch = self.watch
        return bool(watch.watch_energy and watch.looks > LOOKS and self.lost_fraction() > within)

    def lost_fraction(self) -> float:
        """Return (energy lost since the first step) / (largest energy); negative for a gain."""
        watch = self.watch
        mean = (watch.balance + watch.last_balance + watch.last_but_one) / FEW
        return -growth(watch.first_balance, mean, self._largest())

    def _largest(self) -> float:
        return max(self.watch.largest_energy, self.watch.energy_floor)

    def is_sound(self) -> bool:
        """Return True if neither the energy nor the last step shows a fault in the state."""
        watch, heat = self.watch, self.heat
        swings = heat.watch_heat and self.control.step[0].last_dt > BORNE * heat.heat_limit
        if swings or self.has_grown():
            return False
        if not watch.watch_energy:
            return True
        # Include the last window: noise that grows 50 % in 100 steps has already spoiled the state.
        before = watch.first_mean if watch.looks >= FEW else watch.first_balance
        return bool(keeps(before, watch.balance, unit_of(watch)))

    def growth_since(self, before: float) -> float:
        """Return the energy growth relative to `before`; NaN if it is not tracked."""
        unit = max(abs(before), float(self.watch.energy_floor), 1e-300)
        return growth(before, self.energy(), unit)

    def change(self) -> float | None:
        if not self.watch.watch_energy or self.watch.looks <= FEW:
            return None
        # The loss is relative to the first balance, which `forget_growth` leaves unchanged.
        return -100 * self.lost_fraction()

    def error(self) -> float | None:
        """Return the change plus the loss in the transfer, in % of the largest energy."""
        watch, change = self.watch, self.change()
        lost = (watch.lost_now + watch.last_lost + watch.lost_but_one) / FEW - watch.first_lost
        return None if change is None else change + 100 * float(lost) / self._largest()

    def forget_growth(self) -> None:
        """After a warning, measure growth from the present state."""
        watch = self.watch
        watch.first_few = watch.first_mean = watch.largest_mean
        watch.windows, watch.grown = 0, 0.0

    def without(self, stored: float) -> None:
        self.watch.stored_before -= stored
        self.watch.moving_before += stored
