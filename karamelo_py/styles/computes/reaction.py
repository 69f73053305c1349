"""compute reaction."""

import numpy as np

from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.fixes.velocity_nodes import VelocityNodes


class Reaction(Compute):
    """Measure the force that holds nodes, published as ID_x, ID_y, ID_z.

    Parameters
    ----------
    group
        Group of nodes, or ``all``. Every fix velocity_nodes acts either on nodes of the group only,
        or on none of them.

    Example
    -------
    compute(R, reaction, all)
    log_modify(custom, time, R_x, R_y)

    Notes
    -----
    The sum of the reactions of the fixes velocity_nodes in the group: where two of them hold the
    same nodes, the sum is the force of both, whatever they share. Before the first step it is 0.

    See Also
    --------
    fix velocity_nodes, internal_force
    """

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: NodeGroup):
        super().__init__(hub, group)

    def refresh(self) -> None:
        values = self.hub.values
        total = np.zeros(3)
        for fix in self.hub.fixes.values():
            if isinstance(fix, VelocityNodes) and self._contains(fix):
                total += [values.get(f"{fix.id}_{axis}") for axis in "xyz"]
        self.publish_components(total)

    def _contains(self, fix) -> bool:
        """Return True if the nodes that a fix holds belong to the group."""
        if self.group.all:
            return True
        inside = np.isin(fix.group.members, self.group.members)
        if inside.any() and not inside.all():
            raise ScriptError(
                f"fix '{fix.id}' holds nodes of group '{self.group.id}' and others: "
                "its reaction is that of both",
                place=self.place,
                expected="a group that has all nodes of a fix or none",
                hint=f"two fixes, one for the nodes of {self.group.id}, in the place of '{fix.id}'",
            )
        return bool(inside.all()) and len(inside) > 0
