"""Trees of faces: distance to the nearest face, and whether faces enclose a position.

Faces (points in 1D, segments in 2D, triangles in 3D) are in the leaves of a binary tree of boxes
with nodes in depth-first order, so traversal needs no stack. A position is enclosed if its winding
number is not 0: each face crossed by a ray along the last axis counts 1 or -1. Two faces get
identical crossings of their common edge, so none is missed or counted twice. (Sunday 2001;
triangles: Ericson 2005, section 5.1.5.)
"""

from collections.abc import Callable
from math import sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import at_hand, noinline, point_function
from karamelo_py.compiler.threads import Serial, by_threads
from karamelo_py.points.kinematics import KINEMATICS, dot

CHUNK = 1024  # positions per thread at a time
TINY = float(np.finfo(float).tiny)


class Surface(NamedTuple):
    """Faces in a tree of n boxes."""

    boxes: np.ndarray  # (n, 2, d) corners
    # (n, 3) int32: first and end of the faces of a leaf (0, 0 in other nodes); the node after the
    # subtree
    nodes: np.ndarray
    faces: np.ndarray  # (m, d, d): face, corner, axis
    odd: bool  # faces are unoriented: inside where a ray crosses an odd number of them


class Convex(NamedTuple):
    """Region below planes and within a ball or (infinite) cylinder."""

    planes: np.ndarray  # (k, d + 1): inward normals, and their products with a point on the plane
    across: np.ndarray  # (d,) 1 for axes that count in the radius, 0 along a cylinder's axis
    centre: np.ndarray  # (d,)
    radius: float


