"""Functions are run once, on values of the function that is compiled, and written down.

Numba makes code of a function in twenty passes, fifteen milliseconds for the smallest: half of a
first compilation. Where a kernel calls a function marked for it, it is run by Python itself, on a
:class:`~karamelo_py.compiler.values.Value` in the place of each number, and every operation that
meets one is lowered at once, into the function that calls. Tuples are Python's own, so that what
only takes them apart costs nothing. The bits are the same. A function that asks what only a run can
know (`if x > 0`) is walked through instead, statement by statement
(:mod:`~karamelo_py.compiler.walk`). What cannot be written so, Numba compiles as a whole.

Functions run here see their globals through :class:`~karamelo_py.compiler.values.Globals`: what
other code chooses by type is lowered for the types at hand, Python's functions are run in the same
way. Only what the key of a kernel on disk follows may be run
(:mod:`karamelo_py.compiler.fingerprint`): functions that come by another way than a global name or
a closure, as methods do, are Numba's to compile, or to refuse.
"""

import dis
import functools
import inspect
import itertools
import os
import types as python
from collections.abc import Callable, Hashable, Iterable
from traceback import walk_tb
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core.errors import TypingError
from numba.core.imputils import impl_ret_borrowed, lower_builtin
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate, infer_global, signature

from karamelo_py.compiler.choices import note, parts_noted, tag_class
from karamelo_py.compiler.flow import Flow
from karamelo_py.compiler.lowering import Lowering, numbers_of, resolutions
from karamelo_py.compiler.methods import refuse_methods
from karamelo_py.compiler.values import (
    OF_REALS,
    OF_WHOLE,
    Asks,
    Emitted,
    Globals,
    HeldValue,
    Untraceable,
    Value,
    alike,
    asking,
    at_work,
    counting,
    derivatives,
    emit,
    has_derivatives,
    is_literal,
    now,
    writing,
)
from karamelo_py.compiler.walk import Walked

# --- functions as they are run here -----------------------------------------------------------


_modules: dict[int, Globals] = {}
_copies: dict[Any, Any] = {}
_choosers: dict[Callable, list[Callable]] = {}


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
        raise Untraceable
    kind = getattr(thing, "_kind", None)
    return type(thing) if kind is None else getattr(kind, "instance_class", tuple)


def _is_instance(thing: Any, kind: Any) -> bool:
    kinds = tuple(getattr(k, "seen", k) for k in (kind if isinstance(kind, tuple) else (kind,)))
    if not isinstance(thing, Value):
        return issubclass(_class_of(thing), kinds)
    if not all(issubclass(k, tuple) for k in kinds):
        raise Untraceable
    return False


def _attribute(thing: Any, *name: Any) -> Any:
    if isinstance(thing, _Module):
        raise Untraceable
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
        raise Untraceable
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
    if thing in _choosers:
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
    raise Untraceable


def _numba_knows(thing: Any) -> bool:
    """Whether Numba has a version of its own; also before it compiled anything for processors."""
    cpu_target.typing_context.refresh()
    return bool(cpu_target.typing_context._lookup_global(thing))


@functools.cache
def _is_fit(code: python.CodeType) -> bool:
    """Not where a function catches what is raised here, or imports what nothing follows."""
    catches = code.co_exceptiontable and not code.co_flags & inspect.CO_GENERATOR
    return not catches and all(i.opname != "IMPORT_NAME" for i in dis.get_instructions(code))


def _copied(function: Callable) -> Callable:
    """The same function with other globals; walked through where it asks what only a run knows."""
    code = function.__code__
    if not _is_fit(code):
        raise Untraceable
    true = function.__globals__
    seen = _modules.setdefault(id(true), Globals(true, _seen))
    cells = tuple(python.CellType(_seen(c.cell_contents)) for c in function.__closure__ or ())
    defaults = function.__defaults__ and tuple(map(_seen, function.__defaults__))
    made = python.FunctionType(code, seen, function.__name__, defaults, cells)
    made.__kwdefaults__ = {k: _seen(v) for k, v in (function.__kwdefaults__ or {}).items()}
    rolled = code in _rolled
    if not rolled and code not in asking:
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
_asking: dict[python.CodeType, int] = {}  # of functions left to Numba: the line that is why
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
    chosen = None
    try:
        lowering = Lowering(_seen, typing)
        with writing(lowering), parts_noted() as parts:
            chosen = _chosen(dispatch, kinds)
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
    except Asks:
        raise
    except (Exception, Untraceable) as why:  # Numba tells what is wrong, if it is
        _note_why(chosen, why)
        return None


def _note_why(chosen: Callable | None, why: BaseException) -> None:
    """Keep the line of a function for which it is left to Numba."""
    code = getattr(chosen, "__code__", None)
    lines = [k for frame, k in walk_tb(why.__traceback__) if frame.f_code is code]
    if getattr(why, "asking", (None,))[0] is code and code is not None:
        lines = [why.asking[1]]
    if lines:
        _asking[code] = lines[-1]


def _formula(dispatch: Callable, typing: Any, kinds: tuple) -> _Formula | None:
    """What to run for arguments of these types; None if it is Numba's to compile."""
    key = typing, dispatch, numbers_of(kinds)
    if len(_formulas) > MOST_FORMULAS and not at_work():
        forget()
    while key not in _formulas:
        _formulas[key] = None  # of one that calls itself
        try:
            _formulas[key] = _written(dispatch, typing, kinds)
        except Asks:
            # Once more, and through the text of the function that asks.
            _copies.clear()
            del _formulas[key]
    found = _formulas[key]
    if found is not None:
        note(found.parts)
    return found


def line_that_asks(file: str, line: int) -> int | None:
    """The line for which the function at a place was not run, but left to Numba."""
    file = os.path.realpath(file)
    for code, reason in _asking.items():
        lines = (k for _, _, k in code.co_lines())
        if line in lines and os.path.realpath(code.co_filename) == file:
            return reason
    return None


def forget() -> None:
    """Find anew what is run: a point function has another implementation than was known."""
    _formulas.clear()
    resolutions.clear()


def _chosen(dispatch: Callable, kinds: tuple) -> Callable:
    for chooser in _choosers[dispatch]:
        found = chooser(*kinds)
        if found is not None:
            return found
    raise Untraceable


def alone(dispatch: Callable) -> None:
    """Let kernels call `dispatch` as a function of its own, which is not written into them."""
    _own.add(dispatch)


def roll(function: Callable) -> None:
    """Leave the loops in a function to the compiler, those over known ranges too."""
    _rolled.add(function.__code__)


def traced(dispatch: Callable, chooser: Callable) -> None:
    """Let kernels run what `chooser` makes of `dispatch` for types; None if it must not be run."""
    if dispatch in _choosers:
        _choosers[dispatch].append(chooser)
        return
    _choosers[dispatch] = [chooser]

    class Template(AbstractTemplate):
        key = dispatch

        def generic(self, arguments: tuple, keywords: dict) -> Any:
            kinds = _kinds_of(dispatch, arguments)
            found = None if keywords else _formula(dispatch, self.context, kinds)
            return found and signature(found.result, *kinds)

        def get_impl_key(self, called: Any) -> Any:
            return _choosers[dispatch][0]

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
