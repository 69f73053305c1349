"""Load steps: Newton's method in the place of a step that an explicit scheme takes."""

from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.arrays import DT, MASS, TIME, TIMESTEP, Hooks, of_change, of_force
from karamelo_py.kernels.clock import finish
from karamelo_py.kernels.implicit import furthest
from karamelo_py.kernels.step import DONE, SORT, take_rows
from karamelo_py.points.kinematics import Axisymmetric
from karamelo_py.run.implicit.equations import Equations
from karamelo_py.run.implicit.solvers import Singular, rigid_motions, solve
from karamelo_py.script.errors import ScriptError

HALVINGS = 10  # of a load step, at most
FAR = 0.5  # cells that points may go in one part of a load step
ROUNDED = 1e-14  # of the largest forces: no solution is better


class Failed(Exception):
    """A part of a load step has no solution that Newton's method finds, for a reason."""


class Report(NamedTuple):
    """What a load step took."""

    iterations: int
    residual: float
    parts: int


class LoadSteps:
    """Take the load steps of a simulation."""

    def __init__(self, simulation: Any):
        self.simulation = simulation
        self.scheme = simulation.hub.update.scheme
        self.modulus = 0.0
        self.report = Report(0, 0.0, 0)

    def advance(self, hooks: Any, count: int) -> int:
        """Take up to `count` load steps; return how they ended, as `run_steps` does."""
        control = self.simulation.setup.control
        clock = control.clock[0]
        for _ in range(count):
            if control.values[TIME] >= clock.end_time:
                break
            status = self._step(hooks)
            if status != DONE:
                return status
            if clock.drift > clock.drift_limit:
                return SORT
        return DONE

    def _step(self, hooks: Any) -> int:
        """Take a load step, in parts where it has to be."""
        control = self.simulation.setup.control
        whole, step = float(control.values[DT]), control.values[TIMESTEP]
        left, part, parts, iterations = 1.0, 1.0, 0, 0
        while left > 0:
            part = min(part, left)
            try:
                taken, residual = self._part(hooks, part * whole)
            except Failed as reason:
                if part <= 2.0**-HALVINGS:
                    raise self._explained(reason, part) from None
                part /= 2
                continue
            left -= part
            parts, iterations = parts + 1, iterations + taken
            if left > 0:
                part *= 2 if taken <= self.scheme.iterations // 2 else 1
                if control.clock[0].drift > control.clock[0].drift_limit:
                    self.simulation.sort_if_due()
        self.report = Report(iterations, residual, parts)
        control.values[TIMESTEP] = step + 1
        return DONE

    def _part(self, hooks: Any, dt: float) -> tuple[int, float]:
        """Take a part of a load step: find its equilibrium, and let the points follow.

        Loads are those of its end. Returns the number of corrections, and the residual that is
        left.

        Raises
        ------
        Failed
            If there is no equilibrium to be found; nothing has changed then.
        """
        simulation = self.simulation
        s, control = simulation.setup, simulation.setup.control
        time = float(control.values[TIME])
        control.values[DT] = dt
        control.clock[0].kick = control.clock[0].last_dt = dt
        control.values[TIME] = time + dt
        totals = control.totals.copy()
        try:
            if not take_rows(self.scheme.begin, s, simulation.mode, hooks):
                raise Failed("a point has left the domain")
            equations = Equations(s)
            found = self._newton(equations, hooks, dt)
        except Failed:
            control.totals[:] = totals
            self._loads()[:] = 0
            raise
        finally:
            control.values[TIME] = time
        control.values[TIME] = time + dt
        self._publish(equations, found, hooks, dt)
        went_well = take_rows(self.scheme.close, s, simulation.mode, hooks)
        control.values[TIME] = time
        if not went_well:
            raise Failed("a point has gone wrong")
        for block in s.blocks:
            block.points.v[:] = 0
        finish(control)
        return found.iterations, found.residual

    def _loads(self) -> np.ndarray:
        """The loads at nodes that hooks note for the work that they do."""
        hooks = self.simulation.hooks
        return hooks.loads if isinstance(hooks, Hooks) else np.zeros(0)

    def _newton(self, equations: Equations, hooks: Any, dt: float) -> "Equilibrium":
        """Find the displacements at which the forces of a part of a step are in balance."""
        scheme, d = self.scheme, equations.d
        s, nodes = equations.s, equations.nodes
        force = of_force(s.kin)
        external = s.nodes.sums[nodes, force : force + d] + equations.present_forces()
        given, prescribed = self._prescribed(equations, hooks)
        jump = np.where(given, prescribed * dt, 0.0)
        free = ~given
        equations.unknowns(free)
        u = np.zeros_like(external)
        inner = equations.respond(u, dt)
        spacing = float(s.grids.spacing[0])
        if not self.modulus:
            self.modulus = equations.modulus()
        share = scheme.stabilisation * self.modulus
        order = getattr(type(s.basis), "degree", 1)
        ghost = share * equations.ghost(order, spacing) if share else None
        floor = 1e-9 * self.modulus * spacing ** (d - 1)
        motions = rigid_motions(equations.positions(), isinstance(s.kin, Axisymmetric))
        rigid = motions[free]
        residual, settled = np.inf, False
        for iteration in range(scheme.iterations + 1):
            balance = external - inner
            if ghost is not None:
                balance -= ghost @ u
            size = max(np.linalg.norm(external), np.linalg.norm(inner), floor)
            residual = float(np.linalg.norm(balance[free]) / size)
            done = residual <= scheme.tolerance or settled
            if done and not (iteration == 0 and np.any(jump)):
                return Equilibrium(u, given, -balance, iteration, residual)
            if iteration == scheme.iterations:
                break
            equations.linearise()
            A, b = equations.matrix, balance[free] - equations.of_prescribed(jump)
            if ghost is not None:
                of_all = equations.for_all_components(ghost)
                A = A + of_all[free.ravel()][:, free.ravel()]
                b -= (ghost @ jump)[free]
            change = jump.copy()
            if len(b):
                try:
                    change[free] = solve(scheme.solver, A, b, rigid)
                except Singular:
                    raise Failed(SINGULAR) from None
            u += change
            jump[:] = 0
            inner = equations.respond(u, dt)
            if not np.all(np.isfinite(inner)):
                raise Failed("a point turns inside out")
            self._check_reach(equations, u, spacing)
            settled = np.linalg.norm(change) <= scheme.tolerance * np.linalg.norm(u)
        raise Failed(f"{scheme.iterations} corrections leave {residual:.1e} of the forces")

    def _check_reach(self, equations: Equations, u: np.ndarray, spacing: float) -> None:
        kin = equations.s.kin
        far = max(furthest(kin, seen, u) for seen, _ in equations.parts) / spacing
        if not far <= FAR:
            raise Failed(f"points would go {far:.3g} cells at once")

    def _prescribed(self, equations: Equations, hooks: Any) -> tuple[np.ndarray, np.ndarray]:
        """Find which components of the nodes are held, and the velocities that they get.

        Fixes are shown two velocities: what comes out the same is what they prescribe.
        """
        simulation, s = self.simulation, equations.s
        d, nodes, update = equations.d, equations.nodes, s.nodes.update
        totals = s.control.totals.copy()
        found = []
        for shown in (0.0, 1.0):
            update[nodes] = 0
            update[nodes, :d] = shown
            take_rows(self.scheme.hold, s, simulation.mode, hooks)
            found.append(np.array(update[nodes, :d]))
        s.control.totals[:] = totals
        given = found[0] == found[1]
        if np.any(~given & ((found[0] != 0.0) | (found[1] != 1.0))):
            raise ScriptError(
                "a fix changes velocities of nodes without prescribing them, as friction at a wall "
                "does: load steps know no such thing",
                hint="fix velocity_nodes, or an explicit scheme: scheme(musl)",
            )
        return given, found[0]

    def _publish(self, equations: Equations, found: "Equilibrium", hooks: Any, dt: float) -> None:
        """Let those that hold nodes publish the forces that they do it with; velocities at nodes.

        They are shown the velocity that a node would have without them.
        """
        simulation, s = self.simulation, equations.s
        d, nodes, update = equations.d, equations.nodes, s.nodes.update
        mass = s.nodes.sums[nodes, MASS, None]
        v = found.u / dt
        without = np.where(found.given, -found.reaction * dt / mass, 0.0)
        change = of_change(s.kin)
        update[nodes, :d] = v + without
        update[nodes, change : change + d] = without
        take_rows(self.scheme.hold, s, simulation.mode, hooks)
        update[nodes, :d] = s.nodes.velocity[nodes, :d] = v
        update[nodes, change : change + d] = 0

    def _explained(self, reason: Failed, part: float) -> ScriptError:
        """Make of a failure what the user should know."""
        hub, control = self.simulation.hub, self.simulation.setup.control
        step, time = int(control.values[TIMESTEP]) + 1, float(control.values[TIME])
        return ScriptError(
            f"step {step}, time {time:.6g}: {reason}, and so it is with 1/{round(1 / part)} of the load step",
            place=hub.place,
            hint="smaller load steps; a solid that nothing holds, or a load beyond what the body "
            "bears, has no equilibrium",
        )


SINGULAR = "the equations are singular"


class Equilibrium(NamedTuple):
    """Displacements (m, d) of the nodes, which are given, and the forces that hold them."""

    u: np.ndarray
    given: np.ndarray
    reaction: np.ndarray
    iterations: int
    residual: float