def surface_of(faces: np.ndarray, margin: float, *, odd: bool = False) -> Surface:
    """Build a tree of `faces` (m, d, d), its boxes enlarged by `margin`; `odd` as in `Surface`.

    A node's faces are halved at the median along its longest axis.
    """
    count, _, d = faces.shape
    leaves = 1 << max(count.bit_length() - 1, 0)
    middle, order, parts = faces.mean(axis=1), np.arange(count), 1
    while parts < leaves:
        begin = count * np.arange(parts) // parts
        part, at = np.repeat(np.arange(parts), np.diff(begin, append=count)), middle[order]
        size = np.maximum.reduceat(at, begin) - np.minimum.reduceat(at, begin)
        order = order[np.lexsort((at[np.arange(count), size.argmax(axis=1)[part]], part))]
        parts *= 2
    faces = np.ascontiguousarray(faces[order], float)
    ends = count * np.arange(leaves + 1) // leaves
    boxes, nodes = np.empty((2 * leaves - 1, 2, d)), np.zeros((2 * leaves - 1, 3), np.int32)
    levels = [np.stack([np.full((1, d), np.inf), np.full((1, d), -np.inf)], axis=1)]
    if count:
        low = np.minimum.reduceat(faces.min(axis=1), ends[:-1]) - margin
        high = np.maximum.reduceat(faces.max(axis=1), ends[:-1]) + margin
        levels = [np.stack([low, high], axis=1)]
    while len(levels[-1]) > 1:
        low, high = np.moveaxis(levels[-1].reshape(-1, 2, 2, d), 2, 0)
        levels.append(np.stack([low.min(axis=1), high.max(axis=1)], axis=1))
    at = np.zeros(1, np.int64)
    for level in reversed(levels):
        size = 2 * leaves // len(level) - 1
        boxes[at], nodes[at, 2] = level, at + size
        if size == 1:
            nodes[at, 0], nodes[at, 1] = ends[:-1], ends[1:]
        at = np.stack([at + 1, at + 1 + size // 2], axis=1).ravel()
    return Surface(boxes, nodes, faces, odd)


def _corner(kin, surface, i, k):
    return kin.Vector._make([surface.faces[i, k, c] for c in range(kin.dimension)])


def _from_line(a, b, x):
    way, local = b - a, x - a
    return (local - _share_along(way, local) * way).squared()


def _share_along(way, local):
    return min(max(dot(way, local) / max(way.squared(), TINY), 0.0), 1.0)


def _cross(a, b):
    return a._make(
        (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    )


def _is_above(corners, normal, size, x):
    (a, b, c), above = corners, size > TINY
    above = above and dot(_cross(b - a, x - a), normal) >= 0
    above = above and dot(_cross(c - b, x - b), normal) >= 0
    return above and dot(_cross(a - c, x - c), normal) >= 0


@point_function()
def _squared(kin, surface, i, x): ...


@_squared.on(KINEMATICS[1])
def _from_point(kin, surface, i, x):
    return (x - _corner(kin, surface, i, 0)).squared()


@_squared.on(KINEMATICS[2])
def _from_segment(kin, surface, i, x):
    return _from_line(_corner(kin, surface, i, 0), _corner(kin, surface, i, 1), x)


@_squared.on(KINEMATICS[3])
def _from_triangle(kin, surface, i, x):
    a, b, c = (_corner(kin, surface, i, k) for k in range(3))
    normal = _cross(b - a, c - a)
    size = normal.squared()
    if _is_above((a, b, c), normal, size, x):
        height = dot(x - a, normal)
        return height * height / size
    return min(min(_from_line(a, b, x), _from_line(b, c, x)), _from_line(c, a, x))


def _from_box(kin, surface, k, x):
    square = 0.0
    for c in range(kin.dimension):
        away = max(max(surface.boxes[k, 0, c] - x[c], x[c] - surface.boxes[k, 1, c]), 0.0)
        square += away * away
    return square


@noinline
def _nearer(kin, surface, k, x, found):
    best, face = found
    for i in range(surface.nodes[k, 0], surface.nodes[k, 1]):
        square = _squared(kin, surface, i, x)
        if square < best or (square == best and i < face):  # the same face in any order
            best, face = square, i
    return best, face


@noinline
def closest(kin, surface, x, reach, known):
    """Return the squared distance to the nearest face within `reach`, and its number, else -1.

    The search is shorter if `known` is a face nearby; -1 if none is known.
    """
    best, face, k = reach * reach, -1, 0
    if known >= 0:
        square = _squared(kin, surface, known, x)
        if square < best:
            best, face = square, known
    if face < 0:
        # first descend to a near face, so that few boxes are searched
        while surface.nodes[k, 1] == 0 and k + 1 < surface.nodes.shape[0]:
            left, right = k + 1, surface.nodes[k + 1, 2]
            a, b = _from_box(kin, surface, left, x), _from_box(kin, surface, right, x)
            if min(a, b) > best:
                break
            k = left if a <= b else right
        best, face = _nearer(kin, surface, k, x, (best, face))
    k = 0
    while k < surface.nodes.shape[0]:
        if _from_box(kin, surface, k, x) <= best:
            best, face = _nearer(kin, surface, k, x, (best, face))
            k += 1
        else:
            k = surface.nodes[k, 2]
    return best, face


def distance(surface, kin, x, reach):
    """Return the distance to the nearest face, at most `reach`."""
    return sqrt(closest(kin, surface, x, reach, -1)[0])


def _on_line(a, b, x):
    way = b - a
    return a + _share_along(way, x - a) * way


@point_function()
def place_on(kin, surface, i, x):
    """Return the closest point on face `i`."""


@place_on.on(KINEMATICS[1])
def _place_of_point(kin, surface, i, x):
    return _corner(kin, surface, i, 0)


@place_on.on(KINEMATICS[2])
def _place_on_segment(kin, surface, i, x):
    return _on_line(_corner(kin, surface, i, 0), _corner(kin, surface, i, 1), x)


@place_on.on(KINEMATICS[3])
def _place_on_triangle(kin, surface, i, x):
    a, b, c = (_corner(kin, surface, i, k) for k in range(3))
    normal = _cross(b - a, c - a)
    size = normal.squared()
    if _is_above((a, b, c), normal, size, x):
        return x - dot(x - a, normal) / size * normal
    closest, best = _on_line(a, b, x), _from_line(a, b, x)
    if _from_line(b, c, x) < best:
        closest, best = _on_line(b, c, x), _from_line(b, c, x)
    if _from_line(c, a, x) < best:
        closest = _on_line(c, a, x)
    return closest


def nearest(kin, surface, x, reach):
    """Return the closest point on the nearest face, which must be within `reach`."""
    return place_on(kin, surface, closest(kin, surface, x, reach, -1)[1], x)


def _offset(surface, kin, x, reach):
    """Return the largest component of the vector to the nearest face, at most `reach`."""
    far = reach * sqrt(kin.dimension)
    if distance(surface, kin, x, far) >= far:
        return reach
    way, most = x - nearest(kin, surface, x, far), 0.0
    for c in range(kin.dimension):
        most = max(most, abs(way[c]))
    return most


@noinline
def _crossed(a, b, point):
    """Return 1 if a ray from (x, y) along x crosses a rising edge a b, -1 a falling one, else 0."""
    (ax, ay), (bx, by), (x, y) = a, b, point
    if (ay > y) == (by > y):
        return 0
    if ay < by:  # makes the operations the same for both faces of an edge
        return 1 if x < ax + (y - ay) / (by - ay) * (bx - ax) else 0
    return -1 if x < bx + (y - by) / (ay - by) * (ax - bx) else 0


@point_function()
def _crossing(kin, surface, i, x):
    """Return 1 or -1 (by side) if a ray from `x` along the last axis crosses face `i`, else 0."""


@_crossing.on(KINEMATICS[1])
def _crossing_point(kin, surface, i, x):
    return 1 if surface.faces[i, 0, 0] > x[0] else 0


@_crossing.on(KINEMATICS[2])
def _crossing_segment(kin, surface, i, x):
    a, b = _corner(kin, surface, i, 0), _corner(kin, surface, i, 1)
    return _crossed((a[1], a[0]), (b[1], b[0]), (x[1], x[0]))


@_crossing.on(KINEMATICS[3])
def _crossing_triangle(kin, surface, i, x):
    a, b, c = (_corner(kin, surface, i, k) for k in range(3))
    flat = [(corner[0], corner[1]) for corner in (a, b, c)]
    point = x[0], x[1]
    winding = _crossed(flat[0], flat[1], point)
    winding += _crossed(flat[1], flat[2], point)
    winding += _crossed(flat[2], flat[0], point)
    if winding == 0:
        return 0
    normal = _cross(b - a, c - a)
    low, high = min(min(a[2], b[2]), c[2]), max(max(a[2], b[2]), c[2])
    # the face is parallel to the ray: take any height between its ends
    height = low
    if normal[2] != 0:
        fall = normal[0] * (x[0] - a[0]) + normal[1] * (x[1] - a[1])
        height = min(max(a[2] - fall / normal[2], low), high)
    return winding if height > x[2] else 0


@noinline
def encloses(kin, surface, x):
    last, hits, k = kin.dimension - 1, 0, 0
    while k < surface.nodes.shape[0]:
        near = x[last] <= surface.boxes[k, 1, last]
        for c in range(last):
            near = near and surface.boxes[k, 0, c] <= x[c] and x[c] <= surface.boxes[k, 1, c]
        if near:
            for i in range(surface.nodes[k, 0], surface.nodes[k, 1]):
                hits += _crossing(kin, surface, i, x)
        k = k + 1 if near else surface.nodes[k, 2]
    return hits & 1 != 0 if surface.odd else hits != 0


class HalfSpace(NamedTuple):
    normal: np.ndarray  # (d,) inward
    offset: float  # product of the normal and a position on the plane


class Joined(NamedTuple):
    parts: tuple


class Common(NamedTuple):
    parts: tuple


class Outside(NamedTuple):
    inner: NamedTuple


def is_endless(shape: NamedTuple, axis: int) -> bool:
    """Return True if a shape is the same at all positions along `axis`."""
    if isinstance(shape, Joined | Common):
        return all(is_endless(part, axis) for part in shape.parts)
    if isinstance(shape, Outside):
        return is_endless(shape.inner, axis)
    if isinstance(shape, HalfSpace):
        return bool(shape.normal[axis] == 0)
    if isinstance(shape, Convex):
        round_about = shape.across[axis] and np.isfinite(shape.radius)
        return not (shape.planes[:, axis].any() or round_about)
    return False


@point_function()
def depth(shape, kin, x, reach):
    """Return the depth of `x` in a shape, negative outside; it is exact if below `reach`."""


@point_function(otherwise=True)
def slopes(shape, kin, x, reach, within_and_step):
    """Return depth(x - step e_k) - depth(x + step e_k) for each axis k, about -2 step grad(depth).

    `within_and_step` are the depth at `x`, and the step.
    """
    return _slopes_across(shape, kin, x, reach, within_and_step[1])


@slopes.on(Surface)
def _slopes_at_surface(shape, kin, x, reach, within_and_step):
    within, step = within_and_step
    near = abs(within)
    if near <= step:
        return _slopes_across(shape, kin, x, min(near + 1.01 * step, reach), step)
    if near >= reach:
        return x - x
    away = x - nearest(kin, shape, x, 1.001 * near)
    return 2 * step / near * (away if within < 0 else -away)


@noinline
def _slopes_across(shape, kin, x, reach, step):
    differences = []
    for k in range(kin.dimension):
        aside = kin.Vector._make([step if c == k else 0.0 for c in range(kin.dimension)])
        differences.append(
            depth(shape, kin, x - aside, reach) - depth(shape, kin, x + aside, reach)
        )
    return kin.Vector._make(differences)


@depth.on(Surface)
def _depth_in_surface(shape, kin, x, reach):
    away = distance(shape, kin, x, reach)
    return away if encloses(kin, shape, x) else -away


@depth.on(HalfSpace)
def _depth_in_half_space(shape, kin, x, reach):
    height = -shape.offset
    for c in range(kin.dimension):
        height += shape.normal[c] * x[c]
    return height


@depth.on(Convex)
def _depth_in_convex(shape, kin, x, reach):
    square = 0.0
    for c in range(kin.dimension):
        square += shape.across[c] * (x[c] - shape.centre[c]) ** 2
    least = min(shape.radius - sqrt(square), reach)
    for i in range(shape.planes.shape[0]):
        below = -shape.planes[i, kin.dimension]
        for c in range(kin.dimension):
            below += shape.planes[i, c] * x[c]
        least = min(least, below)
    return least


@depth.on(Joined)
@depth.on(Common)
def _depth_in_parts(shape, kin, x, reach):
    choose = max if isinstance(shape, Joined) else min
    combined = depth(shape.parts[0], kin, x, reach)
    for member in shape.parts[1:]:
        combined = choose(combined, depth(member, kin, x, reach))
    return combined


@depth.on(Outside)
def _depth_outside(shape, kin, x, reach):
    return -depth(shape.inner, kin, x, reach)


def _of_positions(measure: Callable) -> Callable[[Surface, np.ndarray, float], np.ndarray]:
    @by_threads
    def measure_some(shape, x, reach, out, n):
        kin, surface = at_hand(shape)
        for p in range(n * CHUNK, min((n + 1) * CHUNK, x.shape[0])):
            position = kin.Vector._make([x[p, c] for c in range(kin.dimension)])
            out[p] = measure(surface, kin, position, reach)

    def measure_all(surface, x, reach):
        d = surface.faces.shape[2]
        positions, out = np.ascontiguousarray(x[:, :d], float), np.empty(len(x))
        shape = KINEMATICS[d](), surface
        measure_some(Serial(), -(-len(x) // CHUNK), shape, positions, float(reach), out)
        return out

    return measure_all


# Functions of positions (n, d) and `reach`, the upper bound of each result: depth (negative
# outside), distance to the nearest face, largest component of the vector to the nearest face.
depths, distances = _of_positions(_depth_in_surface), _of_positions(distance)
offsets = _of_positions(_offset)
