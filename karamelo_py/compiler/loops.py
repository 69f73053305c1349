"""Kernels: loops that Python and other loops call, kept on disk."""

import functools
import gc
import inspect
import os
from collections.abc import Callable
from typing import Any

import numba
from numba import config, njit
from numba.core import event

from karamelo_py.compiler import inlining
from karamelo_py.compiler.cache import KernelCache
from karamelo_py.compiler.compile import by_type, define, shared
from karamelo_py.compiler.held import at_address, hold
from karamelo_py.compiler.packed import Packed
from karamelo_py.compiler.trace import alone


class _NoCollections(event.Listener):
    """While Numba compiles, Python's collector of cycles would walk its many objects in vain."""

    depth = 0
    was_on = False

    def on_start(self, event: Any) -> None:
        if self.depth == 0:
            self.was_on = gc.isenabled()
        self.depth += 1
        gc.disable()

    def on_end(self, event: Any) -> None:
        self.depth -= 1
        if self.depth == 0 and self.was_on:
            gc.enable()


event.register("numba:compile", _NoCollections())

# Threads that wait for each other spin a little, then sleep (GNU OpenMP). Where another program
# takes a core, waiting at full speed makes two threads twenty times slower than one; sleeping at
# once costs a fifth where none does.
os.environ.setdefault("GOMP_SPINCOUNT", "500")


_HOW = {
    "nogil": True,
    "error_model": "numpy",
    "_nrt": False,
    "forceinline": False,
    "no_cfunc_wrapper": True,
}


def _compiled(function: Callable, options: dict) -> Callable:
    """Numba's dispatcher, which compiles nothing anew for the value of a number that is written."""
    compiled = njit(**options)(function)
    if not config.DISABLE_JIT:
        template = compiled.get_call_template
        compiled.get_call_template = lambda args, kws: template(
            tuple(map(numba.types.unliteral, args)),
            {name: numba.types.unliteral(kind) for name, kind in kws.items()},
        )
    return compiled


def kernel(function: Callable | None = None, **options: Any) -> Callable:
    """Compile a loop over points or nodes; cached on disk, free of the interpreter lock.

    No fast mathematics: where products and sums contract would depend on what a loop is inlined
    into, so that results would differ between one thread and two, or a run in pieces and a whole.
    `fma` says where. Kernels allocate nothing, so Numba's reference counting is left out.
    """
    if function is None:
        return lambda f: kernel(f, **options)
    options = _HOW | options
    compiled = _compiled(function, options)
    if not config.DISABLE_JIT:
        compiled._cache = KernelCache(function, options)
    return compiled


def subkernel(function: Callable) -> Callable:
    """A function that kernels call, too large to be written into each place that calls it.

    Python must not call it: there is nothing of it that Python could call.
    """
    if not config.DISABLE_JIT:
        alone(function)
        shared(function)
    return function


def left(function: Callable) -> Callable:
    """A function whose machine code is made with that of the kernel that knows its address."""
    inlining.claim(function.__qualname__, "left")
    return _compiled(function, _HOW | {"no_cpython_wrapper": True})


def entered(function: Callable) -> Callable:
    """A kernel for Python and for other kernels, which takes its tuples held.

    What other kernels call is kept on disk for all of them.
    """
    if config.DISABLE_JIT:
        return function
    inlining.claim(function.__qualname__, "kept")
    names = inspect.signature(function).parameters
    body = define(", ".join(names), f"return inner({', '.join(names)})", inner=shared(function))
    body.__module__, body.__qualname__ = function.__module__, function.__qualname__
    inner = kernel(body, no_cpython_wrapper=True)
    call = define(
        ", ".join(names),
        f"return inner({', '.join(f'hold({name})' for name in names)})",
        inner=inner,
        hold=hold,
    )
    enter = _packed(function, inner)
    by_type(enter)(lambda *arguments: call)
    return enter


def loop(function: Callable) -> Callable:
    """A kernel for Python alone, which takes its tuples held."""
    return function if config.DISABLE_JIT else _packed(function, shared(function))


def _packed(function: Callable, inner: Callable) -> Callable:
    """What Python calls `inner` by, the compiled `function`."""

    def make(held: Any, name: str) -> Callable:
        items = ", ".join(f"a[{k}]" for k in range(len(held)))
        lines = "a = at(number)", f"return inner({items})"
        call = define("number", *lines, at=at_address(held), inner=inner)
        call.__module__, call.__qualname__ = (
            function.__module__,
            f"{function.__qualname__}.entry.{name}",
        )
        return kernel(call)

    packed = Packed(inner, make)

    @functools.wraps(function)
    def enter(*arguments: Any) -> Any:
        return packed(*arguments)

    enter.compile, enter.entries = packed.compile, packed.entries
    return enter
