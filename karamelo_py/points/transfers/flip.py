"""FLIP: the point takes the change of the nodal velocity (Brackbill & Ruppel 1986)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compile import real
from karamelo_py.points.transfers import (
    add_moment,
    add_momentum,
    updated_velocity,
    zero_moment,
)
from karamelo_py.tensors import add, add_scaled, scale


class FLIP(NamedTuple):
    """v_p = (1 - alpha) v_pic + alpha (v_p + dv): alpha = 1 is pure FLIP, alpha = 0 is PIC.

    Keeps energy well; keeps noise in the null space of the grid too, which a little PIC
    (alpha = 0.99) damps.

    Parameters
    ----------
    alpha
        Share of FLIP, 0 to 1.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)
    """

    alpha: float = 1.0

    keeps_moment = False


@updated_velocity.on(FLIP)
def _(transfer, v, v_pic, dv):
    flip = transfer.alpha
    return add_scaled(scale(real(1, flip) - flip, v_pic), flip, add(v, dv))


@add_momentum.on(FLIP)
def _(transfer, kin, basis, stencil, k, weighted_mass, mass, v, moment, total):
    return add_scaled(total, weighted_mass, v)


@zero_moment.on(FLIP)
def _(transfer, kin, like):
    return ()


@add_moment.on(FLIP)
def _(transfer, kin, basis, stencil, k, weight, velocity, moment):
    return moment
