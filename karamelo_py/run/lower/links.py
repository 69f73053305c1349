"""Contacts and joints between rigid bodies."""

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations, product

import numpy as np

from karamelo_py.kernels import rigid_links as kernel
from karamelo_py.kernels import rigid_motion as motion
from karamelo_py.kernels.arrays import Tag
from karamelo_py.kernels.surfaces import Convex, HalfSpace, Outside, Surface
from karamelo_py.points.laws import law_kind
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.region import Region
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.fixes.rigid_body import RigidBody
from karamelo_py.styles.fixes.rigid_links import ContactBodies, Joint, contacts, joints

ROUNDED = 0.05  # radius of balls in corners, in cells
BLUNT = 0.95  # cosine between normals of faces above which the edge between them needs no balls
MOST = 20_000  # largest number of contacts at a time
OVERLAP = 0.1  # cells by which bodies may overlap at the start


def lower_links(hub: Hub, moving: Sequence[RigidBody]) -> kernel.NoLinks | kernel.Links:
    touching, joined = contacts(hub), joints(hub)
    if not touching and not joined:
        return kernel.NoLinks()
    count = len(moving)
    of_solid = {fix.body: n for n, fix in enumerate(moving)}
    for fix in (*touching, *joined):
        _refuse(fix, moving)
    states, constants = (
        motion.records(motion.STATE, count + 1),
        motion.records(motion.CONSTANTS, count + 1),
    )
    for n, fix in enumerate(moving):
        states[n], constants[n] = fix.state[0], fix.constants[0]
    states[count].R[:] = np.eye(3)
    constants[count].bound = np.inf
    free = np.full((count + 1, 6), -1, np.int64)
    ways = np.array([fix.dofs for fix in moving]) > 0
    free[:count][ways] = np.arange(ways.sum())
    touches: list[kernel.Meeting] = []
    apart = [set(joint.linked) for joint in joined]
    for fix in touching:
        parts = [
            kernel.LinkedPart(of_solid.get(part.solid, count), part.region.outline(),
                        balls_of(part.region, hub.domain.h))
            for part in fix.parts
        ]  # fmt: skip
        slot = hub.values.slot(f"{fix.id}_x")
        for a, b in permutations(range(len(parts)), 2):
            one, other = parts[a], parts[b]
            still = not (free[[one.body, other.body]] >= 0).any()
            twice = _is_ball(one.shape) and _is_ball(other.shape) and a > b
            if still or twice or {fix.parts[a].solid, fix.parts[b].solid} in apart:
                one = one._replace(balls=one.balls[:0])  # no balls, but the same kernel
            sign = 1 if a == 0 else -1 if b == 0 else 0
            slots = np.array([slot, int(hub.values.torques[slot]), sign])
            touch = kernel.Meeting(one, other, np.array([fix.mu, fix.restitution]), slots)
            if hub.update.step == 0 and len(one.balls):
                _refuse_overlap(hub, fix, (a, b), touch, (states, constants))
            touches.append(touch)
    rows = sum(len(touch.first.balls) for touch in touches)
    m = int(ways.sum())
    published = [hub.values.slot(f"{fix.id}_x") for fix in (*touching, *joined)]
    return kernel.Links(
        _by_kind(touches), _joints(hub, joined, of_solid, constants),
        np.array([(slot, int(hub.values.torques[slot])) for slot in published]),
        motion.records(kernel.LINK, min(rows, MOST) + 2 * len(joined)),
        np.zeros(1, np.int64), np.zeros(1),
        states, constants, free, *(np.zeros((count + 1, 6)) for _ in range(7)),
        np.zeros((count + 1, 6, 6)), np.zeros((m, m + 1)), np.zeros((2, 3, 6)), np.zeros((3, 4)),
    )  # fmt: skip


def _by_kind(touches: Sequence[kernel.Meeting]) -> tuple[tuple[kernel.Meeting, ...], ...]:
    """Group meetings by the kinds of their shapes, as kernels loop over alike ones."""
    groups: dict[tuple, list[kernel.Meeting]] = {}
    for touch in touches:
        groups.setdefault(law_kind(touch), []).append(touch)
    return tuple(map(tuple, groups.values()))


def _refuse(fix: ContactBodies | Joint, moving: Sequence[RigidBody]) -> None:
    bodies = {body.body: body for body in moving}
    for solid in fix.linked:
        if solid is not None and solid not in bodies:
            hint = f"fix(ID, rigid_body, {solid.id}, ...); motion=(0, 0) holds it"
            raise refusal(fix, f"solid '{solid.id}' has no fix rigid_body", hint)
    if not any(bodies[solid].dofs.any() for solid in fix.linked if solid is not None):
        raise refusal(fix, "none of its bodies moves freely", "a body without motion= and fixed=")


