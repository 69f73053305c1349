"""Functions of tags that nothing follows, so that no kernel may contain them."""

import functools
import types as python
from collections import namedtuple
from collections.abc import Iterable

from karamelo_py.compiler.values import Untraceable

_GENERATED = {*vars(namedtuple("_", ())), "__orig_bases__", "__annotations__", "__annotate_func__"}


@functools.cache
def _functions_of(one: type) -> frozenset[str]:
    """The names of what a class of tuples does with its numbers by functions of its own."""
    if not getattr(one, "_fields", ()) or getattr(one, "is_followed", False):
        return frozenset()
    own = {name: value for base in one.__mro__[:-2] for name, value in vars(base).items()}
    return frozenset(
        name
        for name, value in own.items()
        if name not in _GENERATED
        and isinstance(value, python.FunctionType | property | classmethod | staticmethod)
    )


def _names_in(code: python.CodeType) -> set[str]:
    inner = (c for c in code.co_consts if isinstance(c, python.CodeType))
    return set(code.co_names).union(*map(_names_in, inner))


def refuse_methods(codes: Iterable[python.CodeType], classes: set[type]) -> None:
    """Refuse methods of tuples: they would run as they are, and nothing would follow them."""
    functions = frozenset().union(*map(_functions_of, classes))
    named = functions & set().union(*map(_names_in, codes))
    for name in sorted(name for name in functions if name.startswith("__") or name in named):
        raise Untraceable(
            f"'{name}' is a method of a class of tuples, which kernels cannot call: "
            "write a function, or mark the class with `algebra`"
        )
