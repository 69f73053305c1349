"""Basis linear: hat functions on the nodes."""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.language.rules import known_failure
from karamelo_py.points.basis import BasisTraits, mapped_again, without_moment
from karamelo_py.points.basis.product import Along, along, register
from karamelo_py.points.grid import cells_along, in_cells
from karamelo_py.points.transfers import flip_coefficient

STRETCH = 0.3  # strain above which points at distances of a cell separate
SMALL = 0.3  # fraction of the stable step up to which impacts conserve energy
PER_CELL = 0.17  # stress decreases by about exp(-0.17 N) if stressed material crosses N cells
WARNED_LOSS = 0.03  # loss of stress for a warning


class Linear(NamedTuple):
    """Linear hat functions on the nodes: the basis of the original MPM (Sulsky et al. 1994).

    This is the cheapest basis. The gradient jumps at cell faces: when a stressed point crosses a
    face, nodal forces jump, too (cell-crossing error).

    Example
    -------
    method(ulmpm, FLIP, linear, 1)
    """

    in_lanes = True
    traits = BasisTraits(
        cells=1, least_nodes=2, steady_moment=False, steep_edge=True, gradient_jumps=True
    )


WIDEST = 1.5  # distance in cells up to which points have common nodes


def _apart(scene: Any) -> dict[str, Any] | None:
    for solid in scene.hub.solids.values():
        if len(solid.half_size):
            cells = 2 * float(np.median(solid.half_size)) / scene.hub.domain.h
            if cells > WIDEST:
                return {"solid": solid.id, "cells": cells}
    return None


known_failure(
    Linear,
    "numerical fracture",
    when=lambda basis, scene: scene.moves and scene.elastic and scene.strain > STRETCH,
    reason="strains will be about {scene.strain:.1g} (from speed and weight); with a linear basis, "
    "points more than a cell apart separate (numerical fracture)",
    cure="method tlmpm or ulcpdi, or a spline basis",
)


def _meet_again(basis, scene):
    domain, factor = scene.hub.domain, scene.hub.update.dt_factor
    far = max(domain.hi[: scene.d] - domain.lo[: scene.d])
    small = factor is not None and factor <= SMALL
    kept = scene.moves and flip_coefficient(scene.transfer) > 0.9 and not small
    return kept and len(scene.elastic) > 1 and scene.fastest * scene.duration > far


known_failure(
    Linear,
    "repeated contact",
    when=_meet_again,
    reason="{scene.transfer_name} with a linear basis gains energy at each impact of elastic "
    "bodies, and there is time for many impacts (two disks in a box, 50 impacts: up to 1.1 times "
    "the energy; two to four times with a FLIP coefficient of 0.99)",
    cure=f"quadratic-spline, or dt_factor({SMALL:g})",
)
CROSSING = "stress lost across cells"
CURE = "cpgimp or quadratic-spline instead of linear, with FLIP 0.99 (pressure within 3 %)"
known_failure(
    Linear,
    CROSSING,
    when=lambda basis, scene: scene.crossing.lost > WARNED_LOSS,
    reason="material under impact or initial stress will move at {scene.crossing.speed:.3g} "
    "through {scene.crossing.cells:.2g} cells while stressed; with a linear basis its pressure "
    "falls by 10 to 35 % in each, about {scene.crossing.percent:.0f} % on average, "
    "half at places",
    cure=CURE,
)
known_failure(
    Linear,
    "weight on a soft body",
    when=lambda basis, scene: scene.settling.cells > 0,
    reason="at rest, weight compresses solid '{scene.settling.name}' by "
    "{scene.settling.strain:.2g} of its length, and its end moves by {scene.settling.cells:.2g} "
    "cells; stressed points that cross cells of a linear basis lose stress, so the body comes to "
    "rest 20 % (at 0.26 cells) to 70 % (at 0.64) too far",
    cure="cpgimp or quadratic-spline instead of linear, or tlmpm",
)
known_failure(
    Linear,
    "driven across cells",
    when=lambda basis, scene: scene.driven.cells > 0,
    reason="fixes stretch, compress or shear solid '{scene.driven.name}' by "
    "{scene.driven.cells:.2g} cells; with a linear basis, stresses scatter where points cross "
    "cells (in a bar pulled by 0.3 cells by 30 %, by 0.5 cells more than 100 %)",
    cure="cpgimp instead of linear (within 1 %), or tlmpm",
)
known_failure(
    Linear,
    "points far apart",
    when=lambda basis, scene: _apart(scene),
    reason="points of solid '{solid}' are {cells:.2g} cells apart, such as one in each element of "
    "a mesh: they share no nodes and do not hold together",
    cure="region(ID, mesh, FILE) with solid(ID, region, ...), which puts points in cells; a finer "
    "mesh, or a basis cpdi",
)
known_failure(
    Linear,
    "hourglasses",
    when=lambda basis, scene: not scene.moves and scene.d > 1 and bool(scene.single),
    reason="one point per cell (solid '{scene.single[0]}') with a linear basis in the total frame "
    "does not resist hourglass modes: nodes oscillate without any force",
    cure="{scene.corners} points per cell, or Bernstein-quadratic",
)
known_failure(
    Linear,
    "one row of points",
    when=lambda basis, scene: scene.bent_row,
    reason="solid '{solid}' is {cells:.2g} cells thick with one row of points across, which has no "
    "bending stiffness to resolve: strain is the same on both sides (a cantilever of half a cell "
    "bends by 0.0004 of beam theory)",
    cure="cells of a quarter of its thickness, with two points per direction (two rows in half a "
    "cell reach 0.38 of beam theory)",
)


@along.on(Linear)
def _along_linear(basis, kin, grid, location, direction):
    a = in_cells(grid, direction, location[direction])
    i = min(int(a), cells_along(grid, direction) - 1)  # the last face belongs to the last cell
    r = a - i
    gradients = (-grid.inv_h, grid.inv_h)
    # D = r (1 - r) h^2 vanishes at nodes; N D^-1 (X - x) is the gradient (Jiang, Schroeder & Teran
    # 2017, "An angular momentum conserving affine-particle-in-cell method", section 5.3).
    return Along(i, r, (1 - r, r), gradients, gradients)


mapped_again.on(Linear)(without_moment)
register(Linear, 2)
