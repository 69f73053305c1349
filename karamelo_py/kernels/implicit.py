"""Implicit steps: nodal forces of points after trial displacements, and their derivatives.

Weights and gradients are those of the beginning of a step, and stay what they are while Newton's
method goes on. With H = sum_I u_I (x) grad N_I of the trial displacements, the nominal stress
P(H) = tau(H) (I + H)^-T gives the forces V0 P grad N. Its derivatives dP/dH
(:mod:`karamelo_py.compiler.slopes`) give the whole stiffness V0 grad N dP/dH grad N: geometry, and
all that a law does while it yields (Charlton, Coombs & Augarde 2017 keep gradients in the same
way).
"""

from typing import NamedTuple

import numpy as np
from numba import config

from karamelo_py.compiler.algebra import on_numbers
from karamelo_py.compiler.compile import index, shared
from karamelo_py.compiler.fields import load, rows_of_points, store
from karamelo_py.compiler.held import at_hand
from karamelo_py.compiler.loops import kernel
from karamelo_py.compiler.slopes import seeded, slopes_of
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import Block, Setup
from karamelo_py.kernels.lanes import lanes_with, points_from
from karamelo_py.kernels.sweep import places_of
from karamelo_py.kernels.visit import deformation_of, place_at
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.kinematics import I, gradient, inv, outer, total, unit, vector, zero
from karamelo_py.points.laws import advance, initial_state, kirchhoff_stress, specific_volume


class Seen(NamedTuple):
    """Nodes that the points of a block see: the k-th of each."""

    nodes: np.ndarray  # (n, s) int64: numbers among the unknown nodes
    offsets: np.ndarray  # (n, s) int64: places in the grid, by which pairs of nodes are found
    weights: np.ndarray  # (n, s)
    gradients: np.ndarray  # (n, s, c) in the places before the step


class Response(NamedTuple):
    """Stress and tangent of points after trial displacements; t components of a tensor."""

    increment: np.ndarray  # (t, n) H
    stress: np.ndarray  # (t, n) V0 P
    tangent: np.ndarray  # (t t, n) V0 dP/dH, a row of P after another


def nothing_seen(s: Setup, block: Block) -> tuple[Seen, Response]:
    """Make the arrays of the points of a block."""
    n, t = block.points.mass.size, s.kin.tensor_size
    count, width = support(s.basis, s.kin), len(s.kin.Gradient._fields)
    seen = Seen(
        np.zeros((n, count), np.int64),
        np.zeros((n, count), np.int64),
        np.zeros((n, count)),
        np.zeros((n, count, width)),
    )
    rows = (rows_of_points((k, n), np.float64) for k in (t, t, t * t))
    return seen, Response(*rows)


@kernel
def see(frame, kin, basis, grids, points, laws, now, seen):
    """Find the nodes that points see, with weights and gradients in the present places."""
    points, laws = at_hand(points), at_hand(laws)
    where = places_of(frame, points, now, 1 - now).where
    for p in range(points.mass.size):
        grid = record(grids, points.grid[p])
        stencil = locate(basis, kin, grid, place_at(basis, kin, where, p))
        for k in range(support(basis, kin)):
            node, weight, slope = entry(basis, kin, grid, stencil, k)
            seen.nodes[p, k] = node
            seen.weights[p, k] = weight
            for j, g in enumerate(slope):
                seen.gradients[p, k, j] = g
        if not frame.moves:
            law = record(laws, index(points.material[p]))
            state = load(points.state, p, initial_state(law, kin, points.mass[p]))
            back = inv(deformation_of(frame, kin, law, state, points, p)).at()
            for k in range(support(basis, kin)):
                g = [seen.gradients[p, k, j] for j in range(len(kin.Gradient._fields))]
                for j in range(len(g)):
                    pushed = 0.0
                    for i in range(len(g)):
                        pushed += g[i] * back[i, j] if (i, j) in back else 0.0
                    seen.gradients[p, k, j] = pushed


@shared
def gradient_at(kin, seen, p, k):
    """Load the gradient of the k-th node of a point."""
    return gradient(kin, [seen.gradients[p, k, j] for j in range(len(kin.Gradient._fields))])


@kernel
def strain(kin, seen, u, increment):
    """H of each point, from displacements (nodes, d)."""
    for p in range(seen.nodes.shape[0]):
        total = zero(kin, u[0, 0])
        for k in range(seen.nodes.shape[1]):
            node = seen.nodes[p, k]
            moved = vector(kin, [u[node, i] for i in range(kin.dimension)])
            total = total + outer(moved, gradient_at(kin, seen, p, k))
        store(increment, p, total)


@shared
def nominal_stress(law, kin, state, H, dt):
    """P by the places before the step, per reference volume."""
    after = advance(law, kin, state, H, dt)
    return kirchhoff_stress(law, kin, after).nominal(I + H)


@shared
def stress_and_tangent(law, kin, state, H, dt):
    """P and dP/dH."""
    P = nominal_stress(law, kin, state, seeded(H), dt)
    return P._make([x.value for x in P]), tuple([slopes_of(x, len(H)) for x in P])


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    stress_and_tangent = on_numbers(stress_and_tangent)


