"""Contact and joints between rigid bodies."""

from itertools import combinations
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from karamelo_py.language.arguments import NUMBER, look_up
from karamelo_py.language.rules import known_failure
from karamelo_py.language.signature import Argument, In, NonNegative, Positive
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.region import Region
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import Mark, ScriptError, plural, unknown
from karamelo_py.styles.fixes.formulas import judge_friction
from karamelo_py.styles.fixes.rigid_body import Components, RigidBody

KINDS = "hinge", "ball", "slider", "weld", "spring"


def _require_rigid(solid: Solid, mark: Mark | None) -> None:
    if not solid.rigid:
        raise ScriptError(
            f"solid '{solid.id}' deforms: its material '{solid.material.id}' is not rigid",
            mark=mark,
            expected="a solid of material rigid with a fix rigid_body, or a region",
            hint="fix contact/rigid_body is the contact of a rigid body with deformable solids",
        )


class Party(NamedTuple):
    """Script argument: a rigid solid, or a fixed region."""

    ID: str
    mark: Mark | None
    solid: Solid | None
    region: Region

    script_kind = "a rigid solid, or a region"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> "Party":
        ID, mark = argument.word() or argument.text, argument.mark
        solid = hub.solids.get(ID)
        if solid is None and ID not in hub.regions:
            rigid = (solid.id for solid in hub.solids.values() if solid.rigid)
            message = f"there is no solid and no region '{ID}'"
            hint = f"mu={ID}, restitution=..." if NUMBER.fullmatch(ID) else None
            raise unknown(message, ID, dict.fromkeys([*rigid, *hub.regions]), hint, mark=mark)
        region = look_up(hub.regions, argument) if solid is None else solid.region
        if solid is not None:
            _require_rigid(solid, mark)
        if region is None or region.flat or region.outline() is None:
            raise ScriptError(
                f"'{ID}' has no surface that the program can compute",
                mark=mark,
                expected="a block, cylinder, sphere, plane, closed STL surface or mesh, or some of "
                "these",
            )
        return cls(ID, mark, solid, region)


class ContactBodies(Fix):
    """Apply contact of rigid bodies with each other and with fixed regions, with friction.

    Parameters
    ----------
    first, second, more
        IDs of rigid solids, each with a fix rigid_body, and of fixed regions. Any two can collide.
    mu
        Coefficient of friction (Coulomb).
    restitution
        Normal relative speed after a collision divided by the speed before, from 0 to 1.

    Example
    -------
    fix(touch, contact/bodies, floor, box, ball, mu=0.4, restitution=0.2)

    Notes
    -----
    Publishes the force on the first solid or region as ID_x, ID_y, ID_z.

    The fix works in every method, together with contact with deformable solids. Stacks come to
    rest, even if a heavy body lies on light bodies. Momentum and angular momentum are conserved to
    round-off. No collision adds energy. Collisions in a step are resolved singly, fastest first.

    Disks and spheres are exact. Corners and edges of other shapes are rounded by balls of 0.05
    cells, in 3D one per cell along edges. A fixed region serves as a wall or a container, a body
    with motion=... as a moving wall. There is no contact between bodies that a joint connects.

    The cost of a step grows with the number of pairs, and with the cube of the number of moving
    bodies: use the fix for up to some tens of bodies.

    See Also
    --------
    rigid_body, joint, contact/rigid_body
    """

    syntax = "part, part[, part, ...][, mu=mu][, restitution=e]"
    published = ("x", "y", "z")
    for_method = exerts = links = True

    def __init__(
        self,
        hub: Hub,
        first: Party,
        second: Party,
        *more: Party,
        mu: Annotated[float, NonNegative] = 0.0,
        restitution: Annotated[float, In(0, 1)] = 0.0,
    ):
        super().__init__(hub)
        judge_friction(hub, mu)
        self.parts, self.mu, self.restitution = (first, second, *more), mu, restitution
        self.linked = [part.solid for part in self.parts]
        for k, part in enumerate(self.parts):
            if any(part.ID == other.ID for other in self.parts[:k]):
                message = f"'{part.ID}' is named twice"
                raise ScriptError(message, mark=part.mark, expected="each once")
        if all(part.solid is None for part in self.parts):
            message = "none of its parts moves: all are regions"
            raise ScriptError(message, argument="first", expected="a solid with a fix rigid_body")

    def defined(self) -> None:
        others = [fix for fix in contacts(self.hub) if fix is not self]
        pairs: dict[frozenset[str], Any] = {pair: fix for fix in others for pair in fix.pairs()}
        for pair in self.pairs():
            if pair in pairs:
                a, b = sorted(pair)
                other = pairs[pair]
                raise ScriptError(
                    f"fix '{other.id}' (line {other.mark.line}) is the contact of '{a}' with "
                    f"'{b}' already",
                    expected="each pair in only one fix",
                    mark=self.mark,
                    command="fix contact/bodies",
                )

    def pairs(self) -> set[frozenset[str]]:
        return {frozenset((a.ID, b.ID)) for a, b in combinations(self.parts, 2)}


