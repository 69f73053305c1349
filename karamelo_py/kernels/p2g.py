"""Points to grid: scatter to the nodes in a visit of the points, and the sums there.

A quantity lists in ``fills(kin)`` its columns of the nodes' arrays: (array, first column, end), the
array a name in `Nodes` or the class of a field, which a scene may not have. With ``adds = True`` it
adds to the present values.
"""

from collections.abc import Iterator
from math import nan
from typing import Any, NamedTuple

from karamelo_py.compiler.compile import accumulate, index, of_present, point_function, real
from karamelo_py.compiler.fields import (
    Field,
    StepField,
    SummedField,
    field,
    load,
    load_vector,
    vector,
)
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.lanes.records import move_record
from karamelo_py.compiler.threads import by_threads
from karamelo_py.compiler.tuples import put_at
from karamelo_py.kernels import arrays, visit
from karamelo_py.kernels.arrays import MASS, Buffers, Index, Nodes, Number, Tag, of_force
from karamelo_py.kernels.loss import EnergyLoss, bring_energy
from karamelo_py.kernels.visit import Work, for_tags, node_of, straining_node
from karamelo_py.points import laws
from karamelo_py.points.basis import mapped_again
from karamelo_py.points.frames import force_stress
from karamelo_py.points.kinematics import I, nothing
from karamelo_py.points.transfers import Moment, nodal_momentum, zero_moment
from karamelo_py.points.transfers.xpic import Series, TermOfSeries


class Scattered(NamedTuple):
    """Base of quantities that also work in lanes and at domain corners."""

    in_lanes = True
    not_at_corners = ()


def _forces(kin):
    """Name the columns of forces."""
    return "sums", of_force(kin), arrays.SUMS_WIDTH[kin.dimension]


class MassMomentum(Scattered):
    """Scatter mass and momentum."""

    not_at_corners = ("moments", "loss")
    says = "p2g mass and momentum"
    reads = ("x moved", "mass", "v", "moment")

    @staticmethod
    def fills(kin):
        """Return the columns of the nodes that it adds to, see `columns_of`."""
        vectors = [(kind, 0, kin.dimension) for kind in (Normal, Centre)]
        numbers = [(kind, 0, 1) for kind in (SquaredMass, EnergyLoss)]
        whole = [(kind, 0, of_force(kin)) for kind in ("sums", RigidSums)]
        return *whole, *vectors, *numbers


class InternalForce(Scattered):
    """Scatter the internal force, and the forces of fixes on points."""

    not_at_corners = ("moments",)
    says = "internal force"
    reads = ("mass", "state", "material", "deformation gradient", "force")

    fills = staticmethod(lambda kin: (_forces(kin), (visit.NodalStress, 0, 2)))


class MomentumAgain(Scattered):
    """Scatter momentum to the velocity array."""

    not_at_corners = ("moments",)
    says = "momentum to grid"
    reads = ("mass", "v", "moment")

    fills = staticmethod(lambda kin: (("velocity", 0, arrays.VELOCITY_WIDTH[kin.dimension]),))


class Volumes(Scattered):
    """Scatter volume, after and before the trial increment (F-bar)."""

    says = "volumes to grid"
    reads = ("mass", "state", "material", "volume ratio")

    fills = staticmethod(lambda kin: ((visit.NodalMean, 0, 2),))


class AveragedForce(Scattered):
    """Scatter the force of the averaged mean stress minus the point's mean stress (F-bar)."""

    not_at_corners = ("moments",)
    says = "internal force of the averaged mean stress"
    reads = ("mass", "state", "material", "deformation gradient", "averaged stress")
    adds = True  # to an existing force

    fills = staticmethod(lambda kin: (_forces(kin),))


class SeriesBack(Scattered):
    """Scatter the term of the series of XPIC, times mass."""

    says = "term of the series to the grid"
    reads = ("mass", "term of series")

    fills = staticmethod(lambda kin: ((Series, kin.dimension, 2 * kin.dimension),))


class VelocityBefore(Field):
    """Velocity before the last step; NaN where there was none, or it was reflected in it."""

    shape = vector
    start = nan


class Force(StepField):
    """Force of fixes on a point."""

    shape = vector
    columns = ("bx", "by", "bz")


class WorkOfForces(Field):
    """Work of that force since the last look at the energy."""


class Normal(SummedField):
    """Sum of m grad N at a node: it points out of a body, for contact between solids."""

    shape = vector


class SquaredMass(SummedField):
    """Sum of N m^2 at a node: divided by the sum of N m, the mean mass of its points (USL)."""

    @staticmethod
    def needed(basis: Any) -> bool:
        """Return True if a basis makes light nodes that affect the gradient."""
        return basis.traits.steep_edge


class Centre(SummedField):
    """Sum of mass times position at a node, for the gap between solids."""

    shape = vector


class RigidSums(SummedField):
    """Sums of the rigid points at a node: mass, momentum, force on them, as in `Nodes.sums`."""

    @staticmethod
    def shape(kin):
        """Return the components of the sums of a node."""
        return arrays.SUMS_WIDTH[kin.dimension]


