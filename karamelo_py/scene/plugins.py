"""Checks of styles, and exceptions of plug-ins."""

import inspect
import linecache
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

from karamelo_py.compiler import Undefined, places_of
from karamelo_py.compiler.fields import Field, fields_of
from karamelo_py.kernels import table
from karamelo_py.kernels.equations.heat import Supply
from karamelo_py.kernels.equations.internal_force import Force, WorkOfForces
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.hooks import (
    ACTS_ON,
    NODE_WORDS,
    NODE_WRITES,
    STAGES,
    WHOLE_NODES,
    WHOLE_POINTS,
    WORDS,
    CompiledHook,
)
from karamelo_py.kernels.step import untaken
from karamelo_py.language import faults, registry
from karamelo_py.language.scene import Scene
from karamelo_py.output import node_columns, point_table
from karamelo_py.output.point_table import declared_columns
from karamelo_py.points import laws
from karamelo_py.points.basis import BasisTraits
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.points.laws import LawTraits, law_traits
from karamelo_py.points.transfers import (
    Moment,
    TransferTraits,
    add_moment,
    updated_velocity,
    zero_moment,
)
from karamelo_py.scene.modify import Fix
from karamelo_py.schemes.traits import SchemeTraits
from karamelo_py.script.errors import FAILURES, Mark
from karamelo_py.script.values import in_a_row

SAID = {"basis": ("traits",), "transfer": ("traits",), "scheme": ("rows", "traits")}
TRAITS = {"basis": BasisTraits, "transfer": TransferTraits, "scheme": SchemeTraits}
COLUMNS: dict[str, Any] = {"point_fields": point_table.COLUMNS, "node_fields": node_columns.COLUMNS}
HOOKS_BEGIN = ("initial_", "post_", "final_", "supply_")
ALIKE = 0.85  # similarity above which a method is reported as a misspelt hook


def check_fix(hub: Scene, fix: Fix) -> None:
    name = f"fix {fix.style}"
    for error in _wrong_hooks(fix):
        raise faults.fault(name, error, fix.mark)
    check_fields(hub, name, fix, fix.mark)
    hooks = fix.hooks()
    for method in dir(type(fix)):
        other = hasattr(Fix, method) or method in STAGES or method.startswith("_")
        attribute = getattr(type(fix), method)
        if other or not (callable(attribute) or isinstance(attribute, CompiledHook)):
            continue
        least = 0.0 if method.startswith(HOOKS_BEGIN) else ALIKE
        stages = [stage for stage in STAGES if "heat" in method or "heat" not in stage]
        for close in get_close_matches(method, stages, 1, least):
            hub.warn(
                f"{name} has a method {method}, which is not a hook, and no step calls it",
                hint=f"in the plug-in, rename it to {close}, or begin the name with _",
            )
    measures = type(fix).refresh is not Fix.refresh
    if not (fix.for_method or hooks or measures or fix.every):
        hub.warn(
            f"{name} has no effect: no step calls it, and it measures nothing",
            hint="in the plug-in, define a hook, such as post_particles_to_grid, or refresh",
        )
    said = type(fix).published is not Fix.published and fix.published
    silent = all(isinstance(hook, CompiledHook) and not hook.publishes for hook in hooks.values())
    if hooks and silent and said and not measures:
        hub.warn(
            f"{name} has names in `published`, but none of its hooks publishes: "
            f"{fix.id}_{fix.published[0]} will stay 0".replace("_ ", " "),
            hint="in the plug-in, make the hook with publishes=True, or set published = ()",
        )