@kernel
def respond(kin, points, laws, dt, response):
    """Stress and tangent of each point after its increment."""
    points, laws = at_hand(points), at_hand(laws)
    lanes = lanes_with((), laws, points.mass)
    count = points.mass.size
    for q in range(0, count, lanes.width):
        p = points_from(lanes, q, count)
        law = record(laws, index(points.material[p]))
        mass = points.mass[p]
        state = load(points.state, p, initial_state(law, kin, mass))
        H = load(response.increment, p, zero(kin, mass))
        volume = mass * specific_volume(law)
        P, slopes = stress_and_tangent(law, kin, state, H, dt)
        store(response.stress, p, volume * P)
        store(response.tangent, p, tuple([volume * s for row in slopes for s in row]))


@kernel
def keep_stress(kin, points, laws, stress):
    """V0 P of the present state: no place has changed yet."""
    points, laws = at_hand(points), at_hand(laws)
    for p in range(points.mass.size):
        law = record(laws, index(points.material[p]))
        mass = points.mass[p]
        state = load(points.state, p, initial_state(law, kin, mass))
        tau = kirchhoff_stress(law, kin, state)
        store(stress, p, mass * specific_volume(law) * tau.nominal(unit(kin)))


@kernel
def add_forces(kin, seen, stress, f):
    """Add what stresses (t, n) make of forces (nodes, d): V0 P grad N."""
    for p in range(seen.nodes.shape[0]):
        P = load(stress, p, zero(kin, f[0, 0]))
        for k in range(seen.nodes.shape[1]):
            node = seen.nodes[p, k]
            for i, force in enumerate(P.dot(gradient_at(kin, seen, p, k))):
                f[node, i] += force


@shared
def along(kin, row):
    """Find the direction that a row of a tensor acts along: around an axis that is the radius."""
    return row if row < kin.dimension else 0


@shared
def by_displacement(kin, C, g):
    """dP/du (t d) of a node with gradient g, from dP/dH (t t)."""
    d, places = kin.dimension, kin.Tensor.places
    t = len(places)
    return tuple(
        [
            total(
                [C[c * t + b] * g[places[b][1]] for b in range(t) if along(kin, places[b][0]) == j]
            )
            for c in range(t)
            for j in range(d)
        ]
    )


@shared
def of_force(kin, h, T):
    """df/du (d d) of a node with gradient h, from dP/du of another."""
    d, places = kin.dimension, kin.Tensor.places
    return tuple(
        [
            total(
                [
                    h[column] * T[c * d + j]
                    for c, (row, column) in enumerate(places)
                    if along(kin, row) == i
                ]
            )
            for i in range(d)
            for j in range(d)
        ]
    )


@kernel
def add_stiffness(kin, seen, tangent, middle, K):
    """Add derivatives of the forces of points to K[node, place of the other, i d + j].

    `middle` is the place of a node beside itself: that of a pair is the difference of the offsets.
    """
    t = kin.tensor_size
    for p in range(seen.nodes.shape[0]):
        C = tuple([tangent[c, p] for c in range(t * t)])
        for m in range(seen.nodes.shape[1]):
            T = by_displacement(kin, C, gradient_at(kin, seen, p, m))
            for k in range(seen.nodes.shape[1]):
                node = seen.nodes[p, k]
                place = middle + seen.offsets[p, m] - seen.offsets[p, k]
                for c, x in enumerate(of_force(kin, gradient_at(kin, seen, p, k), T)):
                    K[node, place, c] += x


@kernel
def mark_pairs(seen, middle, used):
    """Mark which places of K get something."""
    for p in range(seen.nodes.shape[0]):
        for k in range(seen.nodes.shape[1]):
            for m in range(seen.nodes.shape[1]):
                place = middle + seen.offsets[p, m] - seen.offsets[p, k]
                used[seen.nodes[p, k], place] = 1


@kernel
def furthest(kin, seen, u):
    """The largest component of the displacement of any point."""
    most = 0.0
    for p in range(seen.nodes.shape[0]):
        total = vector(kin, [0.0 for _ in range(kin.dimension)])
        for k in range(seen.nodes.shape[1]):
            node = seen.nodes[p, k]
            total = total + seen.weights[p, k] * vector(
                kin, [u[node, i] for i in range(kin.dimension)]
            )
        most = max(most, total.largest())
    return most


@kernel
def scatter(seen, mass, values, nodes):
    """Add mass times values (d, n) of points to nodes (m, d)."""
    for p in range(seen.nodes.shape[0]):
        for k in range(seen.nodes.shape[1]):
            share = mass[p] * seen.weights[p, k]
            for i in range(nodes.shape[1]):
                nodes[seen.nodes[p, k], i] += share * values[i, p]


@kernel
def gather(seen, nodes, values):
    """Add values of nodes (m, d) to points (d, n)."""
    for p in range(seen.nodes.shape[0]):
        for k in range(seen.nodes.shape[1]):
            for i in range(nodes.shape[1]):
                values[i, p] += seen.weights[p, k] * nodes[seen.nodes[p, k], i]
