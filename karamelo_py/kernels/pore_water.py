"""Rows of the step for pore water, whose quantities join the soil's passes over the points."""

from typing import NamedTuple

from karamelo_py.kernels import arrays
from karamelo_py.kernels.equations import pore_pressure as pressures
from karamelo_py.kernels.equations import pore_water as pores
from karamelo_py.kernels.equations.internal_force import InternalForce
from karamelo_py.kernels.equations.mass_momentum import MassMomentum, MomentumAgain
from karamelo_py.kernels.equations.move import Move
from karamelo_py.kernels.equations.node_updates import NodalUpdate
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.export import imposing
from karamelo_py.kernels.table import (
    AXIS,
    Added,
    AtNodes,
    BeforeLoads,
    NodeTask,
    Once,
    scene_additions,
)
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.laws.pore_water import with_pore_pressure


def _rim(s):
    # With splines, B is not exactly 0 inside.
    return None if isinstance(s.basis, Linear) else _surface(s)


def _surface(s):
    return pores.RIM / s.control.step[0].spacing


def share_forces(s):
    return pores.ShareForces(_rim(s), _surface(s))


def make_flux(s):
    return pores.MakeFlux(_rim(s), pores.Mapped())


OF_MASS = Added(instead=pores.MixtureMomentum(), then=(pores.WaterMomentum(),))
OF_FORCE = pores.Drag(), pores.UnseenStrain(), pores.PoreVolumes(), pores.WaterForce()
BEFORE_LOADS = Added(before=(NodeTask(pores.SplitMomentum()),))
OF_MOVE = Added(before=(NodeTask(pores.DragWater(pores.Mapped())),), then=(pores.MoveWater(),))
OF_MOVE_OF_STEP = OF_MOVE._replace(before=(NodeTask(pores.DragWater(pores.OfStep())),))
ADDITIONS = (
    (MassMomentum, OF_MASS),
    (BeforeLoads, BEFORE_LOADS),
    (InternalForce, Added(then=OF_FORCE)),
    (
        MomentumAgain,
        Added(instead=pores.MixtureMomentumAgain(), then=(pores.WaterMomentumAgain(),)),
    ),
    (NodalUpdate, Added(instead=NodeTask(pores.ShareForces, make=share_forces))),
    (Move, OF_MOVE),
    (Strain, Added(before=(NodeTask(pores.MakeFlux, make=make_flux),), first=(pores.Seep(),))),
)
# `Drag` sets forces in the record to 0.
SLOW_ADDITIONS = ((MassMomentum, Added(then=(pores.WaterMomentum(), pores.Drag()))),)


class Water(NamedTuple):
    """Fields of pore water, and rows that accompany tasks and quantities."""

    point_fields = pores.POINT_FIELDS
    node_fields = pores.NODE_FIELDS


@scene_additions.on(Water)
def _additions_water(tag):
    return ADDITIONS


def _foresee(s):
    return pressures.Foresee(None, _surface(s))


def _add_pressure(s):
    return pressures.AddPressure(None, _surface(s))


def _make_flux_of_step(s):
    return pores.MakeFlux(None, pores.OfStep())


# Nodal velocities that fixes hold are known before the pressure is solved for.
SOLVE = (
    NodeTask(pressures.ForgetVelocity()),
    AtNodes(arrays.POST_VELOCITIES_TO_GRID, arrays.ON_VELOCITY),
    AXIS,
    NodeTask(pressures.Foresee, make=_foresee),
    Once(pressures.solve),
    NodeTask(pressures.AddPressure, make=_add_pressure),
)
ADDITIONS_OF_SOLUTION = (
    (MassMomentum, OF_MASS),
    (BeforeLoads, BEFORE_LOADS),
    (
        InternalForce,
        Added(instead=pores.SoilForce(), then=(*OF_FORCE, pressures.SumsOfCells())),
    ),
    (NodalUpdate, Added(before=SOLVE)),
    (Move, OF_MOVE_OF_STEP),
    (
        Strain,
        Added(
            before=(NodeTask(pores.MakeFlux, make=_make_flux_of_step), Once(pressures.grow)),
            first=(pores.Seep(),),
        ),
    ),
)


class SolvedWater(NamedTuple):
    """Pore water whose pressure at the end of a step is solved for."""


@scene_additions.on(SolvedWater)
def _additions_solved_water(tag):
    return ADDITIONS_OF_SOLUTION


class SlowWater(NamedTuple):
    """Water in load steps, with equations in `run.implicit.pore_water`."""


@scene_additions.on(SlowWater)
def _additions_slow_water(tag):
    return SLOW_ADDITIONS


impose_pore_pressure = imposing(with_pore_pressure)
