"""PIC: the point takes the nodal velocity (Harlow 1964)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    updated_velocity,
    zero_moment,
)
from karamelo_py.tensors import add_scaled


class PIC(NamedTuple):
    """v_p = v_pic, the updated nodal velocity at the point.

    Very stable and very dissipative: each step smooths the velocity over a cell, and angular
    momentum is lost.

    Example
    -------
    method(ulmpm, PIC, linear)
    """

    keeps_moment = False


@updated_velocity.on(PIC)
def _(transfer, v, v_pic, dv):
    return v_pic


@add_momentum.on(PIC)
def _(transfer, kin, basis, stencil, k, weighted_mass, mass, v, moment, total):
    return add_scaled(total, weighted_mass, v)


@zero_moment.on(PIC)
def _(transfer, kin, like):
    return ()


@add_moment.on(PIC)
def _(transfer, kin, basis, stencil, k, weight, velocity, moment):
    return moment
