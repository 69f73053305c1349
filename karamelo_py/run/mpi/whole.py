"""The whole scene, gathered on rank 0, for functions of all points."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from karamelo_py.kernels.arrays import Setup, arrays_of
from karamelo_py.kernels.totals import SINCE_START
from karamelo_py.run.boxes import numbers
from karamelo_py.run.checkpoint.arrays import of_nodes
from karamelo_py.run.lower.build import lower
from karamelo_py.run.mpi.partition import by_tile, join_tilings, share_of, sized, work_of
from karamelo_py.run.state import SceneState
from karamelo_py.run.tiles import SHARES, WholeDomain, in_use
from karamelo_py.scene.comm import SerialComm
from karamelo_py.script.errors import Quit


class PointsMoved(Exception):
    """A Python fix has moved points to other processes, so the step must start again."""


class Whole:
    def __init__(self, simulation: SceneState, subdomain: Any):
        self.simulation, self.subdomain = simulation, subdomain
        s, self.tiles = lower(simulation.hub, ids=(0, 1), comm=SerialComm())
        control = simulation.control._replace(ranks=s.control.ranks)
        self.setup = s._replace(control=control, contact=simulation.setup.contact)
        self.tiles.threads, self.tiles.mode = simulation.threads, simulation.mode

    def act(self, function: Callable[[Setup], None]) -> None:
        """Call a function of the whole scene on rank 0, and send its changes to all ranks.

        Raises `PointsMoved` if the function moved points; the step must then start again.
        """
        simulation, comm = self.simulation, self.simulation.comm
        self.gather()
        news = None
        if comm.leads:
            sorts = self.tiles.sorts
            try:
                with self._in_place():
                    function(self.setup)
            except BaseException:
                comm.bcast()
                raise
            moved = self.tiles.sorts > sorts
            control = simulation.control
            news = moved, control.values, control.clock.view(np.ndarray), self._nodes(moved)
        news = comm.bcast(news)
        if news is None:
            raise Quit
        moved, values, clock, rows = news
        simulation.control.values[:] = values
        simulation.control.clock.view(np.ndarray)[:] = clock
        if moved:
            self._hand_out_tiles(*rows)
            raise PointsMoved
        self._hand_back(*rows)

    @contextmanager
    def _in_place(self) -> Iterator[None]:
        simulation = self.simulation
        state = simulation.setup, simulation.tiles, simulation.comm, simulation.domain
        simulation.setup, simulation.tiles = self.setup, self.tiles
        simulation.comm, simulation.domain = SerialComm(), WholeDomain(simulation)
        try:
            yield
        finally:
            self.setup = simulation.setup
            simulation.setup, simulation.tiles, simulation.comm, simulation.domain = state

    def gather(self) -> None:
        simulation, comm = self.simulation, self.simulation.comm
        totals = simulation.control.totals
        parts = comm.gather(self._own() | {"work": totals[SINCE_START].copy()})
        totals[SINCE_START] = 0
        blocks = []
        blocks_here = zip(self.setup.blocks, simulation.setup.blocks, strict=True)
        for k, (block, mine) in enumerate(blocks_here):
            counts = [subdomain["counts"][k] for subdomain in parts or ()]
            order = by_tile([subdomain["tiling"][k] for subdomain in parts]) if comm.leads else None
            points = sized(block.points, sum(counts)) if comm.leads else block.points
            rows = [array for _, array in arrays_of(points)]
            for row, (_, array) in zip(rows, arrays_of(mine.points), strict=True):
                for c in np.ndindex(array.shape[:-1]):
                    comm.gather_rows(array[c], row[c] if comm.leads else None, counts)
                    if comm.leads:
                        row[c] = row[c][order]
            blocks.append(block._replace(points=points))
        self.setup = self.setup._replace(blocks=tuple(blocks))
        if comm.leads:
            totals[SINCE_START] = sum(subdomain["work"] for subdomain in parts)
            self._join(parts)

    def _own(self) -> dict:
        simulation, subdomain = self.simulation, self.subdomain
        s, nodes = simulation.setup, subdomain.counted()
        return {
            "counts": [block.points.mass.size for block in s.blocks],
            "tiling": [
                {name: getattr(tiling, name)[:rows] for name, rows in in_use(tiling)}
                | {"report": tiling.report[: tiling.count[0]]}
                for tiling in (block.tiling for block in s.blocks)
            ],
            "nodes": nodes,
            "at nodes": [array[nodes] for _, array in of_nodes(s)],
            "memory": [array[nodes] for array in subdomain.memory()],
        }

    def _join(self, parts: list[dict]) -> None:
        whole, tiles = self.setup, self.tiles
        for k, block in enumerate(whole.blocks):
            block.tiling.count[1] = 1 if tiles.direct else SHARES
            join_tilings(block.tiling, [subdomain["tiling"][k] for subdomain in parts])
        tiles.empty_nodes(whole)
        tiles.lay_out(whole)
        nodes = numbers(whole.spans)
        for _, array in of_nodes(whole):
            array[nodes] = 0  # also at nodes that no box reaches
        memory = self.subdomain.memory()
        for subdomain in parts:
            for (_, array), rows in zip(of_nodes(whole), subdomain["at nodes"], strict=True):
                array[subdomain["nodes"]] = rows
            for array, rows in zip(memory, subdomain["memory"], strict=True):
                array[subdomain["nodes"]] = rows

    def _nodes(self, moved: bool) -> tuple:
        subdomain, tiles = self.subdomain, self.simulation.tiles
        nodes = numbers(self.setup.spans)
        if not moved:
            return nodes, [array[nodes] for _, array in of_nodes(self.setup)]
        tiles.share_out(work_of(tiles.loads(self.setup.blocks), subdomain.load.costs))
        return tiles.owner, nodes, [one[nodes] for one in subdomain.memory()]

    def _shares(self) -> list[dict[str, np.ndarray]] | None:
        comm, owner = self.simulation.comm, self.simulation.tiles.owner
        if not comm.leads:
            return None
        return [share_of(self.setup, owner == rank) for rank in range(comm.size)]

    def _hand_out_tiles(self, owner: np.ndarray, nodes: np.ndarray, memory: list) -> None:
        simulation, subdomain = self.simulation, self.subdomain
        simulation.tiles.owner = owner
        subdomain.put([simulation.comm.scatter(self._shares())])
        for one, rows in zip(subdomain.memory(), memory, strict=True):
            one[nodes] = rows

    def _hand_back(self, nodes: np.ndarray, rows: list) -> None:
        s, subdomain = self.simulation.setup, self.simulation.comm.scatter(self._shares())
        here = np.isin(nodes, numbers(s.spans))
        for (_, array), mine in zip(of_nodes(s), rows, strict=True):
            array[nodes[here]] = mine[here]
        for k, block in enumerate(s.blocks):
            for name, array in arrays_of(block.points):
                array[...] = subdomain[f"points/{k}/{name}"]
