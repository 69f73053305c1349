"""Evaluate expression trees."""

import math
from collections.abc import Callable
from functools import partial, reduce
from typing import Any, Protocol

from karamelo_py.script import syntax
from karamelo_py.script.errors import ScriptError, plural
from karamelo_py.script.expressions import Expression, Value, applied
from karamelo_py.script.functions import FUNCTIONS, TAIL, compute

REWRITTEN: dict[str, Callable[..., Expression]] = {
    "pow": lambda a, b: applied("^", a, b),
    "mod": lambda a, b: applied("%", a, b),
    "tgamma": lambda a: applied("gamma", a),
    "exp2": lambda a: applied("^", Expression(2.0), a),
    "degrees": lambda a: applied("*", a, Expression(180 / math.pi)),
    "radians": lambda a: applied("*", a, Expression(math.pi / 180)),
    "remainder": lambda a, b: applied(
        "-", a, applied("*", b, applied("round", applied("/", a, b)))
    ),
    "inv_norm": lambda a: _inverse_normal(a),
}

# Inverse normal distribution in the middle and in the tails (Wichura 1988, algorithm AS 241):
# coefficients of numerator and denominator, highest power first.
_MIDDLE = (
    (
        2509.0809287301226727, 33430.575583588128105, 67265.770927008700853, 45921.953931549871457,
        13731.693765509461125, 1971.5909503065514427, 133.14166789178437745, 3.3871328727963666080,
    ),
    (
        5226.4952788528545610, 28729.085735721942674, 39307.895800092710610, 21213.794301586595867,
        5394.1960214247511077, 687.18700749205790830, 42.313330701600911252, 1.0,
    ),
)  # fmt: skip
_SIDES = (
    (
        7.74545014278341407640e-4, 2.27238449892691845833e-2, 2.41780725177450611770e-1,
        1.27045825245236838258, 3.64784832476320460504, 5.76949722146069140550,
        4.63033784615654529590, 1.42343711074968357734,
    ),
    (
        1.05075007164441684324e-9, 5.47593808499534494600e-4, 1.51986665636164571966e-2,
        1.48103976427480074590e-1, 6.89767334985100004550e-1, 1.67638483018380384940,
        2.05319162663775882187, 1.0,
    ),
)  # fmt: skip


def _quotient(polynomials: tuple[tuple[float, ...], ...], r: Expression) -> Expression:
    terms = []
    for coefficients in polynomials:
        term = Expression(coefficients[0])
        for coefficient in coefficients[1:]:
            term = applied("+", applied("*", term, r), Expression(coefficient))
        terms.append(term)
    return applied("/", *terms)


def _inverse_normal(p: Expression) -> Expression:
    q = applied("-", p, Expression(0.5))
    middle = _quotient(_MIDDLE, applied("-", Expression(0.180625), applied("*", q, q)))
    tail = applied("min", p, applied("-", Expression(1.0), p))
    far = applied("sqrt", applied("neg", applied("log", tail)))
    side = _quotient(_SIDES, applied("-", far, Expression(1.6)))
    within = applied(">=", tail, Expression(TAIL))
    side = applied("if", within, applied("*", applied("sign", q), side), Expression(math.nan))
    near = applied("<=", applied("abs", q), Expression(0.425))
    return applied("if", near, applied("*", q, middle), side)


class NameScope(Protocol):
    """Names and commands of a script; a variable `hides` a function of its name."""

    def name(self, name: str, node: syntax.Name, raw: syntax.Raw) -> Value: ...

    def command(self, node: syntax.FunctionCall, raw: syntax.Raw) -> Value: ...

    def hides(self, name: str) -> bool: ...


def evaluate(node: syntax.Node, raw: syntax.Raw, scope: NameScope) -> Value:
    if isinstance(node, (syntax.NumberLiteral, syntax.TextLiteral)):
        return node.value
    if isinstance(node, syntax.Name):
        return scope.name(node.name, node, raw)
    if isinstance(node, syntax.UnaryOperation):
        operand = _numeric(node.operand, raw, scope, f"'{node.operator}'")
        if node.operator == "+":
            return operand
        return _apply("not" if node.operator == "!" else "neg", node, (operand,), raw)
    if isinstance(node, syntax.BinaryOperation):
        return _binary(node, raw, scope)
    assert isinstance(node, syntax.FunctionCall)
    if node.name not in FUNCTIONS or scope.hides(node.name):
        return scope.command(node, raw)
    return _function(node, raw, scope)


def mark_of(raw: syntax.Raw, node: syntax.Node) -> Any:
    return raw.source.mark(raw.start + node.start, raw.start + node.end)


def _binary(node: syntax.BinaryOperation, raw: syntax.Raw, scope: NameScope) -> Value:
    left = evaluate(node.left, raw, scope)
    logical = node.operator in ("&&", "||") and isinstance(left, float) and not math.isnan(left)
    if logical and (left != 0) == (node.operator == "||"):
        # Logical operators are evaluated lazily, so that a != 0 && 1/a > 2 is not an error.
        return 1.0 if left != 0 else 0.0
    right = evaluate(node.right, raw, scope)
    if isinstance(left, str) or isinstance(right, str):
        return _texts(node, left, right, raw)
    return _apply(node.operator, node, (left, right), raw)


