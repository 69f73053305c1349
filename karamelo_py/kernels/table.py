"""Rows of schemes, and the fused and staged steps made of them.

A scheme lists its stages once, in ``rows``. Four things are derived from them: the staged step, in
which fixes act on points between stages; the fused step with the fewest passes over the points,
whose first scatter joins the last pass of the previous step; the text of `karamelo-py check`; the
memory traffic of `karamelo-py bench`. Scenes add rows for F-bar, XPIC, heat and contact (`plain`).
"""

from collections import namedtuple
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

from karamelo_py.compiler import kernel, point_function, real
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.threads import shared_out
from karamelo_py.kernels import arrays
from karamelo_py.kernels.arrays import Setup, Tag
from karamelo_py.kernels.clock import take_reports
from karamelo_py.kernels.equations import NodalQuantity, fbar, loss, sheared, strain, xpic
from karamelo_py.kernels.equations import node_updates as nodes
from karamelo_py.kernels.equations.corrected_acceleration import (
    Acceleration,
    CorrectAcceleration,
    UpdateToCorrect,
    correct_acceleration,
)
from karamelo_py.kernels.equations.internal_force import InternalForce
from karamelo_py.kernels.equations.mass_momentum import MassMomentum, MomentumAgain, Normal
from karamelo_py.kernels.equations.move import Move
from karamelo_py.kernels.equations.periodic import (
    Join,
    JoinMean,
    JoinMeanStress,
    JoinVelocity,
    Seam,
    ask_to_sort,
)
from karamelo_py.kernels.equations.pore_water import clear_water_across
from karamelo_py.kernels.records import clear_first
from karamelo_py.kernels.sweep import OldWeights, PresentWeights, Visit
from karamelo_py.points.transfers import NodalMass, stores_moment


class Processor(NamedTuple):
    pass


@point_function(tags=2)
def take(row: Any, backend: Any) -> Any:
    """Carry out a row on a back end; ``@take.on(Row, Card)`` declares the function.

    For `Processor`, ``(row, s, step)`` with a `Setup` and `~.kernels.step.InStep` is traced, and
    may return False if a point failed. For `~.compiler.gpu.Card`, ``(row, steps)`` with a
    `~.run.gpu.StepsOnCard` yields launches.
    """


class AtPoints(NamedTuple):
    """Fixes act on points; `then` is 1 after new positions are known, else 0."""

    stage: int
    then: int


class AtNodes(NamedTuple):
    """Fixes act on nodes; `target` is `arrays.ON_SUMS`, `ON_UPDATE` or `ON_VELOCITY`."""

    stage: int
    target: int
    at: Any = None  # maps the setup to a setup with other nodes


class Gather(NamedTuple):
    """A task from grid to points, for a fraction of dt."""

    task: NamedTuple
    share: float = 1.0
    of_last_step: bool = False  # True: uses the velocity before the update


class Scatter(namedtuple("Scatter", "quantities weights")):
    """Scatters quantities to the grid: a tuple of them, or a single one."""

    __slots__ = ()

    def __new__(cls, quantities: Any, weights: Any = PresentWeights()) -> "Scatter":  # noqa: B008
        single = isinstance(quantities, NodalQuantity)
        return super().__new__(cls, (quantities,) if single else tuple(quantities), weights)


class NodeTask(NamedTuple):
    """Carries out a task at every node in use."""

    task: Any  # a tag, or the class of the tags that `make` returns
    at: Any = None  # maps the setup to a setup with other nodes
    length: Any = None  # maps the setup to a time interval that replaces `kick`
    make: Any = None  # maps the setup to the tag


class EachNode(NamedTuple):
    """Calls ``function(s, n)`` at every node in use, by ``loop(s, mode)``."""

    function: Any
    loop: Any


class EachPoint(NamedTuple):
    """Calls ``function(s, block, p)`` at every point of one kind of law, by ``loop(s, block)``."""

    function: Any
    law: type
    loop: Any


class Once(NamedTuple):
    """Calls ``function(s)`` between two loops; a result of False stops the run."""

    function: Any


class InThreads(NamedTuple):
    """Calls ``function(s, mode)`` once, which divides its own loops among threads by `mode`."""

    function: Any


class WorkOfLoads(NamedTuple):
    """Sums the work of nodal loads; `again`: velocities have been mapped again after the move."""

    again: bool = False


class Repeated(NamedTuple):
    """Repeats ``rows(k)`` for k < ``count(s)``."""

    count: Any
    rows: Any


