"""Functions are run once, on values of the function that is compiled, and written down.

Numba makes code of a function in twenty passes, fifteen milliseconds for the smallest: half of a
first compilation. Where a kernel calls a function marked for it, it is run by Python itself, on a
:class:`~karamelo_py.compiler.values.Value` in the place of each number, and every operation that
meets one is lowered at once, into the function that calls. Tuples are Python's own, so that what
only takes them apart costs nothing. The bits are the same. A function that asks what only a run can
know (`if x > 0`) is walked through instead, statement by statement
(:mod:`~karamelo_py.compiler.walk`). What cannot be written so is refused: :class:`CannotCompile`.

Functions run here see their globals through :class:`~karamelo_py.compiler.values.Globals`: what
other code chooses by type is lowered for the types at hand, Python's functions are run in the same
way. Only what the key of a kernel on disk follows may be run
(:mod:`karamelo_py.compiler.fingerprint`): functions that come by another way than a global name or
a closure, as methods do, are refused.
"""

import dis
import functools
import inspect
import itertools
import re
import types as python
from collections.abc import Callable, Hashable, Iterable, Iterator
from traceback import walk_tb
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.errors import NumbaError, TypingError
from numba.core.imputils import impl_ret_borrowed, lower_builtin
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from karamelo_py.compiler.choices import choosers, note, parts_noted, tag_class
from karamelo_py.compiler.flow import Flow
from karamelo_py.compiler.lowering import Lowering, name_of, numbers_of, resolutions
from karamelo_py.compiler.methods import refuse_methods
from karamelo_py.compiler.values import (
    OF_REALS,
    OF_WHOLE,
    DataDependentBranch,
    Emitted,
    Globals,
    HeldValue,
    Untraceable,
    Value,
    alike,
    at_work,
    branching,
    counting,
    derivatives,
    emit,
    has_derivatives,
    is_literal,
    now,
    words,
    writing,
)
from karamelo_py.compiler.walk import Walked, place_in_text

# --- what cannot be compiled ------------------------------------------------------------------


class CannotCompile(TypeError):
    """Tell why a function cannot become code of a kernel; what was wrong is its cause."""

    def __init__(self, reason: str, function: Callable):
        super().__init__(f"{reason} (in {name_of(function)})")
        code = getattr(function, "__code__", None)
        self.begins = (code.co_filename, code.co_firstlineno) if code else ("", 0)


class Undefined(TypeError):
    """A point function is not defined for classes that need it."""

    def __init__(self, function: str, classes: tuple):
        names = ", ".join(getattr(c, "__name__", str(c)) for c in classes)
        super().__init__(f"{function} is not defined for ({names})")
        self.classes = classes


def _reason(error: BaseException) -> str:
    """What is wrong, in one line; of Numba, the cause that it gives."""
    if isinstance(error, Untraceable):
        return str(error)
    if not isinstance(error, NumbaError):
        return ": ".join(filter(None, (type(error).__name__, str(error))))
    text = re.sub(r"\x1b\[[\d;]*m", "", str(error))
    inner = text.rpartition("raised a specific error:")[2] or text
    lines = (line.strip() for line in inner.splitlines())
    causes = (line for line in lines if line and not re.match(r"(\w+: )?Failed in ", line))
    return next(causes, type(error).__name__)


def places_of(error: BaseException) -> Iterator[tuple[str, int]]:
    """Files and lines that took part in an exception, the innermost first."""
    if isinstance(error, CannotCompile):
        if error.__cause__ is not None:
            yield from places_of(error.__cause__)
        yield error.begins
    for frame, line in reversed([*walk_tb(error.__traceback__)]):
        yield place_in_text(frame) or (frame.f_code.co_filename, line)


# --- functions as they are run here -----------------------------------------------------------


_modules: dict[int, Globals] = {}
_copies: dict[Any, Any] = {}


class _Module:
    """A module, whose functions are seen like globals."""

    def __init__(self, module: python.ModuleType):
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return _seen(getattr(self._module, name))


class _Dispatched(Emitted):
    """A point function: what the classes of its tags choose."""

    def __call__(self, *arguments: Any) -> Any:
        if self.counts(arguments):
            return self.seen(*arguments)
        if self.seen in derivatives and has_derivatives(arguments):
            return now().seen(derivatives[self.seen])(*arguments)
        if self.seen in OF_REALS:
            arguments = alike(arguments)
        lowering = now()
        kinds = _kinds_of(self.seen, map(lowering.kind_of, arguments))
        found = _formula(self.seen, lowering.typing, kinds)
        if found is None:
            return emit(self.seen, *arguments)
        if self.seen in _own:
            return lowering.call_own(found.name, found.run, kinds, found.result, arguments)
        if lowering.builder is None and found.plain:
            return lowering.wrapped(found.result, None)
        return found.run(*arguments)

    def defined(self, *classes: type) -> bool:
        """Whether a point function has an implementation for these classes."""
        return self.seen.defined(*classes)


