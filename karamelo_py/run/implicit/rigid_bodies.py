"""Free rigid bodies in equilibrium, within Newton's method.

A body moves its nodes by u = T q, with its displacements and small rotations q as unknowns. Contact
gives forces f at these nodes, so T^T f plus the loads on the body vanish in equilibrium. Rotations
are linear within a step; the points of the body then rotate exactly.
"""

import numpy as np
import scipy.sparse as sp

from karamelo_py.kernels import rigid_motion as motion
from karamelo_py.kernels.arrays import DT, Block, Control
from karamelo_py.run.implicit import solvers
from karamelo_py.run.implicit.contact import Contact
from karamelo_py.run.implicit.equations import Equations
from karamelo_py.run.state import SceneState
from karamelo_py.styles.fixes.rigid_body import WAYS, RigidBody, bodies_of

WEAK = 1e-9  # relative size of a constraint below which it holds nothing
UNSUPPORTED = 1e-2  # tolerated unsupported fraction of a load; a ball touches few nodes at first


class LoadedBody:
    """One body: its motion, the loads on it, and its `nodes` (n,) as indices in the equations.

    `motions` (n, d, 6) are nodal velocities per unit of the body's velocity and spin. `ways` (k,)
    are indices of its unknown components. `led` (6,) is the prescribed velocity and spin.
    """

    def __init__(self, fix: RigidBody, body: motion.FreeBody, equations: Equations):
        self.fix, self.body = fix, body
        values, mass, d = fix.hub.values, fix.constants[0].mass, equations.d
        self.nodes = np.flatnonzero(equations.led & (equations.grid == body.field))
        numbers = np.array([
            0.0 if formula is None else formula.evaluate(values) for formula in fix.formulas_of_body
        ])  # fmt: skip
        self.led = numbers[motion.LED : motion.LOADED]
        self.load = numbers[motion.LOADED : motion.FALLS].copy()
        self.load[:3] += mass * numbers[motion.FALLS :]
        self.load[3:] += np.cross(fix.state[0].R @ fix.constants[0].offset, self.load[:3])
        self.ways = np.flatnonzero(fix.dofs)
        arms = np.zeros((len(self.nodes), 3))
        arms[:, :d] = equations.positions[self.nodes]
        arms -= fix.state.x
        turning = np.cross(np.eye(3), arms[:, None]).transpose(0, 2, 1)
        translating = np.broadcast_to(np.eye(3), turning.shape)
        self.motions = np.concatenate([translating, turning], axis=2)[:, :d]

    def finish(
        self, q: np.ndarray, forces: np.ndarray, blocks: tuple[Block, ...], control: Control
    ) -> None:
        """Move the body by `q` (6,), publish its values, and move its points in this step."""
        fix, body, dt, d = self.fix, self.body, float(control.values[DT]), forces.shape[1]
        state, work = fix.state[0], body.solution
        total = np.einsum("ncw,nc->w", self.motions, forces[self.nodes])
        state.force[:], state.torque[:] = total[:3], total[3:]
        work.u[:] = q / dt
        state.spin[:] = work.u[3:]
        motion.move(body, dt, d, True)
        for block in blocks:
            points = block.points
            mask = (points.id >= body.ids[0]) & (points.id < body.ids[1])
            arm = points.x[control.motion[0].now][:, mask].astype(float) - work.before[:d, None]
            points.v[:, mask] = state.move[:d, None] + state.spread[:d, :d] @ arm
        state.v[:] = state.spin[:] = state.momentum[:] = 0.0
        motion.publish(body, control.values)


