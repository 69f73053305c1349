"""Fixes that only measure."""

import numpy as np

from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import AnyGroup, ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import FIRST, USUAL, Fix, node_hook, per_direction, point_hook
from karamelo_py.script.expressions import Expression


def force_of_nodes(node):
    return node.v, node.v_star, node.force, node.force


def momentum_rate(pt):
    return pt.v, pt.x, pt.mass * pt.v / pt.kick


# For each quantity: the stage of the step, and the hook at nodes or points that measures it.
HOOKS = {
    "internal_force": ("post_particles_to_grid", node_hook(force_of_nodes)),
    "force": ("post_update_grid_state", node_hook(force_of_nodes)),
    "momentum_before": ("initial_integrate", point_hook(momentum_rate)),
    "momentum_after": ("final_integrate", point_hook(momentum_rate)),
}
# Fixes for these quantities act before all other fixes.
COME_FIRST = ("internal_force", "momentum_before")


class Measuring(Fix):
    """Publish the sum of a quantity of `HOOKS`, or of the ``external_force`` of fixes on points."""

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: AnyGroup, name: str):
        super().__init__(hub, group)
        self.name = name
        self.order = FIRST if name in COME_FIRST else USUAL
        if name in HOOKS:
            self.formulas = (Expression(0.0),) * hub.domain.dimension
            setattr(self, *HOOKS[name])

    def refresh(self) -> None:
        if self.name not in HOOKS:
            self.publish_components(self.hub.fields.added_up(self))

    def terms(self, points: PointTable) -> list[np.ndarray]:
        return [points.particle("b" + axis) for axis in "xyz"]


class CheckSolution(Fix):
    """Compare the displacement of points with an exact solution, whenever the log is written.

    Parameters
    ----------
    displacement
        ux, uy, uz, one per dimension: functions of x0, y0, z0 and time.

    Example
    -------
    fix(error, check_solution, all, 0.01*sin(PI*x0)*sin(10*time), 0)

    Notes
    -----
    Publishes the present error ID_s = sqrt(sum V0 |u - u_exact|^2 / sum V0), and, summed over the
    outputs so far, ID_x = sum dt sum V0 |u - u_exact|^2, ID_y = sum dt sum V0 |u_exact|^2, and the
    relative error ID_z = sqrt(ID_x / ID_y). V0 is the initial volume of a point, dt the time step.
    """

    syntax = "group, ux[, uy[, uz]]"
    published = ("x", "y", "z", "s")
    remembers = ("_step",)

    def __init__(self, hub: Hub, group: ParticleGroup, *displacement: Expression | None):
        super().__init__(hub, group)
        self.formulas = per_direction(hub, "u", displacement)
        self._step: int | None = None

    def refresh(self) -> None:
        now, size, volume = self.hub.fields.added_up(self)
        if not volume:
            return
        self.publish("s", np.sqrt(now / volume))
        if self._step == self.hub.update.step:
            return
        self._step, dt = self.hub.update.step, self.hub.update.dt
        error, total = (self.hub.values.get(f"{self.id}_{axis}") for axis in "xy")
        error, total = error + dt * now, total + dt * size
        self.publish_all(error, total, np.sqrt(error / total) if total > 0 else 0.0)

    def terms(self, points: PointTable) -> np.ndarray:
        x, x0 = points.position, points.reference_position
        squares = np.zeros((2, points.count))
        for k, formula in enumerate(self.formulas):
            if formula is not None:
                exact = formula.evaluate_points(self.hub.values, x, x0)
                squares += np.stack([x[:, k] - x0[:, k] - exact, exact]) ** 2
        return points.reference_volume * np.vstack([squares, np.ones(points.count)])