def _class_of(thing: Any) -> type:
    if isinstance(thing, Value):
        raise Untraceable("a kernel cannot ask for the type of a number: ask for that of a tag")
    kind = getattr(thing, "_kind", None)
    return type(thing) if kind is None else getattr(kind, "instance_class", tuple)


def _is_instance(thing: Any, kind: Any) -> bool:
    kinds = tuple(getattr(k, "seen", k) for k in (kind if isinstance(kind, tuple) else (kind,)))
    if not isinstance(thing, Value):
        return issubclass(_class_of(thing), kinds)
    if not all(issubclass(k, tuple) for k in kinds):
        raise Untraceable("a kernel cannot ask for the type of a number: ask for that of a tag")
    return False


def _attribute(thing: Any, *name: Any) -> Any:
    if isinstance(thing, _Module):
        raise Untraceable("what is taken from a module has to be named: module.name")
    return getattr(thing, *name)


_OF_NUMBERS = {*OF_WHOLE, float}
_INSTEAD = {
    is_literal: is_literal,
    type: _class_of,
    isinstance: _is_instance,
    range: counting,
    getattr: _attribute,
}
_SAFE = {
    callable,
    len,
    zip,
    enumerate,
    tuple,
    list,
    dict,
    set,
    sum,
    reversed,
    any,
    all,
    map,
    slice,
    hasattr,
}
_CONSTANT = (type(None), type(NotImplemented), bool, int, float, str, np.number, np.bool_)


def _seen(thing: Any) -> Any:
    """What takes the place of a global in functions that are run here."""
    if isinstance(thing, (*_CONSTANT, Emitted, _Module)):
        return thing
    if isinstance(thing, python.ModuleType):
        return _Module(thing)
    if isinstance(thing, tuple):
        inner = [_seen(item) for item in thing]
        return type(thing)(*inner) if hasattr(thing, "_fields") else tuple(inner)
    if isinstance(thing, list):
        return list(map(_seen, thing))
    if isinstance(thing, np.ndarray):
        return now().constant(thing)
    if not isinstance(thing, Hashable):
        raise Untraceable(f"a {type(thing).__name__} is nothing that kernels know")
    if thing not in _copies:
        _copies[thing] = _copy(thing)
    made = _copies[thing]
    if isinstance(made, Walked) or (
        isinstance(made, python.FunctionType) and type(made.__globals__) is Globals
    ):
        note([made.__code__])
    if isinstance(made, type):
        now().classes.add(made)
    return made


def _copy(thing: Any) -> Any:
    """The same for what is called."""
    if thing in _INSTEAD:
        return _INSTEAD[thing]
    if thing in _SAFE:
        return thing
    if thing in choosers:
        return _Dispatched(thing)
    number = isinstance(thing, type) and issubclass(thing, np.generic)
    if number or thing in _OF_NUMBERS or isinstance(thing, types.Number):
        return Emitted(thing)
    if isinstance(thing, type) and issubclass(thing, tuple):
        return thing
    if hasattr(thing, "py_func") or _numba_knows(thing):
        return Emitted(thing)
    if isinstance(thing, python.FunctionType):
        return _copied(thing)
    raise Untraceable(f"kernels do not know {getattr(thing, '__name__', repr(thing))}")


def _numba_knows(thing: Any) -> bool:
    """Whether Numba has a version of its own; also before it compiled anything for processors."""
    cpu_target.typing_context.refresh()
    return bool(cpu_target.typing_context._lookup_global(thing))


@functools.cache
def _fault_of(code: python.CodeType) -> str:
    """Why a function is not run: where it catches what is raised here, or nothing follows it."""
    if code.co_exceptiontable and not code.co_flags & inspect.CO_GENERATOR:
        return "kernels know no `try` and no `with`"
    if any(i.opname == "IMPORT_NAME" for i in dis.get_instructions(code)):
        return "kernels know no `import` within a function: import at the top of the file"
    return ""


def _copied(function: Callable) -> Callable:
    """The same function with other globals; walked through where it asks what only a run knows."""
    code = function.__code__
    if _fault_of(code):
        raise Untraceable(_fault_of(code))
    true = function.__globals__
    seen = _modules.setdefault(id(true), Globals(true, _seen))
    cells = tuple(python.CellType(_seen(c.cell_contents)) for c in function.__closure__ or ())
    defaults = function.__defaults__ and tuple(map(_seen, function.__defaults__))
    made = python.FunctionType(code, seen, function.__name__, defaults, cells)
    made.__kwdefaults__ = {k: _seen(v) for k, v in (function.__kwdefaults__ or {}).items()}
    rolled = code in _rolled
    if not rolled and code not in branching:
        return made
    vars(made).update(vars(function))
    return Walked(made, lambda: Flow(now()), rolled)


def run_for_kernel(dispatch: Callable, arguments: tuple) -> Any:
    """What a point function gives where one that nothing sees through calls it, as methods do."""
    return _seen(dispatch)(*arguments)


# --- what kernels call ----------------------------------------------------------------------------


class _Formula(NamedTuple):
    """What is run for arguments of some types, the type of its result, what it consists of."""

    run: Callable
    result: types.Type
    parts: frozenset
    plain: bool  # whether the type says all that is known of the result
    name: str  # that nothing else has


