"""A scene on several processes: where kernels of one call the others.

They call a Python function by address, which puts what it receives in the kernels' arrays.
"""

from typing import NamedTuple

import numpy as np
from numba import types

from karamelo_py.compiler import caller_of, kernel
from karamelo_py.kernels import totals
from karamelo_py.kernels.sums import arrays_given
from karamelo_py.kernels.sweep import sweep_blocks, visit_shares

CALL = types.int64(types.int64, types.int64, types.int64)
SWEEP, NEXT, GIVE, TAKE, TOTALS, LARGEST, NUMBER = range(7)

_call = caller_of(CALL)


class Linked(NamedTuple):
    """This process has some of the tiles."""

    address: int  # of ``(request, a, b) -> number``
    foreign: np.ndarray  # (N,) uint8: 1 if another process counts the terms of a node


@kernel
def _ask(address, request, a, b):
    return _call(address, request, a, b)


@totals.collect.on(Linked)
def _collect_linked(ranks, control, first, count):
    _ask(ranks.address, TOTALS, first, count)


@totals.counts.on(Linked)
def _counts_linked(ranks, n):
    return ranks.foreign[n] == 0


@totals.number_of_all.on(Linked)
def _number_of_all_linked(ranks, control, number):
    return _ask(ranks.address, NUMBER, number, 0)


@kernel
def _agree_on_reports(address, control):
    clock, answer = control.clock[0], control.answer
    answer[0], answer[1], answer[2] = clock.move, clock.new_move, clock.new_rate
    answer[3] = clock.wrong
    _call(address, LARGEST, 4, 0)
    clock.move, clock.new_move, clock.new_rate = answer[0], answer[1], answer[2]
    clock.wrong = int(answer[3])


@totals.agree_on_reports.on(Linked)
def _agree_on_reports_linked(ranks, control):
    _agree_on_reports(ranks.address, control)


@kernel
def _agree_on_heat(address, control):
    clock, answer = control.clock[0], control.answer
    answer[0], answer[1] = -clock.T_low, -clock.coldest
    answer[2], answer[3] = -clock.set_low, -clock.fall
    answer[4], answer[5] = clock.T_high, clock.hottest
    answer[6], answer[7], answer[8] = clock.set_high, clock.rise, clock.own_heat
    _call(address, LARGEST, 9, 0)
    clock.T_low, clock.coldest = -answer[0], -answer[1]
    clock.set_low, clock.fall = -answer[2], -answer[3]
    clock.T_high, clock.hottest = answer[4], answer[5]
    clock.set_high, clock.rise, clock.own_heat = answer[6], answer[7], answer[8]


@totals.agree_on_heat.on(Linked)
def _agree_on_heat_linked(ranks, control):
    _agree_on_heat(ranks.address, control)


@kernel
def _ask_if(due, address, request, a, b):
    if due:
        _call(address, request, a, b)


@totals.take_over.on(Linked)
def _take_over_linked(ranks, due):
    _ask_if(due, ranks.address, TAKE, 0, 0)


def _sweep_tiles(s, mode, visit, context, of_border):
    for block in s.blocks:
        border = block.tiling.count[2]
        if of_border:
            visit_shares(mode, border, visit, context, block, 0)
        else:
            visit_shares(mode, block.tiling.count[1] - border, visit, context, block, border)
        if len(s.blocks) > 1:
            _ask(s.control.ranks.address, NEXT, 0, 0)


@sweep_blocks.on(Linked)
def _sweep_blocks_linked(ranks, s, mode, visit, context):
    address = ranks.address
    _ask(address, SWEEP, 0, 0)
    _sweep_tiles(s, mode, visit, context, True)
    if len(visit.quantities):
        due = context.scatters & (s.buffers.count[1] == 0)
        _ask_if(due, address, GIVE, s.buffers.number, arrays_given(visit.quantities, s.kin))
    _sweep_tiles(s, mode, visit, context, False)