class SceneTask(NamedTuple):
    rows: Any
    says: str | None = None


class Check(NamedTuple):
    """Checks new positions after fixes changed them."""


class Sweep(NamedTuple):
    visit: Visit
    share: float = 1.0
    of_last_step: bool = False
    gathers: bool = True
    scatters: bool = True
    moves: bool = True  # new positions go to the other array
    only_if_more: bool = False  # the scatter is for the next step
    at: Any = None
    reported: Any = take_reports  # takes the reports of points, if not None


def each_node(function: Any) -> EachNode:
    @kernel
    def loop(s, mode):
        for r in range(1, 1 + s.spans[0, 0]):
            for n in range(s.spans[r, 0], s.spans[r, 1]):
                function(s, n)

    return EachNode(function, loop)


def each_node_apart(function: Any) -> EachNode:
    """Divide a loop over nodes among threads; `function` changes only values of its node."""

    @shared_out
    def visit_span(s, k):
        for n in range(s.spans[k + 1, 0], s.spans[k + 1, 1]):
            function(s, n)

    @kernel
    def loop(s, mode):
        visit_span(mode, s.spans[0, 0], s)

    return EachNode(function, loop)


def each_point(function: Any, law: type) -> EachPoint:
    @kernel
    def loop(s, block):
        for p in range(block.points.mass.size):
            function(s, block, p)

    return EachPoint(function, law, loop)


def _tasks(gathers: list[Gather]) -> tuple:
    """List the tasks of a pass. Strain depends on earlier moves and on the step of the velocity."""
    kind: type = strain.Strain
    if any(isinstance(g.task, Move) for g in gathers):
        kind = strain.StrainInMove
    elif any(g.of_last_step for g in gathers):
        kind = strain.StrainOfLastStep
    return tuple(kind() if type(g.task) is strain.Strain else g.task for g in gathers)


def _kinds(tags: Any) -> Any:
    """Return the classes of tags; tags of different classes may compare equal."""
    return tuple(_kinds(tag) if type(tag) is tuple else type(tag) for tag in tags)


class _FusedStep:
    def __init__(self, rows: Iterable[Any]):
        self.rows: list[Any] = []
        self.visits: list[Visit] = []
        self.gathers: list[Gather] = []  # gathers collected for the next pass
        self.next_sums: Scatter | None = None  # the first scatter, for the last pass
        for row in rows:
            _FUSED.get(type(row), _FusedStep.add)(self, row)
        self.visit(self.next_sums, more=True)

    def visit(self, scatter: Scatter | None, more: bool = False) -> None:
        gathers, (quantities, weights) = self.gathers, scatter or Scatter((), OldWeights())
        self.visits.append(Visit(_tasks(gathers), quantities, weights))
        share, of_last_step = gathers[0][1:] if gathers else (1.0, False)
        flags = bool(gathers), scatter is not None, bool(gathers) or more, more
        self.rows.append(Sweep(self.visits[-1], share, of_last_step, *flags))
        self.gathers = []

    def add(self, row: Any) -> None:
        if self.gathers:
            self.visit(None)
        self.rows.append(row)

    def gather(self, row: Gather) -> None:
        if any(row[1:] != other[1:] for other in self.gathers):
            self.visit(None)
        self.gathers.append(row)

    def scatter(self, row: Scatter) -> None:
        if self.next_sums is None:
            self.next_sums = row
        else:
            self.visit(row)

    def omit(self, row: Any) -> None: ...


_FUSED: dict[type, Any] = {
    Gather: _FusedStep.gather, Scatter: _FusedStep.scatter,
    AtPoints: _FusedStep.omit, Check: _FusedStep.omit,
}  # fmt: skip


def fused(rows: Iterable[Any]) -> list[Any]:
    """List the rows of a step with the fewest passes. Nodal sums must exist at its start."""
    return _FusedStep(rows).rows


def staged(rows: Iterable[Any]) -> list[Any]:
    """List the rows as separate passes, each taken from a fused pass where possible."""
    rows = list(rows)
    return one_by_one(rows, _FusedStep(rows).visits)


def one_by_one(rows: Iterable[Any], loops: Iterable[Visit] = ()) -> list[Any]:
    """List rows as separate passes, or as parts of `loops`."""

    def loop_of(single: Visit, items: slice) -> Visit:
        kinds = _kinds(single[items])
        return next((visit for visit in loops if _kinds(visit[items]) == kinds), single)

    def gather(row: Gather) -> Sweep:
        visit = loop_of(Visit(_tasks([row]), (), OldWeights()), slice(0, 1))
        return Sweep(visit, *row[1:], gathers=True, scatters=False)

    def scatter(row: Scatter) -> Sweep:
        return Sweep(loop_of(Visit((), *row), slice(1, 3)), gathers=False, moves=False)

    alone: dict[type, Any] = {Gather: gather, Scatter: scatter}
    return [alone.get(type(row), lambda row: row)(row) for row in rows]


