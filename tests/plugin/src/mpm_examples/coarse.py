"""method coarse: a grid of its own making."""

from typing import Annotated, Literal

from karamelo_py.language.signature import AtLeast
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice
from karamelo_py.styles.methods.ulmpm import ULMPM


class Coarse(ULMPM):
    """ulmpm on a grid whose cells are larger than those of the domain.

    Parameters
    ----------
    factor
        How many times.
    heat
        Whether heat flows.

    Example
    -------
    method(coarse, FLIP, linear, 1, 2)
    """

    def __init__(
        self,
        hub: Hub,
        factor: Annotated[float, AtLeast(1)],
        heat: Literal["mechanical", "thermo-mechanical"] = "mechanical",
    ):
        super().__init__(hub, heat)
        self.factor = factor

    def lattices(self, hub: Hub) -> list[Lattice]:
        """The grid."""
        domain = hub.domain
        return [self._lattice(domain.dimension, domain.lo, domain.hi, self.factor * domain.h)]
