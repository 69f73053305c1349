"""USF: update stress first (Burgess, Sulsky & Brackbill 1992; Bardenhagen 2002)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compile import shared
from karamelo_py.kernels.hooks import ON_SUMS, ON_UPDATE, ON_VELOCITY
from karamelo_py.kernels.stages import (
    ClearSums,
    Force,
    Gradient,
    MassMomentum,
    Nothing,
    SumsToVelocity,
    Update,
    Velocity,
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


class USF(NamedTuple):
    """The stress follows from the nodal velocity at the start of the step, before the forces.

    Gains a little energy where the other schemes lose some.

    Example
    -------
    scheme(usf)
    """

    stages = (
        ("nodal velocity", "stress and force in one visit of the points", "update v*", "g2p, move, p2g in one visit"),
        ("p2g mass and momentum", "nodal velocity", "stress and force", "update v*", "g2p, move"),
    )


@begin.on(USF, Fused)
def _(scheme, visits, mode, s):
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, step_size(s))
    sweep_here(s, mode, Nothing(), MassMomentum(), step_size(s))


@step.on(USF, Fused)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    if not _stress_first(s, mode, hooks, dt):
        return False
    if not more:
        return sweep(s, mode, Velocity(), Nothing(), dt)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    return sweep(s, mode, Velocity(), MassMomentum(), dt)


@shared
def _stress_first(s, mode, hooks, dt):
    """From the momentum on the nodes to v*, by way of the stress."""
    sweep_nodes(mode, SumsToVelocity(), s.kin, s.nodes, s.spans, dt)
    at_nodes(hooks, POST_UPDATE_GRID_STATE, ON_VELOCITY, s)
    if not sweep(s, mode, Gradient(), Force(), dt):
        return False
    at_nodes(hooks, POST_PARTICLES_TO_GRID, ON_SUMS, s)
    sweep_nodes(mode, Update(), s.kin, s.nodes, s.spans, dt)
    at_nodes(hooks, POST_UPDATE_GRID_STATE, ON_UPDATE, s)
    return True


@begin.on(USF, Staged)
def _(scheme, visits, mode, s):
    return None


@step.on(USF, Staged)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    at_points(hooks, INITIAL_INTEGRATE, 0, s)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    if not sweep_here(s, mode, Nothing(), MassMomentum(), dt):
        return False
    if not _stress_first(s, mode, hooks, dt):
        return False
    if not sweep(s, mode, Velocity(), Nothing(), dt):
        return False
    at_points(hooks, POST_GRID_TO_POINT, 1, s)
    at_points(hooks, POST_ADVANCE_PARTICLES, 1, s)
    if not check_moves(s):
        return False
    at_points(hooks, FINAL_INTEGRATE, 1, s)
    return True