def _says_sweep(row: Sweep, setup: Any) -> str:
    parts = [tag.says for tag in row.visit.tasks if row.gathers]
    parts += [tag.says for tag in row.visit.quantities if row.scatters]
    return ", ".join(parts) + (" in one pass over the points" if len(parts) > 1 else "")


_SAYS: dict[type, Any] = {
    Sweep: _says_sweep,
    NodeTask: lambda row, setup: row.task.says,
}


@point_function(otherwise=True)
def _described(row: Any, setup: Any) -> str | None:
    rows = in_scene.find((type(row),))(row, setup)
    texts = [_SAYS[type(one)](one, setup) for one in rows if type(one) in _SAYS]
    return "; ".join(text for text in texts if text) or None


@_described.on(SceneTask)
def _described_scene(row, setup):
    return row.says if len(row.rows(setup)) else None


def says(row: Any, setup: Any) -> str | None:
    """Describe a row and the parts that join it in a scene; None for a row without effect."""
    return _described.find((type(row),))(row, setup)


# Kinds of rows that are replaced before a step.
COMBINED = frozenset({Gather, Scatter, Repeated, SceneTask})


class Added(NamedTuple):
    """Rows and tasks that accompany a task or quantity in a scene (`Setup.additions`)."""

    before: tuple = ()  # rows before the task or quantity
    instead: Any = None  # replaces the task or quantity
    first: tuple = ()  # in the same pass, before it
    then: tuple = ()  # in the same pass, after it


class NoAdditions(NamedTuple):
    pass


@point_function(otherwise=True)
def scene_additions(tag: Any) -> tuple:
    """Return pairs of a class of tasks or quantities and its `Added`."""
    return ()


class BeforeLoads(NamedTuple):
    """A key of `scene_additions` for rows that precede the forces of fixes."""


def additions_of(tag: type, s: Setup) -> Added:
    for kind, additions in scene_additions.find((type(s.additions),))(s.additions):
        if kind in tag.__mro__:
            return additions
    return Added()


def _joined(tags: tuple, s: Setup) -> tuple:
    joined: tuple = ()
    for tag in tags:
        additions = additions_of(type(tag), s)
        instead = tag if additions.instead is None else additions.instead
        joined = (*joined, *additions.first, instead, *additions.then)
    return joined


@point_function(otherwise=True)
def in_scene(row: Any, s: Setup) -> Iterable[Any]:
    """Return the rows that replace a row in a scene."""
    return (row,)


@in_scene.on(SceneTask)
def _rows_of_scene(row, s):
    return plain(row.rows(s), s)


@in_scene.on(NodeTask)
def _after_others(row, s):
    if row.at:
        return (row,)
    additions = additions_of(row.task if row.make else type(row.task), s)
    return *plain(additions.before, s), row if additions.instead is None else additions.instead


@in_scene.on(Sweep)
def _with_additions(row, s):
    """Add the tasks that join a pass, and rows before it; F-bar adds a pass before strains."""
    averages = average_volumes(row, s) if isinstance(s.averaging, fbar.FBar) else ()
    if row.at is not None:
        return (*averages, row)
    before: tuple = ()
    for task in row.visit.tasks if row.gathers else ():
        before = (*before, *additions_of(type(task), s).before)
    tasks, quantities, weights = row.visit
    visit = Visit(_joined(tasks, s), _joined(quantities, s), weights)
    return (*averages, *before, row._replace(visit=visit))


def plain(rows: Iterable[Any], s: Setup) -> Iterator[Any]:
    for row in rows:
        yield from in_scene.find((type(row),))(row, s)


class Insulated(NamedTuple):
    rows = ()


def _clear_radial(s, n):
    nodes, kin = s.nodes, s.kin
    if nodes.sums[n, arrays.MASS] > 0:
        nodes.sums[n, arrays.of_momentum(kin)] = 0
        nodes.sums[n, arrays.of_force(kin)] = 0
        nodes.update[n, 0] = 0
        nodes.update[n, arrays.of_change(kin)] = 0
        nodes.velocity[n, 0] = 0
        clear_first(field(nodes.fields, Normal), n)
        clear_water_across(nodes, kin, n)


