"""Logarithmic elastic strains, for steps of any size and rotation."""

from typing import NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.points.kinematics.principal import exponential_of, logarithm_of


class Logarithmic(NamedTuple):
    """Tag of the elastic strain ln V, with the left elastic stretch V."""

    in_lanes = True
    scalarised = ("elastic_trial",)


@point_function()
def elastic_trial(strain, e, dl):
    """Return the elastic strain `e` after an elastic increment of any size.

    V becomes the left stretch of (I + dl) V: 1/2 ln[(I + dl) exp(2 e) (I + dl)^T] (Simo 1992,
    "Algorithms for static and dynamic multiplicative plasticity that preserve the classical return
    mapping schemes of the infinitesimal theory", Comput. Methods Appl. Mech. Eng. 99).
    """


@elastic_trial.on(Logarithmic)
def _elastic_trial_logarithmic(strain, e, dl):
    return 0.5 * logarithm_of(exponential_of(2 * e).carried(dl))
