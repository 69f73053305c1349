"""Equations of an implicit step: unknowns, sparse matrix, ghost stabilisation."""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from karamelo_py.compiler import on_numbers
from karamelo_py.compiler.fields import field, rows_of_points
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels import implicit as loops
from karamelo_py.kernels import implicit_twist  # noqa: F401
from karamelo_py.kernels.arrays import MASS, Block, Matter, OnGrids, Setup, Tag, known_to_laws
from karamelo_py.kernels.equations.fbar import FBar
from karamelo_py.kernels.equations.heat import Conductance
from karamelo_py.kernels.equations.twist import RadiusAfterMove
from karamelo_py.points.grid import node_places, node_position
from karamelo_py.points.kinematics import free_from
from karamelo_py.points.laws import can, constrained_velocity, initial_state, specific_volume
from karamelo_py.run.implicit.averaging import AveragedVolumes
from karamelo_py.run.implicit.solvers import rigid_motions
from karamelo_py.scene.modify import Fix

BATCH = 8192  # points assembled at a time
MOST_MOVED = 0.5  # displacement relative to other nodes, in cells per cell of distance
# Arrays in FOLLOWING are reused as long as the arrays in FOLLOWED are unchanged.
FOLLOWED, FOLLOWING = ("nodes", "deforming"), ("positions", "rigid_motions", "differences")


def valid(seen: loops.Seen) -> np.ndarray:
    return np.arange(seen.nodes.shape[1]) < seen.count[:, None]


def interpolation(seen: Iterable[loops.Seen], nodes: int) -> sp.csr_matrix:
    """Return the weights (n, nodes) of the nodes at all points of some blocks."""
    counts, weights, numbers = [np.zeros(1, np.int32)], [np.zeros(0)], [np.zeros(0, np.int32)]
    for one in seen:
        some = valid(one)
        counts.append(one.count)
        weights.append(one.weights[some])
        numbers.append(one.nodes[some])
    starts = np.cumsum(np.concatenate(counts))
    data = np.concatenate(weights), np.concatenate(numbers), starts
    return sp.csr_matrix(data, (len(starts) - 1, nodes))


def summed(
    weights: sp.csr_matrix, blocks: Sequence[Block], values: Iterable[np.ndarray]
) -> np.ndarray:
    """Return nodal sums (m, k) of mass times the values (k, n) of the points of each block."""
    if not blocks:
        return np.zeros((weights.shape[1], 1))
    mass = sp.diags(np.concatenate([block.points.mass for block in blocks]))
    return (mass @ weights).T @ np.concatenate([*values], axis=1).T


def distinct(numbers: list[np.ndarray]) -> np.ndarray:
    numbers = [array for array in numbers if array.size]
    if not numbers:
        return np.zeros(0, np.int64)
    low = min(int(array.min()) for array in numbers)
    present = np.zeros(max(int(array.max()) for array in numbers) - low + 1, bool)
    for array in numbers:
        present[array - low] = True
    return np.flatnonzero(present) + low


class Moduli(NamedTuple):
    mean: float  # mean modulus by volume; 0 if nothing deforms
    of_grids: np.ndarray  # (g,) modulus of each grid, 0 where nothing deforms
    of_laws: list[np.ndarray]  # for each block (2, k): moduli of its laws, and specific volumes

    def alike(self) -> bool:
        every = (table[0, table[1] > 0] for table in self.of_laws)
        return len(np.unique(np.concatenate([np.zeros(0), *every]))) <= 1


