"""Derivatives of formulas, and substitution of names."""

from collections.abc import Mapping

from karamelo_py.script.expressions import Expression, applied
from karamelo_py.script.terms import in_order

ZERO, ONE = Expression(0.0), Expression(1.0)


def is_number(term: Expression, value: float) -> bool:
    return term.operation == "number" and term.value == value


def plus(a: Expression, b: Expression) -> Expression:
    return b if is_number(a, 0) else a if is_number(b, 0) else applied("+", a, b)


def times(a: Expression, b: Expression) -> Expression:
    if is_number(a, 0) or is_number(b, 0):
        return ZERO
    return b if is_number(a, 1) else a if is_number(b, 1) else applied("*", a, b)


def to_power(base: Expression, exponent: float) -> Expression:
    if exponent in (0, 1):
        return base if exponent else ONE
    return applied("^", base, Expression(exponent))


# Derivatives of functions of one number x, from x and the value f.
OF_ONE = {
    "neg": lambda x, f: Expression(-1),
    "sqrt": lambda x, f: applied("/", Expression(0.5), f),
    "exp": lambda x, f: f,
    "log": lambda x, f: applied("/", ONE, x),
    "sin": lambda x, f: applied("cos", x),
    "cos": lambda x, f: applied("neg", applied("sin", x)),
    "tan": lambda x, f: plus(ONE, to_power(f, 2)),
    "tanh": lambda x, f: applied("-", ONE, to_power(f, 2)),
    "sinh": lambda x, f: applied("cosh", x),
    "cosh": lambda x, f: applied("sinh", x),
}


def derivative(root: Expression, name: str) -> Expression:
    slopes: dict[int, Expression] = {}
    for term in in_order(root):
        slopes[id(term)] = _derivative(term, name, [slopes[id(x)] for x in term.operands])
    return slopes[id(root)]


def _derivative(term: Expression, name: str, slopes: list[Expression]) -> Expression:
    operation, operands = term.operation, term.operands
    if name not in term.names:
        return ZERO
    if operation == "name":
        return ONE
    if operation in OF_ONE:
        return times(OF_ONE[operation](operands[0], term), slopes[0])
    if operation == "if":
        return applied("if", operands[0], *slopes[1:])
    if operation in ("<", "<=", ">", ">="):
        return ZERO
    (a, b), (s, t) = operands, slopes
    if operation == "+":
        return plus(s, t)
    if operation == "-":
        return s if is_number(t, 0) else plus(s, applied("neg", t))
    if operation == "*":
        return plus(times(s, b), times(a, t))
    if operation == "/":
        first = s if is_number(s, 0) else applied("/", s, b)
        second = ZERO if is_number(t, 0) else applied("neg", applied("/", times(term, t), b))
        return plus(first, second)
    if operation in ("max", "min"):
        above, below = (s, t) if operation == "max" else (t, s)
        first = times(applied(">=", a, b), above)
        return plus(first, times(applied("-", ONE, applied(">=", a, b)), below))
    if b.operation == "number":
        return times(times(b, to_power(a, b.value - 1)), s)
    of_base = times(applied("/", times(b, term), a), s)
    return plus(of_base, times(times(term, applied("log", a)), t))


def replaced(root: Expression, by: Mapping[str, Expression]) -> Expression:
    results: dict[int, Expression] = {}
    for term in in_order(root):
        if term.operation == "name":
            results[id(term)] = by.get(term.value, term)
        elif term.operands:
            results[id(term)] = applied(term.operation, *[results[id(x)] for x in term.operands])
        else:
            results[id(term)] = term
    return results[id(root)]
