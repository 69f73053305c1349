"""What all domains share: from corners, their weights and gradients to nodes."""

from __future__ import annotations

from math import inf

from numba.extending import overload

from karamelo_py.compiler.compile import define, index, point_function, real, shared
from karamelo_py.compiler.tuples import add, add_row, add_scaled, scale, subtract
from karamelo_py.points.basis import (
    affine_weight,
    blank,
    carried,
    carrier,
    carriers,
    carry,
    entry,
    extent,
    locate,
    placed,
    reach,
    support,
)
from karamelo_py.points.basis.cpdi import domain
from karamelo_py.points.basis.product import hoop, inverse_radius
from karamelo_py.points.grid import cells_along, in_cells, pick
from karamelo_py.points.kinematics import Axisymmetric, PlaneStrain, Space

_INLINED = {"forceinline": True}
KINEMATICS = {2: (PlaneStrain, Axisymmetric), 3: (Space,)}


# --- one corner -------------------------------------------------------------------------------


@shared
def along_cell(grid, direction, x):
    """The cell of a corner in one direction, how far the corner lies in it (0 to 1), and where.

    A corner beyond the grid counts as lying on its face: weights go on adding up to one.
    """
    cells = cells_along(grid, direction)
    a = in_cells(grid, direction, x)
    a = min(max(real(0, a), a), real(cells, a))  # so written, NaN becomes 0
    i = min(int(a), cells - 1)
    return i, a - real(i, a), pick(direction, grid.x0, grid.y0, grid.z0) + a * grid.h


@point_function()
def hats(kin, grid, x):
    """The first node of the cell of a corner, the fractions of that cell, and the place itself."""


@hats.on(PlaneStrain)
@hats.on(Axisymmetric)
def _(kin, grid, x):
    i, r, a = along_cell(grid, 0, x[0])
    j, s, b = along_cell(grid, 1, x[1])
    return grid.first + i * grid.step_x + j, (r, s), (a, b)


@hats.on(Space)
def _(kin, grid, x):
    i, r, a = along_cell(grid, 0, x[0])
    j, s, b = along_cell(grid, 1, x[1])
    k, t, c = along_cell(grid, 2, x[2])
    return grid.first + i * grid.step_x + j * grid.step_y + k, (r, s, t), (a, b, c)


@shared
def _side(far, fraction):
    return fraction if far > 0 else real(1, fraction) - fraction


@point_function()
def hat(kin, fractions, j):
    """The linear function of the j-th node of a cell."""


