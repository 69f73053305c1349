"""Water in the pores: nodal sums, drag between soil and water, and the flux back to points.

Points are soil with water and move with the soil; nodes have a second velocity (Jassim, Stolle &
Vermeer 2013; Bandara & Soga 2015). A node has the mass of water m = sum N m_w, its momentum, the
volume V and the pore volume, the pressure force P = sum p V g and the outward area B = sum V g. The
fraction n = pores / V of P - B p_b acts on the water, the rest on the soil, where p_b is the
prescribed pressure at open nodes and the mean pressure at others. There is no flux through B at
nodes that are not open.

The flux is j = m / V (v_w - v_s) at nodes. Pressure rate and force use the same gradients: with a
linear basis at the cell centre (one pressure rate per cell), otherwise at the points; if pressures
are solved for, by cells with any basis (:mod:`~.pore_cells`).

In explicit steps with splines, strains and pressures in the null space of the grid would grow. S
maps a quantity to the nodes and back, and is symmetric in the product weighted by volumes. In each
step R (1 - S)^2 x is subtracted from the volume strain of soil and pores, where R = 0.3 and x is
the strain of the water: the sum of volume strains minus the volume of inflows. In consolidation the
soil strains as water leaves, x remains small, and smoothing does not let the soil creep where its
strain jumps. If the water is softer than the soil, x is as large as the strain of the soil. Hence x
decays by the fraction R `fades` per step. R (1 - S) y is subtracted from the content, where y is
the sum of inflows that decays by the fraction R per step: an inflow is smoothed once. The sums of
volume and water do not change.

Velocities of nodes are means by the mass of soil and water, relative velocities of the water by its
mass. Hence undrained points have no flux, also if their water contents differ, and the momentum of
the mixture is conserved.

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
    FieldMappedAgain,
    StepField,
    SummedField,
    field,
    increase,
    numbers,
    pair,
    scalar,
    store,
    store_from,
    vector,
)
from karamelo_py.compiler.powers import power
from karamelo_py.compiler.tuples import count_in
from karamelo_py.kernels import arrays
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.equations.fbar import VolumeCorrection
from karamelo_py.kernels.equations.internal_force import InternalForce, WorkOfForces, force_at
from karamelo_py.kernels.equations.mass_momentum import MassMomentum, MomentumAgain
from karamelo_py.kernels.equations.node_updates import (
    NodalUpdate,
    WorkAtNodes,
    at_node,
    node_task,
)
from karamelo_py.kernels.equations.pore_cells import (
    CellGrowth,
    are_solved,
    by_cells,
    cell_fraction,
    cell_grad,
    cell_N,
)
from karamelo_py.kernels.equations.strain import increment
from karamelo_py.kernels.records import clear_first, put_at, row
from karamelo_py.points import laws
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.frames import force_stress, spatial_increment
from karamelo_py.points.kinematics import I, det, dot, nothing, outer, zero
from karamelo_py.points.kinematics import total as sum_of
from karamelo_py.points.laws.pore_water import (
    Saturated,
    drag_at,
    drag_per_volume,
    pore_pressure,
    porosity,
    water_content,
)
from karamelo_py.points.transfers import nodal_momentum, updated_velocity

RIM = 0.5  # |B| / (V / h) above which a spline's node is at the surface
SMOOTHING = 0.3  # R
WAYS = "xlo", "xhi", "ylo", "yhi", "zlo", "zhi", "surface", "volume"
SMALL = 1e-4  # below this b, (1 - exp(-b)) / b is a series


class RelativeVelocity(Field):
    shape = vector
    columns = ("wx", "wy", "wz")

    @staticmethod
    def needed(law):
        return isinstance(law, Saturated)


class VolumeStrain(Field):
    """Strain x of the water, (1 - S) x of the previous step, and recent inflow y (splines)."""

    shape = numbers(3, 0)
    needed = RelativeVelocity.needed


def of_drag(kin):
    return 7 if kin.dimension == 3 else 3


def of_volumes(kin):
    return 4 if kin.dimension == 1 else 8


def of_pressure(kin):
    return of_volumes(kin) + 4


def of_unseen(kin):
    return 6 if kin.dimension == 2 else of_pressure(kin) + 2 * kin.dimension


class WaterSums(SummedField):
    """Nodal sums of water and pores.

    Mass, relative momentum and force of the water, as in `Nodes.sums`, with a column for the drag
    and, in 2D, for volume times unseen strain and inflow; volume, volume of pores, volume times
    pressure, volume times strain; force of the pressure (d,) and outward area (d,).
    """

    shape = staticmethod(lambda kin: max(of_unseen(kin) + 2, of_pressure(kin) + 2 * kin.dimension))
    filled = True


class WaterAgain(FieldMappedAgain):
    """Water's momentum mapped again after the move."""

    shape = vector


