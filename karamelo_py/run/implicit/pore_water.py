"""Displacements of soil and nodal pore pressures of a load step (u-p).

The balance of water at node i is sum N_i V0 (w' - w) - dt sum V grad N_i . q = 0 over points with
water content w, volume V and Darcy's flux q = -k (grad p - rho g). The pressure loads the soil with
sum V p grad N_i. Time integration is backward Euler.

Without drainage, pressures oscillate if displacement and pressure have the same basis. Therefore
deviations of pressure increments from cell means have a compliance per unit volume, max(0, 3 / M -
12 k dt / h^2) (Bochev & Dohrmann 2006; White & Borja 2008, "Stabilized low-order finite elements
for coupled solid-deformation/fluid-diffusion"; Zhao & Choo 2020), which conserves water.
"""

from collections.abc import Iterable

import numpy as np
import scipy.sparse as sp

from karamelo_py.compiler.fields import field
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import MASS, Block, Tag, matter_of, of_force
from karamelo_py.kernels.equations.pore_water import (
    Flux,
    GivenFlux,
    GivenPressure,
    RelativeVelocity,
    WaterSums,
)
from karamelo_py.kernels.export import export
from karamelo_py.points.laws import initial_state, specific_volume, wave_speed_squared
from karamelo_py.points.laws.pore_water import State, drag_per_volume, pore_pressure, porosity
from karamelo_py.run.implicit.equations import Equations, interpolation, valid
from karamelo_py.run.implicit.solvers import direct
from karamelo_py.scene.modify import Fix

OUTLET = 1e3  # conductance of a seepage face / conductance of its cells
CAVITATION = -1e5  # Pa relative to the atmosphere: vacuum
NUMBERS = "n", "drag", "K", "rho", "suction"
EPS = 50 * float(np.finfo(float).eps)


def is_wet(equations: Equations) -> bool:
    return any(RelativeVelocity.needed(block.laws) for block in equations.blocks)


