"""Pairs of touching points of two bodies, found with linked cells, and their forces.

Sums are in double precision, by one thread and in the order of ids, so they are independent of the
number of threads and of the order in memory.
"""

from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import at_hand, kernel, noinline
from karamelo_py.compiler.fields import load_vector
from karamelo_py.kernels.arrays import Tag, vector_at
from karamelo_py.kernels.views import deformation_of, state_at, volume_of
from karamelo_py.points.bodies import (
    NEW,
    Face,
    FrictionMemory,
    Hertz,
    MeetingFaces,
    TouchingPair,
    along,
    force_between,
    radius,
    rub,
)
from karamelo_py.points.kinematics import inv, zero_vector


class TwoBodies(NamedTuple):
    """Points of two bodies by id; the second starts at `first2`."""

    x: np.ndarray  # (n, d)
    v: np.ndarray  # (n, d)
    mass: np.ndarray  # (n,)
    radius: np.ndarray  # (n,)
    force: np.ndarray  # (n, d)
    grip: np.ndarray  # (n, d + 2) of the first body (`points.bodies.rub`), or (n, 0)
    face: np.ndarray  # (n, d + 3) `points.bodies.Face`, or (n, 0)
    first2: int


class OneOfTwo(NamedTuple):
    begin1: int
    end1: int
    begin2: int
    end2: int


class Push(NamedTuple):
    law: Tag  # `points.bodies`
    kin: Tag
    reach: float  # largest distance between touching points along an axis
    step: float  # time since the previous positions
    dt: float  # dt of the stiffness, with `kick`
    kick: float


class Cells(NamedTuple):
    start: np.ndarray  # (c + 1,) int64, room for c cells
    cell: np.ndarray  # (n,) int64; -1 if the point touches nothing
    order: np.ndarray  # (n,) int64: points of the second body
    corner: np.ndarray  # (3,) lower corner of the covered region
    length: np.ndarray  # (3,) lengths of the covered region
    count: np.ndarray  # (3,) int64 number of cells
    contact: np.ndarray  # (7,) sums over the partners of a point (`_touch`)
    total: np.ndarray  # (3,) force on the first body


def cells_for(points: int) -> Cells:
    return Cells(
        start=np.zeros(2 * points + 65, np.int64), cell=np.zeros(points, np.int64),
        order=np.zeros(points, np.int64), corner=np.zeros(3), length=np.zeros(3),
        count=np.ones(3, np.int64), contact=np.zeros(7), total=np.zeros(3),
    )  # fmt: skip


@noinline
def _body(id, bodies):
    if bodies.begin1 <= id < bodies.end1:
        return 0
    return 1 if bodies.begin2 <= id < bodies.end2 else -1


def _radius(matter, x, p):
    kin, points, laws = matter
    law, state = state_at(kin, points, laws, p)
    return radius(kin, float(volume_of(kin, points, law, state, p)), load_vector(kin, x, p))


@kernel
def extend(matter, x, ids, extents):
    """Extend the extents of two bodies by the points of a block at `x` (w, n).

    `extents` (2, 7): largest -x, -y, -z, x, y, z and radius of each body.
    """
    matter = at_hand(matter)
    points = matter.points
    for p in range(points.id.size):
        body = _body(points.id[p], ids)
        if body >= 0:
            for k in range(matter.kin.dimension):
                extents[body, k] = max(extents[body, k], -float(x[k, p]))
                extents[body, 3 + k] = max(extents[body, 3 + k], float(x[k, p]))
            extents[body, 6] = max(extents[body, 6], _radius(matter, x, p))


@kernel
def pick(matter, x, ids, corners, rows):
    """Fill `rows` with the two bodies' points between `corners` (2, d); return their number."""
    matter, count = at_hand(matter), 0
    points = matter.points
    for p in range(points.id.size):
        inside = _body(points.id[p], ids) >= 0
        for k in range(matter.kin.dimension):
            inside = inside and corners[0, k] <= x[k, p] <= corners[1, k]
        if inside:
            rows[count] = p
            count += 1
    return count


@kernel
def collect(matter, x, rows, out):
    """Put id, mass, radius, position and velocity of points into `out` (n, 3 + 2 d)."""
    matter = at_hand(matter)
    points, d = matter.points, matter.kin.dimension
    for i in range(rows.size):
        p = rows[i]
        out[i, 0], out[i, 1] = points.id[p], points.mass[p]
        out[i, 2] = _radius(matter, x, p)
        for k in range(d):
            out[i, 3 + k] = x[k, p]
            out[i, 3 + d + k] = points.v[k, p]


