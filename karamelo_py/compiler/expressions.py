"""Expressions of functions that are walked through (`karamelo_py.compiler.statements`)."""

import ast
import functools
import operator
from collections.abc import Callable
from typing import Any

from karamelo_py.compiler.flow import Flow, is_value
from karamelo_py.compiler.values import Untraceable, emit

BINARY = {
    ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul,
    ast.MatMult: operator.matmul,
    ast.Div: operator.truediv, ast.FloorDiv: operator.floordiv, ast.Mod: operator.mod,
    ast.Pow: operator.pow, ast.BitAnd: operator.and_, ast.BitOr: operator.or_,
    ast.BitXor: operator.xor, ast.LShift: operator.lshift, ast.RShift: operator.rshift,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
    ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.USub: operator.neg, ast.UAdd: operator.pos, ast.Invert: operator.invert,
}  # fmt: skip


class ExpressionCompiler:
    """Compile expressions, by what the names in them stand for."""

    function: Callable  # that they are of, with the globals that it is to see
    free: dict[str, Any]  # its closure
    flow: Flow  # writes the code of ways
    names: dict[str, Any]  # what the function's own names stand for

    def branch(self, condition: Any, then: Callable, otherwise: Callable) -> None:
        """Go both ways, and on from where they meet."""
        raise NotImplementedError

    def do(self, node: ast.AST) -> Any:
        """Compile a statement, or an expression to its value."""
        return getattr(self, type(node).__name__, self.unknown)(node)

    def unknown(self, node: ast.AST) -> None:
        """Refuse what kernels do not know."""
        kind = type(node).__name__
        raise Untraceable(f"kernels know no {_WORDS.get(kind, kind)}")

    def name(self, name: str) -> Any:
        """Look a name up."""
        if name in self.names:
            return self.names[name]
        if name in self.free:
            return self.free[name]
        if name in self.function.__code__.co_varnames:
            raise Untraceable(f"'{name}' is not of one kind on all ways to here")
        return self.function.__globals__[name]

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
        """Compile the items of a tuple, or arguments."""
        out: list = []
        for node in nodes:
            if isinstance(node, ast.Starred):
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

    def NamedExpr(self, node: ast.NamedExpr) -> Any:
        self.names[node.target.id] = value = self.do(node.value)
        return value

    def BinOp(self, node: ast.BinOp) -> Any:
        return BINARY[type(node.op)](self.do(node.left), self.do(node.right))

    def UnaryOp(self, node: ast.UnaryOp) -> Any:
        value = self.do(node.operand)
        if isinstance(node.op, ast.Not):
            return self.flow.negate(value)
        return BINARY[type(node.op)](value)

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
        """Compile one comparison."""
        if isinstance(op, ast.Is | ast.IsNot):
            return (a is b) == isinstance(op, ast.Is)
        if isinstance(op, ast.In):
            return self.among(a, b)
        if isinstance(op, ast.NotIn):
            return self.flow.negate(self.among(a, b))
        return BINARY[type(op)](a, b)

    def among(self, a: Any, things: Any) -> Any:
        """Compile the question whether `a` is one of some things."""
        if is_value(things):
            raise Untraceable("kernels do not look for a number in an array")
        same = [operator.eq(a, b) for b in things] if is_value(a) else [a in things]
        return functools.reduce(lambda one, other: emit(operator.or_, one, other), same or [False])

    def BoolOp(self, node: ast.BoolOp) -> Any:
        return self.chain(node.values, isinstance(node.op, ast.And))

    def chain(self, nodes: list[ast.expr], every: bool) -> Any:
        """Compile `and` or `or`: the first value that decides, or the last one."""
        value = self.do(nodes[0])
        if len(nodes) == 1:
            return value
        if not is_value(value):
            return self.chain(nodes[1:], every) if bool(value) == every else value
        rest, stay = (lambda: self.chain(nodes[1:], every)), (lambda: value)
        return self.either(value, *((rest, stay) if every else (stay, rest)))

    def either(self, condition: Any, then: Callable, otherwise: Callable) -> Any:
        """Compile the choice of one of two expressions."""

        def of(do: Callable) -> Callable:
            def put() -> None:
                self.names["?"] = do()

            return put

        self.branch(condition, of(then), of(otherwise))
        if "?" not in self.names:
            raise Untraceable("an expression gives things of two kinds")
        return self.names.pop("?")

    def IfExp(self, node: ast.IfExp) -> Any:
        condition = self.do(node.test)
        if not is_value(condition):
            return self.do(node.body if condition else node.orelse)
        return self.either(condition, lambda: self.do(node.body), lambda: self.do(node.orelse))

    def Call(self, node: ast.Call) -> Any:
        function = self.do(node.func)
        if isinstance(getattr(function, "__self__", None), CHANGING):
            raise Untraceable(ON_ALL_WAYS)
        arguments = self.items(node.args)
        keywords = {k.arg: self.do(k.value) for k in node.keywords}
        return self.flow.call(function, arguments, keywords)

    def Lambda(self, node: ast.Lambda) -> Callable:
        names = [a.arg for a in node.args.args]

        def call(*arguments: Any) -> Any:
            outer = self.names
            self.names = outer | dict(zip(names, arguments, strict=True))
            try:
                return self.do(node.body)
            finally:
                self.names = outer

        return call

    def ListComp(self, node: ast.ListComp | ast.GeneratorExp) -> list:
        out: list = []
        outer = dict(self.names)

        def go(k: int) -> None:
            if k == len(node.generators):
                out.append(self.do(node.elt))
                return
            one = node.generators[k]
            for item in self.do(one.iter):
                self.give(one.target, item)
                if all(self.do(test) for test in one.ifs):
                    go(k + 1)

        go(0)
        self.names = outer
        return out

    GeneratorExp = ListComp


CHANGING = list | dict | set
ON_ALL_WAYS = "on one of several ways, a list would change on all"
_WORDS = {
    "JoinedStr": "text with numbers in it", "Try": "`try`", "With": "`with`", "Delete": "`del`",
    "Import": "`import` within a function", "ImportFrom": "`import` within a function",
    "Global": "`global`", "Nonlocal": "`nonlocal`", "Match": "`match`", "ClassDef": "`class`",
    "Raise": "`raise` of this kind", "FunctionDef": "function within of this kind",
}  # fmt: skip