def _axis_of(grids, g):
    first = grids.first[g]
    return first, first + (
        grids.step_x[g] if abs(grids.x0[g]) <= grids.slack[g] * grids.h[g] else 0
    )


@kernel
def _hold_axis(s, mode):
    for g in range(s.grids.first.size):
        begin, end = _axis_of(s.grids, g)
        for n in range(begin, end):
            _clear_radial(s, n)


def _hold_node(s, n):
    for g in range(s.grids.first.size):
        begin, end = _axis_of(s.grids, g)
        if begin <= n < end:
            _clear_radial(s, n)


def hold_axis(s: Setup) -> tuple:
    """Set v_r = 0 on an axis of symmetry, where N / r is unbounded."""
    # normals on the axis are along the axis
    return (EachNode(_hold_node, _hold_axis),) if s.kin.hoops else ()


def sum_series(s: Setup) -> tuple:
    """Replace the velocity change by XPIC's new velocity."""
    if not s.transfer.traits.series:
        return ()
    # (I - (I - S S+)^m) v_p = S sum_k (I - S+ S)^k S+ v, k from 0 to m - 1
    terms = Repeated(lambda s: s.transfer.order - 1, _next_term)
    return NodeTask(xpic.StartSeries()), terms, *hold_axis(s)


def _next_term(k: int) -> tuple:
    visit = Visit((xpic.SeriesTerm(k),), (xpic.SeriesBack(),), OldWeights())
    return Sweep(visit, moves=False, reported=None), NodeTask(xpic.ExtendSeries())


def average_volumes(row: Sweep, s: Setup) -> tuple:
    """Average the volume change of the next strain at the nodes (F-bar)."""
    if not (row.gathers and any(isinstance(task, strain.Strain) for task in row.visit.tasks)):
        return ()
    trial = strain.TrialStrainOfLastStep() if row.of_last_step else strain.TrialStrain()
    visit = Visit((trial,), (fbar.Volumes(),), OldWeights())
    sweep = Sweep(visit, row.share, row.of_last_step, moves=False, reported=None)
    return sweep, *JOIN_MEANS(s), NodeTask(fbar.TakeMean())


def average_stress(s: Setup) -> tuple:
    if not isinstance(s.averaging, fbar.FBar):
        return ()
    visit = Visit((fbar.SetMeanStress(),), (fbar.AveragedForce(),), OldWeights())
    sweep = Sweep(visit, moves=False, reported=None)
    return *JOIN_STRESSES(s), NodeTask(fbar.TakeMeanStress()), sweep


def corrected(s: Setup) -> tuple:
    if field(s.nodes.fields, Acceleration) is None:
        return ()
    return (NodeTask(CorrectAcceleration, make=correct_acceleration), *hold_axis(s))


def update_velocity(s: Setup) -> tuple:
    task = UpdateToCorrect() if len(corrected(s)) else nodes.NodalUpdate()
    return (NodeTask(task),)


def at_nodes_with(kind: type, task: Tag) -> Any:
    return lambda s: (NodeTask(task),) if field(s.nodes.fields, kind) is not None else ()


def any_node(s):
    return nodes.UpdateToVelocity(real(0, s.nodes.sums[0, arrays.MASS]))


def light_node(s):
    """Return the task that limits gradients at nodes lighter than d (c dt / h)^2 of a point (USL).

    The fraction d (c dt / h)^2 is at most 1. At nodes of less mass, strain would change faster than
    stress can follow. There is no limit with moments in the total frame, which return the whole
    nodal velocity and would grow with any limit.
    """
    if stores_moment(s.transfer) and not s.frame.moves:
        return any_node(s)
    step, motion = s.control.step[0], s.control.motion[0]
    courant = motion.rate * s.control.values[arrays.DT] / step.spacing
    masses = min(s.kin.dimension * courant * courant, 1.0)
    return nodes.UpdateToVelocity(real(masses, s.nodes.sums[0, arrays.MASS]))


def seams(task: type, across: tuple) -> Any:
    """Return the rows that join images of nodes in periodic directions."""
    further = tuple(NodeTask(kind, make=sheared.at_images(kind)) for kind in across)

    def rows(s):
        ranks = s.control.ranks
        if not isinstance(ranks, Seam):
            return ()
        joins = tuple([NodeTask(task(axis)) for axis in ranks.joined])
        return (*joins, *further) if isinstance(ranks.shear, sheared.Shear) else joins

    return rows


