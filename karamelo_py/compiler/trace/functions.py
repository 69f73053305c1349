"""Select functions by argument types, and compile them where they are called.

Each number is a `Value`, whose operations become code of the calling function at once. Tuples and
classes are Python's and make no code. The text of a function is compiled by `statements`.
"""

import functools
import itertools
import types as python
from collections.abc import Callable, Iterable, Iterator
from traceback import walk_tb
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types

from karamelo_py.compiler.code.arithmetic import OPERATIONS
from karamelo_py.compiler.trace import choices, values
from karamelo_py.compiler.trace.choices import (
    INTERPRETED,
    modules_of,
    note,
    tag_class,
)
from karamelo_py.compiler.trace.lowering import Lowering, name_of, numbers_of
from karamelo_py.compiler.trace.session import one_at_a_time, session
from karamelo_py.compiler.trace.statements import AstFunction


class CannotCompile(TypeError):
    """A function cannot be compiled; the reason is its cause."""

    def __init__(self, reason: str, function: Callable):
        super().__init__(f"{reason} (in {name_of(function)})")
        code = function.__code__ if isinstance(function, python.FunctionType) else None
        self.begins = (code.co_filename, code.co_firstlineno) if code else ("", 0)


class Undefined(TypeError):
    """A point function is not defined for these classes."""

    def __init__(self, function: str, classes: tuple):
        names = ", ".join(c.__name__ if isinstance(c, type) else str(c) for c in classes)
        super().__init__(f"{function} is not defined for ({names})")
        self.classes = classes


def _reason(error: BaseException) -> str:
    if isinstance(error, values.Untraceable):
        return str(error)
    return ": ".join(filter(None, (type(error).__name__, str(error))))


def places_of(error: BaseException) -> Iterator[tuple[str, int]]:
    """Yield files and lines of an exception, innermost first."""
    if isinstance(error, CannotCompile):
        if error.__cause__ is not None:
            yield from places_of(error.__cause__)
        yield error.begins
    yield from vars(error).get("places", ())  # places in the text that is compiled
    for frame, line in reversed([*walk_tb(error.__traceback__)]):
        yield frame.f_code.co_filename, line


class Module:
    def __init__(self, module: python.ModuleType, seen: Callable[[Any], Any]):
        self._module, self._seen = module, seen

    def __getattr__(self, name: str) -> Any:
        note(modules_of(self._module))
        return self._seen(getattr(self._module, name))


_NO_TYPES = "a kernel cannot ask for the type of a number: ask for the type of a tag"


def _class_of(thing: Any) -> type:
    if isinstance(thing, values.Value):
        raise values.Untraceable(_NO_TYPES)
    if isinstance(thing, values.HeldValue):
        return tag_class(thing._kind) or tuple
    return type(thing)


def _plain_class(kind: Any) -> Any:
    return kind.seen if isinstance(kind, values.Emitted) else kind


def _is_instance(thing: Any, kind: Any) -> bool:
    kinds = tuple(map(_plain_class, kind if isinstance(kind, tuple) else (kind,)))
    if not isinstance(thing, values.Value):
        return issubclass(_class_of(thing), kinds)
    if not all(issubclass(k, tuple) for k in kinds):
        raise values.Untraceable(_NO_TYPES)
    return False


def _attribute(thing: Any, *name: Any) -> Any:
    if isinstance(thing, Module):
        raise values.Untraceable("an attribute of a module has to be named: module.name")
    return getattr(thing, *name)


INSTEAD = {type: _class_of, isinstance: _is_instance, getattr: _attribute}
_SAFE = {
    callable, len, zip, enumerate, tuple, list, dict, set, sum, reversed, any, all, map, slice,
    hasattr, range, values.is_literal,
}  # fmt: skip
_CONSTANT = (type(None), type(NotImplemented), bool, int, float, str, np.number, np.bool_)
_AS_THEY_ARE = (*_CONSTANT, values.Emitted, Module)


def _seen(thing: Any) -> Any:
    """Return the replacement of a global in traced functions."""
    if type(thing) is python.FunctionType and thing in session.seen:
        made, modules = session.seen[thing]
        if modules:
            note(modules)
        return made
    if isinstance(thing, _AS_THEY_ARE):
        return thing
    if isinstance(thing, python.ModuleType):
        return Module(thing, _seen)
    if isinstance(thing, tuple):
        return values.rebuilt(thing, map(_seen, thing))
    if isinstance(thing, list):
        return list(map(_seen, thing))
    if isinstance(thing, np.ndarray):
        return values.now().constant(thing)
    if type(thing).__hash__ is None:
        raise values.Untraceable(f"a {type(thing).__name__} is unknown to kernels")
    cached = session.seen
    if thing not in cached:
        cached[thing] = _copy(thing), modules_of(thing)
    made, modules = cached[thing]
    note(modules)
    return made


def _copy(thing: Any) -> Any:
    if thing in INSTEAD:
        return INSTEAD[thing]
    if thing in _SAFE or (isinstance(thing, type) and issubclass(thing, tuple)):
        return thing
    is_emitted = thing in session.choosers or thing in session.builtins or thing in OPERATIONS
    if is_emitted or isinstance(thing, values.Intrinsic | type):
        return values.Emitted(thing)
    if isinstance(thing, python.FunctionType):
        return _copied(thing)
    name = thing.__name__ if hasattr(thing, "__name__") else repr(thing)
    raise values.Untraceable(f"kernels do not know {name}")


def _copied(function: Callable) -> AstFunction:
    walked = session.walked
    if function not in walked:
        walked[function] = AstFunction(function, _seen), modules_of(function)
    made, modules = walked[function]
    note(modules)
    return made


