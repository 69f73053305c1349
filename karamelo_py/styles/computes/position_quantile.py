"""compute position_quantile."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import In
from karamelo_py.output.point_table import PointTable
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute

BITS = 8  # of a coordinate that are looked at together
SIGN = np.uint64(1 << 63)


class PositionQuantile(Compute):
    """Measure the coordinates below which a share of the mass lies, each on its own.

    Published as ID_x, ID_y, ID_z. A front measured so does not jump after a few points that fly
    ahead, as the largest position does.

    Parameters
    ----------
    share
        Share of the mass, from 0 (the lowest point) to 1 (the highest).

    Example
    -------
    compute(front, position_quantile, all, 0.99)
    log_modify(custom, time, front_x)

    Notes
    -----
    The first coordinate at which the mass of the points up to there reaches the share.

    See Also
    --------
    max_position, center_of_mass
    """

    published = ("x", "y", "z")

    def __init__(self, hub: Hub, group: ParticleGroup, share: Annotated[float, In(0, 1)]):
        super().__init__(hub, group)
        self.share = share

    def refresh(self) -> None:
        """Measure and publish."""
        d = self.hub.domain.dimension
        # Of the bits of the coordinates, eight at a time: which come first is known so far.
        first, below = [0] * d, np.zeros(d)
        for shift in range(64 - BITS, -1, -BITS):
            mass = self.hub.fields.added_up(self, "masses", shift, first).reshape(d, -1)
            if shift == 64 - BITS:
                # Shares such as 0.1 of ten equal points must not fail by rounding.
                wanted = self.share * mass.sum(axis=1) * (1 - 1e-12)
            for axis, of_bits in enumerate(mass):
                there = np.flatnonzero(of_bits)
                if not len(there):  # no points
                    self.publish_components(np.zeros(d))
                    return
                up_to = below[axis] + np.cumsum(of_bits[there])
                own = there[min(np.count_nonzero(up_to < wanted[axis]), len(there) - 1)]
                below[axis] += of_bits[:own].sum()
                first[axis] = first[axis] << BITS | int(own)
        self.publish_components(_numbers(np.array(first, np.uint64)))

    def masses(self, points: PointTable, shift: int, first: list[int]) -> tuple:
        """Masses of points whose coordinates begin with these bits, by the next ones."""
        found = []
        for axis, begin in enumerate(first):
            bits = _bits(points.position[:, axis].astype(float)) >> np.uint64(shift)
            rows = np.flatnonzero(bits >> np.uint64(BITS) == begin)
            own = (bits[rows] & np.uint64(2**BITS - 1)).astype(np.int64)
            found.append((own + axis * 2**BITS, points.mass[rows].astype(float)))
        rows, terms = (np.concatenate(same) for same in zip(*found, strict=True))
        return len(first) * 2**BITS, rows, terms


def _bits(numbers: np.ndarray) -> np.ndarray:
    """Whole numbers in the order of floating-point ones."""
    bits = (numbers + 0.0).view(np.uint64)  # no zero with a sign
    return np.where(bits >> np.uint64(63) > 0, ~bits, bits | SIGN)


def _numbers(bits: np.ndarray) -> np.ndarray:
    """The numbers that have these bits."""
    return np.where(bits >> np.uint64(63) > 0, bits ^ SIGN, ~bits).view(float)
