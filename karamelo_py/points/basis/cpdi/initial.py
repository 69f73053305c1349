"""The domains of points before the first step, from what a solid says of its points.

A solid has `half_size` (n, d), of the box around each point, and, where it comes from a mesh,
`corners` (n, c, d), of the element around each point.
"""

from __future__ import annotations

from typing import Any

import numpy as np


def half_edges(solid: Any) -> np.ndarray:
    """Half edges along the axes, one after another (n, d * d)."""
    half = solid.half_size
    d = half.shape[1]
    return (half[:, :, None] * np.eye(d)).reshape(-1, d * d)


def element_corners(solid: Any, signs: np.ndarray | None = None) -> np.ndarray:
    """Corners (n, c * d) of the elements of a mesh, else of the boxes around points.

    `signs` (c, d) are the corners of the box of side 2 around 0.
    """
    corners = solid.corners
    if corners is None:
        corners = solid.x0[:, None, :] + signs * solid.half_size[:, None, :]
    return corners.reshape(len(corners), -1).astype(float)


def turned(places: np.ndarray, negative: np.ndarray, order: list[int], d: int) -> np.ndarray:
    """Corners (n, c * d) in another order where the volume in the present one is negative."""
    corners = places.reshape(len(places), -1, d).copy()
    corners[negative] = corners[negative][:, order]
    return corners.reshape(len(places), -1)
