"""strength linear: elastic shear without limit."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from karamelo_py.points.materials.strength.elastic import Elastic
from karamelo_py.signature import Positive
from karamelo_py.strengths.base import Strength

if TYPE_CHECKING:
    from karamelo_py.hub import Hub


class Linear(Strength):
    """Elastic shear without limit.

    Parameters
    ----------
    G
        Shear modulus.

    Example
    -------
    strength(elastic, linear, 80e9)

    Notes
    -----
    The deviatoric stress turns with the point (Jaumann rate) and grows by 2 G dev(d), d the strain
    increment.

    See Also
    --------
    plastic, eos, material eos-strength
    """

    def __init__(self, hub: Hub, G: Annotated[float, Positive]):
        self.law = Elastic(G)
