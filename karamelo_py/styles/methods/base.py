"""Base of methods: grids, data of the points, parts of a step."""

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from karamelo_py.kernels.visit import FBar, PointByPoint
from karamelo_py.language import registry
from karamelo_py.points.frames import Updated
from karamelo_py.points.kinematics import KINEMATICS, Axisymmetric
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice, numbered
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import Place, ScriptError
from karamelo_py.styles.methods.domains import initial_shape

DIRECTIONS = ("x", "y", "z")


def force_on(solid: Solid) -> str:
    """Stem of the names under which the force on a solid is published."""
    return f"ContactForce_{solid.id}"


def torque_on(solid: Solid) -> str:
    """The same of the torque."""
    return f"ContactTorque_{solid.id}"


class NoContact(NamedTuple):
    """Solids act on each other by sharing nodes, or not at all."""


class Method:
    """Base of the method styles.

    Attributes
    ----------
    basis
        The basis' tag.
    basis_name
        The basis, with its variant, as the script calls it.
    thermal
        Whether heat flows.
    place
        Place of the command in the script, for messages.
    frame
        Whether weights belong to present or reference positions.
    own_grids
        Whether every solid has a grid of its own, laid over its own box with its own cell size.
    fields_per_solid
        Whether every solid has a velocity field of its own on the grid of the domain.
    """

    basis: NamedTuple
    basis_name = ""
    thermal = False
    place: Place | None = None
    frame: NamedTuple = Updated()
    own_grids: ClassVar[bool] = False
    fields_per_solid: ClassVar[bool] = False

    def __init__(self, hub: Hub, heat: Literal["mechanical", "thermo-mechanical"] = "mechanical"):
        """Take the option that scripts may add.

        Parameters
        ----------
        heat
            Whether heat flows between points, too.
        """
        self.thermal = heat == "thermo-mechanical"

    @property
    def regular_points(self) -> bool:
        """True if points of a cell stand at equal distances, so that their domains tile it."""
        return bool(getattr(self.basis, "shape", ()))

    def contact_between(self, hub: Hub, lattices: Sequence[Lattice]) -> NamedTuple:
        """Return the tag of contact between solids with velocity fields of their own."""
        return NoContact()

    def begin(self, hub: Hub, contact: NamedTuple) -> None:
        """Before every run: bring what `contact_between` made up to date with the fixes."""

    def remembered(self, contact: NamedTuple, spans: np.ndarray) -> list[np.ndarray]:
        """Views of what of `contact` the next step reads, in the ranges `spans` (k, 2) of nodes."""
        return []

    def resume(self, contact: NamedTuple, before: NamedTuple) -> None:
        """Take over what a step left in the contact `before` the scene was lowered anew."""

    def welcome(self, hub: Hub, solid: Solid) -> None:
        """A solid has been defined."""

    def lattices(self, hub: Hub) -> list[Lattice]:
        """The grids of the scene, in the order of their nodes."""
        domain = hub.domain
        return [self._lattice(domain.dimension, domain.lo, domain.hi, domain.h)]

    def lattice_of(self, hub: Hub, solid: Solid) -> int:
        """Return the number of the grid that the points of a solid see."""
        return 0

    def held_with(self, hub: Hub, nodes: np.ndarray) -> np.ndarray:
        """The nodes to hold where a fix gives all components of the velocity of `nodes`."""
        return nodes

    def kinematics(self, hub: Hub) -> Any:
        """The kinematics of the scene."""
        return Axisymmetric() if hub.domain.axisymmetric else KINEMATICS[hub.domain.dimension]()

    def averaging(self, hub: Hub) -> NamedTuple:
        """Return the tag of averaging: `FBar` where changes of volume are averaged."""
        return FBar() if hub.update.anti_locking else PointByPoint()

    def places(self, kin: Any, solid: Solid, real: type) -> np.ndarray:
        """Positions and shapes of the domains of a solid's points before the first step, (n, w)."""
        return np.concatenate([solid.x0, self.shapes(kin, solid)], axis=1).astype(real)

    def shapes(self, kin: Any, solid: Solid) -> np.ndarray:
        """Return the shapes of the domains of a solid's points, (n, s), as the basis keeps them."""
        return initial_shape(type(self.basis), solid)

    def _lattice(
        self, dimension: int, lo: Sequence[float], hi: Sequence[float], h: float
    ) -> Lattice:
        basis = type(self.basis)
        return Lattice(dimension, lo, hi, h, basis.nodes_per_cell, basis.least_nodes)

    def check(self, hub: Hub) -> None:
        """Refuse what does not go together; called before every run."""
        transfer, basis, scheme = hub.update.transfer, self.basis, hub.update.scheme
        unsteady = transfer.inverts_spread and not basis.steady_moment and self.frame.moves
        if unsteady and not getattr(scheme, "maps_velocity_again", False):
            raise ScriptError(
                f"{registry.name_of('transfer', type(transfer))} with {self.basis_name} functions "
                f"and {registry.name_of('scheme', type(scheme))} is unstable: D of the affine "
                "transfers vanishes at nodes, and there the moments push where there is next to no "
                "mass",
                hint="scheme(musl), or quadratic-spline in the place of the basis, or method tlmpm",
            )


class OwnGrids(Method):
    """A grid of its own for every solid."""

    own_grids = True
    remembers = ("warned",)
    warned = False

    def begin(self, hub: Hub, contact: NamedTuple) -> None:
        """Tell once of solids that pass through all others."""
        touching = {solid.id for fix in hub.fixes.values() for solid in fix.solids}
        alone = [ID for ID in hub.solids if ID not in touching]
        if len(hub.solids) > 1 and alone and not self.warned:
            self.warned = True
            hub.warn(
                f"solids with grids of their own pass through each other: {', '.join(alone)}",
                hint="fix(ID, contact/minimize_penetration, solid1, solid2, mu) for those that may "
                "meet, or method ulmpm",
            )

    def lattices(self, hub: Hub) -> list[Lattice]:
        """A grid over the box of each solid."""
        d = hub.domain.dimension
        return numbered([self._lattice(d, s.lo, s.hi, s.h) for s in hub.solids.values()])

    def lattice_of(self, hub: Hub, solid: Solid) -> int:
        """The grid of a solid has its number."""
        return solid.index
