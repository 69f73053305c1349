"""Code for operations on values."""

import copy
import functools
import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import typeof, types

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code import arithmetic, exceptions
from karamelo_py.compiler.code.builder import Builder
from karamelo_py.compiler.trace import indexing
from karamelo_py.compiler.trace import values as traced
from karamelo_py.compiler.trace.choices import tag_class
from karamelo_py.compiler.trace.flow import Flow
from karamelo_py.compiler.trace.held import HeldTuple, item_at, item_of
from karamelo_py.compiler.trace.session import session

MOST_OPERATIONS = 100_000  # largest number in a function; more operations should be a loop


class FunctionType(types.Opaque):
    def __init__(self, function: Callable):
        self.function = function
        name = function.__qualname__ if hasattr(function, "__qualname__") else function
        super().__init__(f"Function({name}, {id(function)})")


_TRACED = traced.Value, traced.HeldValue


@functools.cache
def _is_of_values(one: type) -> bool:
    """Return True for classes of values; Numba's abstract classes are slow."""
    others = types.Literal, types.NoneType, types.BaseTuple, types.NamedTupleClass, FunctionType
    return not issubclass(one, others)


def _tuple_type(kinds: tuple, named: type | None) -> types.BaseTuple:
    key, cache = (named, numbers_of(kinds)), session.tuples
    if key not in cache:
        cache[key] = types.BaseTuple.from_types(kinds, named)
    return cache[key]


_literal = functools.lru_cache(typed=True)(types.literal)  # types.literal makes a new type per call