class Equations:
    """Nodal forces of a step, and their derivatives.

    `nodes` (m,) are the nodes in stencils of points. `mass` (m,) is 0 at nodes with gradients only,
    `places` (m, d) are grid indices, `per_node` is the number of unknowns per node (d, and one for
    the rotation around the axis). `deforming` (m,) masks nodes of points that deform (`blocks`,
    with their stencils in `parts`), `led` (m,) nodes of rigid points, with `velocity_of_rigid` (m,
    d). `cached` is from the previous step, or empty.
    """

    def __init__(self, s: Setup, mode: Tag, cached: dict[str, np.ndarray], stabilised: bool):
        self.s, self.mode, self.d = s, mode, s.kin.dimension
        self.per_node = len(s.kin.Unknown._fields)
        self.blocks = [block for block in s.blocks if not can(block.laws, constrained_velocity)]
        self.parts = [self._seen(block) for block in self.blocks]
        counts = [seen.nodes[valid(seen)] for seen, _ in self.parts]
        soft = distinct(counts)
        tools = [(b, self._seen(b)[0]) for b in s.blocks if can(b.laws, constrained_velocity)]
        counts += [seen.nodes[seen.weights > 0] for _, seen in tools]
        self.nodes = distinct(counts)
        self.numbers = np.full(np.ptp(self.nodes) + 1, -1)
        self.numbers[self.nodes - self.nodes[0]] = np.arange(len(self.nodes))
        self.mass = s.nodes.sums[self.nodes, MASS].astype(float)
        self.grid = np.searchsorted(s.grids.first, self.nodes, side="right") - 1
        self.steps = self._steps(self.grid)
        self.grids_of_nodes = record(s.grids, self.grid)
        self.places = np.stack(node_places(self.grids_of_nodes, self.nodes), 1)[:, : self.d]
        self.parts = [(self._numbered(seen), response) for seen, response in self.parts]
        tools = [(block, self._numbered(seen)) for block, seen in tools]
        self.deforming = np.isin(self.nodes, soft)
        self.led, self.velocity_of_rigid = self._led(tools)
        if all(np.array_equal(vars(self)[name], cached.get(name)) for name in FOLLOWED):
            vars(self).update(cached)
        self._find_pairs(stabilised)
        self.averaged = AveragedVolumes(self) if isinstance(s.averaging, FBar) else None

    def matter(self, block: Block) -> Matter:
        radius = [one for one in block.points.fields if isinstance(one, RadiusAfterMove)]
        points = known_to_laws(block.points)._replace(fields=tuple(radius))
        return Matter(self.s.kin, points, block.laws)

    def cached(self) -> dict[str, np.ndarray]:
        return {name: vars(self)[name] for name in (*FOLLOWED, *FOLLOWING) if name in vars(self)}

    def _steps(self, g: np.ndarray) -> np.ndarray:
        x, y = self.s.grids.step_x[g], self.s.grids.step_y[g]
        return np.stack([x, y, np.ones_like(x)], 1)[:, : self.d]

    def _seen(self, block: Block) -> tuple[loops.Seen, loops.Response]:
        s = self.s
        seen, response = loops.nothing_seen(s, block)
        points, now = block.points, s.control.motion[0].now
        where = points.x[now] if s.frame.moves else points.home
        at = OnGrids(s.basis, s.kin, s.grids, points.grid, where)
        matter = Matter(s.kin, points, block.laws)
        loops.see(self.mode, loops.PARTS, s.frame, at, matter, seen)
        return seen, response

    def _led(self, tools: list[tuple[Block, loops.Seen]]) -> tuple[np.ndarray, np.ndarray]:
        momentum = np.zeros((len(self.nodes), self.per_node))
        blocks, weights = [b for b, _ in tools], interpolation((x for _, x in tools), len(momentum))
        mass = summed(weights, blocks, (np.ones((1, b.points.mass.size)) for b in blocks))
        momentum[:, : self.d] = summed(weights, blocks, (block.points.v for block in blocks))
        led = mass[:, 0] > 0
        return led, np.divide(momentum, mass, out=momentum, where=led[:, None])

    def _numbered(self, seen: loops.Seen) -> loops.Seen:
        most = int(seen.count.max(initial=1))
        number = self.number_of(seen.nodes[:, :most])
        in_use = valid(seen)[:, :most] & (number >= 0)
        first = number[np.arange(len(number)), in_use.argmax(1)]
        small = np.int32 if number.size < 2**31 else np.int64
        nodes = np.where(in_use, number, first[:, None]).astype(np.int32)
        entries = np.flatnonzero(valid(seen)[:, :most]).astype(small)
        starts = np.append(0, np.cumsum(seen.count))
        by_point = entries, nodes.ravel()[entries], starts
        by_node = sp.csr_matrix(by_point, (len(nodes), len(self.nodes))).tocsc()
        return seen._replace(
            nodes=nodes,
            weights=seen.weights[:, :most].copy(),
            gradients=seen.gradients[:, :most].copy(),
            starts=by_node.indptr.astype(np.int64),
            entries=by_node.data,
        )

    def _find_pairs(self, stabilised: bool) -> None:
        """Find the pairs of nodes in common stencils, and lay out K, a block per pair.

        The pairs include pairs of the ghost stabilisation, and each node with itself.
        """
        d, k, m = self.d, self.per_node, len(self.nodes)
        ways = (x[seen.nodes] for x in self.places.T for seen, _ in self.parts)
        reach = max((int(np.ptp(way, axis=1).max(initial=0)) for way in ways), default=0)
        row = 2 * reach + 1
        weights = row ** np.arange(d)[::-1]
        rank = np.full((m, row**d), -1, np.int32)
        middle = int(reach * weights.sum())
        self.layout = loops.Pairs(self.places @ weights, middle, rank, np.zeros(m + 1, np.int64))
        rank[:, middle] = 0
        for seen, _ in self.parts:
            loops.mark_pairs(self.mode, loops.PARTS, seen, self.layout)
        rows, offsets = np.nonzero(rank == 0)
        shift = np.stack(np.unravel_index(offsets, (row,) * d), 1) - reach
        columns = self.number_of(self.nodes[rows] + (shift * self.steps[rows]).sum(1))
        self.joined = rows.astype(np.int32), columns.astype(np.int32)
        pairs = every = rows * m + columns
        if stabilised:
            lines = self.differences[0]
            ghosts = lines[:, np.repeat(range(3), 3)] * m + lines[:, np.tile(range(3), 3)]
            every = np.union1d(pairs, ghosts)
        self.pairs = tuple(one.astype(np.int32) for one in np.divmod(every, m))
        np.cumsum(np.bincount(self.pairs[0], minlength=m), out=self.layout.first[1:])
        rank[rows, offsets] = np.searchsorted(every, pairs) - self.layout.first[rows]
        self.K = sp.bsr_matrix(
            (np.zeros((len(every), k, k)), self.pairs[1], self.layout.first), (m * k, m * k)
        )

    def number_of(self, nodes: np.ndarray) -> np.ndarray:
        at = nodes - self.nodes[0]
        inside = (at >= 0) & (at < len(self.numbers))
        return np.where(inside, self.numbers[np.where(inside, at, 0)], -1)

    def bodies(self) -> np.ndarray:
        rows, columns = self.joined
        m = len(self.nodes)
        graph = sp.csr_matrix((np.ones(len(rows), bool), (rows, columns)), (m, m))
        return connected_components(graph, directed=False)[1]

    def respond(self, u: np.ndarray, dt: float) -> np.ndarray:
        """Return nodal forces (m, d) after displacements (m, d); not finite if a point fails."""
        s = self.s
        for seen, response in self.parts:
            loops.strain(self.mode, loops.PARTS, s.kin, seen, u, response)
        if self.averaged is not None:
            self.averaged.respond(dt)
        else:
            for block, (_, response) in zip(self.blocks, self.parts, strict=True):
                loops.respond(self.mode, loops.PARTS, self.matter(block), dt, response)
        return self._forces()

    def _forces(self) -> np.ndarray:
        f = np.zeros((len(self.nodes), self.per_node))
        for seen, response in self.parts:
            loops.add_forces(self.mode, loops.PARTS, self.s.kin, seen, response.stress, f)
        return f

    def furthest(self) -> float:
        return max((float(response.furthest.max()) for _, response in self.parts), default=0.0)

    def furthest_into(self, u: np.ndarray, fixed: np.ndarray) -> float:
        """Return the largest displacement, in cells, of a node towards nodes that move differently.

        A node moves differently if its displacement (m, d) differs by more than a step's rotation
        or strain allows, or if it is `fixed` (nodes, d) and has no points.
        """
        cells = u[:, : self.d] / self.s.grids.spacing[self.grid][:, None]
        far, k = np.nonzero(np.abs(cells) > MOST_MOVED)
        g, start, way, most = self.grid[far], self.places[far], cells[far, k], 0.0
        ends = np.stack([self.s.grids.nx[g], self.s.grids.ny[g], self.s.grids.nz[g]], 1)[
            :, : self.d
        ]
        for side in np.ndindex(*(2,) * self.d):
            shift = np.clip(np.floor(start + cells[far]).astype(int) + side, 0, ends) - start
            node = self.nodes[far] + (shift * self.steps[far]).sum(1)
            number = self.number_of(node)
            other = np.where(number >= 0, cells[number, k], 0.0)
            meets = np.abs(way - other) > MOST_MOVED * (1 + np.abs(shift).max(1))
            meets &= (number >= 0) | fixed[node, k]
            most = max(most, float(np.abs(way[meets]).max(initial=0.0)))
        return most

    def present_forces(self) -> np.ndarray:
        if self.averaged is not None:
            self.averaged.keep_stress()
        else:
            for block, (_, response) in zip(self.blocks, self.parts, strict=True):
                loops.keep_stress(Matter(self.s.kin, block.points, block.laws), response.stress)
        return self._forces()

    def prescribed(self, fixes: Iterable[Fix], count: int) -> tuple[np.ndarray, np.ndarray]:
        mask, values = np.zeros((len(self.nodes), count), bool), np.zeros((len(self.nodes), count))
        for fix in fixes:  # the last fix of a node applies
            mask_of_fix, value = fix.prescribed(self.nodes, self.positions)
            mask |= mask_of_fix
            values[mask_of_fix] = value[mask_of_fix]
        return mask, values

    @cached_property
    def weights(self) -> sp.csr_matrix:
        """Return the weights (n, m) of the nodes at the points of all blocks."""
        return interpolation((seen for seen, _ in self.parts), len(self.nodes))

    @cached_property
    def positions(self) -> np.ndarray:
        return np.stack(node_position(self.grids_of_nodes, self.nodes), 1)[:, : self.d]

    @cached_property
    def rigid_motions(self) -> np.ndarray:
        motions = rigid_motions(self.positions, free_from(self.s.kin))
        if self.per_node == self.d:
            return motions
        motions = np.pad(motions, ((0, 0), (0, 1), (0, 1)))
        motions[:, -1, -1] = 1.0
        return motions

    @cached_property
    def levers(self) -> np.ndarray:
        """Return lengths (m, k) per unit of the unknowns: 1, or the radius for angles."""
        levers = np.ones((len(self.nodes), self.per_node))
        levers[:, self.d :] = self.positions[:, :1]
        return levers

    def for_all_components(self, matrix: sp.csr_matrix) -> sp.bsr_matrix:
        blocks = matrix.data[:, None, None] * np.eye(self.d)
        shape = tuple(self.d * size for size in matrix.shape)
        return sp.bsr_matrix((blocks, matrix.indices, matrix.indptr), shape)

    def linearise(self, dt: float, ghost: sp.csr_matrix | None = None) -> None:
        d, t, kin = self.per_node, self.s.kin.tensor_size, self.s.kin
        blocks = self.K.data
        blocks[:] = 0
        alone = ~self.deforming[self.pairs[0]] & (self.pairs[0] == self.pairs[1])
        blocks[alone] = np.eye(d)  # sums of sparse matrices drop blocks of zeros
        into = loops.Blocks(self.layout, blocks.reshape(-1, d * d))
        for k, (block, (seen, response)) in enumerate(zip(self.blocks, self.parts, strict=True)):
            n, done = block.points.mass.size, np.zeros(len(self.nodes), np.int64)
            if self.averaged is not None:
                some = loops.Tangent(0, n, self.averaged.averages[k].tangent, done)
                loops.add_stiffness(self.mode, loops.PARTS, kin, seen, some, into)
                continue
            matter = self.matter(block)
            tangent = rows_of_points((t * t, min(n, BATCH)), np.float64)
            for first in range(0, n, BATCH):
                some = loops.Tangent(first, min(first + BATCH, n), tangent, done)
                loops.respond_to_changes(self.mode, loops.PARTS, matter, dt, response, some)
                loops.add_stiffness(self.mode, loops.PARTS, kin, seen, some, into)
        if ghost is not None:
            m = len(self.nodes)
            rows = np.repeat(np.arange(m), np.diff(ghost.indptr))
            every = self.pairs[0] * np.int64(m) + self.pairs[1]
            at = np.searchsorted(every, rows * m + ghost.indices)
            levers = self.levers[rows] * self.levers[ghost.indices]
            blocks[at] += ghost.data[:, None, None] * levers[:, None] * np.eye(d)
        self.whole = self.K
        if self.averaged is not None:
            self.whole = (self.K.tocsr() + self.averaged.stiffness()).tobsr((d, d))

    def conduction(self) -> sp.csr_matrix:
        data = np.zeros(len(self.pairs[1]))
        for block, (seen, _) in zip(self.blocks, self.parts, strict=True):
            conductance = field(block.points.fields, Conductance)
            loops.add_conductance(self.s.kin, seen, conductance, self.layout, data)
        m = len(self.nodes)
        return sp.csr_matrix((data, self.pairs[1], self.layout.first), (m, m))

    def moduli(self) -> "Moduli":
        kin = self.s.kin
        places = kin.Tensor.places
        of_grids = np.zeros((2, len(self.s.grids.first)))
        total = volume = 0.0
        of_laws = [np.zeros((2, block.points.material.max() + 1)) for block in self.blocks]
        for block, of_own in zip(self.blocks, of_laws, strict=True):
            points = block.points
            for k in np.unique(points.material):
                law = record(block.laws, k)
                trial = loops.IncrementAt(kin.Tensor._make([0.0] * len(places)), 1.0)
                state = initial_state(law, kin, 1.0)
                _, C = on_numbers(loops.stress_and_tangent)(law, kin, state, trial, 1.0)
                one = C[0][0] if self.d == 1 else 1.3 * (C[0][0] - C[0][places.index((1, 1))])
                rows = float(points.mass[points.material == k].sum() * specific_volume(law))
                total, volume = total + rows * float(one), volume + rows
                of_own[:, k] = one, specific_volume(law)
                on = points.grid[points.material == k]
                own_of = np.bincount(on, points.mass[points.material == k], of_grids.shape[1])
                of_grids += own_of * float(specific_volume(law)) * np.array([[float(one)], [1.0]])
        per = np.where(of_grids[1] > 0, of_grids[1], 1.0)
        return Moduli(total / volume if volume else 0.0, of_grids[0] / per, of_laws)

    def ghost(self, moduli: "Moduli") -> sp.csr_matrix:
        """Return the matrix (m, m) that penalises jumps of gradients at the border of bodies.

        The matrix is in units of the mean modulus. The modulus at a node is the mean over its
        points by volume; a difference uses the smallest modulus of its nodes.
        """
        lines, size, D = self.differences
        weights = size**self.d
        if not moduli.alike():
            tables = zip(self.blocks, moduli.of_laws, strict=True)
            rows = (table[:, block.points.material] for block, table in tables)
            values = (np.stack([volume * young, volume]) for young, volume in rows)
            sums = summed(self.weights, self.blocks, values)
            none = np.full(len(sums), np.inf)
            means = np.divide(sums[:, 0], sums[:, 1], out=none, where=sums[:, 1] > 0)
            least = means[lines].min(1, initial=np.inf)
            weights = weights * np.where(np.isfinite(least), least, 0.0) / moduli.mean
        factor = 1 / 3 / 2 ** (self.d - 1)
        return (factor * (D.T @ sp.diags(weights) @ D)).tocsr()

    @cached_property
    def differences(self) -> tuple[np.ndarray, np.ndarray, sp.csr_matrix]:
        """Return second differences at borders of bodies: nodes (n, 3), cells (n,), matrix (n, m).

        With a linear basis, second differences are the jumps of gradients across faces of border
        cells (Coombs 2023). Splines have no such jumps, but the differences stabilise their border
        nodes, too.
        """
        d, places = self.d, self.places
        touched = np.zeros((int(self.grid.max()) + 1, *(places.max(0) + 2)), bool)
        soft = self.deforming
        touched[self.grid[soft], *places[soft].T] = True
        corners = [tuple(slice(c, c - 1 or None) for c in at) for at in np.ndindex(*(2,) * d)]
        cells = np.logical_and.reduce([touched[:, *corner] for corner in corners])
        padded = np.pad(cells, [(0, 0), *[(1, 1)] * d])
        around = [np.roll(padded, k, 1 + i) for i in range(d) for k in (1, -1)]
        border = cells & ~np.logical_and.reduce(around)[:, *(slice(1, -1),) * d]
        rows, sizes = [], []
        for i in range(d):
            beyond = np.roll(cells, 1, 1 + i), np.roll(border, 1, 1 + i)
            g, *at = np.nonzero(cells & beyond[0] & (border | beyond[1]))
            for side in np.ndindex(*(2,) * (d - 1)):
                corner = np.stack(at, 1) + np.insert(np.array(side, int), i, 0)
                rows.append(self._line(g, corner, i))
                sizes.append(self.s.grids.spacing[g])
        lines = np.concatenate(rows)
        whole = (lines >= 0).all(1)
        lines, size = lines[whole], np.concatenate(sizes)[whole]
        n = len(lines)
        at_nodes = np.repeat(np.arange(n), 3), lines.ravel()
        D = sp.csr_matrix((np.tile((1.0, -2.0, 1.0), n), at_nodes), (n, len(self.nodes)))
        return lines, size, D

    def _line(self, g: np.ndarray, corner: np.ndarray, axis: int) -> np.ndarray:
        """Return nodes (rows, 3) next to corners along an axis; -1 for nodes not in use."""
        shifts = np.array([-1, 0, 1])
        steps = self._steps(g)
        first = self.s.grids.first[g] + (corner * steps).sum(1)
        along = corner[:, axis, None] + shifts
        numbers = self.number_of(first[:, None] + shifts * steps[:, axis, None])
        return np.where(along >= 0, numbers, -1)