class WaterUpdate(StepField):
    """w* after the update, w* - w, the mass of the soil, exp(-b) and f.

    After the update, the last three are replaced by exp(-b) and the velocity (d,) of points minus
    the velocity of a fix that holds the soil at the node.
    """

    shape = staticmethod(lambda kin: 2 * kin.dimension + max(3, 1 + kin.dimension))


class Flux(Field):
    """Mass flux (d,) per area, outflow per volume, three means, mass outflow through open nodes.

    The outflow per unit volume is computed for closed nodes and does not leave the points; the mass
    outflow does. The means are of strain, unseen strain and inflow.
    """

    shape = numbers(5, 1)
    filled = True


class GivenPressure(StepField):
    """Prescribed pressure at a node (NaN: none); 1 if water may only leave there."""

    shape = pair
    start = float("nan")


class GivenFlux(StepField):
    """Rates of water supply to a node, by `WAYS`.

    Values are per unit area of faces with an outward normal along each direction (lo, hi), per unit
    area of any face, and per unit volume; after the step, the mass flow rate that each supplied.
    """

    shape = numbers(2, 2)


POINT_FIELDS = RelativeVelocity, WorkOfForces, VolumeStrain, VolumeCorrection
NODE_FIELDS = (
    WaterSums, WaterAgain, WaterUpdate, Flux, GivenPressure, WorkAtNodes,
)  # fmt: skip


def _is_wet(pt):
    return isinstance(pt.w.laws, Saturated)


def pore_N(node):
    return cell_N(node) if by_cells(node.w) else node.N


def pore_grad(node):
    """Return the gradient for pressure and flux."""
    return cell_grad(node) if by_cells(node.w) else node.grad_N


@eq.reads("mass", "state", "material")
def water(pt):
    """Return the mass (m,) of water of a point, or () if it is dry."""
    if not _is_wet(pt):
        return ()
    law, state = pt.law_and_state
    volume = eq.mass(pt) * laws.specific_volume(law)
    return (volume * water_content(law, pt.kin, state),)


@eq.reads("relative velocity")
def water_w(pt):
    return pt.load(RelativeVelocity, pt.v) if _is_wet(pt) else ()


@eq.reads("mass", "state", "material")
def mixture_mass(pt):
    return sum(water(pt), eq.mass(pt))


class WetPoint(NamedTuple):
    m: arrays.Number  # mass of the water, () if dry
    w: tuple  # velocity of the water relative to the soil
    drag: arrays.Number  # force per unit relative velocity
    volumes: tuple  # of point and pores, times pressure; with splines, times strain, or content
    unseen: tuple  # products of volume and unseen strain and inflow (splines)
    p: arrays.Number
    area: tuple  # volume times the unit tensor, in the frame of the gradients


@eq.reads(
    "mass", "state", "material", "deformation gradient", "v", "relative velocity",
    "volume strain",
)  # fmt: skip
def pores(pt):
    """Return a point's contribution to `WaterSums`, or () if it is dry."""
    if not _is_wet(pt):
        return ()
    law, state, f = pt.law_state_F
    kin, J = pt.kin, laws.jacobian(law, pt.kin, state)
    V0 = eq.mass(pt) * laws.specific_volume(law)
    V, n, p = V0 * J, porosity(law, kin, state), pore_pressure(law, kin, state)
    strains = () if by_cells(pt.w) else pt.load(VolumeStrain, (V,) * 3)
    area = V0 * force_stress(pt.w.frame, kin, nothing(kin) + J * I, f)
    drag = V * drag_at(law.permeability, law, n)
    strain, unseen = _times(V, strains[:1]), _times(V, strains[1:])
    content, volumes = V0 * water_content(law, kin, state), (V, V0 * state.pores, V * p, *strain)
    if are_solved(pt.w.nodes):
        volumes = (*volumes, content)
    return WetPoint(content, water_w(pt), drag, volumes, unseen, p, area)


