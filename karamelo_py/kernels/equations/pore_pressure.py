"""Pore pressure at the end of a step, solved for on the grid (scheme semi-implicit).

The forces of a step include the increment q of the pore pressure in the step, one value per cell
(linear basis). With the gradients G of a cell at its nodes, P = G q is the force of the increment,
and n P' is the part of it that acts on the water, where P' = P - B q_i at closed nodes
(:mod:`~.pore_water`). The velocity v of the soil and the seepage velocity s = n w then change by

    dv = dt (P - f n P') / W,   dw = f (dt n P' / m - dv),   ds = n dw,

with W = m_s + m (1 - f), and dv = 0 where a fix holds the node. The pressure of the law after the
step has the same increment if, for each cell,

    V^2 / (sum V K / n) q / dt + G^T v + G'^T s = supply.

This matrix, C / dt + G^T R G, is symmetric and positive definite; it is not stored. The conjugate
gradients are preconditioned with its diagonal. One pressure per cell needs no further unknowns at
open boundaries, where the prescribed pressure is in P. After Kularathna, Liang, Zhao, Chandra,
Zhao & Soga 2021, "A semi-implicit material point method based on fractional-step method for
saturated soil", with the pressure of the previous step in the first velocity, and drag at its new
value in both.
"""

from math import nan
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import kernel, noinline, real
from karamelo_py.compiler.fields import StepField, SummedField, field, numbers
from karamelo_py.compiler.tuples import flat, record
from karamelo_py.kernels import arrays
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.clock import kick, step_size
from karamelo_py.kernels.equations import pore_water as pores
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.kernels.records import put_at
from karamelo_py.points import laws
from karamelo_py.points.basis.product import digits
from karamelo_py.points.grid import Grid
from karamelo_py.points.laws.pore_water import pore_stiffness

ACCURACY = 1e-8  # residual / first residual
MOST = 4  # iterations / number of unknowns, at most

# Columns of `CellSums`: volume; its product with K / n; columns of the volume as a stress.
VOLUME, STIFF, AREA = 0, 1, 2
# Columns of `CellPressures`: increment, residual, direction, product of matrix and direction, and
# diagonal of the matrix.
X, RESIDUAL, WAY, PRODUCT, DIAGONAL = range(5)


def _of_cells(kin):
    return AREA + kin.dimension**2


class CellSums(SummedField):
    """Sums over the points of a cell, at its first node."""

    shape = staticmethod(_of_cells)


class CellPressures(StepField):
    """Conjugate gradients, at the first node of a cell."""

    shape = numbers(5)


class NodeResponse(StepField):
    """Velocity v and seepage velocity s (d,) of an increment, its force P (d,), dt / W (d,) or 0.

    Then f n, n, dt f / m; 1 / V of closed nodes, else 0; sum of V q; what stays at a closed node.
    """

    shape = numbers(6, 4)


V_, S_, P_, MOBILE = range(4)  # times the dimension: first columns of vectors in `NodeResponse`
FN, N, SEEPS, CLOSED, SUM, STAYS = range(6)  # columns after them


@eq.reads("mass", "state", "material", "deformation gradient", "v", "relative velocity")
def cell(pt):
    """Return what a point gives to its cell, or () if dry."""
    seen = pores.pores(pt)
    if not len(seen):
        return ()
    law, state = pt.law_and_state
    V = seen.volumes[0]
    return (V, V * pore_stiffness(law, pt.kin, state), *flat(seen.area.columns()))


class SumsOfCells(eq.NodalQuantity):
    says = "volumes of cells"
    takes = eq.of_point(cell=cell)
    gives = (
        eq.Sum(
            eq.whole(CellSums),
            lambda pt, node: pt.cell if node.k == 0 and len(pt.cell) else (),
        ),
    )


@node_task
class ForgetVelocity(NamedTuple):
    """Sets the velocity to NaN, so that fixes show which components they hold."""

    goes_through = ("velocity",)

    def at_node(task, kin, nodes, n, dt):
        for k in range(kin.dimension):
            nodes.velocity[n, k] = real(nan, dt)


