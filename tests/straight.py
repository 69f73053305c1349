"""Interpreted loops without what chooses by type: for tests that take many steps.

Interpreted, a step of a point is some thousand calls of small functions, nine tenths of its time.
Here the functions that a visit calls for each point and node are run once on :class:`Known`
values, which write down every operation that meets them; what was written is a straight function
of the same operations in the same order, so of the same bits, that is called from then on. A
question that only a value can answer (`if x > 0`) is answered as it was at first: before anything
is stored, what was written asks again, and leaves it to a function written for the other answer.
"""

import builtins
import operator
import re
import threading
import types
from collections.abc import Callable
from itertools import count
from linecache import getlines
from typing import Any

import numpy as np

from karamelo_py.compiler import compile as compiling
from karamelo_py.compiler.compile import SPELLED
from karamelo_py.kernels import stencils, sums, sweep
from karamelo_py.kernels.visit import Work

# Calls from which on it is worth to write a function down: what is done at one node, and a visit.
AFTER, AFTER_VISITS = 300, 80


class Branches(Exception):
    """A function asks for a value when something may have been stored already."""


def _ask(*arguments: Any) -> Any:
    raise Branches


class Known:
    """A number, an array or the like: what it is now, and the expression that gives it."""

    __array_ufunc__ = None

    def __init__(self, text: str, value: Any):
        self.__dict__.update(_text=text, _value=value)

    __int__ = __float__ = __iter__ = __len__ = __contains__ = _ask
    __hash__ = object.__hash__

    def __bool__(self) -> bool:
        answer = bool(self._value)
        _writer().ask(f"not {ref(self)}" if answer else ref(self))
        return answer

    def __index__(self) -> int:
        answer = operator.index(self._value)
        _writer().ask(f"{ref(self)} != {answer}")
        return answer

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return _writer().load(self, f".{name}", getattr(self._value, name))

    def __setattr__(self, name: str, value: Any) -> None:
        _writer().store(self, f".{name}", value)
        setattr(self._value, name, actual(value))

    def __getitem__(self, place: Any) -> Any:
        return _writer().load(self, f"[{ref(place)}]", self._value[actual(place)])

    def __setitem__(self, place: Any, value: Any) -> None:
        _writer().store(self, f"[{ref(place)}]", value)
        self._value[actual(place)] = actual(value)


def _operators() -> None:
    signs = {
        "add": "+", "sub": "-", "mul": "*", "truediv": "/", "floordiv": "//", "mod": "%",
        "pow": "**", "and_": "&", "or_": "|", "xor": "^", "lshift": "<<", "rshift": ">>",
        "lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!=",
    }  # fmt: skip
    for name, sign in signs.items():
        do = getattr(operator, name)
        plain = name.rstrip("_")

        def apply(a: Any, b: Any, do: Any = do, sign: str = sign) -> Known:
            if isinstance(b, tuple):
                raise Branches
            return _writer().pure(f"{ref(a)} {sign} {ref(b)}", do(actual(a), actual(b)))

        setattr(Known, f"__{plain}__", apply)
        setattr(Known, f"__r{plain}__", lambda a, b, apply=apply: apply(b, a))
    for name, sign in {"neg": "-", "pos": "+", "invert": "~"}.items():
        do = getattr(operator, name)
        setattr(
            Known,
            f"__{name}__",
            lambda a, do=do, sign=sign: _writer().pure(f"{sign}{ref(a)}", do(a._value)),
        )
    Known.__abs__ = lambda a: _writer().pure(f"abs({ref(a)})", abs(a._value))


_operators()


