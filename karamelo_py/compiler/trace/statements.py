"""Compiles a function's text, statement by statement.

Python values are computed at once. If a condition is known only at run time, both branches are
written, and variables are merged as phis of SSA form. A loop over a known range is unrolled if it
is short or cannot remain a loop; other loops remain loops.
"""

import ast
import builtins
import copy
import dis
import functools
import inspect
import linecache
import operator
import os
import time
import types as python
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
from numba import types

from karamelo_py.compiler.code import exceptions
from karamelo_py.compiler.trace import values
from karamelo_py.compiler.trace.choices import codes_in
from karamelo_py.compiler.trace.flow import Edge, Flow, Grows, Numbered, Range, is_value
from karamelo_py.compiler.trace.values import LONG, HeldValue, Untraceable, emit


@functools.cache
def _stored(node: ast.AST) -> frozenset[str]:
    return frozenset(
        n.id for n in ast.walk(node) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)
    )


@functools.cache
def _globals_in(code: python.CodeType) -> frozenset[str]:
    """List globals, and from Python 3.12 on variables of comprehensions."""
    loads = (i for one in codes_in(code) for i in dis.get_instructions(one))
    return frozenset(i.argval for i in loads if i.opname == "LOAD_GLOBAL")


_began = time.time()


def _is_as_read(code: python.CodeType, text: str) -> bool:
    """Return True if a file is unchanged since Python read it."""
    try:
        about = os.stat(code.co_filename)
    except OSError:
        return True
    if max(about.st_ctime, about.st_mtime) < _began:
        return True
    return code in codes_in(compile(text, code.co_filename, "exec", dont_inherit=True))


_parsed = functools.cache(ast.parse)


def _functions_at(line: int, within: ast.AST) -> Iterator[ast.FunctionDef | ast.Lambda]:
    """Yield functions that begin at a line; decorators are part of them."""
    for node in ast.iter_child_nodes(within):
        if isinstance(node, ast.stmt | ast.expr):
            begins = [node.lineno, *(d.lineno for d in vars(node).get("decorator_list", ()))]
            if not min(begins) <= line <= (node.end_lineno or line):
                continue
            if min(begins) == line and isinstance(node, ast.FunctionDef | ast.Lambda):
                yield node
        yield from _functions_at(line, node)


def _has(node: ast.expr, code: python.CodeType) -> bool:
    begin, end = (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)
    places = [p for p in code.co_positions() if None not in p and p[3]]
    return all(begin <= (p[0], p[2]) and (p[1], p[3]) <= end for p in places)


@functools.cache
def source_of(code: python.CodeType) -> list[ast.stmt]:
    text = "".join(linecache.getlines(code.co_filename))
    if not _is_as_read(code, text):
        raise Untraceable("its file has changed since Python read it: start again")
    candidates = [*_functions_at(code.co_firstlineno, _parsed(text))]
    for node in candidates:
        if isinstance(node, ast.FunctionDef) and node.name == code.co_name:
            return node.body
    # a line may have several lambdas, or nested ones
    bodies = [n.body for n in candidates if isinstance(n, ast.Lambda) and _has(n.body, code)]
    if code.co_name != "<lambda>" or not bodies:
        raise Untraceable("its text is unknown: write it to a file")
    body = max(bodies, key=lambda body: body.col_offset)
    return [ast.copy_location(ast.Return(body), body)]


class AstFunction:
    """Compiles a function from its text where it is called.

    ``seen(thing)`` replaces globals, closure variables and defaults.
    """

    def __init__(self, function: Callable, seen: Callable[[Any], Any]):
        self.function, self.seen = function, seen
        self.__code__ = code = function.__code__
        self.body = source_of(code)
        self.generates = bool(code.co_flags & inspect.CO_GENERATOR)
        # By loop, and by all that determines its code: the types of initial literals by name, or
        # None for an unrolled loop.
        self.loops: dict[tuple, dict | None] = {}
        others = code.co_kwonlyargcount or code.co_flags & (
            inspect.CO_VARARGS | inspect.CO_VARKEYWORDS
        )
        self.plain = -1 if others else code.co_argcount  # parameters, if all are positional

    @functools.cached_property
    def signature(self) -> inspect.Signature:
        function, code = self.function, self.__code__
        plain = python.FunctionType(
            code, {}, code.co_name, function.__defaults__, function.__closure__
        )  # the code object has the same signature
        plain.__kwdefaults__ = function.__kwdefaults__
        return inspect.signature(plain)

    def free(self) -> dict[str, Any]:
        names = self.__code__.co_freevars
        cells = zip(names, self.function.__closure__ or (), strict=True)
        return {name: self.seen(cell.cell_contents) for name, cell in cells} if names else {}

    def of_module(self, name: str) -> Any:
        true = self.function.__globals__
        if name not in true and not hasattr(builtins, name):
            raise NameError(f"name '{name}' is not defined")
        return self.seen(true[name] if name in true else getattr(builtins, name))

    def __call__(self, *arguments: Any, **keywords: Any) -> Any:
        if not keywords and len(arguments) == self.plain:
            names = dict(zip(self.__code__.co_varnames, arguments, strict=False))
        else:
            names = _bound(self.signature, arguments, keywords, self.seen)
        return AstCompiler(self, names, self.free()).result()


