"""USAVG: half of the stress update first, half last (Nairn 2003)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import real, shared
from karamelo_py.kernels.arrays import (
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
    POST_UPDATE_GRID_STATE,
    POST_VELOCITIES_TO_GRID,
)
from karamelo_py.kernels.hooks import ON_VELOCITY
from karamelo_py.kernels.stages import (
    ClearSums,
    ClearVelocity,
    Force,
    Gradient,
    MassMomentum,
    Momentum,
    MomentumToVelocity,
    Nothing,
    SecondGradient,
    SumsToVelocity,
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


class USAVG(NamedTuple):
    """Half of the strain from the nodal velocity before the forces, half from the one of musl.

    The gain of usf and the loss of musl nearly cancel: energy is kept best, for two updates of the
    stress a step (Nairn 2003, "Material point method calculations with explicit cracks").

    Example
    -------
    scheme(usavg)
    """

    courant = (1.0, 1.0)
    stages = (
        (
            "nodal velocity",
            "half of the strain and force in one visit of the points",
            "update v*",
            "g2p, move, momentum to grid in one visit",
            "re-mapped velocity",
            "half of the strain and p2g in one visit",
        ),
        (
            "p2g mass and momentum",
            "nodal velocity",
            "half of the strain and force",
            "update v*",
            "g2p, move",
            "momentum to grid",
            "re-mapped velocity",
            "half of the strain",
        ),
    )


@begin.on(USAVG, Fused)
def _(scheme, visits, mode, s):
    return map_to_nodes(s, mode, MassMomentum())


@shared
def _half_first(s, mode, hooks, half):
    """From the momentum on the nodes to v*, by way of half of the strain."""
    sweep_nodes(mode, SumsToVelocity(), s.kin, s.nodes, s.spans, half)
    at_nodes(hooks, POST_UPDATE_GRID_STATE, ON_VELOCITY, s)
    touch_velocity(s.contact, s, 0)
    if not strain(s.averaging, s, mode, Gradient(), Force(), half):
        return False
    update_nodes(s, mode, hooks)
    sweep_nodes(mode, ClearVelocity(), s.kin, s.nodes, s.spans, half)
    return True


@shared
def _remap(s, mode, hooks, half):
    sweep_nodes(mode, MomentumToVelocity(), s.kin, s.nodes, s.spans, half)
    at_nodes(hooks, POST_VELOCITIES_TO_GRID, ON_VELOCITY, s)
    touch_velocity(s.contact, s, 1)


@step.on(USAVG, Fused)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    half = real(0.5, dt) * dt
    if not _half_first(s, mode, hooks, half):
        return False
    if not sweep(s, mode, Velocity(), Momentum(), dt):
        return False
    _remap(s, mode, hooks, half)
    if not more:
        return strain(s.averaging, s, mode, SecondGradient(), Nothing(), half)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    return strain(s.averaging, s, mode, SecondGradient(), MassMomentum(), half)


@begin.on(USAVG, Staged)
def _(scheme, visits, mode, s):
    return True


@step.on(USAVG, Staged)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    half = real(0.5, dt) * dt
    at_points(hooks, INITIAL_INTEGRATE, 0, s)
    if not map_to_nodes(s, mode, MassMomentum()):
        return False
    if not _half_first(s, mode, hooks, half):
        return False
    if not move_points(s, mode, hooks):
        return False
    sweep_here(s, mode, Nothing(), Momentum(), dt)
    _remap(s, mode, hooks, half)
    if not strain(s.averaging, s, mode, SecondGradient(), Nothing(), half):
        return False
    at_points(hooks, FINAL_INTEGRATE, 1, s)
    return True
