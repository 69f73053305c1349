"""What rules that foresee failures ask of a scene before a run: how its solids move."""

from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from karamelo_py.language import registry
from karamelo_py.points.laws import law_kind
from karamelo_py.points.transfers import Moment
from karamelo_py.run.body_motion import Motion
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.fixes.body_force import BodyForce


class Foreseen:
    """A scene before a run of `duration`: what rules ask of it."""

    def __init__(self, hub: Hub, simulation: Any, duration: float):
        self.hub, self.simulation = hub, simulation
        # A run that a condition ends takes some hundred steps at least.
        self.duration = duration if isfinite(duration) else 300 * simulation.dt
        update = hub.update
        self.transfer, self.method, self.scheme = update.transfer, update.method, update.scheme
        self.basis = update.method.basis
        self.moves = update.method.frame.moves
        self.d = hub.domain.dimension
        self.words = registry.name_of("transfer", type(self.transfer))

    def solids(self, *laws: type) -> list[Any]:
        """The solids with one of these laws, or parts of laws."""
        return [s for s in self.hub.solids.values() if set(law_kind(s.material.law)) & set(laws)]

    @property
    def moments(self) -> bool:
        """Whether points move through the grid, with moments or gradients of their velocity."""
        return self.moves and Moment in getattr(self.transfer, "point_fields", ())

    @property
    def vanishing(self) -> bool:
        """Whether points move through places at which D of the affine transfers vanishes."""
        return self.moves and not self.basis.steady_moment

    @cached_property
    def motions(self) -> list[Motion]:
        """How the solids move."""
        return self.simulation.motions()

    @cached_property
    def turn(self) -> float:
        """The angle by which the solid that turns most would turn in this run, if none held it."""
        if self.d == 1 or self.hub.domain.axisymmetric:
            return 0.0
        return max((one.spin for one in self.motions), default=0.0) * self.duration

    @cached_property
    def waves(self) -> float:
        """The speed of waves."""
        clock = self.simulation.control.clock[0]
        return float(clock.rate) - self.simulation.fastest(clock.common[0])

    @cached_property
    def speed(self) -> float:
        """The largest component of a velocity over the speed of waves."""
        return self.simulation.fastest() / self.waves if self.waves > 0 else 0.0

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
    def vibration(self) -> tuple[float, float]:
        """The strain by which a solid swings that is stretched evenly, and in how many periods."""
        most = 0.0, 0.0
        for one in self.motions if self.waves > 0 else ():
            strain = one.rate * one.size / (2 * self.waves)
            periods = self.duration * self.waves / (3 * one.size) if one.size else 0.0
            most = max(most, (strain, periods))
        return most

    @cached_property
    def sag(self) -> float:
        """The strain of a solid under its own weight, g L / c^2."""
        most = 0.0
        for fix in self.hub.fixes.values():
            if isinstance(fix, BodyForce) and self.waves > 0 and self.motions:
                x = np.array([one.centre for one in self.motions])
                for k, formula in enumerate(fix.formulas[: self.d]):
                    if formula is not None:
                        g = abs(formula.evaluate_points(self.hub.values, x, x).mean())
                        size = max(one.high[k] - one.low[k] for one in self.motions)
                        most = max(most, float(g * size / self.waves**2))
        return most
