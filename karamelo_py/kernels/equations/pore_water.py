"""Water in the pores: nodal sums, drag between soil and water, and the flux back to points.

Points are soil with water and move with the soil; nodes have a second velocity (Jassim, Stolle &
Vermeer 2013; Bandara & Soga 2015). A node has the mass of water m = sum N m_w, its momentum, the
volume V and the pore volume, the pressure force P = sum p V g and the outward area B = sum V g. The
fraction n = pores / V of P - B p_b acts on the water, the rest on the soil, where p_b is the
prescribed pressure at open nodes and the mean pressure at others. There is no flux through B at
nodes that are not open.

The flux is j = m / V (v_w - v_s) at nodes. Pressure rate and force use the same gradients: with a
linear basis at the cell centre (one pressure rate per cell), otherwise at the points. With splines,
pressure in the null space of the grid would grow. Therefore R (1 - S)^2 p is subtracted from p in
each step, where R = 1/20 and S maps p to the nodes and back; this changes pore volumes only.

Drag D is integrated exactly for constant acceleration in the step: with b = dt D / m and f = (1 -
exp(-b)) / b, the relative velocity w becomes w exp(-b) + (dt f_w / m - dv_s) f. A node then moves
like a mass m_s + m (1 - f) under the force f_s + (1 - f) f_w + D f w. Fixes get these values, so a
fix that holds the node has the reaction of soil and water.
"""

from math import exp, inf, nan, sqrt
from typing import NamedTuple

from karamelo_py.compiler import real, where
from karamelo_py.compiler.fields import (
    Field,
    StepField,
    SummedField,
    field,
    increase,
    numbers,
    pair,
    store,
    vector,
)
from karamelo_py.kernels import arrays
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.equations.internal_force import WorkOfForces
from karamelo_py.kernels.equations.node_updates import WorkAtNodes, node_task
from karamelo_py.kernels.equations.strain import increment
from karamelo_py.kernels.records import put_at, row
from karamelo_py.points import laws
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.product import digits
from karamelo_py.points.frames import force_stress, spatial_increment
from karamelo_py.points.kinematics import I, det, dot, nothing, outer, zero
from karamelo_py.points.kinematics import total as sum_of
from karamelo_py.points.laws.pore_water import (
    Saturated,
    drag_per_volume,
    pore_pressure,
    porosity,
    water_content,
)
from karamelo_py.points.transfers import nodal_momentum, updated_velocity

RIM = 0.5  # |B| / (V / h) above which a spline's node is at the surface
SMOOTHING = 0.05  # R
WAYS = "xlo", "xhi", "ylo", "yhi", "zlo", "zhi", "surface", "volume"
SMALL = 1e-4  # below this b, (1 - exp(-b)) / b is a series


# --- fields ---------------------------------------------------------------------------------------


class RelativeVelocity(Field):
    shape = vector
    columns = ("wx", "wy", "wz")

    @staticmethod
    def needed(law):
        return isinstance(law, Saturated)


class UnseenPressure(Field):
    """Pressure minus its mean through the nodes and back, one step earlier (splines)."""

    needed = RelativeVelocity.needed


class WaterSums(SummedField):
    """Water's nodal mass, momentum and force, as in `Nodes.sums`."""

    shape = eq.RigidSums.shape


class PoreSums(SummedField):
    """Nodal sums: volume, pore volume, volume times pressure and times unseen pressure, drag."""

    shape = numbers(5)


class PoreForce(SummedField):
    """Force of the pressure (d,), and outward area (d,)."""

    shape = numbers(0, 2)


class WaterAgain(SummedField):
    """Water's momentum mapped again after the move."""

    shape = vector


class WaterUpdate(StepField):
    """w* after the update, w* - w, and the mass of the soil."""

    shape = numbers(1, 2)


class Flux(Field):
    """Mass flux per area (d,); two outflows; two pressures.

    The first outflow, per volume, is for closed nodes, where points retain the water; the second, a
    mass per time, leaves through open nodes. The pressures are the mean at the node, and the mean
    of the unseen part.
    """

    shape = numbers(4, 1)


class GivenPressure(StepField):
    """Prescribed pressure at a node (NaN: none); 1 if water may only leave there."""

    shape = pair
    start = float("nan")


class GivenFlux(StepField):
    """Water supplied to a node per time, by `WAYS`.

    Values are per area of faces with an outward normal along each direction (lo, hi), per area of
    any face, and per volume; after the step, the mass per time that each supplied.
    """

    shape = numbers(2, 2)


