"""Volumes and centroids of point boxes clipped at the edge of a region.

The surface in a box is approximated by a plane, fitted to `Region.depth` at the corners and the
centre. Where the plane is not accurate, the box is halved, up to `HALVED` times.
"""

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.scene.region import Region

HALVED = 5  # number of halvings of a box in each direction
PLANE = 0.01  # tolerated distance of the surface from a plane / box size
EDGE = 0.05  # tolerance for the smallest sub-boxes
SHEET = 0.01  # tolerance for a surface that may belong to a thin sheet
LEAST = 0.1  # smallest fraction of a box; smaller pieces are merged with a neighbour
NOTHING = 1e-9  # round-off / box size
# Largest fraction of a box that may lie in smallest sub-boxes with a surface that is not plane:
# ROUGH/3 at a corner in 2D or an edge in 3D, more in thin sheets.
ROUGH = 0.025
MOSTLY = 0.1
FACE = 2  # pieces of a box face per direction
SLOPE = 1e-3  # smaller slopes, relative to the largest, count as 0: sums would lose digits


class Pieces(NamedTuple):
    number: np.ndarray  # (n,) number of the box, ascending
    middle: np.ndarray  # (n, d) centroids
    fraction: np.ndarray  # (n,) volume / box volume
    # (m,) fraction of each box that lies in smallest sub-boxes with a surface that is not plane
    rough: np.ndarray

    def missed(self, size: float) -> float:
        """Return the smallest thickness that is resolved; 0 means any thickness."""
        mostly = self.rough.sum() > MOSTLY * self.fraction.sum()
        return size / 2**HALVED if mostly or self.rough.max(initial=0) > ROUGH else 0.0


def clip(region: Region, x: np.ndarray, size: float, first: int) -> tuple[np.ndarray, Pieces]:
    """Clip boxes of edge `size` around `x` (n, d).

    Returns the mask of boxes that reach into the region, and the pieces of cut boxes.

    Boxes are first cut at the domain and the region's bounding box, so faces along axes are exact.
    """
    d = x.shape[1]
    half = size / 2
    reach = (1 + NOTHING) * math.sqrt(d) * half
    inner, outer = half - NOTHING * size, half + NOTHING * size
    lo, hi = region.lo[:d], region.hi[:d]
    depth = region.depth(x, (1 + NOTHING) * reach)
    kept = depth > -reach
    passed = depth < reach
    passed &= kept
    for k in range(d):
        if (x[:, k].min() < lo[k] + inner) or (x[:, k].max() > hi[k] - inner):
            kept &= (x[:, k] > lo[k] - outer) & (x[:, k] < hi[k] + outer)
            passed |= (x[:, k] < lo[k] + inner) | (x[:, k] > hi[k] - inner)
            passed &= kept
    edge = np.flatnonzero(passed)
    at = x[edge]
    corner = np.maximum(at - half, lo)
    fraction, moment, rough = _measure(region, corner, np.minimum(at + half, hi) - corner, size)
    middle = moment / np.maximum(fraction, NOTHING)[:, None]
    kept[edge] = fraction > NOTHING
    left = kept[edge] & (fraction <= 1 - NOTHING)
    return kept, Pieces(first + edge[left], middle[left], fraction[left], rough)


def join(region: Region, boxes: Any, pieces: Pieces) -> Pieces:
    """Merge small pieces into the nearest larger ones of adjacent boxes, and set them to 0."""
    small = np.flatnonzero(pieces.fraction < LEAST)
    middle = pieces.middle[small]
    d = middle.shape[1]
    nearest, taker = np.full(len(small), np.inf), np.full(len(small), -1)
    lean = np.where(middle > boxes.middles(pieces.number[small]), 1, -1)
    for step in np.array(list(itertools.product((0, 1), repeat=d))):
        number = boxes.beside(pieces.number[small], step * lean)
        row = np.minimum(np.searchsorted(pieces.number, number), len(pieces.number) - 1)
        is_piece = pieces.number[row] == number
        large = is_piece & (pieces.fraction[row] >= LEAST)
        at = pieces.middle[row]
        other = np.flatnonzero(~is_piece & (number >= 0))
        at[other] = boxes.middles(number[other])
        large[other] = region.depth(at[other], region.domain.tolerance) > 0
        for k in range(d):
            large &= (at[:, k] > region.lo[k]) & (at[:, k] < region.hi[k])
        at -= middle
        distance = np.sqrt(np.einsum("ni,ni->n", at, at))
        nearer = large & (distance < nearest * (1 - NOTHING))
        nearest[nearer], taker[nearer] = distance[nearer], number[nearer]
    merged = taker >= 0
    small, taker = small[merged], taker[merged]
    new = np.setdiff1d(taker, pieces.number)
    order = np.argsort(np.concatenate([pieces.number, new]), kind="stable")
    number = np.concatenate([pieces.number, new])[order]
    fraction = np.concatenate([pieces.fraction, np.ones(len(new))])[order]
    middle = np.concatenate([pieces.middle, boxes.middles(new)])[order]
    giver = np.searchsorted(number, pieces.number[small])
    taker = np.searchsorted(number, taker)
    moment = middle * fraction[:, None]
    np.add.at(moment, taker, moment[giver])
    np.add.at(fraction, taker, fraction[giver])
    fraction[giver] = 0
    middle[taker] = moment[taker] / fraction[taker][:, None]
    return Pieces(number, middle, fraction, pieces.rough)