class Joint(Fix):
    """Join two rigid bodies, or one to the ground, by a hinge, ball, slider, weld or spring.

    Parameters
    ----------
    kind
        hinge: rotation about an axis; ball: any rotation about a position (3D); slider: motion
        along an axis without rotation; weld: no relative motion; spring: a force along the line
        between two positions.
    first, second
        IDs of rigid solids, each with a fix rigid_body. Default for `second`: the ground.
    at
        Position of the joint, or of the spring's end in the first body. Default: its centre.
    end
        Position of the spring's end in the second body or the ground. Default: the body's centre.
    axis
        Direction of a hinge (in 3D) or slider, fixed in the first body.
    stiffness, damping, length
        For a spring: force per extension, force per speed of extension, and the unstretched length
        (default: the initial length).

    Example
    -------
    fix(pin, joint, hinge, arm, forearm, at=(0.5, 0.3))
    fix(rail, joint, slider, arm, axis=(1, 0))
    fix(coil, joint, spring, arm, end=(0, 1), stiffness=200)

    Notes
    -----
    Publishes the force on the first body as ID_x, ID_y, ID_z.

    A joint holds from the first step until delete_fix. Joints are solved together with all contacts
    of the bodies, so masses may have any ratio. While bodies rotate, a joint opens in each step by
    an error of second order in dt; the next step closes it.

    A spring is explicit and dissipates nothing up to a stiffness per unit mass of 1/dt^2; a stiffer
    one is implicit, with numerical damping. Damping is implicit.

    See Also
    --------
    rigid_body, contact/bodies
    """

    syntax = (
        "kind, solid[, solid][, at=(x, y, z)][, end=(x, y, z)][, axis=(x, y, z)]"
        "[, stiffness=k][, damping=c][, length=l]"
    )
    published = ("x", "y", "z")
    for_method = exerts = links = True

    def __init__(
        self,
        hub: Hub,
        kind: Annotated[str, Literal[KINDS]],
        first: Solid,
        second: Solid | None = None,
        *,
        at: Components | None = None,
        end: Components | None = None,
        axis: Components | None = None,
        stiffness: Annotated[float, Positive] | None = None,
        damping: Annotated[float, NonNegative] | None = None,
        length: Annotated[float, NonNegative] | None = None,
    ):
        super().__init__(hub)
        d = hub.require_domain().dimension
        self.kind, self.linked = kind, (first, second)
        for k, solid in enumerate(self.linked):
            if solid is not None and not solid.rigid:
                raise ScriptError(
                    f"solid '{solid.id}' deforms: its material '{solid.material.id}' is not rigid",
                    argument=("first", "second")[k],
                    expected="a solid of material rigid, with a fix rigid_body",
                )
        if first is second:
            raise ScriptError(
                f"'{first.id}' is named twice", argument="second", expected="another body"
            )
        if hub.update.step > 0:
            raise ScriptError(
                "bodies may have moved in earlier runs",
                argument="kind",
                expected="joints before the first run; delete_fix releases them",
            )
        self.spring = None if stiffness is None else (stiffness, damping or 0.0, length)
        if (kind == "ball" and d < 3) or (kind == "hinge" and d < 2):
            message = f"a {kind} needs a domain in {'3D' if kind == 'ball' else '2D or 3D'}"
            raise ScriptError(message, argument="kind", expected="hinge" if d == 2 else "weld")
        needed = {"hinge": "axis" if d == 3 else "", "slider": "axis", "spring": "stiffness"}
        further = {"spring": ("end", "damping", "length")}
        takes = (needed.get(kind), *further.get(kind, ()))
        options = {
            "axis": axis, "end": end, "stiffness": stiffness, "damping": damping, "length": length
        }  # fmt: skip
        for name, value in options.items():
            if name == needed.get(kind) and value is None:
                examples = {"axis": f"axis=({', '.join('001'[-d:])})", "stiffness": "stiffness=k"}
                message = f"a {kind} needs its {name}"
                raise ScriptError(message, argument="kind", expected=examples[name])
            if value is not None and name not in takes:
                message = f"{name} is not an argument of a {kind} in {d}D"
                raise ScriptError(message, argument=name, expected=f"a {kind} without {name}")
        if kind == "spring" and second is None and end is None:
            message = "a spring to the ground needs the position of its end there"
            raise ScriptError(message, argument="kind", expected="end=(...)")
        self.at, self.end = self._vector(at, d), self._vector(end, d)
        self.axis = self._vector(axis, d)
        if self.axis is not None and not np.linalg.norm(self.axis) > 0:
            raise ScriptError(
                "the axis has no length", argument="axis", expected="a direction that is not 0"
            )

    @staticmethod
    def _vector(components: Components | None, d: int) -> np.ndarray | None:
        if components is None:
            return None
        numbers = components.numbers()
        if len(numbers) != d:
            raise ScriptError(
                plural(len(numbers), "component"),
                mark=components.argument.mark,
                expected=f"{d} numbers",
            )
        return np.array([*numbers, 0.0, 0.0][:3])


def contacts(hub: Hub) -> list[ContactBodies]:
    return [fix for fix in hub.fixes.values() if isinstance(fix, ContactBodies)]


def joints(hub: Hub) -> list[Joint]:
    return [fix for fix in hub.fixes.values() if isinstance(fix, Joint)]


def _passed(fix: RigidBody, scene: Any) -> dict[str, str] | None:
    linked = {fix.body.id}
    for contact in contacts(fix.hub):
        names = [part.ID for part in contact.parts]
        linked |= set(names) if fix.body.id in names else set()
    for joint in joints(fix.hub):
        linked |= {s.id for s in joint.linked if s} if fix.body in joint.linked else set()
    others = [s.id for s in fix.hub.solids.values() if s.rigid and s.id not in linked]
    return {"others": ", ".join(others), "one": others[0]} if others else None


known_failure(
    RigidBody,
    "body '{part.body.id}' and rigid solids",
    when=_passed,
    reason="it passes through other rigid solids: {others}",
    cure="fix(ID, contact/bodies, {part.body.id}, {one}, mu=0.3)",
)
