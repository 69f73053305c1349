"""Facts of a scene before a run, which rules judge: its parts, and how its solids move."""

from collections.abc import Iterator
from functools import cached_property
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.language import registry, rules
from karamelo_py.output.fields import Fields
from karamelo_py.points.transfers import Moment
from karamelo_py.run import timestep
from karamelo_py.run.advice.noise import Noise, drift_of, turn_of
from karamelo_py.run.body_motion import BodyMotion
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import attributed, foreign_parts

TURN = 0.3  # angle, in radian, beyond which a scene is said to turn


class Vibration(NamedTuple):
    """Strain by which a solid swings that is stretched evenly, and in how many periods."""

    strain: float
    periods: float


class SceneFacts:
    """Facts of a scene before a run of `duration`.

    Attributes
    ----------
    hub, simulation
        The scene, and what steps it.
    duration
        Of the run; that of some hundred steps where a condition ends it.
    d
        Number of dimensions.
    method, basis, transfer, scheme
        Its parts.
    basis_name, transfer_name
        Words of the script for two of them.
    moves
        Whether points move through the grid.
    """

    def __init__(self, hub: Hub, simulation: Any, duration: float):
        self.hub, self.simulation = hub, simulation
        self.duration = duration if isfinite(duration) else 300 * simulation.dt
        self.method, self.transfer, self.scheme = (
            getattr(hub.update, name) for name in ("method", "transfer", "scheme")
        )
        self.basis, self.basis_name = self.method.basis, self.method.basis_name
        self.transfer_name = registry.name_of("transfer", type(self.transfer))
        self.moves = self.method.frame.moves
        self.d = hub.domain.dimension

    # --- parts ---------------------------------------------------------------------------------

    def parts(self) -> Iterator[tuple[Any, Any]]:
        """Give the parts, each once, and the materials that laws and their parts belong to."""
        materials = dict.fromkeys(solid.material for solid in self.hub.solids.values())
        found = [(fix, None) for fix in self.hub.fixes.values()]
        found += [(part, one) for one in materials for part in law_parts(one.law)]
        found += [(one, None) for one in (self.method, self.basis, self.transfer, self.scheme)]
        fields: dict[type, None] = {}
        for part, _ in found:
            fields |= dict.fromkeys(getattr(part, "point_fields", ()))
            fields |= dict.fromkeys(getattr(part, "node_fields", ()))
        yield from found
        yield from ((field, None) for field in fields)

    def advice(self, kind: str) -> Iterator[rules.Advice]:
        """Tell what the rules of the parts say, of one kind."""
        foreign = {part.kind: part for part in foreign_parts(self.hub)}
        for part, owner in self.parts():
            with attributed(self.hub, foreign.get(type(part))):
                said = list(rules.advice(kind, part, owner, self))
            yield from said

    @property
    def elastic(self) -> list[Any]:
        """The solids of laws that store all work, and bear tension."""
        return [s for s in self.hub.solids.values() if getattr(s.material.law, "rebounds", False)]

    @property
    def moments(self) -> bool:
        """Whether points move through the grid, with moments or gradients of their velocity."""
        return self.moves and Moment in getattr(self.transfer, "point_fields", ())

    @property
    def vanishing(self) -> bool:
        """Whether points move through places at which D of the affine transfers vanishes."""
        return self.moves and not self.basis.steady_moment

    @property
    def kept(self) -> float:
        """The share of FLIP, of transfers that keep velocities alone."""
        moments = Moment in getattr(self.transfer, "point_fields", ())
        return 0.0 if moments else getattr(self.transfer, "alpha", 0.0)

    @property
    def linear(self) -> bool:
        """Whether gradients jump at the faces of cells, with nodes at their corners alone."""
        return getattr(self.basis, "gradient_jumps", False) and self.basis.nodes_per_cell == 1

    @property
    def corners(self) -> int:
        """Number of corners of a cell."""
        return 2**self.d

    @property
    def sparse(self) -> bool:
        """Whether a solid has about one point a cell and direction."""
        return timestep.sparse(self.hub)

    @property
    def single(self) -> list[str]:
        """The solids with one point a cell."""
        return [s.id for s in self.hub.solids.values() if timestep.one_a_cell(s)]

    # --- motion --------------------------------------------------------------------------------

    @cached_property
    def motions(self) -> list[BodyMotion]:
        """How the solids move."""
        return self.simulation.motions()

    @cached_property
    def drift(self) -> Noise | None:
        """What a drift through the grid feeds, at most."""
        return drift_of(self)

    @cached_property
    def rotation(self) -> Noise | None:
        """What a turn through the grid feeds, at most."""
        return turn_of(self)

    @cached_property
    def turn(self) -> float:
        """The angle by which the solid that turns most would turn in this run, if none held it."""
        if self.d == 1 or self.hub.domain.axisymmetric:
            return 0.0
        return max((one.spin for one in self.motions), default=0.0) * self.duration

    @property
    def turns(self) -> bool:
        """Whether a solid turns by an angle that counts."""
        return self.turn > TURN

    @cached_property
    def waves(self) -> float:
        """The speed of waves."""
        clock = self.simulation.control.clock[0]
        return float(clock.rate) - self.simulation.fastest(clock.common[0])

    @cached_property
    def fastest(self) -> float:
        """The largest component of a velocity."""
        return self.simulation.fastest()

    @property
    def speed(self) -> float:
        """The same over the speed of waves."""
        return self.fastest / self.waves if self.waves > 0 else 0.0

    @cached_property
    def impact(self) -> float:
        """Half of the largest difference of velocities over the speed of waves."""
        if not (self.motions and self.waves > 0):
            return 0.0
        fast, slow = (
            np.array([getattr(m, name) for m in self.motions]) for name in ("fast", "slow")
        )
        return float((fast.max(axis=0) - slow.min(axis=0)).max()) / 2 / self.waves

    @cached_property
    def vibration(self) -> Vibration:
        """How the solid swings that does so most."""
        most = Vibration(0.0, 0.0)
        for one in self.motions if self.waves > 0 else ():
            strain = one.rate * one.size / (2 * self.waves)
            periods = self.duration * self.waves / (3 * one.size) if one.size else 0.0
            most = max(most, Vibration(strain, periods))
        return most

    @cached_property
    def sag(self) -> float:
        """The strain of a solid under its own weight, g L / c^2."""
        most = 0.0
        for fix in self.hub.fixes.values():
            if fix.accelerates and self.waves > 0 and self.motions:
                x = np.array([one.centre for one in self.motions])
                for k, formula in enumerate(fix.formulas[: self.d]):
                    if formula is not None:
                        g = abs(formula.evaluate_points(self.hub.values, x, x).mean())
                        size = max(one.high[k] - one.low[k] for one in self.motions)
                        most = max(most, float(g * size / self.waves**2))
        return most

    @property
    def strain(self) -> float:
        """The strain that impacts and weights cause."""
        return max(self.impact if len(self.hub.solids) > 1 else 0.0, self.sag)

    @cached_property
    def shear_stress(self) -> float:
        """The largest equivalent stress of a point."""
        return self.simulation.largest(_equivalent_stress)[0]


def _equivalent_stress(points: Fields) -> np.ndarray:
    return points.particle("seq")


def law_parts(law: Any) -> Iterator[Any]:
    """Give a law and its parts."""
    yield law
    for part in law:
        if isinstance(part, tuple):
            yield from law_parts(part)
