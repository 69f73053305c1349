"""Fixes that act from Python in a step: their hooks, beside the compiled ones."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import INITIAL_INTEGRATE, ON_VELOCITY, SUPPLY_HEAT, Setup
from karamelo_py.kernels.heat import at_heat_nodes, at_heated_points
from karamelo_py.kernels.hook_loop import at_nodes, at_points
from karamelo_py.kernels.hooks import STAGES, CompiledHook
from karamelo_py.run.lower.hook_tables import lower_hooks
from karamelo_py.scene.views import NodesView, PieceView, PointsView
from karamelo_py.script.errors import ScriptError


def sets_initial_state(fix: Any) -> bool:
    """Tell whether all a fix does is a hook in Python before the first step."""
    hooks = fix.hooks()
    return set(hooks) == {"initial_integrate"} and not isinstance(
        hooks["initial_integrate"], CompiledHook
    )


class PythonHooks:
    """Hooks of a step when some fixes act from Python: theirs, and the compiled ones."""

    def __init__(self, simulation: Any, fixes: list):
        self.simulation = simulation
        self.compiled = lower_hooks(simulation.hub, fixes, simulation.mode, simulation.threads)
        self.by_stage: dict[int, list[tuple[Any, Callable]]] = {}
        for fix in fixes:
            for name, hook in fix.hooks().items():
                if not isinstance(hook, CompiledHook):
                    self.by_stage.setdefault(STAGES[name], []).append((fix, hook))

    def act(self, function: Callable, s: Setup, stage: int, *arguments: Any) -> None:
        """Call what acts from Python on a setup: the own one where that is enough for all."""
        if all(fix.point_by_point for fix, _ in self.by_stage[stage]):
            function(self, s, stage, *arguments)
        else:
            self.simulation.act(lambda whole: function(self, whole, stage, *arguments), s)


def _call(simulation: Any, fix: Any, hook: Callable, view: Any) -> None:
    """Call a hook; of one that each process calls for its own, see that all agree."""
    try:
        hook(view)
        if fix.point_by_point:
            _agree(simulation, fix)
    except ScriptError as error:
        error.place = error.place or fix.place
        raise


def _agree(simulation: Any, fix: Any) -> None:
    """See that all processes have asked for the same, and have published the same.

    Otherwise one would wait for the others for ever, or the values would be those of a part.
    """
    values = simulation.hub.values
    names = (f"{fix.id}_{name}" if name else fix.id for name in fix.published)
    own = {name: values.get(name) for name in names if name in values}
    first, *others = simulation.everyone("its end", own)
    for other in others:
        name = next((name for name in first if repr(first[name]) != repr(other[name])), None)
        if name is not None:
            raise ScriptError(
                f"fix {fix.style}: {name} is {first[name]:.6g} on one process and "
                f"{other[name]:.6g} on another",
                hint=f"tell the author of {fix.style}: point_by_point, each has a part of the "
                "points; points.total(terms) and nodes.total(terms) are sums over all",
            )


def _on_nodes(hooks: PythonHooks, s: Setup, stage: int, target: int) -> None:
    for fix, hook in hooks.by_stage[stage]:
        before = target == ON_VELOCITY
        view = NodesView(hooks.simulation, s, fix.group, stage, before_update=before)
        _call(hooks.simulation, fix, hook, view)


def _on_heat_nodes(hooks: PythonHooks, s: Setup, stage: int, target: int) -> None:
    # A temperature is to a capacity what a velocity is to a mass: the same view shows it.
    nodes = s.heat.nodes._replace(fields=s.nodes.fields)
    _on_nodes(hooks, s._replace(nodes=nodes), stage, target)


def _on_points(hooks: PythonHooks, s: Setup, stage: int, then: int) -> None:
    for fix, hook in hooks.by_stage[stage]:
        view = view_of(hooks.simulation, fix, then=bool(then))
        _call(hooks.simulation, fix, hook, view)
        if view.moved and stage == INITIAL_INTEGRATE:
            hooks.simulation.sort()
        elif view.moved:
            s.control.clock[0].drift = np.inf


@at_nodes.on(PythonHooks)
def _at_nodes_python_hooks(hooks, stage, target, s):
    at_nodes(hooks.compiled, stage, target, s)
    if stage in hooks.by_stage:
        hooks.act(_on_nodes, s, stage, target)


@at_points.on(PythonHooks)
def _at_points_python_hooks(hooks, stage, then, s):
    if stage == INITIAL_INTEGRATE and hooks.simulation.taken_up:
        hooks.simulation.taken_up = False
        return
    at_points(hooks.compiled, stage, then, s)
    if stage == INITIAL_INTEGRATE:
        hooks.simulation.clear_forces()
    if stage in hooks.by_stage:
        hooks.act(_on_points, s, stage, then)


@at_heat_nodes.on(PythonHooks)
def _at_heat_nodes_python_hooks(hooks, stage, target, s):
    at_heat_nodes(hooks.compiled, stage, target, s)
    if stage in hooks.by_stage:
        hooks.act(_on_heat_nodes, s, stage, target)


@at_heated_points.on(PythonHooks)
def _at_heated_points_python_hooks(hooks, s):
    at_heated_points(hooks.compiled, s)
    if SUPPLY_HEAT in hooks.by_stage:
        hooks.act(_on_points, s, SUPPLY_HEAT, 0)


def view_of(simulation: Any, fix: Any, *, then: bool) -> PointsView:
    """Show the points of a fix, or those of them that are at hand."""
    if fix.point_by_point:
        return PieceView(simulation, list(simulation.rows_of(fix.group)), then, in_steps=True)
    return PointsView(simulation, simulation.members(fix.group), then)


def views_of(simulation: Any, fix: Any) -> Iterator[PointsView]:
    """Yield the points of a fix before a step, in pieces where it looks at each on its own."""
    if not fix.point_by_point:
        yield view_of(simulation, fix, then=False)
        return
    for part in simulation.rows_of(fix.group):
        yield PieceView(simulation, [part], False, in_steps=False)