class Lowering:
    """Writes code with a builder; ``seen(thing)`` replaces globals."""

    dispatch: Callable  # calls functions selected by type

    def __init__(self, seen: Callable, builder: ir.IRBuilder):
        self.seen, self.builder, self.flow = seen, builder, Flow(self, builder)
        self.operations = 0  # number of operations in the function that is being traced
        self.begun: set[tuple] = set()  # functions that are being traced
        self.regardless = False  # whether code continues after a called function has raised
        self.read: dict[tuple, Any] = {}  # items read from held tuples in this branch

    def wrapped(self, kind: types.Type, value: Any) -> Any:
        if _is_of_values(type(kind)):
            return traced.Value(kind, value)
        if isinstance(kind, types.Literal):
            return kind.literal_value
        if isinstance(kind, types.NoneType):
            return None
        if isinstance(kind, HeldTuple):
            return traced.HeldValue(kind, value)
        if isinstance(kind, types.BaseTuple):
            inner = [
                self.wrapped(item, value and self.builder.extract_value(value, k))
                for k, item in enumerate(kind)
            ]
            made = tag_class(kind)
            return made(*inner) if made else tuple(inner)
        if isinstance(kind, types.NamedTupleClass):
            return kind.instance_class
        return self.seen(kind.function)

    def kind_of(self, thing: Any) -> types.Type:
        """Return the type of a wrapped object; integers have literal types."""
        if isinstance(thing, _TRACED):
            return thing._kind
        if isinstance(thing, int):
            return _literal(thing)
        if isinstance(thing, tuple):
            kinds = tuple([types.unliteral(self.kind_of(item)) for item in thing])
            return _tuple_type(kinds, type(thing) if hasattr(thing, "_fields") else None)
        if thing is None or isinstance(thing, float | np.generic):
            return typeof(thing)
        if isinstance(thing, traced.Emitted):
            return FunctionType(thing.seen)
        if isinstance(thing, type) and issubclass(thing, tuple) and hasattr(thing, "_fields"):
            return types.NamedTupleClass(thing)
        raise traced.Untraceable(f"{thing!r} is unknown to kernels")

    def lowered(self, thing: Any, wanted: types.Type) -> Any:
        if isinstance(thing, _TRACED):
            return llvm.cast(self.builder, thing._value, thing._kind, wanted)
        if isinstance(thing, tuple):
            items = [self.lowered(a, k) for a, k in zip(thing, wanted, strict=True)]
            return llvm.make_tuple(self.builder, wanted, items)
        if isinstance(thing, int | float | np.generic):
            scalar = llvm.number_in(wanted)
            if scalar is not None:
                made = llvm.constants(scalar)(thing)
                return llvm.cast(self.builder, made, scalar, wanted)
        return llvm.nothing()

    def constant(self, array: np.ndarray) -> traced.Value:
        kind = typeof(array)
        return traced.Value(kind, llvm.constant_array(self.builder, kind, array))

    def unify(self, *kinds: types.Type) -> types.Type | None:
        first = kinds[0]
        if all(kind is first or kind == first for kind in kinds):
            return first
        if all(isinstance(kind, types.Number | types.Boolean) for kind in kinds):
            return arithmetic.common(*kinds)
        arrays = all(isinstance(kind, types.Array) for kind in kinds)
        if arrays and len({(k.dtype, k.ndim) for k in kinds}) == 1:
            return first.copy(layout="A", readonly=True)
        return None

    def call(self, function: Callable, arguments: tuple) -> Any:
        if function in session.builtins:
            return session.builtins[function](self, *arguments)
        if function in _OF_ITEMS and _has_slice(arguments[1]):
            return self.of_item(*arguments)
        value = self.dispatch(function, arguments)
        if value is not NotImplemented:
            return value
        self.operations += 1
        if self.operations > MOST_OPERATIONS:
            raise traced.Untraceable(f"it has more than {MOST_OPERATIONS} operations: use a loop")
        if function in _OF_ITEMS:
            return self.of_item(*arguments)
        kinds = tuple(map(self.kind_of, arguments))
        operation = self.operation(function, kinds)
        if operation is None:
            return self.other(function, arguments, kinds)
        values = [self.lowered(a, k) for a, k in zip(arguments, operation.arguments, strict=True)]
        return self.wrapped(operation.result, operation.code(self.builder, values))

    def operation(self, function: Callable, kinds: tuple) -> arithmetic.Operation | None:
        key = function, numbers_of(kinds)
        cache = session.operations
        if key not in cache:
            if isinstance(function, traced.Intrinsic):
                cache[key] = _of_intrinsic(function, kinds)
            else:
                cache[key] = arithmetic.operation(function, kinds)
        return cache[key]

    def other(self, function: Callable, arguments: tuple, kinds: tuple) -> Any:
        if function is len and isinstance(kinds[0], types.Array):
            return self.attribute(arguments[0], "shape")[0]
        if function is bool and isinstance(kinds[0], types.BaseTuple | types.NoneType):
            return bool(len(kinds[0])) if isinstance(kinds[0], types.BaseTuple) else False
        raise traced.Untraceable(
            f"{name_of(function)} is not defined for ({', '.join(map(traced.words, kinds))})"
        )

    def of_item(self, things: Any, index: Any, *value: Any) -> Any:
        if isinstance(things, traced.Value) and isinstance(things._kind, types.Array):
            do = indexing.put if value else indexing.get
            return do(self, things, index, *value)
        if isinstance(things, tuple) and isinstance(index, traced.Value) and not value:
            return indexing.item_of_tuple(self, things, index)
        raise traced.Untraceable(f"{self.kind_of(things)} has no items")

    def in_type_of(self, thing: Any, model: Any) -> Any:
        kind = llvm.scalar_of(model._kind)
        if isinstance(thing._kind, llvm.Lanes):
            kind = llvm.Lanes(kind, thing._kind.width)
        value = llvm.cast(self.builder, thing._value, thing._kind, kind)
        return traced.Value(kind, value)

    def cast(self, thing: Any, kind: types.Type) -> Any:
        return self.wrapped(kind, self.lowered(thing, kind))

    attribute, set_attribute = indexing.attribute, indexing.set_attribute

    def item(self, parent: traced.HeldValue, k: int) -> Any:
        key = id(parent), k
        if key not in self.read:
            value = item_of(self.builder, parent._kind, parent._value, k)
            self.read[key] = self.wrapped(parent._kind[k], value), parent  # its id stays unique
        return self.read[key][0]

    def item_at(self, parent: traced.HeldValue, k: Any) -> Any:
        number = self.lowered(k, types.int64)
        value = item_at(self.builder, parent._kind, parent._value, number)
        return self.wrapped(parent._kind[0], value)

    def function(self, name: str, run: Callable, kinds: tuple, result: Any = None) -> ir.Function:
        """Return the module's separate function for `run`, whose result type is `result`."""
        module = self.builder.module
        functions, key = vars(module).setdefault("own", {}), (run, kinds)
        made = functions.get(key)
        if made is None:
            made = new_function(module, kinds, result, f"{name}.{len(functions)}")
            made.linkage = "internal"
            made.attributes.add("nounwind")
            functions[key] = made
            inner = Lowering(self.seen, Builder(made.append_basic_block("entry")))
            made.gives = inner.give_back(run, kinds, made.args, result)
        return made

    def give_back(self, run: Callable, kinds: tuple, values: Any, result: Any) -> types.Type:
        """Write a function; return its result type, which follows from the code if not `result`."""
        passed = iter(values)
        with traced.writing(self):
            value = run(
                *(self.wrapped(k, None if llvm.is_empty(k) else next(passed)) for k in kinds)
            )
            if result is None:
                result = types.unliteral(self.kind_of(value))
                if not llvm.is_empty(result):
                    exceptions.returning(self.builder.function, llvm.register_type(result))
            if llvm.is_empty(result):
                self.builder.ret_void()
            else:
                self.builder.ret(self.lowered(value, result))
            return result

    def removal(self) -> Callable[[], None]:
        """Return a function that removes the code written from now on."""
        builder = self.builder
        function, block = builder.function, builder.block
        ends = [(b, [*b.instructions], b.terminator) for b in (function.blocks[0], block)]
        parts = function, function.scope, function.module, function.module.scope
        kept = [(vars(part), _copied(vars(part))) for part in parts]

        def remove() -> None:
            for one, instructions, terminator in ends:
                one.instructions, one.terminator = [*instructions], terminator
                one.extracted = {}
            for names, before in kept:
                names.clear()
                names.update(_copied(before))
            builder.position_at_end(block)

        return remove

    def call_function(
        self, function: Any, kinds: tuple, result: types.Type, arguments: tuple
    ) -> Any:
        pairs = zip(arguments, kinds, strict=True)
        values = [self.lowered(a, k) for a, k in pairs if not llvm.is_empty(k)]
        made = self.builder.call(function, values + exceptions.passed_to(self.builder, function))
        exceptions.go_on(self.builder, function, self.regardless)
        return self.wrapped(result, None if llvm.is_empty(result) else made)


