"""strength linear: elastic shear without limit."""

from typing import Annotated, NamedTuple

from karamelo_py.language.signature import Positive
from karamelo_py.points.kinematics.tensors import dev
from karamelo_py.points.laws.strengths import shear_response


class Elastic(NamedTuple):
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

    in_lanes = True
    rebounds = True

    G: Annotated[float, Positive]


def elastic_trial(G, s, strain):
    """Deviatoric stress after a strain increment, were it all elastic."""
    # The deviator of the sum: rounding errors of many steps would give s a trace otherwise.
    return dev(s + 2 * G * strain)


@shear_response.on(Elastic)
def _shear_response_elastic(strength, kin, s, strain, memory, heat, dt):
    return elastic_trial(strength.G, s, strain), memory, 0
