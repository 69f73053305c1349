"""Arrays of a run, as NamedTuples for kernels.

n points in a block, d dimensions, N nodes, T tiles. Point arrays are (components, n), node arrays
(N, components); optional fields are declared (:mod:`karamelo_py.compiler.fields`).
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from karamelo_py.compiler import noinline
from karamelo_py.compiler.fields import (
    as_rows_of_points,
    name_of,
    rows_of_points,
    some_points,
)
from karamelo_py.kernels.records import row
from karamelo_py.kernels.totals import LIMBS, Alone
from karamelo_py.points.grid import Grid
from karamelo_py.points.kinematics import vector

# A NamedTuple, often empty, whose class selects implementations.
Tag: TypeAlias = Any
# A number in double or single precision, lanes of such numbers, or a number with derivatives.
Number: TypeAlias = Any
# An index, or several indices in lanes.
Index: TypeAlias = Any


class Nodes(NamedTuple):
    sums: np.ndarray  # mass, momentum, force
    update: np.ndarray  # v* after the update, v* - v
    velocity: np.ndarray  # velocity that strains the points
    fields: tuple  # (N, components) each


# Column of the first component in node records. 3D vectors are padded to fill a register.
MASS = 0


def of_momentum(kin):
    return 1


def of_force(kin):
    return 2 if kin.dimension == 1 else 4


def of_change(kin):
    return 4 if kin.dimension == 3 else kin.dimension


def vector_at(kin, records, i, first, template):
    return vector(kin, row(records, i, first, (*template,)))


# Widths of node records by dimension.
SUMS_WIDTH = {1: 4, 2: 8, 3: 8}
UPDATE_WIDTH = {1: 2, 2: 4, 3: 8}
VELOCITY_WIDTH = {1: 1, 2: 2, 3: 4}


class Points(NamedTuple):
    """Points of one law, sorted by tile; a location (w numbers) is position and domain shape."""

    x: np.ndarray  # (2, w, n) locations; `motion.now` is the present index
    home: np.ndarray | None  # (w, n) reference locations (total frame)
    v: np.ndarray  # (d, n)
    mass: np.ndarray  # (n,)
    state: np.ndarray  # (s, n)
    material: np.ndarray  # (n,) int32 row in the table of laws
    grid: np.ndarray  # (n,) int32
    id: np.ndarray  # (n,) int64
    fields: tuple  # (components, n) each


def known_to_laws(points):
    """Return points without optional fields, so that all methods use the same kernels of laws."""
    return Points(
        points.x, None, points.v, points.mass, points.state, points.material, points.grid,
        points.id, (),
    )  # fmt: skip


def arrays_of(points: Points) -> Iterator[tuple[str, np.ndarray]]:
    """Yield (name, array), with points along the last axis."""
    for name, array in points._asdict().items():
        if name != "fields" and array is not None:
            yield name, array
    for one in points.fields:
        yield name_of(type(one)), one.array


def made_of(points: Points, arrays: Iterable[np.ndarray]) -> Points:
    remaining = iter(arrays)
    items: list[Any] = [None if array is None else next(remaining) for array in points[:-1]]
    return Points(*items, tuple(type(one)(next(remaining)) for one in points.fields))


class Tiling(NamedTuple):
    # (3,) int64: numbers of occupied tiles, of parts of the points, of parts for other processes
    count: np.ndarray
    share: np.ndarray  # (S + 1,) int64: part k is order[share[k]:share[k + 1]]
    order: np.ndarray  # (T + 1,) int64: occupied tiles in the order in which threads take them
    range: np.ndarray  # (T + 1, 2) int64: points of the k-th occupied tile
    grid: np.ndarray  # (T + 1,) int64: grid of the k-th occupied tile
    number: np.ndarray  # (T + 1,) int64: number of the k-th occupied tile
    box: np.ndarray  # (T + 1, 2 d) int64: first and last nodes in reach of its points
    # (T + 1, r, 2) int16: first and last node in each row of the box (in 3D, row i ny + j), counted
    # from the start of the row; last < first if the row is empty; r = 0 if boxes are not refined
    rows: np.ndarray
    # (T + 1, 5) int64: rows of the tile in the buffers; Grid.first, step_x and step_y of its box
    buffer: np.ndarray
    # (T + 1, 15): largest move, largest rate, failed point + 1; in energy checks also kinetic and
    # stored energy, loss in the transfer, number of the solid (-1: several), mass, momentum,
    # elastic energy, and elastic energy times velocity
    report: np.ndarray


CLEAR, TAKE, ADD = range(3)  # last column of Buffers.parts


class Buffers(NamedTuple):
    """Buffers to which the points of tiles scatter: dense boxes of nodes, one after another.

    A tile of nodes adds the boxes that reach it in a fixed order, and then sets them to 0. The
    parts of a tile are ranges of nodes that overlap a box; an additional first part clears nodes
    outside the first box. Columns of a part: first node in the grid and in the box; lengths;
    strides in the grid and in the box along the first two directions; the action. With few points,
    the node arrays themselves are the only buffer.
    """

    nodes: Nodes
    count: np.ndarray  # (2,) int64: number of parts; 1 if nodes are the only buffer
    first: np.ndarray  # (S + 1,) int64: part k has rows first[k]:first[k + 1]
    parts: np.ndarray  # (p, 10) int64
    number: int  # index among the scene's buffers


class Locations(NamedTuple):
    """Locations of points in a sweep, each (w, n)."""

    where: np.ndarray  # positions at which weights are computed
    x: np.ndarray  # positions before the move
    y: np.ndarray  # positions after the move


class Block(NamedTuple):
    points: Points
    laws: NamedTuple  # (m,) parameters over materials
    tiling: Tiling


class OnGrids(NamedTuple):
    basis: Tag  # () if the basis does not matter
    kin: Tag
    grids: Grid
    of: np.ndarray  # (n,) grid of each point
    x: np.ndarray  # (w, n) locations


class Matter(NamedTuple):
    kin: Tag
    points: Points
    laws: NamedTuple


def matter_of(kin: Tag, block: Block) -> Matter:
    return Matter(kin, known_to_laws(block.points), block.laws)


def some_of(block: Block, rows: np.ndarray) -> Block:
    """Return the block with the points `rows` in this order, not yet sorted."""
    arrays = (some_points(array, rows) for _, array in arrays_of(block.points))
    return block._replace(points=made_of(block.points, map(as_rows_of_points, arrays)))


def joined_points(points: Points, parts: Sequence[Sequence[np.ndarray]]) -> Points:
    """Return `points` with all arrays replaced by the concatenated arrays of `parts`."""
    count = sum(arrays[0].shape[-1] for arrays in parts)
    made = [rows_of_points((*a.shape[:-1], count), a.dtype.type) for _, a in arrays_of(points)]
    for array, same in zip(made, zip(*parts, strict=True), strict=True):
        np.concatenate(same, axis=-1, out=array)
    return made_of(points, made)


class NoHooks(NamedTuple):
    pass


HOOK = np.dtype([
    ("address", np.int64),
    ("stage", np.int64),
    ("begin", np.int64),  # range of members; begin is -1 for all
    ("end", np.int64),
    ("slot", np.int64),  # slot of the published total; -1: none
    ("uses_before", np.int64),  # also needs the formulas one step earlier
    ("uses_share", np.int64),  # uses 1 / number of members with mass
    ("holds", np.int64),  # sets or bounds the velocity
    ("uses_place", np.int64),  # formulas depend on position
    ("totals", np.int64),  # numbers published by a hook on whole points
    ("accelerates", np.int64),  # also acts on pore water
])  # fmt: skip
PROGRAM = np.dtype([
    ("begin", np.int64),  # range of code; begin is -1 for NULL
    ("end", np.int64),
    ("first", np.int64),  # range of constants
    ("last", np.int64),
])  # fmt: skip
# The hook that holds a node along one axis.
HELD = np.dtype([("slot", np.int64), ("force", np.float64)])  # slot: 1 + slot of the total, or 0


class Apart(NamedTuple):
    """Private arrays for the hooks of A threads."""

    chosen: np.ndarray  # (A, BLOCK)
    scratch: np.ndarray  # (A, 9 + depth, BLOCK)
    values: np.ndarray  # (A, ...)
    totals: np.ndarray  # (A, rows, LIMBS), zero between loops
    step: np.ndarray  # (A, 1) STEP, entries for hooks
    heat: np.ndarray  # (A, 1) HEAT, entries for hooks


class Hooks(NamedTuple):
    """Compiled hooks of fixes, called by address at their stage (`kernels.hooks`)."""

    evaluate: int  # address of the formula evaluator
    table: np.ndarray  # (k,) HOOK
    programs: np.ndarray  # (k, n) PROGRAM: three components, friction at a wall, values of a tool
    members: np.ndarray  # int64: node numbers, or bits per point
    code: np.ndarray  # (c, 2) int64, of formulas
    constants: np.ndarray  # (m,) float64
    x0: np.ndarray  # (n, d) reference positions by id
    chosen: np.ndarray  # (BLOCK,) int64 scratch
    scratch: np.ndarray  # (9 + depth, BLOCK): x y z x0 y0 z0, value, value before, stack, value 3
    holders: np.ndarray  # (N, d) HELD if several hooks hold the same nodes, else (0, d)
    loads: np.ndarray  # (N, d) loads in this step if hooks apply forces, else (0, d)
    rigid_fields: np.ndarray  # (F,) bool: rigid velocity fields, of N/F nodes each; or (0,)
    torques: np.ndarray  # (values,) for the slot of a force: slot of its torque, or 0
    mode: Tag  # one or several threads
    apart: Apart
    whole: tuple  # tags of hooks on whole points


VALUE, BEFORE = 6, 7  # rows of Hooks.scratch
WHOLE = -1  # marks one of Hooks.whole instead of an address

# Stages of fixes, named as in Karamelo.
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
POST_CONTACT = 10  # damping, also of contact forces
POST_UPDATE_GRID_ROTATION = 11
POST_ROTATION_TO_GRID = 12

# Node array that a hook changes.
ON_SUMS, ON_UPDATE, ON_VELOCITY = 0, 1, 2

# Clock of the step size (`kernels.clock`, `run.step_size`).
STEP = np.dtype([
    ("fixed_dt", np.float64),  # set_dt, or 0
    ("dt_factor", np.float64),  # fraction of the stable step
    ("dt_factor_moving", np.float64),  # dt_factor after points have moved
    ("heat_factor", np.float64),  # fraction of conduction's stable step
    ("end_time", np.float64),
    ("last_dt", np.float64),  # 0 at the start and after load steps
    ("kick", np.float64),  # time for which forces act, from mid-step to mid-step
    ("first_kick", np.float64),  # kick of the first step, in steps
    ("contact_dt", np.float64),  # dt that sets the contact stiffness
    ("contact_kick", np.float64),  # kick for steps of this length
    ("last_contact_dt", np.float64),
    ("release", np.float64),  # dt is held until it could be this many times as large; 0: never
    ("held", np.float64),  # held dt / dt_factor, as scripts and halvings change the factor
    ("spacing", np.float64),  # smallest cell size
    ("courant", np.float64),  # stable step * rate / cell size
    ("courant_moving", np.float64),  # `courant` once points have moved
    ("kept", np.float64),  # FLIP coefficient
    ("kept_by_time", np.float64),  # exponent of `kept` per stable step; 0: `kept` is constant
    ("first_limit", np.float64),  # initial stable step
    ("limit", np.float64),  # stable step
    ("over_limit", np.int64),  # consecutive steps above the limit
    ("watch_limit", np.int64),  # 1: steps above the limit stop the run
])  # fmt: skip
# Motion of points (`kernels.clock`, `run.tiles`): lengths in cells
MOTION = np.dtype([
    ("rate", np.float64),  # max over points of c + max |v_i - common_i|
    ("new_rate", np.float64),  # rate found in the last sweep
    ("closing", np.float64),  # rate of the first step if cells close at the speed of their points
    ("common", np.float64, (1, 3)),  # reference velocity for speeds
    ("weight", np.float64),  # weight of the common drift; 1: `common` is 0
    ("wave", np.float64),  # wave speed when `common` was measured
    ("speed", np.float64),  # speed of the fastest point
    ("move", np.float64),  # largest move of a point in this step
    ("new_move", np.float64),
    ("stride", np.float64),
    ("drift", np.float64),  # sum of the largest moves since points were sorted
    ("drift_limit", np.float64),
    ("pace", np.float64),  # largest move in a step since points were sorted
    ("path", np.float64),  # longest path of a point
    ("now", np.int64),  # index of present locations
    ("wrong", np.int64),  # 1 if a point failed, or NOT_SOLVED
])  # fmt: skip
# Energy monitor (`kernels.watch`, `run.energy`)
ENERGY = np.dtype([
    ("watch_energy", np.int64),  # 1: the work of all loads is known
    ("level", np.float64),  # weight of the present stored energy in the balance
    ("work", np.float64),  # work of fixes
    ("kinetic", np.float64),
    ("stored", np.float64),  # includes dissipated energy
    ("lost_by_transfer", np.float64),
    ("lost_with_deleted", np.float64),  # loss of points that have been deleted
    ("lost_before", np.float64),  # `lost_by_transfer` one step earlier
    ("born_with", np.float64),  # initial internal energy of gases
    ("stored_before", np.float64),  # `stored` one step earlier
    ("moving_before", np.float64),  # kinetic energy minus work one step earlier
    ("stored_at", np.int64),  # step number of `stored_before` and `moving_before`
    ("looks", np.int64),  # number of checks
    ("balance", np.float64),  # kinetic + stored + dissipated - work
    ("first_balance", np.float64),
    ("first_work", np.float64),
    ("sum_of_balance", np.float64),  # sum over a window
    ("last_balance", np.float64),  # balance at the previous check
    ("last_but_one", np.float64),
    ("first_lost", np.float64),  # lost in the transfer, at the same times
    ("lost_now", np.float64),
    ("last_lost", np.float64),
    ("lost_but_one", np.float64),
    ("first_few", np.float64),  # mean of the first checks
    ("first_mean", np.float64),  # mean of the first window
    ("largest_mean", np.float64),
    ("of_bodies", np.float64),  # kinetic energy of free rigid bodies, not in the balance
    ("largest_energy", np.float64),  # largest kinetic, stored, rigid-body energy or work
    ("largest_own", np.float64),  # `largest_energy` without drift
    ("of_drift", np.float64),  # kinetic energy of centres of mass
    ("elastic", np.float64),  # elastic energy at the last check
    ("carried", np.float64, (1, 3)),  # elastic energy times cells moved through
    ("to_and_fro", np.float64),  # time for waves through all bodies and back
    ("time_of_look", np.float64),
    ("lost", np.float64),  # largest relative loss by crossing cells
    ("crossed", np.float64),  # number of cells through which stressed material has moved
    ("supplied", np.float64),  # largest work, of either sign
    ("energy_floor", np.float64),  # round-off
    ("windows", np.int64),  # consecutive windows with growth
    ("growth", np.float64),  # relative growth in the last window
    ("grown", np.float64),  # largest growth since the first checks
])  # fmt: skip
# Conduction (`kernels.heat`, hooks, `kernels.watch`)
HEAT = np.dtype([
    ("heat_limit", np.float64),  # stable step, or infinite
    ("heat_reference", np.float64),  # stable step in undeformed bodies
    ("watch_heat", np.int64),  # 1: all heat sources are known
    ("coldest", np.float64),  # bounds on temperatures from the initial state, fixes and sources
    ("hottest", np.float64),
    ("T_low", np.float64),  # extremes of temperature at the last check
    ("T_high", np.float64),
    ("own_heat", np.float64),  # largest temperature rise of a point by dissipation
    ("set_low", np.float64),  # extremes of temperature set by fixes at nodes
    ("set_high", np.float64),
    ("rise", np.float64),  # largest heating rate by fixes
    ("fall", np.float64),
])  # fmt: skip
CLOCK = np.dtype([("step", STEP), ("motion", MOTION), ("energy", ENERGY), ("heat", HEAT)])
TIME, TIMESTEP, DT = 0, 1, 2  # first published values
LAST = 2**62  # above any point id


class Control(NamedTuple):
    values: np.ndarray  # published values, from TIME, TIMESTEP, DT on
    clock: np.ndarray  # (1,) CLOCK; the next four are its parts
    step: np.ndarray
    motion: np.ndarray
    energy: np.ndarray
    heat: np.ndarray
    totals: np.ndarray  # (rows, LIMBS): published values; mass and momentum per solid
    digits: np.ndarray  # (LIMBS,) scratch
    answer: np.ndarray  # rounded totals, results agreed among processes
    firsts: np.ndarray  # (S + 1,) int64: first point id of each solid; LAST
    ranks: Tag  # other processes, or `Alone`


def new_control(values: np.ndarray, firsts: Sequence[int] = (), d: int = 0) -> Control:
    """Make a `Control` at time 0; `firsts` are ids of the solids' first points."""
    clock: Any = np.zeros(1, CLOCK).view(np.recarray)
    parts = clock.step, clock.motion, clock.energy, clock.heat
    clock.motion.weight = clock.motion.stride = 1.0
    more = (1 + d) * (len(firsts) + 1)
    totals = np.zeros((len(values) + more, LIMBS), np.int64)
    digits, answer = np.zeros(LIMBS, np.int64), np.zeros(max(16, more))
    ids = np.array([*firsts, LAST], np.int64)
    return Control(values, clock, *parts, totals, digits, answer, ids, Alone())


class Setup(NamedTuple):
    """All arguments of a step; its type selects the code."""

    frame: Tag
    kin: Tag
    basis: Tag
    transfer: Tag
    averaging: Tag
    contact: Tag
    bodies: Tag  # free rigid bodies, or none
    heat: Tag
    additions: Tag  # adds tasks and quantities: pore water, rotation
    grids: Grid  # (g,) each
    nodes: Nodes
    buffers: Buffers
    blocks: tuple[Block, ...]  # one per law
    spans: np.ndarray  # (1 + rows, 2) int64: number of ranges, then ranges of nodes in use
    ranges: np.ndarray  # (S + rows, 2) int64: range of each part's rows, then ranges of nodes
    control: Control


def with_items(of, /, **items):
    """Return a copy of a NamedTuple or `hold` tuple, with `items` replaced."""
    pairs = zip(of._fields, of, strict=True)
    return type(of)(*[items.get(name, item) for name, item in pairs])


@noinline
def first_from(ascending, begin, end, x):
    """Return the first index of a value >= `x`; np.searchsorted takes 0.4 s to compile."""
    while begin < end:
        middle = (begin + end) // 2
        if ascending[middle] < x:
            begin = middle + 1
        else:
            end = middle
    return begin