def _texts(node: syntax.BinaryOperation, left: Value, right: Value, raw: syntax.Raw) -> Value:
    if isinstance(left, str) and isinstance(right, str):
        if node.operator == "+":
            return left + right
        if node.operator in ("==", "!="):
            return float((left == right) == (node.operator == "=="))
    guilty, text = (node.left, left) if isinstance(left, str) else (node.right, right)
    message = f"'{text}' is text, and '{node.operator}' needs numbers"
    expected = "a number; texts can be joined with + and compared with == and !="
    raise ScriptError(message, mark=mark_of(raw, guilty), expected=expected)


def _numeric(node: syntax.Node, raw: syntax.Raw, scope: NameScope, user: str) -> float | Expression:
    value = evaluate(node, raw, scope)
    if isinstance(value, str):
        message = f"'{value}' is text, and {user} needs a number"
        raise ScriptError(message, mark=mark_of(raw, node), expected="a number")
    return value


def _function(node: syntax.FunctionCall, raw: syntax.Raw, scope: NameScope) -> Value:
    signature = FUNCTIONS[node.name]
    count = len(node.operands)
    if not signature.least <= count <= signature.most:
        wanted = "at least " * (signature.most > signature.least)
        wanted += plural(signature.least, "operand")
        message = f"{node.name} takes {wanted}, not {count}"
        chooses = (
            "if(...) chooses one of two values; run_while(condition) ends a run by a condition"
        )
        hint = chooses if node.name == "if" else None
        mark, form = mark_of(raw, node), usage(node.name)
        raise ScriptError(message, mark=mark, expected=form, hint=hint, code="arguments")
    if node.name == "if":
        condition = _numeric(node.operands[0], raw, scope, "if")
        if isinstance(condition, float):
            if math.isnan(condition):
                return math.nan
            return evaluate(node.operands[1 if condition != 0 else 2], raw, scope)
    values = tuple(_numeric(operand, raw, scope, node.name) for operand in node.operands)
    if node.name in ("min", "max"):
        return reduce(lambda a, b: _apply(node.name, node, (a, b), raw), values)
    return _apply(node.name, node, values, raw)


def usage(name: str) -> str:
    operands = {"if": "condition, a, b", "atan2": "y, x", "min": "a, b, ...", "max": "a, b, ..."}
    return f"{name}({operands.get(name) or ('a, b' if FUNCTIONS[name].least == 2 else 'a')})"


def _apply(operation: str, node: syntax.Node, values: tuple, raw: syntax.Raw) -> float | Expression:
    if any(isinstance(value, Expression) for value in values):
        operands = [Expression(value) for value in values]
        try:
            return REWRITTEN.get(operation, partial(applied, operation))(*operands)
        except ScriptError as error:
            error.mark = mark_of(raw, node)
            raise
    try:
        return compute(operation, *values)
    except (ValueError, ZeroDivisionError, OverflowError) as error:
        raise _impossible(operation, node, values, raw, error) from None


_DOMAINS = {
    "sqrt": "a number of at least 0",
    "atanh": "a number between -1 and 1, both excluded",
    "acosh": "a number of at least 1",
    "inv_norm": f"a number from {TAIL:g} to 1 - {TAIL:g}",
    "log1p": "a number above -1",
    **dict.fromkeys(("log", "log2", "log10"), "a number above 0"),
    **dict.fromkeys(("asin", "acos"), "a number between -1 and 1"),
    **dict.fromkeys(("^", "pow"), "a whole exponent for a negative base"),
    **dict.fromkeys(("gamma", "lgamma", "tgamma"), "any number but 0, -1, -2, ..."),
}


def _impossible(
    operation: str, node: syntax.Node, values: tuple, raw: syntax.Raw, error: Exception
) -> ScriptError:
    operands = _operands(node)
    shown = ", ".join(f"{value:g}" for value in values)
    if isinstance(error, ZeroDivisionError) or (operation in ("^", "pow") and values[0] == 0):
        guilty = operands[0] if operation in ("^", "pow") else operands[-1]
        literal = isinstance(guilty, syntax.NumberLiteral)
        which = "" if literal else f": {raw.code[guilty.start : guilty.end]} is 0"
        message, expected = f"division by zero{which}", "a number other than 0"
        mark, code = mark_of(raw, guilty), "division-by-zero"
        return ScriptError(message, mark=mark, expected=expected, code=code)
    if isinstance(error, OverflowError):
        message = f"the result of {_spelled(operation, shown)} is too large"
        return ScriptError(message, mark=mark_of(raw, node), expected="at most 1.8e308")
    return ScriptError(
        f"{_spelled(operation, shown)} is not a real number",
        mark=mark_of(raw, operands[0] if len(operands) == 1 else node),
        expected=_DOMAINS.get(operation, "a finite result"),
    )


def _spelled(operation: str, shown: str) -> str:
    if operation in FUNCTIONS:
        return f"{operation}({shown})"
    return f" {operation} ".join(shown.split(", "))


def _operands(node: syntax.Node) -> tuple[syntax.Node, ...]:
    if isinstance(node, syntax.UnaryOperation):
        return (node.operand,)
    if isinstance(node, syntax.BinaryOperation):
        return node.left, node.right
    assert isinstance(node, syntax.FunctionCall)
    return node.operands
