"""Copies of axisymmetric points around the axis y, in 3D."""

from collections.abc import Callable

import numpy as np

FRAME = {"11": (0, 0), "22": (1, 1), "33": (2, 2), "12": (0, 1), "13": (0, 2), "23": (1, 2)}
# Components of vectors along radius, axis and circumference (None: 0), by their names in 3D.
VECTORS = {
    ("x", "y", "z"): ("x", "y", None),
    ("x0", "y0", "z0"): ("x0", "y0", None),
    ("vx", "vy", "vz"): ("vx", "vy", "vtheta"),
    ("bx", "by", "bz"): ("bx", "by", None),
}


def revolved(
    names: tuple[str, ...], column: Callable[[str], np.ndarray], angle: float
) -> list[np.ndarray]:
    """Return columns (n,) in 3D of a copy at an angle from x to z.

    `column` returns a column of the half plane. Positions and tensors, but not reference positions,
    are also rotated by the angle of twist.
    """
    made: dict[str, np.ndarray] = {}
    twist = column("twist")
    for components, parts in VECTORS.items():
        if not set(components) & set(names):
            continue
        a = angle + (0 if components[0] == "x0" else twist)
        along, axial, around = (0 * twist if name is None else column(name) for name in parts)
        turned = (
            along * np.cos(a) - around * np.sin(a),
            axial,
            along * np.sin(a) + around * np.cos(a),
        )
        made.update(zip(components, turned, strict=True))
    for kind in "set":
        wanted = {kind + name: places for name, places in FRAME.items() if kind + name in names}
        if not wanted:
            continue
        c, s, zero = np.cos(angle + twist), np.sin(angle + twist), 0 * twist
        Q = np.array([[c, zero, -s], [zero, zero + 1, zero], [s, zero, c]])
        S = np.empty((3, 3, len(twist)))
        for name, (i, j) in FRAME.items():
            S[i, j] = S[j, i] = column(kind + name)
        rotated = np.einsum("ikn,kln,jln->ijn", Q, S, Q)
        made.update({name: rotated[places] for name, places in wanted.items()})
    return [made[name] if name in made else column(name) for name in names]
