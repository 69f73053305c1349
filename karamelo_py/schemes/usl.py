"""USL: update stress last (Sulsky et al. 1994; Sinaie et al. 2017)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.kernels.hooks import ON_SUMS, ON_UPDATE
from karamelo_py.kernels.stages import (
    ClearSums,
    Everything,
    Gradient,
    Nothing,
    Update,
    UpdateToVelocity,
    Velocity,
    VelocityAndGradient,
)
from karamelo_py.kernels.step import (
    Fused,
    Staged,
    at_nodes,
    at_points,
    begin,
    check_moves,
    step,
    step_size,
    sweep,
    sweep_here,
)
from karamelo_py.kernels.sweep import sweep_nodes
from karamelo_py.state.arrays import (
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
    POST_ADVANCE_PARTICLES,
    POST_GRID_TO_POINT,
    POST_PARTICLES_TO_GRID,
    POST_UPDATE_GRID_STATE,
)


class USL(NamedTuple):
    """The stress follows from the gradient of the updated nodal velocity.

    One visit of the points a step: the fastest scheme. It dissipates a little, and a node with
    next to no mass has a large velocity, which its gradient shows.

    Example
    -------
    scheme(usl)
    """

    stages = (
        ("p2g, g2p, move and stress in one visit of the points", "update v*"),
        ("p2g", "update v*", "g2p, move", "stress"),
    )


@begin.on(USL, Fused)
def _(scheme, visits, mode, s):
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, step_size(s))
    sweep_here(s, mode, Nothing(), Everything(), step_size(s))


@step.on(USL, Fused)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    at_nodes(hooks, POST_PARTICLES_TO_GRID, ON_SUMS, s)
    sweep_nodes(mode, Update(), s.kin, s.nodes, s.spans, dt)
    at_nodes(hooks, POST_UPDATE_GRID_STATE, ON_UPDATE, s)
    if not more:
        return sweep(s, mode, VelocityAndGradient(), Nothing(), dt)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    return sweep(s, mode, VelocityAndGradient(), Everything(), dt)


@begin.on(USL, Staged)
def _(scheme, visits, mode, s):
    return None


@step.on(USL, Staged)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    at_points(hooks, INITIAL_INTEGRATE, 0, s)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    if not sweep_here(s, mode, Nothing(), Everything(), dt):
        return False
    at_nodes(hooks, POST_PARTICLES_TO_GRID, ON_SUMS, s)
    sweep_nodes(mode, Update(), s.kin, s.nodes, s.spans, dt)
    at_nodes(hooks, POST_UPDATE_GRID_STATE, ON_UPDATE, s)
    sweep_nodes(mode, UpdateToVelocity(), s.kin, s.nodes, s.spans, dt)
    if not sweep(s, mode, Velocity(), Nothing(), dt):
        return False
    at_points(hooks, POST_GRID_TO_POINT, 1, s)
    at_points(hooks, POST_ADVANCE_PARTICLES, 1, s)
    if not check_moves(s):
        return False
    if not sweep(s, mode, Gradient(), Nothing(), dt):
        return False
    at_points(hooks, FINAL_INTEGRATE, 1, s)
    return True
