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
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import config, types

from karamelo_py.compiler import code, machine
from karamelo_py.compiler.atomics import I64, add, pause, read, replaced, write
from karamelo_py.compiler.compile import by_type, define, shared
from karamelo_py.compiler.failing import note, noting
from karamelo_py.compiler.held import HeldTuple, address, at_address, held_type, hold
from karamelo_py.compiler.intrinsics import builtin, intrinsic
from karamelo_py.compiler.loops import noinline
from karamelo_py.compiler.trace import formula
from karamelo_py.compiler.values import Value


class Serial(NamedTuple):
    """One thread."""


class Threaded(NamedTuple):
    """All threads that there are; `team` is where what a team shares lies (`new_team`)."""

    team: int = 0


# --- threads ----------------------------------------------------------------------------------

_TASK = ir.FunctionType(ir.VoidType(), [I64, I64])  # where its arguments are, and a number
_PART = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 4)
_threads = config.NUMBA_NUM_THREADS


def set_threads(count: int) -> None:
    """Let loops take so many threads from now on."""
    global _threads
    _threads = count


@functools.cache
def _pool(count: int) -> ThreadPoolExecutor:
    """Start so many threads, beside the one at work."""
    return ThreadPoolExecutor(count)


if hasattr(os, "register_at_fork"):
    # A process that another one made by copying itself has none of its threads.
    os.register_at_fork(after_in_child=_pool.cache_clear)


def _share_out(count: int, part: int, task: int, arguments: int) -> None:
    """Do a task for each number below `count`, by `part`, a function of a range of these."""
    do = _PART(part)
    size = min(count, _threads)
    ends = [count * k // size for k in range(size + 1)] if size else [0, 0]
    pairs = pairwise(ends[1:])
    others: list = []
    try:
        for pair in pairs:
            others.append(_pool(_threads - 1).submit(do, task, arguments, *pair))
        do(task, arguments, *ends[:2])
    except BaseException as error:  # such as Ctrl-C; the others still work on these arguments
        note(error)
    while others:
        try:
            others[-1].result()
        except BaseException as error:
            note(error)
        others = [other for other in others if not other.done()]


machine.publish_python("karamelo_share_out", _PART, noting(_share_out))


def _address_of(function: Callable, *like: int) -> int:
    """Give the address of a function of as many whole numbers."""
    raise NotImplementedError


@builtin(_address_of)
def _address_of_code(lowering: Any, function: Any, count: int) -> Value:
    kinds = (types.intp,) * count
    found = formula(function.seen, kinds)
    if lowering.builder is None:
        return Value(types.intp, None)
    made = lowering.function(found.name, found.run, kinds, types.none)
    if getattr(made, "raises", False):
        lowering.builder.function.raises = True
    return Value(types.intp, lowering.builder.ptrtoint(made, I64))


@intrinsic
def _call(task, arguments, number):
    """Call the task at an address."""

    def codegen(builder, signature, values):
        builder.call(builder.inttoptr(values[0], _TASK.as_pointer()), values[1:])
        return code.nothing()

    return types.none(types.intp, types.intp, types.intp), codegen


@intrinsic
def _call_python(count, part, task, arguments):
    """Call `_share_out`."""

    def codegen(builder, signature, values):
        function = code.external(builder, "karamelo_share_out", ir.VoidType(), [I64] * 4)
        builder.call(function, values)
        return code.nothing()

    return types.none(*[types.intp] * 4), codegen


def _regardless(function: Callable, *arguments: Any) -> Any:
    """Call a function; an exception in it is left to who called this one."""
    raise NotImplementedError


@builtin(_regardless)
def _call_regardless(lowering: Any, function: Callable, *arguments: Any) -> Any:
    lowering.regardless = True
    try:
        return function(*arguments)
    finally:
        lowering.regardless = False


@shared
def _do_part(task, arguments, begin, end):
    for number in range(begin, end):
        _call(task, arguments, number)


@noinline
def _in_parallel(count, task, arguments):
    """Do a task for each number below `count`, by threads that begin for it."""
    _call_python(count, _address_of(_do_part, 4), task, arguments)


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
    if team == 0 or read(team + _STATE) != _LEADS:
        _in_parallel(count, task, arguments)
    elif count > 1:
        _share(team, count, task, arguments)
    elif count == 1:
        _call(task, arguments, 0)


@noinline
def _begin_and_end(team, body, arguments):
    """Let threads do `body`: one of them leads."""
    _in_parallel(read(team + _SIZE), body, arguments)


def _task_of(name: str, items: Any, lines: tuple, **names: Any) -> Callable:
    """Make a function of the address of these items, `a` in its lines, and of a number k."""
    held = HeldTuple(tuple(map(held_type, items)))
    task = define("arguments, k", "a = at(arguments)", *lines, at=at_address(held), **names)
    task.__qualname__ = f"{name}.task.{held.name}"
    return shared(task)


def shared_out(function: Callable, parameters: str) -> Callable:
    """Make ``f(mode, count, ...)``: ``function(..., k)`` for each k below `count`.

    `parameters` are the names of what stands before k.
    """

    def loop(mode, count, *arguments):
        for k in range(count):
            function(*arguments, k)

    @by_type(loop)
    def _loop_by_type(mode, count, *arguments):
        names = f"mode, count, {parameters}"
        if mode.instance_class is not Threaded:
            lines = "for k in range(count):", f"    function({parameters}, k)"
            return define(names, *lines, function=function)
        items = ", ".join(f"a[{k}]" for k in range(len(arguments)))
        call = (f"function({items}, k)",)
        return define(
            names,
            f"distribute(mode.team, count, address_of(body, 2), address(hold(({parameters},))))",
            distribute=_distribute, address_of=_address_of, address=address, hold=hold,
            body=_task_of(function.__qualname__, arguments, call, function=function),
        )  # fmt: skip

    return loop


def by_team(function: Callable, parameters: str) -> Callable:
    """Make ``f(mode, ...)``: ``function(mode, ...)``, a whole number, by a team where there is one.

    `parameters` are the names of what stands behind the mode.
    """

    def run(mode, *arguments):
        return function(mode, *arguments)

    inner = noinline(function)

    @by_type(run)
    def _run_by_type(mode, *arguments):
        names = f"mode, {parameters}"
        if mode.instance_class is not Threaded:
            return define(names, f"return function({names})", function=inner)
        items = ", ".join(f"a[{k}]" for k in range(1 + len(arguments)))
        names_of_words = {
            "STATE": _STATE, "LEADS": _LEADS, "ENDED": _ENDED, "RESULT": _RESULT,
            "SIZE": _SIZE, "WAITS": _WAITS, "read": read, "write": write, "function": inner,
        }  # fmt: skip
        lines = (
            "team = a[0].team",
            "if k > 0:",
            "    serve(team, k)",
            "else:",
            "    write(team + STATE, LEADS)",
            f"    write(team + RESULT, regardless(function, {items}))",
            "    write(team + STATE, ENDED)",
        )
        body = _task_of(
            function.__qualname__, (mode, *arguments), lines, serve=_serve, regardless=_regardless,
            **names_of_words,
        )  # fmt: skip
        return define(
            names,
            "team = mode.team",
            f"if team == 0: return function({names})",
            "write(team + STATE, WAITS)",
            f"begin_and_end(team, address_of(body, 2), address(hold(({names}))))",
            "return read(team + RESULT)",
            begin_and_end=_begin_and_end, address_of=_address_of, address=address, hold=hold,
            body=body, **names_of_words,
        )  # fmt: skip

    return run
