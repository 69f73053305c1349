"""Loops that threads share out: one for all kernels, which calls what is done by its address.

The arguments of a loop stay where they are in memory. What is done with them is a function of that
place and a number.

Threads that sleep between two loops take as long to wake up as a small loop takes. A kernel of many
loops is therefore run by a *team* (`by_team`): its first thread leads, and goes through the kernel;
the others wait for loops of it. Each has its part of the numbers of a loop, the same in each step,
and takes those of a thread that does not go on. The leader waits for numbers that were taken, never
for threads: one that another program keeps from running holds nobody up.
"""

import ctypes
import functools
import inspect
import os
import platform
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import config, types

from karamelo_py.compiler import code, machine
from karamelo_py.compiler.choices import INTERPRETED
from karamelo_py.compiler.code import I32, I64
from karamelo_py.compiler.compile import implements, shared
from karamelo_py.compiler.failing import failure_at, note
from karamelo_py.compiler.held import HeldTuple, held_as, held_type
from karamelo_py.compiler.loops import kernel, noinline
from karamelo_py.compiler.trace import formula
from karamelo_py.compiler.values import HeldValue, Value, in_kernels, intrinsic, now


class Serial(NamedTuple):
    """One thread."""


class Threaded(NamedTuple):
    """All threads that there are; `team` is where what a team shares lies (`new_team`)."""

    team: int = 0


# --- words of memory that threads share -------------------------------------------------------


def _word(builder: Any, place: Any) -> Any:
    return builder.inttoptr(place, I64.as_pointer())


@intrinsic
def read(place):
    """Read the word at an address; all is seen that was written before it was."""

    def codegen(builder, at):
        return builder.load_atomic(_word(builder, at), "acquire", 8)

    return types.intp(types.intp), codegen


@intrinsic
def write(place, value):
    """Write a word; who sees it sees all that was written before."""

    def codegen(builder, at, number):
        builder.store_atomic(number, _word(builder, at), "release", 8)

    return types.none(types.intp, types.intp), codegen


@intrinsic
def add(place, value):
    """Add to a word, which others may do, too."""

    def codegen(builder, at, number):
        builder.atomic_rmw("add", _word(builder, at), number, "acq_rel")

    return types.none(types.intp, types.intp), codegen


@intrinsic
def replaced(place, old, new):
    """Put `new` in the place of `old`; false if the word was another one."""

    def codegen(builder, at, *numbers):
        found = builder.cmpxchg(_word(builder, at), *numbers, "acq_rel", "acquire")
        return builder.extract_value(found, 1)

    return types.boolean(types.intp, types.intp, types.intp), codegen


@intrinsic
def pause(long):
    """Wait a moment; if `long`, sleep."""

    def codegen(builder, sleeps):
        def call(name, result, *numbers):
            function = code.external(builder, name, result, [I32] * len(numbers))
            builder.call(function, [I32(number) for number in numbers])

        with builder.if_else(sleeps) as (then, otherwise):
            with then:
                if sys.platform == "win32":
                    call("Sleep", ir.VoidType(), 0)
                else:
                    call("usleep", I32, 10)
            with otherwise:
                if platform.machine().lower() in ("x86_64", "amd64"):
                    call("llvm.x86.sse2.pause", ir.VoidType())

    return types.none(types.boolean), codegen


def add_among(array, i, j, value):
    """Add a whole number to an item of an array, which other threads may do, too."""
    array[i, j] += value


@implements(add_among)
@intrinsic
def _add_among(array, i, j, value):
    def codegen(builder, table, i, j, number):
        at = code.item_pointer(builder, array, table, (i, j))
        builder.atomic_rmw("add", at, number, "monotonic")

    return types.none(array, types.int64, types.int64, types.int64), codegen


# --- threads ----------------------------------------------------------------------------------

# Where its arguments are, a number, and where it may fail.
_TASK = ir.FunctionType(ir.VoidType(), [I64] * 3)
_PART = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 5)
_SHARE_OUT = [ctypes.c_int64] * 6


class _Pools(threading.local):
    """Hold the threads that serve a thread of Python, by their number."""

    def __init__(self) -> None:
        self.of = functools.cache(ThreadPoolExecutor)


_pools = _Pools()
if hasattr(os, "register_at_fork"):
    # A process that another one made by copying itself has none of its threads.
    os.register_at_fork(after_in_child=lambda: _pools.of.cache_clear())


