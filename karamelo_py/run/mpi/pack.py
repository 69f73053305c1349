"""Points and tiles by name, on their way from one process to another."""

import numpy as np

from karamelo_py.compiler.fields import some_points
from karamelo_py.kernels.arrays import Block, Setup, Tiling, arrays_of
from karamelo_py.run.boxes import between
from karamelo_py.run.mpi.partition import occupied
from karamelo_py.run.tiles import in_use, one_after_another, shares_of

ROWS = ("number", "range", "grid", "box", "rows")  # of a tiling


def share_of(s: Setup, own: np.ndarray) -> dict[str, np.ndarray]:
    """Pack the points and tiles of `s` in tiles of which `own` says so, by name."""
    found = {}
    for k, block in enumerate(s.blocks):
        found |= share_of_block(k, block, own)
    return found


def share_of_block(k: int, block: Block, own: np.ndarray) -> dict[str, np.ndarray]:
    """Pack the points and tiles of the k-th block in tiles of which `own` says so, by name."""
    points, found = share_of_tiling(k, block.tiling, own)
    return found | {
        f"points/{k}/{name}": some_points(array, points) for name, array in arrays_of(block.points)
    }


def share_of_tiling(
    k: int, tiling: Tiling, own: np.ndarray
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Find the points in tiles of which `own` says so, and pack these tiles."""
    which = np.flatnonzero(own[occupied(tiling)[0]])
    ranges = tiling.range[which]
    points = between(*ranges.T)
    rows = {name: getattr(tiling, name)[which] for name in ROWS}
    rows["range"] = one_after_another(ranges)
    rows["count"] = np.array([len(which), *tiling.count[1:]])
    rows["share"] = shares_of(rows["range"], int(tiling.count[1]), len(tiling.share))
    return points, {f"tiling/{k}/{name}": array for name, array in rows.items()}


def tilings_in_use(s: Setup) -> list[dict[str, np.ndarray]]:
    """List the tiles of each block by name, as far as they are in use."""
    tilings = [block.tiling for block in s.blocks]
    return [{name: getattr(one, name)[:rows] for name, rows in in_use(one)} for one in tilings]


def stripped(found: dict[str, np.ndarray], stem: str) -> dict[str, np.ndarray]:
    """Choose the arrays whose names begin so, and name them without that."""
    return {n.removeprefix(stem): array for n, array in found.items() if n.startswith(stem)}


def _joint(tilings: list[dict[str, np.ndarray]], name: str) -> np.ndarray:
    """Join rows of the tiles of all processes, one process after another."""
    return np.concatenate([part[name][: part["count"][0]] for part in tilings])


def by_tile(tilings: list[dict[str, np.ndarray]]) -> np.ndarray:
    """Find the order of tiles for points that stand one process after another."""
    ranges = one_after_another(_joint(tilings, "range"))
    return between(*ranges[np.argsort(_joint(tilings, "number"))].T)


def join_tilings(tiling: Tiling, tilings: list[dict[str, np.ndarray]]) -> None:
    """Join the tiles of all processes, in the order of their numbers."""
    order = np.argsort(_joint(tilings, "number"))
    tiling.count[0] = len(order)
    names = [name for name in (*ROWS, "report") if name in tilings[0]]
    rows = {name: _joint(tilings, name)[order] for name in names}
    ranges = one_after_another(rows["range"])
    if "report" in rows:
        # Points that went wrong keep their place in their tile.
        wrong = rows["report"][:, 2] > 0
        rows["report"][wrong, 2] += (ranges - rows["range"])[wrong, 0]
    for name, array in (rows | {"range": ranges}).items():
        getattr(tiling, name)[: len(order)] = array
    tiling.share[:] = shares_of(ranges, int(tiling.count[1]), len(tiling.share))
