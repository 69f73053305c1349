"""Pore pressure at the end of a step, solved for on the grid (scheme semi-implicit).

The forces of a step include the increment q of the pore pressure in the step, one value per cell
(:mod:`~.pore_cells`). With the gradients G of a cell at its nodes, P = G q is the force of the
increment, and e n P' is the part of it that acts on the water, where P' = P - B q_i at closed nodes
and e is 1 except at edges (:func:`~.pore_water.edge`). The velocity v of the soil and the seepage
velocity s = e n w then change by

    dv = dt (P - f e n P') / W,   dw = f (dt e n P' / m - dv),   ds = e n dw,

with W = m_s + m (1 - f), and dv = 0 where a fix holds the node. The pressure of the law after the
step has the same increment if, for each cell,

    V^2 / (sum V K / n) q / dt + G^T v + G'^T s = supply.

The matrix, C / dt + G^T R G, is symmetric and positive definite. Each cell stores the entries for
lower neighbours. Conjugate gradients are preconditioned by an incomplete Cholesky factorisation,
which changes only the diagonal: it adds most of the neglected entries (Gustafsson 1978), and all
positive ones, which make the factorisation useless in 3D otherwise.

After Kularathna, Liang, Zhao, Chandra, Zhao & Soga 2021, "A semi-implicit material point method
based on fractional-step method for saturated soil", but the first velocity includes the pressure of
the previous step, and both use the new drag.
"""

from math import nan
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import kernel, noinline, real
from karamelo_py.compiler.fields import StepField, field, numbers
from karamelo_py.compiler.tuples import flat, record
from karamelo_py.kernels import arrays
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.clock import NOT_SOLVED, step_size
from karamelo_py.kernels.equations import pore_water as pores
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.kernels.equations.pore_cells import (
    AREA,
    STIFF,
    VOLUME,
    CellGrowth,
    CellSums,
    cell_fraction,
    radius_of,
)
from karamelo_py.kernels.records import put_at
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.product import digits
from karamelo_py.points.grid import Grid
from karamelo_py.points.kinematics import product
from karamelo_py.points.kinematics import total as sum_of
from karamelo_py.points.laws.pore_water import pore_stiffness

ACCURACY = 1e-5  # residual / first residual
MOST = 4  # iterations / number of unknowns, at most
KEPT = 0.97  # part of the neglected entries that is added to the diagonal of the preconditioner
LEAST = 0.25  # least diagonal of the preconditioner / diagonal of the matrix

# Columns of `CellPressures`: increment, residual, direction, product of matrix and direction;
# diagonal, inverse diagonal of the preconditioner; preconditioned residual, scratch sum; number of
# the step if the cell has water, growth of second order; entries of lower neighbours, by `_rank`.
X, RESIDUAL, WAY, PRODUCT, DIAGONAL, INVERSE, AHEAD, SCRATCH, STEP, GROWTH, LOWER = range(11)
# Columns of `NodeResponse`: vectors, then numbers.
V_, S_, P_, MOBILE = range(4)  # times the dimension
FN, N, SEEPS, CLOSED, SUM, STAYS = range(6)  # after 4 d columns


def _count_below(d):
    """Return the number of neighbours whose number is lower than the cell's."""
    return (3**d - 1) // 2


def _rank(way):
    """Return the index of a direction (-1, 0, 1 per axis); lower cells come first."""
    rank = 0
    for k in way:
        rank = 3 * rank + k + 1
    return rank


def _of_pressures(kin):
    return LOWER + _count_below(kin.dimension)


class CellPressures(StepField):
    """Equation of a cell and its solution, at the first node of the cell."""

    shape = staticmethod(_of_pressures)


class NodeResponse(StepField):
    """Velocity v and seepage velocity s (d,), force P of increments (d,), dt / W (d,) or 0.

    Further columns: f n, n, dt f / m; 1 / V of closed nodes, else 0; sum of V q; rate that a closed
    node retains.
    """

    shape = numbers(6, 4)


@eq.reads("mass", "state", "material", "deformation gradient", "v", "relative velocity")
def cell(pt):
    """Return the terms of a point in the sums of its cell, or () if dry."""
    seen = pores.pores(pt)
    if not len(seen):
        return ()
    law, state = pt.law_and_state
    V, area, d = seen.volumes[0], seen.area.at(), pt.kin.dimension
    around = [sum_of([area[i, i] for i in range(d, d + pt.kin.hoops)])] if pt.kin.hoops else []
    return (V, V * pore_stiffness(law, pt.kin, state), *flat(seen.area.columns()), *around)


