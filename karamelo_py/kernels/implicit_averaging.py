"""F-bar in implicit steps, and its derivatives, which couple more nodes.

With A = I + H and J = det A, the law gets s A, where s = (r / J)^(1/k) in k directions and

    r_p = sum_i N_ip R_i,    R_i = sum_q N_iq V_q J_q / sum_q N_iq V_q.

The energy e(A, r) of a point has the derivatives P = de/dA = V0 (tau - p I) A^-T and q = de/dr = V0
p / r, where p is the mean of tau along these directions. Nodal forces are P grad N, plus V J A^-T
grad N times the average of q. With S = dR/du, their derivatives

    K + X^T S + S^T Y + S^T Z S

are sums over points and products of nodal matrices, where X contains dP/dr, Y dq/dA and Z dq/dr.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import config

from karamelo_py.compiler import at_hand, kernel, on_numbers
from karamelo_py.compiler.fields import load, rows_of_points, store
from karamelo_py.compiler.slopes import seeded, slopes_of, value_of
from karamelo_py.compiler.threads import by_threads
from karamelo_py.kernels.arrays import Block
from karamelo_py.kernels.implicit import (
    PARTS,
    IncrementAt,
    add_force,
    conjugate,
    gradient_at,
    increment_of,
    points_of,
    radius_of,
    row_of,
    strained_point,
)
from karamelo_py.kernels.lanes import lanes_with, points_from
from karamelo_py.kernels.views import state_at
from karamelo_py.points.frames import Updated, scaled_increment
from karamelo_py.points.kinematics import I, det, inv, tensor, zero
from karamelo_py.points.laws import advance, jacobian, kirchhoff_stress, specific_volume


class Averages(NamedTuple):
    """Averages at the n points of a block; tensors have t components."""

    volume: np.ndarray  # (1, n) V
    grown: np.ndarray  # (1, n) V J
    cofactors: np.ndarray  # (t, n) V J A^-T
    ratio: np.ndarray  # (1, n) r
    pressure: np.ndarray  # (1, n) q
    mean: np.ndarray  # (1, n) average of q
    tangent: np.ndarray  # (t t, n) dP/dA, row by row
    by_ratio: np.ndarray  # (t, n) dP/dr
    of_pressure: np.ndarray  # (t, n) dq/dA
    stiffness: np.ndarray  # (1, n) dq/dr


def nothing_averaged(kin: Any, block: Block) -> Averages:
    n, t = block.points.mass.size, kin.tensor_size
    return Averages(
        *(rows_of_points((k, n), np.float64) for k in (1, 1, t, 1, 1, 1, t * t, t, t, 1))
    )


def cofactors(A):
    """Return J A^-T, the derivatives of J."""
    return det(A) * inv(A).transposed()


@by_threads
def grow(matter, response, averages, chunk):
    """Compute volumes before and after the increment, and their derivatives."""
    matter, response, averages = at_hand(matter), at_hand(response), at_hand(averages)
    kin, points, _ = matter
    for p in range(points_of(points.mass.size, chunk), points_of(points.mass.size, chunk + 1)):
        law, state, H, volume = strained_point(matter, response, p)
        A, volume = I + H, volume * jacobian(law, kin, state)
        averages.volume[0, p] = volume
        averages.grown[0, p] = volume * det(A)
        store(averages.cofactors, p, volume * cofactors(A))


def averaged_stress(law, kin, state, change, dt):
    """Return P and q per reference volume after an increment H with averaged volume ratio."""
    (H, r), ratio = change
    strain = increment_of(kin, H, r)
    A = I + strain
    dl = scaled_increment(Updated(), kin, strain, (), ratio / det(A))
    tau = kirchhoff_stress(law, kin, advance(law, kin, state, dl, dt))
    p = tau.mean_of_stretching()
    return conjugate(kin, (tau - p * I).nominal(A), H, r), p / ratio


if config.DISABLE_JIT:  # type: ignore[attr-defined]
    averaged_stress = on_numbers(averaged_stress)


@by_threads
def respond_averaged(matter, dt, response, averages, chunk):
    matter, response, averages = at_hand(matter), at_hand(response), at_hand(averages)
    kin, points, laws = matter
    lanes = lanes_with((), laws, points.mass)
    end = points_of(points.mass.size, chunk + 1)
    t = kin.tensor_size
    for q in range(points_of(points.mass.size, chunk), end, lanes.width):
        p = points_from(lanes, q, end)
        law, state, H, volume = strained_point(matter, response, p)
        (ratio,) = load(averages.ratio, p, (volume,))
        *by_H, by_ratio = seeded((*H, ratio))
        trial = IncrementAt(tensor(kin, by_H), radius_of(kin, points, p))
        P, pressure = averaged_stress(law, kin, state, (trial, by_ratio), dt)
        slopes = [slopes_of(x, t + 1) for x in P]
        store(response.stress, p, volume * value_of(P))
        store(averages.tangent, p, tuple([volume * s for row in slopes for s in row[:t]]))
        store(averages.by_ratio, p, tuple([volume * row[t] for row in slopes]))
        of_pressure = slopes_of(pressure, t + 1)
        store(averages.pressure, p, (volume * value_of(pressure),))
        store(averages.of_pressure, p, tuple([volume * s for s in of_pressure[:t]]))
        store(averages.stiffness, p, (volume * of_pressure[t],))


@kernel
def keep_averaged_stress(matter, response, averages):
    kin, points, laws = at_hand(matter)
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        tau = kirchhoff_stress(law, kin, state)
        mean = tau.mean_of_stretching()
        volume = points.mass[p] * specific_volume(law)
        none = zero(kin, volume)
        store(response.increment, p, none)
        P = (tau - mean * I).nominal(I + none)
        store(response.stress, p, volume * conjugate(kin, P, none, radius_of(kin, points, p)))
        averages.pressure[0, p] = volume * mean


@by_threads
def bring_mean(kin, response, averages, chunk):
    """Add the terms of the averaged q to P and its derivatives."""
    response, averages = at_hand(response), at_hand(averages)
    count = averages.mean.shape[1]
    for p in range(points_of(count, chunk), points_of(count, chunk + 1)):
        q = averages.mean[0, p]
        H = load(response.increment, p, zero(kin, q))
        made = cofactors(I + seeded(H))
        scale = q * averages.volume[0, p]
        t = kin.tensor_size
        for c, x in enumerate(made):
            response.stress[c, p] += scale * value_of(x)
            for b, slope in enumerate(slopes_of(x, t)):
                averages.tangent[c * t + b, p] += scale * slope


@by_threads
def add_slopes(kin, seen, tensors, blocks, chunk):
    """Add N_a T grad N_b of point tensors T (t, n) to pairs of nodes, d numbers each."""
    seen, (pairs, out) = at_hand(seen), at_hand(blocks)
    d = len(kin.Unknown._fields)
    m, width = pairs.codes.size, seen.nodes.shape[1]
    for a in range(m * chunk // PARTS, m * (chunk + 1) // PARTS):
        for e in range(seen.starts[a], seen.starts[a + 1]):
            p, k = seen.entries[e] // width, seen.entries[e] % width
            weight = seen.weights[p, k]
            T = load(tensors, p, zero(kin, weight))
            for other in range(seen.count[p]):
                at = d * row_of(pairs, a, seen.nodes[p, other])
                none = kin.Unknown._make([weight - weight] * d)
                made = add_force(kin, none, T, gradient_at(kin, seen, p, other))
                for j, x in enumerate(made):
                    out[at + j] += weight * x


@by_threads
def add_products(seen, values, blocks, chunk):
    """Add N_a N_b times point values (1, n) to pairs of nodes."""
    seen, (pairs, out) = at_hand(seen), at_hand(blocks)
    m, width = pairs.codes.size, seen.nodes.shape[1]
    for a in range(m * chunk // PARTS, m * (chunk + 1) // PARTS):
        for e in range(seen.starts[a], seen.starts[a + 1]):
            p, k = seen.entries[e] // width, seen.entries[e] % width
            scale = seen.weights[p, k] * values[0, p]
            for other in range(seen.count[p]):
                out[row_of(pairs, a, seen.nodes[p, other])] += scale * seen.weights[p, other]
