"""Formulas for every kinematics from one definition over its components.

``@formula`` takes a function of `kin` and of operands whose annotations say what they are
(``Tensor``, ``Symmetric``, ``Vector``, ``Number``). It runs it once for each kinematics, with
:class:`Components` for `kin` and symbols for the components, and makes
a function that is chosen by the class of `kin`.
"""

import inspect
from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any

from karamelo_py.compiler.compile import by_type, tag_class
from karamelo_py.compiler.symbols import Symbol, written
from karamelo_py.points.kinematics.tags import TAGS

Pair = tuple[int, int]


def _pairs(names: Iterable[str]) -> tuple[Pair, ...]:
    return tuple((int(name[0]) - 1, int(name[1]) - 1) for name in names)


class Components:
    """Which components tensors have in one kinematics.

    Attributes
    ----------
    dimension
        Number of components of a vector.
    directions
        Those of vectors.
    axes
        Directions in which a tensor has components: the one around the axis is among them.
    pairs, symmetric_pairs
        Rows and columns of the components of a tensor and of a symmetric one, in their order.
    """

    def __init__(self, tag: type):
        self.dimension = tag.dimension
        self.directions = range(tag.dimension)
        self.pairs = _pairs(tag.tensor_names)
        self.symmetric_pairs = _pairs(tag.symmetric_names)
        self.axes = sorted({i for i, _ in self.pairs})

    def vector(self, component: Callable[[int], Any]) -> tuple:
        """The vector with these components."""
        return tuple(component(i) for i in self.directions)

    def tensor(self, component: Callable[[int, int], Any]) -> tuple:
        """The tensor with these components."""
        return tuple(component(i, j) for i, j in self.pairs)

    def symmetric(self, component: Callable[[int, int], Any]) -> tuple:
        """The symmetric tensor with these components."""
        return tuple(component(i, j) for i, j in self.symmetric_pairs)

    def moved(self, i: int) -> int:
        """The direction of the vector that row `i` of a gradient comes from.

        Around the axis it is the radius: v_r / r there is the strain, and its stress a force on it.
        """
        return i if i < self.dimension else 0


class Number:
    """An operand that is whatever the formula takes it for: a number or a tuple."""

    def __new__(cls, name: str, kin: Components) -> Any:
        return Symbol(name)


class Vector(Number):
    """An operand with a component a direction; gradients have one more around the axis."""


class Tensor:
    """An operand such as F; components that the kinematics has not are 0."""

    def __init__(self, name: str, kin: Components):
        self.at = {pair: Symbol(f"{name}[{n}]") for n, pair in enumerate(self.layout(kin))}

    @staticmethod
    def layout(kin: Components) -> Iterable[Pair]:
        """Row and column of each component."""
        return kin.pairs

    def __getitem__(self, pair: Pair) -> Any:
        return self.at.get(pair, 0)


class Symmetric(Tensor):
    """An operand such as stress."""

    @staticmethod
    def layout(kin: Components) -> Iterable[Pair]:
        """Row and column of each component."""
        return kin.symmetric_pairs

    def __getitem__(self, pair: Pair) -> Any:
        return self.at.get((min(pair), max(pair)), 0)


class _Written(dict):
    """The functions of a formula by tag, each written when it is first asked for."""

    def __init__(self, definition: Callable, tags: Iterable[type]):
        self.definition, self.tags = definition, tags
        self.given: dict[type, Callable] = {}  # not of the formula

    @property
    def made_of(self) -> tuple:
        """What the cache of kernels follows: not what happens to be written already."""
        return self.definition, tuple(self.tags), self.given, written, Components

    def give(self, tag: type, function: Callable) -> Callable:
        """A tag gets a function that is not of the formula."""
        self[tag] = self.given[tag] = function
        return function

    def __missing__(self, tag: type) -> Callable:
        if tag not in self.tags:
            raise TypeError(f"{self.definition.__name__} is not defined for {tag.__name__}")
        given = list(inspect.signature(self.definition, eval_str=True).parameters.values())[1:]
        first = next((p for p in given if p.annotation is not Number), given[0])
        kin = Components(tag)
        self[tag] = written(
            ", ".join(["kin", *(p.name for p in given)]),
            self.definition(kin, *(p.annotation(p.name, kin) for p in given)),
            like=first.name if first.annotation is Number else f"{first.name}[0]",
        )
        return self[tag]


def formula(*tags: type) -> Callable[[Callable], Callable]:
    """Make a function by kinematics of a formula, for these tags (all if none is named).

    Literals get the number type of the first operand that is no `Number`.
    ``name.on(Tag)`` gives a tag a function that is not of the formula.
    """

    def declare(definition: Callable) -> Callable:
        table = _Written(definition, tags or TAGS)

        @wraps(definition)
        def dispatch(kin, *operands):
            return table[type(kin)](kin, *operands)

        del dispatch.__wrapped__  # Numba would read its signature
        by_type(dispatch)(lambda kin, *operands: table[tag_class(kin)])
        dispatch.on = lambda tag: lambda function: table.give(tag, function)
        return dispatch

    return declare