def trace(tensor):
    a = tensor.at()
    return sum_of([a[i, i] for i in tensor.axes])


class OfWater(NamedTuple):
    mass: arrays.Number
    v: tuple
    moment: tuple


def _momentum(m, v, node):
    return nodal_momentum(node.transfer, OfWater(m, v, ()), node)


def _times(factor, numbers):
    return tuple([factor * number for number in numbers])


def _affine_volumes(pt, w):
    if not len(pt.pores):
        return ()
    if not isinstance(w.basis, Linear):
        return () if by_cells(w) else (pt.pores.volumes, ())
    return eq.Unweighted(_times(0.5**w.kin.dimension, pt.pores.volumes), ())


def _force_and_area_at(pt, node):
    if not len(pt.pores):
        return ()
    area = pt.pores.area.dot(pore_grad(node))
    return (*(pt.pores.p * area), *area)


def _affine_force_and_area(pt, w):
    # Gradients at a cell's centre differ only in sign.
    if not (len(pt.pores) and isinstance(w.basis, Linear)) or w.kin.hoops:
        return ()
    p, slope = pt.pores.p, 0.5 ** (w.kin.dimension - 1) * w.grid.inv_h
    steps = [slope * column for column in pt.pores.area.columns()]
    first = -sum_of(steps)
    growths = tuple([(*(2 * p * step), *(2 * step)) for step in steps])
    return eq.Unweighted((*(p * first), *first), growths)


MASS = eq.MASS._replace(array=WaterSums)
# Ends are the next first columns, so that the record is moved as a whole, with forces of 0.
MOMENTUM = eq.MOMENTUM._replace(array=WaterSums, end=of_drag)
DRAG = eq.NodeColumns(
    WaterSums,
    of_drag,
    scalar,
    lambda kin: of_unseen(kin) if kin.dimension == 2 else of_volumes(kin),
)
VOLUMES = eq.NodeColumns(WaterSums, of_volumes, lambda kin: 4, of_pressure)
PRESSURE = eq.NodeColumns(
    WaterSums, of_pressure, lambda kin: 2 * kin.dimension,
    lambda kin: of_pressure(kin) + 2 * kin.dimension,
)  # fmt: skip
UNSEEN = eq.NodeColumns(WaterSums, of_unseen, lambda kin: 2, lambda kin: of_unseen(kin) + 2)
OF_PORES = eq.of_point(pores=pores)


class MixtureMomentum(MassMomentum):
    takes = eq.of_point(**{**MassMomentum.takes, "mass": mixture_mass})


class MixtureMomentumAgain(MomentumAgain):
    takes = eq.of_point(**{**MomentumAgain.takes, "mass": mixture_mass})


class WaterMomentum(eq.ExtensiveQuantity):
    says = "water to grid"
    takes = OF_PORES
    gives = (
        eq.Sum(
            MASS,
            lambda pt, node: (node.N * pt.pores.m,) if len(pt.pores) else (),
            lambda pt, w: (pt.pores.m, ()) if len(pt.pores) else (),
        ),
        eq.Sum(
            MOMENTUM,
            lambda pt, node: _momentum(*pt.pores[:2], node) if len(pt.pores) else (),
            lambda pt, w: (pt.pores.m * pt.pores.w, ()) if len(pt.pores) else (),
        ),
    )


class Drag(eq.ExtensiveQuantity):
    says = "drag to grid"
    takes = OF_PORES
    gives = (
        eq.Sum(
            DRAG,
            lambda pt, node: (node.N * pt.pores.drag,) if len(pt.pores) else (),
            lambda pt, w: (pt.pores.drag, ()) if len(pt.pores) else (),
        ),
    )


class PoreVolumes(eq.ExtensiveQuantity):
    says = "volumes of pores to grid"
    takes = OF_PORES
    gives = (
        eq.Sum(
            VOLUMES,
            lambda pt, node: _times(pore_N(node), pt.pores.volumes) if len(pt.pores) else (),
            _affine_volumes,
        ),
    )


