"""The arrays and tags of a visit to a point, loops over its tags, and F-bar.

A visit gathers from the nodes of the point's stencil and updates the point (grid to points,
:mod:`karamelo_py.kernels.g2p`), then scatters to the nodes (points to grid,
:mod:`karamelo_py.kernels.p2g`). *What* is gathered and scattered are tuples of tags, so that one
loop (:mod:`karamelo_py.kernels.sweep`) serves every scheme, fused or stage by stage.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.compile import fma, index, point_function, prefetch, real
from karamelo_py.compiler.fields import (
    Field,
    StepField,
    SummedField,
    field,
    load,
    load_vector,
    pair,
)
from karamelo_py.compiler.tuples import count_in, record, row
from karamelo_py.kernels.arrays import Index, Nodes, Number, Places, Points, Tag
from karamelo_py.points.basis import blank, entry, support
from karamelo_py.points.frames import DeformationGradient, scaled_increment
from karamelo_py.points.grid import Grid
from karamelo_py.points.kinematics import zero
from karamelo_py.points.laws import deformation, initial_state, jacobian, specific_volume
from karamelo_py.points.transfers import Moment, gradient_weight, zero_moment


class Work(NamedTuple):
    """Arrays and tags of a visit to a point; made once per tile."""

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
    kick: Number  # how long forces act in the step


def place_at(basis: Tag, kin: Tag, array: np.ndarray, p: Index) -> tuple:
    """Load the place (w,) of point `p`: its position and the shape of its domain."""
    return load(array, p, blank(basis, kin, load_vector(kin, array, p)))


def node_of(w: Work, stencil: tuple, k: int) -> tuple:
    """Return number i, weight N and gradient of N of the k-th node of a stencil."""
    return entry(w.basis, w.kin, w.grid, stencil, k)


def straining_node(w: Work, stencil: tuple, k: int) -> tuple:
    """Return the same, with its weight in strains and forces instead of the gradient."""
    i, N, grad_N = node_of(w, stencil, k)
    return i, N, gradient_weight(w.transfer, w.basis, w.kin, w.grid, stencil, k, grad_N)


def nodes_of(w: Work, stencil: tuple) -> tuple:
    """Return what `node_of` says of all nodes that a point sees."""
    return tuple([node_of(w, stencil, k) for k in range(support(w.basis, w.kin))])


def law_at(points: Points, laws: NamedTuple, p: Index) -> Tag:
    """Load the law of point `p`, with the parameters of its material."""
    return record(laws, index(points.material[p]))  # type: ignore[arg-type]


def state_at(kin: Tag, points: Points, laws: NamedTuple, p: Index) -> tuple:
    """Load the law of point `p` and its state."""
    law = law_at(points, laws, p)
    return law, load(points.state, p, initial_state(law, kin, points.mass[p]))


def volume_of(kin: Tag, points: Points, law: Tag, state: tuple, p: Index) -> Number:
    """Return the present volume of point `p`."""
    return points.mass[p] * specific_volume(law) * jacobian(law, kin, state)


def law_and_state(w: Work, p: Index) -> tuple:
    """Load the law of point `p` and its state."""
    return state_at(w.kin, w.points, w.laws, p)


def deformed_state(w: Work, p: Index) -> tuple:
    """Load the law of point `p`, its state, and F as `deformation_of`."""
    law, state = law_and_state(w, p)
    return law, state, deformation_of(w.frame, w.kin, law, state, w.points, p)


def ask_ahead(w: Work, p: Index, like: Number, apart: bool) -> None:
    """Prefetch the data of the next points, in 3D.

    Points with moments of velocity are visited once per step, with all their data: more
    arrays side by side than a processor sees the pattern of. So is what the update of a stretch of
    points needs (`apart`), while it gathers.
    """
    d, fields = w.kin.dimension, w.points.fields
    moment = len(zero_moment(w.transfer, w.kin, like))
    if d == 3 and (apart or moment):
        state = count_in(initial_state(law_at(w.points, w.laws, p), w.kin, like))
        more = (field(fields, Moment), moment)
        if apart:
            more = (field(fields, DeformationGradient), w.kin.tensor_size)
        for array, rows in ((w.places.x, d), (w.points.v, d), more, (w.points.state, state)):
            if array is not None:
                for k in range(rows):
                    prefetch(array, (k, p))


@point_function(otherwise=True)
def records_of(tag: Tag, nodes: Nodes) -> np.ndarray | None:
    """Return the records that a task gathers from, or that take a quantity, for `prefetch_records`.

    None: they are not asked for.
    """
    return None


def deformation_of(frame: Tag, kin: Tag, law: Tag, state: tuple, points: Points, p: Index) -> tuple:
    """Return the deformation gradient F of a point where the frame needs it, else ()."""
    if frame.moves:
        return ()
    f = load(field(points.fields, DeformationGradient), p, zero(kin, points.mass[p]))
    return f if len(f) else deformation(law, kin, state)


def for_tags(function: Callable, names: str, each: str | None = None) -> Callable:
    """Make ``f(tags, ...)``: the tuple of ``function(tag, ...)`` over a tuple of tags.

    `names` are the other parameters; of the one called `each`, every tag gets its own item.
    """

    own = names.split(", ").index(each) if each else None

    def loop(tags, *arguments):
        if own is None:
            return tuple([function(tag, *arguments) for tag in tags])
        before, items, after = arguments[:own], arguments[own], arguments[own + 1 :]
        return tuple([function(t, *before, items[k], *after) for k, t in enumerate(tags)])

    return loop


all_records_of = for_tags(records_of, "nodes")


# --- F-bar: averages over the surroundings, where a scene asks ---------------------------------


class VolumeRatio(StepField):
    """Ratio of volumes of the trial increment of a point."""

    start = 1.0


class NodalMean(SummedField):
    """Sum weight times value, and weights, at a node; then replace the first by the mean.

    Of ratios of volumes, weighted with volumes (F-bar); of temperatures, weighted with conductance.
    """

    shape = pair


class AveragedStress(StepField):
    """Mean stress of a point and its surroundings."""


class PressureBeside(Field):
    """Pressure that the last forces had more than the point: averaged less own (F-bar)."""


class NodalStress(SummedField):
    """Sum of weight, volume and mean stress, and of weight and volume; then the mean."""

    shape = NodalMean.shape


class PointByPoint(NamedTuple):
    """Every point has its own change of volume."""

    in_lanes = True


class FBar(NamedTuple):
    """Changes of volume are averaged over the surroundings, against volumetric locking.

    With d_p the rate of volume of a point and V_p its volume, the average is
    sum_i N_ip sum_q N_iq V_q d_q / sum_q N_iq V_q. Weighted with volumes it is its own adjoint: the
    mean stress averaged alike gives forces whose power equals the averaged strain's.
    """

    in_lanes = True
    point_fields = (VolumeRatio, AveragedStress)
    node_fields = (NodalMean, NodalStress)


class FBarOfSoil(FBar):
    """The same, with laws whose yield surface takes a part of the averaged pressure.

    If it took the point's pressure, soil that dilates less than friction asks for would lose
    strength in stripes (:func:`~karamelo_py.points.laws.strengths.frictional.share_of_average`).
    """

    point_fields = (*FBar.point_fields, PressureBeside)


def no_ratio(w, like):
    """Return the start of the gather of the averaged volume ratio; () where none is averaged."""
    return (real(0, like),) if isinstance(w.averaging, FBar) else ()


def gathered_ratio(w, stencil, k, total):
    """Add the ratio of volumes at the k-th node to `total`, where it is averaged."""
    if not len(total):
        return total
    i, weight, _ = node_of(w, stencil, k)
    (mean,) = row(field(w.nodes.fields, NodalMean), i, 0, total)
    return (fma(weight, mean, total[0]),)


def averaged(w, p, dl, ratio):
    """Give `dl` the change of volume that the surroundings have on average, where there is one."""
    if not len(ratio):
        return dl
    # The ratio of volumes of the increment is replaced by its average over the points nearby,
    # weighted with their volumes (after Coombs et al. 2018, "Overcoming volumetric locking in
    # material point methods", eq. 23; there over the points of a cell). In the total frame, `dl`
    # is dt Fdot, and F + dl is scaled.
    _, _, f = deformed_state(w, p)
    own = field(w.points.fields, VolumeRatio)[0, p]
    return scaled_increment(w.frame, w.kin, dl, f, ratio[0] / own)