@node_task
class Foresee(NamedTuple):
    """Computes the velocities that a step would have with the pressure at its beginning."""

    rim: float
    surface: float

    says = "velocities before the pressure changes"
    goes_through = ("sums", "velocity", "water sums", "node response", "cell pressures")

    def at_node(task, kin, nodes, n, dt):
        out, d = field(nodes.fields, NodeResponse), kin.dimension
        put_at(field(nodes.fields, CellPressures), n, 0, (real(0, dt),) * 5)
        put_at(out, n, 0, (real(0, dt),) * (4 * d + 6))
        if not pores.is_wet_node(nodes, kin, n):
            return
        water = field(nodes.fields, pores.WaterSums)
        pores.close_if_dry(nodes, kin, n)
        drag, forces = pores.forces_at(task, kin, nodes, n, dt)
        m, V, of_V = water[n, arrays.MASS], water[n, pores.of_volumes(kin)], pores.of_volumes(kin)
        per_mass, per_volume, share = 1 / m, 1 / V, water[n, of_V + 1] / V
        across = real(0, dt)
        for k in range(d):
            on_water, force, v, w = forces[k]
            held = nodes.velocity[n, k]
            new = held if held == held else v + dt * force / drag.whole
            w = drag.left * w + drag.taken * (dt * on_water * per_mass - (new - v))
            out[n, V_ * d + k] = new
            out[n, S_ * d + k] = share * w
            out[n, MOBILE * d + k] = real(0, dt) if held == held else dt / drag.whole
            across += share * w * water[n, pores.of_pressure(kin) + d + k]
        is_open = pores.is_open(nodes, n)
        closed = real(0, dt) if is_open else per_volume
        supply = real(0, dt) if is_open else pores.supply_at(nodes, kin, n)
        supply *= water[n, of_V + 1] * per_mass * per_volume
        numbers = (drag.taken * share, share, dt * drag.taken * per_mass)
        put_at(out, n, 4 * d, (*numbers, closed, real(0, dt), closed * across + supply))


class System(NamedTuple):
    """Arrays of a solution; its type selects the kernel."""

    kin: arrays.Tag
    grids: Grid
    spans: np.ndarray
    sums: np.ndarray  # of the water
    cells: np.ndarray
    pressures: np.ndarray
    nodes: np.ndarray
    dt: float
    kick: float


def _corners(kin, grid):
    """List a cell's nodes: offset from the first node, and gradient at the centre."""
    d = kin.dimension
    steps = (grid.step_x, grid.step_y, 1)[:d]
    slope = 0.5 ** (d - 1) * grid.inv_h
    corners = []
    for k in range(2**d):
        ways = digits(k, 2, d)
        offset = 0
        for way, step in zip(ways, steps, strict=True):
            offset = offset + step if way else offset
        corners.append((offset, [slope if way else -slope for way in ways]))
    return corners


def _row(system, c, slopes):
    """Return the force (d,) at a corner of a unit increment in cell `c`."""
    d, cells = system.kin.dimension, system.cells
    force = []
    for k in range(d):
        total = 0.0
        for j in range(d):
            total = total + cells[c, AREA + j * d + k] * slopes[j]
        force.append(total)
    return force


def _grid_of(grids, n):
    g = 0
    while g + 1 < grids.first.size and n >= grids.first[g + 1]:
        g += 1
    return record(grids, g)


