"""What Numba does while it compiles, of no use here and a seventh of the time.

It tells its listeners of every call of LLVM, and compares all options of a compilation, one by one
through properties, at each call that it gives a type to. Neither changes what is compiled.
"""

from __future__ import annotations

from llvmlite.binding import ffi
from numba.core.targetconfig import TargetConfig


def _values(self: TargetConfig) -> dict:
    """All options with their values, set or not."""
    kind = type(self)
    if kind not in _defaults:
        _defaults[kind] = {name: option.default for name, option in kind.options.items()}
    return _defaults[kind] | self._values


_defaults: dict[type, dict] = {}
_hashes: dict[type, int] = {}


def _hash(self: TargetConfig) -> int:
    """Numba's own hash, which is of the names of the options."""
    kind = type(self)
    if kind not in _hashes:
        _hashes[kind] = hash(tuple(sorted(kind.options)))
    return _hashes[kind]


TargetConfig.values = _values
TargetConfig.__hash__ = _hash
ffi.lib._lock._cblist.clear()