def _refuse_overlap(
    hub: Hub, fix: ContactBodies, which: tuple[int, int], touch: kernel.Meeting, at: tuple
) -> None:
    states, constants = at
    (a, b), d = which, hub.domain.dimension
    first, second = touch.first.body, touch.second.body
    x = touch.first.balls[:, :3] - constants[first].start
    x = x @ states[first].R.T + states[first].x - states[second].x
    x = x @ states[second].R + constants[second].start
    reach = hub.domain.h + touch.first.balls[:, 3].max()
    depth = fix.parts[b].region.depth(x[:, :d], reach) + touch.first.balls[:, 3]
    if depth.max() > OVERLAP * hub.domain.h:
        names = f"'{fix.parts[a].ID}' and '{fix.parts[b].ID}'"
        raise refusal(
            fix, f"{names} overlap by {depth.max():.3g} at the start", "a gap between them"
        )


def _joints(
    hub: Hub, joined: Sequence[Joint], of_solid: dict, constants: np.recarray
) -> np.ndarray:
    records = motion.records(kernel.JOINT, len(joined))
    for record, joint in zip(records, joined, strict=True):
        first, second = (of_solid.get(solid, len(of_solid)) for solid in joint.linked)
        record.first, record.second = first, second
        spring = joint.spring is not None
        record.at = constants[first].start if joint.at is None else joint.at
        record.end = record.at
        if spring:
            record.end = constants[second].start if joint.end is None else joint.end
            record.spring, (record.stiffness, record.damping, length) = 1, joint.spring
            record.length = np.linalg.norm(record.at - record.end) if length is None else length
        axis = np.array([0.0, 0.0, 1.0] if joint.axis is None else joint.axis)
        axis /= np.linalg.norm(axis)
        aside = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
        aside /= np.linalg.norm(aside)
        record.axes[:] = axis, aside, np.cross(axis, aside)
        record.holds[:] = {
            "ball": (1, 1, 1, 0, 0, 0),
            "hinge": (1, 1, 1, 0, 1, 1),
            "slider": (0, 1, 1, 1, 1, 1),
        }.get(joint.kind, (1, 1, 1, 1, 1, 1))
        record.slot = hub.values.slot(f"{joint.id}_x")
        record.torque = hub.values.torques[record.slot]
    return records


def refusal(fix: Fix, message: str, hint: str) -> ScriptError:
    return ScriptError(message, mark=fix.mark, hint=hint, command=f"fix {fix.style}")


def _is_ball(shape: Tag) -> bool:
    return isinstance(shape, Convex) and bool(shape.across.all())


def balls_of(region: Region, h: float) -> np.ndarray:
    """Return balls (n, 4), centre and radius, that touch the surface of `region` from inside.

    A disk or sphere is one ball. In other shapes, small balls are placed in convex corners and, in
    3D, at intervals of a cell along edges and on round faces.
    """
    d, shape = region.dimension, region.outline()
    if _is_ball(shape):
        return np.array([[*shape.centre, 0.0, 0.0][:3] + [shape.radius]])
    size = (region.box_hi - region.box_lo)[:d]
    radius = min(ROUNDED * h, 0.02 * size.min())
    around: list[np.ndarray] = [np.empty((0, d))]
    planes = list(_planes(shape, 1.0))
    lo, hi = region.lo[:d], region.hi[:d]
    for count in range(max(d - 1, 1), d + 1):
        for some in combinations(planes, count):
            normals = np.array([plane[:d] for plane in some])
            if np.linalg.matrix_rank(normals, 1e-6) < count:
                continue
            inwards = np.linalg.pinv(normals)
            corner = inwards @ np.array([plane[d] for plane in some])
            corner = corner - radius * inwards @ np.ones(count)
            if count == d:
                around.append(corner[None])
            elif d == 3:
                around.append(_along_edge(corner, normals, (lo, hi), h))
    around += [*_on_round_faces(shape, (lo, hi), radius, h)]
    around += [_in_corners_of(faces, radius, h) for faces in _faces(shape)]
    x = np.concatenate(around)
    inside = ((x > lo - h) & (x < hi + h)).all(axis=1)
    x = np.unique(np.round(x[inside], 12), axis=0)
    depth = region.depth(x, 2 * radius) if len(x) else np.empty(0)
    fits = (depth > 0.3 * radius) & (depth < 1.001 * radius)
    balls = np.zeros((int(fits.sum()), 4))
    balls[:, :d], balls[:, 3] = x[fits], depth[fits]
    return balls


