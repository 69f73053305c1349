"""The arrays a run works on, as NamedTuples that kernels take.

n is the number of points of a block, d the dimension, N the number of nodes, T the number of tiles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Nodes(NamedTuple):
    """Fields of the nodes of all grids, dense in node number; untouched pages cost no memory."""

    sums: np.ndarray  # (N, 1 + 2 d): mass, momentum, force, as the points give them
    update: np.ndarray  # (N, 2 d): v* after the momentum update, and v* - v
    velocity: np.ndarray  # (N, d): the velocity whose gradient deforms the points
    normal: np.ndarray | None  # (N, d): sum of m grad N, for contact between solids
    growth: np.ndarray | None  # (N, 2): volume after and before an increment, for F-bar
    series: np.ndarray | None  # (N, 2 d): term of the series of XPIC, sum for the next


class Points(NamedTuple):
    """What the points of one constitutive law carry, in the order of the tiles."""

    v: np.ndarray  # (n, d) velocity
    mass: np.ndarray  # (n,)
    state: np.ndarray  # (n, s) state of the law
    moment: np.ndarray | None  # (n, t) what the transfer keeps
    material: np.ndarray  # (n,) int32, row in the table of laws
    deformation: np.ndarray | None  # (n, t) F, where the frame needs it and the law has none
    force: np.ndarray | None  # (n, d) force that fixes put on the point
    growth: np.ndarray | None  # (n,) ratio of volumes of the trial increment, for F-bar
    echo: np.ndarray | None  # (n, d) term of the series of XPIC
    bounces: np.ndarray | None  # (n, d) how often the edge of the domain has reflected the point
    heat: np.ndarray | None  # (n, GRADIENT + d), see the columns below, where heat flows


# Columns of Points.heat; behind them the gradient of temperature, which alone outlives a step.
TEMPERATURE, CAPACITY, CONDUCTANCE, FACE, SUPPLY, SHARE, GRADIENT = range(7)


class Tiling(NamedTuple):
    """The points of a block by tile, in the order in which a sweep visits the tiles."""

    range: np.ndarray  # (T + 1, 2) int64: points of the k-th occupied tile
    colour: np.ndarray  # (c + 1,) int64: occupied tiles of colour c are colour[c]:colour[c + 1]
    grid: np.ndarray  # (T + 1,) int64: the grid that the k-th occupied tile belongs to
    report: np.ndarray  # (T + 1, 3): largest move, largest rate, offending point + 1 of each tile


class Places(NamedTuple):
    """Where the points of a block are during a sweep: arrays (n, w) of places."""

    where: np.ndarray  # that the weights of the gather belong to
    x: np.ndarray  # before
    y: np.ndarray  # after


class Block(NamedTuple):
    """Points of one law, its parameters per material, and where each tile's points lie.

    A place is a position (d numbers), followed by what the basis keeps of the shape of a point's
    domain where weights follow the motion.
    """

    x: np.ndarray  # (2, n, w): places now and after the move; Control.whole[NOW] says which
    home: np.ndarray | None  # (n, w) reference places, where weights belong to them (total frame)
    points: Points
    laws: NamedTuple  # the law's NamedTuple with an array (m,) for each parameter
    tiling: Tiling
    id: np.ndarray  # (n,) int64, 0-based number of each point in the scene
    grid: np.ndarray  # (n,) int32, the grid of each point


class NoHooks(NamedTuple):
    """No fix acts in the compiled loop."""


class Hooks(NamedTuple):
    """Compiled hooks of the fixes, called by address at their stage (see kernels.hooks)."""

    evaluate: int  # address of the evaluator of formulas
    table: np.ndarray  # (k, HOOK_COLUMNS) int64
    members: np.ndarray  # int64: node numbers, or a 1 for each point that is a member
    code: np.ndarray  # (c, 2) int64: the programs of the formulas, one after another
    constants: np.ndarray  # (m,) float64
    x0: np.ndarray  # (n, d) reference positions of the points, by id
    chosen: np.ndarray  # (BLOCK,) int64 scratch
    scratch: np.ndarray  # (8 + depth, BLOCK): x y z x0 y0 z0, value, value before, stack


# Hooks.table: address; stage; range of members (-1: all); slot of the published total (-1: none);
# whether the value one step earlier is used, whether the number of members with mass is used;
# then, for each component, a range of code and one of constants (-1: NULL).
ADDRESS, STAGE, FROM, TO, SLOT, USES_BEFORE, USES_SHARE, CODE = range(8)
HOOK_COLUMNS = CODE + 12
VALUE, BEFORE = 6, 7  # rows of Hooks.scratch

# Stages of a step at which fixes act, in Karamelo's names.
INITIAL_INTEGRATE = 0
POST_PARTICLES_TO_GRID = 1
POST_UPDATE_GRID_STATE = 2
POST_GRID_TO_POINT = 3
POST_ADVANCE_PARTICLES = 4
POST_VELOCITIES_TO_GRID = 5
FINAL_INTEGRATE = 6
POST_HEAT_TO_GRID = 7
SUPPLY_HEAT = 8
POST_UPDATE_GRID_HEAT = 9


class Control(NamedTuple):
    """What the compiled loop reads and writes beside the fields."""

    values: np.ndarray  # published values: TIME, TIMESTEP, DT come first
    real: np.ndarray  # (17,) float64, see the names below
    whole: np.ndarray  # (4,) int64, see the names below


TIME, TIMESTEP, DT = 0, 1, 2
# Control.real
FIXED_DT, DT_FACTOR, END_TIME, RATE, NEW_RATE, MOVE, DRIFT, DRIFT_LIMIT, SPACING = range(9)
LIGHTEST = 9  # mass of the lightest point, where the edge of the basis is steep
NEW_MOVE = 10
COURANT = 11  # stable step as a share of cell size over the fastest point's rate
HEAT_LIMIT = 12  # stable step of conduction, infinite where there is none
KEPT = 13  # share of its own velocity that a point keeps, and changes by what that of nodes does
FIRST_LIMIT = 14  # stable step at the start
LIMIT = 15  # stable step now
HEAT_REFERENCE = 16  # stable step of conduction in undeformed bodies
# Control.whole
NOW, WRONG, OVER_LIMIT, WATCH_LIMIT = range(4)


class Setup(NamedTuple):
    """Everything a step needs; its type decides what is compiled."""

    frame: NamedTuple  # whether weights belong to present or reference positions
    kin: NamedTuple  # kinematics tag
    basis: NamedTuple
    transfer: NamedTuple
    averaging: NamedTuple  # whether changes of volume are averaged (F-bar)
    contact: NamedTuple  # how solids with fields of their own touch
    heat: NamedTuple  # whether heat flows between points, and the nodes it flows through
    grids: NamedTuple  # points.grid.Grid with an array (g,) for each number
    nodes: Nodes
    blocks: tuple  # of Block, one for each constitutive law
    spans: np.ndarray  # (1 + rows, 2) int64: their number, then ranges of node numbers in use
    control: Control