def _measure(
    region: Region, lo: np.ndarray, edges: np.ndarray, size: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return volume fractions (n,), first moments (n, d) and `Pieces.rough` of clipped boxes."""
    n, d = lo.shape
    sums: np.ndarray = np.zeros((1 + d, n))
    rough: np.ndarray = np.empty(0)
    box = np.flatnonzero((edges > NOTHING * size).all(axis=1))
    # Rows of one component are contiguous, as regions read one component after another.
    lo, edges = lo[box].T, edges[box].T
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=d)))
    places = np.concatenate([corners, np.full((1, d), 0.5)])
    for halved in range(HALVED + 1):
        if not len(box):
            break
        reach = np.sqrt((edges**2).sum(axis=0)) / 2
        x = lo[:, None, :] + edges[:, None, :] * places.T[:, :, None]
        depth = region.depth(x.reshape(d, -1).T, 2 * reach.max()).reshape(len(places), -1)
        at_corners, inmost = depth[:-1], depth[-1]
        mean = at_corners.mean(axis=0)
        slopes = (corners - 0.5).T @ at_corners / 2 ** (d - 2)
        off = np.abs(at_corners - mean - (corners - 0.5) @ slopes).max(axis=0)
        off = np.maximum(off, np.abs(mean - inmost))
        whole = at_corners.min(axis=0) >= -NOTHING * size
        whole &= inmost >= (0.5 - NOTHING) * edges.min(axis=0)
        passed = (np.abs(inmost) < reach) & ~whole
        slopes[:, ~passed] = 0
        # If corners and centre are on the same side, a thin sheet may still cross the box.
        unseen = np.abs(np.sign(depth).sum(axis=0)) == len(depth)
        edge = np.where(unseen, SHEET, EDGE) * edges.max(axis=0)
        bent = passed & (off > (edge if halved == HALVED else np.minimum(edge, PLANE * size)))
        volume = edges.prod(axis=0) / size**d
        if halved == HALVED:
            rough = np.bincount(box[bent], volume[bent])
            bent[:] = False
        done = ~bent
        fraction, middle = _plane((mean + 2 * inmost)[done] / 3, slopes[:, done])
        fraction *= volume[done]
        sums[0] += np.bincount(box[done], fraction, n)
        for k in range(d):
            along = lo[k, done] + edges[k, done] * middle[k]
            sums[1 + k] += np.bincount(box[done], fraction * along, n)
        edges, parts = edges[:, bent] / 2, len(corners)
        lo = lo[:, None, bent] + corners.T[:, :, None] * edges[:, None, :]
        lo, edges, box = lo.reshape(d, -1), np.tile(edges, parts), np.tile(box[bent], parts)
    return sums[0], sums[1:].T, rough[rough > 0]


def surface(region: Region, x: np.ndarray, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Return area times outward normal (n, d), and a surface position (n, d), in each box.

    The area follows from the covered areas of opposite faces, so that the sum over boxes is exact.
    """
    n, d = x.shape
    ends = np.array(list(itertools.product((0.0, 1.0), repeat=d - 1)))
    starts = np.array(list(itertools.product(range(FACE), repeat=d - 1)), float)
    on_face = (starts[:, None, :] + ends) / FACE - 0.5
    area = np.empty((n, d))
    for k in range(d):
        covered = []
        for side in (-0.5, 0.5):
            at = x[:, None, None, :] + np.insert(on_face, k, side, axis=2) * size
            # A face between two boxes that lies in the surface counts as uncovered for both.
            depth = region.depth(at.reshape(-1, d), 2 * size) - NOTHING * size
            depth = np.ascontiguousarray(depth.reshape(-1, len(ends)).T)
            slopes = (ends - 0.5).T @ depth * 2.0 ** (3 - d)
            fraction = _plane(depth.mean(axis=0), slopes)[0] if d > 1 else depth[0] > 0
            covered.append(fraction.reshape(n, -1).mean(axis=1))
        area[:, k] = (covered[0] - covered[1]) * size ** (d - 1)
    length = np.maximum(np.linalg.norm(area, axis=1, keepdims=True), np.finfo(float).tiny)
    return area, x + region.depth(x, 2 * size)[:, None] * area / length


def _plane(mean: np.ndarray, slopes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return volume (n,) and centroid (d, n) of mean + slopes (x - 1/2) > 0 in a unit cube."""
    m = np.abs(slopes)
    steep = m > SLOPE * np.maximum(m.max(axis=0), np.abs(mean))
    fraction, middle = (mean > 0).astype(float), np.full(slopes.shape, 0.5)
    ways = (1 << np.arange(len(m))) @ steep
    for way in range(1, 1 << len(m)):
        rows = np.flatnonzero(ways == way)
        if len(rows):
            here = np.ix_(np.array([k for k in range(len(m)) if way >> k & 1]), rows)
            fraction[rows], middle[here] = _simplices(mean[rows], m[here])
    return fraction, np.where(slopes > 0, 1 - middle, middle)


def _simplices(mean: np.ndarray, m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the results of `_plane` for slopes -`m` (d, n), with m > 0.

    The volume is the simplex at the lowest corner, minus its overhangs beyond the cube, which are
    simplices at the other corners (inclusion and exclusion).
    """
    d = len(m)
    top = mean + m.sum(axis=0) / 2
    fraction, moment = np.zeros(len(mean)), np.zeros(m.shape)
    unit = 1 / (math.factorial(d) * m.prod(axis=0))
    for corner in itertools.product((0, 1), repeat=d):
        height = np.maximum(top - np.array(corner, float) @ m, 0)
        volume = (-1) ** sum(corner) * height**d * unit
        fraction += volume
        for k in range(d):
            moment[k] += volume * (corner[k] + height / ((d + 1) * m[k]))
    fraction = np.clip(fraction, 0, 1)
    return fraction, np.clip(moment / np.maximum(fraction, NOTHING), 0, 1)