@kernel
def rotate_faces(frame, matter, rows, faces):
    """Rotate and stretch reference `faces` (n, d + 3) with the points."""
    kin, points, laws = at_hand(matter)
    none = zero_vector(kin, 0.0)
    for i in range(rows.size):
        law, state = state_at(kin, points, laws, rows[i])
        f: Any = deformation_of(frame, kin, points, (law, state), rows[i])
        normal = inv(f.planar()).transposed() @ vector_at(kin, faces, i, 0, none)
        size = sqrt(normal.squared())
        for k in range(kin.dimension):
            faces[i, k] = normal[k] / size
        faces[i, kin.dimension] /= size


@noinline
def _range(x, begin, end, k):
    lo, hi = inf, -inf
    for i in range(begin, end):
        lo = min(lo, x[i, k])
        hi = max(hi, x[i, k])
    return lo, hi


@noinline
def _largest(values, begin, end):
    largest = 0.0
    for i in range(begin, end):
        largest = max(largest, values[i])
    return largest


@noinline
def _lay_cells(d, bodies, cells, reach):
    """Cover the region of possible contact by cells; return the cell width, 0 without contact."""
    n, m = bodies.first2, bodies.mass.size
    width = min(_largest(bodies.radius, 0, n) + _largest(bodies.radius, n, m), reach)
    if not width > 0:
        return 0.0
    for k in range(d):
        lo1, hi1 = _range(bodies.x, 0, n, k)
        lo2, hi2 = _range(bodies.x, n, m, k)
        cells.corner[k] = max(lo1, lo2) - width
        length = min(hi1, hi2) + width - cells.corner[k]
        # no overlap, or NaN
        if not 0 <= length < inf:
            return 0.0
        cells.length[k] = length
    room = cells.start.size - 1
    while True:
        total = 1.0
        for k in range(3):
            along = np.floor(cells.length[k] / width) + 1 if k < d else 1.0
            total *= along
            if total > room:
                break
            cells.count[k] = int(along)
        if total <= room:
            return width
        width *= 2.0


@noinline
def _find_cells(d, bodies, cells, width):
    n, m = bodies.first2, bodies.mass.size
    used = cells.count[0] * cells.count[1] * cells.count[2]
    cells.start[: used + 1] = 0
    for i in range(m):
        number = 0
        for k in range(d):
            a = bodies.x[i, k] - cells.corner[k]
            if not 0 <= a <= cells.length[k]:
                number = -1
                break
            number = number * cells.count[k] + min(int(a / width), cells.count[k] - 1)
        cells.cell[i] = number
        if i >= n and number >= 0:
            cells.start[number + 1] += 1
    for c in range(used):
        cells.start[c + 1] += cells.start[c]
    # This loop moves start[c] to the end of cell c, where cell c + 1 begins.
    for j in range(n, m):
        c = cells.cell[j]
        if c >= 0:
            cells.order[cells.start[c]] = j
            cells.start[c] += 1


@noinline
def _push_between(push, bodies, i, j):
    law, kin = push.law, push.kin
    x, none = bodies.x, zero_vector(kin, 0.0)
    dx = vector_at(kin, x, j, 0, none) - vector_at(kin, x, i, 0, none)
    squared, near = 0.0, True
    for k in range(kin.dimension):
        near = near and abs(dx[k]) < push.reach
        squared += dx[k] * dx[k]
    both = bodies.radius[i] + bodies.radius[j]
    if not (near and 0 < squared < both * both):
        return none, 0.0
    radii, masses = (bodies.radius[i], bodies.radius[j]), (bodies.mass[i], bodies.mass[j])
    faces = (_face(kin, bodies, i), _face(kin, bodies, j)) if isinstance(law, MeetingFaces) else ()
    pair = TouchingPair(dx, sqrt(squared), radii, masses, push.dt, push.kick, faces)
    return force_between(law, kin, pair)


def _rubbed(mu, load, hold, stop, at):
    """Return the friction (d,) on a point, and update its contact history ``at`` = (grip, row)."""
    (grip, i), d = at, len(hold)
    memory = FrictionMemory(hold, grip[i, d], grip[i, d + 1])
    force, (hold, mean, unused) = rub(mu, load, memory, stop)
    for k in range(d):
        grip[i, k] = hold[k]
    grip[i, d], grip[i, d + 1] = mean, unused
    return force


