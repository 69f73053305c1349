"""What parts of plug-ins have to bring: looked at when a script asks for one, told in one message.

Built-in parts go through the same checks.
"""

import inspect
from collections.abc import Callable, Iterator
from difflib import get_close_matches
from typing import Any

from karamelo_py.compiler.fields import columns_of
from karamelo_py.kernels import table
from karamelo_py.kernels.hooks import ACTS_ON, STAGES, CompiledHook
from karamelo_py.language.faults import fault, place_of, told
from karamelo_py.language.scene import Scene
from karamelo_py.output.fields import ABSENT_AT_POINTS, PARTICLE_NAMES
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.points.laws import columns_of as columns_of_law
from karamelo_py.points.transfers import updated_velocity
from karamelo_py.scene.modify import Fix

# Attributes that the class of a part must have.
SAID = {
    "basis": ("cells", "nodes_per_cell", "least_nodes", "steady_moment", "steep_edge"),
    "transfer": ("inverts_spread",),
    "scheme": ("rows",),
}
FAMILIES = ("initial_", "post_", "final_", "supply_")
# So much of a name has to be that of a hook.
ALIKE = 0.85


def check_fix(hub: Scene, fix: Fix) -> None:
    """Refuse a fix whose hooks or fields cannot be what its author meant.

    Raises
    ------
    ScriptError
        Naming the fix, its package and its place in the script.
    """
    name = f"fix {fix.style}"
    for what in _faults_of_hooks(fix):
        raise fault(name, what, fix.place)
    check_fields(hub, name, fix, fix.place)
    hooks = fix.hooks()
    _warn_of_names(hub, fix)
    measures = type(fix).refresh is not Fix.refresh
    if not (fix.for_method or hooks or measures):
        hub.warn(f"fix {fix.style} has no hook and no refresh: it does nothing")
    said = type(fix).published is not Fix.published and fix.published
    silent = all(isinstance(hook, CompiledHook) and not hook.publishes for hook in hooks.values())
    if hooks and silent and said and not measures:
        hub.warn(
            f"{name} says in `published` that it publishes, and none of its hooks does: "
            f"{fix.id}_{fix.published[0]} will stay 0".replace("_ ", " "),
            hint="its author writes publishes=True to the hook, or published = ()",
        )


def _faults_of_hooks(fix: Fix) -> Iterator[str]:
    """What is wrong with the hooks of a fix."""
    compiled = {}
    acts = next((moment for moment in STAGES if hasattr(fix, moment)), None)
    if acts and fix.group is None and not fix.for_method:
        yield (
            f"{acts} acts on a group, and the fix has none: its __init__ has to call "
            f"super().__init__(hub, group){place_of(type(fix).__init__)}"
        )
    for moment in STAGES:
        hook = getattr(fix, moment, None)
        if isinstance(hook, CompiledHook):
            compiled[moment] = hook
        elif hook is not None and not callable(hook):
            yield f"{moment} is neither a method nor a compiled hook"
        elif hook is not None and not _takes(hook, 1):
            yield f"{moment} has to take one argument, the view of the group"
    for moment, hook in compiled.items():
        if hook.where != ACTS_ON[moment]:
            yield (
                f"{moment} is a moment of {ACTS_ON[moment]}, and its hook was made for {hook.where}"
            )
        takes, gives = len(hook.signature.args), len(hook.signature.return_type)
        if not _takes(hook.function, takes):
            yield (
                f"{moment}: {hook.function.__name__} has to take the {takes} arguments of a hook "
                f"on {hook.where}: {', '.join(inspect.signature(hook.function).parameters)} "
                "is what it takes"
            )
        given = _tried(fix, moment, hook.function, takes)
        if given is not None and (not isinstance(given, tuple) or len(given) != gives):
            yield f"{moment}: {hook.function.__name__} has to return {gives} numbers, not {given!r}"
    if compiled and not fix.formulas:
        yield (
            f"it has no formulas, so {next(iter(compiled))} would act in no direction: its author "
            "sets self.formulas, one for each direction"
        )
    if compiled and len(fix.formulas) > 3:
        yield "it has more formulas than there are directions, three"


def _takes(function: Callable, count: int) -> bool:
    """Whether a function can be called with so many arguments."""
    function = getattr(function, "py_func", function)
    try:
        inspect.signature(function).bind(*range(count))
    except TypeError:
        return False
    except ValueError:  # it has no signature
        return True
    return True


def _tried(fix: Fix, moment: str, function: Callable, count: int) -> Any:
    """What a compiled hook gives for ones; None where it divides by zero or the like."""
    with told(f"fix {fix.style}", moment, function, fix.place):
        try:
            return function(*[1.0] * count)
        except (ArithmeticError, ValueError):
            return None