def _bound(
    signature: inspect.Signature, arguments: tuple, keywords: dict, seen: Callable = lambda x: x
) -> dict[str, Any]:
    """Return a call's initial variables; `seen` replaces defaults."""
    bound = signature.bind(*arguments, **keywords)
    passed = {*bound.arguments}
    bound.apply_defaults()
    return {n: x if n in passed else seen(x) for n, x in bound.arguments.items()}


def _shape(thing: Any, *within: Callable) -> Any:
    """Replace values by their types. `within`: the functions whose closures are being read."""
    if isinstance(thing, values.Value | values.HeldValue):
        return thing._kind._code
    if isinstance(thing, dict):
        thing = tuple(thing.items())
    if isinstance(thing, tuple | list | set):
        return type(thing), *(_shape(item, *within) for item in thing)
    if isinstance(thing, int | float | np.generic):  # repr tells 0, 0.0, -0.0 and False apart
        return type(thing), repr(thing)
    if isinstance(thing, python.FunctionType) and hasattr(thing, "closes_over"):
        return thing not in within and _shape(thing.closes_over(), thing, *within)
    return thing


_BINARY = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.MatMult: operator.matmul,
    ast.Div: operator.truediv, ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod,
    ast.Pow: operator.pow, ast.BitAnd: operator.and_, ast.BitOr: operator.or_,
    ast.BitXor: operator.xor, ast.LShift: operator.lshift, ast.RShift: operator.rshift,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Invert: operator.invert,
}  # fmt: skip
_CHANGING = (list, dict, set)
_ON_ALL_WAYS = "a list cannot be changed on one of several branches only"
_IMPORT = "`import` within a function: import at the top of the file"
_WORDS = {
    "Try": "`try` or `with`", "With": "`try` or `with`", "Delete": "`del`",
    "Import": _IMPORT, "ImportFrom": _IMPORT,
    "Global": "`global`", "Nonlocal": "`nonlocal`", "Match": "`match`", "ClassDef": "`class`",
    "Raise": "`raise` of this kind", "FunctionDef": "nested function of this kind",
}  # fmt: skip