_formulas: dict[tuple, _Formula | None] = {}
MOST_FORMULAS = 4000  # that are kept: some 12 kB each, 800 for a scene with contact
_numbers = itertools.count()
_begun: set[tuple] = set()  # of what is written now
_own: set[Callable] = set()  # functions that are not written into what calls them
_rolled: set[python.CodeType] = set()  # of functions with loops that are left to the compiler


def _kinds_of(dispatch: Callable, kinds: Iterable[types.Type]) -> tuple[types.Type, ...]:
    """The types of arguments: one function serves all numbers."""
    return tuple(map(types.unliteral, kinds) if dispatch in _own else kinds)


def _is_plain(thing: Any) -> bool:
    if isinstance(thing, tuple):
        return all(map(_is_plain, thing))
    return thing is None or isinstance(thing, Value | HeldValue)


def _written(dispatch: Callable, typing: Any, kinds: tuple) -> _Formula | None:
    """What :func:`_formula` gives, found by running it."""
    chosen = dispatch
    try:
        lowering = Lowering(_seen, typing)
        with writing(lowering), parts_noted() as parts:
            chosen = _chosen(dispatch, kinds)
            if chosen is None:
                return None
            run = _copied(chosen)
            note([run.__code__])
            found = run(*(lowering.wrapped(kind, None) for kind in kinds))
            result = types.unliteral(lowering.kind_of(found))
        codes = {part for part in parts if isinstance(part, python.CodeType)}
        refuse_methods(codes, lowering.classes)
        if hasattr(dispatch, "tags"):
            parts.add((dispatch, tuple(map(tag_class, kinds[: dispatch.tags]))))
        name = f"{dispatch.__qualname__}.{next(_numbers)}"
        return _Formula(run, result, frozenset(parts), _is_plain(found), name)
    except (DataDependentBranch, CannotCompile, Undefined):
        raise
    except (Exception, Untraceable) as why:
        raise CannotCompile(_reason(why), chosen or dispatch) from why


def _formula(dispatch: Callable, typing: Any, kinds: tuple) -> _Formula | None:
    """What to run for arguments of these types; None if Numba has it."""
    key = typing, dispatch, numbers_of(kinds)
    if len(_formulas) > MOST_FORMULAS and not at_work():
        forget()
    while key not in _formulas:
        if key in _begun:
            raise CannotCompile("it calls itself", dispatch)
        _begun.add(key)
        try:
            _formulas[key] = _written(dispatch, typing, kinds)
        except DataDependentBranch:
            # Once more, and through the text of the function that asks.
            _copies.clear()
        finally:
            _begun.remove(key)
    found = _formulas[key]
    if found is not None:
        note(found.parts)
    return found


def forget() -> None:
    """Find anew what is run: a point function has another implementation than was known."""
    _formulas.clear()
    resolutions.clear()


def _chosen(dispatch: Callable, kinds: tuple) -> Callable | None:
    for chooser in choosers[dispatch]:
        found = chooser(*kinds)
        if found is not None:
            return found
    if hasattr(dispatch, "tags"):
        raise Undefined(dispatch.__name__, tuple(map(_class_in_words, kinds[: dispatch.tags])))
    return None


def _class_in_words(kind: types.Type) -> Any:
    return tag_class(kind) or words(kind)


def alone(dispatch: Callable) -> None:
    """Let kernels call `dispatch` as a function of its own, which is not written into them."""
    _own.add(dispatch)


def roll(function: Callable) -> None:
    """Leave the loops in a function to the compiler, those over known ranges too."""
    _rolled.add(function.__code__)


def traced(dispatch: Callable, chooser: Callable) -> None:
    """Let kernels run what `chooser` makes of `dispatch` for types; None if it has nothing."""
    if dispatch in choosers:
        choosers[dispatch].append(chooser)
        return
    choosers[dispatch] = [chooser]

    class Template(AbstractTemplate):
        key = dispatch

        def generic(self, arguments: tuple, keywords: dict) -> Any:
            kinds = _kinds_of(dispatch, arguments)
            found = None if keywords else _formula(dispatch, self.context, kinds)
            return found and signature(found.result, *kinds)

        def get_impl_key(self, called: Any) -> Any:
            return choosers[dispatch][0]

    infer_global(dispatch, types.Function(Template))

    @lower_builtin(chooser, types.VarArg(types.Any))
    def lower(context: Any, builder: Any, called: Any, values: list) -> Any:
        lowering = Lowering(_seen, context.typing_context, context, builder)
        with writing(lowering):
            arguments = [lowering.wrapped(k, v) for k, v in zip(called.args, values, strict=True)]
            result = _Dispatched(dispatch)(*arguments)
            if types.unliteral(lowering.kind_of(result)) != called.return_type:
                raise TypingError(f"{dispatch.__qualname__} has changed while it was compiled")
            value = lowering.lowered(result, called.return_type)
            return impl_ret_borrowed(context, builder, called.return_type, value)
