"""Rows of pore water, and how its quantities join passes of the soil."""

from typing import NamedTuple

from karamelo_py.compiler import point_function
from karamelo_py.compiler.fields import field
from karamelo_py.kernels import arrays, hook_loop
from karamelo_py.kernels.clock import kick
from karamelo_py.kernels.equations import pore_water as pores
from karamelo_py.kernels.equations.internal_force import InternalForce
from karamelo_py.kernels.equations.mass_momentum import MassMomentum, MomentumAgain
from karamelo_py.kernels.equations.move import Move
from karamelo_py.kernels.equations.node_updates import NodalUpdate
from karamelo_py.kernels.equations.strain import Strain
from karamelo_py.kernels.export import imposing
from karamelo_py.kernels.table import Company, NodeTask, Processor, companies, take
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.laws.pore_water import with_pore_pressure


class AtWater(NamedTuple):
    pass


@point_function(otherwise=True)
def at_water(hooks, s):
    pass


def at_its_nodes(s):
    sums = field(s.nodes.fields, pores.WaterSums)
    return arrays.with_items(s, nodes=arrays.with_items(s.nodes, sums=sums))


@at_water.on(arrays.Hooks)
def _at_water_hooks(hooks, s):
    here = at_its_nodes(s)
    members = hook_loop.hooked_nodes(here, arrays.ON_SUMS, 0.0)
    hook_loop.node_hooks(arrays.POST_WATER_TO_GRID, members, hooks, here, kick(s))


@take.on(AtWater, Processor)
def _at_water(row, s, step):
    at_water(step.hooks, s)


def _rim(s):
    # With a linear basis every node is at the rim. With splines, B is not exactly 0 inside.
    return 0.0 * _surface(s) if isinstance(s.basis, Linear) else _surface(s)


def _surface(s):
    return pores.RIM / s.control.step[0].spacing


def share_forces(s):
    return pores.ShareForces(_rim(s), _surface(s))


def make_flux(s):
    return pores.MakeFlux(_rim(s))


COMPANIES = (
    (MassMomentum, Company(then=(pores.WaterMomentum(),))),
    (InternalForce, Company(then=(pores.PoreVolumes(), pores.WaterForce()))),
    (MomentumAgain, Company(then=(pores.WaterMomentumAgain(),))),
    (NodalUpdate, Company(before=(AtWater(), NodeTask(pores.ShareForces, make=share_forces)))),
    (Move, Company(before=(NodeTask(pores.DragWater()),), then=(pores.MoveWater(),))),
    (Strain, Company(before=(NodeTask(pores.MakeFlux, make=make_flux),), first=(pores.Seep(),))),
)
SLOW_COMPANIES = COMPANIES[:1]


class Water(NamedTuple):
    """Fields of pore water, and rows that accompany tasks and quantities."""

    point_fields = pores.POINT_FIELDS
    node_fields = pores.NODE_FIELDS


@companies.on(Water)
def _companies_water(tag):
    return COMPANIES


class SlowWater(NamedTuple):
    """Water in load steps, with equations in `run.implicit.pore_water`."""


@companies.on(SlowWater)
def _companies_slow_water(tag):
    return SLOW_COMPANIES


impose_pore_pressure = imposing(with_pore_pressure)
