"""Compute force_on: force, torque and point of action, on a solid or of fixes."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.language.rules import FLAT, Restrictions
from karamelo_py.language.signature import Argument
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Compute
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import Mark, ScriptError
from karamelo_py.styles.methods.base import LOADS

AXES = "x", "y", "z"


class Acting(NamedTuple):
    ID: str
    mark: Mark | None
    solid: Solid | None  # None: a fix

    script_kind = "a solid, or a fix that exerts a force"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> "Acting":
        ID = argument.word() or argument.text
        fix, solid = hub.fixes.get(ID), hub.solids.get(ID)
        if fix is not None and solid is not None:
            message = f"'{ID}' is a solid (line {solid.mark.line}) and a fix (line {fix.mark.line})"
            raise ScriptError(message, mark=argument.mark, expected="another ID for the fix")
        if fix is None and solid is None:
            candidates = ", ".join([*hub.solids, *(f for f in hub.fixes if hub.fixes[f].exerts)])
            message = f"there is no solid and no fix '{ID}'"
            raise ScriptError(message, mark=argument.mark, expected=candidates or cls.script_kind)
        if fix is not None and not fix.exerts:
            raise ScriptError(
                f"fix '{ID}' ({fix.style}) publishes no force with a torque",
                mark=argument.mark,
                expected=f"the solid '{fix.moves.id}'" if fix.moves else cls.script_kind,
            )
        return cls(ID, argument.mark, solid)


class Summand(NamedTuple):
    """A published force, and the names of its torque about the origin."""

    force: str  # ID of ID_x, ID_y, ID_z
    sign: float = 1.0
    of_second: bool = False  # True: torque on the second of two solids
    of_method: bool = False


class ForceOn(Compute):
    """Measure the force on a solid, or exerted by fixes, with its torque and point of action.

    Parameters
    ----------
    part, more
        IDs of solids or fixes; the forces of several are added. For a solid: the contact force that
        other solids, rigid bodies, tools and surfaces exert on it. For a fix: its force on the
        points or nodes of its group.
    x, y, z
        Position about which the torque is taken.

    Example
    -------
    fix(clamp, velocity_nodes, left, 0, 0)
    fix(pull, force_particles, tip, 0, -100)
    compute(F, force_on, clamp, pull, x=0.5)
    log_modify(custom, time, F_x, F_tz, F_py)

    Notes
    -----
    Publishes the force ID_x, ID_y, ID_z, the torque ID_tx, ID_ty, ID_tz, and the point of action
    ID_px, ID_py, ID_pz; in 2D only ID_x, ID_y, ID_tz, ID_px and ID_py. The force on a wall, tool or
    surface is the opposite of the force of its fix.

    The point of action is the point of the line of action closest to (x, y, z). In 3D the line of
    action is the central axis, about which a torque may remain. If (x, y, z) is the origin, the
    line meets y = 0 at x = ID_tz/ID_y.

    Walls (fix velocity_nodes), loads and weight are included only if their fixes are named. Lever
    arms are taken at the beginning of the step, from the present positions of points and the grid
    positions of nodes (initial positions in tlmpm). In load steps, torques have errors of the order
    of the displacement in a step.

    The fixes may be velocity_nodes, velocity_particles, body_force, force_nodes, force_particles,
    edge_traction, edge_pressure, neumann_bc_mech, absorbing, local_damping, contact/..., indent and
    other tools. Define them before this compute. Friction of contact/minimize_penetration acts
    between the centres of points, so the torques on the two solids are not quite opposite. The
    torque of velocity_particles omits the angular momentum that affine transfers store in points.

    See Also
    --------
    reaction, fix velocity_nodes, fix contact/surface, method ulmpm/contacts
    """

    syntax = "part[, part, ...][, x=x][, y=y][, z=z]"
    published: tuple[str, ...] = (*AXES, *("t" + axis for axis in AXES), *("p" + a for a in AXES))
    restrictions = Restrictions(
        "force_on", "no compute force_on", only={"kinematics": FLAT}, without=("gpu", "periodic")
    )
    group = None  # type: ignore[assignment]

    def __init__(
        self,
        hub: Hub,
        part: Acting,
        *more: Acting,
        x: float = 0.0,
        y: float = 0.0,
        z: float = 0.0,
    ):
        self.hub, self.parts = hub, (part, *more)
        self.about = np.array([x, y, z])
        d = hub.require_domain().dimension
        turning = {1: (), 2: ("tz",), 3: ("tx", "ty", "tz")}[d]
        self.published = (*AXES[:d], *turning, *(f"p{axis}" for axis in AXES[:d]))
        self.loads = self._loads()
        for load in self.loads:
            if not load.of_method:
                hub.values.publish_torque(load.force)

    def refresh(self) -> None:
        if self._loads() != self.loads:
            raise ScriptError(
                "fixes that act on its solid have been defined or deleted since",
                mark=self.mark,
                expected="compute force_on after all fixes of contact",
                hint=f"delete_compute({self.id}), and this line again",
            )
        total, values = np.zeros(6), self.hub.values
        for load in self.loads:
            names = [load.force, load.force]
            if load.of_method:
                names = [f"{kind}_{load.force}" for kind in LOADS]
            elif load.force not in self.hub.fixes:
                continue  # the fix has been deleted
            of = [f"{names[0]}_{axis}" for axis in AXES]
            pushes = [values.get(name) if name in values else 0.0 for name in of]
            if load.of_method:
                turns = np.array([values.get(f"{names[1]}_{axis}") for axis in AXES])
            else:
                turns = values.torque_of(load.force)[3 * load.of_second :][:3]
            total[:3] += load.sign * np.array(pushes)
            total[3:] += turns
        force, torque = total[:3], total[3:] - np.cross(self.about, total[:3])
        square = float(np.dot(force, force))
        arm = np.cross(force, torque) / square if square > 0 else 0.0
        numbers = [*force, *torque, *(self.about + arm)]
        everything = dict(zip(ForceOn.published, numbers, strict=True))
        for name in self.published:
            self.publish(name, everything[name])

    def _loads(self) -> list[Summand]:
        loads: list[Summand] = []
        for part in self.parts:
            one = part.solid
            for load in [Summand(part.ID)] if one is None else self._on(one, part.mark):
                if load in loads:
                    message = f"the force of '{load.force}' would count twice"
                    raise ScriptError(message, mark=part.mark, expected="each once")
                loads.append(load)
        return loads

    def _on(self, solid: Solid, mark: Mark | None) -> Iterator[Summand]:
        count = 0
        for load in self._of_contact(solid, mark):
            count += 1
            yield load
        if count:
            return
        others = [s.id for s in self.hub.solids.values() if s is not solid]
        reason = "no fix of contact acts on it"
        if others and not self.hub.update.method.own_grids:
            reason = f"{', '.join([solid.id, *others])} have the same nodes"
        raise ScriptError(
            f"the contact force on solid '{solid.id}' is unknown: {reason}",
            mark=mark,
            expected="method(ulmpm/contacts, ...), a fix of contact in a line before, or the fixes "
            "that act on it instead",
        )

    def _of_contact(self, solid: Solid, mark: Mark | None) -> Iterator[Summand]:
        if f"{LOADS[0]}_{solid.id}_x" in self.hub.values:
            yield Summand(solid.id, of_method=True)
        for fix in self.hub.fixes.values():
            if not fix.exerts:
                continue
            if solid in fix.solids and fix.friction is None:
                first = fix.solids[0] is solid
                yield Summand(fix.id, 1.0 if first else -1.0, of_second=not first)
            elif fix.presses and self._acts_on(fix, solid, mark):
                yield Summand(fix.id)

    def _acts_on(self, fix: Any, solid: Solid, mark: Mark | None) -> bool:
        soft = [s for s in self.hub.solids.values() if not s.rigid]
        touched = [s.id for s in soft if fix.group.touches(s)]
        if solid.id not in touched:
            return False
        if len(touched) > 1:
            raise ScriptError(
                f"fix '{fix.id}' (line {fix.mark.line}) acts on {', '.join(touched)}, and its "
                "force is their sum",
                mark=mark,
                expected=f"a fix {fix.style} for each solid",
                hint=f"compute(F, force_on, {fix.id}) measures the force on all of them",
            )
        return True
