"""Contacts and joints between rigid bodies, solved together with all other loads.

A link connects two bodies at a position. U_a and U_b are their velocities (v, omega), and r = A U_a
- B U_b, with 3 x 6 matrices A and B, is their relative velocity there. The impulse p acts on the
first body and -p on the second, so momentum and angular momentum are conserved to round-off. p
depends on the velocities at the end of the step, like a stiff damper (`SOFT` is the fraction of an
approach that remains)::

    contact:  p_n = max(-(n . r + g / dt), 0) / (SOFT w_n), p_t = -r_t / (SOFT w_t), at most mu p_n
    joint:    p_k = -(e_k . r + c_k / dt) / (SOFT w_k), for each direction e_k that it holds

where g is the gap, c the displacement of the joint from its fixed position, and w the velocity
change per impulse. Newton's method finds the velocities of all bodies together, including their
contacts with material points.

Collisions come first and use the velocities before the forces of the step, so bodies at rest do not
bounce (Guendelman, Bridson & Fedkiw 2003, "Nonconvex rigid bodies with stacking"). The fastest
approach is resolved first, so an impulse travels through a row of touching balls.

Contacts are found between the surface of one body and balls in the other: a whole disk or sphere,
or small balls that round corners and edges.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import noinline, point_function
from karamelo_py.kernels import arrays
from karamelo_py.kernels import rigid_motion as motion
from karamelo_py.kernels.surfaces import (
    Common,
    Convex,
    HalfSpace,
    Joined,
    Outside,
    Surface,
    distance,
    encloses,
    nearest,
)

SOFT = 1e-5
GIVEN_BACK = 0.1  # fraction of a penetration that is removed per step
SOLVED, GOOD_ENOUGH = 1e-18, 1e-14  # residual / momentum, both as sums of p^2 / m
SEARCHES, NEAR_MINIMUM = 40, 0.1  # line search: evaluations, final slope / initial slope
SLOW = 1e-9  # collisions slower than this fraction of the fastest are ignored
COLLISIONS = 50  # largest number per contact
CONTACT, HOLD, HOLD_ROTATION = range(3)
_NUMBER, _VECTOR, _MATRIX = (np.float64,), (np.float64, 3), (np.float64, (3, 3))
LINK = np.dtype([
    ("kind", np.int64), ("first", np.int64), ("second", np.int64),  # indices of the bodies
    ("at", *_VECTOR), ("ways", *_MATRIX),  # a contact's first direction is its normal
    ("gap", *_NUMBER), ("mu", *_NUMBER), ("restitution", *_NUMBER),
    ("stiff", *_VECTOR), ("bias", *_VECTOR),  # by direction
    ("constant", *_NUMBER),  # impulse along the first direction
    ("impulse", *_VECTOR), ("hit", *_VECTOR),  # impulse on the first body; part due to collisions
    ("slip", *_VECTOR), ("speed", *_NUMBER), ("push", *_NUMBER), ("rub", *_NUMBER),
    ("bound", *_NUMBER), ("most", *_NUMBER),  # largest friction; prescribed bound of friction
    ("slot", np.int64), ("torque", np.int64),  # indices of published force, torque; torque 0: none
    ("sign", *_NUMBER),  # 1 if the slots are of the first body, -1 of the second
])  # fmt: skip
JOINT = np.dtype([
    ("first", np.int64), ("second", np.int64),
    ("at", *_VECTOR), ("end", *_VECTOR),  # initial positions in the first and second body
    ("axes", *_MATRIX),  # initial axes, as rows
    ("holds", np.int64, 6),  # 1 if held: displacement along each axis, then rotation about each
    ("spring", np.int64), ("stiffness", *_NUMBER), ("damping", *_NUMBER), ("length", *_NUMBER),
    ("slot", np.int64), ("torque", np.int64),
])  # fmt: skip


class LinkedPart(NamedTuple):
    """A body, or a fixed region, that can touch other bodies."""

    body: int  # index of the body; the last body is fixed
    shape: arrays.Tag
    balls: np.ndarray  # (n, 4) initial centres, radii


class Meeting(NamedTuple):
    """Balls of one part that may touch the surface of another."""

    first: LinkedPart
    second: LinkedPart
    numbers: np.ndarray  # (2,) mu, restitution
    slots: np.ndarray  # (3,) indices of force, of torque; 1: on the first part, -1: on the second


class NoLinks(NamedTuple):
    pass


class Links(NamedTuple):
    """Links, and the state of B bodies and one fixed body."""

    touches: tuple[tuple[Meeting, ...], ...]  # by the kinds of their shapes
    joints: np.ndarray  # (k,) JOINT
    published: np.ndarray  # (k, 2) indices of published forces and torques
    rows: np.ndarray  # (n,) LINK
    count: np.ndarray  # (1,) int64
    dt: np.ndarray  # (1,)
    states: np.ndarray  # (B + 1,) motion.STATE: x, R
    constants: np.ndarray  # (B + 1,) motion.CONSTANTS of the bodies: start, bound
    free: np.ndarray  # (B + 1, 6) int64: index of the unknown, or -1
    u: np.ndarray  # (B + 1, 6) velocities at the end of the step
    old: np.ndarray  # velocities before the step
    jump: np.ndarray  # velocity change due to collisions
    trial: np.ndarray
    rest: np.ndarray
    trial_rest: np.ndarray
    impulses: np.ndarray  # (B + 1, 6) sums of the impulses of links
    inverse: np.ndarray  # (B + 1, 6, 6) inverse mass matrix, 0 where prescribed
    slope: np.ndarray  # (m, m + 1) matrix of the Newton step, right-hand side in the last column
    jacobian: np.ndarray  # (2, 3, 6): A and B of the present link
    weight: np.ndarray  # (3, 4): A M^-1 A^T + B M^-1 B^T, right-hand side last


@point_function()
def closest(shape, kin, x, reach):
    """Return the depth of `x` in a shape and the outward unit direction (d,), 0 beyond `reach`."""


@closest.on(Convex)
def _closest_on_convex(shape, kin, x, reach):
    arm = x._make([shape.across[c] * (x[c] - shape.centre[c]) for c in range(kin.dimension)])
    radial = sqrt(arm.squared())
    least, out = shape.radius - radial, (1 / radial if radial > 0 else 0.0) * arm
    square = min(least, 0.0) ** 2
    way = max(-least, 0.0) * out
    for i in range(shape.planes.shape[0]):
        normal = x._make([shape.planes[i, c] for c in range(kin.dimension)])
        below = -shape.planes[i, kin.dimension]
        for c in range(kin.dimension):
            below += normal[c] * x[c]
        if below < least:
            least, out = below, -normal
        if below < 0:
            square += below * below
            way = way + below * normal
    if square > 0:  # axes of planes are orthogonal
        least, out = -sqrt(square), 1 / sqrt(square) * way
    return least, out


@closest.on(HalfSpace)
def _closest_on_plane(shape, kin, x, reach):
    height = -shape.offset
    for c in range(kin.dimension):
        height += shape.normal[c] * x[c]
    return height, x._make([-shape.normal[c] for c in range(kin.dimension)])


@closest.on(Surface)
def _closest_on_faces(shape, kin, x, reach):
    away = distance(shape, kin, x, reach)
    if away >= reach or away == 0:
        return -away, x - x
    way = x - nearest(kin, shape, x, 1.001 * away)
    sign = 1.0 if encloses(kin, shape, x) else -1.0
    return sign * away, -sign / away * way


@closest.on(Outside)
def _closest_outside(shape, kin, x, reach):
    within, out = closest(shape.inner, kin, x, reach)
    return -within, -out


@closest.on(Joined)
@closest.on(Common)
def _closest_of_parts(shape, kin, x, reach):
    sign = 1.0 if isinstance(shape, Joined) else -1.0
    within, out = closest(shape.parts[0], kin, x, reach)
    for member in shape.parts[1:]:
        other, way = closest(member, kin, x, reach)
        if sign * (other - within) > 0:
            within, out = other, way
    return within, out


@noinline
def _set_jacobians(links, link):
    for side in range(2):
        body = link.first if side == 0 else link.second
        A, x, centre = links.jacobian[side], link.at, links.states[body].x
        A[:] = 0.0
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            if link.kind == HOLD_ROTATION:
                A[k, 3 + k] = 1.0
            else:
                A[k, k] = 1.0
                A[k, 3 + i], A[k, 3 + j] = x[j] - centre[j], centre[i] - x[i]


@noinline
def _relative(links, link, u, k):
    """Return component `k` of A U_a - B U_b."""
    A, B, r = links.jacobian[0], links.jacobian[1], 0.0
    for c in range(6):
        r += A[k, c] * u[link.first, c] - B[k, c] * u[link.second, c]
    return r


@noinline
def _set_weight(links, link):
    """Set W = A M^-1 A^T + B M^-1 B^T, the change of relative velocity per impulse."""
    W, (sides, rows, columns) = links.weight, links.jacobian.shape  # loops are not unrolled
    for k in range(rows):
        for j in range(rows):
            total = 0.0
            for side in range(sides):
                A = links.jacobian[side]
                inverse = links.inverse[link.first if side == 0 else link.second]
                for a in range(columns):
                    for b in range(columns if A[k, a] != 0 else 0):
                        total += A[k, a] * inverse[a, b] * A[j, b]
            W[k, j] = total


@noinline
def _along(links, a, b):
    """Return a . W b for vectors (3,)."""
    total = 0.0
    for k in range(3):
        for j in range(3):
            total += a[k] * links.weight[k, j] * b[j]
    return total


@noinline
def _give(links, link, p, into, by_mass):
    """Add impulse `p` of a link to (B + 1, 6) impulses, or its velocity changes if `by_mass`."""
    sides, rows, columns = links.jacobian.shape
    for side in range(sides):
        A, body = links.jacobian[side], link.first if side == 0 else link.second
        sign = 1.0 if side == 0 else -1.0
        for a in range(columns):
            for k in range(rows):
                if by_mass:
                    for b in range(columns):
                        into[body, a] += sign * links.inverse[body, a, b] * A[k, b] * p[k]
                else:
                    into[body, a] += sign * A[k, a] * p[k]


@noinline
def _begin(links, body, k):
    state, work, inverse = body.state[0], body.solution, links.inverse[k]
    links.states[k].x[:], links.states[k].R[:] = state.x, state.R
    links.old[k, :3], links.old[k, 3:] = state.v, state.spin
    links.u[k] = work.u
    J, size = work.slope, work.slope.shape[0]
    for c in range(size):
        for a in range(size):
            for b in range(size):
                both = body.dofs[a] and body.dofs[b]
                J[a, b] = work.mass[a, b] if both else (1.0 if a == b else 0.0)
            J[a, 6] = 1.0 if a == c and body.dofs[a] else 0.0
        motion.solve_system(J)
        inverse[:, c] = J[:, 6]


@noinline
def _speed(links, body):
    u = links.u[body]
    spin = sqrt(u[3] ** 2 + u[4] ** 2 + u[5] ** 2)
    # The fixed body has an infinite bound.
    return sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2) + (
        spin * links.constants[body].bound if spin > 0 else 0.0
    )


@noinline
def _apart(links, a, b):
    """Return the distance between the spheres about two bodies; negative if they overlap."""
    x, y, square = links.states[a].x, links.states[b].x, 0.0
    for c in range(3):
        square += (x[c] - y[c]) ** 2
    return sqrt(square) - links.constants[a].bound - links.constants[b].bound


@noinline
def _list_touch(links, touch, kin, dt):
    a, b, d = touch.first.body, touch.second.body, kin.dimension
    reach = 2 * dt * (_speed(links, a) + _speed(links, b)) + 1e-6 * links.constants[a].bound
    if _apart(links, a, b) > reach:
        return
    balls, x, y = touch.first.balls, links.states[a].x, links.states[b].x
    begin, origin = links.constants[a].start, links.constants[b].start
    for i in range(balls.shape[0]):
        arm = [balls[i, c] - begin[c] for c in range(3)]
        way = motion.from_start(links.states[a], (arm[0], arm[1], arm[2]))
        radius, away = balls[i, 3], [way[c] + x[c] - y[c] for c in range(3)]
        far = links.constants[b].bound + radius + reach
        if away[0] ** 2 + away[1] ** 2 + away[2] ** 2 > far * far:
            continue
        local = motion.to_start(links.states[b], (away[0], away[1], away[2]))
        position = kin.Vector._make([local[c] + origin[c] for c in range(d)])
        within, out = closest(touch.second.shape, kin, position, reach + radius)
        gap = -within - radius
        if gap >= reach or out.squared() == 0 or links.count[0] == links.rows.size:
            continue
        way = [out[c] if c < d else 0.0 for c in range(3)]
        normal = motion.from_start(links.states[b], (way[0], way[1], way[2]))
        link = links.rows[links.count[0]]
        link.kind, link.first, link.second, link.gap = CONTACT, a, b, gap
        link.hit[:] = 0.0
        link.mu, link.restitution = touch.numbers[0], touch.numbers[1]
        link.slot, link.torque, link.sign = touch.slots[0], touch.slots[1], touch.slots[2]
        for c in range(3):
            link.ways[0, c] = normal[c]
            link.at[c] = y[c] + away[c] - radius * normal[c]
        link.constant = link.most = 0.0
        _set_stiffness(links, link, dt)
        if link.stiff[0] > 0:
            links.count[0] += 1


@noinline
def _set_stiffness(links, link, dt):
    _set_jacobians(links, link)
    _set_weight(links, link)
    along = _along(links, link.ways[0], link.ways[0])
    aside = links.weight[0, 0] + links.weight[1, 1] + links.weight[2, 2] - along
    link.stiff[0] = 1 / (SOFT * along) if along > 0 else 0.0
    link.stiff[1] = 1 / (SOFT * aside) if aside > 0 else 0.0
    link.bias[0] = link.gap / dt if link.gap > 0 else GIVEN_BACK * link.gap / dt


@noinline
def _list_joint(links, joint, dt, kick):
    a, b, holds = joint.first, joint.second, joint.holds
    ends = [
        motion.place_of(links.states[a], links.constants[a], joint.at),
        motion.place_of(links.states[b], links.constants[b], joint.end),
    ]
    way = [ends[0][c] - ends[1][c] for c in range(3)]
    for kind in (HOLD, HOLD_ROTATION):
        link = links.rows[links.count[0]]
        link.kind, link.first, link.second, link.constant = kind, a, b, 0.0
        link.slot, link.torque, link.sign = joint.slot, joint.torque, 1.0
        link.mu = link.most = 0.0
        for c in range(3):
            link.at[c], link.hit[c] = ends[1][c], 0.0
            axis = motion.from_start(
                links.states[a], (joint.axes[c, 0], joint.axes[c, 1], joint.axes[c, 2])
            )
            for k in range(3):
                link.ways[c, k] = axis[k]
        if joint.spring:
            if kind == HOLD:
                _set_spring(links, link, joint, (way[0], way[1], way[2]), (dt, kick))
                links.count[0] += 1
            continue
        if kind == HOLD_ROTATION:
            error = _rotation_between(links, joint)
            way = [error[c] for c in range(3)]
        _set_jacobians(links, link)
        _set_weight(links, link)
        some = False
        for k in range(3):
            along, gap = _along(links, link.ways[k], link.ways[k]), 0.0
            for c in range(3):
                gap += link.ways[k, c] * way[c]
            holding = holds[k if kind == HOLD else 3 + k] and along > 0
            link.stiff[k] = 1 / (SOFT * along) if holding else 0.0
            link.bias[k] = gap / dt
            some = some or link.stiff[k] > 0
        links.count[0] += 1 if some else 0


@noinline
def _rotation_between(links, joint):
    """Return the small rotation vector from the second body's axes to the first's.

    Rotation about the first axis is omitted if free.
    """
    total = [0.0, 0.0, 0.0]
    alone = not joint.holds[3]
    for k in range(3):
        axis = (joint.axes[k, 0], joint.axes[k, 1], joint.axes[k, 2])
        a = motion.from_start(links.states[joint.first], axis)
        b = motion.from_start(links.states[joint.second], axis)
        weight = (1.0 if k == 0 else 0.0) if alone else 0.5
        for c in range(3):
            total[c] += weight * motion.cross(b, a, c)
    return total[0], total[1], total[2]


@noinline
def _set_spring(links, link, joint, way, times):
    dt, kick = times
    length = sqrt(way[0] ** 2 + way[1] ** 2 + way[2] ** 2)
    for c in range(3):
        link.ways[0, c] = way[c] / length if length > 0 else 0.0
        link.stiff[c] = link.bias[c] = 0.0
    _set_jacobians(links, link)
    _set_weight(links, link)
    link.constant = kick * joint.stiffness * (length - joint.length)
    link.stiff[0] = kick * joint.damping
    if joint.stiffness * dt * kick * _along(links, link.ways[0], link.ways[0]) > 1:
        link.stiff[0] += kick * dt * joint.stiffness


@noinline
def _set_impulse(links, link, u, bounded):
    """Set the impulse of a link at the velocities `u`.

    With `bounded`, friction is limited by the normal impulse of an earlier pass.
    """
    _set_jacobians(links, link)
    for k in range(3):
        link.slip[k], link.impulse[k] = _relative(links, link, u, k), 0.0
    if link.kind != CONTACT:
        for j in range(3):
            along = 0.0
            for k in range(3):
                along += link.ways[j, k] * link.slip[k]
            push = -link.stiff[j] * (along + link.bias[j]) - (link.constant if j == 0 else 0.0)
            for k in range(3):
                link.impulse[k] += push * link.ways[j, k]
        return
    along = square = 0.0
    for k in range(3):
        along += link.ways[0, k] * link.slip[k]
    link.push = link.stiff[0] * max(-along - link.bias[0], 0.0)
    for k in range(3):
        link.slip[k] -= along * link.ways[0, k]
        square += link.slip[k] ** 2
    link.bound = link.mu * link.push
    link.speed, link.rub, most = sqrt(square), 0.0, link.most if bounded else link.bound
    if link.push > 0 and square > 0:
        link.rub = min(link.stiff[1], most / link.speed)
    for k in range(3):
        link.impulse[k] = link.push * link.ways[0, k] - link.rub * link.slip[k]


@noinline
def _slope_of(link, k, j, bounded):
    """Return -dp_k/dr_j of a link whose impulse is known."""
    if link.kind != CONTACT:
        total = 0.0
        for i in range(3):
            total += link.stiff[i] * link.ways[i, k] * link.ways[i, j]
        return total
    if not link.push > 0:
        return 0.0
    normal = link.ways[0]
    along = normal[k] * normal[j]
    slope = link.stiff[0] * along + link.rub * ((1.0 if k == j else 0.0) - along)
    if 0.0 < link.rub < link.stiff[1]:
        way = link.slip[k] / link.speed
        slope -= link.rub * way * link.slip[j] / link.speed
        slope -= 0.0 if bounded else link.mu * link.stiff[0] * way * normal[j]
    return slope


@noinline
def _add_slope(links, link, bounded):
    _set_jacobians(links, link)
    sides, rows, columns = links.jacobian.shape
    for k in range(rows):
        for j in range(rows):
            slope = _slope_of(link, k, j, bounded)
            if slope == 0:
                continue
            for side in range(sides):
                row = links.free[link.first if side == 0 else link.second]
                for other in range(sides):
                    column = links.free[link.first if other == 0 else link.second]
                    sign = slope if side == other else -slope
                    for a in range(columns):
                        if row[a] < 0 or links.jacobian[side, k, a] == 0:
                            continue
                        for b in range(columns):
                            if column[b] >= 0:
                                links.slope[row[a], column[b]] += (
                                    sign * links.jacobian[side, k, a] * links.jacobian[other, j, b]
                                )


@noinline
def _residual(links, bodies, u, rest, bounded):
    """Put M U - P minus all impulses into `rest`; return its square, in units of energy."""
    links.impulses[:] = 0.0
    for i in range(links.count[0]):
        _set_impulse(links, links.rows[i], u, bounded)
        _give(links, links.rows[i], links.rows[i].impulse, links.impulses, False)
    square = 0.0
    for n, body in enumerate(bodies):
        motion.residual(body, links.dt[0], u[n], rest[n], bounded)
        for a in range(6):
            rest[n, a] -= links.impulses[n, a]
            if body.dofs[a]:
                square += rest[n, a] ** 2 / body.solution.mass[a, a]
    return square


@noinline
def _add_body(links, body, n, bounded):
    work = body.solution
    J = work.slope
    J[:, :6] = work.mass
    for i in range(body.count[0]):
        motion.add_slope(body, i, bounded)
    m, size = links.slope.shape[0], links.free.shape[1]
    for a in range(size):
        row = links.free[n, a]
        if row >= 0:
            links.slope[row, m] = links.rest[n, a]
            for b in range(size):
                if links.free[n, b] >= 0:
                    links.slope[row, links.free[n, b]] += J[a, b]


@noinline
def _try(links, bodies, fraction, bounded):
    """Try `fraction` of the Newton step (last column of `slope`); return the squared residual."""
    m = links.slope.shape[0]
    links.trial[:] = links.u
    for n in range(links.free.shape[0]):
        for a in range(6):
            if links.free[n, a] >= 0:
                links.trial[n, a] -= fraction * links.slope[links.free[n, a], m]
    return _residual(links, bodies, links.trial, links.trial_rest, bounded)


@noinline
def _fall(links, rest):
    """Return the slope along the Newton step: the product of residual and step."""
    m, total = links.slope.shape[0], 0.0
    for n in range(links.free.shape[0]):
        for a in range(6):
            if links.free[n, a] >= 0:
                total += rest[n, a] * links.slope[links.free[n, a], m]
    return total


@noinline
def _descend(links, bodies):
    """Minimise along the Newton step; return the squared residual, 0 if the step does not descend.

    With bounded friction the residual is the gradient of a convex function.
    """
    begin = _fall(links, links.rest)
    if not begin > 0:
        return 0.0
    low, high, fraction, now = 0.0, np.inf, 1.0, 0.0
    for _ in range(SEARCHES):
        now = _try(links, bodies, fraction, True)
        fall = _fall(links, links.trial_rest)
        if abs(fall) <= NEAR_MINIMUM * begin:
            break
        if fall > 0:
            low = fraction
        else:
            high = fraction
        fraction = 0.5 * (low + high) if high < np.inf else 2 * fraction
    return now


@noinline
def _iterate(links, bodies, bounded):
    """Take Newton steps, halved if needed; return True if they have converged."""
    energy = 0.0
    size = _residual(links, bodies, links.u, links.rest, bounded)
    for body in bodies:
        for a in range(6):
            energy += body.solution.momentum[a] ** 2 / body.solution.mass[a, a]
    for _ in range(motion.PASSES_AT_MOST):
        if size <= SOLVED * energy:
            return True
        links.slope[:] = 0.0
        for n, body in enumerate(bodies):
            _add_body(links, body, n, bounded)
        for i in range(links.count[0]):
            _add_slope(links, links.rows[i], bounded)
        motion.solve_system(links.slope)
        better, now = False, size
        if bounded:
            now = _descend(links, bodies)
            better = now > 0
        fraction = 1.0
        for _ in range(0 if bounded else motion.HALVINGS):
            now = _try(links, bodies, fraction, bounded)
            if now < size:
                better = True
                break
            fraction *= 0.5
        if not better:
            _residual(links, bodies, links.u, links.rest, bounded)
            return size <= GOOD_ENOUGH * energy
        links.u[:], links.rest[:] = links.trial, links.trial_rest
        size = now
    return False


@noinline
def _solve(links, bodies):
    if _iterate(links, bodies, False):
        return
    # With friction bounds by the previous normal impulses, the problem is convex and Newton's
    # method converges. The first pass has no friction, so it finds normal impulses.
    for n, body in enumerate(bodies):
        links.u[n] = body.solution.u
    _iterate(links, bodies, True)
    for _ in range(motion.BOUNDS_AT_MOST):
        if motion.bounds_are_settled(links.rows, links.count[0]):
            return
        _iterate(links, bodies, True)
    for body in bodies:
        body.state[0].failed += 1


@noinline
def _approach(links, link, dt):
    """Return the speed of approach before the step if the bodies collide in it, else 0."""
    _set_jacobians(links, link)
    before = after = 0.0
    for k in range(3):
        jump = _relative(links, link, links.jump, k)
        before += link.ways[0, k] * (_relative(links, link, links.old, k) + jump)
        after += link.ways[0, k] * (_relative(links, link, links.u, k) + jump)
    return -before if before < 0 and link.gap + dt * after < 0 else 0.0


@noinline
def _hit(links, link):
    """Resolve the collision of a contact.

    Friction stops the slip, with an impulse of up to mu times the normal impulse.
    """
    _set_jacobians(links, link)
    _set_weight(links, link)
    W, n, r, p = links.weight, link.ways[0], link.slip, link.impulse
    along = square = trace = 0.0
    for k in range(3):
        r[k] = _relative(links, link, links.old, k) + _relative(links, link, links.jump, k)
        along += n[k] * r[k]
        trace += W[k, k]
    push = -(1 + link.restitution) * along / _along(links, n, n)
    for k in range(3):
        p[k] = push * n[k]
        square += (r[k] - along * n[k]) ** 2
    if link.mu > 0 and square > 0:
        for k in range(3):
            W[k, 3] = -link.restitution * along * n[k] - r[k]
            W[k, k] += 1e-12 * trace  # regularises directions in which neither body can move
        _solve_three(W, p)
        normal = total = 0.0
        for k in range(3):
            normal += n[k] * p[k]
            total += p[k] ** 2
        if normal <= 0 or total - normal**2 > (link.mu * normal) ** 2:
            for k in range(3):
                p[k] = n[k] - link.mu * (r[k] - along * n[k]) / sqrt(square)
            rate = _along(links, n, p)
            for k in range(3):
                # Drop friction if it would prevent separation.
                p[k] = -(1 + link.restitution) * along / rate * p[k] if rate > 0 else push * n[k]
    work = 0.0
    for k in range(3):
        work += p[k] * r[k]
    most = -2 * work / _along(links, p, p)  # a larger impulse would add energy
    for k in range(3):
        p[k] *= min(most, 1.0)
        link.hit[k] += p[k]
    _give(links, link, p, links.jump, True)


@noinline
def _solve_three(W, p):
    """Solve W p = b by the adjugate; W (3, 4) is symmetric, with b as last column."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        total = 0.0
        for c in range(3):
            a, b = (c + 1) % 3, (c + 2) % 3
            total += (W[i, a] * W[j, b] - W[i, b] * W[j, a]) * W[c, 3]
        p[k] = total
    det = 0.0
    for c in range(3):
        a, b = (c + 1) % 3, (c + 2) % 3
        det += W[0, c] * (W[1, a] * W[2, b] - W[1, b] * W[2, a])
    for k in range(3):
        p[k] /= det