def _wrong_hooks(fix: Fix) -> Iterator[str]:
    hooks = {moment: getattr(fix, moment) for moment in STAGES if hasattr(fix, moment)}
    if hooks and fix.group is None and not fix.for_method:
        yield (
            f"{next(iter(hooks))} acts on a group, but the fix has none: its __init__ has to call "
            f"super().__init__(hub, group){faults.place_of(type(fix).__init__)}"
        )
    compiled = {m: h for m, h in hooks.items() if isinstance(h, CompiledHook)}
    compiled = {m: hook for m, hook in compiled.items() if not hook.internal}
    for moment, hook in hooks.items():
        if isinstance(hook, CompiledHook):
            continue
        if not callable(hook):
            yield f"{moment} is neither a method nor a compiled hook"
        elif misfit(hook, 1):
            yield f"{moment} has to take one argument, the view of the group"
    for moment, hook in compiled.items():
        acts_on, whole = ACTS_ON[moment], hook.where in (WHOLE_NODES, WHOLE_POINTS)
        name = getattr(hook.function, "__name__", "")
        if not name or (whole and hook.tag is None):
            unnamed = name or type(hook.function).__name__
            yield f"{moment} takes a function with a name (def name(...): ...), not a {unnamed}"
            continue
        at_own = moment in NODE_WRITES if hook.where == WHOLE_NODES else acts_on != "nodes"
        if hook.where != acts_on and not (whole and at_own):
            yield f"{moment} is a stage of {acts_on}, but its hook was made for {hook.where}"
        function = hook.function
        takes = len(hook.reads) + 2 if whole else 1
        if misfit(function, takes):
            signature = ", ".join(inspect.signature(function).parameters)
            many = f"{takes} arguments" if whole else "one argument"
            yield (
                f"{moment}: {function.__name__} has to take the {many} of a hook on "
                f"{hook.where}, not {signature}"
            )
        if whole:
            yield from _wrong_items(fix, moment, hook)
            if hook.publishes and not in_a_row(fix.published):
                yield (
                    f"{moment} publishes several numbers, and published = {fix.published} has to "
                    "be a part of x, y, z, s, '' in that order, or other names"
                )
            continue
        gives = len(hook.signature.return_type)
        with faults.as_script_error(f"fix {fix.style}", moment, function, fix.mark):
            try:
                result = function(*[1.0] * len(hook.signature.args))
            except (ArithmeticError, ValueError):
                continue
        if not isinstance(result, tuple) or len(result) != gives:
            yield f"{moment}: {function.__name__} has to return {gives} numbers, not {result!r}"
    directed = [moment for moment, hook in compiled.items() if hook.tag is None]
    if directed and not fix.formulas:
        yield (
            f"it has no formulas, so {directed[0]} would act in no direction: its author "
            "sets self.formulas, one for each direction"
        )
    if compiled and len(fix.formulas) > 3:
        yield "it has more formulas than there are directions, three"


def _wrong_items(fix: Fix, moment: str, hook: CompiledHook) -> Iterator[str]:
    readable, fields, written_too = WORDS, fix.point_fields, "velocity"
    if hook.on_nodes:
        readable, fields = NODE_WORDS, fix.node_fields
        written_too = NODE_WRITES.get(moment, "force")
    else:
        fields = (*fields, *Conducting.point_fields)
    words = ", ".join(repr(word) for word in readable)
    for item in (*hook.reads, *hook.writes):
        written = item in hook.writes
        if isinstance(item, type):
            if item not in fields:
                of = "node" if hook.on_nodes else "point"
                yield (
                    f"{moment}: {of}s have no {_shown(item)} because of this fix: its author "
                    f"names it in {of}_fields"
                )
            if written and item is Force and moment != "initial_integrate":
                yield f"{moment}: forces on points are set in initial_integrate"
            if written and item is Supply and moment != "supply_heat":
                yield f"{moment}: heat is supplied in supply_heat"
            if written and item is Force and WorkOfForces not in fix.point_fields:
                yield f"{moment}: point_fields has to have Force and WorkOfForces"
        elif written and item != written_too:
            yield f"{moment} writes {item!r}: '{written_too}' or a class of a field"
        elif item not in readable and (hook.on_nodes or not callable(item)):
            laws = "" if hook.on_nodes else ", or a function of laws"
            yield f"{moment} reads {item!r}: {words}, a class of a field{laws}"


