"""Code of what meets a value: what an operation on numbers, lanes and arrays is, Numba says."""

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.core.typing.templates import fold_arguments

from karamelo_py.compiler.held import _Held, item_of
from karamelo_py.compiler.values import Emitted, HeldValue, Untraceable, Value, words, writing

MOST_OPERATIONS = 10_000  # of one formula; beyond, a loop is better left to the compiler
LONGEST = 1000  # range that is gone through


class Lowering:
    """Where code goes to: to a builder, or nowhere while only types are asked for.

    Parameters
    ----------
    seen
        What takes the place of a function in functions that are run.
    typing, context, builder
        Numba's.

    Attributes
    ----------
    classes
        Of the tuples that were met.
    read
        What was read of held tuples on the way to here.
    """

    spread: Callable  # what makes lanes of a number
    converted: Callable  # what makes lanes of real numbers of lanes of whole ones

    def __init__(self, seen: Callable, typing: Any, context: Any = None, builder: Any = None):
        self.seen, self.typing, self.context, self.builder = seen, typing, context, builder
        self.classes: set[type] = set()
        self.operations = 0
        self.read: dict[tuple, Any] = {}

    def wrapped(self, kind: types.Type, value: Any) -> Any:
        """What point functions see of a value."""
        if isinstance(kind, types.Literal):
            return kind.literal_value
        if isinstance(kind, types.NoneType):
            return None
        if isinstance(kind, types.BaseTuple) and hasattr(kind, "instance_class"):
            self.classes.add(kind.instance_class)
        if isinstance(kind, _Held):
            return HeldValue(kind, value)
        if isinstance(kind, types.BaseTuple):
            inner = [
                self.wrapped(item, self.builder and self.builder.extract_value(value, k))
                for k, item in enumerate(kind)
            ]
            made = getattr(kind, "instance_class", None)
            return made(*inner) if made else tuple(inner)
        if isinstance(kind, types.NamedTupleClass):
            return kind.instance_class
        if isinstance(kind, types.Function | types.Dispatcher):
            function = kind.typing_key if isinstance(kind, types.Function) else kind.dispatcher
            return self.seen(function)
        return Value(kind, value)

    def kind_of(self, thing: Any) -> types.Type:
        """The Numba type of what point functions see; whole numbers keep their value in it."""
        if isinstance(thing, Value | HeldValue):
            return thing._kind
        if isinstance(thing, int):
            return types.literal(thing)
        if isinstance(thing, tuple):
            kinds = tuple(types.unliteral(self.kind_of(item)) for item in thing)
            made = type(thing) if hasattr(thing, "_fields") else None
            if made:
                self.classes.add(made)
            return types.BaseTuple.from_types(kinds, made)
        if isinstance(thing, Emitted):
            thing = thing.seen
        elif not isinstance(thing, float | np.generic | type | None):
            raise Untraceable(f"{thing!r} is nothing that a kernel knows")
        return self.typing.resolve_value_type(thing)

    def lowered(self, thing: Any, wanted: types.Type) -> Any:
        """Code that gives what point functions see, in the type `wanted`."""
        kind = self.kind_of(thing)
        if isinstance(thing, Value | HeldValue):
            return self.context.cast(self.builder, thing._value, kind, wanted)
        if isinstance(thing, tuple):
            items = [self.lowered(a, k) for a, k in zip(thing, wanted, strict=True)]
            return self.context.make_tuple(self.builder, wanted, items)
        number = isinstance(thing, int | float | np.generic)
        if number and hasattr(wanted, "width"):
            made = self.context.get_constant_generic(self.builder, wanted.scalar, thing)
            return self.spread(self.builder, made, wanted)
        if number and not isinstance(wanted, types.Literal):
            kind = types.unliteral(kind)
            made = self.context.get_constant_generic(self.builder, kind, thing)
            return self.context.cast(self.builder, made, kind, wanted)
        return self.context.get_dummy_value()

    def constant(self, array: np.ndarray) -> Value:
        """An array that is part of the code."""
        kind = self.typing.resolve_value_type(array)
        return Value(
            kind, self.builder and self.context.get_constant_generic(self.builder, kind, array)
        )

    def call(self, function: Callable, arguments: tuple) -> Any:
        """What `function` gives for these arguments."""
        self.operations += 1
        if self.operations > MOST_OPERATIONS:
            raise Untraceable(f"it has more than {MOST_OPERATIONS} operations: take a loop")
        kinds = tuple(map(self.kind_of, arguments))
        if hasattr(function, "py_func"):
            kinds = tuple(map(types.unliteral, kinds))
        resolved = _resolved(self.typing, function, kinds)
        called = resolved.called
        if any(isinstance(kind, types.Omitted) for kind in called.args):
            raise Untraceable(f"an argument of {name_of(function)} is left out")
        if self.builder is None:
            return self.wrapped(called.return_type, None)
        if called.pysig is not None:  # with *arguments in a tuple
            arguments = fold_arguments(called.pysig, arguments, {}, _as_is, _as_is, _as_is)
        values = [self.lowered(a, k) for a, k in zip(arguments, called.args, strict=True)]
        made = resolved.made(self.context)
        return self.wrapped(called.return_type, made(self.builder, values))

    def in_type_of(self, thing: Any, like: Any) -> Any:
        """A whole number as a real one of the type of `like`."""
        if hasattr(thing._kind, "width"):
            return self.call(self.converted, (thing, like))
        kind = getattr(like._kind, "scalar", like._kind)
        value = self.builder and self.context.cast(self.builder, thing._value, thing._kind, kind)
        return Value(kind, value)

    def call_bound(self, method: Value, arguments: tuple) -> Any:
        """What a method of a number or an array gives."""
        if not isinstance(method._kind, types.BoundFunction):
            raise Untraceable(f"{words(method._kind)} cannot be called")
        kinds = tuple(map(self.kind_of, arguments))
        called = _typed(self.typing, method._kind, kinds, str(method._kind))
        if self.builder is None:
            return self.wrapped(called.return_type, None)
        values = [self.lowered(a, k) for a, k in zip(arguments, called.args, strict=True)]
        made = self.context.get_function(method._kind, called)
        return self.wrapped(called.return_type, made(self.builder, [method._value, *values]))

    def attribute(self, thing: Value, name: str) -> Any:
        """An attribute of an array or a record."""
        kind = self.typing.resolve_getattr(thing._kind, name)
        if kind is None:
            raise AttributeError(f"{words(thing._kind)} has no attribute '{name}'")
        if self.builder is None or isinstance(kind, types.BoundFunction):  # of what it is bound to
            return self.wrapped(kind, thing._value)
        read = self.context.get_getattr(thing._kind, name)
        value = read(self.context, self.builder, thing._kind, thing._value, name)
        return self.wrapped(kind, value)

    def set_attribute(self, thing: Value, name: str, value: Any) -> None:
        """Set an attribute of a record."""
        called = self.typing.resolve_setattr(thing._kind, name, self.kind_of(value))
        if called is None:
            raise AttributeError(f"{words(thing._kind)} has no attribute '{name}' of that type")
        if self.builder is not None:
            write = self.context.get_setattr(name, called)
            write(self.builder, (thing._value, self.lowered(value, called.args[1])))

    def item(self, held: HeldValue, k: int) -> Any:
        """An item of a held tuple."""
        key = id(held), k
        if key not in self.read:
            value = self.builder and item_of(self.context, self.builder, held._kind, held._value, k)
            self.read[key] = self.wrapped(held._kind[k], value), held  # so that its id stays its
        return self.read[key][0]

    def function(self, name: str, run: Callable, kinds: tuple, result: types.Type) -> ir.Function:
        """A function of its own in the module that is written, which does what `run` does."""
        module = self.builder.module
        if name in module.globals:
            return module.globals[name]
        convention = self.context.call_conv
        made = ir.Function(module, convention.get_function_type(result, kinds), name)
        made.linkage = "internal"
        convention.decorate_function(made, [f"a{k}" for k in range(len(kinds))], kinds)
        builder = ir.IRBuilder(made.append_basic_block("entry"))
        inner = Lowering(self.seen, self.typing, self.context, builder)
        values = convention.decode_arguments(builder, kinds, made)
        inner.give_back(run, kinds, values, result)
        return made

    def give_back(self, run: Callable, kinds: tuple, values: list, result: types.Type) -> None:
        """Return what `run` gives from the function that is written."""
        with writing(self):
            given = run(*(self.wrapped(k, v) for k, v in zip(kinds, values, strict=True)))
            value = self.context.get_return_value(self.builder, result, self.lowered(given, result))
            self.context.call_conv.return_value(self.builder, value)

    def call_own(
        self, name: str, run: Callable, kinds: tuple, result: types.Type, arguments: tuple
    ) -> Any:
        """Call the function of its own that does what `run` does."""
        if self.builder is None:
            return self.wrapped(result, None)
        function = self.function(name, run, kinds, result)
        values = [self.lowered(a, k) for a, k in zip(arguments, kinds, strict=True)]
        convention = self.context.call_conv
        status, value = convention.call_function(self.builder, function, result, kinds, values)
        with cgutils.if_unlikely(self.builder, status.is_error):
            convention.return_status_propagate(self.builder, status)
        return self.wrapped(result, value)