POINT_FIELDS = RelativeVelocity, UnseenPressure, WorkOfForces
NODE_FIELDS = (
    WaterSums, PoreSums, PoreForce, WaterAgain, WaterUpdate, Flux, GivenPressure, WorkAtNodes,
)  # fmt: skip


# --- points to nodes ------------------------------------------------------------------------------


def _is_wet(pt):
    return isinstance(pt.w.laws, Saturated)


def pore_N(node):
    if not isinstance(node.w.basis, Linear):
        return node.N
    return real(0.5**node.kin.dimension, node.N)


def pore_grad(node):
    """Return the gradient for pressure and flux, at the cell centre with a linear basis."""
    if not isinstance(node.w.basis, Linear):
        return node.grad_N
    d = node.kin.dimension
    slope = real(0.5 ** (d - 1), node.N) * node.w.grid.inv_h
    signs = [2 * digit - 1 for digit in digits(node.k, 2, d)]
    return node.grad_N._make([slope if sign > 0 else -slope for sign in signs])


@eq.reads("mass", "state", "material")
def water(pt):
    """Return the mass (m,) of water of a point, or () if it is dry."""
    if not _is_wet(pt):
        return ()
    law, state = pt.law_and_state
    volume = eq.mass(pt) * laws.specific_volume(law)
    return (volume * water_content(law, pt.kin, state),)


@eq.reads("v", "relative velocity")
def water_v(pt):
    return pt.v + pt.load(RelativeVelocity, pt.v) if _is_wet(pt) else ()


@eq.reads("mass", "state", "material", "unseen pressure")
def volumes(pt):
    """Return the quantities of `PoreSums`, or () if dry."""
    if not _is_wet(pt):
        return ()
    law, state = pt.law_and_state
    volume = eq.mass(pt) * laws.specific_volume(law) * laws.jacobian(law, pt.kin, state)
    p, drag = pore_pressure(law, pt.kin, state), drag_per_volume(law, pt.kin, state)
    unseen = pt.of(UnseenPressure)[0, pt.p]
    return volume, volume * porosity(law, pt.kin, state), volume * p, volume * unseen, volume * drag


@eq.reads("mass", "state", "material", "deformation gradient")
def pores(pt):
    """Return pressure, and volume as a stress, or () if dry."""
    if not _is_wet(pt):
        return ()
    law, state, f = pt.law_state_F
    one = nothing(pt.kin) + laws.jacobian(law, pt.kin, state) * I
    area = eq.mass(pt) * laws.specific_volume(law) * force_stress(pt.w.frame, pt.kin, one, f)
    return pore_pressure(law, pt.kin, state), area


def _sums_at(pt, node):
    if not len(pt.volumes):
        return ()
    *some, drag = pt.volumes
    return (*[pore_N(node) * one for one in some], node.N * drag)


def _affine_sums(pt, w):
    if not len(pt.volumes) or isinstance(w.basis, Linear):
        return ()
    return pt.volumes, ()


def _force_and_area_at(pt, node):
    if not len(pt.pores):
        return ()
    p, V = pt.pores
    area = V.dot(pore_grad(node))
    return (*(p * area), *area)


class OfWater(NamedTuple):
    mass: arrays.Number
    v: tuple
    moment: tuple


def _momentum_at(pt, node):
    if not len(pt.water):
        return ()
    return nodal_momentum(node.transfer, OfWater(pt.water[0], pt.water_v, ()), node)


def _affine_mass(pt, w):
    return (pt.water[0], ()) if len(pt.water) else ()


def _affine_momentum(pt, w):
    return (pt.water[0] * pt.water_v, ()) if len(pt.water) else ()


class WaterMomentum(eq.NodalQuantity):
    says = "water to grid"
    takes = eq.of_point(water=water, water_v=water_v)
    gives = (
        eq.Sum(
            eq.MASS._replace(array=WaterSums),
            lambda pt, node: tuple([node.N * m for m in pt.water]),
            _affine_mass,
        ),
        eq.Sum(eq.MOMENTUM._replace(array=WaterSums), _momentum_at, _affine_momentum),
    )


class PoreVolumes(eq.NodalQuantity):
    says = "volumes of pores to grid"
    takes = eq.of_point(volumes=volumes)
    gives = (eq.Sum(eq.whole(PoreSums), _sums_at, _affine_sums),)


class WaterForce(eq.NodalQuantity):
    says = "pore pressure to grid"
    takes = eq.of_point(pores=pores)
    gives = (eq.Sum(eq.whole(PoreForce), _force_and_area_at),)


class WaterMomentumAgain(eq.NodalQuantity):
    says = "momentum of the water to grid"
    takes = eq.of_point(water=water, water_v=water_v)
    gives = (eq.Sum(eq.whole(WaterAgain), _momentum_at, _affine_momentum),)


