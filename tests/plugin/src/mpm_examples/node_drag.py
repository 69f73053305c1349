"""fix node_drag: the drag of fix air_drag on nodes, which keep what it has taken."""

from math import sqrt
from typing import Annotated

from karamelo_py.compiler.fields import Field
from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.modify import Fix, vector_hook
from karamelo_py.script.expressions import Expression


class Taken(Field):
    """Momentum per mass that drag has taken at a node, without its direction."""

    columns = ("taken",)


def drag(mass, velocity, force, taken, values, dt):
    """f = -m c |v| v; its sum is published."""
    (c,) = values
    speed = sqrt(velocity.squared())
    own = -mass * c * speed * velocity
    return force + own, taken + dt * c * speed * speed, own


class NodeDrag(Fix):
    """Slow nodes down by a force that grows with the square of their speed.

    Parameters
    ----------
    c
        Force per mass and squared speed: a number or a formula.

    Example
    -------
    fix(wind, node_drag, all, 0.1)

    Notes
    -----
    Publishes the total force as ID_x, ID_y, ID_z; the column taken of dumps of nodes adds up c v^2.
    """

    published = ("x", "y", "z")
    node_fields = (Taken,)
    post_particles_to_grid = vector_hook(
        drag,
        reads=("mass", "velocity", "force", Taken),
        writes=("force", Taken),
        publishes=True,
        nodes=True,
    )

    def __init__(self, hub, group: NodeGroup, c: Annotated[Expression, NonNegative]):
        super().__init__(hub, group)
        self.formulas = (Expression(c),)
