"""Motion through the grid that a body bears: it feeds what the grid does not see of velocities.

Measured with disks of rubber and of metal, 4 to 16 cells across the radius, that vibrate by 0.01 to
2 % while they drift or turn (docs/energy.md).
"""

from math import inf
from typing import Any, NamedTuple


class Borne(NamedTuple):
    """Cells crossed times c dt/h up to which energy is kept, with two points a cell or one.

    Attributes
    ----------
    drift
        By the centre of mass in the plane and in space, with musl and usf.
    line
        By how much less that is in 1D.
    averaged
        The same as `drift` with usavg.
    rim
        By the rim of a body that turns, with musl and usf.
    rim_averaged
        The same with usavg.
    fastest
        Times the speed of waves, from where on a drift feeds nothing.
    damps
        Whether a drift beyond that damps what vibrates in space.
    """

    drift: tuple[float, float]
    line: float
    averaged: tuple[float, float]
    rim: tuple[float, float]
    rim_averaged: tuple[float, float]
    fastest: float = inf
    damps: bool = False


JUMPS = Borne((4, 2), 3, (35, 35), (15, 1.5), (inf, 7))  # functions whose gradients jump
BOXES = Borne((18, 18), 6, (inf, inf), (60, 25), (inf, inf))
QUADRATIC = Borne((54, 20), 6, (inf, inf), (inf, 25), (inf, inf))
CUBIC = Borne((135, 70), 6, (inf, inf), (inf, inf), (inf, inf), fastest=1, damps=True)


def borne(basis: Any) -> Borne:
    """Look up what is known of these functions: the basis says it, or what is like it does."""
    usual = BOXES if basis.steep_edge else QUADRATIC
    usual = JUMPS if getattr(basis, "gradient_jumps", False) else usual
    return getattr(basis, "borne", usual)
