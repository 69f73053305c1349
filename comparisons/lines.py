"""Distances between measured and computed lines."""

import numpy as np


def distance(points, line):
    """Mean distance of points from a broken line (rows of x and y)."""
    start, along = line[:-1], np.diff(line, axis=0)
    ahead = points[:, None] - start
    share = (ahead * along).sum(-1) / (along**2).sum(-1)
    away = ahead - np.clip(share, 0, 1)[..., None] * along
    return np.hypot(away[..., 0], away[..., 1]).min(axis=1).mean()


def surface(points, density, width):
    """Height of what lies on a floor, as if it had its first density, over columns of a width."""
    first = np.floor(points.x.min() / width) * width
    edges = np.arange(first, points.x.max() + 2 * width, width)
    volume, _ = np.histogram(points.x, edges, weights=points.mass / density)
    return np.column_stack([(edges[1:] + edges[:-1]) / 2, volume / width])


def unmoved(points, limit):
    """The upper ends of the columns of points that have moved by less than `limit`."""
    moved = np.hypot(points.x - points.x0, points.y - points.y0)
    still = moved < limit
    columns = np.unique(points.x0[still])
    top = [points.y0[still & (points.x0 == x)].max() for x in columns]
    return np.column_stack([columns, top])