def misfit(function: Callable, count: int) -> str:
    """Return the reason why a function cannot be called with `count` arguments, or ""."""
    try:
        inspect.signature(getattr(function, "py_func", function)).bind(*range(count))
    except TypeError as error:
        return str(error)
    except ValueError:
        pass
    return ""


def check_part(hub: Scene, name: str, plugin: Any) -> None:
    family, kind = name.partition(" ")[0], type(plugin)
    missing = [attribute for attribute in SAID.get(family, ()) if not hasattr(kind, attribute)]
    error = f"{kind.__name__} has no attribute {', '.join(missing)}" if missing else ""
    if family in TRAITS and not error:
        error = _wrong_traits(kind, kind.traits, TRAITS[family])
    if family == "transfer" and not updated_velocity.defined(kind):
        error = error or f"updated_velocity is not defined for {kind.__name__}"
    if family == "transfer" and add_moment.defined(kind) and not zero_moment.defined(kind):
        error = error or f"{kind.__name__} defines add_moment, but not zero_moment"
    if family == "scheme" and not error:
        strange = [row for row in kind.rows if untaken([row], table.Processor)]
        if strange:
            error = f"{strange[0]!r} in its rows is not a row of a scheme"
        elif not any(isinstance(row, table.Scatter) for row in kind.rows):
            error = "none of its rows is a Scatter: nothing reaches the grid"
    if error:
        raise faults.fault(name, error, hub.mark)
    check_fields(hub, name, plugin, hub.mark)
    stored = any(issubclass(field, Moment) for field in fields_of(plugin, "point_fields"))
    if zero_moment.defined(kind) and not stored:
        raise faults.fault(name, "it defines zero_moment: add Moment to point_fields", hub.mark)


def _wrong_traits(kind: type, traits: object, wanted: type) -> str:
    if not isinstance(traits, wanted):
        return f"its traits are {traits!r}, and no {wanted.__name__}(...)"
    names = wanted._fields  # type: ignore[attr-defined]
    fields = kind._fields if issubclass(kind, tuple) else ()  # type: ignore[attr-defined]
    for name in sorted(set(dir(kind)) - {"traits", *fields}):
        close = [] if name.startswith("_") else get_close_matches(name, names, 1, ALIKE)
        if close:
            return f"{name} is one of its traits: traits = {wanted.__name__}({close[0]}=...)"
    return ""


def check_fields(hub: Scene, name: str, owner: object, mark: Mark | None) -> None:
    for attribute in ("point_fields", "node_fields"):
        kinds = fields_of(owner, attribute)
        if not isinstance(kinds, tuple):
            error = f"{attribute} has to be a tuple of classes, as in ({_shown(kinds)},)"
            raise faults.fault(name, error, mark)
        for kind in kinds:
            field = f"the field {_shown(kind)}"
            with faults.as_script_error(name, field, kind, mark):
                error = _wrong_field(kind) or _wrong_size(kind, hub.domain)
            if error:
                raise faults.fault(name, f"{field}{error}", mark)
            for column in kind.columns:
                if shows := _shows(hub, column, kind, attribute):
                    error = f"{kind.__name__}: the column '{column}' is {shows}"
                    raise faults.fault(name, error, mark)


def check_law(hub: Scene, name: str, law: NamedTuple) -> None:
    kind = type(law)
    if registry.is_foreign(kind) and (error := _wrong_traits(kind, law_traits(law), LawTraits)):
        raise faults.fault(name, error, hub.mark)
    for column in laws.columns_of(law):
        if shows := _shows(hub, column, None):
            raise faults.fault(name, f"the column '{column}' is {shows}", hub.mark)


def _wrong_field(kind: Any) -> str:
    is_field = inspect.isclass(kind) and issubclass(kind, Field)
    if not is_field:
        return " is not derived from Field"
    if not isinstance(kind.columns, tuple):
        return f" has columns that are not a tuple of words, as in ({kind.columns!r},)"
    return ""


