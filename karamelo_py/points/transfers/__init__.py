"""Transfers: mapping of velocity from points to nodes and back, one file per family.

A transfer is a NamedTuple of parameters. It declares what a point stores besides its velocity
(`point_fields`: nothing, or a tensor such as the affine moment B), and updates the velocity from
v_pic = sum_I N_I v*_I and dv = sum_I N_I (v*_I - v_I). Functions of a node get a view with N,
grad_N, arm = X_i - x, affine_N = N_i D^-1 (X_i - x) and `kin` (:mod:`karamelo_py.kernels.views`).
The default functions are for PIC.
"""

from typing import NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.compiler.fields import Field, StepField, planar
from karamelo_py.language.rules import Restrictions, known_failure
from karamelo_py.points import noise


class TransferTraits(NamedTuple):
    inverts_spread: bool = False  # uses the inverse of D = sum_I N_I (X_I - x)(X_I - x)^T
    retains: bool = False  # points retain the fraction `alpha` of their velocity
    per_time: bool = False  # alpha applies to a stable step
    keeps_gradient: bool = False  # `Moment` is the velocity gradient
    lossless: bool = False  # maps nodal velocities to points and back without loss
    series: bool = False  # the new velocity is a series, which needs further passes over the points
    # Fraction of the stable step with musl in the total frame.
    fraction_in_total: float = 1.0
    # Fractions of the stable step of isolated points in flowing material, with musl and with usl.
    lone_fractions: tuple[float, float] = (1.0, 1.0)
    # Points at walls retain more of their gradients if other points are near.
    by_neighbours: bool = False
    restrictions: Restrictions | None = None


class Moment(Field):
    """Moment B or velocity gradient L stored by a point."""

    shape = planar


class NodalMass(StepField):
    """Mass at the nodes in this step, for passes that already scatter the sums of the next."""


def flip_coefficient(transfer) -> float:
    """Return the fraction of its velocity that a point retains per step; 0 for PIC."""
    return transfer.alpha if transfer.traits.retains else 0.0


def stores_moment(transfer) -> bool:
    return zero_moment.defined(type(transfer))


@point_function()
def updated_velocity(transfer, v, v_pic, dv):
    pass


@point_function(otherwise=True)
def in_step(transfer, kept):
    """Return the transfer for a step in which points retain the fraction `kept`."""
    return transfer


@point_function()
def lost_fractions(transfer, template):
    """Return the fractions (2,) of energy dissipated in mapping to the nodes, and back.

    Stored moments return the rest. If the function is not defined, the loss is not recorded.
    """


@point_function(otherwise=True)
def displacing_velocity(transfer, v, v_pic, j):
    """Return the velocity that moves a point, given `v` after the step and the `known_volume` j."""
    return v_pic


@point_function(otherwise=True)
def known_volume(transfer, law, kin, state):
    """Return det F of a point if the transfer needs it, else ()."""
    return ()


@point_function(otherwise=True)
def nodal_momentum(transfer, pt, node):
    """Return the momentum that a point `pt` (`mass`, `v`, `moment`) gives to a node."""
    return node.N * pt.mass * pt.v


@point_function(otherwise=True)
def affine_velocity(transfer, moment, inverse_d):
    """Return C if a point gives a node at X the velocity v + C (X - x), else ().

    `inverse_d` is (D^-1,), or () if D varies.
    """
    return ()


@point_function(otherwise=True)
def zero_moment(transfer, kin, template):
    return ()


@point_function(otherwise=True)
def add_moment(transfer, node, v, moment):
    return moment


def narrowed_tensor(tensor, kept):
    pairs = zip(tensor, tensor.places, strict=True)
    return tensor._make([kept[j] * a for a, (_, j) in pairs])


@point_function(otherwise=True)
def narrowed(transfer, moment, kept):
    """Return the moment with the fractions `kept` (d,) of its gradients, for points at walls."""
    return narrowed_tensor(moment, kept)


@point_function(otherwise=True)
def fraction(transfer, moment, kept):
    return kept * moment


@point_function(otherwise=True)
def affine_part(transfer, moment):
    """Return the tensor of a moment; for an angular velocity, only the tensor is stored."""
    return moment


@point_function(otherwise=True)
def with_affine_part(transfer, kin, affine):
    return affine


@point_function(otherwise=True)
def by_arms(transfer, inverse_d):
    """Return (a,) if the stored tensor is a sum_I N_I v*_I (X_I - x)^T, else ()."""
    return ()


@point_function(otherwise=True)
def gradient_weight(transfer, node):
    return node.grad_N


@point_function(otherwise=True)
def forces_by_arms(transfer, kin):
    """Return True, known when compiled, if `gradient_weight` is N_I D^-1 (X_I - x)."""
    return False


@point_function(otherwise=True)
def straining(transfer, kin, gradient):
    """Return the gradient to gather with the velocity, or () if points store it."""
    return gradient


@point_function(otherwise=True)
def terms(transfer):
    return 1


def _inside_out(moment, scene):
    # The strain is computed from moments, as in MLS.
    by_moments = gradient_weight.defined(type(scene.transfer))
    growing = not scene.transfer.traits.inverts_spread or by_moments
    return scene.moments and scene.vanishing and growing


def _left_out(moment, scene):
    kept = scene.d == 3 or scene.transfer.traits.retains
    return scene.moments and scene.vanishing and kept and not _inside_out(moment, scene)


WITH = "{scene.transfer_name} with the basis {scene.basis_name}"
TURNS = 1.5  # revolutions after which the energy gain is relevant
SMOOTH = "quadratic-spline, or method tlmpm"
known_failure(
    Moment,
    "affine noise",
    when=_inside_out,
    reason=f"{WITH} gains energy where points cross cells, for any step and scheme, until the run "
    "stops (a drifting disk turns inside out after a few dozen steps)",
    cure=SMOOTH,
)
known_failure(
    Moment,
    "affine noise",
    when=_left_out,
    reason=f"{WITH} gains energy, because the velocity that deforms the points omits their "
    "moments (a disk in 3D: 17 % per revolution)",
    cure=SMOOTH,
)
known_failure(
    Moment,
    "affine noise",
    when=lambda moment, scene: (
        scene.moments
        and scene.vanishing
        and scene.free_turns > TURNS
        and not (_inside_out(moment, scene) or _left_out(moment, scene))
    ),
    reason=f"a body rotates freely, {{scene.free_turns:.2g}} times, and {WITH} gains energy in "
    "each revolution: a disk with 4 to 8 cells across the radius breaks within 5 to 7",
    cure=SMOOTH,
)
noise.warn_of_rotation(Moment)