@point_function()
def load_of(quantity: Tag, w: Work, p: Index, like: Number) -> tuple:
    """Return the load of a point: the numbers that it scatters, before weighting."""


visit.records_of.on(MassMomentum)(lambda quantity, nodes: nodes.sums)


visit.records_of.on(MomentumAgain)(lambda quantity, nodes: nodes.velocity)


@point_function()
def scattered(quantity: Tag, w: Work, stencil: tuple, k: int, load: tuple) -> None:
    """Add the contribution to the k-th node of the stencil."""


def _moment(w, p, like):
    return load(field(w.points.fields, Moment), p, zero_moment(w.transfer, w.kin, like))


def _is_apart(w):
    """Return True for rigid points with separate sums at their nodes."""
    return laws.moves_as_told(w.laws) and field(w.nodes.fields, RigidSums) is not None


def _mass(w, p):
    """Return the mass that a point gives to the sums of all solids."""
    mass = of_present(p, w.points.mass[p])
    return mass - mass if _is_apart(w) else mass


@load_of.on(MassMomentum)
def _load_of_mass_momentum(quantity, w, p, like):
    v = load_vector(w.kin, w.points.v, p)
    rigid = (of_present(p, w.points.mass[p]),) if _is_apart(w) else ()
    x = () if field(w.nodes.fields, Centre) is None else load_vector(w.kin, w.places.y, p)
    return _mass(w, p), v, _moment(w, p, like), rigid, x


@scattered.on(MassMomentum)
def _scattered_mass_momentum(quantity, w, stencil, k, load):
    i, N, grad_N = node_of(w, stencil, k)
    mass, v, moment, rigid, x = load
    momentum = nodal_momentum(w.transfer, w.kin, w.basis, w.grid, stencil, k, N, mass, v, moment)
    accumulate(w.nodes.sums, i, MASS, (N * mass, *momentum))
    bring_energy(field(w.nodes.fields, EnergyLoss), i, N * mass, momentum)
    if len(rigid):
        part = N * rigid[0]
        accumulate(field(w.nodes.fields, RigidSums), i, MASS, (part, *(part * v)))
    if len(x):
        accumulate_optional(field(w.nodes.fields, Centre), i, N * mass * x)
    accumulate_optional(field(w.nodes.fields, Normal), i, mass * grad_N.planar())
    accumulate_optional(field(w.nodes.fields, SquaredMass), i, (N * mass * mass,))


def _mean_stress(kin, law, state, volume):
    """Return volume times mean stress, and volume, of a point of reference `volume`."""
    tau = laws.kirchhoff_stress(law, kin, state).mean_of_stretching()
    return volume * tau, volume * laws.jacobian(law, kin, state)


@load_of.on(AveragedForce)
def _load_of_averaged_force(quantity, w, p, like):
    law, state, f = visit.deformed_state(w, p)
    volume = _mass(w, p) * laws.specific_volume(law)
    own, present = _mean_stress(w.kin, law, state, volume)
    change = present * field(w.points.fields, visit.AveragedStress)[0, p] - own
    return force_stress(w.frame, w.kin, nothing(w.kin) - change * I, f)


@scattered.on(AveragedForce)
def _scattered_averaged_force(quantity, w, stencil, k, load):
    i, _, grad_N = straining_node(w, stencil, k)
    accumulate(w.nodes.sums, i, of_force(w.kin), (*load.dot(grad_N),))


@load_of.on(InternalForce)
def _load_of_internal_force(quantity, w, p, like):
    law, state, f = visit.deformed_state(w, p)
    volume = _mass(w, p) * laws.specific_volume(law)
    # Minus volume times stress, with the sign of the internal force.
    stress = -volume * force_stress(w.frame, w.kin, laws.kirchhoff_stress(law, w.kin, state), f)
    force = load(field(w.points.fields, Force), p, load_vector(w.kin, w.points.v, p))
    of_mean = isinstance(w.averaging, visit.FBar)
    mean = _mean_stress(w.kin, law, state, volume) if of_mean else ()
    # Rigid points take no force: it would act on other points at their nodes.
    here = of_present(p, real(0 if laws.moves_as_told(w.laws) else 1, volume))
    return stress, here * force if len(force) else (), mean


@scattered.on(InternalForce)
def _scattered_internal_force(quantity, w, stencil, k, load):
    i, N, grad_N = straining_node(w, stencil, k)
    stress, of_fixes, mean = load
    force = stress.dot(grad_N)
    if len(of_fixes):
        force = N * of_fixes + force
    accumulate(w.nodes.sums, i, of_force(w.kin), (*force,))
    accumulate_optional(field(w.nodes.fields, visit.NodalStress), i, tuple([N * a for a in mean]))


@load_of.on(MomentumAgain)
def _load_of_momentum_again(quantity, w, p, like):
    moment = _moment(w, p, like)
    if len(moment) and w.frame.moves:  # of weights that never change, all is mapped again
        moment = mapped_again(w.basis, w.grid, moment)
    return _mass(w, p), load_vector(w.kin, w.points.v, p), moment


