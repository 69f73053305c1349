"""Steps of implicit schemes by Newton's method."""

from math import ceil
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler.fields import field
from karamelo_py.kernels.arrays import DT, TIME, TIMESTEP, Hooks, Tag, of_change, of_force
from karamelo_py.kernels.clock import finish
from karamelo_py.kernels.contact import SeparateFields
from karamelo_py.kernels.equations.twist import (
    AngularVelocity,
    SumsAround,
    TorqueOfLoads,
    UpdateAround,
)
from karamelo_py.kernels.free_bodies import FreeBodies
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.rigid import PUBLISH, RigidBodies, RigidSums
from karamelo_py.kernels.step import DONE, GAINED, SORT, STOPPED, take_rows
from karamelo_py.kernels.totals import WORK, add_to, carry
from karamelo_py.kernels.twist import HELD
from karamelo_py.kernels.watch import look_at_end
from karamelo_py.points.kinematics import free_from
from karamelo_py.points.laws import can, constrained_velocity
from karamelo_py.run.boxes import used
from karamelo_py.run.implicit.conduction import conduct
from karamelo_py.run.implicit.contact import Contact
from karamelo_py.run.implicit.equations import Equations, Moduli
from karamelo_py.run.implicit.inertia import Motion, Rest
from karamelo_py.run.implicit.newton import Broken, Failed, Loose, Newton, TooFar, Wrong, counted
from karamelo_py.run.implicit.pore_water import Seepage, is_wet
from karamelo_py.run.implicit.rigid_bodies import MovingBodies
from karamelo_py.run.implicit.solvers import Singular, release
from karamelo_py.run.implicit.tools import PushingTool
from karamelo_py.run.no_number import no_number
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.schemes.quasi_static import PUBLISHED
from karamelo_py.script.errors import Mark, ScriptError

SUBSTEP_HALVINGS = 10
LONG_WAY = 1.0  # path of a point in a step, in cells, above which a warning is given


class PointsWrong(Exception):
    """A point left the domain or failed."""


class NoEquilibrium(Exception):
    """A load step has no equilibrium, though some of its substeps may have been taken."""


