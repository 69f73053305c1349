"""A scene that several processes share: where the kernels of one call the others.

They call a function of Python by its address. Whatever it gets from the other processes, it leaves
in the arrays that the kernels know.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import types

from karamelo_py.compiler.compile import caller_of, entered
from karamelo_py.kernels.totals import (
    agree_on_heat,
    agree_on_reports,
    collect,
    counts,
    exchange,
    number_of_all,
)

CALL = types.int64(types.int64, types.int64, types.int64)
BOXES, TOTALS, REPORTS, HEAT, NUMBER = range(5)

_call = caller_of(CALL)


class Linked(NamedTuple):
    """This process has some tiles of the scene."""

    address: int  # of the function ``(what, a, b) -> number``
    foreign: np.ndarray  # (N,) uint8: 1 where another process adds up what a node gives


@entered
def _ask(address, what, a, b):
    return _call(address, what, a, b)


@collect.on(Linked)
def _(ranks, control, first, count):
    _ask(ranks.address, TOTALS, first, count)


@counts.on(Linked)
def _(ranks, n):
    return ranks.foreign[n] == 0


@number_of_all.on(Linked)
def _(ranks, control, number):
    return _ask(ranks.address, NUMBER, number, 0)


@agree_on_reports.on(Linked)
def _(ranks, control):
    _ask(ranks.address, REPORTS, 0, 0)


@agree_on_heat.on(Linked)
def _(ranks, control):
    _ask(ranks.address, HEAT, 0, 0)


@entered
def _ask_if(due, address, what, a, b):
    if due:
        _call(address, what, a, b)


@exchange.on(Linked)
def _(ranks, buffers, due, what):
    _ask_if(due, ranks.address, BOXES, buffers.number, what)
