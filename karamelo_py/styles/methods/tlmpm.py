"""method tlmpm: total Lagrangian, a grid for each solid."""

from typing import NamedTuple

from karamelo_py.points.frames import Total
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice, numbered
from karamelo_py.scene.solid import Solid
from karamelo_py.styles.methods.base import Method


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
        d = hub.domain.dimension
        return numbered([self._lattice(d, s.lo, s.hi, s.h) for s in hub.solids.values()])

    def lattice_of(self, hub: Hub, solid: Solid) -> int:
        return solid.index


class TLMPM(OwnGrids):
    """Total Lagrangian MPM: weights belong to reference positions, each solid has its own grid.

    Weights never change: no point crosses a cell face, and a body breaks only where its law says
    so. Solids do not see each other on the grid: contact is a matter of fixes (contact/hertz,
    contact/minimize_penetration). For bodies that keep their topology (de Vaucorbeil, Nguyen &
    Hutchinson 2020, "A Total-Lagrangian material point method for solid mechanics problems
    involving large deformations").

    Example
    -------
    method(tlmpm, FLIP, linear, 0.99)
    """

    frame = Total()