class UnseenStrain(eq.ExtensiveQuantity):
    says = "null-space strain and inflow to grid"
    takes = OF_PORES
    gives = (
        eq.Sum(
            UNSEEN,
            lambda pt, node: _times(node.N, pt.pores.unseen) if len(pt.pores) else (),
            lambda pt, w: (pt.pores.unseen, ()) if len(pt.pores) and len(pt.pores.unseen) else (),
        ),
    )


class WaterForce(eq.ExtensiveQuantity):
    says = "pore pressure to grid"
    takes = OF_PORES
    gives = (eq.Sum(PRESSURE, _force_and_area_at, _affine_force_and_area),)


@eq.reads("mass", "state", "material", "deformation gradient")
def soil_pressure(pt):
    """Return minus the mean effective stress times `WetPoint.area`, or ()."""
    if not _is_wet(pt) or isinstance(pt.w.basis, Linear):
        return ()
    law, state, f = pt.law_state_F
    V0 = eq.mass(pt) * laws.specific_volume(law)
    tau = laws.kirchhoff_stress(law, pt.kin, state).mean_of_stretching()
    return -V0 * force_stress(pt.w.frame, pt.kin, nothing(pt.kin) + tau * I, f)


def _soil_force_at(pt, node):
    force = force_at(pt, node)
    if not len(pt.soil):
        return force
    return force + pt.soil.dot(pore_grad(node)) - pt.soil.dot(node.grad_N)


class SoilForce(InternalForce):
    """Internal force whose mean effective stress is conjugate to the volume rates of cells."""

    takes = eq.of_point(**InternalForce.takes, soil=soil_pressure)
    gives = (eq.Sum(eq.FORCE, _soil_force_at), *InternalForce.gives[1:])


class WaterMomentumAgain(eq.ExtensiveQuantity):
    says = "momentum of the water to grid"
    takes = eq.of_point(water=water, w=water_w)
    gives = (
        eq.Sum(
            eq.whole(WaterAgain),
            lambda pt, node: _momentum(*pt.water, pt.w, node) if len(pt.water) else (),
            lambda pt, w: (pt.water[0] * pt.w, ()) if len(pt.water) else (),
        ),
    )


def _taken_up(b):
    """Return exp(-b), and (1 - exp(-b)) / b."""
    e = exp(-b)
    return e, (1 - e) / b if b > SMALL else 1 - 0.5 * b * (1 - b / 3)


def _is_rim(nodes, kin, n, rim):
    if rim is None:
        return True
    sums, first = field(nodes.fields, WaterSums), of_pressure(kin) + kin.dimension
    V = sums[n, of_volumes(kin)]
    squared = real(0, V)
    for k in range(kin.dimension):
        squared += sums[n, first + k] * sums[n, first + k]
    return squared >= rim * rim * V * V


def is_open(nodes, n):
    p = field(nodes.fields, GivenPressure)[n, 0]
    return p == p


def close_if_dry(nodes, kin, n):
    """Close a node of a seepage face unless its pressure or flow is outward."""
    prescribed, sums = field(nodes.fields, GivenPressure), field(nodes.fields, WaterSums)
    of_V, of_area = of_volumes(kin), of_pressure(kin) + kin.dimension
    if prescribed[n, 1] == 1 and sums[n, of_V + 2] <= prescribed[n, 0] * sums[n, of_V]:
        across = real(0, sums[n, 0])
        for k in range(kin.dimension):
            across += sums[n, arrays.of_momentum(kin) + k] * sums[n, of_area + k]
        if across <= 0:
            prescribed[n, 0] = nan


def _is_closed(nodes, kin, n, rim):
    has_volume = field(nodes.fields, WaterSums)[n, of_volumes(kin)] > 0
    return has_volume and not is_open(nodes, n) and _is_rim(nodes, kin, n, rim)


def mass_of_flow(nodes, kin, n):
    """Return the mass of water of a node by the volumes of cells, if pressures are solved for."""
    of_mass = of_volumes(kin) + 3 if are_solved(nodes) else arrays.MASS
    return field(nodes.fields, WaterSums)[n, of_mass]