class MovingBodies:
    """The k unknown motions of all free bodies, within Newton's method."""

    def __init__(self, equations: Equations, simulation: SceneState):
        hub, tags = simulation.hub, simulation.setup.bodies.bodies
        pairs = zip(bodies_of(hub), tags, strict=True)
        self.bodies = [LoadedBody(fix, body, equations) for fix, body in pairs]
        m, d = len(equations.nodes), equations.d
        columns, self.velocities = [np.zeros((m, d, 0))], np.zeros((m, d))
        self.nodes = np.zeros(m, bool)
        for one in self.bodies:
            some = np.zeros((m, d, len(one.ways)))
            some[one.nodes] = one.motions[:, :, one.ways]
            columns.append(some)
            self.nodes[one.nodes] = True
            self.velocities[one.nodes] = one.motions @ one.led
        T = np.concatenate(columns, axis=2)
        self.T = sp.csr_matrix(T.reshape(m * d, -1))
        self.load = np.concatenate([one.load[one.ways] for one in self.bodies])
        bounds = [np.where(one.ways < 3, 1.0, one.fix.constants[0].bound) for one in self.bodies]
        self.lever = np.concatenate(bounds)
        self.q = np.zeros(len(self.load))

    def rest(self, balance: np.ndarray) -> np.ndarray:
        """Return the forces and torques (k,) that contact does not balance."""
        return self.T.T @ balance.ravel() + self.load

    def norm(self, forces: np.ndarray) -> float:
        return float(np.linalg.norm(forces / self.lever))

    def couple(self, contact: sp.spmatrix, free: np.ndarray, balance: np.ndarray) -> None:
        """Project contact stiffness (m d, m d) and unbalanced forces (m, d) onto the bodies."""
        below = self.T.T @ contact
        unknown = sp.diags(free.ravel().astype(float))
        stiffness = (below @ self.T).tocsr()
        # Regularise directions without contact, which have no load.
        weak = max(WEAK * float(np.abs(contact.data).max(initial=0.0)), 1e-300) * self.lever**2
        self.parts = unknown @ contact @ self.T, below @ unknown, stiffness + sp.diags(weak)
        self.left = self.rest(balance)

    def solve(self, A: sp.spmatrix, b: np.ndarray, kept: dict) -> np.ndarray:
        """Solve for the motions of the bodies, too; return changes of displacements (m, d)."""
        right, below, stiffness = self.parts
        whole = sp.bmat([[A, right], [below, stiffness]]).tocsr()
        x = solvers.direct(whole, np.concatenate([b, self.left]), kept)
        if not np.all(np.isfinite(x)):
            raise solvers.Singular
        u, q = x[: len(b)], x[len(b) :]
        self.q += q
        return (u + self.T @ q).reshape(self.velocities.shape)

    def finish(self, forces: np.ndarray, control: Control, blocks: tuple[Block, ...]) -> None:
        dt, first = float(control.values[DT]), 0
        for one in self.bodies:
            q, end = one.led * dt, first + len(one.ways)
            q[one.ways] = self.q[first:end]
            one.finish(q, forces, blocks, control)
            first = end

    def without_stiffness(self, contact: Contact) -> list[str]:
        """Return the solids that touch another rigid solid."""
        chosen = contact.close & (contact.stiffness == 0)
        nodes = np.concatenate([contact.first[chosen], contact.second[chosen]])
        return [one.fix.body.id for one in self.bodies if np.any(np.isin(one.nodes, nodes))]

    def loose(self, contact: Contact) -> tuple[str, str] | None:
        """Return a solid and a direction in which it is loaded but not held, or None.

        A body without contact is assumed to touch the closest nodes of other bodies.
        """
        first = 0
        for one in self.bodies:
            count, nodes = len(one.ways), np.zeros(len(self.nodes), bool)
            lever, load = self.lever[first : first + count], one.load[one.ways]
            nodes[one.nodes], first = True, first + count
            contact.meet(nodes)
            motions = np.zeros((*self.velocities.shape, count))
            motions[one.nodes] = one.motions[:, :, one.ways] / lever
            rows = np.linalg.qr(contact.constraints(motions, nodes), "r")
            _, sizes, ways = np.linalg.svd(rows)
            loose = ways[np.sum(sizes > WEAK * sizes.max(initial=0.0)) :]
            rest = loose.T @ (loose @ (load / lever))
            if np.abs(rest).max(initial=0.0) > UNSUPPORTED * np.abs(load / lever).max(initial=0.0):
                return one.fix.body.id, WAYS[one.ways[np.abs(rest).argmax()]]
        return None
