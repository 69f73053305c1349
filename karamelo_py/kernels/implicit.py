"""Implicit steps: nodal forces after trial displacements, and their derivatives.

All Newton iterations use the weights and gradients before the step (as in Charlton, Coombs &
Augarde 2017). With H = sum_I u_I (x) grad N_I, the nominal stress P(H) = tau(H) (I + H)^-T gives
the forces V0 P grad N, and dP/dH (:mod:`karamelo_py.compiler.slopes`) the consistent stiffness V0
grad N dP/dH grad N.
"""

from typing import NamedTuple

import numpy as np
from numba import config

from karamelo_py.compiler import at_hand, kernel, on_numbers, point_function
from karamelo_py.compiler.fields import load, rows_of_points, store
from karamelo_py.compiler.slopes import seeded, slopes_of
from karamelo_py.compiler.threads import by_threads
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import Block, Setup
from karamelo_py.kernels.lanes import lanes_with, points_from
from karamelo_py.kernels.views import deformation_of, location_at, state_at
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.basis.cpdi import AtCorners
from karamelo_py.points.kinematics import (
    I,
    gradient,
    inv,
    large,
    outer,
    total,
    unit,
    zero,
    zero_vector,
)
from karamelo_py.points.laws import advance, by_rates, kirchhoff_stress, specific_volume

PARTS = 64  # parts of a parallel loop, each with whole groups of lanes
GROUP = 8


class Seen(NamedTuple):
    """Nodes in the stencils of a block's points, with nonzero weight or gradient."""

    count: np.ndarray  # (n,) int32
    nodes: np.ndarray  # (n, s) int32 index of the unknown (int64: in the grid)
    weights: np.ndarray  # (n, s)
    gradients: np.ndarray  # (n, s, c) before the step
    starts: np.ndarray  # (m + 1,) int64: range of each node in `entries`
    entries: np.ndarray  # int32 or int64: p s + k for point p and k-th node of its stencil, by node


class Pairs(NamedTuple):
    """Pairs of nodes in a common stencil: the blocks of K, row by row."""

    codes: np.ndarray  # (m,) int64 grid positions, whose differences identify pairs
    middle: int  # column of difference 0 in `rank`
    rank: np.ndarray  # (m, r) int32: index of the other node in a row, or -1
    first: np.ndarray  # (m + 1,) int64: range of a node's pairs


class Blocks(NamedTuple):
    pairs: Pairs
    values: np.ndarray


class Tangent(NamedTuple):
    """Stress derivatives of points from `first` to `end`."""

    first: int
    end: int
    values: np.ndarray  # (t t, c) V0 dP/dH, row by row
    done: np.ndarray  # (m,) int64 number of entries that are done, by node


class Response(NamedTuple):
    """Increments and stresses after trial displacements, each with t components."""

    increment: np.ndarray  # (t, n) H
    stress: np.ndarray  # (t, n) V0 P
    furthest: np.ndarray  # (PARTS,) largest displacement component


def row_of(pairs: Pairs, a: int, b: int) -> int:
    return pairs.first[a] + pairs.rank[a, pairs.middle + pairs.codes[b] - pairs.codes[a]]


def nothing_seen(s: Setup, block: Block) -> tuple[Seen, Response]:
    n, t = block.points.mass.size, s.kin.tensor_size
    count, width = support(s.basis, s.kin), len(s.kin.Gradient._fields)
    none = np.zeros(0, np.int64)
    seen = Seen(
        np.zeros(n, np.int32), np.zeros((n, count), np.int64), np.zeros((n, count)),
        np.zeros((n, count, width)), none, none,
    )  # fmt: skip
    rows = (rows_of_points((t, n), np.float64) for _ in range(2))
    return seen, Response(*rows, np.zeros(PARTS))