def sort_in_time(s: Setup) -> tuple:
    return (Once(ask_to_sort),) if isinstance(s.control.ranks, Seam) else ()


JOIN_MEANS, JOIN_STRESSES = seams(JoinMean, ()), seams(JoinMeanStress, ())
SEAM = SceneTask(seams(Join, sheared.OF_SUMS), "sums of periodic images")
SEAM_AGAIN = SceneTask(seams(JoinVelocity, sheared.OF_VELOCITY), "momentum of periodic images")
HEAT = SceneTask(lambda s: s.heat.rows, "heat to the nodes, its flow, temperature of the points")
FRICTION = SceneTask(at_nodes_with(loss.FrictionalHeat, loss.ClearFrictionalHeat()))
LOSS = SceneTask(
    at_nodes_with(loss.EnergyLoss, loss.KeepLoss()),
    "kinetic energy that the nodes lose, as heat to the points",
)
NODAL_MASS = SceneTask(at_nodes_with(NodalMass, loss.KeepMass()))
AVERAGED = SceneTask(average_stress, "force of the averaged mean stress in a pass over the points")
CONTACT = SceneTask(
    lambda s: (*s.bodies.rows_first, *s.contact.rows, *s.bodies.rows_last), "contact of v*"
)
WORK_OF_LOADS = WorkOfLoads()
# The velocity that strains points must satisfy contact, too, unless it is v*.
CONTACT_BEFORE = SceneTask(lambda s: (*s.bodies.rows_before, *s.contact.rows_before))
CONTACT_AFTER = SceneTask(lambda s: (*s.bodies.rows_after, *s.contact.rows_after))
CONTACT_WORK = SceneTask(lambda s: (*s.bodies.rows_work, *s.contact.rows_work))
BEFORE_LOADS = SceneTask(lambda s: additions_of(BeforeLoads, s).before)
CORRECTION = SceneTask(corrected, CorrectAcceleration.says)
AXIS = SceneTask(hold_axis, "v_r = 0 on the axis")
SERIES = SceneTask(sum_series, "series of XPIC")

BEGIN = AtPoints(arrays.INITIAL_INTEGRATE, 0)
END = AtPoints(arrays.FINAL_INTEGRATE, 1)
SUMS = Scatter((MassMomentum(), InternalForce()))
MASS_AND_MOMENTUM = Scatter(MassMomentum())
# Nodal velocity before the forces, for schemes that strain first.
VELOCITY_BEFORE = (
    MASS_AND_MOMENTUM,
    AXIS,
    NodeTask(nodes.SumsToVelocity()),
    AtNodes(arrays.POST_UPDATE_GRID_STATE, arrays.ON_VELOCITY),
    CONTACT_BEFORE,
)
FORCE = Scatter(InternalForce(), OldWeights())
# v* = v + dt f / m with loads, prescribed velocities and contact; heat flow.
UPDATE = (
    SceneTask(sort_in_time),
    AVERAGED,
    SEAM,
    FRICTION,
    LOSS,
    NODAL_MASS,
    HEAT,
    BEFORE_LOADS,
    AtNodes(arrays.POST_PARTICLES_TO_GRID, arrays.ON_SUMS),
    AXIS,
    SceneTask(update_velocity, nodes.NodalUpdate.says),
    CORRECTION,
    AtNodes(arrays.POST_UPDATE_GRID_STATE, arrays.ON_UPDATE),
    CONTACT,
)
ACCELERATE = (*UPDATE, WORK_OF_LOADS, CONTACT_WORK)
MOVE = (
    Gather(Move()),
    AtPoints(arrays.POST_GRID_TO_POINT, 1),
    AtPoints(arrays.POST_ADVANCE_PARTICLES, 1),
    Check(),
)
# Velocities of the moved points, mapped again.
MOMENTUM_AGAIN = (
    Scatter(MomentumAgain(), OldWeights()),
    SEAM_AGAIN,
    NodeTask(nodes.MomentumToVelocity()),
    AXIS,
    AtNodes(arrays.POST_VELOCITIES_TO_GRID, arrays.ON_VELOCITY),
    CONTACT_AFTER,
    WorkOfLoads(again=True),
)


def shown_sums(rows: Iterable[Any]) -> tuple:
    """List the quantities of `SUMS`, and those a scheme also scatters before points move."""
    by_class = {type(one): one for one in SUMS.quantities}
    for row in rows:
        if isinstance(row, Gather) and isinstance(row.task, Move):
            break
        if isinstance(row, Scatter):
            by_class |= {type(one): one for one in row.quantities}
    return tuple(by_class.values())
