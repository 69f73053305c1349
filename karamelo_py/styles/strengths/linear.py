"""strength linear: elastic shear without limit."""

from __future__ import annotations

from typing import Annotated

from karamelo_py.language.signature import Positive
from karamelo_py.points.laws.strength.elastic import Elastic
from karamelo_py.scene.hub import Hub
from karamelo_py.styles.strengths.base import Strength


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