class Writer:
    """The text of a function that is being written."""

    def __init__(self, given: str) -> None:
        self.given = given  # the names of the arguments
        self.lines: list[str] = []
        self.names: dict[str, Any] = {}  # of constants and functions
        self.once: dict[str, Known] = {}  # what has been computed
        self.loaded: dict[str, Any] = {}  # what has been read since the last store
        self.paths: dict[int, tuple[Any, str]] = {}  # of tuples that are not made here
        self.waiting: dict[tuple[str, str], Any] = {}  # to be stored: array and place, value
        self.stored = False  # whether something has been
        self.asked: set[str] = set()
        self.kept: set[str] = set()  # what is called, for all that it may do
        self.arrays: dict[tuple, str] = {}  # by the memory that they are
        self.failed: set = set()

    def new(self, text: str, value: Any) -> Any:
        """What an expression gives, under a name of its own."""
        name = f"v{len(self.lines)}"
        self.lines.append(f"{name} = {text}")
        return self.wrap(value, name)

    def pure(self, text: str, value: Any) -> Any:
        """The same for what depends on nothing but values: computed once."""
        if text not in self.once:
            self.once[text] = self.new(text, value)
        return self.once[text]

    def load(self, array: Known, place: str, value: Any) -> Any:
        """The same for what is read from memory."""
        if callable(value) or isinstance(value, np.ndarray):
            raise Branches
        name = ref(array)
        for there, other in self.waiting:
            if there == name and (other == place or not _apart(other, place)):
                known = self.waiting[there, other]
                if other == place and type(actual(known)) is type(value):
                    return known
                self.flush()
                break
        if name + place not in self.loaded:
            self.loaded[name + place] = self.new(name + place, value)
        return self.loaded[name + place]

    def store(self, array: Known, place: str, value: Any) -> None:
        """Something will be written to memory: when all questions are answered."""
        name = ref(array)
        for there, other in self.waiting:
            if there == name and other != place and not _apart(other, place):
                self.flush()
                break
        self.loaded = {k: v for k, v in self.loaded.items() if not k.startswith(name)}
        self.waiting[name, place] = value

    def flush(self) -> None:
        """Write down what waits to be stored."""
        for (array, place), value in self.waiting.items():
            self.lines.append(f"{array}{place} = {ref(value)}")
        self.stored = self.stored or bool(self.waiting)
        self.waiting = {}

    def ask(self, otherwise: str) -> None:
        """What is written is not for arguments of which this holds."""
        if otherwise not in self.asked:
            if self.stored:
                raise Branches
            self.asked.add(otherwise)
            self.lines.append(f"if {otherwise}: return other({self.given})")

    def needed(self) -> list[str]:
        """The lines, without those whose result nothing uses."""
        lines, used = [], set(self.kept)
        for line in reversed(self.lines):
            name, equals, _ = line.partition(" = ")
            if not equals or not name.isidentifier() or name in used:
                used.update(re.findall(r"\bv\d+\b", line))
                lines.append(line)
        return lines[::-1]

    def state(self) -> tuple:
        """What is to be restored where a function cannot be run."""
        return (
            list(self.lines), dict(self.once), dict(self.loaded), dict(self.waiting), self.stored,
            set(self.asked),
        )  # fmt: skip

    def restore(self, state: tuple) -> None:
        """Back to an earlier state."""
        self.lines, self.once, self.loaded, self.waiting, self.stored, self.asked = state

    def constant(self, value: Any) -> str:
        """The name of something that is always the same."""
        for name, known in self.names.items():
            if known is value:
                return name
        name = f"c{len(self.names)}"
        self.names[name] = value
        return name

    def wrap(self, value: Any, path: str) -> Any:
        """What functions see of a value that `path` gives."""
        if isinstance(value, tuple):
            inner = [self.wrap(item, f"{path}[{k}]") for k, item in enumerate(value)]
            made = type(value)(*inner) if hasattr(value, "_fields") else tuple(inner)
            self.paths[id(made)] = made, path
            return made
        if value is None or isinstance(value, str | type):
            return value
        if isinstance(value, np.ndarray) and value.size:
            path = self.arrays.setdefault(_memory(value), path)
        return Known(path, value)


def _memory(array: np.ndarray) -> tuple:
    return array.__array_interface__["data"][0], array.shape, array.strides


def _apart(one: str, other: str) -> bool:
    """Whether two places in an array differ for sure: by a number."""
    if "slice" in one + other:
        return False
    here, there = (place[1:-1].strip("(), ").split(", ") for place in (one, other))
    pairs = zip(here, there, strict=False)
    return any(a != b and a.isdigit() and b.isdigit() for a, b in pairs)


_now = threading.local()  # ranks may be threads


def _writer() -> Writer:
    return _now.writer


