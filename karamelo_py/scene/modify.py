"""Base classes of fixes and computes (Modify in LAMMPS and Karamelo).

A fix overrides hooks, which are named as in Karamelo (docs/plugins.md). A hook is a method, called
with a view of the group at one stage of each step, or a compiled hook made by :func:`node_hook`,
:func:`point_hook` or :func:`vector_hook`.
"""

from collections.abc import Callable, Iterator, Sequence
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
from karamelo_py.language.rules import Restrictions
from karamelo_py.language.scene import Scene
from karamelo_py.output.units import NUMBER
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.views import NodesView, PointsView
from karamelo_py.script.errors import Mark, ScriptError, plural
from karamelo_py.script.expressions import Expression
from karamelo_py.script.values import SUFFIXES

__all__ = [
    "Compute",
    "Fix",
    "InitialFix",
    "NodesView",
    "PointsView",
    "heat_hook",
    "node_hook",
    "per_direction",
    "point_hook",
    "vector_hook",
]


FIRST, USUAL, LAST = range(3)  # order of fixes within a stage; USUAL: as in the script
FROM_PYTHON = 3e-4  # cost of a call of a Python hook, seconds


class Publisher:
    """Base of fixes and computes: publishes values under its ID."""

    hub: Scene
    id: str = ""
    style: str = ""
    mark: Mark | None = None
    columns: Sequence[str] = ()  # dump columns that the class reads
    # Suffixes of published values: "x" for ``ID_x``, "" for ``ID``.
    published: tuple[str, ...] = SUFFIXES
    has_published = False
    unit = NUMBER  # unit of the published values
    # Declared fields (`compiler.fields`); `Force` if ``initial_integrate`` sets forces on points.
    point_fields: tuple[type, ...] = ()
    node_fields: tuple[type, ...] = ()
    restrictions: Restrictions | None = None  # options of a scene that are not supported

    def publish(self, name: str, value: float) -> None:
        if name not in self.published:
            raise ValueError(f"'{name}' is not in {type(self).__name__}.published")
        self.has_published = True
        self.hub.values.set(f"{self.id}_{name}" if name else self.id, float(value))

    def publish_components(self, vector: np.ndarray) -> None:
        for name, value in zip("xyz", vector, strict=False):
            if name in self.published:
                self.publish(name, value)

    def publish_all(self, *values: float) -> None:
        for name, value in zip(self.published, values, strict=False):
            self.publish(name, value)

    def refresh(self) -> None:
        """Update the values before output."""


def _formulas_in(value: Any) -> Iterator[Expression]:
    if isinstance(value, Expression):
        yield value
    elif isinstance(value, (tuple, list)):
        for item in value:
            yield from _formulas_in(item)


def moved(hub: Scene) -> dict[Any, "Fix"]:
    return {fix.moves: fix for fix in hub.fixes.values() if fix.moves is not None}


