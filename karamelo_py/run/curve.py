"""A curve through all places of a grid, ranges of which are compact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def along_curve(shape: Sequence[int], size: Sequence[int]) -> np.ndarray:
    """The number of each place, in the order of rows, along Hilbert's curve.

    Places have a `size` in each direction. The curve goes through the cube around the grid, first
    through a half across its longest direction, and not all that it passes is a place. After
    Skilling, J. (2004), "Programming the Hilbert curve", AIP Conference Proceedings 707, 381-387.
    """
    steps = np.array(size) // min(size)
    x = np.indices(shape).reshape(len(shape), -1) * steps[:, None]
    if len(shape) == 1:
        return x[0]
    x = x[np.argsort(-steps * shape, kind="stable")]
    bits = range(int(x.max()).bit_length())
    for bit in reversed(bits[1:]):
        below = (1 << bit) - 1
        for k in range(len(x)):
            turned = x[k] >> bit & 1 == 1
            swapped = np.where(turned, 0, (x[0] ^ x[k]) & below)
            x[k] ^= swapped
            x[0] ^= np.where(turned, below, swapped)
    for k in range(1, len(x)):
        x[k] ^= x[k - 1]
    turned = np.zeros_like(x[0])
    for bit in bits[1:]:
        turned ^= np.where(x[-1] >> bit & 1, (1 << bit) - 1, 0)
    x ^= turned
    key = np.zeros_like(x[0])
    for bit in reversed(bits):
        for along in x:
            key = key << 1 | along >> bit & 1
    number = np.empty_like(key)
    number[np.argsort(key)] = np.arange(len(key))
    return number