@noinline
def _collide(links, bodies, dt):
    links.jump[:] = 0.0
    fastest = 0.0
    for _ in range(COLLISIONS * links.count[0]):
        worst, which = 0.0, -1
        for i in range(links.count[0]):
            link = links.rows[i]
            if link.kind == CONTACT and link.restitution > 0:
                speed = _approach(links, link, dt)
                if speed > worst:
                    worst, which = speed, i
        fastest = max(fastest, worst)
        if which < 0 or worst <= SLOW * fastest:
            break
        _hit(links, links.rows[which])
    if fastest == 0:
        return
    links.impulses[:] = 0.0
    for i in range(links.count[0]):
        link = links.rows[i]
        if link.kind == CONTACT:
            _set_jacobians(links, link)
            _give(links, link, link.hit, links.impulses, False)
    for n, body in enumerate(bodies):
        for a in range(6):
            body.solution.momentum[a] += links.impulses[n, a]
            body.solution.u[a] += links.jump[n, a]
        links.u[n] = body.solution.u


@noinline
def find(links, bodies, control, kin):
    """List the links of this step; return True if there are any."""
    dt, values = control.values[arrays.DT], control.values
    links.count[0], links.dt[0] = 0, dt
    for i in range(links.published.shape[0]):
        for c in range(3):
            values[links.published[i, 0] + c] = 0.0
            if links.published[i, 1]:
                values[links.published[i, 1] + c] = 0.0
    for n, body in enumerate(bodies):
        _begin(links, body, n)
    for alike in links.touches:
        for touch in alike:
            _list_touch(links, touch, kin, dt)
    for i in range(links.joints.size):
        _list_joint(links, links.joints[i], dt, control.step[0].kick)
    return links.count[0] > 0


