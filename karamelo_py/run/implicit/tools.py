"""Forces of tools on points within Newton's method."""

from typing import Any

import numpy as np
import scipy.sparse as sp

from karamelo_py.run.implicit.equations import Equations
from karamelo_py.run.state import SceneState
from karamelo_py.scene.modify import Fix, PointsView

NEAR = 1e-6  # step of finite differences, in cells


class Displaced:
    """A view of points displaced by `way` (n, d), with unchanged volume and damage."""

    def __init__(self, view: PointsView, way: np.ndarray):
        self.view, self.position = view, view.position + way

    def __getattr__(self, name: str) -> Any:
        return getattr(self.view, name)


class PushingTool:
    def __init__(self, fix: Fix, equations: Equations, simulation: SceneState):
        self.fix, self.d = fix, equations.d
        self.near = NEAR * float(np.min(equations.s.grids.spacing))
        self.view = PointsView(simulation, simulation.points.members(fix.group), then=False)
        rows, columns, weights = [], [], []
        pairs = zip(equations.blocks, equations.parts, strict=True)
        seen_by = {id(block): seen for block, (seen, _) in pairs}
        for piece in self.view._rows.parts:
            if id(piece.block) in seen_by:
                seen = seen_by[id(piece.block)]
                rows.append(np.repeat(piece.places, seen.nodes.shape[1]))
                columns.append(seen.nodes[piece.rows].ravel())
                weights.append(seen.weights[piece.rows].ravel())
        at = np.concatenate(rows), np.concatenate(columns)
        shape = len(self.view.ids), len(equations.nodes)
        self.gather = sp.csr_matrix((np.concatenate(weights), at), shape)
        self.gather_all = equations.for_all_components(self.gather)
        self.way = np.zeros((shape[0], self.d))
        self.included = self.force = self.at(self.way)  # force in nodal forces; present force

    def at(self, way: np.ndarray) -> np.ndarray:
        return self.fix.forces(Displaced(self.view, way))

    def respond(self, u: np.ndarray) -> None:
        self.way = self.gather @ u
        self.force = self.at(self.way)

    def forces(self) -> np.ndarray:
        return self.gather.T @ (self.force - self.included)

    def matrix(self) -> sp.bsr_matrix:
        n = len(self.way)
        slopes = np.empty((n, self.d, self.d))
        for j, step in enumerate(self.near * np.eye(self.d)):
            slopes[:, :, j] = (self.at(self.way - step) - self.at(self.way + step)) / 2 / self.near
        blocks = sp.bsr_matrix((slopes, np.arange(n), np.arange(n + 1)))
        return (self.gather_all.T @ blocks @ self.gather_all).tobsr((self.d, self.d))

    def publish(self) -> None:
        """Publish the force; give points its mean over the step, for the right work."""
        self.force = self.at(self.way)
        self.view.force = self.view.force + (self.force - self.included) / 2
        self.view.write_back()
        self.fix.publish_load(Displaced(self.view, self.way), self.force)