def _copied(names: dict[str, Any]) -> dict[str, Any]:
    return {n: copy.copy(x) if isinstance(x, list | dict | set) else x for n, x in names.items()}


def function_type(kinds: tuple, result: Any, *more: ir.Type) -> ir.FunctionType:
    """Return a function's LLVM type; empty arguments are not passed."""
    is_void = result is None or llvm.is_empty(result)
    gives = ir.VoidType() if is_void else llvm.register_type(result)
    arguments = [llvm.register_type(k) for k in kinds if not llvm.is_empty(k)]
    return ir.FunctionType(gives, [*arguments, *more])


def new_function(module: ir.Module, kinds: tuple, result: Any, name: str) -> ir.Function:
    """Start an LLVM function, with a `Failure` except on GPUs."""
    if traced.in_one_module():
        return ir.Function(module, function_type(kinds, result), name)
    return exceptions.passing(ir.Function(module, function_type(kinds, result, llvm.I64), name))


_OF_ITEMS = {operator.getitem, operator.setitem}


def _has_slice(index: Any) -> bool:
    return any(isinstance(one, slice) for one in (index if isinstance(index, tuple) else (index,)))


def _of_intrinsic(function: traced.Intrinsic, kinds: tuple) -> arithmetic.Operation | None:
    plain = tuple(map(types.unliteral, kinds))
    definition = function.definition(*plain) or function.definition(*kinds)
    if definition is None:
        return None
    signature, codegen = definition
    return arithmetic.Operation(
        signature.return_type, signature.args, lambda builder, values: codegen(builder, *values)
    )


def name_of(function: Callable) -> str:
    return function.__name__ if hasattr(function, "__name__") else str(function)


def numbers_of(kinds: tuple) -> tuple[int, ...]:
    """Return Numba's type numbers, which compare faster."""
    return tuple([kind._code for kind in kinds])
