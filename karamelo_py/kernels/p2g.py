"""Points to grid: what a visit of the points scatters to the nodes."""

from typing import Any, NamedTuple

from karamelo_py.compiler.compile import accumulate, of_present, point_function, real, shared
from karamelo_py.compiler.fields import StepField, SummedField, field, load, load_vector, vector
from karamelo_py.compiler.tuples import add_optional, leading, scale, subtract
from karamelo_py.kernels.arrays import MASS, SUMS_WIDTH, VELOCITY_WIDTH, of_force
from karamelo_py.kernels.averaging import AveragedStress, FBar, NodalMean, NodalStress, VolumeRatio
from karamelo_py.kernels.g2p import zero_vector
from karamelo_py.kernels.loss import EnergyLoss, bring_energy
from karamelo_py.kernels.visit import deformation_of, for_tags, law_of, records_of, state_of
from karamelo_py.points.basis import entry, mapped_again
from karamelo_py.points.frames import Total, add_force, force_stress
from karamelo_py.points.kinematics import add_pressure, dimension, stretching_mean, zero_symmetric
from karamelo_py.points.laws import (
    constrained_velocity,
    jacobian,
    kirchhoff_stress,
    specific_volume,
)
from karamelo_py.points.transfers import Moment, add_momentum, gradient_weight, zero_moment
from karamelo_py.points.transfers.xpic import Series, TermOfSeries


class MassMomentum(NamedTuple):
    """Scatter mass and momentum."""

    in_lanes = True
    says = "p2g mass and momentum"
    reads = ("x moved", "mass", "v", "moment")

    @staticmethod
    def fills(kin):
        """See `kernels.sums`."""
        d = dimension(kin)
        own = (
            (Normal, 0, d),
            (SquaredMass, 0, 1),
            (Centre, 0, d),
            (RigidSums, 0, of_force(kin)),
            (EnergyLoss, 0, 1),
        )
        return ("sums", 0, of_force(kin)), *own


class InternalForce(NamedTuple):
    """Scatter the internal force, and that of fixes on points."""

    in_lanes = True
    says = "internal force"
    reads = ("mass", "state", "material", "deformation gradient", "force")

    @staticmethod
    def fills(kin):
        """See `kernels.sums`."""
        return ("sums", of_force(kin), SUMS_WIDTH[dimension(kin)]), (NodalStress, 0, 2)


class MomentumAgain(NamedTuple):
    """Scatter momentum to the velocity array."""

    in_lanes = True
    says = "momentum to grid"
    reads = ("mass", "v", "moment")

    @staticmethod
    def fills(kin):
        """See `kernels.sums`."""
        return (("velocity", 0, VELOCITY_WIDTH[dimension(kin)]),)


class Volumes(NamedTuple):
    """Scatter volume, after and before the trial increment (F-bar)."""

    in_lanes = True
    says = "volumes to grid"
    reads = ("mass", "state", "material", "volume ratio")

    @staticmethod
    def fills(kin):
        """See `kernels.sums`."""
        return ((NodalMean, 0, 2),)


class AveragedForce(NamedTuple):
    """Scatter the internal force of the averaged mean stress less that of a point's own (F-bar)."""

    in_lanes = True
    says = "internal force of the averaged mean stress"
    reads = ("mass", "state", "material", "deformation gradient", "averaged stress")
    adds = True  # to a force that is there

    @staticmethod
    def fills(kin):
        """See `kernels.sums`."""
        return (("sums", of_force(kin), SUMS_WIDTH[dimension(kin)]),)


class SeriesBack(NamedTuple):
    """Scatter the term of the series of XPIC, times mass."""

    in_lanes = True
    says = "term of the series to the grid"
    reads = ("mass", "term of series")

    @staticmethod
    def fills(kin):
        """See `kernels.sums`."""
        return ((Series, dimension(kin), 2 * dimension(kin)),)


class Force(StepField):
    """Force that fixes put on a point."""

    shape = vector
    columns = ("bx", "by", "bz")


class Normal(SummedField):
    """Sum of m grad N at a node: it points out of a body, for contact between solids."""

    shape = vector


