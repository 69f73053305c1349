"""USF: update stress first (Burgess, Sulsky & Brackbill 1992; Bardenhagen 2002)."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import shared
from karamelo_py.kernels.arrays import (
    FINAL_INTEGRATE,
    INITIAL_INTEGRATE,
    POST_UPDATE_GRID_STATE,
)
from karamelo_py.kernels.hooks import ON_VELOCITY
from karamelo_py.kernels.stages import (
    ClearSums,
    Force,
    Gradient,
    MassMomentum,
    Nothing,
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
    touch_velocity,
    update_nodes,
)
from karamelo_py.kernels.sweep import sweep_nodes


class USF(NamedTuple):
    """The stress follows from the nodal velocity at the start of the step, before the forces.

    Gains a little energy where the other schemes lose some.

    Example
    -------
    scheme(usf)
    """

    courant = (1.0, 1.0)
    stages = (
        (
            "nodal velocity",
            "stress and force in one visit of the points",
            "update v*",
            "g2p, move, p2g in one visit",
        ),
        ("p2g mass and momentum", "nodal velocity", "stress and force", "update v*", "g2p, move"),
    )


@begin.on(USF, Fused)
def _(scheme, visits, mode, s):
    return map_to_nodes(s, mode, MassMomentum())


@shared
def _stress_first(s, mode, hooks):
    """From the momentum on the nodes to v*, by way of the stress."""
    dt = step_size(s)
    sweep_nodes(mode, SumsToVelocity(), s.kin, s.nodes, s.spans, dt)
    at_nodes(hooks, POST_UPDATE_GRID_STATE, ON_VELOCITY, s)
    touch_velocity(s.contact, s, 0)
    if not strain(s.averaging, s, mode, Gradient(), Force(), dt):
        return False
    update_nodes(s, mode, hooks)
    return True


@step.on(USF, Fused)
def _(scheme, visits, mode, s, hooks, more):
    dt = step_size(s)
    if not _stress_first(s, mode, hooks):
        return False
    if not more:
        return sweep(s, mode, Velocity(), Nothing(), dt)
    sweep_nodes(mode, ClearSums(), s.kin, s.nodes, s.spans, dt)
    return sweep(s, mode, Velocity(), MassMomentum(), dt)


@begin.on(USF, Staged)
def _(scheme, visits, mode, s):
    return True


@step.on(USF, Staged)
def _(scheme, visits, mode, s, hooks, more):
    at_points(hooks, INITIAL_INTEGRATE, 0, s)
    if not map_to_nodes(s, mode, MassMomentum()):
        return False
    if not _stress_first(s, mode, hooks) or not move_points(s, mode, hooks):
        return False
    at_points(hooks, FINAL_INTEGRATE, 1, s)
    return True