# --- at the nodes ---------------------------------------------------------------------------------


def _taken_up(b):
    """Return exp(-b), and (1 - exp(-b)) / b."""
    e = exp(-b)
    return e, (1 - e) / b if b > SMALL else 1 - 0.5 * b * (1 - b / 3)


def _is_rim(nodes, kin, n, rim):
    force, V = field(nodes.fields, PoreForce), field(nodes.fields, PoreSums)[n, 0]
    squared, d = real(0, V), kin.dimension
    for k in range(d):
        squared += force[n, d + k] * force[n, d + k]
    return squared >= rim * rim * V * V


def _is_open(nodes, n):
    p = field(nodes.fields, GivenPressure)[n, 0]
    return p == p


def _close_if_dry(nodes, kin, n):
    """Close a node of a seepage face unless its pressure or flow is outward."""
    prescribed, sums = field(nodes.fields, GivenPressure), field(nodes.fields, PoreSums)
    if prescribed[n, 1] == 1 and sums[n, 2] <= prescribed[n, 0] * sums[n, 0]:
        water, force = field(nodes.fields, WaterSums), field(nodes.fields, PoreForce)
        m, m_s, across = water[n, arrays.MASS], nodes.sums[n, arrays.MASS], real(0, sums[n, 0])
        for k in range(kin.dimension):
            of_momentum = arrays.of_momentum(kin) + k
            w = water[n, of_momentum] / m - nodes.sums[n, of_momentum] / m_s
            across += w * force[n, kin.dimension + k]
        if across <= 0:
            prescribed[n, 0] = nan


def _is_closed(nodes, kin, n, rim):
    return not _is_open(nodes, n) and _is_rim(nodes, kin, n, rim)


def _by_pressure(nodes, kin, n, rim):
    """Return the force of the pressure on the water (d,), and the boundary pressure.

    The latter is the prescribed pressure at an open node, the mean pressure at other nodes of the
    rim, and otherwise 0.
    """
    sums, force = field(nodes.fields, PoreSums), field(nodes.fields, PoreForce)
    p, d = real(0, sums[n, 0]), kin.dimension
    if _is_open(nodes, n):
        p = field(nodes.fields, GivenPressure)[n, 0]
    elif _is_rim(nodes, kin, n, rim):
        p = sums[n, 2] / sums[n, 0]
    share = sums[n, 1] / sums[n, 0]
    return [share * (force[n, k] - force[n, d + k] * p) for k in range(d)], p


def _mass_given(nodes, kin, n, V):
    """Return the mass of water that a node gets per time; store it by `WAYS`."""
    supply, force, d = field(nodes.fields, GivenFlux), field(nodes.fields, PoreForce), kin.dimension
    whole, squared = real(0, V), real(0, V)
    if supply is None:
        return whole
    for k in range(d):
        area = force[n, d + k]
        squared += area * area
        supply[n, 2 * k] *= max(-area, real(0, V))
        supply[n, 2 * k + 1] *= max(area, real(0, V))
    supply[n, 2 * d] *= sqrt(squared)
    supply[n, 2 * d + 1] *= V
    for k in range(2 * d + 2):
        whole += supply[n, k]
    return whole


def _is_wet_node(nodes, n):
    water, sums = field(nodes.fields, WaterSums), field(nodes.fields, PoreSums)
    return nodes.sums[n, arrays.MASS] > 0 and water[n, arrays.MASS] > 0 and sums[n, 0] > 0


@node_task
class ShareForces(NamedTuple):
    """Sets the force on the water, and for fixes mass and force of a node with dragged water."""

    rim: float  # |B| / V of closed nodes
    surface: float  # |B| / V of nodes at the surface

    says = "forces on soil and water"
    goes_through = ("sums", "water sums", "pore sums", "pore force", "water update")

    def at_node(task, kin, nodes, n, dt):
        if not _is_wet_node(nodes, n):
            return
        water, sums = field(nodes.fields, WaterSums), field(nodes.fields, PoreSums)
        force, d = field(nodes.fields, PoreForce), kin.dimension
        _close_if_dry(nodes, kin, n)
        m, m_s, D = water[n, arrays.MASS], nodes.sums[n, arrays.MASS], sums[n, 4]
        along = real(0, m)
        pushed, _ = _by_pressure(nodes, kin, n, task.rim)
        if _is_closed(nodes, kin, n, task.surface):
            # A wall supports the weight of water next to it, which is not in the mean pressure.
            squared = real(0, m)
            for k in range(d):
                along += water[n, arrays.of_force(kin) + k] * force[n, d + k]
                squared += force[n, d + k] * force[n, d + k]
            along /= squared
        _, taken = _taken_up(dt * D / m)
        whole = m_s + m * (1 - taken)
        for k in range(d):
            of_force, of_momentum = arrays.of_force(kin) + k, arrays.of_momentum(kin) + k
            by_pressure = pushed[k]
            carried = along * force[n, d + k]
            on_water = water[n, of_force] - carried + by_pressure
            v = nodes.sums[n, of_momentum] / m_s
            w = water[n, of_momentum] / m - v
            rest = nodes.sums[n, of_force] + carried + force[n, k] - by_pressure
            water[n, of_force] = on_water
            nodes.sums[n, of_force] = rest + (1 - taken) * on_water + D * taken * w
            nodes.sums[n, of_momentum] = whole * v
        nodes.sums[n, arrays.MASS] = whole
        field(nodes.fields, WaterUpdate)[n, 2 * kin.dimension] = m_s


