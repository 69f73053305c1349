"""fix local_damping: forces against the motion, as large as what is out of balance."""

from typing import Annotated

from karamelo_py.language.signature import In
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, node_hook
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.methods.ulmpm_contacts import ULMPMContacts


def brake(mass, v, v_star, force, value, before, dt, share):
    """v* loses a share of what the force changed it by, against v; the total is the force of that.

    Where the step turns the node around, or a wall has stopped it, there is nothing to brake.
    """
    against = 0.0
    if v * v_star > 0:
        change = min(abs(v_star - v), abs(force) * dt / mass)
        against = min(value * change, abs(v_star))
        if v > 0:
            against = -against
    return v, v_star + against, force, mass * against / dt


class LocalDamping(Fix):
    """Bring a scene to rest: each node is braked by a share of the force that is out of balance.

    Parameters
    ----------
    alpha
        The share, from 0 to 1; 0.8 is usual. A number or a formula of time: damping may end.

    Example
    -------
    fix(weight, body_force, all, 0, -9.81)
    fix(calm, local_damping, all, 0.8)

    Notes
    -----
    f - alpha |f| sign(v), component by component, in the place of the force f of a node (Cundall
    1987). Where forces balance there is no damping: the state of rest is that without it, whatever
    the stiffness, and steady motion is not braked. A scene takes some ten periods of its slowest
    vibration to come to rest with 0.8.

    It acts after all other fixes, wherever it stands: nodes that are held, or move as told at a
    constant speed, are not braked, and their reactions are those of the scene. Publishes the sum of
    what it adds as ID_x, ID_y, ID_z.

    In method ulmpm/contacts it acts before solids push each other, so that bodies in contact stick
    like by friction, anywhere between 1 - alpha and 1 + alpha of the load: there alpha has to go
    to 0, as 0.8*max(1 - time/T, 0) does.

    See Also
    --------
    body_force, edge_traction, run_while
    """

    published = ("x", "y", "z")
    acts_last = True

    post_update_grid_state = node_hook(brake)

    def __init__(self, hub: Hub, group: NodeGroup, alpha: Annotated[Expression, In(0, 1)] = 0.8):
        super().__init__(hub, group)
        self.formulas = (Expression(alpha),) * hub.domain.dimension

    def defined(self) -> None:
        """Warn where rest would not be that without damping."""
        alpha = self.formulas[0]
        lasts = alpha.is_constant and alpha.constant > 0
        if lasts and isinstance(self.hub.update.method, ULMPMContacts):
            self.hub.warn(
                "bodies that touch come to rest anywhere near their balance while damping acts",
                hint="an alpha that goes to 0: 0.8*max(1 - time/T, 0)",
            )
