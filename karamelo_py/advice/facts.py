"""Facts of a scene before a run, which rules judge: its parts, and how its solids move."""

import re
from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from math import isfinite, pi, sqrt
from operator import methodcaller
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice import settling
from karamelo_py.advice.bodies import drift_of, held, lag_of, pressed_evenly, turn_of
from karamelo_py.advice.crossing import expected
from karamelo_py.advice.neighbours import bent_row, parting, uneven
from karamelo_py.compiler.fields import declared
from karamelo_py.language import registry, rules
from karamelo_py.points import transfers
from karamelo_py.points.laws import can, constrained_velocity, law_parts, law_traits
from karamelo_py.points.transfers import flip_coefficient, stores_moment
from karamelo_py.run import timestep
from karamelo_py.run.body_motion import motions
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.plugins import attributed, foreign_parts
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.script.parser import read_script

PIC = 0.21  # viscosity over (1 - alpha) h^2/dt of velocities that come from the grid
TURN = 0.3  # angle, in radian, beyond which a scene counts as rotating
SEQ = methodcaller("particle", "seq")  # equivalent stress of points


class Vibration(NamedTuple):
    """Strain amplitude of a solid that is stretched uniformly, and in how many periods."""

    strain: float
    periods: float


class SceneFacts:
    """Facts of a scene before a run of `duration`: its parts, and how they move."""

    def __init__(self, hub: Hub, simulation: Any, duration: float):
        self.hub, self.simulation = hub, simulation
        # That of some hundred steps where a condition ends the run.
        self.duration = duration if isfinite(duration) else 300 * simulation.dt
        self.method, self.scheme = hub.update.method, hub.update.scheme
        self.transfer, self.basis = hub.update.transfer, self.method.basis
        self.basis_name = self.method.basis_name  # words of the script
        self.transfer_name = registry.name_of("transfer", type(self.transfer))
        self.d, self.corners = hub.domain.dimension, 2**hub.domain.dimension  # of a cell
        self.moves = self.method.frame.moves  # points move through the grid
        keeps = stores_moment(hub.update.transfer)
        self.moments = self.moves and keeps  # and store moments or gradients of their velocity
        # They move through places at which D of the affine transfers vanishes.
        self.vanishing = self.moves and not self.basis.traits.steady_moment
        # The FLIP coefficient, for transfers that store only velocities.
        self.kept = 0.0 if keeps else flip_coefficient(self.transfer)
        # Gradients jump at the faces of cells, with nodes at their corners alone.
        traits = self.basis.traits
        self.linear = traits.gradient_jumps and traits.nodes_per_cell == 1
        self.hats = self.linear or bool(traits.shape)  # on the nodes, or on domains of points
        solids = hub.solids.values()
        # Whether laws store all work, and sustain tension.
        self.elastic = [s for s in solids if law_traits(s.material.whole).rebounds]
        # About one point per cell and direction.
        self.single = [s.id for s in solids if timestep.one_a_cell(s)]
        self.sparse = bool(self.single)

    def parts(self) -> Iterator[tuple[Any, Any]]:
        """Give the parts, each once, and the materials that laws and their parts belong to."""
        materials = dict.fromkeys(solid.material for solid in self.hub.solids.values())
        found = [(fix, None) for fix in self.hub.fixes.values()]
        found += [(part, one) for one in materials for part in law_parts(one.law)]
        found += [(one, None) for one in (self.method, self.basis, self.transfer, self.scheme)]
        yield from found
        owners = [part for part, _ in found]
        kinds = declared(owners, "point_fields") + declared(owners, "node_fields")
        yield from ((kind, None) for kind in dict.fromkeys(kinds))

    def advice(self, kind: str, *, of_laws: bool = False) -> Iterator[rules.Advice]:
        """Tell what the rules of the parts say, of one kind, or of laws and first states alone."""
        foreign = {part.kind: part for part in foreign_parts(self.hub)}
        for part, owner in self.parts():
            if of_laws and owner is None and not (isinstance(part, Fix) and part.first_step_only):
                continue
            with attributed(self.hub, foreign.get(type(part))):
                said = list(rules.advice(kind, part, owner, self))
            yield from said

    # Each of these is found once, when a rule asks for it.
    text = cached_property(lambda self: script_text(self.hub))
    motions = cached_property(lambda self: motions(self.simulation))
    drift, rotation = cached_property(drift_of), cached_property(turn_of)
    lag, crossing = cached_property(lag_of), cached_property(expected)
    settling, uneven = cached_property(settling.expected), cached_property(uneven)
    bent_row, parting = cached_property(bent_row), cached_property(parting)
    # The step over the stable one, and over what holds for uneven neighbours.
    share = property(lambda self: self.simulation.dt / self.simulation.limit)
    share_of_uneven = property(lambda self: self.share * self.uneven.of_step)
    fastest = cached_property(lambda self: self.simulation.fastest())  # component of a velocity
    turns = property(lambda self: self.turn > TURN)  # by an angle that counts
    # The largest velocity over the speed of waves; the strain that impacts and weights cause.
    speed = property(lambda self: self.fastest / self.waves if self.waves > 0 else 0.0)
    strain = property(lambda self: max(self.impact if len(self.hub.solids) > 1 else 0.0, self.sag))
    # Whether all bodies deform evenly, so that no cell is constrained alone.
    even = cached_property(lambda self: all(pressed_evenly(self, one) for one in self.motions))
    shear_stress = cached_property(lambda self: self.simulation.points.largest(SEQ)[0])

    @property
    def reads_temperature(self) -> bool:
        """Tell whether the script has a word for a temperature of its points."""
        return bool(re.search(r"average_temperature|(\b|_)T(max)?\b", self.text))

    @cached_property
    def turn(self) -> float:
        """Find the angle by which the solid that rotates most would rotate if nothing held it."""
        if self.d == 1 or self.hub.domain.axisymmetric:
            return 0.0
        return max((one.spin for one in self.motions), default=0.0) * self.duration

    @property
    def locks(self) -> bool:
        """Return True if linear cells contain several points whose volumes hardly change."""
        free = self.sparse or self.hub.update.anti_locking or self.hub.domain.thin
        return self.hats and self.d > 1 and not free

    @property
    def grid_viscosity(self) -> float:
        """Return the kinematic viscosity of the velocities that points take from the grid."""
        series = transfers.terms.defined(type(self.transfer))
        if not self.moves or self.moments or series or self.simulation.implicit:
            return 0.0
        dt = self.simulation.limit if self.transfer.traits.per_time else 0.0
        dt = dt or self.simulation.dt
        return PIC * (1 - self.kept) * self.hub.domain.h**2 / dt if dt > 0 else 0.0

    @cached_property
    def moving_walls(self) -> bool:
        """Tell whether a rigid solid moves, or a fix leads it."""
        solids = list(self.hub.solids.values())
        rigid = [can(solid.material.law, constrained_velocity) for solid in solids]
        led = (fix for fix in self.hub.fixes.values() if fix.leads_points)
        led = (fix for fix in led if not all(map(is_zero, fix.formulas)))
        moving = (rigid[m.number] and np.any([m.slow, m.fast]) for m in self.motions)
        return any(rigid) and (any(led) or any(moving))

    @cached_property
    def free_turns(self) -> float:
        """Return the revolutions of the solid that rotates most and is held nowhere."""
        free = [one.spin for one in self.motions if self.turn > TURN and not held(self, one).any()]
        return max(free, default=0.0) * self.duration / (2 * pi)

    @cached_property
    def waves(self) -> float:
        """Return the speed of waves."""
        clock = self.simulation.control.clock[0]
        return float(clock.rate) - self.simulation.fastest(clock.common[0])

    @cached_property
    def impact(self) -> float:
        """Return half of the largest difference of velocities over the speed of waves."""
        if not (self.motions and self.waves > 0):
            return 0.0
        fast = np.max([one.fast for one in self.motions], axis=0)
        slow = np.min([one.slow for one in self.motions], axis=0)
        return float((fast - slow).max()) / 2 / self.waves

    @cached_property
    def vibration(self) -> Vibration:
        """Estimate the vibration of the solid that vibrates most."""
        most = Vibration(0.0, 0.0)
        for one in self.motions if self.waves > 0 else ():
            strain = one.rate * one.size / (2 * self.waves)
            periods = self.duration * self.waves / (3 * one.size) if one.size else 0.0
            most = max(most, Vibration(strain, periods))
        return most

    @cached_property
    def weights(self) -> list[np.ndarray]:
        """Find the mean accelerations (d,) that fixes give the solids."""
        found = []
        for fix in self.hub.fixes.values():
            if fix.accelerates and self.waves > 0 and self.motions:
                x = np.array([one.centre for one in self.motions])
                given = (
                    0.0 if f is None else f.evaluate_points(self.hub.values, x, x).mean()
                    for f in fix.formulas[: self.d]
                )  # fmt: skip
                found.append(np.array([*given]))
        return found

    @cached_property
    def sag(self) -> float:
        """Estimate the strain of a solid under its own weight, g L / c^2."""
        sizes = [one.high - one.low for one in self.motions]
        found = (np.abs(g) * np.max(sizes, axis=0) / self.waves**2 for g in self.weights)
        return max((float(one.max()) for one in found), default=0.0)

    @cached_property
    def bending(self) -> float:
        """Estimate the strain of the slenderest solid if its weight or its motion bends it.

        A cantilever of the length L and the height H has a strain of 3 g L^2 / (H c^2) at its
        clamp; the kinetic energy of a beam becomes strain energy, with strains up to sqrt(3) v / c.
        """
        most = 3**0.5 * 2 * self.impact
        for g in self.weights:
            for one in self.motions:
                sides = one.high - one.low
                across = np.delete(np.abs(g), sides.argmax()).max(initial=0.0)
                if sides.min() > 0:
                    bent = 3 * across * sides.max() ** 2 / sides.min()
                    most = max(most, float(bent) / self.waves**2)
        return most

    @property
    def falls(self) -> float:
        """Return the duration of the run over sqrt(L/g), in which a solid falls by its size."""
        sizes = [np.maximum(one.high - one.low, 1e-300) for one in self.motions]
        found = (np.abs(g) / np.max(sizes, axis=0) for g in self.weights)
        return self.duration * max((sqrt(one.max()) for one in found), default=0.0)

    @property
    def passes(self) -> float:
        """Measure ways of points past each other, at present velocities, in sizes of solids."""
        found = [(one.fast - one.slow).max() / (4 * one.size) for one in self.motions if one.size]
        return self.duration * float(max(found, default=0.0))

    @cached_property
    def pressure_ratio(self) -> float:
        """Return the largest pressure over the smallest of all; 1 where there is tension."""
        points = self.simulation.points
        low = -points.largest(lambda some: some.particle("s11"))[0]
        high = points.largest(lambda some: -some.particle("s11"))[0]
        return high / low if low > 0 else 1.0


def script_text(hub: Hub) -> str:
    """Read all files of the script, included ones too, without comments."""
    files = dict.fromkeys([*hub.interpreter.files, *hub.interpreter.files_ahead])
    lines: list[str] = []
    for path in files:
        with suppress(ScriptError):  # the file may be gone by now
            lines += read_script(path).splitlines()
    return "\n".join(line.partition("#")[0] for line in lines)


def is_zero(formula: Any) -> bool:
    """Tell whether a formula is not given, or always 0."""
    if formula is None:
        return True
    formula = Expression(formula)
    return formula.is_constant and formula.constant == 0
