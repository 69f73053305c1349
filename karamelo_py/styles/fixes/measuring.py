"""Fixes that change nothing and measure forces for the functions of groups in expressions."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import Group
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, node_hook, point_hook
from karamelo_py.script.expressions import Expression


def force_of_nodes(mass, v, v_star, force, value, before, dt, share):
    """The total is the force."""
    return v, v_star, force, force


def momentum_rate(mass, v, x_old, x, value, before, dt, kick):
    """The total is the momentum over the time that forces act for."""
    return v, x, mass * v / kick


class Measuring(Fix):
    """Base of fixes that only measure.

    Attributes
    ----------
    comes_first
        Whether it acts before all other fixes, whenever it is defined.
    """

    published = ("x", "y", "z")
    comes_first = False

    def __init__(self, hub: Hub, group: Group):
        super().__init__(hub, group)
        self.formulas = (Expression(0.0),) * hub.domain.dimension


class ForceBeforeFixes(Measuring):
    """Force of nodes before other fixes add to it."""

    comes_first = True
    post_particles_to_grid = node_hook(force_of_nodes)


class TotalForce(Measuring):
    """Force of nodes with all that fixes have added."""

    post_update_grid_state = node_hook(force_of_nodes)


class MomentumBefore(Measuring):
    """Momentum of points at the start of a step over the step."""

    comes_first = True
    initial_integrate = point_hook(momentum_rate, publishes=True)


class MomentumAfter(Measuring):
    """Momentum of points at the end of a step over the step."""

    final_integrate = point_hook(momentum_rate, publishes=True)


class PointForce(Fix):
    """Force that fixes put on points."""

    published = ("x", "y", "z")
    comes_first = False

    def refresh(self) -> None:
        """Measure and publish."""
        self.publish_components(self.hub.fields.added_up(self))

    def terms(self, points: PointTable) -> list[np.ndarray]:
        """Components of the forces on points."""
        return [points.particle("b" + axis) for axis in "xyz"]