@noinline
def _sum_impulses(links):
    links.impulses[:] = 0.0
    for i in range(links.count[0]):
        link = links.rows[i]
        _set_jacobians(links, link)
        _give(links, link, link.impulse, links.impulses, False)


@noinline
def solve(links, bodies, control):
    dt, kick, values = control.values[arrays.DT], control.step[0].kick, control.values
    _collide(links, bodies, dt)
    _solve(links, bodies)
    _sum_impulses(links)
    for n, body in enumerate(bodies):
        body.solution.u[:] = links.u[n]
        for a in range(6):
            body.solution.momentum[a] += links.impulses[n, a]
    for i in range(links.count[0]):
        link = links.rows[i]
        for c in range(3):
            link.impulse[c] += link.hit[c]
        _set_jacobians(links, link)
        _publish(link, values, kick)
    # Published forces include collisions.
    _sum_impulses(links)
    for n, body in enumerate(bodies):
        body.solution.link_impulses[:] = links.impulses[n]


@noinline
def _publish(link, values, kick):
    p = link.impulse
    for c in range(3):
        if link.kind != HOLD_ROTATION:
            values[link.slot + c] += link.sign * p[c] / kick
        if link.torque:
            torque = p[c] if link.kind == HOLD_ROTATION else motion.cross(link.at, p, c)
            values[link.torque + c] += link.sign * torque / kick
