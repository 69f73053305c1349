"""Parallel loops: one implementation for all kernels, which calls the loop body by address.

The body is a function of the address of the loop's arguments, and of an index. As waking threads
takes as long as a small loop, a kernel with many loops is run by a *team* (`by_team`): the first
thread executes the kernel, and the other threads wait for its loops. Each thread has a fixed range
of indices, and takes indices from threads that make no progress.
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

from karamelo_py.compiler import llvm
from karamelo_py.compiler.code import machine
from karamelo_py.compiler.code.exceptions import failure_at, note
from karamelo_py.compiler.llvm import I32, I64
from karamelo_py.compiler.trace.choices import INTERPRETED
from karamelo_py.compiler.trace.functions import chosen
from karamelo_py.compiler.trace.held import HeldTuple, held_as, held_type
from karamelo_py.compiler.trace.kernels import kernel, noinline
from karamelo_py.compiler.trace.primitives import implements, shared
from karamelo_py.compiler.trace.values import (
    HeldValue,
    Value,
    builtin,
    in_kernels,
    in_one_module,
    intrinsic,
    now,
)


class Serial(NamedTuple):
    pass


class Threaded(NamedTuple):
    """Selects several threads; `team` is the address of their shared memory (`new_team`)."""

    team: int = 0


def many_threads() -> bool:
    """Return True if several threads may write to the same number, as on a GPU."""
    return False


@builtin(many_threads)
def _many_threads(lowering: Any) -> bool:
    return in_one_module()


def _word(builder: ir.IRBuilder, address: Any) -> ir.Value:
    return builder.inttoptr(address, I64.as_pointer())


@intrinsic
def read(address):
    def codegen(builder, at):
        return builder.load_atomic(_word(builder, at), "acquire", 8)

    return types.intp(types.intp), codegen


@intrinsic
def write(address, value):
    def codegen(builder, at, number):
        builder.store_atomic(number, _word(builder, at), "release", 8)

    return types.none(types.intp, types.intp), codegen


@intrinsic
def add(address, value):
    def codegen(builder, at, number):
        builder.atomic_rmw("add", _word(builder, at), number, "acq_rel")

    return types.none(types.intp, types.intp), codegen


@intrinsic
def replaced(address, old, new):
    """Store `new` atomically if the word is `old`; return True if it was."""

    def codegen(builder, at, *numbers):
        result = builder.cmpxchg(_word(builder, at), *numbers, "acq_rel", "acquire")
        return builder.extract_value(result, 1)

    return types.boolean(types.intp, types.intp, types.intp), codegen


@intrinsic
def pause(long):
    def codegen(builder, sleeps):
        def call(name, result, *numbers):
            function = llvm.external(builder, name, result, [I32] * len(numbers))
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
    array[i, j] += value


@implements(add_among)
@intrinsic
def _add_among(array, i, j, value):
    def codegen(builder, table, i, j, number):
        at = llvm.item_pointer(builder, array, table, (i, j))
        builder.atomic_rmw("add", at, number, "monotonic")

    return types.none(array, types.int64, types.int64, types.int64), codegen


# Parameters of a task: address of the arguments, index, address of the `Failure`.
_TASK = ir.FunctionType(ir.VoidType(), [I64] * 3)
_PART = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 5)
_SHARE_OUT = [ctypes.c_int64] * 6


class _Pools(threading.local):
    def __init__(self) -> None:
        self.of = functools.cache(ThreadPoolExecutor)


_pools = _Pools()
if hasattr(os, "register_at_fork"):
    # a forked process has no other threads
    os.register_at_fork(after_in_child=lambda: _pools.of.cache_clear())


def _share_out(
    count: int, run_range: int, task: int, arguments: int, threads: int, failure: int
) -> None:
    """Run a task for each index in [0, count), by ranges; `threads` = 0 uses all threads."""
    do, threads = _PART(run_range), threads or config.NUMBA_NUM_THREADS
    size = min(count, threads)
    ends = [count * k // size for k in range(size + 1)] if size else [0, 0]
    pairs = pairwise(ends[1:])
    others: list = []
    try:
        for pair in pairs:
            others.append(_pools.of(threads - 1).submit(do, task, arguments, *pair, failure))
        do(task, arguments, *ends[:2], failure)
    except BaseException as error:  # catches Ctrl-C, too, as threads still use these arguments
        note(error, failure)
    while others:
        try:
            others[-1].result()
        except BaseException as error:
            note(error, failure)
        others = [other for other in others if not other.done()]


machine.publish_python("karamelo_share_out", ctypes.CFUNCTYPE(None, *_SHARE_OUT), _share_out)


class _Task(NamedTuple):
    function: Callable
    kind: HeldTuple

    def __call__(self, address: Value, number: Value) -> None:
        lowering = now()
        pointer = lowering.builder.inttoptr(address._value, self.kind.register_type())
        run = chosen(self.function, (*self.kind, types.intp))
        run(*HeldValue(self.kind, pointer), number)


def _address(lowering: Any, name: str, run: Callable, count: int) -> Value:
    made = lowering.function(name, run, (types.intp,) * count, types.none)
    if hasattr(made, "raises"):
        lowering.builder.function.raises = True
    return Value(types.intp, lowering.builder.ptrtoint(made, I64))


@in_kernels
def _task(lowering: Any, function: Any, items: tuple) -> tuple[Value, Value]:
    """Store items; return the address of a function of items and index, and the items' address."""
    kind = HeldTuple(tuple(held_type(types.unliteral(lowering.kind_of(item))) for item in items))
    stored = held_as(lowering, items, kind)
    task = _address(lowering, function.seen.__qualname__, _Task(function.seen, kind), 2)
    return task, Value(types.intp, lowering.builder.ptrtoint(stored._value, I64))


