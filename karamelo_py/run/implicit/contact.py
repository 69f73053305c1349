"""Contact between solids with separate fields, within Newton's method.

If the relative displacement u at a common node exceeds the gap g along the normal N, the penalty
pressure is p = max(0, k (N u - g)). The tangential spring sticks while |k s| <= mu p for the slip s
of the step, and slides at mu p (Wriggers 2006, "Computational Contact Mechanics", chapter 10).
Normals and gaps are from the beginning of the step.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import TIMESTEP
from karamelo_py.kernels.contact import Bodies, ListedPairs, list_pairs
from karamelo_py.kernels.equations.loss import FrictionalHeat
from karamelo_py.run.implicit.equations import Equations

STIFF = 1e3  # stiffness of the penalty spring / stiffness of a cell of the softer body
LIGHT = 0.01  # fraction of an inner node's mass below which a node has no contact
SLIPPERY = 0.05  # fraction of an inner node's mass below which a node has no friction
CLOSE = 1e-4  # gap in cells below which contact is assumed at first


class Contact:
    """Pairs of nodes where bodies meet; c is the number of pairs.

    `first`, `second` (c,) are indices of unknown nodes, `normal` (c, d) points to the second body,
    `close` (c,) masks pairs in contact before the step, `push` (c,) and `drag` (c, d) are normal
    and tangential forces on the second body. `moduli` (g,) are Young's moduli by grid, 0 if rigid.
    """

    def __init__(self, equations: Equations, moduli: np.ndarray):
        self.equations, self.s, self.d = equations, equations.s, equations.d
        s, nodes = equations.s, equations.nodes
        tag = self.tag = s.contact
        room = len(nodes) * len(tag.slot)
        pairs, gap = np.zeros((room, 2), np.int64), np.zeros(room)
        normal = np.zeros((room, self.d))
        listed = ListedPairs(pairs, normal, gap)
        count = list_pairs(Bodies(tag, s.kin, s.nodes), s.grids, s.spans, listed, -1)
        # Nodes with almost no mass would carry no load.
        shares = self._shares()[equations.number_of(pairs[:count])].min(1)
        chosen = np.flatnonzero(shares >= LIGHT)
        count = len(chosen)
        self.pairs, self.normal = pairs[chosen], normal[chosen]
        self.gap = np.maximum(gap[chosen], 0.0)
        self.first, self.second = (equations.number_of(one) for one in self.pairs.T)
        self.a, self.b = (equations.grid[one] for one in (self.first, self.second))
        # The friction of light nodes would rotate in each correction and prevent convergence.
        mu = tag.friction[self.a, self.b]
        self.mu = np.where((shares[chosen] < SLIPPERY) & np.isfinite(mu), 0.0, mu)
        self.stiffness = self._stiffness(moduli)
        h = float(np.min(s.grids.spacing))
        self.gap[self.touched()] = 0  # treats the contact as closed, whatever gap was measured
        self.close = (self.gap <= CLOSE * h) | self.touched()
        ones, at = np.ones(count), np.arange(count)
        m = len(nodes)
        self.jump = sp.csr_matrix((ones, (at, self.first)), (count, m)) - sp.csr_matrix(
            (ones, (at, self.second)), (count, m)
        )
        self.jumps = equations.for_all_components(self.jump).tocsr()
        self.respond(np.zeros((m, self.d)), supposed=True)

    def meet(self, nodes: np.ndarray) -> None:
        """Assume contact at the closest pairs of a body of which no pair is in contact.

        `nodes` (m,) are the nodes of the body.
        """
        mask = (nodes[self.first] | nodes[self.second]) & (self.stiffness > 0)
        if np.any(mask) and not np.any(self.close[mask]):
            near = CLOSE * float(np.min(self.s.grids.spacing))
            self.close |= mask & (self.gap <= self.gap[mask].min() + near)
            self.respond(np.zeros((len(nodes), self.d)), supposed=True)

    def _shares(self) -> np.ndarray:
        equations = self.equations
        mass = equations.mass / self._around(equations.positions[:, 0], self.s.grids.spacing[0])
        most = np.zeros(len(self.s.grids.first))
        np.maximum.at(most, equations.grid, mass)
        return mass / np.maximum(most[equations.grid], 1e-300)

    def _stiffness(self, moduli: np.ndarray) -> np.ndarray:
        both = np.stack([moduli[self.a], moduli[self.b]])
        softer = np.where(both > 0, both, np.inf).min(0)
        h = self.s.grids.spacing[self.a]
        stiffness = STIFF * np.where(np.isfinite(softer), softer, 0.0) * h ** (self.d - 2)
        return stiffness * self._around(self.equations.positions[self.first, 0], h)

    def _around(self, x: np.ndarray, h: np.ndarray) -> np.ndarray:
        """Return length or area (m,) per radian at radii `x`, for cells of size `h`; 1 if plane."""
        return np.maximum(x, 0.25 * h) ** self.s.kin.hoops

    def touched(self, sign: int = 0) -> np.ndarray:
        """Return the mask (c,) of pairs in contact after the last `respond`.

        With `sign` -1, include only pairs that stuck.
        """
        step = int(self.s.control.values[TIMESTEP])
        last = self.tag.touched[self.pairs[:, 0], self.b]
        last = sign * last if sign else np.abs(last)
        return (last > 0) & (last >= step)

    def respond(self, u: np.ndarray, *, supposed: bool = False) -> None:
        """Compute forces after nodal displacements (m, d), and derivatives of the forces.

        With `supposed`, `u` is a first guess; contact and sticking are as in the last step.
        """
        k, N = self.stiffness, self.normal
        x = self.jump @ u
        across = (N * x).sum(1)
        push = k * (across - self.gap)
        self.pressed = self.close if supposed else push >= 0
        self.push = np.where(self.pressed, push, 0.0)
        self.slip = x - across[:, None] * N
        NN = N[:, :, None] * N[:, None, :]
        self.tangent = np.where(self.pressed, k, 0.0)[:, None, None] * NN
        self._rub(np.eye(self.d) - NN, supposed)

    def _rub(self, along: np.ndarray, supposed: bool) -> None:
        """Compute the drag and its derivatives by return mapping.

        Pairs are tried as sticking; if the friction exceeds Coulomb's cone, they slide on it (Simo
        & Laursen 1992, "An augmented Lagrangian treatment of contact problems involving friction").
        """
        k, N, slip, C = self.stiffness, self.normal, self.slip, self.tangent
        glued = np.isinf(self.mu)
        mu = np.where(glued, 0.0, self.mu)
        size = np.linalg.norm(slip, axis=1)
        bound = mu * np.maximum(self.push, 0.0)
        rubs = self.pressed & (self.mu > 0)
        self.sticks = sticks = rubs & (glued | (k * size <= bound) | supposed)
        slides = rubs & ~sticks
        size = np.where(size > 0, size, 1.0)
        way = slip / size[:, None]
        bound = np.where(slides, bound, 0.0)
        self.drag = np.where(sticks[:, None], k[:, None] * slip, bound[:, None] * way)
        C += np.where(sticks, k, 0.0)[:, None, None] * along
        C += (bound / size)[:, None, None] * (along - way[:, :, None] * way[:, None, :])
        C += np.where(slides, mu * k, 0.0)[:, None, None] * way[:, :, None] * N[:, None, :]

    @property
    def on_second(self) -> np.ndarray:
        return self.push[:, None] * self.normal + self.drag

    def forces(self) -> np.ndarray:
        return -(self.jump.T @ self.on_second)

    def matrix(self) -> sp.bsr_matrix:
        c, d = len(self.first), self.d
        row = np.arange(c * d).reshape(c, d)
        i, j = (np.broadcast_to(x, (c, d, d)).ravel() for x in (row[:, :, None], row[:, None, :]))
        C = sp.csr_matrix((self.tangent.ravel(), (i, j)), (c * d, c * d))
        return (self.jumps.T @ C @ self.jumps).tobsr((d, d))

    def constraints(self, motions: np.ndarray, mask: np.ndarray) -> np.ndarray:
        """Return the rows (r, k) by which closed pairs constrain the rigid `motions` (m, d, k)."""
        rows = []
        for nodes in (self.first, self.second):
            chosen = self.close & mask[nodes]
            moved = motions[nodes[chosen]]
            rows.append(np.einsum("ci,cik->ck", self.normal[chosen], moved))
            rows.append(moved[self.mu[chosen] > 0].reshape(-1, motions.shape[2]))
        return np.concatenate(rows)

    def stopped(self, v: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """Return `v` (m, d) without the relative normal velocities of pairs under pressure.

        The change conserves momentum; `inverse` (m, d) are inverse masses, 0 at held nodes.
        """
        return v + inverse * self._stopping(v, inverse, self._across()[self.pressed])

    def accelerated(self, a: np.ndarray, v: np.ndarray, inverse: np.ndarray) -> np.ndarray:
        """Add the effect of contact at the beginning of the step to accelerations `a` (m, d).

        Approaching pairs in contact get zero relative normal acceleration. Pairs that stuck get
        zero relative acceleration; other pairs slide with the velocities `v` (m, d).
        """
        B, touched, stuck = self._across(), self.touched(), self.touched(-1)
        touched = touched & (B @ a.ravel() > 0)  # other pairs may separate
        every = np.repeat(touched & stuck, self.d)
        rows = sp.vstack([B[touched & ~stuck], self.jumps[every]]).tocsr()
        forces = self._stopping(a, inverse, rows)
        way = self.jump @ v
        way -= (way * self.normal).sum(1)[:, None] * self.normal
        way /= np.maximum(np.linalg.norm(way, axis=1), 1e-300)[:, None]
        slides = touched & ~stuck & (self.mu > 0)
        push = -(self.normal * (self.jump @ (inverse * forces))).sum(1)
        bears = (self.jumps.multiply(self.jumps) @ inverse.ravel()).reshape(-1, self.d)
        push /= np.maximum((self.normal**2 * bears).sum(1), 1e-300)
        drag = np.where(slides, np.where(np.isinf(self.mu), 0, self.mu) * push, 0)[:, None] * way
        return a + inverse * (forces - self.jump.T @ drag)

    def _stopping(self, v: np.ndarray, inverse: np.ndarray, rows: sp.csr_matrix) -> np.ndarray:
        seen = rows @ v.ravel()
        if not np.any(seen):
            return np.zeros_like(v)
        W = rows @ sp.diags(inverse.ravel()) @ rows.T
        W = W + sp.diags(1e-9 * W.diagonal() + 1e-300)
        return -(rows.T @ np.atleast_1d(spsolve(W.tocsc(), seen))).reshape(v.shape)

    def _across(self) -> sp.csr_matrix:
        c, d = self.normal.shape
        at = np.repeat(np.arange(c), d), np.arange(c * d)
        return (sp.csr_matrix((self.normal.ravel(), at), (c, c * d)) @ self.jumps).tocsr()

    def publish(self) -> None:
        tag, values = self.tag, self.s.control.values
        step = int(values[TIMESTEP]) + 1
        x = np.zeros((len(self.first), 3))
        x[:, : self.d] = self.equations.positions[self.first]
        force = np.zeros_like(x)
        force[:, : self.d] = self.on_second
        loads = np.concatenate([force, np.cross(x, force)], 1)
        for k, (slot, torque) in enumerate(zip(tag.slot, tag.torque, strict=True)):
            total = loads[self.b == k].sum(0) - loads[self.a == k].sum(0)
            values[slot : slot + 3], values[torque : torque + 3] = total[:3], total[3:]
        for (a, b), slot in np.ndenumerate(tag.pair):
            if slot >= 0:
                one, other = (self.a == a) & (self.b == b), (self.a == b) & (self.b == a)
                values[slot : slot + 3] = force[other].sum(0) - force[one].sum(0)
                if turns := tag.torques[slot]:
                    turning = loads[other, 3:].sum(0) - loads[one, 3:].sum(0)
                    values[turns : turns + 3] = turning
        for source, copy in tag.copies:
            values[copy : copy + 3] = values[source : source + 3]
        tag.touched[self.pairs[:, 0], self.b] = np.where(
            self.pressed, np.where(self.sticks, -step, step), 0
        )
        self._warm()

    def _warm(self) -> None:
        heat = field(self.s.nodes.fields, FrictionalHeat)
        if heat is None:
            return
        nodes, mass = self.equations.nodes, self.equations.mass
        heat[nodes] = 0
        work = (self.drag * self.slip).sum(1) * ~self.sticks
        to_first = self.tag.warmth[self.a, self.b]
        for at, fraction in ((self.first, to_first), (self.second, 1 - to_first)):
            np.add.at(heat[:, 0], nodes[at], fraction * work / mass[at])
