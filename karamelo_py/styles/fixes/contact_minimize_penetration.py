"""fix contact/minimize_penetration: points of two solids undo their penetration, with friction."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import NonNegative
from karamelo_py.points.bodies import MinimizePenetration
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.styles.fixes.friction import judge_friction
from karamelo_py.styles.fixes.pairs import PairContact


class ContactMinimizePenetration(PairContact):
    """Let two solids touch point by point, as stiffly as the step allows, with friction.

    Parameters
    ----------
    solid1, solid2
        IDs of the two solids.
    mu
        Coefficient of friction (Coulomb).

    Example
    -------
    fix(touch, contact/minimize_penetration, ball, plate, 0.2)

    Notes
    -----
    Points are balls with the radius R of half the side of a cube of their present volume (in the
    plane a square, in axisymmetry one at the distance r from the axis). Two that are closer than
    R1 + R2 get the forces that take them apart within one step, if both were free: m1 m2 / (m1 +
    m2) p / dt^2 for the penetration p = R1 + R2 - |x2 - x1|. Friction is mu times that, along the
    slip, and at most what stops the slip of two free points (de Vaucorbeil & Nguyen 2021,
    "Modelling contacts with a total Lagrangian material point method").

    A surface of balls is rough: sliding is braked by riding from ball to ball, too, with mu = 0 by
    one to two tenths of the pressing force in a block of two points a cell and direction.

    With many processes the first looks for pairs, among the points of all that may touch.
    Publishes the force on solid1 as ID_x, ID_y, ID_z; that on solid2 is the opposite. Pairs are
    found by cells: the cost grows with the number of points.

    See Also
    --------
    contact/hertz, contact/friction, method tlmpm
    """

    def __init__(
        self, hub: Hub, solid1: Solid, solid2: Solid, mu: Annotated[float, NonNegative] = 0.0
    ):
        super().__init__(hub, solid1, solid2)
        self.mu = float(mu)
        judge_friction(hub, self.mu)

    def law(self) -> NamedTuple:
        """Full undoing of penetration, and friction."""
        return MinimizePenetration(self.mu)
