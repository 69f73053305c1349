"""The arrays and tags of a visit to a point, and loops over its tags.

A visit gathers from the nodes of the point's stencil and settles the point (grid to points,
:mod:`karamelo_py.kernels.g2p`), then scatters to the nodes (points to grid,
:mod:`karamelo_py.kernels.p2g`). *What* is gathered and scattered are tuples of tags, so that one
loop (:mod:`karamelo_py.kernels.sweep`) serves every scheme, fused or stage by stage.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import index, point_function, prefetch, real, shared
from karamelo_py.compiler.fields import field, load, load_vector
from karamelo_py.compiler.tuples import count_in, record
from karamelo_py.kernels.arrays import Index, Nodes, Number, Places, Points, Tag
from karamelo_py.points.basis import blank, locate
from karamelo_py.points.frames import DeformationGradient, Total
from karamelo_py.points.grid import Grid
from karamelo_py.points.kinematics import zero
from karamelo_py.points.laws import deformation, initial_state
from karamelo_py.points.transfers import Moment, zero_moment


class Work(NamedTuple):
    """Arrays and tags of a visit to a point; made once a tile."""

    frame: Tag
    kin: Tag
    basis: Tag
    grid: Grid
    transfer: Tag
    averaging: Tag
    nodes: Nodes
    points: Points
    laws: NamedTuple  # parameters of the materials, an array (m,) each
    places: Places
    common: tuple  # (d,) velocity that speeds are measured from


@shared
def place_at(basis: Tag, kin: Tag, array: np.ndarray, p: Index) -> tuple:
    """Load the place (w,) of point `p`: its position and the shape of its domain."""
    return load(array, p, blank(basis, kin, load_vector(kin, array, p)))


@shared
def law_of(w: Work, p: Index) -> Tag:
    """Load the law of point `p`, with the parameters of its material."""
    return record(w.laws, index(w.points.material[p]))  # type: ignore[arg-type]


@shared
def state_of(w: Work, law: Tag, p: Index, like: Number) -> tuple:
    """Load the state (s,) of the law at point `p`."""
    return load(w.points.state, p, initial_state(law, w.kin, like))


@shared
def stored_or_own(f: tuple, law: Tag, kin: Tag, state: tuple) -> tuple:
    """Return the deformation gradient `f` if it is stored, else that of the law's state."""
    return f if len(f) else deformation(law, kin, state)


@shared
def ask_ahead(w: Work, p: Index, like: Number) -> None:
    """Ask the memory for the data of the next points, where they keep moments of velocity.

    These are visited once a step, with all they have: in space that is more arrays side by side
    than a processor sees the pattern of.
    """
    moment = zero_moment(w.transfer, w.kin, like)
    if w.kin.dimension == 3 and len(moment):
        _ask_for_motion(w, p)
        _ask(field(w.points.fields, Moment), len(moment), p)
        _ask(w.points.state, count_in(initial_state(law_of(w, p), w.kin, like)), p)


@shared
def ask_ahead_of_stretch(w: Work, p: Index, like: Number) -> None:
    """Ask the memory for the data of the update of a stretch of points, while it gathers."""
    if w.kin.dimension == 3:
        _ask_for_motion(w, p)
        _ask(w.points.state, count_in(initial_state(law_of(w, p), w.kin, like)), p)
        f = field(w.points.fields, DeformationGradient)
        if f is not None:
            _ask(f, w.kin.tensor_size, p)


@shared
def _ask_for_motion(w, p):
    _ask(w.places.x, w.kin.dimension, p)
    _ask(w.points.v, w.kin.dimension, p)


@shared
def _ask(array, rows, p):
    for k in range(rows):
        prefetch(array, (k, p))


@point_function(otherwise=True)
def records_of(tag: Tag, nodes: Nodes) -> np.ndarray | None:
    """Return the records that a task gathers from, or that take a quantity, for `prefetch_records`.

    None: they are not asked for.
    """
    return None


@point_function(otherwise=True)
def deformation_of(frame: Tag, kin: Tag, law: Tag, state: tuple, points: Points, p: Index) -> tuple:
    """Return the deformation gradient F of a point where the frame needs it, else ()."""
    return ()


@deformation_of.on(Total)
def _deformation_of_total(frame, kin, law, state, points, p):
    f = load(field(points.fields, DeformationGradient), p, zero(kin, points.mass[p]))
    return stored_or_own(f, law, kin, state)


@point_function(otherwise=True)
def present_stencil(frame: Tag, w: Work, stencil: tuple, p: Index) -> tuple:
    """Return the stencil of the place after the move; in the total frame it never changes."""
    return locate(w.basis, w.kin, w.grid, place_at(w.basis, w.kin, w.places.y, p))


@present_stencil.on(Total)
def _present_stencil_total(frame, w, stencil, p):
    return stencil


# --- loops over tags, written out -------------------------------------------------------------


def for_tags(function: Callable, names: str, each: str | None = None) -> Callable:
    """Make ``f(tags, ...)``: the tuple of ``function(tag, ...)`` over a tuple of tags.

    `names` are the other parameters; of the one called `each`, every tag gets its own item.
    """

    own = names.split(", ").index(each) if each else None

    @shared
    def loop(tags, *arguments):
        if own is None:
            return tuple([function(tag, *arguments) for tag in tags])
        before, items, after = arguments[:own], arguments[own], arguments[own + 1 :]
        return tuple([function(t, *before, items[k], *after) for k, t in enumerate(tags)])

    return loop


def in_turn(function: Callable) -> Callable:
    """Make ``f(tags, w, stencil, p, dt, totals, fastest)`` of settling functions, in turn.

    Distances add up, and the rate goes from one to the next (see `g2p.settled`).
    """

    @shared
    def loop(tags, w, stencil, p, dt, totals, fastest):
        moved = real(0, fastest)
        for k, tag in enumerate(tags):
            further, fastest = function(tag, w, stencil, p, dt, totals[k], totals, fastest)
            moved += further
        return moved, fastest

    return loop


all_records_of = for_tags(records_of, "nodes")