def edge(nodes, kin, n):
    """Return e = sqrt(m / `mass_of_flow`), which differs from 1 at edges and in part-filled cells.

    With the pressure force e n P' and the flux e n w, the equation of the pressure is symmetric and
    its permeability exact; with the weight g m / e, hydrostatic pressures are exact, too.
    """
    m, one = field(nodes.fields, WaterSums)[n, arrays.MASS], mass_of_flow(nodes, kin, n)
    return sqrt(m / one) if are_solved(nodes) and one > 0 else real(1, m)


def inverse_volume(nodes, kin, n):
    """Return 1 / V of a wet node, or 0 if no cell next to it has water."""
    V = field(nodes.fields, WaterSums)[n, of_volumes(kin)]
    return 1 / V if V > 0 else real(0, V)


def _by_pressure(nodes, kin, n, rim):
    """Return the force of the pressure on the water (d,), and the boundary pressure.

    The latter is the prescribed pressure at an open node, the mean pressure at other nodes of the
    rim, and otherwise 0.
    """
    sums, d, of_P = field(nodes.fields, WaterSums), kin.dimension, of_pressure(kin)
    of_V, p = of_volumes(kin), real(0, sums[n, 0])
    per_volume = inverse_volume(nodes, kin, n)
    if is_open(nodes, n):
        p = field(nodes.fields, GivenPressure)[n, 0]
    elif _is_rim(nodes, kin, n, rim):
        p = sums[n, of_V + 2] * per_volume
    share = sums[n, of_V + 1] * per_volume * edge(nodes, kin, n)
    return [share * (sums[n, of_P + k] - sums[n, of_P + d + k] * p) for k in range(d)], p


def _faces(nodes, kin, n):
    """List the areas and the volume of a node, by `WAYS`."""
    sums, d = field(nodes.fields, WaterSums), kin.dimension
    V, squared, areas = sums[n, of_volumes(kin)], real(0, sums[n, 0]), []
    for k in range(d):
        area = sums[n, of_pressure(kin) + d + k]
        squared += area * area
        areas += [max(-area, real(0, V)), max(area, real(0, V))]
    return [*areas, sqrt(squared), V]


def mass_given(nodes, kin, n, store):
    """Return the mass flow rate of water that fixes supply to a node; `store` it by `WAYS`."""
    supply = field(nodes.fields, GivenFlux)
    whole = real(0, nodes.sums[n, 0])
    if supply is None:
        return whole
    for k, size in enumerate(_faces(nodes, kin, n)):
        given = supply[n, k] * size
        if store:
            supply[n, k] = given
        whole += given
    return whole


def clear_water_across(nodes, kin, n):
    """Clear the radial components of a node on the axis."""
    sums, d = field(nodes.fields, WaterSums), kin.dimension
    if sums is not None:
        for first in (arrays.of_momentum(kin), arrays.of_force(kin), of_pressure(kin)):
            sums[n, first] = 0
        sums[n, of_pressure(kin) + d] = 0
        clear_first(field(nodes.fields, WaterAgain), n)


def is_wet_node(nodes, kin, n):
    sums = field(nodes.fields, WaterSums)
    return nodes.sums[n, arrays.MASS] > 0 and sums[n, arrays.MASS] > 0


class DragAt(NamedTuple):
    m_s: arrays.Number  # mass of the soil
    left: arrays.Number  # exp(-b)
    taken: arrays.Number  # f
    whole: arrays.Number  # mass of soil and dragged water


def forces_at(task, kin, nodes, n, dt):
    """Return `DragAt`, and by direction: force on the water, on the whole mass, v and w."""
    water, d, of_P = field(nodes.fields, WaterSums), kin.dimension, of_pressure(kin)
    m, m_s, D = water[n, arrays.MASS], nodes.sums[n, arrays.MASS], water[n, of_drag(kin)]
    along = real(0, m)
    pushed, _ = _by_pressure(nodes, kin, n, task.rim)
    if _is_closed(nodes, kin, n, task.surface):
        # A wall supports the weight of water next to it, which is not in the mean pressure.
        squared = real(0, m)
        for k in range(d):
            area = water[n, of_P + d + k]
            along += water[n, arrays.of_force(kin) + k] * area
            squared += area * area
        along /= squared
    per_mass, per_soil = 1 / m, 1 / m_s
    left, taken = _taken_up(dt * D * per_mass)
    per_edge, forces = 1 / edge(nodes, kin, n), []
    for k in range(d):
        of_force, of_momentum = arrays.of_force(kin) + k, arrays.of_momentum(kin) + k
        by_pressure = pushed[k]
        carried = along * water[n, of_P + d + k]
        by_weight = per_edge * (water[n, of_force] - carried)
        on_water = by_weight + by_pressure
        v = nodes.sums[n, of_momentum] * per_soil
        w = water[n, of_momentum] * per_mass
        rest = nodes.sums[n, of_force] + water[n, of_force] - by_weight
        rest += water[n, of_P + k] - by_pressure
        forces.append((on_water, rest + (1 - taken) * on_water + D * taken * w, v, w))
    return DragAt(m_s, left, taken, m_s + m * (1 - taken)), forces


