"""One step of the material point method as on a board: MUSL, FLIP, neo-Hookean, in NumPy.

Nothing here is shared with karamelo-py, whose steps the tests compare with this one.
"""

from typing import NamedTuple

import numpy as np


class Body(NamedTuple):
    """n points in d directions."""

    x: np.ndarray  # (n, d) places
    v: np.ndarray  # (n, d) velocities
    F: np.ndarray  # (n, d, d) deformation gradients
    m: np.ndarray  # (n,) masses
    V: np.ndarray  # (n,) volumes of the reference
    lam: float  # Lame's first parameter
    G: float  # shear modulus


def linear(r):
    """Hat and slope at a distance of r cells from its node."""
    near = np.abs(r) < 1
    return np.where(near, 1 - np.abs(r), 0), np.where(near, -np.sign(r), 0)


def quadratic(r):
    """Quadratic B-spline and slope (Steffen et al. 2008), away from walls."""
    a = np.abs(r)
    parts = [a < 1 / 2, a < 3 / 2]
    value = np.select(parts, [3 / 4 - a**2, (3 / 2 - a) ** 2 / 2], 0)
    return value, np.select(parts, [-2 * r, -(3 / 2 - a) * np.sign(r)], 0)


def stress(body):
    """Cauchy stress [G (F F^T - 1) + lam ln J 1] / J of each point, and J = det F."""
    J, one = np.linalg.det(body.F), np.eye(body.x.shape[1])
    B = body.F @ body.F.transpose(0, 2, 1)
    kirchhoff = body.G * (B - one) + body.lam * np.log(J)[:, None, None] * one
    return kirchhoff / J[:, None, None], J


def step(body, nodes, h, dt, basis=linear, share=1.0):
    """The body after dt. `nodes` (k, d) are places of nodes; `share` is that of FLIP."""
    x, v, F, m, V, *_ = body
    # Weights N (n, k) and gradients dN (n, k, d): products over the directions.
    value, slope = basis((x[:, None, :] - nodes) / h)
    N, d = value.prod(axis=2), x.shape[1]
    dN = np.stack([np.where(np.arange(d) == i, slope / h, value).prod(2) for i in range(d)], 2)

    # Points to grid: mass, momentum, internal force -sum V sigma grad N.
    sigma, J = stress(body)
    mass = N.T @ m
    divide = np.where(mass > 0, mass, np.inf)[:, None]  # no velocity where there is no mass
    old = N.T @ (m[:, None] * v) / divide
    force = -np.einsum("p,pij,pkj->ki", V * J, sigma, dN)

    # On the grid, and back to the points.
    new = old + dt * force / divide
    v = share * (v + N @ (new - old)) + (1 - share) * N @ new
    x = x + dt * N @ new

    # MUSL: the momentum of the points to the grid again, and the strain from its velocity.
    again = N.T @ (m[:, None] * v) / divide
    L = np.einsum("ki,pkj->pij", again, dN)
    return body._replace(x=x, v=v, F=(np.eye(d) + dt * L) @ F)


def vibrating_bar(cells=20, periods=2.0):
    """First mode of a free bar of length 1 in 1D: times, and the share of the mode in v."""
    h, c = 1 / cells, 10.0
    x = (np.arange(2 * cells) + 1 / 2) * h / 2
    mode = np.cos(np.pi * x)
    one = np.ones(2 * cells)
    # lam + 2 G = rho c^2 with rho = 1
    body = Body(
        x[:, None], 1e-3 * mode[:, None], one[:, None, None], one * h / 2, one * h / 2, c**2, 0
    )
    nodes, dt = h * np.arange(-2, cells + 3)[:, None], h / c / 4
    times, shares = dt * np.arange(int(periods * 2 / c / dt) + 1), []
    for _ in times:
        shares.append(body.v[:, 0] @ mode / (1e-3 * mode @ mode))
        body = step(body, nodes, h, dt)
    return times, np.array(shares)
