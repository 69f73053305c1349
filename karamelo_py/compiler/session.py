"""Memory of the compiler: functions, types, arrays and machine code found so far."""

import contextvars
import itertools
import sys
import threading
from collections.abc import Callable
from typing import Any
from weakref import WeakValueDictionary


class Session:
    """Memory of the compiler; one thread of Python at a time compiles (`one_at_a_time`)."""

    def __init__(self) -> None:
        self.seen: dict[Any, Any] = {}
        self.walked: dict[Callable, Any] = {}
        self.functions: dict[tuple, Any] = {}  # compiled for types of arguments
        self.operations: dict[tuple, Any] = {}
        self.outdated = False  # functions have to be found anew
        self.changes = 0  # of implementations that compiled kernels may contain
        self.loaded: dict[str, list[int]] = {}  # addresses, by names of kernels
        self.addresses: dict[tuple, int] = {}
        self.interpreted: WeakValueDictionary[int, Callable] = WeakValueDictionary()
        # Arrays that kernels were called with, by id, and numbers of their types.
        self.arrays: dict[int, Any] = {}
        self.array_types: dict[tuple, int] = {}
        self.numbers = itertools.count()  # safe in threads
        self.waits = True  # for other processes that compile; False after a timeout


_session = contextvars.ContextVar("session", default=Session())  # noqa: B039
current = _session.get
one_at_a_time = threading.RLock()


def importable(module: str, name: str, make: Callable[[], type]) -> type:
    """Return the class of this name in a module; `make` it first, where cached kernels find it."""
    names = vars(sys.modules[module])
    with one_at_a_time:
        if name not in names:
            names[name] = make()
        return names[name]
