"""The stable step of bodies in the total frame, as limited by nodes with little mass.

Edge nodes may have more stiffness per unit mass than inner ones. FLIP damps their motion by
averaging; transfers with moments or velocity gradients do not. The step is stable below 2 / w,
where w^2 is the largest eigenvalue of M^-1 K with lumped masses.
"""

from collections.abc import Callable
from itertools import product
from math import floor, inf, sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import Tag
from karamelo_py.kernels.laws import law_on
from karamelo_py.points.basis.product import along
from karamelo_py.points.laws import (
    initial_state,
    parameter,
    specific_volume,
    wave_speed_squared,
)
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid

LIGHT_FRACTION = 0.9  # fraction of an inner node's mass
MOST_PAIRS = 100_000  # number of point-node pairs up to which all nodes are used
LANCZOS_STEPS = 24  # enough for the highest frequency within 1 %


class _Line(NamedTuple):
    first: np.ndarray  # (n,) first node of the stencil
    weights: np.ndarray  # (n, m) weights of the nodes
    slopes: np.ndarray  # (n, m) gradients of the weights


def stable_courant(hub: Hub, grids: NamedTuple) -> float:
    """Return the stable step / (h/c) for the nodes of all solids; inf if it is unknown.

    The result is rounded down to four digits, so that the order of sums cannot change it.
    """
    if not along.defined(type(hub.update.method.basis)):
        return inf
    solids = [s for s in hub.solids.values() if not s.rigid]
    limits = [_stable_courant(hub, solid, grids) for solid in solids if solid.count]
    least = min(limits, default=inf)
    return floor(1e4 * least) / 1e4 if least < inf else inf


def _stable_courant(hub: Hub, solid: Solid, grids: NamedTuple) -> float:
    method, volume = hub.update.method, solid.volume0
    kin = method.kinematics(hub)
    places = method.places(kin, solid, float)
    grid = record(grids, method.lattice_of(hub, solid))
    lines = [_line(method.basis, kin, grid, places, k) for k in range(kin.dimension)]
    sizes = [int(line.first.max()) + line.weights.shape[1] for line in lines]
    count, pairs = int(np.prod(sizes)), list(product(*(range(o.weights.shape[1]) for o in lines)))

    def nodes(steps: tuple[int, ...]) -> np.ndarray:
        at = [line.first + j for line, j in zip(lines, steps, strict=True)]
        return np.ravel_multi_index(at, sizes)

    def weight(steps: tuple[int, ...], slope: int = -1) -> np.ndarray:
        factors = [
            (one.slopes if k == slope else one.weights)[:, j]
            for k, (one, j) in enumerate(zip(lines, steps, strict=True))
        ]
        return np.prod(factors, axis=0)

    radius = places[:, 0] if kin.hoops else None
    area = volume if radius is None else volume / radius**kin.hoops
    none = np.zeros(count)
    filled = sum((np.bincount(nodes(k), area * weight(k), count) for k in pairs), none)
    limit = LIGHT_FRACTION * filled.max()
    while True:
        seen = (filled > 0) & (filled < limit)
        for _ in range(2):  # points of light nodes, then points with a node of these
            near = np.any([seen[nodes(k)] for k in pairs], axis=0)
            seen = np.zeros(count, bool)
            for k in pairs:
                seen[nodes(k)[near]] = True
        if near.sum() * len(pairs) <= MOST_PAIRS or limit < 0.01 * filled.max():
            break
        limit *= 0.7
    if not near.any():
        return inf
    mass = filled
    if radius is not None:
        mass = sum((np.bincount(nodes(k), volume * weight(k), count) for k in pairs), none)
    number = np.cumsum(seen) - 1
    at = np.stack([number[nodes(k)[near]] for k in pairs], axis=1)
    slopes = [np.stack([weight(k, i)[near] for k in pairs], 1) for i in range(kin.dimension)]
    hoop = None
    if radius is not None:
        hoop = np.stack([weight(k)[near] / radius[near] for k in pairs], 1)
    shear = _shear_fraction(law_on(solid.material.whole, solid.h, solid.T0), kin)
    root = np.sqrt(mass[seen])
    root[root == 0] = inf

    def stiffness(u: np.ndarray) -> np.ndarray:
        """Return M^-1/2 K M^-1/2 u (nodes, d), in units of c^2."""
        u_of_points = (u / root[:, None])[at]
        gradient = np.stack([(u_of_points * g[:, :, None]).sum(axis=1) for g in slopes], axis=2)
        trace = np.trace(gradient, axis1=1, axis2=2)
        hoop_strain = 0.0 if hoop is None else (u_of_points[:, :, 0] * hoop).sum(axis=1)
        pressure = (1 - 2 * shear) * (trace + kin.hoops * hoop_strain)
        stress = shear * (gradient + gradient.transpose(0, 2, 1))
        stress += pressure[:, None, None] * np.eye(kin.dimension)
        stress *= volume[near][:, None, None]
        force = sum(g[:, :, None] * stress[:, None, :, i] for i, g in enumerate(slopes))
        if hoop is not None:
            hoop_stress = kin.hoops * (pressure + 2 * shear * hoop_strain)
            force[:, :, 0] += hoop * (volume[near] * hoop_stress)[:, None]
        columns = [np.bincount(at.ravel(), f.ravel(), len(root)) for f in np.moveaxis(force, 2, 0)]
        return np.stack(columns, axis=1) / root[:, None]

    return 2 / (sqrt(_largest(stiffness, (len(root), kin.dimension))) * solid.h)


def _line(basis: Tag, kin: Tag, grid: Tag, places: np.ndarray, direction: int) -> _Line:
    d = kin.dimension
    coordinates = places[:, direction::d] if places.shape[1] > d else places[:, direction, None]
    _, first, back = np.unique(coordinates, axis=0, return_index=True, return_inverse=True)
    lines = [along(basis, kin, grid, tuple(mark), direction) for mark in places[first]]
    back = back.ravel()
    return _Line(
        np.array([int(one.first) for one in lines])[back],
        np.array([one.weights for one in lines], float)[back],
        np.array([one.gradients for one in lines], float)[back],
    )


def _shear_fraction(law: Tag, kin: Tag) -> float:
    """Return shear modulus / P-wave modulus, at most 1/2 (Poisson's ratio 0)."""
    strength = parameter(law, "strength", None)
    G = parameter(law, "G", None) or (shear_modulus(strength) if strength else inf)
    stiffness = wave_speed_squared(law, kin, initial_state(law, kin, 1.0)) / specific_volume(law)
    return min(float(G / stiffness), 0.5)


def _largest(operator: Callable[[np.ndarray], np.ndarray], shape: tuple[int, int]) -> float:
    """Return the largest eigenvalue of a symmetric operator, by Lanczos iteration (1950)."""
    q = np.random.default_rng(0).standard_normal(shape)
    q /= sqrt((q * q).sum())
    basis, diagonal, off_diagonal = [q], [], []
    for _ in range(min(LANCZOS_STEPS, q.size)):
        r = operator(basis[-1])
        diagonal.append(float((r * basis[-1]).sum()))
        for _ in range(2):
            for one in basis:
                r = r - (r * one).sum() * one
        size = sqrt((r * r).sum())
        if not size > 1e-9 * diagonal[0]:
            break
        off_diagonal.append(size)
        basis.append(r / size)
    n = len(diagonal)
    off = off_diagonal[: n - 1]
    matrix = np.diag(diagonal) + np.diag(off, 1) + np.diag(off, -1)
    return float(np.linalg.eigvalsh(matrix)[-1])
