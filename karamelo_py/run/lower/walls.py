"""Held nodes, and cell faces whose nodes are all held."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import Setup
from karamelo_py.kernels.equations.corrected_acceleration import (
    HELD,
    LOWER,
    UPPER,
    Sides,
)
from karamelo_py.points.basis import walled
from karamelo_py.points.basis.splines import ABOVE, BELOW
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.modify import Fix


def with_walls(fixes: list[Fix], lattices: list[Lattice], basis: NamedTuple) -> NamedTuple:
    walls = []
    for axis in sorted({axis for fix in fixes for axis in fix.held_directions}):
        nodes = np.unique(np.concatenate([f.nodes for f in fixes if axis in f.held_directions]))
        for lattice in lattices:
            ends = lattice.first, lattice.first + lattice.node_count
            nodes_of_lattice = nodes[slice(*np.searchsorted(nodes, ends))]
            if len(nodes_of_lattice):
                walls += [(lattice, *wall) for wall in _walls(lattice, nodes_of_lattice)]
    if not walls:
        return basis
    cells = sum(math.prod(lattice.cells) for lattice in lattices)
    faces = np.zeros((cells, lattices[0].dimension), np.int8)
    for lattice, direction, above in walls:
        for step, side in ((0, BELOW), (-1, ABOVE)):
            cell = above.copy()
            cell[:, direction] += step
            number = np.ravel_multi_index(tuple(cell.T), lattice.cells[: cell.shape[1]])
            faces[lattice.first_cell + number, direction] |= side
    return walled(basis, faces)


def _walls(lattice: Lattice, nodes: np.ndarray) -> Iterator[tuple[int, np.ndarray]]:
    """Yield each direction with walls, and the cells (n, d) on the upper side of these walls.

    A face is a wall if all its nodes are held. Faces inside a block of held nodes, with held faces
    on both sides, are not walls. The ends of the grid are always walls.
    """
    d = lattice.dimension
    places = lattice.places(nodes)[:, :d]
    corner = places.min(axis=0)
    fixed = np.zeros(places.max(axis=0) - corner + 1, np.bool_)
    fixed[tuple((places - corner).T)] = True
    for k in range(d):
        face = np.moveaxis(fixed, k, 0)
        for axis in range(1, d):
            face = np.moveaxis(face, axis, 0)
            face = np.moveaxis(face[:-1] & face[1:], 0, axis)
        wall = face.copy()
        wall[1:-1] &= ~(face[:-2] & face[2:])
        cell = np.argwhere(np.moveaxis(wall, 0, k)) + corner
        # Omit cells at the ends of the grid: the stencil of three nodes does not fit into one cell.
        cell = cell[(cell[:, k] > 0) & (cell < lattice.cells[:d]).all(axis=1)]
        if len(cell):
            yield k, cell


def mark_sides(hub: Hub, s: Setup) -> None:
    """Mark the nodes at edges of grids, and the nodes that fixes hold in this run (`Sides`)."""
    sides = field(s.nodes.fields, Sides)[:, 0]
    if sides.any():  # pages take no memory until they are written
        sides[:] = 0
    for fix in hub.fixes.values():
        for k, formula in enumerate(fix.formulas if fix.prescribes_velocity else ()):
            if formula is not None:
                nodes = slice(None) if fix.group.all else fix.nodes
                sides[nodes] = sides[nodes].astype(int) | HELD << k
    for lattice in hub.lattices:
        of_lattice = sides[lattice.first :][: lattice.node_count].reshape(lattice.shape)
        for k in range(s.kin.dimension):
            planes = np.moveaxis(of_lattice, k, 0)
            planes[0] += LOWER << k
            planes[-1] += UPPER << k
