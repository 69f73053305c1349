"""Control flow of a traced function: branches, merges and loops."""

import operator
import types as python
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numba import types

from karamelo_py.compiler.llvm import scalar_of
from karamelo_py.compiler.trace.values import (
    HeldValue,
    Untraceable,
    Value,
    emit,
    is_literal,
    rebuilt,
    words,
)

_PLAIN = (bool, int, float, str, np.generic, type(None))
_MERGED = (Value, HeldValue, *_PLAIN)  # values of these classes may differ between branches
_DROPPED = object()
IN_A_LOOP = " between iterations of a loop"


class Edge(NamedTuple):
    """End of a branch: its last block, its variables, and the items read from `HeldTuple`s."""

    block: Any
    names: dict[str, Any]
    read: dict


class Range:
    """A range whose bounds are known at run time."""

    def __init__(self, *bounds: Any):
        self.bounds = bounds

    def __iter__(self) -> Any:
        raise Untraceable("the end of a range is only known when the kernel runs")


class Numbered(NamedTuple):
    """Items of a tuple with their numbers."""

    items: HeldValue

    def __iter__(self) -> Any:
        return enumerate(self.items)


class Counter(NamedTuple):
    start: Value
    goes_on: Callable[[Value], Value]
    after: Callable[[Value], Value]


class Phi(NamedTuple):
    made: Value | HeldValue
    on: list


class LoopHeader(NamedTuple):
    block: Any
    phis: list[Phi]
    names: dict[str, Any]
    paths: list[tuple]  # each value that phis join: a name, and indices in tuples


def is_value(thing: Any) -> bool:
    return isinstance(thing, Value)


def is_real(thing: Any) -> bool:
    return isinstance(thing, Value) and isinstance(thing._kind, types.Float)


def _is_same(a: Any, b: Any) -> bool:
    return a is b or (isinstance(a, _PLAIN) and type(a) is type(b) and repr(a) == repr(b))


class Grows(Untraceable):
    """Numbers change type in a loop; `grown` maps the path of each number to its new type."""

    def __init__(self, grown: dict[tuple, Any]):
        super().__init__(f"a number becomes one of another type{IN_A_LOOP}")
        self.grown = grown


def is_number_type(thing: Any) -> bool:
    return hasattr(type(thing), "constant")


def _counter(kinds: tuple) -> types.Integer:
    if not all(isinstance(kind, types.Integer) for kind in kinds):
        raise Untraceable("the ends of a range are not whole numbers")
    alike = all(kind == kinds[0] for kind in kinds)
    return kinds[0] if alike and kinds[0] in (types.int32, types.uint64) else types.int64