def points_of(count, k):
    groups = (count + GROUP - 1) // GROUP
    return min(GROUP * (groups * k // PARTS), count)


@by_threads
def see(frame, at, matter, seen, chunk):
    (basis, _, grids, of, where), seen = at_hand(at), at_hand(seen)
    kin, points, laws = at_hand(matter)
    for p in range(points_of(points.mass.size, chunk), points_of(points.mass.size, chunk + 1)):
        grid = record(grids, of[p])
        stencil = locate(basis, kin, grid, location_at(basis, kin, where, p))
        count = 0
        for k in range(support(basis, kin)):
            node, weight, slope = entry(basis, kin, grid, stencil, k)
            gives = weight != 0
            for g in slope:
                gives = gives | (g != 0)
            if gives:
                slot = count
                if isinstance(basis, AtCorners):  # corners may have common nodes
                    for other in range(count):
                        if seen.nodes[p, other] == node:
                            slot = other
                seen.nodes[p, slot] = node
                seen.weights[p, slot] += weight
                for j, g in enumerate(slope):
                    seen.gradients[p, slot, j] += g
                if slot == count:
                    count += 1
        seen.count[p] = count
        if not frame.moves:
            law, state = state_at(kin, points, laws, p)
            back = inv(deformation_of(frame, kin, points, (law, state), p)).at()
            for k in range(support(basis, kin)):
                g = [seen.gradients[p, k, j] for j in range(len(kin.Gradient._fields))]
                for j in range(len(g)):
                    pushed = 0.0
                    for i in range(len(g)):
                        within = (i, j) in back and (i < kin.dimension or i == j)
                        pushed += g[i] * back[i, j] if within else 0.0
                    seen.gradients[p, k, j] = pushed


def unknowns(kin, values, node):
    return kin.Unknown._make([values[node, i] for i in range(len(kin.Unknown._fields))])


def gradient_at(kin, seen, p, k):
    return gradient(kin, [seen.gradients[p, k, j] for j in range(len(kin.Gradient._fields))])


@by_threads
def strain(kin, seen, u, response, chunk):
    """Compute H of each point from displacements (m, d)."""
    seen, response = at_hand(seen), at_hand(response)
    count = seen.nodes.shape[0]
    most = 0.0
    for p in range(points_of(count, chunk), points_of(count, chunk + 1)):
        H = zero(kin, u[0, 0])
        shift = zero_vector(kin, u[0, 0])
        for k in range(seen.count[p]):
            node = seen.nodes[p, k]
            moved = unknowns(kin, u, node)
            H = H + gradient_of(kin, moved, gradient_at(kin, seen, p, k))
            moved = kin.Vector._make(moved[: kin.dimension])
            shift = shift + seen.weights[p, k] * moved
        store(response.increment, p, H)
        most = max(most, shift.largest())
    response.furthest[chunk] = most


def strained_point(matter, response, p):
    kin, points, laws = matter
    law, state = state_at(kin, points, laws, p)
    mass = points.mass[p]
    H = load(response.increment, p, zero(kin, mass))
    return law, state, H, mass * specific_volume(law)


# For rotation around an axis, H and its conjugate stress are linear in the nodal unknowns, but
# depend on the radius r of the point before the step.


@point_function(otherwise=True)
def radius_of(kin, points, p):
    return ()


@point_function(otherwise=True)
def gradient_of(kin, u, slopes):
    """Return the contribution to H of a node with unknowns `u`."""
    return outer(u, slopes)


@point_function(otherwise=True)
def increment_of(kin, H, r):
    return H


@point_function(otherwise=True)
def conjugate(kin, P, H, r):
    return P


@point_function(otherwise=True)
def add_force(kin, start, stress, slopes):
    return start + stress.dot(slopes)


class IncrementAt(NamedTuple):
    H: tuple
    r: object = ()


def nominal_stress(law, kin, state, trial, dt):
    """Return P per reference volume, relative to positions before the step."""
    H, r = trial
    dl = increment_of(kin, H, r)
    after = advance(law, kin, state, large(dl) if by_rates(law) else dl, dt)
    return conjugate(kin, kirchhoff_stress(law, kin, after).nominal(I + dl), H, r)


def stress_and_tangent(law, kin, state, trial, dt):
    P = nominal_stress(law, kin, state, IncrementAt(seeded(trial.H), trial.r), dt)
    return P._make([x.value for x in P]), tuple([slopes_of(x, len(trial.H)) for x in P])


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    stress_and_tangent = on_numbers(stress_and_tangent)


@by_threads
def respond(matter, dt, response, chunk):
    matter, response = at_hand(matter), at_hand(response)
    kin, points, laws = matter
    lanes = lanes_with((), laws, points.mass)
    end = points_of(points.mass.size, chunk + 1)
    for q in range(points_of(points.mass.size, chunk), end, lanes.width):
        p = points_from(lanes, q, end)
        law, state, H, volume = strained_point(matter, response, p)
        trial = IncrementAt(H, radius_of(kin, points, p))
        store(response.stress, p, volume * nominal_stress(law, kin, state, trial, dt))


@by_threads
def respond_to_changes(matter, dt, response, tangent, chunk):
    matter, response = at_hand(matter), at_hand(response)
    kin, points, laws = matter
    lanes = lanes_with((), laws, points.mass)
    first, count = tangent.first, tangent.end - tangent.first
    last = points_of(count, chunk + 1)
    for q in range(points_of(count, chunk), last, lanes.width):
        p = points_from(lanes, first + q, first + last)
        law, state, H, volume = strained_point(matter, response, p)
        trial = IncrementAt(H, radius_of(kin, points, p))
        _, slopes = stress_and_tangent(law, kin, state, trial, dt)
        columns = points_from(lanes, q, last)
        store(tangent.values, columns, tuple([volume * s for row in slopes for s in row]))


@kernel
def keep_stress(matter, stress):
    kin, points, laws = at_hand(matter)
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        tau = kirchhoff_stress(law, kin, state)
        none, r = zero(kin, points.mass[p]), radius_of(kin, points, p)
        P = conjugate(kin, tau.nominal(unit(kin)), none, r)
        store(stress, p, points.mass[p] * specific_volume(law) * P)


# Each node sums over its points in order; nodes are divided among threads.


@by_threads
def mark_pairs(seen, pairs, chunk):
    seen, pairs = at_hand(seen), at_hand(pairs)
    m, width = pairs.codes.size, seen.nodes.shape[1]
    for a in range(m * chunk // PARTS, m * (chunk + 1) // PARTS):
        for e in range(seen.starts[a], seen.starts[a + 1]):
            p = seen.entries[e] // width
            for k in range(seen.count[p]):
                pairs.rank[a, pairs.middle + pairs.codes[seen.nodes[p, k]] - pairs.codes[a]] = 0


@by_threads
def add_forces(kin, seen, stress, f, chunk):
    """Add V0 P grad N of stresses (t, n) to nodal forces (m, d)."""
    seen = at_hand(seen)
    m, width = f.shape[0], seen.nodes.shape[1]
    for a in range(m * chunk // PARTS, m * (chunk + 1) // PARTS):
        total = unknowns(kin, f, a)
        for e in range(seen.starts[a], seen.starts[a + 1]):
            p, k = seen.entries[e] // width, seen.entries[e] % width
            of_point = load(stress, p, zero(kin, f[0, 0]))
            total = add_force(kin, total, of_point, gradient_at(kin, seen, p, k))
        for i, force in enumerate(total):
            f[a, i] = force


def along(kin, i):
    """Return index and column of the tensor components that act on an unknown.

    The hoop component acts on the radial unknown.
    """
    d, places = kin.dimension, kin.Tensor.places
    return [
        (c, column) for c, (row, column) in enumerate(places)
        if (column < d or row == column) and i == (0 if row == column >= d else row)
    ]  # fmt: skip


def by_gradient(kin, h, C):
    """Return df/dH (d t) of a node with gradient h, from dP/dH (t t)."""
    d, t = len(kin.Unknown._fields), kin.tensor_size
    return tuple(
        [
            total([h[column] * C[c * t + b] for c, column in along(kin, i)])
            for i in range(d)
            for b in range(t)
        ]
    )


def by_displacement(kin, D, g):
    """Return df/du (d d) from df/dH (d t), for f at one node, and u at one with gradient g."""
    d, t = len(kin.Unknown._fields), kin.tensor_size
    return tuple(
        [
            total([D[i * t + b] * g[column] for b, column in along(kin, j)])
            for i in range(d)
            for j in range(d)
        ]
    )


@by_threads
def add_stiffness(kin, seen, tangent, blocks, chunk):
    """Add derivatives of the points' forces to blocks K (b, d d)."""
    seen, (pairs, K) = at_hand(seen), at_hand(blocks)
    first, end, values, done = tangent
    t = kin.tensor_size
    m, width = pairs.codes.size, seen.nodes.shape[1]
    for a in range(m * chunk // PARTS, m * (chunk + 1) // PARTS):
        e = seen.starts[a] + done[a]
        while e < seen.starts[a + 1] and seen.entries[e] < end * width:
            p, k = seen.entries[e] // width, seen.entries[e] % width
            C = tuple([values[c, p - first] for c in range(t * t)])
            D = by_gradient(kin, gradient_at(kin, seen, p, k), C)
            for other in range(seen.count[p]):
                at = row_of(pairs, a, seen.nodes[p, other])
                made = by_displacement(kin, D, gradient_at(kin, seen, p, other))
                for c, x in enumerate(made):
                    K[at, c] += x
            e += 1
        done[a] = e - seen.starts[a]


@kernel
def add_conductance(kin, seen, conductance, pairs, C):
    """Add point conductances (1, n) times grad N_a grad N_b to pairs of nodes."""
    for a in range(pairs.codes.size):
        for e in range(seen.starts[a], seen.starts[a + 1]):
            p, k = seen.entries[e] // seen.nodes.shape[1], seen.entries[e] % seen.nodes.shape[1]
            g = gradient_at(kin, seen, p, k).planar()
            for other in range(seen.count[p]):
                h = gradient_at(kin, seen, p, other).planar()
                along = total([x * y for x, y in zip(g, h, strict=True)])
                C[row_of(pairs, a, seen.nodes[p, other])] += conductance[0, p] * along


@kernel
def gather(seen, nodes, values):
    """Add nodal values (m, d) to points (d, n)."""
    for p in range(seen.nodes.shape[0]):
        for k in range(seen.count[p]):
            for i in range(nodes.shape[1]):
                values[i, p] += seen.weights[p, k] * nodes[seen.nodes[p, k], i]
