"""The arrays of a whole scene, from the parts of all processes."""

from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import Block, Setup, arrays_of
from karamelo_py.run.checkpoint.arrays import of_nodes
from karamelo_py.run.mpi.crew import Crew
from karamelo_py.run.mpi.pack import by_tile, join_tilings
from karamelo_py.run.mpi.partition import joined, sized
from karamelo_py.run.tiles.boxes import numbers
from karamelo_py.run.tiles.tiles import SHARES, Tiles


def lined_up(
    crew: Crew, blocks: tuple[Block, ...], own: tuple[Block, ...], parts: list[dict] | None
) -> tuple[Block, ...]:
    """The blocks of the whole, at the first with the points of all, tile after tile.

    They come component by component, so that nothing of that size is there twice. `parts` are what
    `Part.shown` says of all.
    """
    whole = []
    for k, (block, mine) in enumerate(zip(blocks, own, strict=True)):
        counts = [part["counts"][k] for part in parts] if parts is not None else []
        order = by_tile([part["tiling"][k] for part in parts]) if parts else None
        points = sized(block.points, sum(counts)) if crew.leads else block.points
        rows = [array for _, array in arrays_of(points)]
        for row, (_, array) in zip(rows, arrays_of(mine.points), strict=True):
            for c in np.ndindex(array.shape[:-1]):
                crew.lined_up(array[c], row[c] if crew.leads else None, counts)
                if crew.leads:
                    row[c] = row[c][order]
        whole.append(block._replace(points=points))
    return tuple(whole)


def spread(crew: Crew, blocks: tuple[Block, ...]) -> tuple[Block, ...]:
    """Give the points of the first to all."""
    own = [[a for _, a in arrays_of(b.points)] for b in blocks] if crew.leads else None
    found = crew.told(own)
    return tuple(
        block._replace(points=joined(block.points, [arrays]))
        for block, arrays in zip(blocks, found, strict=True)
    )


def join(whole: Setup, tiles: Tiles, memory: list[np.ndarray], parts: list[dict[str, Any]]) -> None:
    """Tiles and nodes of the whole from those of all, and what contact remembers of nodes."""
    for k, block in enumerate(whole.blocks):
        block.tiling.count[1] = 1 if tiles.direct else SHARES
        join_tilings(block.tiling, [part["tiling"][k] for part in parts])
    tiles.empty_nodes(whole)
    tiles.lay_out(whole)
    nodes = numbers(whole.spans)
    for _, array in of_nodes(whole):
        array[nodes] = 0  # also those that no box reaches: nobody has them
    for part in parts:
        for (_, array), rows in zip(of_nodes(whole), part["at nodes"], strict=True):
            array[part["nodes"]] = rows
        for array, rows in zip(memory, part["memory"], strict=True):
            array[part["nodes"]] = rows
