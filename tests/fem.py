"""A small finite element program: an independent witness where no exact solution is known.

Total Lagrangian bricks (quadrilaterals in plane strain) with full integration, the neo-Hookean law
of comparisons/exact.py, lumped masses, explicit central differences. It shares no code with the
package.
"""

from collections.abc import Callable
from itertools import product

import numpy as np

from comparisons.exact import first_piola_kirchhoff, lame


def falling(
    cells: tuple[int, ...],
    size: tuple[float, ...],
    held: Callable[[np.ndarray], np.ndarray],
    watched: tuple[float, ...],
    gravity: tuple[float, ...],
    duration: float,
    E: float = 1e6,
    nu: float = 0.3,
    rho: float = 1050,
    courant: float = 0.3,
) -> tuple[np.ndarray, np.ndarray]:
    """Times and displacements (n, d) of the node nearest to `watched`; gravity acts at once.

    `held` tells from reference positions (n, d) which nodes are clamped.
    """
    d = len(cells)
    lam, mu = lame(E, nu)
    h = np.array(size) / cells
    nodes = tuple(n + 1 for n in cells)
    axes = [np.linspace(0, size[k], nodes[k]) for k in range(d)]
    X = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    corners = np.array(list(product((0, 1), repeat=d)))
    first = np.array(list(product(*(range(n) for n in cells))))
    elements = np.ravel_multi_index(
        tuple(np.moveaxis(first[:, None] + corners[None], -1, 0)), nodes
    )

    points = (np.array(list(product((-1, 1), repeat=d))) / np.sqrt(3) + 1) / 2
    hats = np.where(corners == 1, points[:, None], 1 - points[:, None])
    gradients = np.empty((len(points), len(corners), d))
    for k in range(d):
        others = [j for j in range(d) if j != k]
        sign = np.where(corners[:, k] == 1, 1, -1)
        gradients[..., k] = sign * hats[..., others].prod(-1) / h[k]
    weight = h.prod() / len(points)
    mass = np.zeros(len(X))
    np.add.at(mass, elements, rho * h.prod() / len(corners))

    u, v = np.zeros_like(X), np.zeros_like(X)
    clamped = held(X)
    node = int(np.argmin(((X - watched) ** 2).sum(-1)))
    dt = courant * h.min() / np.sqrt((lam + 2 * mu) / rho)
    steps = int(np.ceil(duration / dt))
    history = np.zeros((steps + 1, d))
    for step in range(steps):
        F = np.eye(d) + np.einsum("eai,qaj->eqij", u[elements], gradients, optimize=True)
        P = first_piola_kirchhoff(F, lam, mu)
        forces = np.zeros_like(X)
        pull = np.einsum("eqij,qaj->eai", P, gradients, optimize=True)
        np.add.at(forces, elements, -weight * pull)
        # The first kick is half a step, so that v lies between the positions.
        v += (dt / 2 if step == 0 else dt) * (forces / mass[:, None] + gravity)
        v[clamped] = 0
        u += dt * v
        history[step + 1] = u[node]
    return dt * np.arange(steps + 1), history


def cantilever(elements_high: int = 8, duration: float = 3.0):
    """Time and vertical displacement of the lower corner of the 2D cantilever of in.cantilever."""
    time, u = falling(
        (4 * elements_high, elements_high),
        (4, 1),
        lambda X: X[:, 0] < 1e-9,
        (4, 0),
        (0, -10),
        duration,
    )
    return time, u[:, 1]


def vertical_bar(elements: int = 8, duration: float = 0.2):
    """Time and vertical displacement of a lower corner of the cube of in.vertical_bar."""
    time, u = falling(
        (elements,) * 3,
        (1, 1, 1),
        lambda X: X[:, 2] > 1 - 1e-9,
        (0, 0, 0),
        (0, 0, -1000),
        duration,
    )
    return time, u[:, 2]