def of_cell(pt, node):
    if not len(pt.cell):
        return ()
    if isinstance(node.w.basis, Linear):
        return pt.cell if node.k == 0 else ()
    fraction = cell_fraction(node)
    return tuple([fraction * number for number in pt.cell])


class SumsOfCells(eq.ExtensiveQuantity):
    says = "volumes of cells"
    takes = eq.of_point(cell=cell)
    gives = (eq.Sum(eq.whole(CellSums), of_cell),)


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

    rim: float | None
    surface: float

    says = "velocities before the pressure changes"
    goes_through = (
        "sums", "velocity", "water sums", "water update", "node response", "cell pressures",
    )  # fmt: skip

    def at_node(task, kin, nodes, n, dt):
        out, d = field(nodes.fields, NodeResponse), kin.dimension
        put_at(field(nodes.fields, CellPressures), n, 0, (real(0, dt),) * _of_pressures(kin))
        put_at(out, n, 0, (real(0, dt),) * (4 * d + 6))
        if not pores.is_wet_node(nodes, kin, n):
            return
        water, update = field(nodes.fields, pores.WaterSums), field(nodes.fields, pores.WaterUpdate)
        pores.close_if_dry(nodes, kin, n)
        drag, forces = pores.forces_at(task, kin, nodes, n, dt)
        m, of_V = water[n, arrays.MASS], pores.of_volumes(kin)
        per_mass, per_volume = 1 / m, pores.inverse_volume(nodes, kin, n)
        share = water[n, of_V + 1] * per_volume * pores.edge(nodes, kin, n)
        across = real(0, dt)
        for k in range(d):
            on_water, force, v, w = forces[k]
            held = nodes.velocity[n, k]
            new = held if held == held else v + dt * force / drag.whole
            before = held if held == held else v
            by_force = dt * on_water * per_mass - (new - before)
            w = drag.left * (w + drag.left * (v - before)) + drag.taken * by_force
            update[n, k] = before  # for `DragWater`
            out[n, V_ * d + k] = new
            out[n, S_ * d + k] = share * w
            out[n, MOBILE * d + k] = real(0, dt) if held == held else dt / drag.whole
            across += share * w * water[n, pores.of_pressure(kin) + d + k]
        is_open = pores.is_open(nodes, n)
        closed = real(0, dt) if is_open else per_volume
        supply = real(0, dt) if is_open else pores.mass_given(nodes, kin, n, False)
        if supply != 0:
            supply *= water[n, of_V + 1] / pores.mass_of_flow(nodes, kin, n) * per_volume
        numbers = (drag.taken * share, share, dt * drag.taken * per_mass)
        put_at(out, n, 4 * d, (*numbers, closed, real(0, dt), closed * across + supply))


class System(NamedTuple):
    """Arrays of the linear system; its type selects the kernel."""

    kin: arrays.Tag
    grids: Grid
    spans: np.ndarray
    sums: np.ndarray  # of the water
    cells: np.ndarray
    pressures: np.ndarray
    nodes: np.ndarray
    before: np.ndarray  # velocities of the soil before the step or, for `grow`, after it (n, d)
    dt: float
    step: float


def _steps(kin, grid):
    return (grid.step_x, grid.step_y, 1)[: kin.dimension]


def _offset(steps, way):
    total = 0
    for k, step in zip(way, steps, strict=True):
        if k:
            total = total + step if k > 0 else total - step
    return total


class CornerOfCell(NamedTuple):
    way: list  # 0 or 1 per direction
    offset: int  # from the first node of the cell
    slopes: list  # gradient at the centre
    grid: Grid


def _corners(kin, grid):
    d = kin.dimension
    steps, slope = _steps(kin, grid), 0.5 ** (d - 1) * grid.inv_h
    corners = []
    for k in range(2**d):
        way = digits(k, 2, d)
        slopes = [slope if far else -slope for far in way]
        corners.append(CornerOfCell(way, _offset(steps, way), slopes, grid))
    return corners


