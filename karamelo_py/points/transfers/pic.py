"""PIC: the point takes the nodal velocity (Harlow 1964)."""

from typing import NamedTuple

from karamelo_py.language.rules import known_failure
from karamelo_py.points.transfers import take_nodal_velocity


class PIC(NamedTuple):
    """v_p = v_pic, the updated nodal velocity at the point.

    Very stable and very dissipative: each step smooths the velocity over a cell, and angular
    momentum is lost.

    Example
    -------
    method(ulmpm, PIC, linear)
    """

    inverts_spread = False
    in_lanes = True


known_failure(
    PIC,
    "angular momentum",
    when=lambda pic, scene: scene.turns,
    reason="PIC takes a per cent or more of the angular momentum of a turning body in every step",
    cure="APIC, or FLIP, in the place of PIC",
)

take_nodal_velocity(PIC)
