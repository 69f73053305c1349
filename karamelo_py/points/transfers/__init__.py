"""Transfers: how velocity travels from points to nodes and back. One file each.

A transfer is a NamedTuple (its class is the tag). It says what a point keeps beside its velocity
(`affine`: the moment of velocity B, a tensor) and how the velocity follows from the nodes:

v_pic
    sum_I N_I v*_I, the updated nodal velocity at the point
dv
    sum_I N_I (v*_I - v_I), its change during the step
"""

from karamelo_py.compile import point_function


@point_function()
def updated_velocity(transfer, v, v_pic, dv):
    """The point's velocity after the step."""


@point_function()
def add_momentum(transfer, kin, basis, stencil, k, weighted_mass, mass, v, moment, total):
    """total + the momentum that a point gives to the k-th node of its stencil.

    `weighted_mass` is N_I m_p, the mass that it gives.
    """


@point_function()
def zero_moment(transfer, kin, like):
    """The moment of velocity at rest, as a tuple: empty for transfers that keep none."""


@point_function()
def add_moment(transfer, kin, basis, stencil, k, weight, velocity, moment):
    """moment + N_I v*_I (X_I - x)^T: the part of the k-th node in the moment of velocity."""
