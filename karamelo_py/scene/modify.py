"""Fixes and computes: what acts on a run and what measures it (LAMMPS's and Karamelo's Modify).

A fix overrides the hooks it needs, by the names of Karamelo: the page on plug-ins lists them. Each
is either a method, called with a view of the group (Python comes back at that stage of each step),
or the result of :func:`node_hook`, :func:`point_hook` or :func:`vector_hook`, which is compiled
into the loop.
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


FROM_PYTHON = 3e-4  # seconds of a core, of a hook without what it does


class Publisher:
    """Base of fixes and computes: publishes values under its ID."""

    hub: Scene
    id: str = ""
    style: str = ""
    place: Place | None = None
    # Suffixes of the values it sets: "x" for ``ID_x`` and the like, "" for ``ID``.
    published: tuple[str, ...] = SUFFIXES
    has_published = False

    def publish(self, name: str, value: float) -> None:
        """Publish `value` as ID_`name`, or as the plain ID when `name` is empty."""
        if name not in self.published:
            raise ValueError(f"'{name}' is not in {type(self).__name__}.published")
        self.has_published = True
        self.hub.values.set(f"{self.id}_{name}" if name else self.id, float(value))

    def publish_components(self, vector: np.ndarray) -> None:
        """Publish up to three components as ID_x, ID_y, ID_z, as far as `published` has them."""
        for name, value in zip("xyz", vector, strict=False):
            if name in self.published:
                self.publish(name, value)

    def publish_all(self, *values: float) -> None:
        """Publish values in the order of `published`, as many as there are."""
        for name, value in zip(self.published, values, strict=False):
            self.publish(name, value)

    def refresh(self) -> None:
        """Bring published values up to date; called before the log or a dump is written."""


class Fix(Publisher):
    """Base of all fixes: acts on its `group` during a run. Attributes say what else it is."""

    group: Any = None  # of nodes or points
    formulas: tuple = ()  # one, or None, for each component, of compiled hooks
    first_step_only = False  # acts in the first step after its definition and is idle thereafter
    # Its hooks in Python look at each point or node on its own, and move none. Then they see, in
    # any order, the points that are at hand: those of one of several processes, and before the
    # first step some after others. For sums over all there is ``total``.
    point_by_point = False
    for_method = False  # has no hooks because the method reads it
    # Prescribes velocities of the nodes of its group in ``post_update_grid_state``, in the
    # directions in which it has a formula: contact does not move them.
    prescribes_velocity = False
    # Directions in which it holds or bounds nodes: faces of cells that have all their nodes among
    # them are walls, at which splines are modified as at the ends of the grid.
    held_directions: tuple[int, ...] = ()
    # Formula of the coefficient of friction along the wall that it makes by such velocities, in the
    # directions in which it has no formula; None for walls without.
    wall_friction: Any = None
    # Fields that it declares (`compiler.fields`): `Force` if it sets forces on points in
    # ``initial_integrate``.
    point_fields: tuple[type, ...] = ()
    node_fields: tuple[type, ...] = ()
    impulsive = False  # undoes a penetration within one step
    leads_points = False  # against their forces
    follows_points = False  # pushes points by where they are, as tools do
    depth_of: Any = None  # of points in a tool: (n,), which pictures outline
    faces_of: Any = None  # of a tool that is made of them: (m, d, d), by their corners now
    accelerates = False  # its formulas are forces per mass, as of weight
    brakes = False  # takes energy, as much as it is told
    acts_last = False  # after all others at each moment, wherever the script has it
    # Its hooks in Python bring no energy: what they do to points and nodes stores it, passes it on
    # or takes it away. Otherwise the energy of the scene is not watched.
    conserves = False
    # Acts between steps, by ``between_steps()``, after each step whose number is a multiple of
    # this; returns whether it has taken points away. 0: it does not.
    every = 0
    friction: float | None = None  # between its two `solids`, for methods with contact on the grid
    solids: tuple = ()  # that it acts between, without a group

    def __init__(self, hub: Scene, group: Any = None):
        self.hub = hub
        if group is not None:
            self.group = group

    @property
    def nodes(self) -> np.ndarray:
        """Numbers of the nodes that it acts on, of fixes that act on nodes."""
        return self.group.nodes

    def defined(self) -> None:
        """Called when the fix has its ID and belongs to the scene."""

    def seconds(self) -> float:
        """Estimate the seconds of a core that it adds to a step, for words of ``check``."""
        from_python = any(not isinstance(hook, CompiledHook) for hook in self.hooks().values())
        return FROM_PYTHON if from_python and not self.first_step_only else 0.0

    def hooks(self) -> dict[str, Any]:
        """The hooks this fix overrides: name to method or compiled hook."""
        found = {name: getattr(self, name) for name in STAGES if hasattr(self, name)}
        return {
            name: hook if isinstance(hook, CompiledHook) else self._told(name, hook)
            for name, hook in found.items()
        }

    def _told(self, name: str, hook: Callable) -> Callable:
        """`hook`, whose exceptions say where they come from."""

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