def _warn_of_names(hub: Scene, fix: Fix) -> None:
    """Tell of methods that look like hooks and are none."""
    for name in dir(type(fix)):
        if hasattr(Fix, name) or name in STAGES or name.startswith("_"):
            continue
        own = getattr(type(fix), name)
        if not callable(own) and not isinstance(own, CompiledHook):
            continue
        close = get_close_matches(name, STAGES, 1, 0.0 if name.startswith(FAMILIES) else ALIKE)
        if close:
            hub.warn(
                f"fix {fix.style} has a method {name}, which is no hook and is never called by a "
                "step",
                hint=f"its author meant {close[0]}, or begins the name with _",
            )


def check_part(hub: Scene, name: str, part: Any) -> None:
    """Refuse a transfer, basis, method or scheme of which something is missing.

    Parameters
    ----------
    hub
        The scene.
    name
        Family and style: ``basis smooth``.
    part
        What the style made.
    """
    family, kind = name.partition(" ")[0], type(part)
    missing = [attribute for attribute in SAID.get(family, ()) if not hasattr(kind, attribute)]
    if missing:
        raise fault(name, f"{kind.__name__} has no attribute {', '.join(missing)}", hub.place)
    if family == "transfer" and not updated_velocity.defined(kind):
        raise fault(name, f"updated_velocity is not defined for {kind.__name__}", hub.place)
    if family == "scheme":
        known = (
            table.AtPoints, table.AtNodes, table.Gather, table.Scatter,
            table.NodeTask, table.SceneTask, table.Check,
        )  # fmt: skip
        for row in kind.rows:
            if not isinstance(row, known):
                raise fault(name, f"{row!r} in its rows is not a row of a scheme", hub.place)
        if not any(isinstance(row, table.Scatter) for row in kind.rows):
            raise fault(name, "none of its rows is a Scatter: nothing reaches the grid", hub.place)
    check_fields(hub, name, part, hub.place)


def check_fields(hub: Scene, name: str, owner: Any, place: Any) -> None:
    """Refuse fields that are declared wrongly, or whose columns mean something else."""
    for attribute in ("point_fields", "node_fields"):
        kinds = getattr(owner, attribute, ())
        if not isinstance(kinds, tuple):
            what = f"{attribute} has to be a tuple of classes, as in ({_shown(kinds)},)"
            raise fault(name, what, place)
        for kind in kinds:
            for what in _faults_of_field(kind):
                raise fault(name, f"the field {_shown(kind)} {what}", place)
            with told(name, f"the field {kind.__name__}", kind, place):
                what = _wrong_size(kind, hub.domain)
            if what:
                raise fault(name, f"the field {kind.__name__}: {what}", place)
    for kind in getattr(owner, "point_fields", ()):
        for column in columns_of(kind):
            shows = _shows(hub, column, kind)
            if shows:
                raise fault(name, f"{kind.__name__}: the column '{column}' is {shows}", place)


def check_columns(hub: Scene, name: str, law: Any) -> None:
    """Refuse a law, or a part of one, that shows a number under a name that is in use."""
    for column in columns_of_law(law):
        if column in PARTICLE_NAMES and column not in ABSENT_AT_POINTS:
            raise fault(name, f"the column '{column}' is one of every scene", hub.place)
        if column in hub.fields.declared_columns():
            kind = hub.fields.declared_columns()[column][0].__name__
            raise fault(name, f"the column '{column}' is one of the field {kind}", hub.place)


def _faults_of_field(kind: Any) -> Iterator[str]:
    if not (inspect.isclass(kind) and issubclass(kind, tuple) and hasattr(kind, "_fields")):
        yield "is not a NamedTuple class"
    elif kind._fields != ("array",):
        yield "has to have one member, array: Any"
    elif not callable(getattr(kind, "shape", None)):
        yield "has no shape: scalar, vector, tensor or planar"
    elif not isinstance(columns_of(kind), tuple):
        yield f"has columns that are no tuple of words, as in ({columns_of(kind)!r},)"


def _wrong_size(kind: type, domain: Any) -> str | None:
    """What is wrong with the number of components, in the dimensions that the scene may have."""
    for dimension in [domain.dimension] if domain else KINEMATICS:
        kin = KINEMATICS[dimension]()
        size, start = kind.shape(kin), getattr(kind, "start", 0.0)
        if not isinstance(size, int) or size < 1:
            return f"its shape gives {size!r}, not a number of components"
        if callable(start) and len(start(kin)) != size:
            return f"it starts from {len(start(kin))} numbers and has {size} components"
    return None


def _shows(hub: Scene, column: str, kind: type) -> str | None:
    """What a column shows already, if that is not this field."""
    if column in PARTICLE_NAMES and column not in ABSENT_AT_POINTS:
        return "one of every scene"
    if column in hub.fields.columns_of_laws():
        return "one of a material"
    other = hub.fields.declared_columns().get(column, (kind, 0))[0]
    return None if other is kind else f"one of the field {other.__name__}"


def _shown(kind: Any) -> str:
    return getattr(kind, "__name__", repr(kind))