def ref(thing: Any) -> str:
    """The text that stands for what functions see."""
    writer = _writer()
    if isinstance(thing, Known):
        text = thing._text
        if text.endswith("]"):  # a part of an argument, read once
            known = writer.once.get(text)
            if known is None:
                name = f"v{len(writer.lines)}"
                writer.lines.append(f"{name} = {text}")
                known = writer.once[text] = Known(name, thing._value)
            return known._text
        return text
    if isinstance(thing, tuple):
        if id(thing) in writer.paths and writer.paths[id(thing)][0] is thing:
            return writer.paths[id(thing)][1]
        inner = "".join(f"{ref(item)}, " for item in thing)
        return f"{writer.constant(type(thing)) if hasattr(thing, '_fields') else ''}({inner})"
    if isinstance(thing, slice):
        return f"slice({ref(thing.start)}, {ref(thing.stop)}, {ref(thing.step)})"
    if thing is None or type(thing) in (bool, int, str):
        return repr(thing)
    return writer.constant(thing)


def actual(thing: Any) -> Any:
    """The value behind what functions see."""
    if isinstance(thing, Known):
        return thing._value
    if isinstance(thing, tuple):
        inner = [actual(item) for item in thing]
        return type(thing)(*inner) if hasattr(thing, "_fields") else tuple(inner)
    return thing


def has_known(thing: Any) -> bool:
    """Whether there is a value among these."""
    return isinstance(thing, Known) or (isinstance(thing, tuple) and any(map(has_known, thing)))


# --- functions as they are run here ---------------------------------------------------------------


class _Globals(dict):
    def __init__(self, true: dict):
        super().__init__()
        self.true = true

    def __getitem__(self, name: str) -> Any:
        return seen(self.true[name] if name in self.true else getattr(builtins, name))


class _Module:
    def __init__(self, module: Any):
        self._module = module

    def __getattr__(self, name: str) -> Any:
        return seen(getattr(self._module, name))


class Called:
    """A function of the program: run if it can be, else called."""

    def __init__(self, function: Callable):
        self.function = function
        self.seen: Callable | None = None
        # As often as its numbers say: each other number would be another answer.
        text = getlines(function.__code__.co_filename)
        lines = {line for _, _, line in function.__code__.co_lines() if line}
        self.loops = bool(text) and any("while " in text[line - 1] for line in lines)
        # What stands there knows no arrays, or only reads them.
        self.is_pure = (function.__module__ or "").startswith("karamelo_py.points")

    def __getattr__(self, name: str) -> Any:
        return getattr(self.function, name)

    def chosen(self, arguments: tuple) -> Callable:
        """What is run for these arguments."""
        function = self.function
        if hasattr(function, "find"):
            found = function.find(tuple(type(a) for a in arguments[: function.tags]))
            return _called(found).run if found else self.run
        table = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
        if hasattr(function, "on") and "table" in table:
            return _called(table["table"].cell_contents[type(arguments[0])]).run
        return self.run

    @property
    def run(self) -> Callable:
        """The function with other globals."""
        if self.seen is None:
            function = self.function
            cells = tuple(types.CellType(seen(c.cell_contents)) for c in function.__closure__ or ())
            self.seen = types.FunctionType(
                function.__code__, _Globals(function.__globals__), function.__name__,
                function.__defaults__, cells,
            )  # fmt: skip
            self.seen.__kwdefaults__ = function.__kwdefaults__
        return self.seen

    def __call__(self, *arguments: Any) -> Any:
        writer = _writer()
        classes = self.function, tuple(type(a) for a in arguments)
        if classes not in writer.failed and not self.loops:
            before = writer.state()
            try:
                return self.chosen(arguments)(*arguments)
            except Branches:
                writer.restore(before)
                writer.failed.add(classes)
        if self.is_pure:
            return _opaque(self.function)(*arguments)
        writer.flush()
        writer.stored = True  # perhaps
        text = f"{writer.constant(self.function)}({', '.join(map(ref, arguments))})"
        writer.loaded.clear()
        writer.kept.add(f"v{len(writer.lines)}")
        return writer.new(text, self.function(*map(actual, arguments)))


def _real(value: Any, like: Any) -> Any:
    kind = type(actual(like))
    if has_known(value):
        return _writer().pure(f"{_writer().constant(kind)}({ref(value)})", kind(value._value))
    return Known(_writer().constant(kind(value)), kind(value))