def _share_out(
    count: int, part: int, task: int, arguments: int, threads: int, failure: int
) -> None:
    """Do a task for each number below `count`, by `part`, a function of a range of these.

    By so many threads, or all if 0.
    """
    do, threads = _PART(part), threads or config.NUMBA_NUM_THREADS
    size = min(count, threads)
    ends = [count * k // size for k in range(size + 1)] if size else [0, 0]
    pairs = pairwise(ends[1:])
    others: list = []
    try:
        for pair in pairs:
            others.append(_pools.of(threads - 1).submit(do, task, arguments, *pair, failure))
        do(task, arguments, *ends[:2], failure)
    except BaseException as error:  # such as Ctrl-C; the others still work on these arguments
        note(error, failure)
    while others:
        try:
            others[-1].result()
        except BaseException as error:
            note(error, failure)
        others = [other for other in others if not other.done()]


machine.publish_python("karamelo_share_out", ctypes.CFUNCTYPE(None, *_SHARE_OUT), _share_out)


class _Task(NamedTuple):
    """Do something with the items of a held tuple, which lies at a place, and a number."""

    function: Callable
    held: HeldTuple

    def __call__(self, place: Value, number: Value) -> None:
        lowering = now()
        pointer = lowering.builder.inttoptr(place._value, self.held.register_type())
        lowering.seen(self.function)(*HeldValue(self.held, pointer), number)


def _address(lowering: Any, name: str, run: Callable, count: int) -> Value:
    """Give the address of a function of its own, of as many whole numbers."""
    made = lowering.function(name, run, (types.intp,) * count, types.none)
    if getattr(made, "raises", False):
        lowering.builder.function.raises = True
    return Value(types.intp, lowering.builder.ptrtoint(made, I64))


@in_kernels
def _task(lowering: Any, function: Any, items: tuple) -> tuple[Value, Value]:
    """Put items into memory; the address of what does a function of them and a number; theirs."""
    held = HeldTuple(tuple(held_type(types.unliteral(lowering.kind_of(item))) for item in items))
    found = formula(function.seen, (*held, types.intp))
    there = held_as(lowering, items, held)
    if lowering.builder is None:
        return Value(types.intp, None), Value(types.intp, None)
    task = _address(lowering, found.name, _Task(function.seen, held), 2)
    return task, Value(types.intp, lowering.builder.ptrtoint(there._value, I64))


@intrinsic
def _call(task, arguments, number):
    """Call the task at an address."""

    def codegen(builder, task, *numbers):
        pointer = builder.inttoptr(task, _TASK.as_pointer())
        builder.call(pointer, [*numbers, failure_at(builder)])

    return types.none(types.intp, types.intp, types.intp), codegen


@in_kernels
def _regardless(lowering: Any, function: Callable, *arguments: Any) -> Any:
    """Call a function; an exception in it is left to who called this one."""
    lowering.regardless = True
    try:
        return function(*arguments)
    finally:
        lowering.regardless = False


def _do_part(task, arguments, begin, end):
    for number in range(begin, end):
        _call(task, arguments, number)


@in_kernels
def _in_parallel(lowering: Any, count: Any, task: Value, arguments: Value, threads: Any) -> None:
    """Do a task for each number below `count`, by threads that begin for it (`_share_out`)."""
    found = formula(_do_part, (types.intp,) * 4)
    if lowering.builder:
        builder, kinds = lowering.builder, [I64] * len(_SHARE_OUT)
        part = _address(lowering, found.name, found.run, 4)
        given = (count, part, task, arguments, threads)
        numbers = [lowering.lowered(number, types.intp) for number in given]
        function = code.external(builder, "karamelo_share_out", ir.VoidType(), kinds)
        builder.call(function, [*numbers, failure_at(builder)])


# --- teams ------------------------------------------------------------------------------------

# Words, each in a line of the caches of its own.
_STATE, _SIZE, _TASK_AT, _ARGUMENTS, _COUNT, _DONE, _EPOCH = range(0, 7 * 64, 64)
_RESULT, _TICKETS = range(7 * 64, 9 * 64, 64)
_WAITS, _LEADS, _ENDED = range(3)  # in _STATE
_SHORT = 8000  # pauses, some 0.3 ms; then threads sleep, since others may need their cores
_APART, _LOOKS = 10, 64  # pauses between looks at what is left of another's part; looks, 30 us
_PATIENCE = 11000  # pauses until a thread does not wait for a leader any more
_LEFT = (1 << 32) - 1  # of a ticket: how many numbers are left; above them the loop


def new_team(threads: int) -> np.ndarray:
    """Make what a team of so many threads shares; its address is that in `Threaded`."""
    words = np.zeros((_TICKETS // 64 + threads, 8), np.int64)
    words[_SIZE // 64, 0] = threads
    return words


@noinline
def _take_part(team, k):
    """Do what thread `k` gets of the loop of now, its own part first; how many numbers.

    What a thread works on is in its caches, and to get it from there may take longer than the work:
    others take of its part when that gets no smaller for a while.
    """
    size = read(team + _SIZE)
    epoch = read(team + _TICKETS + 64 * k) >> 32
    mine = 0
    looks = 0
    seen = 0
    while True:
        part = k
        word = read(team + _TICKETS + 64 * k)
        for other in range(0 if word & _LEFT > 0 else size):
            found = read(team + _TICKETS + 64 * other)
            if found & _LEFT > word & _LEFT:
                part, word = other, found
        left = word & _LEFT
        if word >> 32 != epoch or left == 0:
            return mine
        if word != seen:
            seen, looks = word, 0
        if part != k and looks < _LOOKS:
            looks += 1
            for _ in range(_APART):
                pause(False)
        elif replaced(team + _TICKETS + 64 * part, word, word - 1):
            # As long as a number is not done, the loop stays that of now.
            end = read(team + _COUNT) * (part + 1) // size
            task, arguments = read(team + _TASK_AT), read(team + _ARGUMENTS)
            _call(task, arguments, end - left)
            mine += 1
            seen = word - 1


@noinline
def _share(team, count, task, arguments):
    """Let the team do a loop; its leader calls this."""
    size = read(team + _SIZE)
    write(team + _TASK_AT, task)
    write(team + _ARGUMENTS, arguments)
    write(team + _COUNT, count)
    write(team + _DONE, 0)
    epoch = read(team + _EPOCH) + 1
    for part in range(size):
        numbers = count * (part + 1) // size - count * part // size
        write(team + _TICKETS + 64 * part, ((epoch & _LEFT) << 32) | numbers)
    write(team + _EPOCH, epoch)
    mine = _take_part(team, 0)
    pauses = 0
    while read(team + _DONE) + mine < count:
        pause(pauses > _SHORT)
        pauses += 1


@noinline
def _serve(team, k):
    """Take part in loops until the leader ends, if there is one."""
    seen = -1
    pauses = 0
    while True:
        state = read(team + _STATE)
        if state == _ENDED or (state == _WAITS and pauses > _PATIENCE):
            return
        epoch = read(team + _EPOCH)
        if state == _LEADS and epoch != seen:
            seen = epoch
            pauses = 0
            mine = _take_part(team, k)
            if mine > 0:
                add(team + _DONE, mine)
        pause(pauses > _SHORT)
        pauses += 1


@noinline
def _distribute(team, count, task, arguments):
    """Do a loop: by the team that is at work, if one is, else by threads that begin for it."""
    if team == 0:
        _in_parallel(count, task, arguments, 0)
    elif read(team + _STATE) != _LEADS:
        _in_parallel(count, task, arguments, read(team + _SIZE))
    elif count > 1:
        _share(team, count, task, arguments)
    elif count == 1:
        _call(task, arguments, 0)


def shared_out(function: Callable) -> Callable:
    """Make ``f(mode, count, ...)``: ``function(..., k)`` for each k below `count`."""
    noinline(function)

    def loop(mode, count, *arguments):
        if isinstance(mode, Threaded) and not INTERPRETED:
            _distribute(mode.team, count, *_task(function, arguments))
        else:
            for k in range(count):
                function(*arguments, k)

    return loop


def by_threads(share: Callable) -> Callable:
    """Make the kernel ``f(mode, count, ...)`` that does ``share(..., k)`` for each k below `count`.

    The threads of `mode` divide these numbers among them.
    """
    names = ["mode", "count", *inspect.signature(share).parameters][:-1]
    loop = shared_out(share)

    @functools.wraps(share, updated=())  # marks stay with the share
    def all_shares(*arguments):
        loop(*arguments)

    kinds = [inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for name in names]
    all_shares.__signature__ = inspect.Signature(kinds)  # type: ignore[attr-defined]
    return kernel(all_shares)


def by_team(function: Callable) -> Callable:
    """Make ``f(mode, ...)``: ``function(mode, ...)``, a whole number, by a team where there is one.

    Its first thread does it, the others serve it.
    """
    inner = noinline(function)

    @shared
    def member(mode, *arguments):
        *given, k = arguments
        team = mode.team
        if k > 0:
            _serve(team, k)
        else:
            write(team + _STATE, _LEADS)
            write(team + _RESULT, _regardless(inner, mode, *given))
            write(team + _STATE, _ENDED)

    def run(mode, *arguments):
        if INTERPRETED or not isinstance(mode, Threaded):
            return inner(mode, *arguments)
        team = mode.team
        if team == 0:
            return inner(mode, *arguments)
        write(team + _STATE, _WAITS)
        size = read(team + _SIZE)
        _in_parallel(size, *_task(member, (mode, *arguments)), size)
        return read(team + _RESULT)

    return run