@scattered.on(MomentumAgain)
def _scattered_momentum_again(quantity, w, stencil, k, load):
    i, N, _ = node_of(w, stencil, k)
    mass, v, moment = load
    momentum = nodal_momentum(w.transfer, w.kin, w.basis, w.grid, stencil, k, N, mass, v, moment)
    accumulate(w.nodes.velocity, i, 0, (*momentum,))


@load_of.on(Volumes)
def _load_of_volumes(quantity, w, p, like):
    law, state = visit.law_and_state(w, p)
    volume = _mass(w, p) * laws.specific_volume(law) * laws.jacobian(law, w.kin, state)
    return volume * field(w.points.fields, visit.VolumeRatio)[0, p], volume


@scattered.on(Volumes)
def _scattered_volumes(quantity, w, stencil, k, load):
    i, weight, _ = node_of(w, stencil, k)
    part = (weight * load[0], weight * load[1])
    accumulate(field(w.nodes.fields, visit.NodalMean), i, 0, part)


@load_of.on(SeriesBack)
def _load_of_series_back(quantity, w, p, like):
    u = load(field(w.points.fields, TermOfSeries), p, load_vector(w.kin, w.points.v, p))
    return _mass(w, p), u


@scattered.on(SeriesBack)
def _scattered_series_back(quantity, w, stencil, k, load):
    i, weight, _ = node_of(w, stencil, k)
    mass, u = load
    accumulate(field(w.nodes.fields, Series), i, len(u), (*(weight * mass * u),))


def accumulate_optional(array, i, values):
    """Add to a node, if the array exists."""
    if array is not None:
        accumulate(array, i, 0, (*values,))


load_all = for_tags(load_of, "w, p, like")
scattered_all = for_tags(scattered, "w, stencil, k, loads", each="loads")


def adds(quantity: NamedTuple) -> bool:
    """Return True if a quantity adds to the values at the nodes."""
    return getattr(type(quantity), "adds", False)


def columns_of(quantities: tuple, kin: NamedTuple) -> list[tuple[Any, int, int]]:
    """List the columns that take all the quantities; adjacent ones are one entry."""
    found: dict[tuple[Any, int], int] = {}  # the first column of each array that ends there
    for quantity in quantities:
        for array, first, end in quantity.fills(kin):
            found[array, end] = found.pop((array, first), first)
    return [(array, first, end) for (array, end), first in found.items()]


def arrays_given(quantities: tuple, kin: Tag) -> int:
    """Add up the kinds of arrays that take the quantities: 1 the sums, 2 velocities, 4 fields."""
    names = {name for name, _, _ in columns_of(quantities, kin)}
    fields = any(not isinstance(name, str) for name in names)
    return ("sums" in names) + 2 * ("velocity" in names) + 4 * fields


def _array(nodes: Nodes, name: Any) -> Any:
    return getattr(nodes, name) if isinstance(name, str) else field(nodes.fields, name)


def _columns(quantities: tuple, kin: NamedTuple) -> Iterator[tuple]:
    for kind in (False, True):
        chosen = tuple(q for q in quantities if adds(q) == kind)
        yield from ((*columns, kind) for columns in columns_of(chosen, kin))


def _take_record(quantities, kin, nodes, n, buffers, m, keep):
    """Move record `m` of the buffers to node `n`, adding or replacing; the record becomes zero."""
    for name, first, end, add in _columns(quantities, kin):
        array = _array(nodes, name)
        if array is not None:
            like = (0,) * (end - first)
            move_record(array, n, _array(buffers, name), m, first, like, add or keep)


def _clear_record(quantities, kin, nodes, n):
    """Clear the columns of node `n` for the quantities, except those that add."""
    for name, first, end, add in _columns(quantities, kin):
        array = _array(nodes, name)
        if array is not None and not add:
            put_at(array, n, first, (0,) * (end - first))


@by_threads
def sum_shares(quantities: tuple, kin: Tag, nodes: Nodes, buffers: Buffers, share: int) -> None:
    """Sum the quantities at the nodes of a part, tile after tile, box after box."""
    nodes, buffers = at_hand(nodes), at_hand(buffers)
    first, parts = buffers.first, buffers.parts
    for part in range(first[share], first[share + 1]):
        what, count = parts[part, 9], parts[part, 4]
        for i in range(parts[part, 2]):
            for j in range(parts[part, 3]):
                n = parts[part, 0] + i * parts[part, 5] + j * parts[part, 6]
                m = parts[part, 1] + i * parts[part, 7] + j * parts[part, 8]
                if what == arrays.CLEAR:
                    for k in range(count):
                        _clear_record(quantities, kin, nodes, index(n + k))
                else:
                    for k in range(count):
                        _take_record(
                            quantities, kin, nodes, index(n + k), buffers.nodes, index(m + k),
                            what == arrays.ADD,
                        )  # fmt: skip