def _as_is(index: int, parameter: Any, argument: Any) -> Any:
    return argument


class _Resolved:
    """Numba's type of a function, its signature for arguments of some types, and its code."""

    __slots__ = ("_made", "called", "typed")

    def __init__(self, typed: types.Type, called: Any):
        self.typed, self.called, self._made = typed, called, None

    def made(self, context: Any) -> Callable:
        """What makes code of it; Numba looks for that in all its registries, often twice."""
        if self._made is None:
            self._made = context.get_function(self.typed, self.called)
        return self._made


resolutions: dict[tuple, _Resolved] = {}


def numbers_of(kinds: tuple) -> tuple[int, ...]:
    """Numba's numbers of types, which are faster to compare."""
    return tuple([kind._code for kind in kinds])


def _resolved(typing: Any, function: Callable, kinds: tuple) -> _Resolved:
    """What Numba knows of a function for arguments of these types, for the target of `typing`."""
    key = typing, function, numbers_of(kinds)
    if key not in resolutions:
        typed = typing.resolve_value_type(function)
        resolutions[key] = _Resolved(typed, _typed(typing, typed, kinds, name_of(function)))
    return resolutions[key]


def _typed(typing: Any, typed: types.Type, kinds: tuple, name: str) -> Any:
    """The signature of a function for arguments of these types."""
    try:
        called = typing.resolve_function_type(typed, kinds, {})
    except TypingError as error:
        if "raised a specific error" in str(error):
            raise
        called = None
    if called is None:
        raise Untraceable(f"{name} is not defined for ({', '.join(map(words, kinds))})")
    return called


def name_of(function: Callable) -> str:
    """What a text calls a function."""
    return getattr(function, "__name__", str(function))