class AstCompiler:
    def __init__(self, walked: AstFunction, names: dict[str, Any], free: dict[str, Any]):
        self.walked, self.names, self.free = walked, names, free
        self.depth = 0  # depth of nested branches and loops in the kernel
        self.yielded: list = []
        self.goes = True  # False after a return or raise
        self.returns: list[Edge] = []
        self.breaks: list[Edge] = []
        self.continues: list[Edge] = []

    @property
    def flow(self) -> Flow:
        return values.now().flow

    def result(self) -> Any:
        self.block(self.walked.body)
        if self.walked.generates:  # generators are evaluated at once
            return self.yielded
        if self.goes:
            self.names = {"": None}
            self.returns.append(self.edge())
        self.meet(self.returns)
        if "" not in self.names:
            raise Untraceable("its results have different types on different branches")
        return self.names[""]

    @property
    def branches(self) -> bool:
        return bool(self.depth or self.returns or self.breaks or self.continues)

    def edge(self) -> Edge:
        return self.flow.edge(self.names)

    def here(self) -> list[Edge]:
        return [self.edge()] if self.goes else []

    def leave(self, edges: list[Edge]) -> None:
        edges.append(self.edge())
        self.goes = False

    def meet(self, edges: list[Edge]) -> None:
        self.goes = bool(edges)
        if edges:
            self.names = self.flow.meet(edges)

    def branch(self, condition: Any, then: Callable, otherwise: Callable) -> None:
        edges: list[Edge] = []
        before = self.names
        for begin, do in zip(self.flow.split(condition), (then, otherwise), strict=True):
            self.names = dict(before)
            self.goes = True
            self.flow.start(begin)
            self.depth += 1
            do()
            self.depth -= 1
            edges += self.here()
        self.meet(edges)

    def do(self, node: ast.AST) -> Any:
        kind = type(node)
        if kind is ast.Name and node.id in self.names:  # half of all nodes are names
            return self.names[node.id]
        return _COMPILED.get(kind, AstCompiler.unknown)(self, node)

    def unknown(self, node: ast.AST) -> None:
        kind = type(node).__name__
        raise Untraceable(f"kernels do not support {_WORDS.get(kind, kind)}")

    def name(self, name: str) -> Any:
        if name in self.names:
            return self.names[name]
        if name in self.free:
            return self.free[name]
        code = self.walked.__code__
        if name in code.co_varnames and name not in _globals_in(code):
            raise Untraceable(f"'{name}' has different types on different branches")
        return self.walked.of_module(name)

    def Name(self, node: ast.Name) -> Any:
        return self.name(node.id)

    def Constant(self, node: ast.Constant) -> Any:
        return node.value

    def Attribute(self, node: ast.Attribute) -> Any:
        return getattr(self.do(node.value), node.attr)

    def Slice(self, node: ast.Slice) -> slice:
        return slice(*(n and self.do(n) for n in (node.lower, node.upper, node.step)))

    def Subscript(self, node: ast.Subscript) -> Any:
        return self.flow.item(self.do(node.value), self.do(node.slice))

    def items(self, nodes: list[ast.expr]) -> list:
        out: list = []
        for node in nodes:
            if type(node) is ast.Starred:
                out += self.do(node.value)
            else:
                out.append(self.do(node))
        return out

    def Tuple(self, node: ast.Tuple) -> tuple:
        return tuple(self.items(node.elts))

    def List(self, node: ast.List) -> list:
        return self.items(node.elts)

    def Set(self, node: ast.Set) -> set:
        return set(self.items(node.elts))

    def Dict(self, node: ast.Dict) -> dict:
        if None in node.keys:
            self.unknown(node)
        return dict(zip(map(self.do, node.keys), map(self.do, node.values), strict=True))

    def JoinedStr(self, node: ast.JoinedStr) -> str:
        return "".join(map(self.do, node.values))

    def FormattedValue(self, node: ast.FormattedValue) -> str:
        value = self.do(node.value)
        if is_value(value):
            raise Untraceable("kernels do not support text with numbers in it")
        if node.conversion >= 0:
            value = {"s": str, "r": repr, "a": ascii}[chr(node.conversion)](value)
        return format(value, self.do(node.format_spec) if node.format_spec else "")

    def Yield(self, node: ast.Yield) -> None:
        if self.branches or not self.walked.generates:
            self.unknown(node)
        self.yielded.append(node.value and self.do(node.value))

    def YieldFrom(self, node: ast.YieldFrom) -> None:
        self.yielded += self.do(node.value)

    def NamedExpr(self, node: ast.NamedExpr) -> Any:
        self.names[node.target.id] = value = self.do(node.value)
        return value

    def BinOp(self, node: ast.BinOp) -> Any:
        return _BINARY[type(node.op)](self.do(node.left), self.do(node.right))

    def UnaryOp(self, node: ast.UnaryOp) -> Any:
        value = self.do(node.operand)
        if isinstance(node.op, ast.Not):
            return self.flow.negate(value)
        return _BINARY[type(node.op)](value)

    def Compare(self, node: ast.Compare) -> Any:
        left = self.do(node.left)
        result: Any = True
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            right = self.do(right_node)
            one = self.compare(op, left, right)
            result = one if result is True else self.flow.both(result, one)
            if result is False:
                return False
            left = right
        return result

    def compare(self, op: ast.cmpop, a: Any, b: Any) -> Any:
        if isinstance(op, ast.Is | ast.IsNot):
            return (a is b) == isinstance(op, ast.Is)
        if isinstance(op, ast.In):
            return self.among(a, b)
        if isinstance(op, ast.NotIn):
            return self.flow.negate(self.among(a, b))
        return _BINARY[type(op)](a, b)

    def among(self, a: Any, things: Any) -> Any:
        if is_value(things):
            raise Untraceable("kernels do not support `in` for arrays")
        same = [operator.eq(a, b) for b in things] if is_value(a) else [a in things]
        return functools.reduce(lambda one, other: emit(operator.or_, one, other), same or [False])

    def BoolOp(self, node: ast.BoolOp) -> Any:
        return self.chain(node.values, isinstance(node.op, ast.And))

    def chain(self, nodes: list[ast.expr], every: bool) -> Any:
        """Compile `and` or `or`; the result is the first value that decides, or else the last."""
        value = self.do(nodes[0])
        if len(nodes) == 1:
            return value
        if not is_value(value):
            return self.chain(nodes[1:], every) if bool(value) == every else value
        rest, stay = (lambda: self.chain(nodes[1:], every)), (lambda: value)
        return self.either(value, *((rest, stay) if every else (stay, rest)))

    def either(self, condition: Any, then: Callable, otherwise: Callable) -> Any:
        result = ast.Name("?")
        self.branch(
            condition, lambda: self.give(result, then()), lambda: self.give(result, otherwise())
        )
        if "?" not in self.names:
            raise Untraceable("an expression has values of two types")
        return self.names.pop("?")

    def IfExp(self, node: ast.IfExp) -> Any:
        condition = self.do(node.test)
        if not is_value(condition):
            return self.do(node.body if condition else node.orelse)
        return self.either(condition, lambda: self.do(node.body), lambda: self.do(node.orelse))

    def Call(self, node: ast.Call) -> Any:
        function = self.do(node.func)
        if (
            self.branches
            and hasattr(function, "__self__")
            and isinstance(function.__self__, _CHANGING)
        ):
            raise Untraceable(_ON_ALL_WAYS)
        arguments = self.items(node.args)
        keywords: dict[str, Any] = {}
        for one in node.keywords:
            value = self.do(one.value)
            keywords.update({one.arg: value} if one.arg else value)
        return self.flow.call(function, arguments, keywords)

    def Lambda(self, node: ast.Lambda) -> Callable:
        signature = self.signature(node.args)

        def call(*arguments: Any, **keywords: Any) -> Any:
            outer = self.names
            self.names = outer | _bound(signature, arguments, keywords)
            try:
                return self.do(node.body)
            finally:
                self.names = outer

        return self.closing(call, node, signature)

    def signature(self, parameters: ast.arguments) -> inspect.Signature:
        bare = copy.copy(parameters)
        bare.defaults, bare.kw_defaults = [], [None] * len(parameters.kwonlyargs)
        text = ast.fix_missing_locations(ast.Expression(ast.Lambda(bare, ast.Constant(None))))
        function = eval(compile(text, "signature", "eval"))
        function.__defaults__ = tuple(map(self.do, parameters.defaults))
        pairs = zip(parameters.kwonlyargs, parameters.kw_defaults, strict=True)
        function.__kwdefaults__ = {a.arg: self.do(node) for a, node in pairs if node is not None}
        return inspect.signature(function)

    def closing(
        self, call: Any, node: ast.Lambda | ast.FunctionDef, signature: inspect.Signature
    ) -> Callable:
        """Store in a function its source and its variables, which determine the machine code."""
        read = {n.id for n in ast.walk(node) if isinstance(n, ast.Name)}
        variables = lambda: {n: x for n, x in (self.free | self.names).items() if n in read}  # noqa: E731
        defaults = [p.default for p in signature.parameters.values()]
        call.closes_over = lambda: (node, defaults, variables())
        return call

    def comprehended(self, node: ast.expr, item: Callable[[], Any]) -> list:
        out: list = []
        outer = dict(self.names)

        def go(k: int) -> None:
            if k == len(node.generators):
                out.append(item())
                return
            one = node.generators[k]
            items = self.do(one.iter)
            if isinstance(items, range) and len(items) > LONGEST:
                raise Untraceable(
                    f"a range of more than {LONGEST} numbers in a comprehension: use a loop"
                )
            for value in items:
                self.give(one.target, value)
                if all(self.do(test) for test in one.ifs):
                    go(k + 1)

        go(0)
        self.names = outer
        return out

    def ListComp(self, node: ast.ListComp | ast.GeneratorExp) -> list:
        return self.comprehended(node, lambda: self.do(node.elt))

    def SetComp(self, node: ast.SetComp) -> set:
        return set(self.ListComp(node))

    def DictComp(self, node: ast.DictComp) -> dict:
        return dict(self.comprehended(node, lambda: (self.do(node.key), self.do(node.value))))

    GeneratorExp = ListComp

    def block(self, statements: list[ast.stmt]) -> None:
        for statement in statements:
            if not self.goes:
                return
            try:
                self.do(statement)
            except BaseException as error:
                here = self.walked.__code__.co_filename, statement.lineno
                vars(error).setdefault("places", []).append(here)
                raise

    def Pass(self, node: ast.Pass) -> None:
        pass

    def Expr(self, node: ast.Expr) -> None:
        self.do(node.value)

    def Return(self, node: ast.Return) -> None:
        self.names = {"": self.do(node.value) if node.value else None}
        self.leave(self.returns)

    def Break(self, node: ast.Break) -> None:
        self.leave(self.breaks)

    def Continue(self, node: ast.Continue) -> None:
        self.leave(self.continues)

    def Assign(self, node: ast.Assign) -> None:
        value = self.do(node.value)
        for target in node.targets:
            self.give(target, value)

    def AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value:
            self.give(node.target, self.do(node.value))

    def FunctionDef(self, node: ast.FunctionDef) -> None:
        if node.decorator_list:
            self.unknown(node)
        signature = self.signature(node.args)

        def call(*arguments: Any, **keywords: Any) -> Any:
            inner = copy.copy(self.walked)
            inner.body, inner.generates = node.body, False
            names = _bound(signature, arguments, keywords)
            return AstCompiler(inner, names, self.free | self.names).result()

        self.names[node.name] = self.closing(call, node, signature)

    def Raise(self, node: ast.Raise) -> None:
        exception, arguments = node.exc, []
        if isinstance(exception, ast.Call):
            exception, arguments = exception.func, self.items(exception.args)
        kind = vars(builtins).get(exception.id) if isinstance(exception, ast.Name) else None
        if not isinstance(kind, type) or any(map(is_value, arguments)):
            self.unknown(node)
        exceptions.fail(self.flow.builder, kind, tuple(arguments))
        self.goes = False

    def Assert(self, node: ast.Assert) -> None:
        text = [node.msg] if node.msg else []
        failed = ast.Raise(ast.Call(ast.Name(AssertionError.__name__), text, []))
        self.If(ast.If(node.test, [], [ast.copy_location(failed, node)]))

    def give(self, target: ast.expr, value: Any) -> None:
        if isinstance(target, ast.Name):
            self.names[target.id] = value
        elif isinstance(target, ast.Tuple | ast.List):
            values = list(value)
            stars = [k for k, t in enumerate(target.elts) if isinstance(t, ast.Starred)]
            if stars:
                first, behind = stars[0], len(target.elts) - 1 - stars[0]
                values[first : len(values) - behind] = [values[first : len(values) - behind]]
            for inner, item in zip(target.elts, values, strict=True):
                self.give(inner.value if isinstance(inner, ast.Starred) else inner, item)
        elif isinstance(target, ast.Attribute):
            setattr(self.do(target.value), target.attr, value)
        elif isinstance(target, ast.Subscript):
            self.changed(target)[self.do(target.slice)] = value
        else:
            self.unknown(target)

    def changed(self, target: ast.Subscript) -> Any:
        things = self.do(target.value)
        if self.branches and isinstance(things, _CHANGING):
            raise Untraceable(_ON_ALL_WAYS)
        return things

    def AugAssign(self, node: ast.AugAssign) -> None:
        operation = _BINARY[type(node.op)]
        target = node.target
        if isinstance(target, ast.Attribute):
            thing = self.do(target.value)
            made = operation(getattr(thing, target.attr), self.do(node.value))
            setattr(thing, target.attr, made)
        elif isinstance(target, ast.Subscript):
            things, index = self.changed(target), self.do(target.slice)
            things[index] = operation(things[index], self.do(node.value))
        else:
            before = self.name(target.id)
            if is_value(before) and isinstance(before._kind, types.Array):  # changed in place
                raise Untraceable("an array as a whole is changed: change its items")
            self.names[target.id] = operation(before, self.do(node.value))

    def If(self, node: ast.If) -> None:
        condition = self.do(node.test)
        if is_value(condition):
            self.branch(condition, lambda: self.block(node.body), lambda: self.block(node.orelse))
        else:
            self.block(node.body if condition else node.orelse)

    def For(self, node: ast.For) -> None:
        through = self.do(node.iter)
        if isinstance(through, range) and len(through) > LONG:
            bounds = through.start, through.stop, through.step
            if self.rolls(node, bounds, lambda k: k):
                return
        items = through.items if isinstance(through, Numbered) else through
        if isinstance(items, HeldValue) and len(items) > ALIKE and len(set(items._kind)) == 1:
            at, numbered = self.flow.lowering.item_at, isinstance(through, Numbered)
            one = (lambda k: (k, at(items, k))) if numbered else lambda k: at(items, k)
            if self.rolls(node, (len(items),), one):
                return
        if is_value(through):
            self.roll(node, (through.shape[0],), lambda k: through[k])
        elif isinstance(through, Range):
            self.roll(node, through.bounds, lambda k: k)
        else:
            self.unroll(node, through)

    def rolls(self, node: ast.For, bounds: tuple, item: Callable) -> bool:
        """Compile a loop over a known range as a loop; return False if that is impossible."""
        loops, key = self.walked.loops, (node, _shape((self.names, self.free)))
        if loops.get(key, {}) is None:
            return False
        go_back = self.state()
        try:
            self.roll(node, bounds, item)
        except (Exception, Untraceable):
            go_back()
            loops[key] = None
            return False
        return True

    def state(self) -> Callable[[], None]:
        """Return a function that goes back to this state and removes the code written since."""
        names, depth = dict(self.names), self.depth
        breaks, continues, returns = self.breaks, self.continues, [*self.returns]
        lowering = self.flow.lowering
        read, remove = dict(lowering.read), lowering.removal()

        def go_back() -> None:
            self.names, self.breaks, self.continues = dict(names), breaks, continues
            self.returns, lowering.read = [*returns], dict(read)
            self.goes, self.depth = True, depth
            remove()

        return go_back

    def unroll(self, node: ast.For, through: Iterable) -> None:
        outer = self.breaks, self.continues
        self.breaks, self.continues = [], []
        for item in through:
            self.give(node.target, item)
            self.block(node.body)
            self.meet([*self.continues, *self.here()])
            self.continues = []
            if not self.goes:
                break
        breaks, (self.breaks, self.continues) = self.breaks, outer
        self.block(node.orelse)
        self.meet([*breaks, *self.here()])

    def While(self, node: ast.While) -> None:
        self.roll(node, None)

    def roll(
        self, node: ast.For | ast.While, bounds: tuple | None, item: Callable | None = None
    ) -> None:
        """Compile a loop that ends at run time; `item` maps the count to the loop variable.

        If the type of an initial literal has to change, the loop is compiled again.
        """
        loops, key = self.walked.loops, (node, _shape((self.names, self.free)))
        grown, go_back = loops.get(key) or {}, self.state()
        while True:
            self.depth += 1
            try:
                self.rolled(node, bounds, item, grown)
                loops[key] = grown
                self.depth -= 1
                return
            except Grows as number:
                grown = grown | number.grown
                go_back()

    def rolled(
        self, node: ast.For | ast.While, bounds: tuple | None, item: Callable | None, grown: dict
    ) -> None:
        counter = None if bounds is None else self.flow.counted(bounds)
        outer = self.breaks, self.continues
        self.breaks, self.continues = [], []
        if counter:
            self.names[_COUNT] = counter.start
        changed = _stored(node) | ({_COUNT} if counter else frozenset())
        head, self.names = self.flow.loop(self.names, changed, grown)
        count = self.names.get(_COUNT)
        condition = counter.goes_on(count) if counter else self.do(node.test)
        edges = []
        if is_value(condition):
            inside, outside = self.flow.split(condition)
            edges.append(outside._replace(names=self.names))
            self.names = dict(self.names)
            self.flow.start(inside)
        elif not condition:
            raise Untraceable("a loop that never begins")
        if counter:
            self.give(node.target, item(count))
        self.block(node.body)
        self.meet([*self.continues, *self.here()])
        if self.goes:
            if counter:
                self.names[_COUNT] = counter.after(count)
            self.flow.close(head, self.names)
        breaks, (self.breaks, self.continues) = self.breaks, outer
        if node.orelse and edges:
            self.meet(edges)
            self.block(node.orelse)
            edges = self.here()
        self.meet([*edges, *breaks])
        self.names.pop(_COUNT, None)


_COMPILED = {getattr(ast, n): f for n, f in vars(AstCompiler).items() if n in vars(ast)}
ALIKE = 2  # alike items of a held tuple up to which a loop over them is unrolled
LONGEST = 1000  # longest range in a comprehension
_COUNT = "for"  # no function has this name
