"""Periodic directions of a run: nodes a period apart, and points that return."""

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import TIMESTEP, Setup
from karamelo_py.kernels.equations.periodic import EVERY, Axis, InUse, Seam
from karamelo_py.run.boxes import numbers
from karamelo_py.scene.domain import Domain


def seam_of(s: Setup, domain: Domain) -> Seam:
    grids, axes = s.grids, []
    strides = int(grids.step_x[0]), int(grids.step_y[0]), 1
    for k in domain.periodic:
        cells = int((grids.nx, grids.ny, grids.nz)[k][0])
        axes.append(Axis(int(grids.first[0]), strides[k], cells + 1, domain.cells_of_period(k)))
    return Seam(tuple(axes))


def return_points(s: Setup, domain: Domain) -> None:
    """Move points outside by whole periods; only at steps that do not depend on restarts."""
    if int(s.control.values[TIMESTEP]) % EVERY:
        return
    for block in s.blocks:
        places = block.points.x[s.control.motion[0].now]
        for k in domain.periodic:
            lo, length = domain.lo[k], domain.hi[k] - domain.lo[k]
            periods = np.floor((places[k] - lo) / length)
            away = periods != 0
            places[k, away] -= length * periods[away]


def mark_nodes(s: Setup) -> None:
    used = field(s.nodes.fields, InUse)
    used[:] = 0
    used[numbers(s.spans), 0] = 1