def share_forces(task, kin, nodes, n, dt):
    if not is_wet_node(nodes, kin, n):
        return
    water, out, d = field(nodes.fields, WaterSums), field(nodes.fields, WaterUpdate), kin.dimension
    drag, forces = forces_at(task, kin, nodes, n, dt)
    put_at(out, n, 2 * d, drag[:3])
    for k in range(d):
        of_force = arrays.of_force(kin) + k
        on_water, force, v, _ = forces[k]
        water[n, of_force] = on_water
        nodes.sums[n, of_force] = force
        nodes.sums[n, arrays.of_momentum(kin) + k] = drag.whole * v
    nodes.sums[n, arrays.MASS] = drag.whole


@node_task
class SplitMomentum(NamedTuple):
    """Subtracts mass and momentum of the water from the sums of a node."""

    says = "momentum of the soil"
    goes_through = ("sums", "water sums")

    def at_node(task, kin, nodes, n, dt):
        if not is_wet_node(nodes, kin, n):
            return
        both = nodes.sums[n, arrays.MASS]
        soil = both - field(nodes.fields, WaterSums)[n, arrays.MASS]
        fraction = soil / both
        nodes.sums[n, arrays.MASS] = soil
        for k in range(kin.dimension):
            nodes.sums[n, arrays.of_momentum(kin) + k] *= fraction


@node_task
class ShareForces(NamedTuple):
    """Updates v*; sets force on water and, for fixes, mass and force with dragged water."""

    rim: float | None  # |B| / V of closed nodes; None: all nodes (linear basis)
    surface: float  # |B| / V of nodes at the surface

    says = "forces on soil and water, update v*"
    goes_through = ("sums", "water sums", "water update", "update")

    def at_node(task, kin, nodes, n, dt):
        if is_wet_node(nodes, kin, n):
            close_if_dry(nodes, kin, n)
        share_forces(task, kin, nodes, n, dt)
        at_node(NodalUpdate(), kin, nodes, n, dt)


class Mapped(NamedTuple):
    """The flux follows velocities that points map to the nodes after the move."""


class OfStep(NamedTuple):
    """The flux follows v* and w*; open nodes let water in, too.

    Before `DragWater`, `WaterUpdate` begins with the soil's velocity before the step (d,).
    """


@node_task
class DragWater(NamedTuple):
    """Updates the relative velocity with the soil's velocity change; resets the mass."""

    velocity: arrays.Tag  # Mapped or OfStep

    says = "drag"
    goes_through = ("sums", "update", "water sums", "water update")

    def at_node(task, kin, nodes, n, dt):
        out, d = field(nodes.fields, WaterUpdate), kin.dimension
        if not is_wet_node(nodes, kin, n):
            put_at(out, n, 0, (0,) * (2 * d))
            return
        water = field(nodes.fields, WaterSums)
        m_s, left, taken = row(out, n, 2 * d, (dt, dt, dt))
        both = m_s + water[n, arrays.MASS]
        per_mass, per_whole = 1 / water[n, arrays.MASS], 1 / nodes.sums[n, arrays.MASS]
        out[n, 2 * d] = left
        for k in range(d):
            of_force, of_momentum = arrays.of_force(kin) + k, arrays.of_momentum(kin) + k
            dv = nodes.update[n, arrays.of_change(kin) + k]
            before = nodes.update[n, k] - dv
            # Water next to a fix that holds the soil slips past it unless drag holds it, too.
            beyond = nodes.sums[n, of_momentum] * per_whole - before
            w = water[n, of_momentum] * per_mass + left * beyond
            further = before - out[n, k] if isinstance(task.velocity, OfStep) else real(0, dt)
            by_force = dt * water[n, of_force] * per_mass - dv - further
            new = left * (w + left * further) + taken * by_force
            out[n, k] = new
            out[n, d + k] = new - w
            out[n, 2 * d + 1 + k] = beyond
            water[n, of_force] = 0
            nodes.sums[n, of_momentum] *= both * per_whole
        nodes.sums[n, arrays.MASS] = both