@node_task
class DragWater(NamedTuple):
    """Sets the relative velocity after the step from the soil's change, and the soil's mass."""

    says = "drag"
    goes_through = ("sums", "update", "water sums", "pore sums", "water update")

    def at_node(task, kin, nodes, n, dt):
        out, d = field(nodes.fields, WaterUpdate), kin.dimension
        if not _is_wet_node(nodes, n):
            for k in range(2 * d):
                out[n, k] = 0
            return
        water, sums = field(nodes.fields, WaterSums), field(nodes.fields, PoreSums)
        m, m_s, whole = water[n, arrays.MASS], out[n, 2 * d], nodes.sums[n, arrays.MASS]
        left, taken = _taken_up(dt * sums[n, 4] / m)
        for k in range(d):
            of_force, of_momentum = arrays.of_force(kin) + k, arrays.of_momentum(kin) + k
            dv = nodes.update[n, arrays.of_change(kin) + k]
            w = water[n, of_momentum] / m - (nodes.update[n, k] - dv)
            new = left * w + taken * (dt * water[n, of_force] / m - dv)
            out[n, k] = new
            out[n, d + k] = new - w
            water[n, of_force] = 0
            nodes.sums[n, of_momentum] *= m_s / whole
        nodes.sums[n, arrays.MASS] = m_s


@node_task
class MakeFlux(NamedTuple):
    rim: float

    says = "flux of the water"
    goes_through = ("sums", "velocity", "water sums", "water again", "pore sums", "flux")

    def at_node(task, kin, nodes, n, dt):
        flux, d = field(nodes.fields, Flux), kin.dimension
        across = real(0, dt)
        if not _is_wet_node(nodes, n):
            put_at(flux, n, 0, (0,) * (d + 4))
            if field(nodes.fields, GivenFlux) is not None:
                put_at(field(nodes.fields, GivenFlux), n, 0, (0,) * (2 * d + 2))
            return
        m, V = field(nodes.fields, WaterSums)[n, arrays.MASS], field(nodes.fields, PoreSums)[n, 0]
        again, force = field(nodes.fields, WaterAgain), field(nodes.fields, PoreForce)
        for k in range(d):
            j = (again[n, k] - m * nodes.velocity[n, k]) / V
            flux[n, k] = j
            across += j * force[n, d + k]
        enters = field(nodes.fields, GivenPressure)[n, 1] == 1 and across < 0
        drained = _is_open(nodes, n) and not enters
        closed = not drained and _is_rim(nodes, kin, n, task.rim)
        for k in range(2):
            flux[n, d + 2 + k] = field(nodes.fields, PoreSums)[n, 2 + k] / V
        supply = _mass_given(nodes, kin, n, V)
        stays = across + supply if closed else supply
        flux[n, d] = real(0, dt) if drained else stays / V
        flux[n, d + 1] = across + supply if drained else real(0, dt)
        # With the mean relative velocity in the step, the remaining work is the work of weight
        # minus the work of drag, and the work of pressure on water that enters or leaves.
        water, out = field(nodes.fields, WaterSums), field(nodes.fields, WaterUpdate)
        pushed, p = _by_pressure(nodes, kin, n, task.rim)
        work = dt * (supply - flux[n, d + 1]) * p * field(nodes.fields, PoreSums)[n, 1] / m
        for k in range(d):
            of_momentum = arrays.of_momentum(kin) + k
            v, dv = nodes.velocity[n, k], nodes.update[n, arrays.of_change(kin) + k]
            # a fix that holds the soil prescribes its velocity throughout
            before = v if nodes.update[n, k] == v else nodes.update[n, k] - dv
            w = 0.5 * ((water[n, of_momentum] + again[n, k]) / m - before - v)
            dv += out[n, d + k]
            work += w * (m * dv - dt * pushed[k])
        field(nodes.fields, WorkAtNodes)[n, 0] += work