def _wrong_size(kind: type[Field], domain: Any) -> str:
    for dimension in [domain.dimension] if domain else KINEMATICS:
        kin = KINEMATICS[dimension]()
        size, start = kind.shape(kin), kind.start
        if not isinstance(size, int) or size < 1:
            return f": its shape gives {size!r}, not a number of components"
        if callable(start) and len(start(kin)) != size:
            return f": it starts from {len(start(kin))} numbers and has {size} components"
    return ""


def _shows(hub: Scene, column: str, kind: type | None, where: str = "point_fields") -> str:
    """Return the part that already shows `column`, or ""; `kind` is its field, None for a law."""
    if COLUMNS[where].get(column) is not None:
        return "one of every scene"
    if kind is not None and where == "point_fields" and column in hub.fields.columns_of_laws():
        return "one of a material"
    other = declared_columns(hub, where).get(column, (kind, 0))[0]
    return "" if other in (None, kind) else f"one of the field {other.__name__}"


def _shown(kind: object) -> str:
    return kind.__name__ if isinstance(kind, type) else repr(kind)


class PartInUse(NamedTuple):
    name: str
    kind: type
    mark: Mark | None


def foreign_parts(hub: Scene) -> list[PartInUse]:
    update, method = hub.update, hub.update.method
    parts = [
        PartInUse(f"{of.kind} {item.style}", type(item), item.mark)
        for of in (hub.fixes, hub.computes, hub.dumps)
        for item in of.values()
    ]
    parts += [
        PartInUse(f"{item.kind} {item.style}", type(item.laws[item.kind]), item.mark)
        for of in (hub.materials, *hub.parts.values())
        for item in of.values()
    ]
    tags = [("scheme", update.scheme, update.scheme_mark)]
    if method is not None:
        tags_of_method = {"transfer": update.transfer, "basis": method.basis, "method": method}
        tags = [*((family, tag, method.mark) for family, tag in tags_of_method.items()), *tags]
    parts += [
        PartInUse(f"{family} {registry.name_of(family, type(tag))}", type(tag), mark)
        for family, tag, mark in tags
        if registry.is_foreign(type(tag))
    ]
    return [plugin for plugin in parts if registry.is_foreign(plugin.kind)]


@contextmanager
def attributed(hub: Scene, usual: PartInUse | None = None) -> Iterator[None]:
    """Convert exceptions in plug-ins to ScriptErrors that name the plug-in, or the part `usual`."""
    try:
        yield
    except faults.KNOWN:
        raise
    except FAILURES as error:
        foreign = foreign_parts(hub)
        if isinstance(error, Undefined):
            suspects = [(plugin, "") for plugin in foreign if plugin.kind in error.classes]
        else:
            places = [(_owner(foreign, f), f" ({Path(f).name}:{k})") for f, k in places_of(error)]
            suspects = [(plugin, mark) for plugin, mark in places if plugin is not None]
        suspects += [(usual, "")] if usual else []
        if not suspects:
            raise
        plugin, mark = suspects[0]
        if not (mark or isinstance(error, Undefined)):  # mark the calling line of the script
            mark = f", in '{linecache.getline(*next(places_of(error))).strip()}'"
        cause = f"{faults.cause_of(error)}{mark}"
        raise faults.fault(plugin.name, cause, plugin.mark, faults.TRACEBACK) from error


def _owner(parts: list[PartInUse], file: str) -> PartInUse | None:
    path = Path(file).resolve()
    for plugin in parts:
        with suppress(TypeError, OSError):  # built-in functions have no source
            if Path(inspect.getfile(plugin.kind)).resolve() == path:
                return plugin
    for plugin in parts:
        package = sys.modules.get(plugin.kind.__module__.partition(".")[0])
        folders = getattr(package, "__path__", ())
        if any(path.is_relative_to(Path(folder).resolve()) for folder in folders):
            return plugin
    return None
