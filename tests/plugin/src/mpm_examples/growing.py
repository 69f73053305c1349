"""transfer growing: FLIP with a parameter of its own."""

from typing import Annotated, NamedTuple

from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import AtLeast, In
from karamelo_py.points.transfers import TransferTraits, updated_velocity


class Growing(NamedTuple):
    """FLIP whose points multiply their velocity in every step.

    Parameters
    ----------
    factor
        By how much, each time.
    times
        How often in a step.

    Example
    -------
    method(ulmpm, growing, linear, 1.5)
    method(ulmpm, growing, linear, 1.5, 2)
    """

    factor: Annotated[float, In(0, 4)]
    times: Annotated[int, AtLeast(1)] = 1

    traits = TransferTraits()


known_failure(
    Growing,
    "growing velocities",
    when=lambda growing, scene: growing.factor > 1 and scene.fastest > 0,
    reason="with {scene.basis_name} functions points at {scene.fastest:.3g} are {part.factor:g} "
    "times as fast after each step",
    cure="a factor of 1 at most",
)


@updated_velocity.on(Growing)
def _updated_velocity_growing(transfer, v, v_pic, dv):
    return transfer.factor**transfer.times * (v + dv)
