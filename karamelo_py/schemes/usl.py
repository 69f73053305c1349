"""USL: update stress last (Sulsky et al. 1994; Sinaie et al. 2017)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.kernels.arrays import (
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
)
from karamelo_py.kernels.stages import (
    ClearSums,
    Everything,
    Gradient,
    Nothing,
    UpdateToVelocity,
    VelocityAndGradient,
)
from karamelo_py.kernels.step import (
    Fused,
    Staged,
    accelerate_nodes,
    at_points,
    begin,
    light_node,
    map_to_nodes,
    move_points,
    step,
    step_size,
    strain,
    sum_series,
)
from karamelo_py.kernels.sweep import sweep_nodes


class USL(NamedTuple):
    """The stress follows from the gradient of the updated nodal velocity.

    One visit of the points a step: the fastest scheme. It dissipates a little. A node with next to
    no mass gets a large velocity, which would show in the gradient: there, and there only, the
    gradient takes the change of velocity by the share of the mass, below d (c dt / h)^2 times (at
    most once) the mass of the lightest point of the scene. Momentum is kept.

    The stable step is shorter than of the other schemes: 0.65 h/c, and 0.4 h/c with one point a
    cell; 0.7 of that with Bernstein-quadratic. Where points average a mode of the nodes away, its
    strain alone answers to the forces: e <- (1 - (w dt)^2) e, stable for w dt < sqrt(2) instead
    of 2.

    Example
    -------
    scheme(usl)
    """

    courant = (0.65, 0.4)
    stages = (
        ("p2g, g2p, move and stress in one visit of the points", "update v*"),
        ("p2g", "update v*", "g2p, move", "stress"),
    )


@begin.on(USL, Fused)
def _(scheme, visits, mode, s):
    return map_to_nodes(s, mode, Everything())


@step.on(USL, Fused)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    accelerate_nodes(s, mode, hooks)
    sweep_nodes(mode, UpdateToVelocity(light_node(s)), s.kin, s.nodes, s.spans, dt)
    sum_series(s.transfer, s, mode)
    if not more:
        return strain(s.averaging, s, mode, VelocityAndGradient(), Nothing(), dt)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    return strain(s.averaging, s, mode, VelocityAndGradient(), Everything(), dt)


@begin.on(USL, Staged)
def _(scheme, visits, mode, s):
    return True


@step.on(USL, Staged)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    at_points(hooks, INITIAL_INTEGRATE, 0, s)
    if not map_to_nodes(s, mode, Everything()):
        return False
    accelerate_nodes(s, mode, hooks)
    sweep_nodes(mode, UpdateToVelocity(light_node(s)), s.kin, s.nodes, s.spans, dt)
    sum_series(s.transfer, s, mode)
    if not move_points(s, mode, hooks):
        return False
    if not strain(s.averaging, s, mode, Gradient(), Nothing(), dt):
        return False
    at_points(hooks, FINAL_INTEGRATE, 1, s)
    return True