class Fix(Publisher):
    """Base of fixes, which act on a `group` during a run. Class attributes are traits."""

    group: Any = None
    formulas: tuple = ()  # for compiled hooks: one formula or None per component
    values_of_time: tuple = ()  # further formulas of a compiled hook, of time alone
    components: tuple = ()  # for a force in Python: a formula or None per direction
    first_step_only = False  # acts only in the first step after its definition
    # True: Python hooks treat each point or node separately and move none. Hooks then get the
    # points of this process in any order; before the first step, they get them in several calls.
    # Sums need ``total``.
    point_by_point = False
    for_method = False  # the method acts for the fix, which has no hooks
    # Prescribes nodal velocities in ``post_update_grid_state``, in directions with a formula.
    # Contact does not change these velocities.
    prescribes_velocity = False
    prescribes_rotation = False  # prescribes the angular velocity of nodes, whose torque is ID_s
    # Directions in which nodes are held or bounded. Splines change at faces with all nodes held.
    held_directions: tuple[int, ...] = ()
    # Friction coefficient (formula) of this wall in directions without a formula, or None.
    wall_friction: Any = None
    by_sizes = False  # computes point sizes from volumes, for a thickness of 1
    impulsive = False  # removes a penetration in a single step
    leads_points = False  # prescribes velocities of points
    reads_itself = False  # formulas may contain values that this fix publishes
    moves: Any = None  # rigid solid that this fix moves by the forces on it
    touches: Any = None  # rigid solid that is in contact with points
    links = False  # True for a contact or joint between rigid bodies
    ignites = False
    follows_points = False  # the force depends on positions of points (tools)
    depth_of: Any = None  # function: depth (n,) of positions in a tool, for outlines in pictures
    faces_of: Any = None  # function: present faces (m, d, d) of a tool or a body
    accelerates = False  # formulas are forces per unit mass
    exerts = False  # publishes a force as ID_x, ID_y, ID_z and, if used, the torque of this force
    pressure: Any = None  # formula of a pressure on whole surfaces; None for other fixes
    presses = False  # exerts the force of a surface on points
    brakes = False
    water_only = False  # prescribes the pressure of pore water
    order = USUAL  # FIRST or LAST at each stage, regardless of the order in the script
    # True: Python hooks do no work, or all of it is summed. False: the energy is not monitored.
    conserves = False
    # Steps between calls of ``between_steps()`` (0: none), which returns True if it deleted points.
    every = 0
    friction: float | None = None  # between the two `solids`, in contact on the grid
    solids: tuple = ()  # solids of a fix without a group

    def __init__(self, hub: Scene, group: Any = None):
        self.hub = hub
        if group is not None:
            self.group = group

    @property
    def all_formulas(self) -> list[Expression]:
        return list(_formulas_in(tuple(vars(self).values())))

    def undefined(self) -> tuple[str, str] | None:
        """Return what makes a shape undefined at present, and what is expected; or None."""
        return None

    def is_endless(self, axis: int) -> bool:
        """True if a tool is the same at all positions along an axis."""
        return False

    @property
    def of_rigid_points(self) -> bool:
        soft = (solid for solid in self.hub.solids.values() if not solid.rigid)
        return isinstance(self.group, ParticleGroup) and not any(map(self.group.touches, soft))

    @property
    def of_bodies(self) -> bool:
        """True if the fix moves, touches or links rigid bodies."""
        return self.moves is not None or self.touches is not None or self.links

    @property
    def nodes(self) -> np.ndarray:
        return self.group.nodes

    def prescribed(self, nodes: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return a mask (m, k) of prescribed components of `nodes` at `x` (m, d), and their values.

        Implicit schemes call this instead of the hooks of the fix. The default reads `formulas`.
        """
        acts = np.isin(nodes, self.nodes)
        mask = np.outer(acts, [formula is not None for formula in self.formulas])
        values, x = np.zeros(mask.shape), x[acts]
        for k, formula in enumerate(self.formulas):
            if formula is not None:
                values[acts, k] = formula.evaluate_points(self.hub.values, x, x)
        return mask, values

    def points_within(self) -> np.ndarray | None:
        """Return the numbers of the points on which the fix acts, or None for its whole group."""
        return None

    def defined(self) -> None:
        """Called after the fix has got its ID."""

    def deleted(self) -> None:
        """Called before the fix is deleted; raises ScriptError if other fixes need it."""

    def seconds(self) -> float:
        """Return the estimated time per step on one core, in seconds, for ``check``."""
        from_python = any(not isinstance(hook, CompiledHook) for hook in self.hooks().values())
        return FROM_PYTHON if from_python and not self.first_step_only else 0.0

    def hooks(self) -> dict[str, Any]:
        hooks = {name: getattr(self, name) for name in STAGES if hasattr(self, name)}
        return {
            name: hook if isinstance(hook, CompiledHook) else self._attributed(name, hook)
            for name, hook in hooks.items()
        }

    def _attributed(self, name: str, hook: Callable) -> Callable:
        @wraps(hook)
        def call(view: Any) -> None:
            with as_script_error(f"fix {self.style}", name, type(self), self.mark):
                hook(view)
                view.write_back()

        return call


class InitialFix(Fix):
    """Base of fixes that set a value of each point or node once, in the next step."""

    published = ()
    first_step_only = True
    point_by_point = True


AROUND = (
    "twist=true: force_nodes, force_particles, body_force, edge_traction and "
    "initial_velocity_particles have a component around the axis; fix angular_velocity_nodes holds "
    "and rotates nodes"
)


def _is_nothing(formula: Expression | None) -> bool:
    return formula is None or (formula.is_constant and formula.constant == 0)


def per_direction(
    hub: Scene, name: str, formulas: Sequence, *, all_given: bool = False, around: bool = False
) -> tuple:
    """Check that there is one formula (or NULL, unless `all_given`) per direction of the domain.

    Components beyond the dimension may be NULL or 0, as in published scripts. With `around`, the
    third component acts around the axis of bodies that twist.
    """
    domain = hub.require_domain()
    d, twists = domain.dimension, isinstance(domain.kin, Twisted)
    if around and twists and len(formulas) == 3 and not _is_nothing(formulas[2]):
        d = 3
    axes = "xyz"[:d]
    wanted = ", ".join(name + axis for axis in axes)
    if len(formulas) < d:
        raise ScriptError(
            f"{plural(len(formulas), 'component')} in {plural(d, 'dimension')}",
            expected=wanted + " (NULL does not act on a component)" * (not all_given),
            code="arguments",
        )
    if len(formulas) > 3:
        message = f"{len(formulas)} components, but there are at most 3 directions"
        surplus = len(formulas) - d
        raise ScriptError(message, argument=3 - len(formulas), expected=wanted, surplus=surplus)
    for k, extra in enumerate(formulas[d:], d - len(formulas)):
        if not _is_nothing(extra):
            last = ": gravity is a component of it" * (name == "b")
            hint = f"the last direction here is {axes[-1]}{last}"
            if twists:
                hint = AROUND
            elif around and domain.kin.hoops == 1 and d == 2:
                hint = "around the axis it acts with axisymmetric(true, twist=true)"
            raise ScriptError(
                f"more components than the {plural(d, 'dimension')} of the domain",
                argument=k,
                expected=f"{wanted} (a further one may only be NULL or 0)",
                hint=hint,
            )
    if all(formula is None for formula in formulas[:d]):
        hub.warn("all components are NULL: it has no effect")
    return tuple(formulas[:d])


class Compute(Publisher):
    """Base of computes, which measure a `group` of points in `refresh`."""

    def __init__(self, hub: Scene, group: ParticleGroup):
        self.hub = hub
        self.group = group
