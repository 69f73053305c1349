"""Formulas with indices, written once and unrolled: run on symbols, they give flat functions.

A formula is ordinary Python that loops over the components which exist. It is run once for each
case (a number of dimensions, say) with a :class:`Symbol` in the place of every number;
:func:`written` makes of what it returns a function without loops, which Python and Numba run alike.
Operations keep the order of the formula; a component that does not exist is the literal 0, which
drops out of sums and products, and what occurs more than once is computed once.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

from karamelo_py.compiler.compile import define, fma, real


class Symbol:
    """An expression: a pattern such as ``({} + {})`` with its parts."""

    def __init__(self, pattern: str, *parts: Any, called: Callable | None = None):
        self.pattern, self.called = pattern, called
        self.parts = tuple(_symbol(part) for part in parts)
        self.text = pattern.format(*(part.text for part in self.parts))

    def __getitem__(self, i: Any) -> Symbol:
        return Symbol("{}[{}]", self, i if isinstance(i, Symbol) else Symbol(str(i)))

    def __getattr__(self, name: str) -> Symbol:
        if name.startswith("_"):
            raise AttributeError(name)
        return Symbol("{}." + name, self)

    def __add__(self, other: Any) -> Symbol:
        return self if _is(0, other) else Symbol("({} + {})", self, other)

    def __radd__(self, other: Any) -> Symbol:
        return self if _is(0, other) else Symbol("({} + {})", other, self)

    def __sub__(self, other: Any) -> Symbol:
        return self if _is(0, other) else Symbol("({} - {})", self, other)

    def __rsub__(self, other: Any) -> Symbol:
        return -self if _is(0, other) else Symbol("({} - {})", other, self)

    def __mul__(self, other: Any) -> Any:
        return _times(self, other, other)

    def __rmul__(self, other: Any) -> Any:
        return _times(other, self, other)

    def __truediv__(self, other: Any) -> Symbol:
        return Symbol("({} / {})", self, other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return Symbol("({} / {})", other, self)

    def __neg__(self) -> Symbol:
        return Symbol("(-{})", self)

    def __gt__(self, other: Any) -> Symbol:
        return Symbol("({} > {})", self, other)

    def __abs__(self) -> Symbol:
        return call(abs, self)


def _is(number: int, item: Any) -> bool:
    return not isinstance(item, Symbol) and item == number


def _times(a: Any, b: Any, other: Any) -> Any:
    if _is(0, other):
        return 0
    if _is(1, other):
        return b if other is a else a
    return Symbol("({} * {})", a, b)


def _symbol(item: Any) -> Symbol:
    """`item`, or the symbol of a literal number in the type of `like`, or of a tuple."""
    if isinstance(item, Symbol):
        return item
    if isinstance(item, tuple | list):
        return Symbol("(" + "{}, " * len(item) + ")", *item)
    number = repr(item).replace("inf", "1e999")
    return Symbol(f"real({number}, {{}})", Symbol("like"), called=real)


def call(function: Callable, *arguments: Any) -> Symbol:
    """`function` of these arguments; an `int` among them is a literal number of a direction."""
    given = (Symbol(str(a)) if type(a) is int else a for a in arguments)
    holes = ", ".join(["{}"] * len(arguments))
    return Symbol(f"{function.__name__}({holes})", *given, called=function)


def add_product(a: Any, b: Any, c: Any) -> Any:
    """a b + c with one rounding (`fma`), or c where a or b does not exist."""
    return c if _is(0, a) or _is(0, b) else call(fma, a, b, c)


def cofactor(m: Any, d: int, i: int, j: int) -> Any:
    """The cofactor of m[i, j] in the d x d matrix `m`."""
    if d == 1:
        return 1
    if d == 2:
        return m[1 - i, 1 - j] if i == j else -m[1 - i, 1 - j]
    p, q, r, s = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
    return m[p, r] * m[q, s] - m[p, s] * m[q, r]


def determinant(m: Any, d: int) -> Any:
    """The determinant of the d x d matrix `m`."""
    return sum(m[0, j] * cofactor(m, d, 0, j) for j in range(d))


def written(parameters: str, result: Any, like: str = "") -> Callable:
    """The function of `parameters` that returns `result`: a symbol, or tuples of symbols.

    `like` is the expression whose number type literals get.
    """
    result = _symbol(result)
    uses: Counter = Counter()
    names: dict[str, Callable] = {}

    def count(symbol: Symbol) -> None:
        uses[symbol.text] += 1
        if uses[symbol.text] == 1:
            if symbol.called is not None:
                names[symbol.called.__name__] = symbol.called
            for part in symbol.parts:
                count(part)

    count(result)
    lines = [f"like = {like}"] if like not in ("", "like") and "like" in uses else []
    known: dict[str, str] = {}

    def spell(symbol: Symbol) -> str:
        if symbol.text not in known:
            text = symbol.pattern.format(*(spell(part) for part in symbol.parts))
            if uses[symbol.text] == 1 or not symbol.parts:
                return text
            known[symbol.text] = f"t{len(known)}"
            lines.append(f"{known[symbol.text]} = {text}")
        return known[symbol.text]

    last = f"return {spell(result)}"
    return define(parameters, *lines, last, **names)
