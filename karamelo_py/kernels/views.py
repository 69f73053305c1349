"""Views of a point, `pt`, and of a node in its stencil, `node`, which equations use.

Views exist only while a kernel is traced. docs/house/kernels.md lists their attributes.
"""

from collections import namedtuple
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import algebra, index
from karamelo_py.compiler.fields import field, load, load_vector
from karamelo_py.compiler.gpu import aligned_record
from karamelo_py.compiler.lanes import prefetch
from karamelo_py.compiler.threads import many_threads
from karamelo_py.compiler.tuples import count_in, record
from karamelo_py.kernels.arrays import (
    Index,
    Locations,
    Nodes,
    Number,
    Points,
    Tag,
    of_change,
    vector_at,
)
from karamelo_py.kernels.records import row
from karamelo_py.points.basis import affine_weight, blank, entry, reach, support
from karamelo_py.points.basis.weighted import Weighted
from karamelo_py.points.frames import DeformationGradient
from karamelo_py.points.grid import Grid
from karamelo_py.points.kinematics import vector, zero
from karamelo_py.points.laws import deformation, initial_state, jacobian, specific_volume
from karamelo_py.points.transfers import Moment, gradient_weight, zero_moment


class Work(NamedTuple):
    """Arrays and tags of a pass, made once per tile."""

    frame: Tag
    kin: Tag
    basis: Tag
    grid: Grid
    transfer: Tag
    averaging: Tag
    nodes: Nodes
    points: Points
    laws: NamedTuple  # material parameters, (m,) each
    locations: Locations
    common: tuple  # (d,) reference velocity
    kick: Number


@algebra
class NodeView(namedtuple("NodeView", "w stencil k i N grad_N")):
    """The k-th node of a point's stencil."""

    __slots__ = ()
    kin = property(lambda node: node.w.kin)
    transfer = property(lambda node: node.w.transfer)
    strain_N = property(lambda node: gradient_weight(node.w.transfer, node))

    @property
    def arm(self):
        """The vector X_i - x."""
        w = self.w
        return reach(w.basis, w.kin, w.grid, self.stencil, self.k)

    @property
    def affine_N(self):
        """The vector N_i D^-1 (X_i - x)."""
        w = self.w
        return affine_weight(w.basis, w.kin, w.grid, self.stencil, self.k)

    def v_star(self, template):
        """Return v* and v* - v in the type of `template`; they are one record in 2D, two in 3D."""
        kin, records, i = self.w.kin, self.w.nodes.update, self.i
        first, d = of_change(kin), kin.dimension
        if many_threads() and not isinstance(i, Weighted):  # adjacent records
            both = aligned_record(records, i, 2 * first)
            return vector(kin, both[:d]), vector(kin, both[first : first + d])
        if d == 2:
            both = row(records, i, 0, (*template, *template))
            return vector(kin, both[:2]), vector(kin, both[2:])
        return vector_at(kin, records, i, 0, template), vector_at(kin, records, i, first, template)

    @property
    def v(self):
        kin, records = self.w.kin, self.w.nodes.velocity
        if many_threads() and not isinstance(self.i, Weighted):
            return vector(kin, aligned_record(records, self.i, of_change(kin))[: kin.dimension])
        return vector_at(kin, records, self.i, 0, self.grad_N[: kin.dimension])

    def of(self, kind):
        return field(self.w.nodes.fields, kind)


@algebra
class PointView(namedtuple("PointView", "w stencil p dt")):
    """A point, or points in lanes, in a gather or an update."""

    __slots__ = ()
    kin = property(lambda pt: pt.w.kin)
    v = property(lambda pt: load_vector(pt.w.kin, pt.w.points.v, pt.p))
    x = property(lambda pt: load_vector(pt.w.kin, pt.w.locations.x, pt.p))
    y = property(lambda pt: load_vector(pt.w.kin, pt.w.locations.y, pt.p))
    law_and_state = property(lambda pt: state_at(pt.w.kin, pt.w.points, pt.w.laws, pt.p))

    @property
    def law_state_F(self):
        w, material = self.w, self.law_and_state
        return *material, deformation_of(w.frame, w.kin, w.points, material, self.p)

    @property
    def nodes(self):
        w = self.w
        return tuple([node_of(w, self.stencil, k) for k in range(support(w.basis, w.kin))])

    def of(self, kind):
        return field(self.w.points.fields, kind)

    def load(self, kind, template):
        """Load as many components of a field as `template` has; () if absent."""
        return load(self.of(kind), self.p, template)


def location_at(basis: Tag, kin: Tag, array: np.ndarray, p: Index) -> tuple:
    """Load a location (w,): position and domain shape."""
    return load(array, p, blank(basis, kin, load_vector(kin, array, p)))


def node_of(w: Work, stencil: tuple, k: int) -> NodeView:
    return NodeView(w, stencil, k, *entry(w.basis, w.kin, w.grid, stencil, k))


def law_at(points: Points, laws: NamedTuple, p: Index) -> Tag:
    return record(laws, index(points.material[p]))  # type: ignore[arg-type]


def state_at(kin: Tag, points: Points, laws: NamedTuple, p: Index) -> tuple:
    law = law_at(points, laws, p)
    return law, load(points.state, p, initial_state(law, kin, points.mass[p]))


def volume_of(kin: Tag, points: Points, law: Tag, state: tuple, p: Index) -> Number:
    return points.mass[p] * specific_volume(law) * jacobian(law, kin, state)


def deformation_of(frame: Tag, kin: Tag, points: Points, material: tuple, p: Index) -> tuple:
    """Return F of a point if the frame needs it, else (); `material` is (law, state)."""
    if frame.moves:
        return ()
    law, state = material
    f = load(field(points.fields, DeformationGradient), p, zero(kin, points.mass[p]))
    return f if len(f) else deformation(law, kin, state)


def ask_ahead(w: Work, p: Index, template: Number, apart: bool) -> None:
    """Prefetch the next points in 3D, if more arrays are read than hardware prefetches."""
    d, fields = w.kin.dimension, w.points.fields
    moment = len(zero_moment(w.transfer, w.kin, template))
    if d == 3 and (apart or moment):
        state = count_in(initial_state(law_at(w.points, w.laws, p), w.kin, template))
        more = (field(fields, Moment), moment)
        if apart:
            more = (field(fields, DeformationGradient), w.kin.tensor_size)
        for array, rows in ((w.locations.x, d), (w.points.v, d), more, (w.points.state, state)):
            if array is not None:
                for k in range(rows):
                    prefetch(array, (k, p))
