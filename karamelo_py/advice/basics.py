"""Basic facts of a scene: parts and motions."""

from functools import cached_property
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.language import registry
from karamelo_py.points.laws import law_traits
from karamelo_py.points.transfers import flip_coefficient, stores_moment
from karamelo_py.run import stable_step
from karamelo_py.run.body_motion import BodyMotion, motions
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.script.expressions import Expression


class Body(NamedTuple):
    motion: BodyMotion
    solid: Solid


class BasicFacts:
    def __init__(self, hub: Hub, simulation: Simulation, duration: float):
        self.hub, self.simulation = hub, simulation
        self.duration = duration if isfinite(duration) else 300 * simulation.steps.later_dt
        self.method, self.scheme = hub.update.method, hub.update.scheme
        self.transfer, self.basis = hub.update.transfer, self.method.basis
        self.basis_name = self.method.basis_name
        self.transfer_name = registry.name_of("transfer", type(self.transfer))
        self.d, self.corners = hub.domain.dimension, 2**hub.domain.dimension
        self.moves = self.method.frame.moves  # updated frame: points move through the grid
        affine = stores_moment(self.transfer)
        self.moments = self.moves and affine  # points move with velocity moments or gradients
        # D of affine transfers vanishes at some positions in a cell.
        self.vanishing = self.moves and not self.basis.traits.steady_moment
        self.kept = 0.0 if affine else flip_coefficient(self.transfer)  # FLIP coefficient
        traits = self.basis.traits
        self.linear = traits.gradient_jumps and traits.nodes_per_cell == 1
        self.hats = self.linear or bool(traits.shape)  # linear, or a basis with domains
        solids = hub.solids.values()
        # Solids whose laws store all work of stress and sustain tension.
        self.elastic = [s for s in solids if law_traits(s.material.whole).rebounds]
        # IDs of solids with about one point per cell and direction.
        self.single = [s.id for s in solids if stable_step.one_a_cell(s)]
        self.sparse = bool(self.single)

    motions = cached_property(lambda self: motions(self.simulation))
    spacing = property(lambda self: float(self.simulation.control.step[0].spacing))

    @cached_property
    def bodies(self) -> list[Body]:
        solids = list(self.hub.solids.values())
        return [Body(motion, solids[motion.number]) for motion in self.motions]

    @cached_property
    def waves(self) -> float:
        motion = self.simulation.control.motion[0]
        return float(motion.rate) - self.simulation.fastest(motion.common[0])

    @cached_property
    def weights(self) -> list[np.ndarray]:
        """Return the mean accelerations (d,) of the solids due to each fix."""
        weights = []
        for fix in self.hub.fixes.values():
            if fix.accelerates and self.waves > 0 and self.motions:
                x = np.array([motion.centre for motion in self.motions])
                means = (
                    0.0 if f is None else f.evaluate_points(self.hub.values, x, x).mean()
                    for f in fix.formulas[: self.d]
                )  # fmt: skip
                weights.append(np.array([*means]))
        return weights


def is_zero(formula: Any) -> bool:
    if formula is None:
        return True
    formula = Expression(formula)
    return formula.is_constant and formula.constant == 0