def _planes(shape: Tag, sign: float) -> Iterator[np.ndarray]:
    """Yield plane faces (d + 1,): the outward normal n, and n . x for positions x on the face."""
    if isinstance(shape, Outside):
        yield from _planes(shape.inner, -sign)
    elif isinstance(shape, Convex):
        yield from -sign * shape.planes
    elif isinstance(shape, HalfSpace):
        yield -sign * np.append(shape.normal, shape.offset)
    elif not isinstance(shape, Surface):
        for part in shape.parts:
            yield from _planes(part, sign)


def _along_edge(
    corner: np.ndarray, normals: np.ndarray, box: tuple[np.ndarray, np.ndarray], h: float
) -> np.ndarray:
    way = np.cross(*normals)
    way /= np.linalg.norm(way)
    ends = np.array([way @ np.array(end) for end in product(*zip(*box, strict=True))])
    first, last = ends.min() - way @ corner, ends.max() - way @ corner
    places = np.linspace(first, last, max(2, int(np.ceil((last - first) / h)) + 1))
    return corner + places[:, None] * way


def _on_round_faces(
    shape: Tag, box: tuple[np.ndarray, np.ndarray], radius: float, h: float
) -> Iterator[np.ndarray]:
    if isinstance(shape, Convex) and np.isfinite(shape.radius):
        R, d, across = shape.radius - radius, len(shape.centre), np.flatnonzero(shape.across)
        count = max(16, int(np.ceil(2 * np.pi * R / h)))
        angle = 2 * np.pi * np.arange(count) / count
        way = np.stack([np.cos(angle), np.sin(angle)], 1)
        if len(across) == 2:
            x = np.zeros((count, d))
            x[:, across] = shape.centre[across] + R * way
            if d == 2:
                yield x
                return
            (axis,) = np.flatnonzero(shape.across == 0)
            lo, hi = box[0][axis] + radius, box[1][axis] - radius
            for z in np.linspace(lo, hi, max(2, int(np.ceil((hi - lo) / h)) + 1)):
                x[:, axis] = z
                yield x.copy()
        elif len(across) == 3:
            z = np.cos(np.pi * (np.arange(count // 2) + 0.5) / (count // 2))
            for height in z:
                aside = np.sqrt(1 - height**2) * way
                yield shape.centre + R * np.column_stack([aside, np.full(count, height)])
    elif not isinstance(shape, (Convex, HalfSpace, Surface, Outside)):
        for part in shape.parts:
            yield from _on_round_faces(part, box, radius, h)


def _faces(shape: Tag) -> Iterator[np.ndarray]:
    if isinstance(shape, Surface):
        yield shape.faces
    elif isinstance(shape, Outside):
        yield from _faces(shape.inner)
    elif not isinstance(shape, (Convex, HalfSpace)):
        for part in shape.parts:
            yield from _faces(part)


def _in_corners_of(faces: np.ndarray, radius: float, h: float) -> np.ndarray:
    """Return ball centres below the corners of `faces` (m, d, d); in 3D, below sharp edges."""
    m, d = len(faces), faces.shape[2]
    side = faces[:, 1:] - faces[:, :1]
    normals = (
        np.cross(side[:, 0], side[:, 1]) if d == 3 else np.stack([side[:, 0, 1], -side[:, 0, 0]], 1)
    )
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    corners, which = np.unique(np.round(faces.reshape(-1, d), 9), axis=0, return_inverse=True)
    which = which.reshape(m, d)
    of_corner: list[list[int]] = [[] for _ in corners]
    for face, some in enumerate(which):
        for corner in some:
            of_corner[corner].append(face)
    x = [
        _below(corner, normals[some], radius)
        for corner, some in zip(corners, of_corner, strict=True)
    ]
    edges: dict[tuple[int, int], list[int]] = {}
    for face, some in enumerate(which if d == 3 else ()):
        for k in range(3):
            a, b = sorted((int(some[k]), int(some[(k + 1) % 3])))
            edges.setdefault((a, b), []).append(face)
    for (a, b), two in edges.items():
        length = np.linalg.norm(corners[b] - corners[a])
        if len(two) == 2 and normals[two[0]] @ normals[two[1]] < BLUNT:
            for part in np.arange(1, np.ceil(length / h)) / np.ceil(length / h):
                x.append(
                    _below(corners[a] + part * (corners[b] - corners[a]), normals[two], radius)
                )
    return np.array(x)


def _below(corner: np.ndarray, normals: np.ndarray, radius: float) -> np.ndarray:
    return corner - radius * np.linalg.pinv(normals, 1e-6) @ np.ones(len(normals))
