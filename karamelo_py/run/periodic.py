"""Periodic directions of a run."""

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import TIME, TIMESTEP, Setup
from karamelo_py.kernels.equations.periodic import EVERY, GHOSTS, Axis, InUse, Seam, position_on
from karamelo_py.kernels.equations.sheared import Shear
from karamelo_py.run.boxes import numbers
from karamelo_py.scene.domain import Domain
from karamelo_py.script.errors import ScriptError


def seam_of(s: Setup, domain: Domain) -> Seam:
    grids, axes = s.grids, []
    strides = int(grids.step_x[0]), int(grids.step_y[0]), 1
    for k in domain.periodic:
        cells = int((grids.nx, grids.ny, grids.nz)[k][0])
        axes.append(Axis(int(grids.first[0]), strides[k], cells + 1, domain.cells_of_period(k)))
    if not domain.shear:
        return Seam(tuple(axes), tuple(axes))
    x, y, *others = axes
    h = float(grids.spacing[0])
    speed = domain.shear * float(domain.hi[1] - domain.lo[1])
    return Seam(tuple(axes), (x, *others), Shear(x, y, speed, h))


def return_points(s: Setup, domain: Domain) -> None:
    """Move points outside the domain by whole periods, at steps that do not depend on restarts."""
    if int(s.control.values[TIMESTEP]) % EVERY:
        return
    for block in s.blocks:
        places = block.points.x[s.control.motion[0].now]
        stored = [
            one.array[first:]
            for one in block.points.fields
            if (first := one.position(s.kin)) is not None
        ]
        for k in reversed(domain.periodic):
            lo, length = domain.lo[k], domain.hi[k] - domain.lo[k]
            periods = np.floor((places[k] - lo) / length)
            away = periods != 0
            for positions in (places, *stored):
                positions[k, away] -= length * periods[away]
            if k == 1 and domain.shear:
                speed = domain.shear * length * periods[away]
                for positions in (places, *stored):
                    positions[0, away] -= speed * s.control.values[TIME]
                block.points.v[0, away] -= speed


def mark_nodes(s: Setup, domain: Domain) -> None:
    used = field(s.nodes.fields, InUse)
    used[:] = 0
    used[numbers(s.spans), 0] = 1
    if not domain.shear:
        return
    n, home = np.arange(len(used)), np.ones(len(used), bool)
    for axis in s.control.ranks.axes:
        node = position_on(axis, n) - GHOSTS
        home &= (node >= 0) & (node < axis.period)
    if not used[home, 0].all():
        raise ScriptError(
            "a sheared cell has empty places",
            expected="bodies that fill the cell of boundary(periodic, ..., shear=...)",
        )