@node_task
class MakeFlux(NamedTuple):
    rim: float | None
    velocity: arrays.Tag  # Mapped or OfStep

    says = "flux of the water"
    goes_through = (
        "sums", "velocity", "water sums", "water update", "water again", "flux",
    )  # fmt: skip

    def at_node(task, kin, nodes, n, dt):
        flux, d = field(nodes.fields, Flux), kin.dimension
        of_step, across = isinstance(task.velocity, OfStep), real(0, dt)
        if not is_wet_node(nodes, kin, n):
            put_at(flux, n, 0, (0,) * (d + 5))
            if field(nodes.fields, GivenFlux) is not None:
                put_at(field(nodes.fields, GivenFlux), n, 0, (0,) * (2 * d + 2))
            return
        water, again = field(nodes.fields, WaterSums), field(nodes.fields, WaterAgain)
        out, of_V, of_area = field(nodes.fields, WaterUpdate), of_volumes(kin), of_pressure(kin) + d
        m = water[n, arrays.MASS]
        pushed, p = _by_pressure(nodes, kin, n, task.rim)
        per_mass, per_volume = 1 / m, inverse_volume(nodes, kin, n)
        if of_step:
            momentum = [m * out[n, k] for k in range(d)]
        else:
            kept = m * out[n, 2 * d]
            momentum = [again[n, k] + kept * out[n, 2 * d + 1 + k] for k in range(d)]
        per_m = per_volume / edge(nodes, kin, n)
        for k in range(d):
            flux[n, k] = momentum[k] * per_m
            across += momentum[k] * per_m * water[n, of_area + k]
        drained = is_open(nodes, n)
        if not of_step:
            enters = field(nodes.fields, GivenPressure)[n, 1] == 1 and across < 0
            drained = drained and not enters
        closed = not drained and _is_rim(nodes, kin, n, task.rim)
        supply = mass_given(nodes, kin, n, True)
        stays = across + supply if closed else supply
        leaves = across + supply if drained else real(0, dt)
        put_at(flux, n, d, (real(0, dt) if drained else stays * per_volume,))
        flux[n, d + 4] = leaves
        if task.rim is not None:  # splines
            columns = of_V + 3, of_unseen(kin), of_unseen(kin) + 1
            put_at(flux, n, d + 1, [water[n, column] * per_volume for column in columns])
        # With the mean relative velocity in the step, the remaining work is the work of weight
        # minus the work of drag, and the work of pressure on water that enters or leaves.
        one = mass_of_flow(nodes, kin, n)
        work = dt * (supply - leaves) * p * water[n, of_V + 1] / one if one > 0 else real(0, dt)
        for k in range(d):
            beyond = out[n, 2 * d + 1 + k]
            dragged = beyond if of_step else out[n, 2 * d] * beyond
            w = 0.5 * ((water[n, arrays.of_momentum(kin) + k] + momentum[k]) * per_mass + dragged)
            dv = nodes.update[n, arrays.of_change(kin) + k] + out[n, d + k]
            work += (w + beyond - dragged) * m * dv - w * dt * pushed[k]
        field(nodes.fields, WorkAtNodes)[n, 0] += work


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
        # The pores follow the mean strain of a cell with a linear basis, so this is not det F.
        drag = per_mass * (state.pores + (1 - law.n)) * drag_per_volume(law, pt.kin, state)
        b = pt.w.kick * drag * (1 + m)  # times the mass m
        unseen = (b / (m + b)) * (new - at_nodes)
        part = m / (1 + m)
        store(pt.of(RelativeVelocity), pt.p, new - unseen)
        store(pt.w.points.v, pt.p, pt.v + part * unseen)
        # Work of this impulse. The nodes' work assumes that the step ends with the new velocity.
        way = dot(unseen, change) - new.squared() + (new - unseen).squared()
        increase(pt.of(WorkOfForces), pt.p, (0.5 * eq.mass(pt) * part * way,))
        return eq.Report(real(0, pt.dt), fastest)


