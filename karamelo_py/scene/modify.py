"""Base classes of fixes and computes (Modify in LAMMPS and Karamelo).

A fix overrides hooks, named as in Karamelo; docs/plugins.md lists them. A hook is a method, called
with a view of the group (Python runs at that stage of each step), or the result of
:func:`node_hook`, :func:`point_hook` or :func:`vector_hook`, which is compiled into the loop.
"""

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from karamelo_py.kernels.hooks import (
    STAGES,
    CompiledHook,
    heat_hook,
    node_hook,
    point_hook,
    vector_hook,
)
from karamelo_py.language.faults import as_script_error
from karamelo_py.language.scene import Scene
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.views import NodesView, PointsView
from karamelo_py.script.errors import Place
from karamelo_py.script.values import SUFFIXES

__all__ = [
    "Compute",
    "Fix",
    "NodesView",
    "PointsView",
    "heat_hook",
    "node_hook",
    "point_hook",
    "vector_hook",
]


FIRST, USUAL, LAST = range(3)  # among the fixes that act at a stage, else as in the script
FROM_PYTHON = 3e-4  # seconds per call of a Python hook, without its work


class Publisher:
    """Base of fixes and computes: publishes values under its ID."""

    hub: Scene
    id: str = ""
    style: str = ""
    place: Place | None = None
    # Suffixes of published values: "x" for ``ID_x`` and so on, "" for ``ID``.
    published: tuple[str, ...] = SUFFIXES
    has_published = False

    def publish(self, name: str, value: float) -> None:
        """Publish `value` as ID_`name`, or as ID if `name` is empty."""
        if name not in self.published:
            raise ValueError(f"'{name}' is not in {type(self).__name__}.published")
        self.has_published = True
        self.hub.values.set(f"{self.id}_{name}" if name else self.id, float(value))

    def publish_components(self, vector: np.ndarray) -> None:
        """Publish up to three components as ID_x, ID_y, ID_z, if they are in `published`."""
        for name, value in zip("xyz", vector, strict=False):
            if name in self.published:
                self.publish(name, value)

    def publish_all(self, *values: float) -> None:
        """Publish values in the order of `published`; missing ones are skipped."""
        for name, value in zip(self.published, values, strict=False):
            self.publish(name, value)

    def refresh(self) -> None:
        """Update published values; called before output."""


class Fix(Publisher):
    """Base of all fixes: acts on its `group` during a run. Class attributes declare traits."""

    group: Any = None  # of nodes or points
    formulas: tuple = ()  # of compiled hooks: one or None per component
    first_step_only = False  # acts only in the first step after its definition
    # Its Python hooks treat each point or node separately and move none. They then get the local
    # points in any order, before the first step in several calls. Sums need ``total``.
    point_by_point = False
    for_method = False  # has no hooks: the method reads it
    # Prescribes nodal velocities in ``post_update_grid_state``, in directions that have a formula;
    # contact does not change them.
    prescribes_velocity = False
    # Directions in which it holds or bounds nodes. Cell faces with all nodes held are walls, at
    # which splines are modified as at the ends of the grid.
    held_directions: tuple[int, ...] = ()
    # Formula of the friction coefficient of this wall, in directions without a formula; None for
    # frictionless walls.
    wall_friction: Any = None
    # Declared fields (`compiler.fields`): `Force` if it sets forces on points in
    # ``initial_integrate``.
    point_fields: tuple[type, ...] = ()
    node_fields: tuple[type, ...] = ()
    by_sizes = False  # takes the sizes of points from their volumes, and no thickness
    impulsive = False  # removes a penetration within one step
    leads_points = False  # prescribes the motion of points
    follows_points = False  # the force depends on positions of points, as for tools
    depth_of: Any = None  # depth of positions in a tool, (n,), for outlines in pictures
    faces_of: Any = None  # present faces of a tool that consists of faces, (m, d, d)
    accelerates = False  # its formulas are forces per mass, such as gravity
    brakes = False  # dissipates energy
    order = USUAL  # FIRST or LAST at each stage, wherever the script defines it
    # Its Python hooks add no energy: they store, transfer or dissipate it. Otherwise the energy
    # balance is not monitored.
    conserves = False
    # Calls ``between_steps()`` after steps that are multiples of this; it returns whether points
    # were deleted. 0: never.
    every = 0
    friction: float | None = None  # between its two `solids`, for contact on the grid
    solids: tuple = ()  # that it acts between, if it has no group

    def __init__(self, hub: Scene, group: Any = None):
        self.hub = hub
        if group is not None:
            self.group = group

    @property
    def nodes(self) -> np.ndarray:
        """Numbers of the nodes that it acts on, for fixes on nodes."""
        return self.group.nodes

    def prescribed(self, nodes: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Give the components (m, k) of `nodes` at `x` (m, d) that it prescribes, and their values.

        Those that it has `formulas` for. For implicit schemes, which do not call its hooks for it.
        """
        own = np.isin(nodes, self.nodes)
        given = np.outer(own, [formula is not None for formula in self.formulas])
        values, x = np.zeros(given.shape), x[own]
        for k, formula in enumerate(self.formulas):
            if formula is not None:
                values[own, k] = formula.evaluate_points(self.hub.values, x, x)
        return given, values

    def defined(self) -> None:
        """Called when the fix has its ID and is part of the scene."""

    def seconds(self) -> float:
        """Estimate the core seconds that it adds to a step, for ``check``."""
        from_python = any(not isinstance(hook, CompiledHook) for hook in self.hooks().values())
        return FROM_PYTHON if from_python and not self.first_step_only else 0.0

    def hooks(self) -> dict[str, Any]:
        """Map the names of overridden hooks to methods or compiled hooks."""
        found = {name: getattr(self, name) for name in STAGES if hasattr(self, name)}
        return {
            name: hook if isinstance(hook, CompiledHook) else self._told(name, hook)
            for name, hook in found.items()
        }

    def _told(self, name: str, hook: Callable) -> Callable:
        """Wrap `hook` so that its exceptions name the fix."""

        @wraps(hook)
        def call(view: Any) -> None:
            with as_script_error(f"fix {self.style}", name, type(self), self.place):
                hook(view)
                view.write_back()

        return call


class Compute(Publisher):
    """Base of all computes: override `refresh`, which measures a `group` of points for the log."""

    def __init__(self, hub: Scene, group: ParticleGroup):
        self.hub = hub
        self.group = group