def run_for_kernel(dispatch: Callable, arguments: tuple) -> Any:
    """Trace a method or point function that is called from plain Python."""
    return _seen(dispatch)(*arguments)


class Selected(NamedTuple):
    """The function selected for argument types; calling it compiles its text."""

    key: tuple
    function: Callable

    def __call__(self, *arguments: Any) -> Any:
        function, lowering = self.function, values.now()
        if values.is_begun(self.key):
            raise CannotCompile("it calls itself", self.key[0])
        before, lowering.operations = lowering.operations, 0
        lowering.begun.add(self.key)
        try:
            run = _seen(function) if isinstance(function, values.Intrinsic) else _copied(function)
            return run(*arguments)
        except (CannotCompile, Undefined):
            raise
        except (Exception, values.Untraceable) as why:
            raise CannotCompile(_reason(why), function) from why
        finally:
            lowering.begun.discard(self.key)
            lowering.operations = before


MOST_FUNCTIONS = 4000  # number of cached functions, of about 12 kB; a scene with contact has 800
not_inlined: set[Callable] = set()


def chosen(dispatch: Callable, kinds: tuple) -> Selected | None:
    """Return the function for argument types, or None."""
    key = dispatch, numbers_of(kinds), values.all_called_in_one()
    with one_at_a_time:
        cached = session.functions
        if not values.at_work() and (session.outdated or len(cached) > MOST_FUNCTIONS):
            session.outdated = False
            for one in (cached, session.seen, session.walked):
                one.clear()
        if key not in cached:
            function = _chosen(dispatch, kinds)
            cached[key] = function and Selected(key, function)
        return cached[key]


def forget() -> None:
    """Drop cached selections after a new implementation."""
    if values.at_work():
        session.functions.clear()
    else:  # another Python thread is changing the table
        session.outdated = True


def outdate_kernels() -> None:
    session.changes += 1


class PointFunction:
    """Function of one point, implemented for classes of its first `tags` arguments.

    Plain Python selects by the arguments' classes, kernels select by their types.
    """

    def __init__(self, stub: Callable, tags: int, otherwise: bool):
        functools.update_wrapper(self, stub)
        self.tags = tags
        self._fallback = stub if otherwise else None
        self._table: dict[tuple[type, ...], Callable] = {}
        self._nearest: dict[tuple[type, ...], Callable | None] = {}

    def find(self, classes: tuple) -> Callable | None:
        """Return the implementation for classes, or for their nearest bases."""
        nearest = self._nearest  # a local name, as another Python thread may replace the table
        if classes not in nearest:
            bases = [c.__mro__ if isinstance(c, type) else (c,) for c in classes]
            matches = (self._table[b] for b in itertools.product(*bases) if b in self._table)
            nearest[classes] = next(matches, self._fallback)
        return nearest[classes]

    def _plain(self, *arguments: Any) -> Any:
        nearest, classes = self._nearest, (arguments[0].__class__,)
        if self.tags > 1:
            classes = tuple([a.__class__ for a in arguments[: self.tags]])
        chosen = nearest[classes] if classes in nearest else self.find(classes)
        if chosen is None:
            raise Undefined(self.__name__, classes)
        return chosen(*arguments)

    def _watched(self, *arguments: Any) -> Any:
        return _seen(self)(*arguments) if values.at_work() else self._plain(*arguments)

    __call__ = _plain if INTERPRETED else _watched

    def on(self, *classes: type) -> Callable[[Callable], Callable]:
        """Decorate the implementation for these classes and derived classes."""

        def register(implementation: Callable) -> Callable:
            self._table[classes] = implementation
            choices.register(implementation)
            before, self._nearest = self._nearest, {}
            forget()
            if any(self.find(asked) is not chosen for asked, chosen in before.items()):
                outdate_kernels()
            return implementation

        return register

    def defined(self, *classes: type) -> bool:
        return self.find(classes) is not self._fallback


def _number_types(kinds: Iterable[types.Type]) -> Iterator[type]:
    for kind in kinds:
        one = tag_class(kind) or type(kind)
        if values.implementations(one) is not None:
            yield one
        elif isinstance(kind, types.BaseTuple):
            yield from _number_types(kind)


def _chosen(dispatch: Callable, kinds: tuple) -> Callable | None:
    for one in _number_types(kinds):
        if dispatch in one.implements:
            return one.implements[dispatch]
    if dispatch not in session.choosers:
        return dispatch
    for chooser in session.choosers[dispatch]:
        chosen = chooser(*kinds)
        if chosen is not None:
            return chosen
    if isinstance(dispatch, PointFunction):
        classes = [tag_class(kind) or values.words(kind) for kind in kinds[: dispatch.tags]]
        raise Undefined(dispatch.__name__, tuple(classes))
    return None


def _call(function: Callable, arguments: tuple) -> Any:
    if function not in session.choosers:
        return NotImplemented
    lowering = values.now()
    kinds = tuple(map(lowering.kind_of, arguments))
    if function in not_inlined:  # one function applies to all numbers
        return call_own(lowering, function, tuple(map(types.unliteral, kinds)), arguments)
    run = chosen(function, kinds)
    return NotImplemented if run is None else run(*arguments)


def call_own(lowering: Lowering, function: Callable, kinds: tuple, arguments: Iterable) -> Any:
    """Call a function that is compiled separately in the module."""
    run = chosen(function, kinds)
    if run is None:
        return NotImplemented
    called = lowering.function(function.__qualname__, run, kinds)
    return lowering.call_function(called, kinds, called.gives, arguments)


Lowering.dispatch = staticmethod(_call)


def write_into(builder: ir.IRBuilder) -> Lowering:
    return Lowering(_seen, builder)
