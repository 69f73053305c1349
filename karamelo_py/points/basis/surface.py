"""Distance of a body's surface from a node, from sums over its points."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.grid import Grid
from karamelo_py.points.kinematics import Line

CELLS = 16  # samples per cell along a line
ENTRIES = 256  # table entries per cell


def profile(basis: NamedTuple, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions in cells from a node, and weights at these, averaged over point domains."""
    x = np.arange(-3 * ENTRIES, 3 * ENTRIES + 1) / ENTRIES
    if basis.traits.shape:
        hats = np.maximum(1 - np.abs(x), 0)
        box = np.ones(max(round(2 * half * ENTRIES), 1) | 1)
        return x, np.convolve(hats, box / len(box), mode="same")
    middle = CELLS // 2
    line = Grid(0.0, 0.0, 0.0, 1.0, 1.0, 1.0, CELLS, 1, 1, float(CELLS), 0.0, 0.0, 0.0, 1, 1, 0, 0)
    weights = np.zeros(len(x))
    for q, position in enumerate(x):
        stencil = locate(basis, Line(), line, (middle + float(position),))
        for k in range(support(basis, Line())):
            node, weight, _ = entry(basis, Line(), line, stencil, k)
            weights[q] += weight if node == middle else 0
    return x, weights


@lru_cache(typed=True)
def surface_table(basis: NamedTuple, half: float) -> np.ndarray:
    """Tabulate the distance of a plane surface from a node against the points' mean position.

    Points of equal mass lie in layers below the surface, the first at half their size. Distances
    are in cells along the outward normal; row k is for a mean of k / ENTRIES - 3 (after Nairn 2013,
    "Modeling imperfect interfaces in the material point method using multimaterial methods", CMES
    92(3), section 4, who uses a power law).
    """
    means = np.arange(-3 * ENTRIES, ENTRIES + 1) / ENTRIES
    if basis.traits.nodes_per_cell > 1:
        # Functions differ from node to node, so the gap is unknown: contact is at a common node.
        return np.full(len(means), 3.0)
    x, weights = profile(basis, half)
    surfaces = np.arange(-2.5, 2.5, 0.5 / ENTRIES)
    layers = np.arange(half, 8, 2 * half)
    positions = surfaces[:, None] - layers
    seen = np.interp(positions, x, weights)
    near = seen.sum(axis=1) > 0
    mean = (seen * positions).sum(axis=1)[near] / seen.sum(axis=1)[near]
    mean = np.maximum.accumulate(mean)
    # The mean is constant once a body fills a node's support: use the first such surface.
    mean, first = np.unique(np.round(mean, 9), return_index=True)
    return np.interp(means, mean, surfaces[near][first])