class SquaredMass(SummedField):
    """Sum of N m^2 at a node: over that of N m it is the mean mass of the points it sees (USL)."""

    @staticmethod
    def needed(basis: Any) -> bool:
        """Whether a basis makes light nodes that the gradient feels."""
        return basis.steep_edge


class Centre(SummedField):
    """Sum of mass times position at a node, for the gap between solids."""

    shape = vector


class RigidSums(SummedField):
    """What rigid points give a node: mass, momentum and the force on them, as in `Nodes.sums`."""

    @staticmethod
    def shape(kin):
        """The components of the sums of a node."""
        return SUMS_WIDTH[kin.dimension]


@point_function()
def load_of(quantity, w, p, like):
    """What a point brings to the nodes."""


@records_of.on(MassMomentum)
def _records_of_mass_momentum(quantity, nodes):
    return nodes.sums


@records_of.on(MomentumAgain)
def _records_of_momentum_again(quantity, nodes):
    return nodes.velocity


@point_function()
def scattered(quantity, w, stencil, k, load):
    """Give the k-th node of the stencil its part."""


@shared
def _moment(w, p, like):
    return load(field(w.points.fields, Moment), p, zero_moment(w.transfer, w.kin, like))


@shared
def _own_mass(w, p):
    return of_present(p, w.points.mass[p])


@shared
def shared_mass(led, law, mass):
    """The mass that a point gives to the sums of all solids: of rigid points none, if `led`."""
    rigid = led is not None and constrained_velocity.defined(type(law))
    return mass - mass if rigid else mass


@shared
def loaded_for(nodal, kin, array, p):
    """The vector of a point, where there is a nodal array for it; else ()."""
    return () if nodal is None else load_vector(kin, array, p)


@shared
def led_mass(led, law, mass):
    """(mass,) of rigid points, which have sums of their own if `led`; () of others."""
    return (mass,) if led is not None and constrained_velocity.defined(type(law)) else ()


@shared
def _mass(w, p):
    return shared_mass(field(w.nodes.fields, RigidSums), law_of(w, p), _own_mass(w, p))


@load_of.on(MassMomentum)
def _load_of_mass_momentum(quantity, w, p, like):
    v = load_vector(w.kin, w.points.v, p)
    led = led_mass(field(w.nodes.fields, RigidSums), law_of(w, p), _own_mass(w, p))
    x = loaded_for(field(w.nodes.fields, Centre), w.kin, w.places.y, p)
    return _mass(w, p), v, _moment(w, p, like), led, x


@shared
def momentum_part(w, stencil, k, weight, mass, v, moment):
    """The momentum that a point gives to the k-th node."""
    none = subtract(v, v)
    return add_momentum(
        w.transfer, w.kin, w.basis, w.grid, stencil, k, weight, mass, v, moment, none
    )


@scattered.on(MassMomentum)
def _scattered_mass_momentum(quantity, w, stencil, k, load):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, v, moment, led, x = load
    part = momentum_part(w, stencil, k, weight, mass, v, moment)
    accumulate(w.nodes.sums, i, MASS, (weight * mass,) + part)
    bring_energy(field(w.nodes.fields, EnergyLoss), i, weight * mass, part)
    accumulate_led(field(w.nodes.fields, RigidSums), i, weight, led, v)
    accumulate_optional(field(w.nodes.fields, Centre), i, scale(weight * mass, x))
    accumulate_optional(field(w.nodes.fields, Normal), i, scale(mass, leading(gradient, v)))
    accumulate_optional(field(w.nodes.fields, SquaredMass), i, (weight * mass * mass,))


@point_function(otherwise=True)
def mean_stress(averaging, kin, law, state, volume):
    """Volume times mean stress, and volume, of a point of reference `volume`; () without F-bar."""
    return ()


@mean_stress.on(FBar)
def _mean_stress_f_bar(averaging, kin, law, state, volume):
    tau = stretching_mean(kin, kirchhoff_stress(law, kin, state))
    return volume * tau, volume * jacobian(law, kin, state)


