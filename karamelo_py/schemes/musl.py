"""MUSL: modified update stress last (Sulsky et al. 1995)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.kernels.arrays import (
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
    POST_VELOCITIES_TO_GRID,
)
from karamelo_py.kernels.hooks import ON_VELOCITY
from karamelo_py.kernels.stages import (
    ClearSums,
    ClearVelocity,
    Everything,
    Gradient,
    Momentum,
    MomentumToVelocity,
    Nothing,
    Velocity,
)
from karamelo_py.kernels.step import (
    Fused,
    Staged,
    at_nodes,
    at_points,
    begin,
    map_to_nodes,
    move_points,
    step,
    step_size,
    strain,
    sweep,
    sweep_here,
    touch_velocity,
    update_nodes,
)
from karamelo_py.kernels.sweep import sweep_nodes


class MUSL(NamedTuple):
    """The stress follows from the velocity of the moved points, mapped to the nodes once more.

    The second mapping makes the gradient of a node with next to no mass harmless, and energy is
    kept well. The default.

    Example
    -------
    scheme(musl)
    """

    maps_velocity_again = True
    courant = (1.0, 1.0)
    stages = (
        (
            "p2g and stress in one visit of the points",
            "update v*",
            "g2p, move, momentum to grid in one visit",
            "re-mapped velocity",
        ),
        ("p2g", "update v*", "g2p, move", "momentum to grid", "re-mapped velocity", "stress"),
    )


@begin.on(MUSL, Fused)
def _(scheme, visits, mode, s):
    return map_to_nodes(s, mode, Everything())


@step.on(MUSL, Fused)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    update_nodes(s, mode, hooks)
    sweep_nodes(mode, ClearVelocity(), s.kin, s.nodes, s.spans, dt)
    if not sweep(s, mode, Velocity(), Momentum(), dt):
        return False
    sweep_nodes(mode, MomentumToVelocity(), s.kin, s.nodes, s.spans, dt)
    at_nodes(hooks, POST_VELOCITIES_TO_GRID, ON_VELOCITY, s)
    touch_velocity(s.contact, s, 1)
    if not more:
        return strain(s.averaging, s, mode, Gradient(), Nothing(), dt)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    return strain(s.averaging, s, mode, Gradient(), Everything(), dt)


@begin.on(MUSL, Staged)
def _(scheme, visits, mode, s):
    return True


@step.on(MUSL, Staged)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    at_points(hooks, INITIAL_INTEGRATE, 0, s)
    if not map_to_nodes(s, mode, Everything()):
        return False
    update_nodes(s, mode, hooks)
    if not move_points(s, mode, hooks):
        return False
    sweep_nodes(mode, ClearVelocity(), s.kin, s.nodes, s.spans, dt)
    sweep_here(s, mode, Nothing(), Momentum(), dt)
    sweep_nodes(mode, MomentumToVelocity(), s.kin, s.nodes, s.spans, dt)
    at_nodes(hooks, POST_VELOCITIES_TO_GRID, ON_VELOCITY, s)
    touch_velocity(s.contact, s, 1)
    if not strain(s.averaging, s, mode, Gradient(), Nothing(), dt):
        return False
    at_points(hooks, FINAL_INTEGRATE, 1, s)
    return True
