"""What Numba does while it compiles, of no use here and a seventh of the time.

It tells its listeners of every call of LLVM, and compares all options of a compilation, one by one
through properties, at each call that it gives a type to. What a kernel calls by type it compiles
once for callers that are inlined themselves and once for others, and so all that this calls. None
of it changes what is computed.
"""

from __future__ import annotations

import functools

from llvmlite.binding import ffi
from numba.core.targetconfig import ConfigStack, TargetConfig
from numba.core.typing import templates


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


def _as_inlined(flags: TargetConfig) -> TargetConfig:
    """The options of a function that is inlined in a kernel."""
    flags = flags.copy()
    flags.forceinline = flags.no_cfunc_wrapper = flags.no_cpython_wrapper = True
    flags.discard("release_gil")
    flags.discard("auto_parallel")
    return flags


_implementation = templates._OverloadFunctionTemplate._get_impl


def _get_impl(self, args: tuple, kws: dict) -> tuple:
    """What is chosen by type; in kernels, which count no references, once for all callers."""
    flags = ConfigStack.top_or_none()
    if flags is None or flags.forceinline or flags.nrt:
        return _implementation(self, args, kws)
    with ConfigStack().enter(_as_inlined(flags)):
        return _implementation(self, args, kws)


templates._OverloadFunctionTemplate._get_impl = _get_impl
TargetConfig.values = _values
TargetConfig.__hash__ = _hash
ffi.lib._lock._cblist.clear()
