"""fix contact/hertz: points of two solids push each other as elastic spheres do."""

from typing import NamedTuple

from karamelo_py.kernels.laws import elastic_law
from karamelo_py.points.bodies import Hertz
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.fixes.pairs import PairContact


def plane_modulus(solid: Solid, argument: str) -> float:
    """E / (1 - nu^2) of a solid's material: 4 G (lambda + G) / (lambda + 2 G)."""
    law = elastic_law(solid.material.law)
    G, lam = getattr(law, "G", None), getattr(law, "lam", None)
    if G is None or lam is None or not G > 0:
        raise ScriptError(
            f"material '{solid.material.id}' of solid '{solid.id}' has no elastic moduli",
            argument=argument,
            expected="a solid of a material with Young's modulus and Poisson's ratio",
        )
    return 4 * G * (lam + G) / (lam + 2 * G)


class ContactHertz(PairContact):
    """Let two solids touch point by point, with the force of Hertz, without friction.

    Parameters
    ----------
    solid1, solid2
        IDs of the two solids; their materials have a Young's modulus and a Poisson's ratio.

    Example
    -------
    fix(touch, contact/hertz, ball, plate)

    Notes
    -----
    Points are balls with the radius R of half the side of a cube of their present volume (in the
    plane a square). Two that are closer than R1 + R2, by p, push each other with 4/3 E* sqrt(R
    p^3) in space and pi/4 E* sqrt(R p^3) otherwise, where R = R1 R2 / (R1 + R2) and 1/E* = (1 -
    nu1^2)/E1 + (1 - nu2^2)/E2. The force is that of single points: bodies get closer than the sum
    of the radii before it is large, and a fast one may pass through.

    Publishes the force on solid1 as ID_x, ID_y, ID_z; that on solid2 is the opposite.
    With many processes the first looks for pairs, among the points of all that may touch.

    See Also
    --------
    contact/minimize_penetration, method tlmpm
    """

    def __init__(self, hub: Hub, solid1: Solid, solid2: Solid):
        super().__init__(hub, solid1, solid2)
        if hub.domain.axisymmetric:
            raise ScriptError(
                "the force of Hertz is one of balls, and axisymmetric points are rings",
                expected="fix contact/minimize_penetration, or a scene in 3D",
            )
        moduli = (plane_modulus(solid1, "solid1"), plane_modulus(solid2, "solid2"))
        self.modulus = 1 / sum(1 / modulus for modulus in moduli)

    def law(self) -> NamedTuple:
        """The force of Hertz."""
        return Hertz(self.modulus)
