"""Output quantities computed from the state of points."""

from collections.abc import Callable
from typing import Any

from karamelo_py.compiler import at_hand, index, kernel, where
from karamelo_py.compiler.fields import load, store
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.records import put_at
from karamelo_py.kernels.views import deformation_of, location_at, state_at
from karamelo_py.points import laws as law_functions
from karamelo_py.points.basis import entry, locate, reach, support
from karamelo_py.points.kinematics import outer, planar, zero

STRAIN, JACOBIAN, ENERGY = 6, 12, 13
EXPORTED = 14  # columns: stress, elastic strain (6 each), det F, stored energy


@kernel
def export_state(matter, out):
    kin, points, laws = at_hand(matter)
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        put_at(out, p, 0, law_functions.cauchy_stress(law, kin, state))
        put_at(out, p, STRAIN, law_functions.elastic_strain(law, kin, state))
        out[p, JACOBIAN] = law_functions.jacobian(law, kin, state)
        volume = points.mass[p] * law_functions.specific_volume(law)
        out[p, ENERGY] = volume * law_functions.energy_density(law, kin, state)


@kernel
def export(quantity, times_volume, matter, out):
    """Fill ``out`` (n,) with a column, times reference volume if ``times_volume``."""
    kin, points, laws = at_hand(matter)
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        number = law_functions.shown(quantity, law, kin, state)
        out[p] = (
            points.mass[p] * law_functions.specific_volume(law) * number if times_volume else number
        )


def imposing(change: Callable) -> Any:
    """Make a kernel that sets points' states to ``change(law, kin, state, value)``.

    The kernel takes a `Matter`, the rows of the points, and a value for each point.
    """

    @kernel
    def impose(matter, rows, values):
        kin, points, laws = at_hand(matter)
        for k in range(rows.size):
            p = index(rows[k])
            law, state = state_at(kin, points, laws, p)
            store(points.state, p, change(law, kin, state, values[k]))

    return impose


def _with_some_stress(law, kin, state, wanted):
    old = law_functions.cauchy_stress(law, kin, state)
    new = [where(wanted[len(old) + c] > 0, wanted[c], x) for c, x in enumerate(old)]
    return law_functions.with_stress(law, kin, state, tuple(new))


# Values: components of Cauchy stress, then for each component 1 to set it, else 0.
impose_stress = imposing(_with_some_stress)
impose_temperature = imposing(law_functions.with_temperature)
impose_lighting = imposing(law_functions.lit)  # values: time since lighting


@kernel
def export_to_nodes(at, values, unit, out):
    """Add sum N value of the points to ``out`` (nodes, 2); ``values`` (n,) are at most 2^36 units.

    The first column is a multiple of `unit`, the second the remainder as a multiple of a unit 2^36
    times smaller. Both sums are exact in any order for up to 2^17 points per node.
    """
    basis, kin, grids, grid_of, where = at_hand(at)
    whole, fine = 1.5 * 2.0**52 * unit, 1.5 * 2.0**16 * unit
    for p in range(values.size):
        grid = record(grids, index(grid_of[p]))
        stencil = locate(basis, kin, grid, location_at(basis, kin, where, p))
        for k in range(support(basis, kin)):
            node_weight = entry(basis, kin, grid, stencil, k)
            n, value = index(node_weight[0]), node_weight[1] * values[p]
            units = (value + whole) - whole
            out[n, 0] += units
            out[n, 1] += ((value - units) + fine) - fine


@kernel
def export_velocity_moment(at, gradients, out):
    """Fill ``out`` (d d, n) with sum N v (X - x) of velocities with these gradients."""
    basis, kin, grids, grid_of, where = at_hand(at)
    flat = planar(kin)
    for p in range(out.shape[1]):
        grid = record(grids, index(grid_of[p]))
        position = location_at(basis, kin, where, p)
        stencil = locate(basis, kin, grid, position)
        total = zero(flat, position[0])
        gradient = load(gradients, p, total)
        for k in range(support(basis, kin)):
            weight = entry(basis, kin, grid, stencil, k)[1]
            arm = reach(basis, kin, grid, stencil, k)
            total = total + outer(weight * (gradient @ arm), arm)
        store(out, p, total)


@kernel
def move_moments(frame, kin, points, laws, moments):
    """Convert moments (d d, n) of velocity from reference to present positions: M F^T."""
    points, laws = at_hand(points), at_hand(laws)
    flat = planar(kin)
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        f: Any = deformation_of(frame, kin, points, (law, state), p)
        moment = load(moments, p, zero(flat, points.mass[p]))
        store(moments, p, moment @ f.planar().transposed())