def _choose(condition: Any, a: Any, b: Any) -> Any:
    if not isinstance(condition, Known):
        return a if condition else b
    if isinstance(a, tuple):
        return a if condition else b
    text = f"{ref(a)} if {ref(condition)} else {ref(b)}"
    return _writer().pure(text, actual(a) if condition._value else actual(b))


def _opaque(function: Callable) -> Callable:
    """A function without effects, of Python or a library."""

    def call(*arguments: Any) -> Any:
        if not has_known(arguments):
            return function(*arguments)
        text = f"{_writer().constant(function)}({', '.join(map(ref, arguments))})"
        return _writer().pure(text, function(*map(actual, arguments)))

    call.itself = function
    return call


def _type(thing: Any) -> type:
    if isinstance(thing, Known):
        raise Branches
    return type(thing)


def _isinstance(thing: Any, kind: Any) -> bool:
    return isinstance(actual(thing), getattr(kind, "itself", kind))


INSTEAD = {
    compiling.real: _real,
    compiling.choose: _choose,
    type: _type,
    isinstance: _isinstance,
}
AS_IT_IS = {len, range, zip, enumerate, tuple, list, dict, set, sum, any, all, map, slice, hasattr,
            getattr, reversed, next, iter, property}  # fmt: skip
_copies: dict[Callable, Called] = {}


def _called(function: Callable) -> Called:
    return _copies.setdefault(function, Called(function))


def seen(thing: Any) -> Any:
    """What takes the place of a global."""
    if isinstance(thing, types.ModuleType):
        return _Module(thing)
    try:
        if thing in INSTEAD:
            return INSTEAD[thing]
        if thing in AS_IT_IS:
            return thing
    except TypeError:
        return thing
    if isinstance(thing, type):
        return thing if issubclass(thing, tuple | BaseException) else _opaque(thing)
    if isinstance(thing, types.FunctionType):
        own = (thing.__module__ or "").startswith("karamelo_py")
        if own or hasattr(thing, "find") or thing.__code__.co_filename == SPELLED:
            return _called(thing)
        return _opaque(thing)
    if callable(thing) and not isinstance(thing, Called):
        return _opaque(thing)
    return thing


# --- what is written -----------------------------------------------------------------------------


def _copy(thing: Any, copies: dict) -> Any:
    """Arguments whose arrays may be changed; those that are one stay one."""
    if isinstance(thing, tuple):
        inner = [_copy(item, copies) for item in thing]
        return type(thing)(*inner) if hasattr(thing, "_fields") else tuple(inner)
    if not isinstance(thing, np.ndarray):
        return thing
    return copies.setdefault(_memory(thing), thing.copy())


def write(function: Callable, arguments: tuple, other: Callable) -> Callable:
    """The straight function of arguments like these; `other` serves those that answer otherwise."""
    names = ", ".join(f"a{k}" for k in range(len(arguments)))
    writer = _now.writer = Writer(names)
    copies: dict = {}
    given = [writer.wrap(_copy(a, copies), f"a{k}") for k, a in enumerate(arguments)]
    result = ref(_called(function)(*given))
    writer.flush()
    writer.lines.append(f"return {result}")
    return compiling.define(names, *writer.needed(), other=other, **writer.names)


# --- in the place of what visits call -------------------------------------------------------------


class Kinds:
    """Of tuples that stay for a while: classes, number types, and which arrays are one."""

    def __init__(self) -> None:
        self.known: dict[int, tuple] = {}
        self.numbers: dict[Any, int] = {}
        self.new = count()

    def __getitem__(self, thing: tuple) -> int:
        found = self.known.get(id(thing))
        if found is None:
            if len(self.known) > 500:
                self.known.clear()
            # A visit works with parts that stay, and with others of its tile; no array is in two.
            parts = isinstance(thing, Work)
            kind = tuple(self[part] for part in thing) if parts else _kind_of(thing, {})
            found = self.known[id(thing)] = thing, self.numbers.setdefault(kind, next(self.new))
        return found[1]


