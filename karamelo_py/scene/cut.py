"""What a region leaves of the boxes of points at its edge: volumes and middles."""

import itertools
from typing import NamedTuple

import numpy as np

from karamelo_py.scene.region import Region

# Parts of a box along each direction, and of those of them through which an edge passes.
COARSE = {1: 64, 2: 10, 3: 5}
FINE = {1: 64, 2: 10, 3: 5}
LEAST = 0.1  # of a box: less is given to a point beside it
NOTHING = 1e-9  # of a box: rounding
SAMPLES = 1 << 16  # places looked at at a time
ROUGH = 0.9  # of the volume in parts that an edge passes: a body hardly thicker than they are


class Pieces(NamedTuple):
    """Of boxes what lies in a region.

    Attributes
    ----------
    box, middle : ndarray (n, d)
        Middles of the boxes and of what is left of them.
    share : ndarray (n,)
        How much that is, of a whole box.
    rough : ndarray (n,)
        How much of it lies in parts through which the edge passes, where it is but estimated.
    """

    box: np.ndarray
    middle: np.ndarray
    share: np.ndarray
    rough: np.ndarray

    @classmethod
    def all_of(cls, pieces: list["Pieces"]) -> "Pieces":
        """Several as one."""
        return cls(*map(np.concatenate, zip(*pieces, strict=True)))


def cut(region: Region, x: np.ndarray, size: float) -> Pieces:
    """What lies in `region`, and in the domain, of boxes of edge length `size` around `x` (n, d).

    Boxes end at the box around the region, so that what lies along the axes is exact.
    """
    step = max(1, SAMPLES // (COARSE[x.shape[1]] + 1) ** x.shape[1])
    parts = [_cut(region, x[i : i + step], size) for i in range(0, max(len(x), 1), step)]
    return Pieces.all_of(parts)


def missed(region: Region, pieces: Pieces, size: float) -> float:
    """How thick a region must be everywhere to be seen; 0 for one that is, as far as is known."""
    seen = size / COARSE[region.dimension]
    rough = pieces.rough.sum() > ROUGH * pieces.share.sum()
    return seen if rough or _thin(region, seen, region.hi - region.lo) else 0.0


def _thin(region: Region, seen: float, whole: np.ndarray) -> bool:
    """Whether a part of it is thinner than that, along an axis along which the `whole` is not."""
    width, limit = region.hi - region.lo, np.minimum(whole, seen) * (1 - NOTHING)
    return ((width > 0) & (width < limit)).any() or any(_thin(p, seen, whole) for p in region.parts)


def _cut(region: Region, x: np.ndarray, size: float) -> Pieces:
    d = x.shape[1]
    lo = np.maximum(x - size / 2, region.lo[:d])
    edges = np.minimum(x + size / 2, region.hi[:d]) - lo
    some = (edges > NOTHING * size).all(axis=1)
    x, lo, edges = x[some], lo[some], edges[some]
    n, m = COARSE[d], FINE[d]
    corners = _inside(region, lo, edges, _lattice(np.arange(n + 1) / n, d))
    corners = corners.reshape(-1, *[n + 1] * d)
    count = sum(
        corners[:, *(slice(k, k + n) for k in shift)].astype(np.int8)
        for shift in itertools.product((0, 1), repeat=d)
    ).reshape(-1, n**d)
    filled = (count == 2**d).astype(float)
    box, part = np.nonzero((count > 0) & (count < 2**d))
    low, fine = _lattice(np.arange(n) / n, d), _lattice((np.arange(m) + 0.5) / m, d)
    moment = filled @ (low + 0.5 / n)
    rough = np.zeros(len(x))
    step = max(1, SAMPLES // len(fine))
    for i in range(0, len(box), step):
        b, p = box[i : i + step], part[i : i + step]
        within = _inside(region, lo[b] + low[p] * edges[b], edges[b] / n, fine)
        filled[b, p] = within.mean(axis=1)
        mean = filled[b, p][:, None] * low[p] + within @ fine / (n * len(fine))
        np.add.at(moment, b, mean)
        np.add.at(rough, b, filled[b, p])
    volume = filled.sum(axis=1)
    middle = lo + edges * moment / np.maximum(volume, NOTHING)[:, None]
    unit = (edges / size).prod(axis=1) / n**d
    share = volume * unit
    whole = share > 1 - NOTHING
    share[whole], middle[whole] = 1, x[whole]
    left = share > NOTHING
    return Pieces(x[left], middle[left], share[left], (rough * unit)[left])


def _lattice(along: np.ndarray, d: int) -> np.ndarray:
    return np.stack(np.meshgrid(*[along] * d, indexing="ij"), axis=-1).reshape(-1, d)


def _inside(region: Region, lo: np.ndarray, edges: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Which `places` (m, d) of boxes with lower corners and edges (n, d) are in: (n, m) bool."""
    # Regions look at one direction after another: each is a row here.
    y = np.multiply(edges.T[:, :, None], places.T[:, None, :])
    y += lo.T[:, :, None]
    return region.inside(y.reshape(len(y), -1).T).reshape(len(lo), len(places))


def join(pieces: Pieces, size: float) -> Pieces:
    """Give what is little to the nearest piece that is not, if one is in a box beside it."""
    share, middle = pieces.share.copy(), pieces.middle
    small, large = np.flatnonzero(share < LEAST), np.flatnonzero(share >= LEAST)
    if not len(large):
        return pieces
    d = middle.shape[1]
    index = np.rint((pieces.box - pieces.box.min(axis=0)) / size).astype(np.int64) + 1
    strides = np.cumprod([1, *(index.max(axis=0) + 2)[:-1]])
    key = index @ strides
    large = large[np.argsort(key[large])]
    nearest, taker = np.full(len(small), np.inf), np.full(len(small), -1)
    for beside in itertools.product((-1, 0, 1), repeat=d):
        wanted = key[small] + np.dot(beside, strides)
        found = large[np.minimum(np.searchsorted(key[large], wanted), len(large) - 1)]
        distance = np.linalg.norm(middle[found] - middle[small], axis=1)
        nearer = (key[found] == wanted) & (distance < nearest * (1 - NOTHING))
        nearest[nearer], taker[nearer] = distance[nearer], found[nearer]
    given = taker >= 0
    small, taker = small[given], taker[given]
    moment = middle * share[:, None]
    np.add.at(moment, taker, moment[small])
    np.add.at(share, taker, share[small])
    rough = pieces.rough.copy()
    np.add.at(rough, taker, rough[small])
    middle = middle.copy()
    middle[taker] = moment[taker] / share[taker][:, None]
    return Pieces(*(np.delete(a, small, axis=0) for a in (pieces.box, middle, share, rough)))
