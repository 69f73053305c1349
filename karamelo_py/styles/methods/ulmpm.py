"""method ulmpm: updated Lagrangian, one grid for the whole domain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.rigid import RigidBodies
from karamelo_py.points.laws import can, constrained_velocity
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.solid import Solid
from karamelo_py.styles.methods.base import Method, publish_loads, slots_of_loads


class ULMPM(Method):
    """Updated Lagrangian MPM: weights follow the present positions, all solids share one grid.

    Solids that meet on the grid move together there: contact without slip and without further
    definition. Nodes that see points of a rigid solid take its velocity.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)

    Notes
    -----
    Publishes the force on every rigid solid as ContactForce_ID_x, ContactForce_ID_y,
    ContactForce_ID_z, with the solid's ID, and its torque about the origin as ContactTorque_ID_x
    and so on: about a place c it is ContactTorque_ID - c x ContactForce_ID.
    """

    def welcome(self, hub: Hub, solid: Solid) -> None:
        if can(solid.material.law, constrained_velocity):
            publish_loads(hub, solid)

    def contact_between(self, hub: Hub, lattices: Sequence[Lattice]) -> NamedTuple:
        solids = list(hub.solids.values())
        rigid = [can(solid.material.law, constrained_velocity) for solid in solids]
        if not any(rigid):
            return super().contact_between(hub, lattices)
        slots = np.full((2, len(solids)), -1)
        for k in np.flatnonzero(rigid):
            slots[:, k] = slots_of_loads(hub, solids[k])
        force, torque = np.repeat(slots, [solid.count for solid in solids], axis=1)
        return RigidBodies(force=force, torque=torque, slots=slots[slots >= 0])