@hat.on(PlaneStrain)
@hat.on(Axisymmetric)
def _(kin, fractions, j):
    return _side(j // 2, fractions[0]) * _side(j % 2, fractions[1])


@hat.on(Space)
def _(kin, fractions, j):
    plane = _side(j // 4, fractions[0]) * _side(j // 2 % 2, fractions[1])
    return plane * _side(j % 2, fractions[2])


@point_function()
def node(kin, grid, first, j):
    """The number of the j-th node of a cell."""


@node.on(PlaneStrain)
@node.on(Axisymmetric)
def _(kin, grid, first, j):
    return index(first + (j // 2) * grid.step_x + j % 2)


@node.on(Space)
def _(kin, grid, first, j):
    return index(first + (j // 4) * grid.step_x + (j // 2 % 2) * grid.step_y + j % 2)


@point_function()
def arm(kin, grid, fractions, j):
    """From a corner to the j-th node of its cell."""


@shared
def _arm(grid, far, fraction):
    return (real(far, fraction) - fraction) * grid.h


@arm.on(PlaneStrain)
@arm.on(Axisymmetric)
def _(kin, grid, fractions, j):
    return _arm(grid, j // 2, fractions[0]), _arm(grid, j % 2, fractions[1])


@arm.on(Space)
def _(kin, grid, fractions, j):
    return (
        _arm(grid, j // 4, fractions[0]),
        _arm(grid, j // 2 % 2, fractions[1]),
        _arm(grid, j % 2, fractions[2]),
    )


@shared
def away(kin, grid, at, centre, j):
    """From the weighted centre to the j-th node of the cell of a corner."""
    return add(arm(kin, grid, at[1], j), subtract(at[2], centre))


# --- all corners ------------------------------------------------------------------------------


def each(function):
    """``f(kin, grid, items)``: the tuple of ``function(kin, grid, item)``, written out."""

    def loop(kin, grid, items):
        return tuple(function(kin, grid, item) for item in items)

    @overload(loop, _INLINED, strict=False)
    def _written_out(kin, grid, items):
        terms = "".join(f"function(kin, grid, items[{k}]), " for k in range(len(items)))
        return define("kin, grid, items", f"return ({terms})", function=function)

    return loop


_hats_of_all = each(hats)


def mean(weights, at):
    """sum_c w_c x_c of the corners' places: sum_I N_I X_I."""
    total = scale(weights[0], at[0][2])
    for w, corner in zip(weights[1:], at[1:], strict=True):
        total = add_scaled(total, w, corner[2])
    return total


@overload(mean, _INLINED)
def _mean(weights, at):
    lines = ["total = scale(weights[0], at[0][2])"]
    for c in range(1, len(weights)):
        lines.append(f"total = add_scaled(total, weights[{c}], at[{c}][2])")
    lines.append("return total")
    return define("weights, at", *lines, scale=scale, add_scaled=add_scaled)


@point_function()
def second_moment(kin, grid, total, weight, away, fractions):
    """total + the part of one corner in D, that is w [(x_c - x)(x_c - x)^T + h^2 r (1 - r)]."""


@shared
def _spread(grid, r):
    return grid.h * grid.h * r * (real(1, r) - r)


@second_moment.on(PlaneStrain)
@second_moment.on(Axisymmetric)
def _(kin, grid, total, weight, away, fractions):
    a, b = away
    return (
        total[0] + weight * (a * a + _spread(grid, fractions[0])),
        total[1] + weight * (b * b + _spread(grid, fractions[1])),
        total[2] + weight * (a * b),
    )


@second_moment.on(Space)
def _(kin, grid, total, weight, away, fractions):
    a, b, c = away
    return (
        total[0] + weight * (a * a + _spread(grid, fractions[0])),
        total[1] + weight * (b * b + _spread(grid, fractions[1])),
        total[2] + weight * (c * c + _spread(grid, fractions[2])),
        total[3] + weight * (a * b),
        total[4] + weight * (a * c),
        total[5] + weight * (b * c),
    )


@point_function()
def no_moment(kin, like):
    """A second moment of zero."""


@no_moment.on(PlaneStrain)
@no_moment.on(Axisymmetric)
def _(kin, like):
    zero = real(0, like)
    return (zero, zero, zero)


@no_moment.on(Space)
def _(kin, like):
    zero = real(0, like)
    return (zero, zero, zero, zero, zero, zero)


@point_function()
def solve(kin, d, a):
    """D^-1 a of a symmetric D in the layout of `second_moment`."""


@solve.on(PlaneStrain)
@solve.on(Axisymmetric)
def _(kin, d, a):
    k = real(1, a[0]) / (d[0] * d[1] - d[2] * d[2])
    return (k * (d[1] * a[0] - d[2] * a[1]), k * (d[0] * a[1] - d[2] * a[0]))


@solve.on(Space)
def _(kin, d, a):
    xx, yy, zz, xy, xz, yz = d
    p = yy * zz - yz * yz
    q = xz * yz - xy * zz
    r = xy * yz - xz * yy
    k = real(1, a[0]) / (xx * p + xy * q + xz * r)
    s = xx * zz - xz * xz
    t = xy * xz - xx * yz
    u = xx * yy - xy * xy
    return (
        k * (p * a[0] + q * a[1] + r * a[2]),
        k * (q * a[0] + s * a[1] + t * a[2]),
        k * (r * a[0] + t * a[1] + u * a[2]),
    )


def moment(kin, grid, weights, at, centre):
    """D = sum_I N_I (X_I - x)(X_I - x)^T about the weighted centre."""
    total = no_moment(kin, centre[0])
    for w, corner in zip(weights, at, strict=True):
        total = second_moment(kin, grid, total, w, subtract(corner[2], centre), corner[1])
    return total


@overload(moment, _INLINED, strict=False)
def _moment(kin, grid, weights, at, centre):
    lines = ["total = no_moment(kin, centre[0])"]
    for c in range(len(weights)):
        lines.append(
            f"total = second_moment(kin, grid, total, weights[{c}], "
            f"subtract(at[{c}][2], centre), at[{c}][1])"
        )
    return define(
        "kin, grid, weights, at, centre", *lines, "return total",
        no_moment=no_moment, second_moment=second_moment, subtract=subtract,
    )  # fmt: skip


def farthest(kin, place):
    """How far a corner that `place` keeps is from the point in any direction; NaN if any is."""
    d = kin.dimension
    far = abs(place[d] - place[0])
    for k in range(d, len(place)):
        far = max(abs(place[k] - place[k % d]), far)
    return far


@overload(farthest, _INLINED, strict=False)
def _farthest(kin, place):
    d = kin.instance_class.dimension
    lines = [f"far = abs(place[{d}] - place[0])"]
    lines += [f"far = max(abs(place[{k}] - place[{k % d}]), far)" for k in range(d + 1, len(place))]
    return define("kin, place", *lines, "return far")


@point_function()
def upright(basis, kin, place):
    """Whether the domain is nowhere folded over: the Jacobian is positive at every corner."""


def corners_of(kin, place):
    """The corners that a place keeps behind its position."""
    d = kin.dimension
    return tuple(tuple(place[k : k + d]) for k in range(d, len(place), d))


@overload(corners_of, _INLINED, strict=False)
def _corners_of(kin, place):
    d = kin.instance_class.dimension
    items = "".join(
        "(" + "".join(f"place[{k + i}], " for i in range(d)) + "), "
        for k in range(d, len(place), d)
    )
    return define("kin, place", f"return ({items})")


def stencil_of(basis, kin, grid, place):
    """The stencil: see `register`."""
    x, weights, gradients = domain(basis, kin, place)
    at = _hats_of_all(kin, grid, x)
    centre = mean(weights, at)
    spread = moment(kin, grid, weights, at, centre)
    return at, weights, gradients, centre, spread, inverse_radius(centre[0])


# --- registration -----------------------------------------------------------------------------


def register(basis: type, d: int, corners: int) -> None:
    """Give `basis`, a class with :func:`domain`, what an engine asks of a basis.

    The stencil is: for each corner the first node of its cell, the fractions of that cell and the
    place; weights; gradients; the weighted centre; D of the affine transfers; 1 / r, of
    axisymmetric points. What a transfer does not use is never computed: compilers see that nobody
    reads it.

    Arms of the affine transfers begin at the weighted centre x = sum_I N_I X_I. Where that is not
    the point (corners beyond the grid; quadrilaterals and hexahedra that are no parallelograms),
    linear momentum stays exact, and angular momentum is that about these centres: what the points
    themselves show wanders by a thousandth of what it does with FLIP (a spinning square, Q4).
    """
    nodes = 2**d

    @carrier.on(basis)
    def _(basis, kin, grid, stencil, corner, j):
        at = stencil[0][corner]
        return node(kin, grid, at[0], j), hat(kin, at[1], j)

    for kin_class in KINEMATICS[d]:
        locate.on(basis, kin_class)(stencil_of)

        @support.on(basis, kin_class)
        def _(basis, kin):
            return corners * nodes

        @reach.on(basis, kin_class)
        def _(basis, kin, grid, stencil, k):
            c = k // nodes
            at = stencil[0][c]
            return away(kin, grid, at, stencil[3], k % nodes)

        @affine_weight.on(basis, kin_class)
        def _(basis, kin, grid, stencil, k):
            c = k // nodes
            at = stencil[0][c]
            weight = stencil[1][c] * hat(kin, at[1], k % nodes)
            to_node = away(kin, grid, at, stencil[3], k % nodes)
            return scale(weight, solve(kin, stencil[4], to_node))

        if kin_class is Axisymmetric:

            @entry.on(basis, kin_class)
            def _(basis, kin, grid, stencil, k):
                c = k // nodes
                j = k % nodes
                at = stencil[0][c]
                n = hat(kin, at[1], j)
                weight = stencil[1][c] * n
                slope = scale(n, stencil[2][c])
                around = hoop(weight, slope[0], stencil[5])
                return node(kin, grid, at[0], j), weight, (slope[0], slope[1], around)

        else:

            @entry.on(basis, kin_class)
            def _(basis, kin, grid, stencil, k):
                c = k // nodes
                j = k % nodes
                at = stencil[0][c]
                n = hat(kin, at[1], j)
                weight = stencil[1][c] * n
                return node(kin, grid, at[0], j), weight, scale(n, stencil[2][c])


def register_carried(basis: type, d: int, corners: int) -> None:
    """Let the corners of `basis`, which defines `upright`, be kept and go with the grid."""
    nodes = 2**d
    register(basis, d, corners)

    @carried.on(basis)
    def _(basis, kin):
        return corners

    @placed.on(basis)
    def _(basis, kin):
        return corners

    @carriers.on(basis)
    def _(basis, kin):
        return nodes

    @carry.on(basis)
    def _(basis, kin, place, old, corner, displacement):
        return add_row(place, d + d * corner, displacement)

    @extent.on(basis)
    def _(basis, kin, grid, place):
        if not upright(basis, kin, place):
            return real(inf, grid.h)
        return farthest(kin, place) * grid.inv_h

    zeros = "zero, " * (d * corners)
    own = "".join(f"x[{k}], " for k in range(d))
    blanked = define("basis, kin, x", "zero = real(0, x[0])", f"return ({own}{zeros})", real=real)
    for kin_class in KINEMATICS[d]:
        blank.on(basis, kin_class)(blanked)
