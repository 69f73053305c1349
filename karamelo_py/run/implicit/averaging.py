"""F-bar in implicit steps."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.sparse as sp

from karamelo_py.kernels import implicit_averaging as loops
from karamelo_py.kernels.implicit import PARTS, Blocks


class AveragedVolumes:
    def __init__(self, equations: Any):
        self.equations, self.mode = equations, equations.mode
        kin = equations.s.kin
        self.averages = [loops.nothing_averaged(kin, block) for block in equations.blocks]

    def _parts(self) -> Iterator[tuple]:
        e = self.equations
        return (
            (e.matter(block), seen, response, averages)
            for block, (seen, response), averages in zip(
                e.blocks, e.parts, self.averages, strict=True
            )
        )

    def _sums(self, name: str) -> np.ndarray:
        rows = [getattr(averages, name)[0] for averages in self.averages]
        return self.equations.weights.T @ np.concatenate(rows)

    def _average(self, nodes: np.ndarray, name: str) -> None:
        """Fill a row of `Averages` with the averages at points of nodal values (m,)."""
        rows, begin = self.equations.weights @ nodes, 0
        for averages in self.averages:
            row = getattr(averages, name)[0]
            row[:] = rows[begin : (begin := begin + len(row))]

    def _grow(self) -> None:
        for matter, _, response, averages in self._parts():
            loops.grow(self.mode, PARTS, matter, response, averages)
        self.volume = self._sums("volume")
        self.volume[self.volume == 0] = 1.0

    def respond(self, dt: float) -> None:
        self._grow()
        self._average(self._sums("grown") / self.volume, "ratio")
        for matter, _, response, averages in self._parts():
            loops.respond_averaged(self.mode, PARTS, matter, dt, response, averages)
        self._bring_mean()

    def keep_stress(self) -> None:
        for matter, _, response, averages in self._parts():
            loops.keep_averaged_stress(matter, response, averages)
        self._grow()
        self._bring_mean()

    def _bring_mean(self) -> None:
        self._average(self._sums("pressure") / self.volume, "mean")
        for _, _, response, averages in self._parts():
            loops.bring_mean(self.mode, PARTS, self.equations.s.kin, response, averages)

    def _matrix(self, name: str) -> sp.csr_matrix:
        e = self.equations
        k = e.per_node
        columns = (e.pairs[1][:, None] * k + np.arange(k)).ravel()
        data = np.zeros(len(columns))
        for _, seen, _, averages in self._parts():
            tensors = getattr(averages, name)
            loops.add_slopes(self.mode, PARTS, e.s.kin, seen, tensors, Blocks(e.layout, data))
        m = len(e.nodes)
        return sp.csr_matrix((data, columns, k * e.layout.first), (m, m * k))

    def stiffness(self) -> sp.csr_matrix:
        e, m = self.equations, len(self.equations.nodes)
        S = sp.diags(1 / self.volume) @ self._matrix("cofactors")
        data = np.zeros(len(e.pairs[1]))
        for _, seen, _, averages in self._parts():
            loops.add_products(self.mode, PARTS, seen, averages.stiffness, Blocks(e.layout, data))
        Z = sp.csr_matrix((data, e.pairs[1], e.layout.first), (m, m))
        return self._matrix("by_ratio").T @ S + S.T @ (self._matrix("of_pressure") + Z @ S)