def _kind_of(thing: Any, arrays: dict) -> Any:
    if isinstance(thing, tuple):
        return type(thing), *(_kind_of(item, arrays) for item in thing)
    if isinstance(thing, np.ndarray):
        return thing.dtype.str, thing.ndim, arrays.setdefault(_memory(thing), len(arrays))
    return type(thing)


kinds = Kinds()


def lazily(
    function: Callable, after: int, answers: int = 4,
    tell: Callable[[Callable], None] = lambda made: None,
) -> Callable:  # fmt: skip
    """The function; `after` some calls a straight one, of so many different `answers`.

    ``tell(made)`` is called with what is run from then on.
    """
    calls, made = 0, None

    def call(*arguments: Any) -> Any:
        nonlocal calls, made
        if made is not None:
            return made(*arguments)
        calls += 1
        if calls < after or not answers:
            return function(*arguments)
        try:
            made = write(function, arguments, lazily(function, after, answers - 1))
        except Exception:
            made = function
        tell(made)
        return made(*arguments)

    return call


def straight(function: Callable, kind: Callable) -> Callable:
    """In the place of `function`: what is written for arguments of one ``kind(*arguments)``."""
    known: dict[Any, Callable] = {}
    made: set[Callable] = set()
    after = AFTER_VISITS if kind is of_visit else AFTER

    def find(arguments: tuple) -> Callable:
        key = kind(*arguments)

        def tell(what: Callable) -> None:
            known[key] = what
            made.add(what)

        if key not in known:
            known[key] = lazily(function, after, tell=tell)
        return known[key]

    def call(*arguments: Any) -> Any:
        return find(arguments)(*arguments)

    # A loop over nodes asks with the same three tuples again and again; looking up their kind
    # would take longer than what is done at a node. Held here, none is another one's memory.
    last: tuple = (None, None, None, None)

    def at_node(one: tuple, kin: tuple, nodes: tuple, *rest: Any) -> Any:
        nonlocal last
        a, b, c, found = last
        if one is not a or kin is not b or nodes is not c:
            arguments = one, kin, nodes, *rest
            found = find(arguments)
            if found in made:
                last = one, kin, nodes, found
        return found(one, kin, nodes, *rest)

    return at_node if kind in (of_node, of_record) else call


def of_visit(tags: tuple, w: tuple, *others: Any) -> tuple:
    """The kind of a visit, and of its length or the like."""
    return kinds[tags], kinds[w], type(others[-1])


def of_place(basis: tuple, kin: tuple, grid: tuple, place: tuple) -> tuple:
    """The kind of a place."""
    return type(basis), type(kin), kinds[grid], len(place), type(place[0])


def of_node(task: tuple, kin: tuple, nodes: tuple, n: int, dt: float) -> tuple:
    """The kind of a task at a node."""
    return type(task), type(kin), kinds[nodes], type(dt)


def of_point(basis: tuple, kin: tuple, array: np.ndarray, p: int) -> tuple:
    """The kind of where a point is."""
    return type(basis), type(kin), array.dtype


def of_stencil(weights: tuple, w: tuple, stencil: tuple, p: int) -> tuple:
    """The kind of a stencil after the move."""
    return type(weights), kinds[w]


def of_record(quantities: tuple, kin: tuple, nodes: tuple, n: int) -> tuple:
    """The kind of what is cleared at a node."""
    return kinds[quantities], type(kin), kinds[nodes]


_FOUND = {
    **{(stencils, name): of_visit for name in ("_gather", "_scatter", "empty_all")},
    **{(sweep, name): of_visit for name in ("settled_all", "load_all")},
    (sweep, "locate"): of_place,
    (sweep, "place_at"): of_point,
    (sweep, "recompute_stencil"): of_stencil,
    (sweep, "at_node"): of_node,
    (sums, "_clear_record"): of_record,
}
_PLAIN = {(module, name): getattr(module, name) for module, name in _FOUND}
_STRAIGHT = {place: straight(_PLAIN[place], kind) for place, kind in _FOUND.items()}


def use(functions: dict = _STRAIGHT) -> None:
    """Let visits of points and nodes call straight functions."""
    for (module, name), function in functions.items():
        setattr(module, name, function)


def use_plain() -> None:
    """Let them call what there is."""
    use(_PLAIN)
