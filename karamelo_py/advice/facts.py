"""Facts of a scene before a run, for rules."""

from collections.abc import Iterator
from functools import cached_property
from math import inf, pi, sqrt
from operator import methodcaller
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice import settling
from karamelo_py.advice.basics import BasicFacts, is_zero
from karamelo_py.advice.bodies import drift_of, is_free, lag_of, pressed_evenly, turn_of
from karamelo_py.advice.crossing import expected
from karamelo_py.advice.neighbours import bent_row, parting, uneven
from karamelo_py.compiler.fields import declared
from karamelo_py.language import rules
from karamelo_py.points import transfers
from karamelo_py.points.laws import law_parts
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.plugins import attributed, foreign_parts

PIC = 0.21  # numerical viscosity of PIC / ((1 - alpha) h^2/dt)
TURN = 0.3  # radians beyond which a scene counts as rotating
SEQ = methodcaller("particle", "seq")
APART = 1.5  # distance of points / cell above which they have few nodes in common
DIATOMIC = 1.4  # ratio of the specific heats of air


class Vibration(NamedTuple):
    strain: float
    periods: float


class SceneFacts(BasicFacts):
    def parts(self) -> Iterator[tuple[Any, Any]]:
        """Yield each part of the scene (law, basis, ...) once, with the material of the part."""
        materials = dict.fromkeys(solid.material for solid in self.hub.solids.values())
        parts = [(fix, None) for fix in self.hub.fixes.values()]
        parts += [
            (law_part, material) for material in materials for law_part in law_parts(material.law)
        ]
        parts += [
            (law_part, None) for law_part in (self.method, self.basis, self.transfer, self.scheme)
        ]
        yield from (*parts, *((compute, None) for compute in self.hub.computes.values()))
        owners = [law_part for law_part, _ in parts]
        kinds = declared(owners, "point_fields") + declared(owners, "node_fields")
        yield from ((kind, None) for kind in dict.fromkeys(kinds))

    def advice(self, kind: str, *, of_laws: bool = False) -> Iterator[rules.Advice]:
        foreign = {piece.kind: piece for piece in foreign_parts(self.hub)}
        for piece, owner in self.parts():
            early = isinstance(piece, Fix) and (piece.first_step_only or piece.accelerates)
            if of_laws and owner is None and not early:
                continue
            with attributed(self.hub, foreign.get(type(piece))):
                advice = list(rules.advice(kind, piece, owner, self))
            yield from advice

    drift, rotation = cached_property(drift_of), cached_property(turn_of)
    lag, crossing = cached_property(lag_of), cached_property(expected)
    driven = cached_property(settling.driven)
    settling, uneven = cached_property(settling.expected), cached_property(uneven)
    bent_row, parting = cached_property(bent_row), cached_property(parting)
    # Step / stable step, and step / limit for neighbours of different density.
    fraction = property(lambda self: self.simulation.dt / self.simulation.steps.limit)
    fraction_of_uneven = property(lambda self: self.fraction * self.uneven.of_step)
    fastest = cached_property(lambda self: self.simulation.fastest())  # largest velocity component
    turns = property(lambda self: self.turn > TURN)
    # Largest velocity / wave speed; strain due to impacts and weight.
    speed = property(lambda self: self.fastest / self.waves if self.waves > 0 else 0.0)
    strain = property(lambda self: max(self.impact if len(self.hub.solids) > 1 else 0.0, self.sag))
    # True if all bodies deform evenly, so that no single cell is constrained.
    even = cached_property(lambda self: all(pressed_evenly(self, body) for body in self.bodies))
    shear_stress = cached_property(lambda self: self.simulation.points.largest(SEQ)[0])

    @property
    def reads_temperature(self) -> bool:
        return any(name == "T" or name.endswith("Tmax") for name in self.hub.asked)

    @cached_property
    def turn(self) -> float:
        if self.d == 1 or self.hub.domain.kin.hoops:
            return 0.0
        return max((motion.spin for motion in self.motions), default=0.0) * self.duration

    @property
    def locks(self) -> bool:
        """True if isochoric flow locks cells of a linear basis that contain several points."""
        free = self.sparse or self.hub.update.anti_locking or self.hub.domain.thin
        return self.hats and (self.d > 1 or self.hub.domain.kin.hoops > 0) and not free

    @property
    def grid_viscosity(self) -> float:
        """Kinematic numerical viscosity, `PIC` (1 - alpha) h^2/dt."""
        series = transfers.terms.defined(type(self.transfer))
        if not self.moves or self.moments or series or self.simulation.implicit:
            return 0.0
        dt = self.simulation.steps.limit if self.transfer.traits.per_time else 0.0
        dt = dt or self.simulation.dt
        return PIC * (1 - self.kept) * self.hub.domain.h**2 / dt if dt > 0 else 0.0

    @cached_property
    def moving_walls(self) -> bool:
        rigid = [solid.rigid for solid in self.hub.solids.values()]
        led = (fix for fix in self.hub.fixes.values() if fix.leads_points)
        led = (fix for fix in led if not all(map(is_zero, fix.formulas)))
        moving = (rigid[m.number] and np.any([m.slow, m.fast]) for m in self.motions)
        return any(rigid) and (any(led) or any(moving))

    @cached_property
    def faces_in_cells(self) -> bool:
        cells: tuple[list, list] = ([], [])
        for solid in self.hub.solids.values():
            at = np.floor((solid.x0 - self.hub.domain.lo[: self.d]) / self.hub.domain.h)
            cells[solid.rigid].extend(np.unique(at, axis=0).tolist())
        return not set(map(tuple, cells[True])).isdisjoint(map(tuple, cells[False]))

    @cached_property
    def free_turns(self) -> float:
        free = [b.motion.spin for b in self.bodies if self.turns and is_free(self, b)]
        return max(free, default=0.0) * self.duration / (2 * pi)

    @cached_property
    def impact(self) -> float:
        """Half of the largest velocity difference / wave speed."""
        if not (self.motions and self.waves > 0):
            return 0.0
        fast = np.max([motion.fast for motion in self.motions], axis=0)
        slow = np.min([motion.slow for motion in self.motions], axis=0)
        return float((fast - slow).max()) / 2 / self.waves

    @cached_property
    def vibration(self) -> Vibration:
        most = Vibration(0.0, 0.0)
        for motion in self.motions if self.waves > 0 else ():
            strain = motion.rate * motion.size / (2 * self.waves)
            periods = self.duration * self.waves / (3 * motion.size) if motion.size else 0.0
            most = max(most, Vibration(strain, periods))
        return most

    @cached_property
    def sag(self) -> float:
        """Strain of bodies due to their weight, g L/c^2."""
        sizes = [motion.high - motion.low for motion in self.motions]
        strains = (np.abs(g) * np.max(sizes, axis=0) / self.waves**2 for g in self.weights)
        # A load may be infinite at the start, such as 1/time.
        return max((float(strain.max()) for strain in strains if strain.max() < inf), default=0.0)

    @cached_property
    def bending(self) -> float:
        """Bending strain of the slenderest solid: 3 g L^2/(H c^2), or sqrt(3) v/c at impact."""
        most = 3**0.5 * 2 * self.impact
        for g in self.weights:
            for motion in self.motions:
                sides = motion.high - motion.low
                across = np.delete(np.abs(g), sides.argmax()).max(initial=0.0)
                if sides.min() > 0:
                    bent = 3 * across * sides.max() ** 2 / sides.min()
                    most = max(most, float(bent) / self.waves**2)
        return most

    @property
    def falls(self) -> float:
        """Duration of the run / sqrt(L/g)."""
        sizes = [np.maximum(motion.high - motion.low, 1e-300) for motion in self.motions]
        rates = (np.abs(g) / np.max(sizes, axis=0) for g in self.weights)
        return self.duration * max((sqrt(rate.max()) for rate in rates), default=0.0)

    @property
    def passes(self) -> float:
        """Relative displacement of points / twice the longest side of a body."""
        rates = [(m.fast - m.slow).max() / (4 * m.size) for m in self.motions if m.size]
        return self.duration * float(max(rates, default=0.0))

    @cached_property
    def pressure_ratio(self) -> float:
        points = self.simulation.points
        low = -points.largest(lambda some: some.particle("s11"))[0]
        high = points.largest(lambda some: -some.particle("s11"))[0]
        return high / low if low > 0 else 1.0

    @cached_property
    def thins(self) -> bool:
        """Return True if points of compressed gas will be more than `APART` cells apart.

        They are once the gas has expanded to the mean pressure of all gas. With APIC, a point alone
        in its cells continues to expand: a blast from a core of 3 cells lost 30 % of its energy.
        """
        points, kin = self.simulation.points, self.hub.domain.kin
        parts = [
            np.column_stack([np.maximum(-some.particle("s11"), 0), some.particle("volume")])
            for some in points.some(None)
        ]
        pressure, volume = np.concatenate(parts).T
        work, room = points.summed(np.column_stack([pressure * volume, volume * (pressure > 0)]))
        if not work > 0:
            return False
        high = points.largest(lambda some: -some.particle("s11"))[0]
        stretch = (high / (work / room)) ** (1 / (DIATOMIC * (self.d + kin.hoops)))
        soft = (solid for solid in self.hub.solids.values() if not solid.rigid)
        apart = max((2 * solid.half_size.max() / solid.h for solid in soft), default=0.0)
        return bool(stretch * apart > APART)