def _below(kin, grid):
    steps = _steps(kin, grid)
    d = kin.dimension
    ways = [[k - 1 for k in digits(rank, 3, d)] for rank in range(_count_below(d))]
    return [_offset(steps, way) for way in ways]


def _in_plane(system, c, corner):
    """Return the force (d,) at a corner due to a unit increment in cell `c`, without hoops."""
    d, cells = system.kin.dimension, system.cells
    force = []
    for k in range(d):
        total = 0.0
        for j in range(d):
            total = total + cells[c, AREA + j * d + k] * corner.slopes[j]
        force.append(total)
    return force


def _of_hoops(system, c, corner):
    d, grid = system.kin.dimension, corner.grid
    r = radius_of(grid, (c - grid.first) // grid.step_x)
    return 0.5**d * system.cells[c, AREA + d * d] / r


def _row(system, c, corner):
    """Return the force (d,) at a corner due to a unit increment in cell `c`."""
    force, grid = _in_plane(system, c, corner), corner.grid
    if not system.kin.hoops:
        return force
    on_axis = abs(grid.x0) <= grid.slack * grid.h and c - grid.first < grid.step_x
    radial = force[0] + _of_hoops(system, c, corner)
    return [0.0 if corner.way[0] == 0 and on_axis else radial, *force[1:]]


def _grid_of(grids, n):
    g = 0
    while g + 1 < grids.first.size and n >= grids.first[g + 1]:
        g += 1
    return record(grids, g)


def _growth(d, H):
    """Return det(I + H) - 1 - tr H."""
    if d == 1:
        return 0.0
    plane = H[0][0] * H[1][1] - H[0][1] * H[1][0]
    if d == 2:
        return plane
    first = H[1][1] * H[2][2] - H[1][2] * H[2][1]
    second = H[0][0] * H[2][2] - H[0][2] * H[2][0]
    volume = H[0][1] * (H[1][2] * H[2][0] - H[1][0] * H[2][2])
    volume += H[0][2] * (H[1][0] * H[2][1] - H[1][1] * H[2][0])
    return plane + first + second + H[0][0] * first + volume


def _outflow(system, c, corners):
    """Return the volume per time that leaves cell `c`, from the velocities at its nodes.

    A rotation by w dt makes volumes grow by (w dt)^2, which is a large pressure if K/n is 5 GPa.
    This term uses the velocities before the step, since predicted velocities contain noise that
    breaks soft soil.
    """
    nodes, d, V = system.nodes, system.kin.dimension, system.cells[c, VOLUME]
    flow, stays = 0.0, 0.0
    for corner in corners:
        n, force = c + corner.offset, _row(system, c, corner)
        for k in range(d):
            flow += force[k] * (nodes[n, V_ * d + k] + nodes[n, S_ * d + k])
        stays += nodes[n, 4 * d + STAYS]
    growth = _second_order(system, c, corners)
    system.pressures[c, GROWTH] = growth
    return flow + V / system.dt * growth - 0.5**d * V * stays


def _second_order(system, c, corners):
    """Return the growth of a cell's volume beyond the trace of the increment."""
    d, per_volume = system.kin.dimension, system.dt / system.cells[c, VOLUME]
    seen = [(c + corner.offset, corner, _in_plane(system, c, corner)) for corner in corners]
    H = [
        [per_volume * sum_of([f[k] * system.before[n, i] for n, _, f in seen]) for k in range(d)]
        for i in range(d)
    ]
    growth, hoops = _growth(d, H), system.kin.hoops
    if hoops:
        rates = [_of_hoops(system, c, corner) * system.before[n, 0] for n, corner, _ in seen]
        around = per_volume / hoops * sum_of(rates)
        in_plane = 1 + growth + sum_of([H[k][k] for k in range(d)])
        growth = growth + in_plane * (product([1 + around] * hoops) - 1) - hoops * around
    return growth


@noinline
def _begin(system):
    """Set residuals, and the first part of the diagonal: the compressibility of the water."""
    pressures, cells = system.pressures, system.cells
    for r in range(1, 1 + system.spans[0, 0]):
        corners = _corners(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            V = cells[c, VOLUME]
            if V > 0:
                pressures[c, STEP] = system.step
                pressures[c, RESIDUAL] = -_outflow(system, c, corners)
                pressures[c, DIAGONAL] = V * V / (cells[c, STIFF] * system.dt)


def _seen(system, n, corner):
    """Return a cell at node `n`, 1 if it has water (else 0), and its forces on soil and water."""
    nodes, d, cells = system.nodes, system.kin.dimension, system.cells
    wet = 0.0
    c = n - corner.offset
    if c < 0:
        c = 0
    elif system.pressures[c, STEP] == system.step:
        wet = 1.0
    mean = 0.5**d * cells[c, VOLUME] * nodes[n, 4 * d + CLOSED]
    area, fn = pores.of_pressure(system.kin) + d, nodes[n, 4 * d + FN]
    force = _row(system, c, corner)
    on_water = [wet * (force[k] - system.sums[n, area + k] * mean) for k in range(d)]
    return c, wet, [wet * force[k] - fn * on_water[k] for k in range(d)], on_water


def _entry(system, n, a, b):
    nodes, d, total = system.nodes, system.kin.dimension, 0.0
    share = nodes[n, 4 * d + N]
    water = share * share * nodes[n, 4 * d + SEEPS]
    for k in range(d):
        total = total + nodes[n, MOBILE * d + k] * a[2][k] * b[2][k] + water * a[3][k] * b[3][k]
    return total


@noinline
def _assemble(system):
    """Add the responses of the nodes to the matrix."""
    pressures, below = system.pressures, _count_below(system.kin.dimension)
    for r in range(1, 1 + system.spans[0, 0]):
        corners = _corners(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for n in range(system.spans[r, 0], system.spans[r, 1]):
            seen = [_seen(system, n, corner) for corner in corners]
            for k, one in enumerate(corners):
                a = seen[k]
                if a[1] > 0:
                    pressures[a[0], DIAGONAL] += _entry(system, n, a, a)
                for j, other in enumerate(corners):
                    rank = _rank([x - y for x, y in zip(one.way, other.way, strict=True)])
                    if rank < below:
                        b = seen[j]
                        if a[1] * b[1] > 0:
                            at = LOWER + rank
                            pressures[a[0], at] += _entry(system, n, a, b)


@noinline
def _factor(system):
    """Set the inverse diagonal of the preconditioner."""
    pressures, count = system.pressures, _count_below(system.kin.dimension)
    for r in range(1, 1 + system.spans[0, 0]):
        below = _below(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            for k in range(count):
                entry = pressures[c, LOWER + k]
                if entry < 0:
                    pressures[c + below[k], SCRATCH] += entry
                elif entry > 0:
                    pressures[c, INVERSE] += entry
                    pressures[c + below[k], INVERSE] += entry
    for r in range(1, 1 + system.spans[0, 0]):
        below = _below(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            if system.cells[c, VOLUME] > 0:
                whole = pressures[c, DIAGONAL] + pressures[c, INVERSE]
                left = whole
                for k in range(count):
                    entry = pressures[c, LOWER + k]
                    if entry < 0:
                        other = c + below[k]
                        lost = entry + KEPT * (pressures[other, SCRATCH] - entry)
                        left -= entry * lost * pressures[other, INVERSE]
                if left < LEAST * whole:
                    left = whole
                pressures[c, INVERSE] = 1 / left


@noinline
def _precondition(system):
    """Set the preconditioned residual; return its product with the residual."""
    pressures, count, result = system.pressures, _count_below(system.kin.dimension), 0.0
    for r in range(1, 1 + system.spans[0, 0]):
        below = _below(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            if system.cells[c, VOLUME] > 0:
                rest = pressures[c, RESIDUAL]
                for k in range(count):
                    entry = pressures[c, LOWER + k]
                    if entry < 0:
                        rest -= entry * pressures[c + below[k], AHEAD]
                pressures[c, AHEAD] = rest * pressures[c, INVERSE]
                pressures[c, SCRATCH] = 0.0
    for back in range(system.spans[0, 0]):
        r = system.spans[0, 0] - back
        below = _below(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        first, last = system.spans[r, 0], system.spans[r, 1]
        for step in range(last - first):
            c = last - 1 - step
            if system.cells[c, VOLUME] > 0:
                ahead = pressures[c, AHEAD] - pressures[c, SCRATCH] * pressures[c, INVERSE]
                pressures[c, AHEAD] = ahead
                result += ahead * pressures[c, RESIDUAL]
                for k in range(count):
                    entry = pressures[c, LOWER + k]
                    if entry < 0:
                        pressures[c + below[k], SCRATCH] += entry * ahead
    return result


@noinline
def _multiply(system, share):
    """Update the direction and its product with the matrix; return their scalar product."""
    pressures, count, result = system.pressures, _count_below(system.kin.dimension), 0.0
    for r in range(1, 1 + system.spans[0, 0]):
        below = _below(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            if system.cells[c, VOLUME] > 0:
                way = pressures[c, AHEAD] + share * pressures[c, WAY]
                pressures[c, WAY] = way
                total = pressures[c, DIAGONAL] * way
                product_above = 0.0
                for k in range(count):
                    entry = pressures[c, LOWER + k]
                    if entry != 0:
                        other = c + below[k]
                        product_above += entry * pressures[other, WAY]
                        pressures[other, PRODUCT] += entry * way
                pressures[c, PRODUCT] = total + product_above
                # entries above the diagonal contribute as much as those below
                result += way * (total + 2 * product_above)
    return result


@noinline
def _correct(system, length):
    """Correct increments along the direction; return the number of unknowns."""
    pressures, count = system.pressures, 0
    for r in range(1, 1 + system.spans[0, 0]):
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            if system.cells[c, VOLUME] > 0:
                pressures[c, X] += length * pressures[c, WAY]
                pressures[c, RESIDUAL] -= length * pressures[c, PRODUCT]
                count += 1
    return count


@noinline
def _scatter(system):
    """Add the forces of increments, and volume times increment, to the nodes."""
    nodes, d = system.nodes, system.kin.dimension
    for r in range(1, 1 + system.spans[0, 0]):
        corners = _corners(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            V = system.cells[c, VOLUME]
            if V > 0:
                q = system.pressures[c, X]
                for corner in corners:
                    n, force = c + corner.offset, _row(system, c, corner)
                    for k in range(d):
                        nodes[n, P_ * d + k] += q * force[k]
                    nodes[n, 4 * d + SUM] += 0.5**d * V * q


@kernel
def _solve(system):
    """Solve for the increments; return False if the residual remains too large."""
    _begin(system)
    _assemble(system)
    _factor(system)
    size = _precondition(system)
    goal = ACCURACY * ACCURACY * size
    share = 0.0
    number, most = 0, 1
    while size > goal and number < most:
        most = MOST * _correct(system, size / _multiply(system, share)) + 10
        before = size
        size = _precondition(system)
        share = size / before
        number += 1
    _scatter(system)
    # NaN in the first residual is reported with the velocities of points.
    return size <= goal or goal != goal


def _system(s, velocities):
    kinds = pores.WaterSums, CellSums, CellPressures, NodeResponse
    of_fields = [field(s.nodes.fields, kind) for kind in kinds]
    step = s.control.values[arrays.TIMESTEP] + 1
    return System(s.kin, s.grids, s.spans, *of_fields, velocities, step_size(s), step)


def solve(s):
    """Add the forces of the increments of pressure to `NodeResponse`; return False on failure."""
    solved = _solve(_system(s, field(s.nodes.fields, pores.WaterUpdate)))
    if not solved:
        s.control.motion[0].wrong = NOT_SOLVED
    return solved


@kernel
def _grow(system, growth):
    for r in range(1, 1 + system.spans[0, 0]):
        corners = _corners(system.kin, _grid_of(system.grids, system.spans[r, 0]))
        for c in range(system.spans[r, 0], system.spans[r, 1]):
            V, total = system.cells[c, VOLUME], 0.0
            if V > 0:
                for corner in corners:
                    force = _row(system, c, corner)
                    for k in range(system.kin.dimension):
                        total += force[k] * system.before[c + corner.offset, k]
                total = system.dt / V * total + system.pressures[c, GROWTH]
            growth[c, 0] = total


def grow(s):
    """Set `CellGrowth` by the velocities of the step."""
    growth = field(s.nodes.fields, CellGrowth)
    if growth is not None:
        _grow(_system(s, s.nodes.velocity), growth)


@node_task
class AddPressure(NamedTuple):
    """Adds the increment to the force and the mean of the pressure; sets the forces for fixes."""

    rim: float | None
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