class LoadSteps:
    def __init__(self, simulation: Simulation):
        self.simulation = simulation
        self.scheme = simulation.hub.update.scheme
        self.dynamic = self.scheme.traits.inertia
        self.moduli: Moduli | None = None
        self.cached: dict[str, np.ndarray] = {}  # arrays of the last equations
        self.parts = 0
        self.failure = ""  # reason why no equilibrium was found
        self.unknowns = self.corrections = 0  # in the last equilibrium; in all steps so far
        self.seconds: dict[str, float] = {}  # time by stage

    def advance(self, hooks: Tag, count: int) -> int:
        """Take up to `count` load steps; return the status, as `run_steps` does."""
        control = self.simulation.setup.control
        step, motion, energy = control.step[0], control.motion[0], control.energy[0]
        s, mode = self.simulation.setup, self.simulation.mode
        if energy.looks == 0 and not self.simulation.begins:
            look_at_end(s, mode)
        for _ in range(count):
            if control.values[TIME] >= step.end_time:
                break
            try:
                self._step(hooks)
            except PointsWrong:
                return STOPPED
            except Broken:
                break
            except NoEquilibrium as error:
                self.failure = str(error)
                return STOPPED
            if not look_at_end(s, mode):
                return GAINED
            if motion.drift > motion.drift_limit:
                return SORT
        return DONE

    def fixed_nodes(self) -> np.ndarray:
        mask = np.zeros(
            (self.simulation.hub.fields.node_count, self.simulation.setup.kin.dimension), bool
        )
        for fix in self.simulation.hub.fixes.values():
            if "post_update_grid_state" in fix.hooks() and not fix.first_step_only:
                for k in fix.held_directions or range(mask.shape[1]):
                    mask[fix.nodes, k] = True
        return mask

    def _step(self, hooks: Tag) -> None:
        control = self.simulation.setup.control
        whole, step = float(control.values[DT]), control.values[TIMESTEP]
        end = float(control.values[TIME]) + whole
        if abs(end - control.step[0].end_time) <= 1e-9 * whole:
            end = float(control.step[0].end_time)
        if not self.dynamic and step == 0:
            self._check_at_rest()
        left, fraction, most, iterations, residual = 1.0, 1.0, 1.0, 0, 0.0
        self.parts, before = 0, None
        while left > 1e-9:
            fraction = min(fraction, left)
            try:
                taken, residual = self._part(hooks, fraction * whole)
            except Broken:
                if self.parts:
                    self.simulation.restore(before)
                raise
            except Failed as reason:
                if before is None:
                    before = self.simulation.snapshot()
                if fraction <= 2.0**-SUBSTEP_HALVINGS:
                    if self.scheme.limit == "error":
                        share = f" even in 1/{round(1 / fraction)} of the load step"
                        raise NoEquilibrium(f"{reason}{share}") from None
                    end = self._limit_reached(reason)
                    break
                fraction /= 2
                if isinstance(reason, TooFar):
                    fraction = most = 2 * fraction / min(max(ceil(1.1 * reason.at), 2), 4)
                continue
            left -= fraction
            control.values[TIMESTEP] = step
            self.parts, iterations = self.parts + 1, iterations + taken
            if left > 1e-9:
                if taken <= self.scheme.iterations // 2:
                    fraction = min(2 * fraction, most)
                if control.motion[0].drift > control.motion[0].drift_limit:
                    self.simulation.sort_if_due()
        for name, value in zip(PUBLISHED, (iterations, residual, self.parts), strict=True):
            self.simulation.hub.values.set(name, float(value))
        control.values[TIME], control.values[TIMESTEP] = end, step + (self.parts > 0)

    def _tell_of_long_way(self, equilibrium: "Equilibrium") -> None:
        far = equilibrium.equations.furthest() / float(np.min(self.simulation.setup.grids.spacing))
        if far <= LONG_WAY or self.dynamic or not self.simulation.setup.frame.moves:
            return
        if self.simulation.hub.update.first_time("a long way in a load step"):
            self.simulation.hub.console.say(
                f"note: points cross {far:.2g} cells in a load step; if the time of crossing "
                "matters, the error is proportional to the step: compare with more load steps"
            )

    def _check_at_rest(self) -> None:
        for block in self.simulation.setup.blocks:
            moving = np.flatnonzero(block.points.v.any(0))
            if len(moving) and not can(block.laws, constrained_velocity):
                solid = self._solid_of(int(block.points.id[moving[0]]))
                raise self._error(
                    f"solid '{solid}' has initial velocities, which load steps ignore",
                    "scheme(newmark), or none",
                )

    def _interrupted(self, correction: int, residual: float) -> bool:
        simulation = self.simulation
        if simulation.between is None:
            return False
        within = f"part {self.parts + 1}, correction {correction}, residual {residual:.1e}"
        return simulation.between(within) and not simulation.begins

    def _limit_reached(self, reason: Failed) -> float:
        time = self.simulation.steps.end_here()
        self.simulation.hub.console.say(
            f"limit load: no equilibrium beyond time {time:.6g}, {reason}; the run ends there"
        )
        return time

    def _part(self, hooks: Tag, dt: float) -> tuple[int, float]:
        """Take a substep with the loads at its end; return number of corrections and residual.

        If there is no equilibrium, raises `Failed`; points have not moved then.
        """
        simulation = self.simulation
        s, control = simulation.setup, simulation.setup.control
        time = float(control.values[TIME])
        totals = control.totals.copy()
        heated = isinstance(s.heat, Conducting)
        cold = simulation.snapshot() if heated else None
        simulation.steps.load_step(dt)
        try:
            # The sums at nodes include the heat capacities, which conduction needs. Conduction
            # changes the stress.
            before = self._forces(hooks).copy() if self.dynamic or heated else None
            loaded = simulation.hooks if self.dynamic else None
            loads = loaded.loads.copy() if isinstance(loaded, Hooks) else None
            control.values[TIME] = time + dt
            if heated:
                self._conduct(hooks, dt)
            after = self._forces(hooks)
            if loads is not None:
                # The work of loads uses their mean over the step, as in Newmark's rule.
                loaded.loads[:] = 0.5 * (loads + loaded.loads)
            equilibrium = self._equilibrium(hooks, dt, before if self.dynamic else None, after)
            self._tell_of_long_way(equilibrium)
            self._publish(equilibrium, hooks, dt)
            if not take_rows(self.scheme.close, s, simulation.mode, hooks):
                raise PointsWrong
        except Failed:
            if cold is not None:
                simulation.restore(cold)
            control.totals[:] = totals
            raise
        finally:
            control.values[TIME] = time
        equilibrium.inertia.end(equilibrium.u)
        if equilibrium.seepage is not None:
            equilibrium.seepage.end(simulation.fixes.acting)
            cavitates = equilibrium.seepage.cavitates()
            if cavitates and simulation.hub.update.first_time("cavitation"):
                simulation.hub.warn(
                    f"{self._now()}: the water is in tension beyond 1 bar, where it boils",
                    hint="pore_water(..., suction=1000) lets pores empty",
                )
        finish(control)
        simulation.steps.anew()
        return equilibrium.iterations, equilibrium.residual

    def _conduct(self, hooks: Tag, dt: float) -> None:
        s, mode = self.simulation.setup, self.simulation.mode
        try:
            conduct(Equations(s, mode, self.cached, False), hooks, self.simulation.fixes.acting, dt)
        except Singular:
            raise self._error(
                "temperatures have no solution: some conductivity is not finite",
                "check conductivities and heat capacities",
            ) from None

    def _forces(self, hooks: Tag) -> np.ndarray:
        """Sum mass, momentum and forces at the nodes; return the forces (nodes, d)."""
        simulation = self.simulation
        s = simulation.setup
        simulation.clear_forces()
        torque = field(s.nodes.fields, TorqueOfLoads)
        if torque is not None:
            torque[:] = 0
        if isinstance(simulation.hooks, Hooks):
            simulation.hooks.loads[:] = 0
        # Prescribed velocities would otherwise be relative to the last step.
        with simulation.steps.altered(last_dt=0.0):
            if not take_rows(self.scheme.begin, s, simulation.mode, hooks):
                raise PointsWrong
        force = of_force(s.kin)
        forces = s.nodes.sums[:, force : force + s.kin.dimension]
        around = field(s.nodes.fields, SumsAround)
        return forces if around is None else np.concatenate([forces, around[:, 2:3]], axis=1)

    def _equilibrium(
        self, hooks: Tag, dt: float, before: np.ndarray | None, after: np.ndarray
    ) -> "Equilibrium":
        """Find the displacements at which forces balance.

        `before` and `after` are the nodal forces of the present stress, with the loads at the
        beginning and at the end of the step; `before` is None without inertia.
        """
        simulation = self.simulation
        s = simulation.setup
        with counted(self.seconds, "layout"):
            equations = Equations(s, simulation.mode, self.cached, self.scheme.stabilisation > 0)
        nodes = equations.nodes
        external = after[nodes] + equations.present_forces()
        self._check_numbers(external, "a node gets a force that is not a number")
        fixed, velocities = self._prescribed(equations)
        led = equations.led[:, None]
        bound = fixed | led
        moving = MovingBodies(equations, simulation) if isinstance(s.bodies, FreeBodies) else None
        of_rigid = equations.velocity_of_rigid
        if moving is not None:
            of_rigid = np.where(moving.nodes[:, None], moving.velocities, of_rigid)
        velocities = np.where(led, of_rigid, velocities)
        if self.moduli is None:
            self.moduli = equations.moduli()
        separate = isinstance(s.contact, SeparateFields)
        contact = Contact(equations, self.moduli.of_grids) if separate else None
        if not self.dynamic:
            self._check_held(equations, bound, contact, moving)
        if before is None:
            inertia: Rest | Motion = Rest(equations)
        else:
            inertia = Motion(equations, self.scheme, dt, before[nodes], bound, velocities, contact)
        tools = [fix for fix in simulation.hub.fixes.values() if fix.follows_points]
        pushing = [*([] if contact is None else [contact])]
        pushing += [PushingTool(fix, equations, simulation) for fix in tools]
        more = self.seconds, self.fixed_nodes
        newton = Newton(self.scheme, equations, ~bound, inertia, pushing, external, dt, *more)
        newton.scale(self.moduli, self.scheme.stabilisation)
        newton.seepage = Seepage(equations, dt) if is_wet(equations) else None
        newton.bodies = moving
        try:
            jump = np.where(bound, velocities * dt, 0.0)
            u, iterations, residual = newton.solve(jump, self._interrupted)
        except Loose as reason:
            where = ", ".join(f"{x:.4g}" for x in equations.positions[int(reason.at)])
            solid = self._solid_at(equations, np.arange(len(nodes)) == reason.at)
            raise Failed(
                f"{reason}: solid '{solid}' is not held near ({where}), or flows there without "
                "hardening"
            ) from None
        except Wrong as reason:
            raise Failed(f"{reason} (solid '{self._solid_of(int(reason.at))}')") from None
        update = simulation.hub.update
        if not self.dynamic and "unstable" not in update.warned_of and newton.unstable:
            update.first_time("unstable")
            simulation.hub.warn(
                f"{self._now()}: the equilibrium is unstable (the determinant of the stiffness "
                "is negative): the body can buckle, or is beyond a limit load",
                hint="add a small imperfection, or use scheme(newmark), to follow its motion",
            )
        release(newton.kept)
        self.cached = equations.cached()
        self.unknowns = int(np.count_nonzero(~bound))
        self.corrections += iterations
        reaction = newton.reaction(u)
        solution = newton.seepage, moving, u, fixed, reaction, iterations, residual
        return Equilibrium(equations, inertia, pushing, *solution)

    def _prescribed(self, equations: Equations) -> tuple[np.ndarray, np.ndarray]:
        holding = [f for f in self.simulation.fixes.acting if "post_update_grid_state" in f.hooks()]
        mask, velocities = equations.prescribed(holding, equations.d)
        if equations.per_node > equations.d:
            fixes = self.simulation.fixes.acting
            rotating = [f for f in fixes if "post_update_grid_rotation" in f.hooks()]
            pairs = (mask, velocities), equations.prescribed(rotating, 1)
            mask, velocities = (np.concatenate(two, axis=1) for two in zip(*pairs, strict=True))
        self._check_numbers(velocities, "a node gets a velocity that is not a number")
        if equations.s.kin.hoops:
            on_axis = equations.positions[:, 0] == 0
            mask[on_axis, 0], velocities[on_axis, 0] = True, 0.0
        return mask, velocities

    def _check_numbers(self, numbers: np.ndarray, message: str) -> None:
        if not np.all(np.isfinite(numbers)):
            hint = "look for a formula that returns NaN, such as a division by zero"
            trouble = no_number(self.simulation, message, hint)
            raise self._error(trouble.message, trouble.fix, trouble.mark)

    def _publish(self, result: "Equilibrium", hooks: Tag, dt: float) -> None:
        """Let fixes publish the reactions at their nodes, and set nodal velocities.

        A fix gets the velocities that its nodes would have without the fix. With rigid solids, a
        fix also gets contact and inertial forces.
        """
        simulation, s = self.simulation, result.equations.s
        d, nodes, update = result.equations.d, result.equations.nodes, s.nodes.update
        mass = result.equations.mass[:, None]
        v = result.u / dt
        around = field(s.nodes.fields, UpdateAround)
        if around is not None:
            inertia = field(s.nodes.fields, SumsAround)[nodes, :1]
            mass = np.concatenate([mass, mass, inertia], axis=1)
        bound = result.fixed & (mass > 0)
        without = np.where(bound, -result.reaction * dt / np.where(bound, mass, 1.0), 0.0)
        change = of_change(s.kin)
        update[nodes, :d] = (v + without)[:, :d]
        update[nodes, change : change + d] = without[:, :d]
        if around is not None:
            around[nodes] = np.stack([(v + without)[:, d], without[:, d]], axis=1)
        work = s.control.totals[WORK].copy()
        with simulation.steps.altered(kept=0.0):  # reactions contain the whole velocity change
            take_rows(self.scheme.hold, s, simulation.mode, hooks)
            if around is not None:
                take_rows((HELD,), s, simulation.mode, hooks)
        s.control.totals[WORK] = work
        add_to(s.control.totals, WORK, result.inertia.work(result.u, result.reaction))
        torque = field(s.nodes.fields, TorqueOfLoads)
        if torque is not None:
            add_to(s.control.totals, WORK, float(torque[nodes, 0] @ result.u[:, d]))
        carry(s.control.totals[WORK])
        update[nodes, :d] = s.nodes.velocity[nodes, :d] = v[:, :d]
        if around is not None:
            around[nodes, 0] = field(s.nodes.fields, AngularVelocity)[nodes, 0] = v[:, d]
            around[nodes, 1] = 0
        update[nodes, change : change + d] = 0
        for one in result.pushing:
            one.publish()
        if result.bodies is not None:
            result.bodies.finish(-result.reaction, s.control, s.blocks)
        if isinstance(s.contact, RigidBodies):
            forces = np.where(result.fixed, 0.0, -result.reaction)
            led = result.equations.led
            rigid, first = field(s.nodes.fields, RigidSums), of_force(s.kin)
            rigid[nodes[led], first : first + s.kin.dimension] = forces[led]
            take_rows(PUBLISH, s, simulation.mode, hooks)

    def _error(self, message: str, hint: str, mark: Mark | None = None) -> ScriptError:
        return ScriptError(
            f"{self._now()}: {message}", mark=mark or self.simulation.hub.mark, hint=hint
        )

    def _now(self) -> str:
        values = self.simulation.setup.control.values
        return f"step {int(values[TIMESTEP]) + 1}, time {float(values[TIME]):.6g}"

    def _check_held(
        self,
        equations: Equations,
        fixed: np.ndarray,
        contact: Contact | None,
        moving: MovingBodies | None,
    ) -> None:
        s = equations.s
        bodies = equations.bodies()
        motions = equations.rigid_motions
        for body in range(bodies.max() + 1):
            nodes = bodies == body
            rows = motions[nodes][fixed[nodes]]
            if fixed[nodes].all() or not motions.shape[2]:
                continue
            if contact is not None:
                rows = np.concatenate([rows, contact.constraints(motions, nodes)])
            if np.linalg.matrix_rank(rows) == motions.shape[2]:
                continue
            free = free_from(s.kin)
            constrained = fixed[nodes].any(0)[free : s.kin.dimension]
            loose = [x for x, h in zip("xyz"[free:], constrained, strict=False) if not h]
            how = f"is not held along {loose[0]}" if loose else "can rotate"
            how = how if len(rows) else "is held by nothing"
            raise self._loose(self._solid_at(equations, nodes), how)
        if moving and contact and (solids := moving.without_stiffness(contact)):
            raise self._error(
                f"rigid solids touch ({', '.join(solids)}), and have no stiffness between them",
                "an elastic material for one of them, or scheme(musl)",
            )
        if moving and contact and (unheld := moving.loose(contact)):
            how = f"is not held along {unheld[1]}" if len(unheld[1]) == 1 else "can rotate"
            raise self._error(
                f"solid '{unheld[0]}' {how}, and there is no inertia",
                f"fixed=({unheld[1]}) in fix rigid_body, contact from the start, with friction "
                "(fix contact/friction), or scheme(musl)",
            )

    def _loose(self, solid: str, how: str) -> ScriptError:
        return self._error(
            f"solid '{solid}' {how}, and there is no inertia",
            "fix velocity_nodes, or scheme(newmark) for bodies that move",
        )

    def refuse_all_loose(self) -> None:
        """Raise ScriptError before the first step if fixes hold no node near points."""
        s, bound = self.simulation.setup, np.any(self.fixed_nodes(), axis=1)
        rigid = any(can(block.laws, constrained_velocity) for block in s.blocks)
        can_move = free_from(s.kin) < s.kin.dimension
        moves = can_move and not (self.dynamic or rigid)
        if moves and not any(bound[a:b].any() for a, b in used(s.spans)[1:]):
            raise self._loose(next(iter(self.simulation.hub.solids)), "is held by nothing")

    def _solid_at(self, equations: Equations, chosen: np.ndarray) -> str:
        for block, (seen, _) in zip(equations.blocks, equations.parts, strict=True):
            points = np.flatnonzero(chosen[seen.nodes].any(1))
            if len(points):
                return self._solid_of(int(block.points.id[points[0]]))
        return ""

    def _solid_of(self, point: int) -> str:
        firsts = self.simulation.setup.control.firsts
        return list(self.simulation.hub.solids)[np.searchsorted(firsts, point, side="right") - 1]


class Equilibrium(NamedTuple):
    equations: Equations
    inertia: Rest | Motion
    pushing: list[Contact | PushingTool]
    seepage: Seepage | None
    bodies: MovingBodies | None
    u: np.ndarray
    fixed: np.ndarray  # mask of held components
    reaction: np.ndarray
    iterations: int
    residual: float


class ImplicitSimulation(Simulation):
    repeats_steps = False
    remedy = "smaller load steps (set_dt), or another tolerance, iterations or solver"
    implicit = True

    def __init__(self, hub: Hub, previous: Simulation | None = None):
        super().__init__(hub, previous)
        self.load_steps = LoadSteps(self)

    @property
    def failure(self) -> str:  # type: ignore[override]
        return self.load_steps.failure

    def refuse(self) -> None:
        self.load_steps.refuse_all_loose()

    def _take(self, hooks: Tag, count: int) -> int:
        return self.load_steps.advance(hooks, count)

    def compile(self) -> None:
        """Do nothing: Newton's method needs no compiled step."""