@intrinsic
def _call(task, arguments, number):

    def codegen(builder, task, *numbers):
        pointer = builder.inttoptr(task, _TASK.as_pointer())
        builder.call(pointer, [*numbers, failure_at(builder)])

    return types.none(types.intp, types.intp, types.intp), codegen


@in_kernels
def _regardless(lowering: Any, function: Callable, *arguments: Any) -> Any:
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
    builder, kinds = lowering.builder, [I64] * len(_SHARE_OUT)
    run = chosen(_do_part, (types.intp,) * 4)
    run_range = _address(lowering, _do_part.__name__, run, 4)
    arguments_of_call = (count, run_range, task, arguments, threads)
    numbers = [lowering.lowered(number, types.intp) for number in arguments_of_call]
    function = llvm.external(builder, "karamelo_share_out", ir.VoidType(), kinds)
    builder.call(function, [*numbers, failure_at(builder)])


# Protocol. Thread 0, the leader, runs the kernel and publishes each parallel loop; other threads
# serve. Only the leader writes _STATE. Each thread has a range of the indices of a loop, and a
# ticket: the number of the loop, and how many indices of the range are left. A thread takes an
# index by decreasing a ticket with compare-and-swap. The protocol is correct because: 1. Each index
# is processed once: only one of several swaps of a ticket succeeds, and tickets of different loops
# differ. 2. A thread that has taken an index sees the task, arguments and count of its loop. The
# leader writes them before it stores the tickets (release), and a swap acquires the ticket; swaps
# by other threads in between continue the release. 3. A loop ends when the leader's indices and
# those in _DONE make up the count. Other threads add to _DONE after their work (release), and the
# leader acquires it, so it sees their results. 4. The leader takes indices that are left itself.
# The leader waits only for indices that other threads have taken, never for a thread that sleeps or
# was preempted. The words are in separate cache lines:
_STATE, _SIZE, _TASK_AT, _ARGUMENTS, _COUNT, _DONE, _EPOCH = range(0, 7 * 64, 64)
_RESULT, _TICKETS = range(7 * 64, 9 * 64, 64)
_WAITS, _LEADS, _ENDED = range(3)  # values of _STATE
_SHORT = 8000  # pauses (0.3 ms) before a waiting thread sleeps, so that others can use its core
_APART, _LOOKS = 10, 64  # pauses between looks at another range; number of looks (30 us in all)
_PATIENCE = 11000  # pauses until a thread no longer waits for a leader
_LEFT = (1 << 32) - 1  # bits of a ticket with the number of indices; the upper bits are the loop


