"""The arrays a run works on, as NamedTuples that kernels take.

n is the number of points of a block, d the dimension, N the number of nodes, T the number of tiles.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Nodes(NamedTuple):
    """Fields of the shared grid, dense in node number; untouched pages cost no memory."""

    sums: np.ndarray  # (N, 1 + 2 d): mass, momentum, force, as the points give them
    update: np.ndarray  # (N, 2 d): v* after the momentum update, and v* - v
    velocity: np.ndarray  # (N, d): the velocity whose gradient deforms the points


class Points(NamedTuple):
    """What the points of one constitutive law carry, in the order of the tiles."""

    v: np.ndarray  # (n, d) velocity
    mass: np.ndarray  # (n,)
    state: np.ndarray  # (n, s) state of the law
    moment: np.ndarray | None  # (n, d d) moment of velocity of affine transfers
    material: np.ndarray  # (n,) int32, row in the table of laws


class Tiling(NamedTuple):
    """The points of a block by tile, in the order in which a sweep visits the tiles."""

    range: np.ndarray  # (T + 1, 2) int64: points of the k-th occupied tile
    colour: np.ndarray  # (c + 1,) int64: occupied tiles of colour c are colour[c]:colour[c + 1]
    report: np.ndarray  # (T + 1, 3): largest move, largest rate, offending point + 1 of each tile


class Block(NamedTuple):
    """Points of one law, its parameters per material, and where each tile's points lie."""

    x: np.ndarray  # (2, n, d): positions now and after the move; Control.whole[NOW] says which
    points: Points
    laws: NamedTuple  # the law's NamedTuple with an array (m,) for each parameter
    tiling: Tiling
    id: np.ndarray  # (n,) int64, 0-based number of each point in the scene


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


class Control(NamedTuple):
    """What the compiled loop reads and writes beside the fields."""

    values: np.ndarray  # published values: TIME, TIMESTEP, DT come first
    real: np.ndarray  # (10,) float64, see the names below
    whole: np.ndarray  # (4,) int64, see the names below


TIME, TIMESTEP, DT = 0, 1, 2
# Control.real
FIXED_DT, DT_FACTOR, END_TIME, RATE, NEW_RATE, MOVE, DRIFT, DRIFT_LIMIT, SPACING = range(9)
POINT_MASS = 9  # mass of the heaviest point
# Control.whole
NOW, WRONG, OVER_LIMIT, WATCH_LIMIT = range(4)


class Setup(NamedTuple):
    """Everything a step needs; its type decides what is compiled."""

    kin: NamedTuple  # kinematics tag
    basis: NamedTuple
    transfer: NamedTuple
    nodes: Nodes
    blocks: tuple  # of Block, one for each constitutive law
    spans: np.ndarray  # (1 + rows, 2) int64: their number, then ranges of node numbers in use
    shape: tuple  # (3,) nodes per direction
    control: Control