class Seepage:
    """Nodal pressures `p` (m,) of a step, and their equations.

    Arrays of points have one entry per point with water, in the order of `wet`, a list of pairs
    (block, stencils).
    """

    def __init__(self, equations: Equations, dt: float):
        s, self.d, self.dt = equations.s, equations.d, dt
        self.equations, self.m = equations, len(equations.nodes)
        self.wet = [
            (block, seen)
            for block, (seen, _) in zip(equations.blocks, equations.parts, strict=True)
            if RelativeVelocity.needed(block.laws)
        ]
        self._read_points()
        self._read_stencils()
        sums, first = field(s.nodes.fields, WaterSums)[equations.nodes], of_force(s.kin)
        self.weight = sums[:, first : first + self.d].astype(float)
        mass = np.where(sums[:, MASS] > 0, sums[:, MASS], 1.0)[:, None]
        density = self.rho * self.full / self.pores
        self.gravity = density[:, None] * (self.N @ (self.weight / mass))
        volumes = self.N.T @ self.volume
        self.present = volumes > 0
        volumes[~self.present] = 1.0
        self.p = self.N.T @ (self.volume * self.before) / volumes
        self.density = self.N.T @ (self.volume * density) / volumes
        every = self.N.T @ (self.volume * ~self.drains) == 0
        self.softest = np.where(every, self.N.T @ (self.volume * self.suction) / volumes, np.inf)
        prescribed = field(s.nodes.fields, GivenPressure)[equations.nodes].astype(float)
        self.given = prescribed[:, 0]
        faces = self.present & (prescribed[:, 1] == 1)
        self.open = self.present & ~np.isnan(self.given) & ~faces
        self._lay_out_flow()
        self.outlet = np.where(faces, OUTLET * self.L.diagonal(), 0.0)
        self.respond(np.zeros((self.m, self.d)))

    def _read_points(self) -> None:
        kin, grids = self.equations.s.kin, self.equations.s.grids
        columns = []
        for block, _ in self.wet:
            points, of = block.points, block.points.material
            per_point = {name: np.asarray(getattr(block.laws, name))[of] for name in NUMBERS}
            law = block.laws._replace(law=None, **per_point)
            records = [record(block.laws, k) for k in range(len(block.laws.n))]
            state = State(None, points.state[-2], points.state[-1])
            n = porosity(law, kin, state)
            mobility = n * n / drag_per_volume(law, kin, state)
            per_mass = np.array([float(specific_volume(one)) for one in records])[of]
            M = np.array([_modulus(one.law, kin) for one in records])[of]
            numbers = [law.n, law.K, law.rho, law.suction, mobility, M, grids.spacing[points.grid]]
            content = state.content / law.rho  # volume of the water
            before = np.empty(len(content))
            export(pore_pressure.tag, False, matter_of(kin, block), before)
            columns.append((per_mass * points.mass, content, state.pores, before, *numbers))
        every = (np.concatenate(one).astype(float) for one in zip(*columns, strict=True))
        self.V0, self.content, self.pores, self.before, self.n, self.K, *more = every
        self.rho, self.suction, self.mobility, M, h = more
        self.drains = self.suction < self.K
        ratio = self.content / self.pores
        # Water that fills the pores sets weight and mobility.
        self.full = np.where(self.drains & (ratio < 1), self.pores, self.content)
        self.mobility = self.mobility * self.full / self.pores
        self.volume = self.V0 * (self.pores + 1 - self.n)
        self.compliance = np.maximum(0, 3 / M - 12 * self.mobility * self.dt / (h * h))

    def _read_stencils(self) -> None:
        self.N = interpolation((seen for _, seen in self.wet), self.m)
        self.of, self.starts = self.N.indices, self.N.indptr
        slopes = [seen.gradients[valid(seen)][:, : self.d] for _, seen in self.wet]
        self.slopes = np.concatenate(slopes)
        self.G = [sp.csr_matrix((g, self.of, self.starts), self.N.shape) for g in self.slopes.T]

    def _lay_out_flow(self) -> None:
        cells = np.concatenate([_cells(self.equations, block) for block, _ in self.wet])
        cells = np.unique(cells, axis=0, return_inverse=True)[1].ravel()
        points = np.arange(len(cells))
        within = sp.csr_matrix((np.ones(len(cells)), (points, cells)))
        shares = within.T @ sp.diags(self.volume)
        self.mean = within @ sp.diags(1 / np.bincount(cells, self.volume)) @ shares
        self.D = (self.N - self.mean @ self.N).tocsr()
        self.inflow = self._flux()
        self._conduct(np.ones(len(points)))

    def _conduct(self, saturation: np.ndarray) -> None:
        pairs = [*zip(self.G, self.gravity.T, strict=True)]
        flow = self.dt * self.volume * (self.mobility * saturation)
        self.L = sum((g.T @ sp.diags(flow) @ g for g in self.G), sp.csr_matrix((self.m, self.m)))
        self.pull = sum(g.T @ (flow * f) for g, f in pairs) + self.inflow
        self.rate = sp.csr_matrix((self.m, self.m))
        if np.any(saturation < 1):
            slope = flow * (saturation < 1) / self.suction
            self.rate = sum(g.T @ sp.diags(slope * (g @ self.p - f)) @ self.N for g, f in pairs)

    def _flux(self) -> np.ndarray:
        """Return the volume (m,) supplied to nodes; store mass flow rates, as `MakeFlux` does."""
        flux = field(self.equations.s.nodes.fields, GivenFlux)
        if flux is None:
            return np.zeros(self.m)
        areas = [g.T @ self.volume for g in self.G]
        sides = [np.maximum(sign * area, 0) for area in areas for sign in (-1, 1)]
        surface = np.sqrt(sum(area * area for area in areas))
        amounts = np.stack([*sides, surface, self.N.T @ self.volume], 1)
        amounts *= flux[self.equations.nodes, : amounts.shape[1]]
        flux[self.equations.nodes, : amounts.shape[1]] = amounts
        return self.dt * amounts.sum(1) / self.rho[0]

    def _scale(self, p: np.ndarray) -> np.ndarray:
        return np.where(p < 0, self.suction, self.K)

    def respond(self, u: np.ndarray) -> None:
        """Update forces and balances after displacements (m, d)."""
        at = self.N @ self.p
        self._strain(u)
        self.lift = self.volume * (1 + self.growth)
        # Bishop (1959): pressure times saturation acts on the soil.
        dry = self.drains & (at < 0)
        self.filled = np.where(dry, np.exp(np.minimum(at, 0) / self.suction), 1.0)
        self.acting = self.filled * (1 + np.where(dry, at / self.suction, 0.0))
        if np.any(self.drains):
            self._conduct(self.filled)
        self.loads = (self.B.T @ (self.lift * (self.filled * at))).reshape(-1, self.d) + self.weight
        scale = self._scale(at)
        more = self.before * (1 / scale - 1 / self._scale(self.before))
        ratio, rise = self.content / self.pores, np.expm1((at - self.before) / scale + more)
        more = (self.pores + 1 - self.n) * self.growth
        self.pores_after = self.pores + more
        self.gain = ratio * (more * (1 + rise) + self.pores * rise)
        self.capacity = self.V0 * ratio * self.pores_after * (1 + rise) / scale
        departs = at - self.before
        damped = self.D.T @ (self.volume * self.compliance * (departs - self.mean @ departs))
        stored, moved = self.N.T @ (self.V0 * self.gain), self.L @ self.p
        above = np.where(self.outlet > 0, self.p - self.given, 0.0)
        self.seeps, self.lets = self.outlet * np.maximum(above, 0), self.outlet * (above > 0)
        self.rest = stored + moved - self.pull + damped + self.seeps
        self.size = max(float(np.linalg.norm(one)) for one in (stored, moved, damped))

    def _strain(self, u: np.ndarray) -> None:
        d = self.d
        H = np.stack([np.stack([g @ u[:, i] for g in self.G], 1) for i in range(d)], 1)
        trace = np.trace(H, axis1=1, axis2=2)
        # det(I + H) - 1, without cancellation
        growth = trace + 0.5 * (trace * trace - np.einsum("pij,pji->p", H, H))
        self.growth = growth + (np.linalg.det(H) if d == 3 else 0.0)
        back = np.repeat(np.linalg.inv(np.eye(d) + H), np.diff(self.starts), axis=0)
        slopes = np.einsum("eji,ej->ei", back, self.slopes)[:, None, :]
        shape = len(H), self.m * d
        self.B = sp.bsr_matrix((slopes, self.of, self.starts), shape=shape).tocsr()

    def forces(self) -> np.ndarray:
        return self.loads

    def residual(self, tolerance: float) -> float:
        if np.any(self.p[self.open] != self.given[self.open]):
            return np.inf
        rest = float(np.linalg.norm(self.rest[~self.open]))
        rounding = EPS * float(np.linalg.norm(self.N.T @ (self.V0 * self.content)))
        return rest / max(self.size, rounding / tolerance, 1e-300)

    def solve(
        self, A: sp.spmatrix, b: np.ndarray, jump: np.ndarray, free: np.ndarray, kept: dict
    ) -> np.ndarray:
        """Correct the pressures, and return the change of displacements (m d,)."""
        Q = (self.B.T @ sp.diags(self.lift * self.acting) @ self.N).tocsr()
        R = (self.B.T @ sp.diags(self.lift * self.filled) @ self.N).tocsr()
        slow = self.D.T @ sp.diags(self.volume * self.compliance) @ self.D
        C = (
            self.L
            + self.rate
            + sp.diags(self.lets)
            + slow
            + self.N.T @ sp.diags(self.capacity) @ self.N
        ).tocsr()
        step = np.where(self.open, self.given - self.p, 0.0)
        into = -self.rest - C @ step - R.T @ jump.ravel()
        moves, seen = free.ravel().astype(float), (self.present & ~self.open).astype(float)
        b = b + moves * (Q @ step)
        unknown = sp.diags(seen)
        Q, R = (sp.diags(moves) @ one @ unknown for one in (Q, R))
        C = unknown @ C @ unknown + sp.diags(1 - seen)
        whole = sp.bmat([[A.tocsr(), -Q], [R.T, C]], format="csr")
        x = direct(whole, np.concatenate([b, seen * into]), kept)
        self._change(x[len(b) :] + step)
        self.p[self.open] = self.given[self.open]
        return x[: len(b)]

    def _change(self, step: np.ndarray) -> None:
        """Add a change of the pressures.

        In unsaturated soil, p changes such that the saturation exp(p/a) changes linearly.
        """
        a, whole = self.softest, self.p + step
        S = np.exp(np.minimum(self.p, 0) / a)
        left = np.where(self.p < 0, S * (1 + step / a), 1 + whole / a)
        dried = a * np.log(np.maximum(left, 0.1 * S))
        self.p = np.where((a < np.inf) & (left < 1), dried, whole)

    def cavitates(self) -> bool:
        """Return True if water in full pores is below -1 bar."""
        return bool(np.any(((self.N @ self.p) < CAVITATION) & ~self.drains))

    def end(self, fixes: Iterable[Fix]) -> None:
        """Store the water of the points; fixes publish the water that left through their nodes."""
        first = 0
        for block, seen in self.wet:
            some = slice(first, first := first + len(seen.count))
            n, state = self.pores_after[some], block.points.state
            state[-2], state[-1] = self.rho[some] * (self.content[some] + self.gain[some]), n
            flow = self.mobility * (self.gravity.T - np.stack([g @ self.p for g in self.G]))
            w = field(block.points.fields, RelativeVelocity)
            w[:] = flow[:, some] * (n + 1 - self.n[some]) / n
        nodes = self.equations.nodes
        left = self.density * np.where(self.open, -self.rest, self.seeps) / self.dt
        flux = field(self.equations.s.nodes.fields, Flux)
        flux[nodes, self.d + 5] = left
        for fix in fixes:
            if Flux in fix.node_fields:
                leaves = float(left[np.isin(nodes, fix.nodes)].sum())
                fix.hub.values.set(f"{fix.id}_s", leaves)
            if GivenFlux in fix.node_fields:
                given = field(self.equations.s.nodes.fields, GivenFlux)[nodes]
                some = given[np.isin(nodes, fix.nodes), int(fix.formulas[1].constant)]
                fix.hub.values.set(f"{fix.id}_s", -float(some.sum()))


def _modulus(law: Tag, kin: Tag) -> float:
    speed = wave_speed_squared(law, kin, initial_state(law, kin, 1.0))
    return float(speed / specific_volume(law))


def _cells(equations: Equations, block: Block) -> np.ndarray:
    s, points = equations.s, block.points
    grids, of = s.grids, points.grid
    home = points.x[s.control.motion[0].now] if points.home is None else points.home
    x = home[: equations.d].T
    origin = np.stack([grids.x0[of], grids.y0[of], grids.z0[of]], 1)[:, : equations.d]
    cells = np.floor((x - origin) * grids.inv_h[of][:, None] + 1e-9).astype(np.int64)
    return np.column_stack([of, cells])