def _volume_rate(node, total, g):
    """Add a node to the gradient with a linear basis, or to the growth of cells."""
    if not len(total):
        return ()
    if isinstance(node.w.basis, Linear):
        return total + outer(node.v, g)
    (growth,) = row(node.of(CellGrowth), node.i, 0, total)
    return (total[0] + cell_fraction(node) * growth,)


class Seep(eq.Task):
    """Gathers the flux before `Strain`; updates water, pores and the water's velocity."""

    says = "inflow and outflow of water"
    reads = ("x", "state", "material", "deformation gradient", "v", "relative velocity")
    writes = ("state", "relative velocity", "volume strain")

    def empty(task, w, x):
        none, tensor = real(0, x[0]), zero(w.kin, x[0])
        spread = none if w.frame.moves else tensor
        if by_cells(w):
            return spread, none, (), tensor if isinstance(w.basis, Linear) else (none,)
        return spread, none, (none,) * 3, ()  # `Strain` gathers the gradient

    def gathered(task, node, total):
        if not isinstance(node.w.laws, Saturated):
            return total
        spread, kept, means, gradient = total
        d, g = node.kin.dimension, pore_grad(node)
        some = row(node.of(Flux), node.i, 0, (*g[:d], kept, *means))
        j, pairs = node.v._make(some[:d]), zip(means, some[d + 1 :], strict=True)
        return (
            spread + (trace(outer(j, g)) if node.w.frame.moves else outer(j, g)),
            kept + pore_N(node) * some[d],
            tuple([mean + node.N * at_node for mean, at_node in pairs]),
            _volume_rate(node, gradient, g),
        )

    def updated(task, pt, total, totals, fastest):
        if not _is_wet(pt):
            return eq.Report(real(0, pt.dt), fastest)
        spread, kept, means, gradient = total
        at_point, (law, old, f) = totals[-1][0], pt.law_state_F
        frame, kin = pt.w.frame, pt.kin
        leaving = spread
        if not frame.moves:
            leaving = trace(spatial_increment(frame, kin, spread, f))
        jacobian, inflow = laws.jacobian(law, kin, old), -pt.dt * (leaving - kept)
        content = old.content + jacobian * inflow

        def growth(gradient):
            return det(I + spatial_increment(frame, kin, increment(pt.dt, gradient), f))

        if isinstance(pt.w.basis, Linear):
            grown = growth(gradient)
        elif are_solved(pt.w.nodes):
            grown, axes = 1 + gradient[0], len(at_point.axes)
            ratio = power(grown / growth(at_point), 1 / axes)
            store(pt.of(VolumeCorrection), pt.p, (axes * (ratio - 1),))
        else:
            grown = growth(at_point)
        # Initial stresses change J but not the pores.
        pores = old.pores + jacobian * (grown - 1)
        if len(means):
            mean, again, mean_recent = means
            strain, unseen, recent = pt.load(VolumeStrain, (mean,) * 3)
            change = real(SMOOTHING, mean) * (again - unseen)
            further = real(SMOOTHING, mean) * (mean_recent - recent)
            pores, content = pores + change * jacobian * grown, content + jacobian * further
            store(pt.of(VolumeCorrection), pt.p, (change,))
            later = strain * (1 - SMOOTHING * law.fades)
            later = later + (grown - 1) + change - (inflow + further) / law.rho
            recent = (1 - SMOOTHING) * recent + inflow
            store(pt.of(VolumeStrain), pt.p, (later, strain - mean, recent))
        new = old._replace(content=content, pores=pores)
        store_from(pt.w.points.state, pt.p, count_in(old.skeleton), new)
        v = pt.v
        ratio = old.content / content  # conserves the momentum of the water
        w = pt.load(RelativeVelocity, v)
        store(pt.of(RelativeVelocity), pt.p, ratio * (v + w) - v)
        good = (content > 0) & (pores > 0)
        return eq.Report(where(good, real(0, content), real(inf, content)), fastest)
