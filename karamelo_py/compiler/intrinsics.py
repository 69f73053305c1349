"""Functions of kernels whose code is written by hand."""

import functools
from collections.abc import Callable
from typing import Any

BUILTINS: dict[Callable, Callable] = {}


class Intrinsic:
    """Define a function of values: by its signature for types, and by what writes the code.

    ``definition(*types)`` returns ``result(*arguments)`` and ``codegen(builder, signature,
    values)``, or None where it is not defined. Types of whole numbers that are known are given
    where it is not defined for others.
    """

    def __init__(self, definition: Callable):
        self.definition = definition
        functools.update_wrapper(self, definition)

    def __call__(self, *arguments: Any) -> Any:
        raise NotImplementedError(f"only kernels can call {self.__qualname__}")


intrinsic = Intrinsic


def builtin(function: Callable) -> Callable[[Callable], Callable]:
    """Decorate what `function` is in kernels: ``made(lowering, *arguments)``, of what is traced."""

    def register(made: Callable) -> Callable:
        BUILTINS[function] = made
        return made

    return register
