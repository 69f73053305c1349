"""Fix mass_damping."""

from typing import Annotated

from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import LAST, Fix, node_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.absorbing import dashpot


def damp(node):
    added = dashpot(node.value, node.mass, node.v, node.force, node.kick)
    return node.v, node.v_star, node.force + added, added


class MassDamping(Fix):
    """Damp the velocity v of nodes by forces -rate m v, as in a layer that absorbs waves.

    Parameters
    ----------
    rate
        Damping rate in 1/time, a function of x0, y0, z0 and time. A wave decays by exp(-rate t/2).

    Example
    -------
    fix(sponge, mass_damping, all, 500*(max(x0 - 80, 0)/20)^2)

    Notes
    -----
    To absorb waves, put a layer with a thickness L of one wavelength in front of fix absorbing. Let
    the rate grow with the square of the depth in the layer, to 6 c/L at the edge (c: P wave speed).
    Less than 0.2 % of the energy of P and S waves at up to 45 degrees is then reflected. The
    damping is mass-proportional Rayleigh damping, so rigid motion is damped, too. In saturated
    ground it acts on the soil; the water is damped by drag.

    Publishes the sum of the damping forces as ID_x, ID_y, ID_z.

    See Also
    --------
    absorbing, local_damping
    """

    published = ("x", "y", "z")
    order = LAST

    post_particles_to_grid = node_hook(damp)

    def __init__(self, hub: Hub, group: NodeGroup, rate: Annotated[Expression, NonNegative]):
        super().__init__(hub, group)
        self.formulas = (Expression(rate),) * hub.domain.dimension