# --- nodes to points ------------------------------------------------------------------------------


class MoveWater(eq.Task):
    """Gathers w* and its change after `Move`; updates the water's velocity."""

    says = "velocity of the water"
    reads = ("x", "v", "mass", "state", "material", "relative velocity", "work of forces")
    writes = ("relative velocity", "v", "work of forces")

    def empty(task, w, x):
        return x - x, x - x

    def gathered(task, node, total):
        if not isinstance(node.w.laws, Saturated):
            return total
        w, dw = total
        d = node.kin.dimension
        both = row(node.of(WaterUpdate), node.i, 0, (*w, *dw))
        return w + node.N * w._make(both[:d]), dw + node.N * w._make(both[d:])

    def updated(task, pt, total, totals, fastest):
        if not _is_wet(pt):
            return eq.Report(real(0, pt.dt), fastest)
        at_nodes, change = total
        law, state = pt.law_and_state
        new = updated_velocity(pt.w.transfer, pt.load(RelativeVelocity, pt.v), at_nodes, change)
        # Drag on velocities in the null space of the grid, with constant momentum of the point.
        per_mass = laws.specific_volume(law)
        m = per_mass * water_content(law, pt.kin, state)
        drag = per_mass * laws.jacobian(law, pt.kin, state) * drag_per_volume(law, pt.kin, state)
        b = pt.w.kick * drag * (1 + m) / m
        unseen = (b / (1 + b)) * (new - at_nodes)
        store(pt.of(RelativeVelocity), pt.p, new - unseen)
        store(pt.w.points.v, pt.p, pt.v + (m / (1 + m)) * unseen)
        # Work of this impulse: for nodes, the step ends with the velocity after it.
        way = dot(unseen, change) - new.squared() + (new - unseen).squared()
        increase(pt.of(WorkOfForces), pt.p, (0.5 * eq.mass(pt) * (m / (1 + m)) * way,))
        return eq.Report(real(0, pt.dt), fastest)


class Seep(eq.Task):
    """Gathers the flux before `Strain`; updates water, pores and the water's velocity."""

    says = "water that comes and goes"
    reads = ("x", "state", "material", "deformation gradient", "v", "relative velocity")
    writes = ("state", "relative velocity", "unseen pressure")

    def empty(task, w, x):
        none = real(0, x[0])
        return zero(w.kin, x[0]), zero(w.kin, x[0]), none, (none, none)

    def gathered(task, node, total):
        if not isinstance(node.w.laws, Saturated):
            return total
        spread, gradient, kept, means = total
        d, g = node.kin.dimension, pore_grad(node)
        (*j, stays, _, mean, again) = row(node.of(Flux), node.i, 0, (*g[:d], kept, kept, *means))
        return (
            spread + outer(node.v._make(j), g),
            gradient + outer(node.v, g),
            kept + pore_N(node) * stays,
            (means[0] + node.N * mean, means[1] + node.N * again),
        )

    def updated(task, pt, total, totals, fastest):
        if not _is_wet(pt):
            return eq.Report(real(0, pt.dt), fastest)
        spread, gradient, kept, (mean, again) = total
        law, old, f = pt.law_state_F
        frame, kin = pt.w.frame, pt.kin
        # per initial volume
        leaving = sum_of(spatial_increment(frame, kin, spread, f).diagonal())
        lost = laws.jacobian(law, kin, old) * (leaving - kept)
        content = old.content - pt.dt * lost / law.rho
        grown = det(I + spatial_increment(frame, kin, increment(pt.dt, gradient), f))
        pores = old.pores * grown + (1 - law.n) * (grown - 1)
        if not isinstance(pt.w.basis, Linear):
            factor = real(SMOOTHING, mean) / law.K
            pores = pores * (1 + factor * (pt.of(UnseenPressure)[0, pt.p] - again))
            store(pt.of(UnseenPressure), pt.p, (pore_pressure(law, kin, old) - mean,))
        new = old._replace(content=content, pores=pores)
        store(pt.w.points.state, pt.p, new)
        v = pt.v
        ratio = old.content / content  # momentum of the water is conserved
        w = pt.load(RelativeVelocity, v)
        store(pt.of(RelativeVelocity), pt.p, ratio * (v + w) - v)
        good = (content > 0) & (pores > 0)
        return eq.Report(where(good, real(0, content), real(inf, content)), fastest)
