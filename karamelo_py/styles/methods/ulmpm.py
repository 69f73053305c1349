"""method ulmpm: updated Lagrangian, one grid for the whole domain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.rigid import RigidBodies
from karamelo_py.points.laws import can, constrained_velocity
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.solid import Solid
from karamelo_py.styles.methods.base import DIRECTIONS, Method, force_on, torque_on


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
        """Publish the force on a rigid solid."""
        if can(solid.material.law, constrained_velocity):
            hub.values.publish_vector(force_on(solid), DIRECTIONS)
            hub.values.publish_vector(torque_on(solid), DIRECTIONS)

    def contact_between(self, hub: Hub, lattices: Sequence[Lattice]) -> NamedTuple:
        """Rigid solids lead what they meet."""
        solids = list(hub.solids.values())
        rigid = [can(solid.material.law, constrained_velocity) for solid in solids]
        if not any(rigid):
            return super().contact_between(hub, lattices)

        def slots(stem) -> list[int]:
            return [
                hub.values.slot(stem(solid) + "_x") if leads else -1
                for solid, leads in zip(solids, rigid, strict=True)
            ]

        counts = [solid.count for solid in solids]
        force, torque = slots(force_on), slots(torque_on)
        return RigidBodies(
            force=np.repeat(np.array(force, np.int64), counts),
            torque=np.repeat(np.array(torque, np.int64), counts),
            slots=np.array([slot for slot in force + torque if slot >= 0], np.int64),
        )
