"""method tlmpm: total Lagrangian, a grid for each solid."""

from karamelo_py.points.frames import Total
from karamelo_py.styles.methods.base import OwnGrids


class TLMPM(OwnGrids):
    """Total Lagrangian MPM: weights belong to reference positions, each solid has its own grid.

    Weights never change: no point crosses a cell face, and a body breaks only where its law says
    so. Solids do not see each other on the grid: contact is a matter of fixes (contact/hertz,
    contact/minimize_penetration). For bodies that keep their topology (de Vaucorbeil, Nguyen &
    Hutchinson 2020, "A Total-Lagrangian material point method for solid mechanics problems
    involving large deformations").

    Example
    -------
    method(tlmpm, FLIP, linear, 0.99)
    """

    frame = Total()
