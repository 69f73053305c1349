"""Values at nodes that fixes prescribe."""

from collections.abc import Callable

import numpy as np

from karamelo_py.kernels.arrays import Setup

SHOWN = 1e20  # a value that no script prescribes


def prescribed(
    s: Setup, update: np.ndarray, nodes: np.ndarray, count: int, hold: Callable[[], object]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find which of the first `count` columns of `update` fixes prescribe at nodes (m,).

    Fixes, which `hold` runs, are shown two values: what comes out the same is what they prescribe.

    Returns
    -------
    given, values, changed
        (m, count) what is prescribed, and the values, 0 elsewhere; what is changed by what it is.
    """
    totals = s.control.totals.copy()
    found = []
    for shown in (-SHOWN, SHOWN):
        update[nodes] = 0
        update[nodes, :count] = shown
        hold()
        found.append(update[nodes, :count].astype(float))
    s.control.totals[:] = totals
    given = found[0] == found[1]
    changed = ~given & ((found[0] != -SHOWN) | (found[1] != SHOWN))
    return given, np.where(given, found[0], 0.0), changed