@noinline
def _scatter(system, column):
    """Add the forces of increments, and volume times increment, to the nodes."""
    kin, nodes, d = system.kin, system.nodes, system.kin.dimension
    for r in range(1, 1 + system.spans[0, 0]):
        corners = _corners(kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            V = system.cells[c, VOLUME]
            if V > 0:
                q = system.pressures[c, column]
                for offset, slopes in corners:
                    force = _row(system, c, slopes)
                    for k in range(d):
                        nodes[c + offset, P_ * d + k] += q * force[k]
                    nodes[c + offset, 4 * d + SUM] += 0.5**d * V * q


@noinline
def _respond(system):
    """Set the velocities that follow from the forces, which become 0."""
    kin, nodes, d = system.kin, system.nodes, system.kin.dimension
    area = pores.of_pressure(kin) + d
    for r in range(1, 1 + system.spans[0, 0]):
        for n in range(system.spans[r, 0], system.spans[r, 1]):
            fn, share = nodes[n, 4 * d + FN], nodes[n, 4 * d + N]
            seeps, closed = nodes[n, 4 * d + SEEPS], nodes[n, 4 * d + CLOSED]
            mean, across = closed * nodes[n, 4 * d + SUM], 0.0
            for k in range(d):
                whole, B = nodes[n, P_ * d + k], system.sums[n, area + k]
                inner = whole - B * mean
                dv = nodes[n, MOBILE * d + k] * (whole - fn * inner)
                s = share * share * seeps * inner - fn * dv
                nodes[n, V_ * d + k], nodes[n, S_ * d + k] = dv, s
                nodes[n, P_ * d + k] = 0.0
                across += s * B
            nodes[n, 4 * d + SUM] = 0.0
            nodes[n, 4 * d + STAYS] = closed * across


def _outflow(system, c, corners):
    """Return the rate of volume that leaves cell `c` by the velocities at its nodes."""
    nodes, d = system.nodes, system.kin.dimension
    total, stays = 0.0, 0.0
    for offset, slopes in corners:
        n, force = c + offset, _row(system, c, slopes)
        for k in range(d):
            total += force[k] * (nodes[n, V_ * d + k] + nodes[n, S_ * d + k])
        stays += nodes[n, 4 * d + STAYS]
    return total - 0.5**d * system.cells[c, VOLUME] * stays


@noinline
def _multiply(system):
    """Multiply the matrix by the direction; return direction times product."""
    cells, pressures, result = system.cells, system.pressures, 0.0
    _scatter(system, WAY)
    _respond(system)
    for r in range(1, 1 + system.spans[0, 0]):
        corners = _corners(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            V = cells[c, VOLUME]
            if V > 0:
                way = pressures[c, WAY]
                held = V * V / (cells[c, STIFF] * system.dt)
                product = held * way + _outflow(system, c, corners)
                pressures[c, PRODUCT] = product
                result += way * product
    return result


def _diagonal(system, c, corners):
    nodes, d = system.nodes, system.kin.dimension
    area, V = pores.of_pressure(system.kin) + d, system.cells[c, VOLUME]
    total = V * V / (system.cells[c, STIFF] * system.dt)
    for offset, slopes in corners:
        n, force = c + offset, _row(system, c, slopes)
        fn, share = nodes[n, 4 * d + FN], nodes[n, 4 * d + N]
        mean = 0.5**d * V * nodes[n, 4 * d + CLOSED]
        for k in range(d):
            inner = force[k] - system.sums[n, area + k] * mean
            on_soil = force[k] - fn * inner
            total += nodes[n, MOBILE * d + k] * on_soil * on_soil
            total += share * share * nodes[n, 4 * d + SEEPS] * inner * inner
    return total


@noinline
def _begin(system):
    """Set residual, direction and diagonal; return residual times preconditioned residual."""
    pressures, result = system.pressures, 0.0
    for r in range(1, 1 + system.spans[0, 0]):
        corners = _corners(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            if system.cells[c, VOLUME] > 0:
                residual, diagonal = -_outflow(system, c, corners), _diagonal(system, c, corners)
                pressures[c, RESIDUAL], pressures[c, DIAGONAL] = residual, diagonal
                pressures[c, WAY] = residual / diagonal
                result += residual * residual / diagonal
    return result


@noinline
def _correct(system, length):
    """Go along the direction; return residual times preconditioned residual, and the unknowns."""
    pressures, result, count = system.pressures, 0.0, 0
    for r in range(1, 1 + system.spans[0, 0]):
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            if system.cells[c, VOLUME] > 0:
                pressures[c, X] += length * pressures[c, WAY]
                residual = pressures[c, RESIDUAL] - length * pressures[c, PRODUCT]
                pressures[c, RESIDUAL] = residual
                result += residual * residual / pressures[c, DIAGONAL]
                count += 1
    return result, count


@noinline
def _turn(system, share):
    pressures = system.pressures
    for r in range(1, 1 + system.spans[0, 0]):
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            if system.cells[c, VOLUME] > 0:
                ahead = pressures[c, RESIDUAL] / pressures[c, DIAGONAL]
                pressures[c, WAY] = ahead + share * pressures[c, WAY]


@kernel
def _solve(system):
    first = _begin(system)
    size = first
    number = 0
    most = 1
    while size > ACCURACY * ACCURACY * first and number < most:
        length = size / _multiply(system)
        before = size
        size, count = _correct(system, length)
        most = MOST * count + 10
        number += 1
        _turn(system, size / before)
    _scatter(system, X)


def solve(s):
    """Add the pressure of the end of the step to the sums at the nodes."""
    fields = s.nodes.fields
    _solve(
        System(
            s.kin, s.grids, s.spans, field(fields, pores.WaterSums), field(fields, CellSums),
            field(fields, CellPressures), field(fields, NodeResponse), step_size(s), kick(s),
        )  # fmt: skip
    )


@node_task
class AddPressure(NamedTuple):
    """Adds the increment to the pressure force and the mean pressure, and shares the forces."""

    rim: float
    surface: float

    says = "forces on soil and water with the new pressure"
    goes_through = ("sums", "water sums", "water update", "node response")

    def at_node(task, kin, nodes, n, dt):
        water, d = field(nodes.fields, pores.WaterSums), kin.dimension
        seen = field(nodes.fields, NodeResponse)
        for k in range(d):
            water[n, pores.of_pressure(kin) + k] += seen[n, P_ * d + k]
        water[n, pores.of_volumes(kin) + 2] += seen[n, 4 * d + SUM]
        pores.share_forces(task, kin, nodes, n, dt)