def new_team(threads: int) -> np.ndarray:
    words = np.zeros((_TICKETS // 64 + threads, 8), np.int64)
    words[_SIZE // 64, 0] = threads
    return words


@noinline
def _take_part(team, k):
    """Process indices of the present loop, first from thread `k`'s range; return their number.

    Data of a thread are in its own caches, so other threads take indices from its range only if the
    range has not become smaller for a while.
    """
    size = read(team + _SIZE)
    epoch = read(team + _TICKETS + 64 * k) >> 32
    mine = looks = seen = 0
    while True:
        owner = k
        word = read(team + _TICKETS + 64 * k)
        for other in range(0 if word & _LEFT > 0 else size):
            ticket = read(team + _TICKETS + 64 * other)
            if ticket & _LEFT > word & _LEFT:
                owner, word = other, ticket
        left = word & _LEFT
        if word >> 32 != epoch or left == 0:
            return mine
        if word != seen:
            seen, looks = word, 0
        if owner != k and looks < _LOOKS:
            looks += 1
            for _ in range(_APART):
                pause(False)
        elif replaced(team + _TICKETS + 64 * owner, word, word - 1):
            # The loop does not end while an index is unfinished.
            end = read(team + _COUNT) * (owner + 1) // size
            task, arguments = read(team + _TASK_AT), read(team + _ARGUMENTS)
            _call(task, arguments, end - left)
            mine += 1
            seen = word - 1


@noinline
def _share(team, count, task, arguments):
    size = read(team + _SIZE)
    write(team + _TASK_AT, task)
    write(team + _ARGUMENTS, arguments)
    write(team + _COUNT, count)
    write(team + _DONE, 0)
    epoch = read(team + _EPOCH) + 1
    for owner in range(size):
        numbers = count * (owner + 1) // size - count * owner // size
        write(team + _TICKETS + 64 * owner, ((epoch & _LEFT) << 32) | numbers)
    write(team + _EPOCH, epoch)
    mine = _take_part(team, 0)
    pauses = 0
    while read(team + _DONE) + mine < count:
        pause(pauses > _SHORT)
        pauses += 1


@noinline
def _serve(team, k):
    """Work on loops until the leader, if any, ends."""
    seen, pauses = -1, 0
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
    if team == 0:
        _in_parallel(count, task, arguments, 0)
    elif read(team + _STATE) != _LEADS:
        _in_parallel(count, task, arguments, read(team + _SIZE))
    elif count > 1:
        _share(team, count, task, arguments)
    elif count == 1:
        _call(task, arguments, 0)


def shared_out(function: Callable) -> Callable:
    """Make ``f(mode, count, ...)``: ``function(..., k)`` for k in [0, count), in parallel."""
    noinline(function)

    def loop(mode, count, *arguments):
        if isinstance(mode, Threaded) and not INTERPRETED:
            _distribute(mode.team, count, *_task(function, arguments))
        else:
            for k in range(count):
                function(*arguments, k)

    return loop


def by_threads(body: Callable) -> Callable:
    """Make the kernel ``f(mode, count, ...)``: ``share(..., k)`` for k in [0, count)."""
    names = ["mode", "count", *inspect.signature(body).parameters][:-1]
    loop = shared_out(body)

    @functools.wraps(body, updated=())  # retains marks of the function
    def all_shares(*arguments):
        loop(*arguments)

    kinds = [inspect.Parameter(name, inspect.Parameter.POSITIONAL_OR_KEYWORD) for name in names]
    all_shares.__signature__ = inspect.Signature(kinds)  # type: ignore[attr-defined]
    return kernel(all_shares)


def by_team(function: Callable) -> Callable:
    """Make ``f(mode, ...)``, which runs ``function(mode, ...)`` (an integer) by a team, if any."""
    inner = noinline(function)

    @shared
    def member(mode, *arguments):
        *items, k = arguments
        team = mode.team
        if k > 0:
            _serve(team, k)
        else:
            write(team + _STATE, _LEADS)
            write(team + _RESULT, _regardless(inner, mode, *items))
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
