"""Methods ulmpm and tlmpm."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels.rigid import RigidBodies
from karamelo_py.language.rules import known_failure
from karamelo_py.points.frames import Total
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice, numbered
from karamelo_py.scene.modify import moved
from karamelo_py.scene.solid import Solid
from karamelo_py.styles.methods.base import Method, publish_loads, slots_of_loads


class ULMPM(Method):
    """Updated Lagrangian MPM: weights follow the present positions; one grid for all solids.

    Solids with common nodes stick to each other: contact without slip. Nodes near points of a rigid
    solid have the velocity of this solid.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)

    Notes
    -----
    Publishes, for each rigid solid ID, the force on it as ContactForce_ID_x, ContactForce_ID_y,
    ContactForce_ID_z, and the torque about the origin as ContactTorque_ID_x and so on. The torque
    about a position c is ContactTorque_ID - c x ContactForce_ID.
    """

    def welcome(self, hub: Hub, solid: Solid) -> None:
        if solid.rigid:
            publish_loads(hub, solid)

    def contact_between(self, hub: Hub, lattices: Sequence[Lattice]) -> NamedTuple:
        solids = list(hub.solids.values())
        rigid = [s.rigid and s not in moved(hub) for s in solids]
        if not any(rigid):
            return super().contact_between(hub, lattices)
        slots = np.full((2, len(solids)), -1)
        for k in np.flatnonzero(rigid):
            slots[:, k] = slots_of_loads(hub, solids[k])
        force, torque = np.repeat(slots, [solid.count for solid in solids], axis=1)
        return RigidBodies(force=force, torque=torque, slots=slots[slots >= 0])


known_failure(
    ULMPM,
    "bodies that part",
    when=lambda method, scene: scene.parting,
    reason="solids '{one}' and '{two}' start {cells:.2g} cells apart and separate at "
    "{speed:.3g}; on one grid, bodies within a cell of each other stick together and pull "
    "each other back",
    cure="method(ulmpm/contacts, ...), or a gap of two cells",
)


class TLMPM(Method):
    """Total Lagrangian MPM: weights follow reference positions; each solid has its own grid.

    No point crosses a cell face, and a body breaks only by damage of its material. Solids do not
    interact on the grid: define contact with fixes (contact/solids, contact/surface). Use it for
    bodies that retain their topology (de Vaucorbeil, Nguyen & Hutchinson 2020, "A
    Total-Lagrangian material point method for solid mechanics problems involving large
    deformations").

    Example
    -------
    method(tlmpm, FLIP, linear, 0.99)
    """

    frame = Total()
    own_grids = True
    remembers = ("warned",)
    warned = False

    def begin(self, hub: Hub, contact: NamedTuple) -> None:
        touching = {solid.id for fix in hub.fixes.values() for solid in fix.solids}
        touching |= {
            solid.id
            for fix in hub.fixes.values()
            for solid in hub.solids.values()
            if fix.touches and (fix.touches is solid or fix.group.touches(solid))
        }
        alone = [ID for ID in hub.solids if ID not in touching]
        if len(hub.solids) > 1 and alone and not self.warned:
            self.warned = True
            hint = (
                "fix(ID, contact/solids, solid1, solid2, mu) for those that may meet, or method "
                "ulmpm"
            )
            if hub.update.scheme.traits.implicit:
                hint = "method(ulmpm/contacts, ...) where they may meet"
            hub.warn(
                f"solids on separate grids pass through each other: {', '.join(alone)}", hint=hint
            )

    def lattices(self, hub: Hub) -> list[Lattice]:
        d = hub.domain.dimension
        return numbered([self._lattice(d, s.lo, s.hi, s.h) for s in hub.solids.values()])

    def lattice_of(self, hub: Hub, solid: Solid) -> int:
        return solid.index