@noinline
def _face(kin, bodies, i):
    normal, d = vector_at(kin, bodies.face, i, 0, zero_vector(kin, 0.0)), kin.dimension
    return Face(normal, bodies.face[i, d], bodies.face[i, d + 1], bodies.face[i, d + 2])


@noinline
def _add(bodies, i, j, force, total):
    for k, component in enumerate(force):
        bodies.force[i, k] += component
        bodies.force[j, k] -= component
        total[k] += component


@noinline
def _touch(push, bodies, cells, i, j):
    """Add the normal force between two points; return 1 if they touch, else 0.

    For the friction on `i`, `cells.contact` sums load, normal force, and stiffness times tangential
    velocity over the partners of `i`.
    """
    kin, contact = push.kin, cells.contact
    (force, stiffness), d = _push_between(push, bodies, i, j), kin.dimension
    square = force.squared()
    if not square > 0:
        return 0
    _add(bodies, i, j, force, cells.total)
    if bodies.grip.shape[1] == 0:
        return 1
    none = zero_vector(kin, 0.0)
    dv = vector_at(kin, bodies.v, j, 0, none) - vector_at(kin, bodies.v, i, 0, none)
    slide = stiffness * along(dv, force)
    contact[0] += sqrt(square)
    for k in range(d):
        contact[1 + k] += force[k]
        contact[1 + d + k] += slide[k]
    return 1


@noinline
def _rub(push, bodies, i, contact):
    kin = push.kin
    grip, none, d = bodies.grip, zero_vector(kin, 0.0), kin.dimension
    normal = kin.Vector._make([contact[1 + k] for k in range(d)])
    slide = kin.Vector._make([contact[1 + d + k] for k in range(d)])
    slid = push.step if grip[i, d] > 0 else 0.0  # a point without contact before has not slid
    hold = along(vector_at(kin, grip, i, 0, none) + slid * slide, normal)
    force = _rubbed(push.law.friction, contact[0], hold, push.dt * slide, (grip, i))
    for k in range(d):
        contact[1 + d + k] = force[k]


@noinline
def _pass_on(push, bodies, cells, i, j):
    """Apply a partner's part of the friction of `i`, proportional to its load."""
    kin, contact, d = push.kin, cells.contact, push.kin.dimension
    square = _push_between(push, bodies, i, j)[0].squared()
    if square > 0:
        fraction = sqrt(square) / contact[0]
        force = kin.Vector._make([fraction * contact[1 + d + k] for k in range(d)])
        _add(bodies, i, j, force, cells.total)


@kernel
def push_apart(push, bodies, cells):
    """Add the forces of all touching pairs, their sum to `cells.total`; return their number."""
    bodies, cells = at_hand(bodies), at_hand(cells)
    d = push.kin.dimension
    cells.total[:] = 0.0
    touching = 0
    rubs = not isinstance(push.law, Hertz) and bodies.grip.shape[1] > 0
    contact = cells.contact
    width = _lay_cells(d, bodies, cells, push.reach)
    if not width > 0:
        return touching
    _find_cells(d, bodies, cells, width)
    nx, ny, nz = cells.count[0], cells.count[1], cells.count[2]
    for i in range(bodies.first2):
        c = cells.cell[i]
        if c < 0:
            continue
        cx, cy, cz = c // (ny * nz), c // nz % ny, c % nz
        contact[:] = 0.0
        for turn in range(2 if rubs else 1):
            if turn == 1:
                if not contact[0] > 0:  # after contact, a bouncing point loses its grip gradually
                    for k in range(d + 2):
                        bodies.grip[i, k] *= 1 - NEW
                    break
                _rub(push, bodies, i, contact)
            for a in range(max(cx - 1, 0), min(cx + 2, nx)):
                for b in range(max(cy - 1, 0), min(cy + 2, ny)):
                    # cells along the last axis are adjacent in `order`
                    first = (a * ny + b) * nz + max(cz - 1, 0)
                    last = (a * ny + b) * nz + min(cz + 1, nz - 1)
                    begin = cells.start[first - 1] if first > 0 else 0
                    for q in range(begin, cells.start[last]):
                        j = cells.order[q]
                        if turn == 0:
                            touching += _touch(push, bodies, cells, i, j)
                        else:
                            _pass_on(push, bodies, cells, i, j)
    return touching
