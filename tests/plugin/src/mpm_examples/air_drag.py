"""fix air_drag: the drag of the air on points, by the whole velocity, inside the compiled loop."""

from math import sqrt
from typing import Annotated

from karamelo_py.kernels.equations.internal_force import Force, WorkOfForces
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.modify import Fix, vector_hook
from karamelo_py.script.expressions import Expression


def drag(mass, velocity, force, values, dt):
    """f = -m c |v| v, added to what other fixes push with; its sum is published."""
    (c,) = values
    own = -mass * c * sqrt(velocity.squared()) * velocity
    return force + own, own


class AirDrag(Fix):
    """Slow points down by a force that grows with the square of their speed.

    Parameters
    ----------
    c
        Force per mass and squared speed: a number or a formula.

    Example
    -------
    fix(wind, air_drag, all, 0.1)

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z.
    """

    published = ("x", "y", "z")
    point_fields = (Force, WorkOfForces)
    initial_integrate = vector_hook(
        drag, reads=("mass", "velocity", Force), writes=(Force,), publishes=True
    )

    def __init__(self, hub, group: ParticleGroup, c: Annotated[Expression, NonNegative]):
        super().__init__(hub, group)
        self.formulas = (Expression(c),)