class Flow:
    """Writes the control flow of a call."""

    def __init__(self, lowering: Any, builder: Any):
        self.lowering, self.builder = lowering, builder

    def edge(self, names: dict[str, Any]) -> Edge:
        return Edge(self.builder.block, names, self.lowering.read)

    def split(self, condition: Value) -> tuple[Edge, Edge]:
        truth = emit(bool, condition)
        blocks = [self.builder.append_basic_block("way") for _ in range(2)]
        self.builder.cbranch(truth._value, *blocks)
        return tuple(Edge(block, {}, dict(self.lowering.read)) for block in blocks)

    def start(self, edge: Edge) -> None:
        self.builder.position_at_end(edge.block)
        self.lowering.read = edge.read

    def meet(self, edges: list[Edge]) -> dict[str, Any]:
        """Merge branches; return the variables that all of them define."""
        first = edges[0]
        if len(edges) == 1:
            self.start(first)
            return first.names
        phis: list[Phi] = []
        names: dict[str, Any] = {}
        for name, thing in first.names.items():
            if all(name in edge.names for edge in edges):
                merged = self._merged([thing, *(edge.names[name] for edge in edges[1:])], phis)
                if merged is not _DROPPED:
                    names[name] = merged
        block = self.builder.append_basic_block("way")
        for k, edge in enumerate(edges):
            self.start(edge)
            self._enter(block, phis, [phi.on[k] for phi in phis])
        everywhere = {
            key: value
            for key, value in first.read.items()
            if all(edge.read.get(key) is value for edge in edges)
        }
        self.start(Edge(block, names, everywhere))
        return names

    def _enter(self, block: Any, phis: list[Phi], values: list) -> None:
        lowered = [
            self.lowering.lowered(v, phi.made._kind) for v, phi in zip(values, phis, strict=True)
        ]
        here = self.builder.block
        self.builder.branch(block)
        for phi, value in zip(phis, lowered, strict=True):
            if phi.made._value is None:
                with self.builder.goto_block(block):
                    phi.made._value = self.builder.phi(value.type)
            phi.made._value.add_incoming(value, here)

    def _merged(self, things: list, phis: list[Phi]) -> Any:
        first = things[0]
        if all(_is_same(first, thing) for thing in things[1:]):
            return first
        if all(isinstance(t, tuple) and type(t) is type(first) for t in things):
            if len({len(t) for t in things}) > 1:
                return _DROPPED
            items = [self._merged(list(item), phis) for item in zip(*things, strict=True)]
            return _DROPPED if any(i is _DROPPED for i in items) else rebuilt(first, items)
        numbers = [t for t in things if is_number_type(t)]
        plain = [t for t in things if not is_number_type(t)]
        if numbers and all(isinstance(t, Value) or is_literal(t) for t in plain):
            wide = [t if is_number_type(t) else numbers[0].constant(t) for t in things]
            return self._merged(wide, phis)
        if any(t is None or not isinstance(t, _MERGED) for t in things):
            return _DROPPED
        kinds = [types.unliteral(self.lowering.kind_of(t)) for t in things]
        real = {k for t, k in zip(things, kinds, strict=True) if is_real(t)}
        if len(real) == 1 and all(is_real(t) or is_literal(t) for t in things):
            (kind,) = real  # literals take the precision of reals
        else:
            kind = self.lowering.unify(*kinds)
        if kind is None or isinstance(kind, types.Optional | types.UnicodeType):
            return _DROPPED
        return self._phi(first, kind, things, phis)

    def _phi(self, model: Any, kind: types.Type, things: list, phis: list[Phi]) -> Any:
        made = (HeldValue if isinstance(model, HeldValue) else Value)(kind, None)
        phis.append(Phi(made, things))
        return made

    def loop(
        self, names: dict[str, Any], changed: frozenset[str], grown: dict[tuple, Any]
    ) -> tuple[LoopHeader, dict[str, Any]]:
        """Start a loop; return its variables.

        Variables in `changed` become phis, with the types in `grown` if given.
        """
        phis: list[Phi] = []
        paths: list[tuple] = []

        def begun(thing: Any, path: tuple) -> Any:
            become = grown.get(path)
            if is_number_type(become) and not isinstance(thing, tuple):
                thing = become.constant(thing)
            if isinstance(thing, tuple):
                return rebuilt(thing, [begun(item, (*path, k)) for k, item in enumerate(thing)])
            if thing is None or not isinstance(thing, _MERGED):
                return thing
            paths.append(path)
            kind = become or types.unliteral(self.lowering.kind_of(thing))
            return self._phi(thing, kind, [thing], phis)

        carried = {name: begun(names[name], (name,)) for name in sorted(changed & names.keys())}
        block = self.builder.append_basic_block("way")
        self._enter(block, phis, [phi.on[0] for phi in phis])
        self.start(Edge(block, {}, dict(self.lowering.read)))
        return LoopHeader(block, phis, carried, paths), names | carried

    def close(self, head: LoopHeader, names: dict[str, Any]) -> None:
        values: list = []
        grown: dict[tuple, Any] = {}
        for name, before in head.names.items():
            if name not in names:
                raise Untraceable(f"'{name}' is not defined on all paths through a loop")
            self._close_phis(head, before, names[name], values, grown)
        if grown:
            raise Grows(grown)
        self._enter(head.block, head.phis, values)

    def _close_phis(
        self, head: LoopHeader, before: Any, after: Any, values: list, grown: dict
    ) -> None:
        if isinstance(before, Value | HeldValue):
            path = head.paths[len(values)]
            if is_number_type(after):
                raise Grows({path: after})
            kind = types.unliteral(self.lowering.kind_of(after))
            is_real = isinstance(scalar_of(kind), types.Float)
            if kind != before._kind and is_real and is_literal(head.phis[len(values)].on[0]):
                grown[path] = kind
            both = self.lowering.unify(kind, before._kind)
            if both != before._kind:
                if isinstance(both, types.Integer):
                    grown[path] = both
                elif path not in grown:
                    raise Untraceable(f"{words(before._kind)} becomes {words(kind)}{IN_A_LOOP}")
            values.append(after)
        elif isinstance(before, tuple):
            if type(before) is not type(after) or len(before) != len(after):
                raise Untraceable(f"a tuple becomes a tuple of another kind{IN_A_LOOP}")
            for one, other in zip(before, after, strict=True):
                self._close_phis(head, one, other, values, grown)
        elif not _is_same(before, after):
            raise Untraceable(f"{before!r} becomes something else{IN_A_LOOP}")

    def counted(self, bounds: tuple) -> Counter:
        lowering, builder = self.lowering, self.builder
        kind = _counter(tuple(types.unliteral(lowering.kind_of(bound)) for bound in bounds))
        start, stop, step = {1: (0, *bounds, 1), 2: (*bounds, 1)}.get(len(bounds), bounds)
        fixed = step if isinstance(step, int) else None
        if fixed == 0:
            raise ValueError("the step of a range is 0")
        start, stop, step = (
            Value(kind, lowering.lowered(bound, kind)) for bound in (start, stop, step)
        )

        def goes_on(counter: Value) -> Value:
            if fixed is None:
                up = emit(operator.and_, step > 0, counter < stop)
                return emit(operator.or_, up, emit(operator.and_, step < 0, counter > stop))
            compare = builder.icmp_signed if kind.signed else builder.icmp_unsigned
            sign = "<" if fixed > 0 else ">"
            return Value(types.boolean, compare(sign, counter._value, stop._value))

        def after(counter: Value) -> Value:
            return Value(kind, builder.add(counter._value, step._value, flags=("nsw",)))

        return Counter(start, goes_on, after)

    def negate(self, thing: Any) -> Any:
        return emit(operator.not_, thing) if is_value(thing) else not thing

    def both(self, a: Any, b: Any) -> Any:
        return emit(operator.and_, a, b) if is_value(a) and is_value(b) else a and b

    def item(self, things: Any, index: Any) -> Any:
        if isinstance(things, tuple) and is_value(index):
            return emit(operator.getitem, things, index)
        return things[index]

    def call(self, function: Callable, arguments: list, keywords: dict) -> Any:
        if function is len and is_value(arguments[0]):
            return emit(len, arguments[0])
        if function is range and any(map(is_value, arguments)):
            return Range(*arguments)
        if function is enumerate and len(arguments) == 1 and isinstance(arguments[0], HeldValue):
            return Numbered(arguments[0])
        if isinstance(function, python.MethodType) and isinstance(function.__self__, tuple):
            plain = function.__func__
            if plain.__name__[0] != "_" and not hasattr(function, "__wrapped__"):
                return self.lowering.seen(plain)(function.__self__, *arguments, **keywords)
        return function(*arguments, **keywords)
