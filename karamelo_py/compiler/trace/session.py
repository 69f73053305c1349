"""Memory of the compiler: implementations, functions, types, arrays and machine code.

A process has one such memory, as it has one LLVM engine and one set of names in machine code.
"""

import itertools
import sys
import threading
from collections.abc import Callable
from typing import Any
from weakref import WeakValueDictionary


class Session:
    """Caches; one Python thread at a time compiles (`one_at_a_time`)."""

    def __init__(self) -> None:
        # Filled by decorators on import.
        self.choosers: dict[Callable, list[Callable]] = {}  # implementations by argument types
        self.builtins: dict[Callable, Callable] = {}  # code of functions (`values.builtin`)
        self.registered: list[Callable] = []  # implementations in all keys (`choices.register`)
        self.seen: dict[Any, Any] = {}  # replacements of globals
        self.walked: dict[Callable, Any] = {}  # texts of functions
        self.functions: dict[tuple, Any] = {}  # functions selected by argument types
        self.operations: dict[tuple, Any] = {}
        self.tuples: dict[tuple, Any] = {}  # tuple types by class and type numbers of items
        self.structs: dict[str, Any] = {}  # types of held tuples in memory, by name
        self.outdated = False  # whether functions have to be selected again
        self.changes = 0  # number of implementations that have changed and that kernels may contain
        self.loaded: dict[str, list[int]] = {}  # addresses by kernel name
        self.addresses: dict[tuple, int] = {}
        self.interpreted: WeakValueDictionary[int, Callable] = WeakValueDictionary()
        self.arrays: dict[int, Any] = {}  # arrays that were passed to kernels, by id
        self.array_types: dict[tuple, int] = {}
        self.numbers = itertools.count()  # safe in threads
        self.waits = True  # wait for other processes that compile; False after a timeout


session = Session()
one_at_a_time = threading.RLock()


def importable(module: str, name: str, make: Callable[[], type]) -> type:
    """Return the class of this name in a module, where cached kernels find it; else `make` it."""
    names = vars(sys.modules[module])
    with one_at_a_time:
        if name not in names:
            names[name] = make()
        return names[name]
