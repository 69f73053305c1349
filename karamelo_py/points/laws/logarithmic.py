"""Logarithmic elastic strains, of laws that follow steps of any size and turn."""

from typing import NamedTuple

from karamelo_py.compiler.compile import point_function
from karamelo_py.points.kinematics.principal import exponential_of, logarithm_of


class Logarithmic(NamedTuple):
    """Tag: elastic strain is ln V, of the elastic part V of the left stretch."""

    in_lanes = True
    scalarised = ("elastic_trial",)


@point_function()
def elastic_trial(strain, e, dl):
    """Elastic strain `e` after an increment, were it all elastic.

    V becomes that of (I + dl) V: 1/2 ln[(I + dl) exp(2 e) (I + dl)^T] (Simo 1992, "Algorithms for
    static and dynamic multiplicative plasticity that preserve the classical return mapping schemes
    of the infinitesimal theory", Comput. Methods Appl. Mech. Eng. 99). Steps of any size are exact,
    and what turns takes its strain along.
    """


@elastic_trial.on(Logarithmic)
def _elastic_trial_logarithmic(strain, e, dl):
    return 0.5 * logarithm_of(exponential_of(2 * e).carried(dl))
