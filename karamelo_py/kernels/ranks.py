"""Scenes on several processes, whose kernels call Python by address to exchange arrays."""

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
    address: int  # address of ``(request, a, b) -> number``
    foreign: np.ndarray  # (N,) uint8: 1 if another process adds the terms of a node


@kernel
def _ask(address, request, a, b, due):
    return _call(address, request, a, b) if due else 0


@totals.collect.on(Linked)
def _collect_linked(ranks, control, first, count):
    _ask(ranks.address, TOTALS, first, count, True)


@totals.counts.on(Linked)
def _counts_linked(ranks, n):
    return ranks.foreign[n] == 0


@totals.number_of_all.on(Linked)
def _number_of_all_linked(ranks, control, number):
    return _ask(ranks.address, NUMBER, number, 0, True)


def _largest(address, answer, numbers):
    for k, number in enumerate(numbers):
        answer[k] = number
    _call(address, LARGEST, len(numbers), 0)
    return tuple([answer[k] for k in range(len(numbers))])


@kernel
def _agree_on_reports(address, control):
    motion = control.motion[0]
    numbers = motion.move, motion.new_move, motion.new_rate, float(motion.wrong)
    numbers = _largest(address, control.answer, numbers)
    motion.move, motion.new_move, motion.new_rate = numbers[:3]
    motion.wrong = int(numbers[3])


@totals.agree_on_reports.on(Linked)
def _agree_on_reports_linked(ranks, control):
    _agree_on_reports(ranks.address, control)


@kernel
def _agree_on_heat(address, control):
    heat = control.heat[0]
    lowest = heat.T_low, heat.coldest, heat.set_low, heat.fall
    highest = heat.T_high, heat.hottest, heat.set_high, heat.rise, heat.own_heat
    numbers = _largest(address, control.answer, (*[-x for x in lowest], *highest))
    heat.T_low, heat.coldest, heat.set_low, heat.fall = [-x for x in numbers[:4]]
    heat.T_high, heat.hottest, heat.set_high, heat.rise, heat.own_heat = numbers[4:]


@totals.agree_on_heat.on(Linked)
def _agree_on_heat_linked(ranks, control):
    _agree_on_heat(ranks.address, control)


@totals.take_over.on(Linked)
def _take_over_linked(ranks, due):
    _ask(ranks.address, TAKE, 0, 0, due)


def _sweep_tiles(s, mode, visit, context, of_border):
    for block in s.blocks:
        border = block.tiling.count[2]
        if of_border:
            visit_shares(mode, border, visit, context, block, 0)
        else:
            visit_shares(mode, block.tiling.count[1] - border, visit, context, block, border)
        if len(s.blocks) > 1:
            _ask(s.control.ranks.address, NEXT, 0, 0, True)


@sweep_blocks.on(Linked)
def _sweep_blocks_linked(ranks, s, mode, visit, context):
    address = ranks.address
    _ask(address, SWEEP, 0, 0, True)
    _sweep_tiles(s, mode, visit, context, True)
    if len(visit.quantities):
        due = context.scatters & (s.buffers.count[1] == 0)
        _ask(address, GIVE, s.buffers.number, arrays_given(visit.quantities, s.kin), due)
    _sweep_tiles(s, mode, visit, context, False)
