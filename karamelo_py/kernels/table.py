"""A scheme as a table: visits of the points, tasks at nodes and fixes, in the order of a step.

A scheme names its rows once, stage by stage, as its class attribute ``rows``. From them follow

- the staged step, in which fixes act on points between the stages;
- the fused step, with as few visits of the points as the rows allow: tasks and scatters that
  nothing separates share a visit, and the first scatter joins the last visit of the step before;
- what `karamelo-py check` says of a step, and the traffic that `karamelo-py bench` counts.

Averaged volumes, XPIC, heat and contact are calls that do nothing in scenes without them.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

from karamelo_py.kernels.g2p import Move, Strain, StrainInMove, StrainOfLastStep
from karamelo_py.kernels.sweep import OldWeights, PresentWeights, Visit


class AtPoints(NamedTuple):
    """Fixes act on the points; `then` is 1 when their new places are known, else 0."""

    stage: int
    then: int


class AtNodes(NamedTuple):
    """Fixes act on the nodes, on their sums, their update or the velocity that strains."""

    stage: int
    target: int


class Gather(NamedTuple):
    """Grid to points: a task, with the share of dt that it takes, of this step or of the last."""

    task: NamedTuple
    share: float = 1.0
    of_last_step: bool = False  # the velocity before the update belongs to the last step


class Scatter(NamedTuple):
    """Points to grid: quantities, by old weights or present ones.

    Present weights are those of the place after the move: of the step to come.
    """

    quantities: tuple
    weights: NamedTuple = PresentWeights()


class NodeTask(NamedTuple):
    """A task at every node in use: its tag, or a function of the setup that makes it."""

    task: Any


class SceneTask(NamedTuple):
    """A call ``function(s, mode, hooks)`` of what only some scenes have."""

    function: Any


class Check(NamedTuple):
    """Look at the new places again, after fixes that may have changed them."""


class Sweep(NamedTuple):
    """A visit of the points, as it is compiled; `gathers` and `scatters` say what of it is done."""

    visit: Visit
    share: float = 1.0
    of_last_step: bool = False
    gathers: bool = True
    scatters: bool = True
    moves: bool = True  # whether new places go to the other of the two arrays
    only_if_more: bool = False  # the scatter belongs to the next step


def _tasks(gathers: list[Gather]) -> tuple:
    """The tasks of one visit; what strains is told of what comes before it.

    Strain behind a move knows what that gathered. By the velocity of the last step, points are
    strained where that has led them.
    """
    moves = any(isinstance(g.task, Move) for g in gathers)

    def known(g: Gather) -> NamedTuple:
        if not isinstance(g.task, Strain) or not (moves or g.of_last_step):
            return g.task
        return StrainInMove() if moves else StrainOfLastStep()

    return tuple(known(g) for g in gathers)


def _kinds(tags: tuple) -> tuple:
    """Return the classes of tags: as tuples, tags without numbers are all equal."""
    return tuple(type(tag) for tag in tags)


def fused(rows: Iterable[Any]) -> list[Any]:
    """The rows of a step with as few visits as they allow; the sums are on the nodes before it."""
    kept = [row for row in rows if not isinstance(row, AtPoints | Check)]
    first = next(k for k, row in enumerate(kept) if isinstance(row, Scatter))
    next_sums = kept.pop(first)
    out: list[Any] = []
    waiting: list[Gather] = []

    def sweep(scatter: Scatter | None, more: bool = False) -> Sweep:
        found = scatter or Scatter((), OldWeights())
        visit = Visit(_tasks(waiting), found.quantities, found.weights)
        share, of_last_step = waiting[0][1:] if waiting else (1.0, False)
        # The new places are read by a scatter of the next step, whoever made them.
        moves = bool(waiting) or more
        scatters = scatter is not None
        return Sweep(visit, share, of_last_step, bool(waiting), scatters, moves, more)

    for row in kept:
        if isinstance(row, Gather):
            if waiting and waiting[0][1:] != row[1:]:
                out.append(sweep(None))
                waiting = []
            waiting.append(row)
        elif isinstance(row, Scatter):
            out.append(sweep(row))
            waiting = []
        else:
            if waiting:
                out.append(sweep(None))
                waiting = []
            out.append(row)
    out.append(sweep(next_sums, more=True))
    return out


def staged(rows: Iterable[Any]) -> list[Any]:
    """The rows of a step one by one, as parts of the visits of the fused step where they can be."""
    rows = list(rows)
    loops = [row.visit for row in fused(rows) if isinstance(row, Sweep)]

    def loop_of(tasks: tuple, scatter: Scatter | None) -> Visit:
        for visit in loops:
            if scatter is None and _kinds(visit.tasks) == _kinds(tasks):
                return visit
            if scatter is not None and (*_kinds(visit.quantities), type(visit.weights)) == (
                *_kinds(scatter.quantities),
                type(scatter.weights),
            ):
                return visit
        if scatter is None:
            return Visit(tasks, (), OldWeights())
        return Visit(tasks, scatter.quantities, scatter.weights)

    out: list[Any] = []
    for row in rows:
        if isinstance(row, Gather):
            out.append(Sweep(loop_of(_tasks([row]), None), *row[1:], True, False))
        elif isinstance(row, Scatter):
            visit = loop_of((), row)
            out.append(Sweep(visit, gathers=False, moves=False))
        else:
            out.append(row)
    return out


def one_by_one(rows: Iterable[Any]) -> list[Any]:
    """The rows of a part of a step, each with a visit of its own."""

    def alone(row: Any) -> Any:
        if isinstance(row, Gather):
            return Sweep(Visit(_tasks([row]), (), OldWeights()), *row[1:], True, False)
        if isinstance(row, Scatter):
            visit = Visit((), row.quantities, row.weights)
            return Sweep(visit, gathers=False, moves=False)
        return row

    return [alone(row) for row in rows]


def says(row: Any, setup: Any) -> str | None:
    """Describe a row in words; None where it does nothing in this scene."""
    if isinstance(row, Sweep):
        parts = [tag.says for tag in row.visit.tasks if row.gathers]
        parts += [tag.says for tag in row.visit.quantities if row.scatters]
        return ", ".join(parts) + (" in one visit of the points" if len(parts) > 1 else "")
    if isinstance(row, NodeTask):
        return getattr(row.task, "says", None)
    if isinstance(row, SceneTask):
        return row.function.says(setup)
    return None
