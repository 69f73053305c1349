"""Loops that threads share out: one for all kernels, which calls what is done by its address.

Numba compiles a loop over threads in five functions, and takes the tuples that it works with apart
and puts them together again in each. Here the arguments stay where they are; what is done with them
is a function of where that is, and a number.

Threads that sleep between two loops take as long to wake up as a small loop takes. A kernel of many
loops is therefore run by a *team* (`by_team`): its first thread leads, and goes through the kernel;
the others wait for loops of it. Each has its part of the numbers of a loop, the same in each step,
and takes those of a thread that does not go on. The leader waits for numbers that were taken, never
for threads: one that another program keeps from running holds nobody up.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numba import config, prange, types
from numba.core import cgutils
from numba.extending import intrinsic

from karamelo_py.compiler import inlining
from karamelo_py.compiler.compile import by_type, define
from karamelo_py.compiler.held import HeldTuple, address, at_address, held_type, hold
from karamelo_py.compiler.loops import kernel, left, subkernel
from karamelo_py.compiler.words import I64, add, pause, read, replaced, word, write


class Serial(NamedTuple):
    """One thread."""


class Threaded(NamedTuple):
    """All threads that Numba was given; `team` is where what a team shares lies (`new_team`)."""

    team: int = 0


_TASK = types.none(types.intp, types.intp)  # where its arguments are, and a number


@intrinsic
def _address_of(typing_context, function):
    """Where the code of a function of this signature is."""
    dispatcher = function.dispatcher
    dispatcher.compile(_TASK.args)

    def codegen(context, builder, signature, arguments):
        compiled = dispatcher.overloads[_TASK.args]
        context.active_code_library.add_linking_library(compiled.library)
        function = context.declare_function(builder.module, compiled.fndesc)
        return builder.ptrtoint(function, context.get_value_type(types.intp))

    return types.intp(function), codegen


def _call_at(context: Any, builder: Any, values: list) -> Any:
    """Code that calls the task at an address; its status."""
    convention = context.call_conv
    kind = convention.get_function_type(_TASK.return_type, _TASK.args)
    function = builder.inttoptr(values[0], kind.as_pointer())
    return convention.call_function(builder, function, _TASK.return_type, _TASK.args, values[1:])[0]


@intrinsic
def _call(typing_context, task, arguments, number, failed):
    """Call the task at an address. Where it fails, one more than its number goes to `failed`."""

    def codegen(context, builder, signature, values):
        status = _call_at(context, builder, values[:3])
        with cgutils.if_unlikely(builder, status.is_error):
            builder.store(builder.add(values[2], I64(1)), word(builder, values[3]))
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.intp, types.intp), codegen


@intrinsic
def _nothing(typing_context):
    """The address of a word of the function that calls this, 0 by now."""

    def codegen(context, builder, signature, values):
        place = cgutils.alloca_once(builder, I64)
        builder.store(I64(0), place)
        return builder.ptrtoint(place, I64)

    return types.intp(), codegen


@intrinsic
def _fail(typing_context, task, arguments, failed):
    """Fail as the task did whose number is one less than what is at `failed`, if that is not 0.

    A thread cannot raise what Python is to see: the task is done once more, by who shared it out.
    """

    def codegen(context, builder, signature, values):
        first = builder.load(word(builder, values[2]))
        with cgutils.if_unlikely(builder, builder.icmp_signed("!=", first, I64(0))):
            status = _call_at(context, builder, [*values[:2], builder.sub(first, I64(1))])
            with cgutils.if_likely(builder, status.is_error):
                context.call_conv.return_status_propagate(builder, status)
            text = "one of several threads failed, and did not when it was asked again"
            context.call_conv.return_user_exc(builder, RuntimeError, (text,))
        return context.get_dummy_value()

    return types.none(types.intp, types.intp, types.intp), codegen


def _in_parallel(count, task, arguments, failed):
    for number in prange(count):
        _call(task, arguments, number, failed)


inlining.claim(_in_parallel.__qualname__, "kept")
_in_parallel = kernel(_in_parallel, parallel=True, no_cpython_wrapper=True)


# --- teams ------------------------------------------------------------------------------------

# Words, each in a line of the caches of its own.
_STATE, _SIZE, _TASK_AT, _ARGUMENTS, _COUNT, _DONE, _EPOCH = range(0, 7 * 64, 64)
_FAILED, _LED, _RESULT, _TICKETS = range(7 * 64, 11 * 64, 64)
_WAITS, _LEADS, _ENDED = range(3)  # in _STATE
_SHORT = 8000  # pauses, some 0.3 ms; then threads sleep, since others may need their cores
_APART, _LOOKS = 10, 64  # pauses between looks at what is left of another's part; looks, 30 us
_PATIENCE = 11000  # pauses until a thread does not wait for a leader any more
_LEFT = (1 << 32) - 1  # of a ticket: how many numbers are left; above them the loop


def new_team(threads: int) -> np.ndarray:
    """What a team of so many threads shares; its address is that in `Threaded`."""
    if not config.DISABLE_JIT:
        numba.get_num_threads()  # which starts what loops from the cache need before being loaded
    words = np.zeros((_TICKETS // 64 + threads, 8), np.int64)
    words[_SIZE // 64, 0] = threads
    return words


@subkernel
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
            _call(task, arguments, end - left, team + _FAILED)
            mine += 1
            seen = word - 1


@subkernel
def _share(team, count, task, arguments):
    """Let the team do a loop; its leader calls this."""
    size = read(team + _SIZE)
    write(team + _TASK_AT, task)
    write(team + _ARGUMENTS, arguments)
    write(team + _COUNT, count)
    write(team + _DONE, 0)
    write(team + _FAILED, 0)
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


@subkernel
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


@subkernel
def _distribute(team, count, task, arguments):
    """Do a loop: by the team that is at work, if one is, else by threads that begin for it."""
    failed = _nothing()
    if team == 0 or read(team + _STATE) != _LEADS:
        _in_parallel(count, task, arguments, failed)
    elif count > 1:
        _share(team, count, task, arguments)
        write(failed, read(team + _FAILED))
    elif count == 1:
        _call(task, arguments, 0, failed)
    _fail(task, arguments, failed)


@subkernel
def _begin_and_end(team, body, leads, arguments):
    """Let threads do `body`: one of them leads, by doing `leads`."""
    _in_parallel(read(team + _SIZE), body, arguments, team + _LED)
    _fail(leads, arguments, team + _LED)


def _task_of(name: str, items: Any, lines: tuple, **names: Any) -> Callable:
    """A function of the address of these items, `a` in its lines, and of a number k."""
    held = HeldTuple(tuple(map(held_type, items)))
    task = define("arguments, k", "a = at(arguments)", *lines, at=at_address(held), **names)
    # Another for other arguments: their types are not in the type of a task, and code of one name
    # that other processes have kept is taken to be the same.
    task.__qualname__ = f"{name}.task.{held.name}"
    return left(task)


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
            f"distribute(mode.team, count, address_of(body), address(hold(({parameters},))))",
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

    inner = subkernel(function)

    @by_type(run)
    def _run_by_type(mode, *arguments):
        names = f"mode, {parameters}"
        if mode.instance_class is not Threaded:
            return define(names, f"return function({names})", function=inner)
        items = ", ".join(f"a[{k}]" for k in range(1 + len(arguments)))
        names_of_words = {
            "LED": _LED, "STATE": _STATE, "LEADS": _LEADS, "ENDED": _ENDED, "RESULT": _RESULT,
            "SIZE": _SIZE, "WAITS": _WAITS, "read": read, "write": write, "function": inner,
        }  # fmt: skip
        leads = _task_of(
            f"{function.__qualname__}.leads", (mode, *arguments),
            (f"write(a[0].team + RESULT, function({items}))",), **names_of_words,
        )  # fmt: skip
        lines = (
            "team = a[0].team",
            "if k > 0:",
            "    serve(team, k)",
            "else:",
            "    write(team + STATE, LEADS)",
            "    call(address_of(leads), arguments, 0, team + LED)",
            "    write(team + STATE, ENDED)",
        )
        body = _task_of(
            function.__qualname__, (mode, *arguments), lines, serve=_serve, call=_call,
            address_of=_address_of, leads=leads, **names_of_words,
        )  # fmt: skip
        return define(
            names,
            "team = mode.team",
            f"if team == 0: return function({names})",
            "write(team + STATE, WAITS)",
            "write(team + LED, 0)",
            f"begin_and_end(team, address_of(body), address_of(leads), address(hold(({names}))))",
            "return read(team + RESULT)",
            begin_and_end=_begin_and_end, address_of=_address_of, address=address, hold=hold,
            body=body, leads=leads, **names_of_words,
        )  # fmt: skip

    return run