@load_of.on(AveragedForce)
def _load_of_averaged_force(quantity, w, p, like):
    law = law_of(w, p)
    state = state_of(w, law, p, like)
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    volume = _mass(w, p) * specific_volume(law)
    own, present = mean_stress(w.averaging, w.kin, law, state, volume)
    change = present * field(w.points.fields, AveragedStress)[0, p] - own
    none = zero_symmetric(w.kin, change)
    return force_stress(w.frame, w.kin, add_pressure(w.kin, change, none, -change), f)


@scattered.on(AveragedForce)
def _scattered_averaged_force(quantity, w, stencil, k, load):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
    part = add_force(w.frame, w.kin, zero_vector(w.kin, weight), load, g)
    accumulate(w.nodes.sums, i, of_force(w.kin), part)


@load_of.on(InternalForce)
def _load_of_internal_force(quantity, w, p, like):
    law = law_of(w, p)
    state = state_of(w, law, p, like)
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    volume = _mass(w, p) * specific_volume(law)
    # Minus volume times stress, with the sign of the internal force.
    stress = scale(-volume, force_stress(w.frame, w.kin, kirchhoff_stress(law, w.kin, state), f))
    force = load(field(w.points.fields, Force), p, load_vector(w.kin, w.points.v, p))
    mean = mean_stress(w.averaging, w.kin, law, state, volume)
    return stress, scale(of_present(p, real(1, volume)), force), mean


@scattered.on(InternalForce)
def _scattered_internal_force(quantity, w, stencil, k, load):
    i, weight, gradient = entry(w.basis, w.kin, w.grid, stencil, k)
    g = gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, gradient)
    stress, outer, mean = load
    none = zero_vector(w.kin, weight)
    part = add_force(w.frame, w.kin, add_optional(none, weight, outer), stress, g)
    accumulate(w.nodes.sums, i, of_force(w.kin), part)
    accumulate_optional(field(w.nodes.fields, NodalStress), i, scale(weight, mean))


@point_function(otherwise=True)
def mapped_again_in(frame, basis, grid, moment):
    """The part of the moment of velocity that MUSL maps again: all where weights never change."""
    return mapped_again(basis, grid, moment)


@mapped_again_in.on(Total)
def _mapped_again_in_total(frame, basis, grid, moment):
    return moment


@load_of.on(MomentumAgain)
def _load_of_momentum_again(quantity, w, p, like):
    moment = mapped_again_in(w.frame, w.basis, w.grid, _moment(w, p, like))
    return _mass(w, p), load_vector(w.kin, w.points.v, p), moment


@scattered.on(MomentumAgain)
def _scattered_momentum_again(quantity, w, stencil, k, load):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, v, moment = load
    accumulate(w.nodes.velocity, i, 0, momentum_part(w, stencil, k, weight, mass, v, moment))


@load_of.on(Volumes)
def _load_of_volumes(quantity, w, p, like):
    law = law_of(w, p)
    state = state_of(w, law, p, like)
    volume = _mass(w, p) * specific_volume(law) * jacobian(law, w.kin, state)
    return volume * field(w.points.fields, VolumeRatio)[0, p], volume


@scattered.on(Volumes)
def _scattered_volumes(quantity, w, stencil, k, load):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    part = (weight * load[0], weight * load[1])
    accumulate(field(w.nodes.fields, NodalMean), i, 0, part)


@load_of.on(SeriesBack)
def _load_of_series_back(quantity, w, p, like):
    u = load(field(w.points.fields, TermOfSeries), p, load_vector(w.kin, w.points.v, p))
    return _mass(w, p), u


@scattered.on(SeriesBack)
def _scattered_series_back(quantity, w, stencil, k, load):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    mass, u = load
    accumulate(field(w.nodes.fields, Series), i, len(u), scale(weight * mass, u))


@shared
def accumulate_led(array, i, weight, led, v):
    """Give a node the mass and momentum of a rigid point."""
    if len(led):
        part = weight * led[0]
        accumulate(array, i, MASS, (part, *scale(part, v)))


@shared
def accumulate_optional(array, i, values):
    """Add to a node, where there is an array for it."""
    if array is not None:
        accumulate(array, i, 0, values)


load_all = for_tags(load_of, "w, p, like")
scattered_all = for_tags(scattered, "w, stencil, k, loads", each="loads")
