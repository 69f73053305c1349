"""What Numba does while it compiles, of no use here and a seventh of the time.

It tells its listeners of every call of LLVM, and compares all options of a compilation, one by one
through properties, at each call that it gives a type to. Neither changes what is compiled.
"""

from __future__ import annotations

import functools

from llvmlite.binding import ffi
from numba.core.targetconfig import TargetConfig


@functools.cache
def _defaults(kind: type) -> dict:
    return {name: option.default for name, option in kind.options.items()}


@functools.cache
def _hash_of(kind: type) -> int:
    return hash(tuple(sorted(kind.options)))


def _values(self: TargetConfig) -> dict:
    """All options with their values, set or not."""
    return _defaults(type(self)) | self._values


def _hash(self: TargetConfig) -> int:
    """Numba's own hash, which is of the names of the options."""
    return _hash_of(type(self))


TargetConfig.values = _values
TargetConfig.__hash__ = _hash
ffi.lib._lock._cblist.clear()
