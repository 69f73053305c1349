"""Rigid bodies that move by the forces on them: their steps, and contact that acts both ways.

A body is its mass, inertia, position, rotation, momentum and surface. A contact is a position x
with a mass m and velocity v* of the other body, a normal n out of the rigid one, and a gap g. With
the velocity U = (V, w) of the rigid body at the end of the step, A U = V + w x (x - X), its impulse
is known in closed form::

    p_n = s m max(n . (A U - v*) - g / dt, 0)
    p_t = m (A U - v*)_t, but at most mu p_n

so the body's equations alone remain, M (U - U*) + sum A^T p = 0, six at most, solved by Newton's
method: the mass of what it touches does not limit the step. Contact at points has s = 0.1 (dt /
dt0)^2 with the whole step dt0: an implicit spring, as stiff in shortened steps. Contact at nodes
has s = 1.

Forces act over `kick`, motion over dt. Between the forces the angular momentum is constant, and the
body rotates about one principal axis after another, x/2 y/2 z y/2 x/2 (McLachlan 1993; Touma &
Wisdom 1994, "Lie-Poisson integrators for rigid body dynamics in the solar system"): the energy of a
free top oscillates by O(dt^2) and does not drift.
"""

from math import atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import caller_of, kernel, noinline, point_function
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import (
    DT,
    MASS,
    ON_UPDATE,
    POST_CONTACT,
    TIMESTEP,
    Tag,
    of_change,
    of_momentum,
)
from karamelo_py.kernels.contact import Bodies, ListedPairs, SeparateFields, list_pairs
from karamelo_py.kernels.surfaces import Surface, depth, distance, slopes
from karamelo_py.kernels.table import AtNodes, Once, each_node, each_point
from karamelo_py.kernels.totals import WORK, add_to
from karamelo_py.kernels.touching import ASIDE, CALL, SOFT, direction_of
from karamelo_py.kernels.views import location_at, state_at, volume_of
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.bodies import radius
from karamelo_py.points.grid import node_position
from karamelo_py.points.kinematics import zero_vector
from karamelo_py.points.laws.rigid import Rigid
from karamelo_py.script.formula import call_evaluate

# Columns of FreeBody.state. Vectors have three components in any dimension.
X, V, W, L = 0, 3, 6, 9  # centre, velocity, spin, angular momentum
Q = 12  # rotation since the start, a quaternion
ANGLE = 16  # the same as an angle about each axis (in 2D); as a vector in 3D
FORCE, TORQUE = 19, 22  # of contact, in this step; about the centre
R = 25  # rotation matrix of Q, by rows
MOVE = 34  # displacement of the centre in this step, over dt
SPREAD = 37  # of other points: (rotation in this step - 1) / dt, by rows
PASSES, FAILED = 46, 47  # of Newton's method: in this step, and steps without a solution
STATE = 48
ABOUT_ORIGIN = 48  # column of published values: torque of contact about the origin, three rows
# Columns of FreeBody.constants.
OF_MASS, INERTIA, AXES, START, BOUND = 0, 1, 4, 13, 16  # AXES: principal axes, by columns
SPEED_AT_MOST = 17  # of a point of the body, in this step
OFFSET = 18  # of the centre of mass from X, in the frame of the start
CONSTANTS = 21
# Formulas of a body: prescribed velocity and spin, force and torque, acceleration.
LED, LOADED, FALLS = 0, 6, 12
FORMULAS = 15
# Columns of a contact.
AT, SOFT_V, NORMAL, GAP, SOFT_MASS, MU, SHARE, IMPULSE = 0, 3, 6, 9, 10, 11, 12, 13
SLIP, SPEED, PUSH, RUB, MOST = 16, 19, 20, 21, 22  # of the last pass; MOST: bound of friction
COLUMNS = 23
# Rows of FreeBody.vectors.
START_P, U, TRIAL, REST, REST_TRIAL, SUM, STEP, ROWS = range(8)
PASSES_AT_MOST, HALVINGS, BOUNDS_AT_MOST = 60, 12, 60
SOLVED, GOOD_ENOUGH = 1e-26, 1e-16  # of the square of the residual at the start

_call = caller_of(CALL)


class TouchingSurface(NamedTuple):
    """The surface of a body, and the points that it touches."""

    shape: Tag
    members: np.ndarray  # (N,) bool, by id
    mu: float
    slot: int  # of the force on the points
    lost: int  # address of a function called for a point without a way out


class FreeBody(NamedTuple):
    field: int  # its velocity field, for contact at nodes
    ids: np.ndarray  # (2,) first id of its points, and the end
    dofs: np.ndarray  # (6,) int64: 1 if it moves freely, 0 if prescribed
    constants: np.ndarray
    state: np.ndarray
    slots: np.ndarray  # (k, 2) slots of published values, and their columns in `state`
    evaluate: int  # address of the evaluator of formulas
    programs: np.ndarray  # (FORMULAS, 4) begin, end, first, last; begin -1: none
    code: np.ndarray
    numbers: np.ndarray
    scratch: np.ndarray
    matrices: np.ndarray  # (2, 6, 7) mass; slope, and the right-hand side
    vectors: np.ndarray  # (ROWS, 6)
    lever: np.ndarray  # (3, 6): A; its first half is the unit matrix
    contacts: np.ndarray  # (n, COLUMNS)
    count: np.ndarray  # (1,) int64: number of contacts
    which: np.ndarray  # (n, 3) int64: block and number of the point, and slot of its force
    pairs: ListedPairs  # scratch, of contact at nodes
    surfaces: tuple[TouchingSurface, ...]


class NoBodies(NamedTuple):
    rows_first = rows_last = rows_before = rows_after = ()


class FreeBodies(NamedTuple):
    bodies: tuple[FreeBody, ...]
    held: np.ndarray  # (N, d) bool: nodes whose velocity is prescribed


class BodiesAtPoints(FreeBodies):
    """Bodies without contact at nodes."""


# --- rotation ---------------------------------------------------------------------------------


@noinline
def _turn_about(state, axis, angle):
    """Rotate by `angle` about a principal axis (3,), in the frame of the start."""
    c, s = cos(0.5 * angle), sin(0.5 * angle)
    a, b, d, e = state[Q], state[Q + 1], state[Q + 2], state[Q + 3]
    x, y, z = s * axis[0], s * axis[1], s * axis[2]
    a, b, d, e = (
        a * c - b * x - d * y - e * z,
        a * x + b * c + d * z - e * y,
        a * y - b * z + d * c + e * x,
        a * z + b * y - d * x + e * c,
    )
    size = 1.0 / sqrt(a * a + b * b + d * d + e * e)
    state[Q], state[Q + 1], state[Q + 2], state[Q + 3] = size * a, size * b, size * d, size * e
    set_matrix(state)


@noinline
def set_matrix(state):
    a, b, c, d = state[Q], state[Q + 1], state[Q + 2], state[Q + 3]
    state[R] = 1 - 2 * (c * c + d * d)
    state[R + 1] = 2 * (b * c - a * d)
    state[R + 2] = 2 * (b * d + a * c)
    state[R + 3] = 2 * (b * c + a * d)
    state[R + 4] = 1 - 2 * (b * b + d * d)
    state[R + 5] = 2 * (c * d - a * b)
    state[R + 6] = 2 * (b * d - a * c)
    state[R + 7] = 2 * (c * d + a * b)
    state[R + 8] = 1 - 2 * (b * b + c * c)


@noinline
def _axis(constants, k):
    return constants[AXES + k], constants[AXES + 3 + k], constants[AXES + 6 + k]


@noinline
def _along_axis(body, k):
    """Angular momentum about the `k`-th principal axis."""
    state, (a, b, c), total = body.state, _axis(body.constants, k), 0.0
    for i in range(3):
        row = R + 3 * i
        total += state[L + i] * (state[row] * a + state[row + 1] * b + state[row + 2] * c)
    return total


@noinline
def _drift_about(body, k, dt):
    angle = dt * _along_axis(body, k) / body.constants[INERTIA + k]
    _turn_about(body.state, _axis(body.constants, k), angle)


@noinline
def _set_spin(body):
    """Set the spin from the angular momentum, after a rotation."""
    state = body.state
    for i in range(3):
        state[W + i] = 0.0
    for k in range(3):
        e0, e1, e2 = _axis(body.constants, k)
        axis, spin = _from_start(state, e0, e1, e2), _along_axis(body, k)
        for i in range(3):
            state[W + i] += axis[i] * spin / body.constants[INERTIA + k]


@noinline
def _turn_by_spin(body, dt):
    """Rotate by the spin of the step: of a body whose rotation is prescribed in part."""
    state = body.state
    size = sqrt(state[W] ** 2 + state[W + 1] ** 2 + state[W + 2] ** 2)
    if size > 0:
        axis = _to_start(state, state[W] / size, state[W + 1] / size, state[W + 2] / size)
        _turn_about(state, axis, size * dt)


@noinline
def _to_start(state, x, y, z):
    """Rotate a vector back to the frame of the start."""
    return (
        state[R] * x + state[R + 3] * y + state[R + 6] * z,
        state[R + 1] * x + state[R + 4] * y + state[R + 7] * z,
        state[R + 2] * x + state[R + 5] * y + state[R + 8] * z,
    )


@noinline
def _from_start(state, x, y, z):
    return (
        state[R] * x + state[R + 1] * y + state[R + 2] * z,
        state[R + 3] * x + state[R + 4] * y + state[R + 5] * z,
        state[R + 6] * x + state[R + 7] * y + state[R + 8] * z,
    )


@noinline
def set_mass(body):
    """Put the mass and the inertia about the present axes into the mass matrix."""
    M, state, constants = body.matrices[0], body.state, body.constants
    for a in range(6):
        for b in range(6):
            M[a, b] = 0.0
    for a in range(3):
        M[a, a] = constants[OF_MASS]
    for k in range(3):
        e0, e1, e2 = _axis(constants, k)
        axis = _from_start(state, e0, e1, e2)
        for a in range(3):
            for b in range(3):
                M[3 + a, 3 + b] += constants[INERTIA + k] * axis[a] * axis[b]


# --- Newton's method --------------------------------------------------------------------------


@noinline
def _set_lever(body, x):
    """Set the matrix A (3, 6) of a position: the velocity of the body there is A U."""
    A, state = body.lever, body.state
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        A[k, 3 + i], A[k, 3 + j] = x[j] - state[X + j], state[X + i] - x[i]


@noinline
def _velocity_there(body, u, k):
    """Component `k` of A U."""
    v = 0.0
    for a in range(6):
        v += body.lever[k, a] * u[a]
    return v


@noinline
def _set_impulse(body, u, i, dt, bounded):
    """Set the impulse of contact `i` at the velocities `u`.

    With `bounded`, friction is limited by the normal impulse of an earlier pass.
    """
    c = body.contacts[i]
    _set_lever(body, c)
    along = square = 0.0
    for k in range(3):
        c[SLIP + k] = _velocity_there(body, u, k) - c[SOFT_V + k]
        along += c[NORMAL + k] * c[SLIP + k]
    c[PUSH] = c[SHARE] * c[SOFT_MASS] * max(along - c[GAP] / dt, 0.0)
    for k in range(3):
        c[SLIP + k] -= along * c[NORMAL + k]
        square += c[SLIP + k] ** 2
    c[SPEED], c[RUB], most = sqrt(square), 0.0, c[MOST] if bounded else c[MU] * c[PUSH]
    if c[PUSH] > 0 and square > 0:
        c[RUB] = min(c[SOFT_MASS], most / c[SPEED])
    for k in range(3):
        c[IMPULSE + k] = c[PUSH] * c[NORMAL + k] + c[RUB] * c[SLIP + k]


@noinline
def _residual(body, count, dt, rows, bounded):
    """Put M U - P + sum A^T p into a row; return its square, in units of energy."""
    vectors, M = body.vectors, body.matrices[0]
    total, u, rest, square = vectors[SUM], vectors[rows[0]], vectors[rows[1]], 0.0
    for a in range(6):
        total[a] = 0.0
    for i in range(count):
        _set_impulse(body, u, i, dt, bounded)
        for k in range(3):
            for a in range(6):
                total[a] += body.lever[k, a] * body.contacts[i, IMPULSE + k]
    for a in range(6):
        rest[a] = total[a] - vectors[START_P, a]
        for b in range(6):
            rest[a] += M[a, b] * u[b]
        if body.dofs[a]:
            square += rest[a] * rest[a] / M[a, a]
    return square


@noinline
def _add_slope(body, i, bounded):
    """Add A^T (dp/dr) A of contact `i`, whose impulse is known, to the slope."""
    c, A, J = body.contacts[i], body.lever, body.matrices[1]
    if not c[PUSH] > 0:
        return
    _set_lever(body, c)
    stiff, slips = c[SHARE] * c[SOFT_MASS], 0.0 < c[RUB] < c[SOFT_MASS]
    for k in range(3):
        for j in range(3):
            along = c[NORMAL + k] * c[NORMAL + j]
            part = stiff * along + c[RUB] * ((1.0 if k == j else 0.0) - along)
            if slips:
                way = c[SLIP + k] / c[SPEED]
                part -= c[RUB] * way * c[SLIP + j] / c[SPEED]
                part += 0.0 if bounded else c[MU] * stiff * way * c[NORMAL + j]
            for a in range(6):
                for b in range(6):
                    J[a, b] += part * A[k, a] * A[j, b]


@noinline
def _solve_system(J):
    """Solve J (6, 7) by elimination with pivots; the result replaces the last column."""
    for k in range(6):
        best = k
        for a in range(k + 1, 6):
            if abs(J[a, k]) > abs(J[best, k]):
                best = a
        for b in range(7):
            J[k, b], J[best, b] = J[best, b], J[k, b]
        for a in range(k + 1, 6):
            part = J[a, k] / J[k, k]
            for b in range(k, 7):
                J[a, b] -= part * J[k, b]
    for back in range(6):
        k = 5 - back
        for b in range(k + 1, 6):
            J[k, 6] -= J[k, b] * J[b, 6]
        J[k, 6] /= J[k, k]


@noinline
def _iterate(body, count, dt, bounded):
    """Newton's method with halved steps; return whether it has converged."""
    vectors, M, J = body.vectors, body.matrices[0], body.matrices[1]
    size, energy = _residual(body, count, dt, (U, REST), bounded), 0.0
    for a in range(6):
        energy += vectors[START_P, a] ** 2 / M[a, a]
    scale = max(size, GOOD_ENOUGH * energy)
    for _ in range(PASSES_AT_MOST):
        if size <= SOLVED * scale:
            return True
        body.state[PASSES] += 1
        for a in range(6):
            for b in range(6):
                J[a, b] = M[a, b]
            J[a, 6] = vectors[REST, a]
        for i in range(count):
            _add_slope(body, i, bounded)
        for a in range(6):
            if not body.dofs[a]:
                for b in range(6):
                    J[a, b] = J[b, a] = 0.0
                J[a, a], J[a, 6] = 1.0, 0.0
        _solve_system(J)
        part, better, now = 1.0, False, size
        for _ in range(HALVINGS):
            for a in range(6):
                vectors[TRIAL, a] = vectors[U, a] - part * J[a, 6]
            now = _residual(body, count, dt, (TRIAL, REST_TRIAL), bounded)
            if now < size:
                better = True
                break
            part *= 0.5
        if not better:
            _residual(body, count, dt, (U, REST), bounded)
            return size <= GOOD_ENOUGH * scale
        for a in range(6):
            vectors[U, a], vectors[REST, a] = vectors[TRIAL, a], vectors[REST_TRIAL, a]
        size = now
    return False


@noinline
def _solve(body, count, dt):
    """Find the velocities at the end of the step, in row U, and the impulses."""
    contacts, state = body.contacts, body.state
    state[PASSES] = 0
    if _iterate(body, count, dt, False):
        return
    # Bounds of friction from the last normal impulses: convex, so Newton's method converges.
    for _ in range(BOUNDS_AT_MOST):
        change = largest = 0.0
        for i in range(count):
            c = contacts[i]
            bound = c[MU] * c[PUSH]
            change, largest = max(change, abs(bound - c[MOST])), max(largest, bound)
            c[MOST] = bound
        if change <= 1e-10 * largest:
            return
        _iterate(body, count, dt, True)
    state[FAILED] += 1


# --- a step -----------------------------------------------------------------------------------


@noinline
def _value(body, s, k):
    """Return the value of formula `k` of a body now; 0 if there is none."""
    programs, control = body.programs, s.control
    if programs[k, 0] < 0:
        return 0.0
    if programs[k, 0] == programs[k, 1]:
        return body.numbers[programs[k, 2]]
    call_evaluate(
        body.evaluate, body.code, body.numbers, control.values, body.scratch,
        programs[k, 0], programs[k, 1], programs[k, 2], programs[k, 3], 1, 6,
    )  # fmt: skip
    return body.scratch[6, 0]


@noinline
def _start(body, s):
    """Find momentum and velocities without contact, in rows START_P and U."""
    state, vectors, kick = body.state, body.vectors, s.control.step[0].kick
    set_mass(body)
    mass, c = body.constants[OF_MASS], body.constants
    arm = _from_start(state, c[OFFSET], c[OFFSET + 1], c[OFFSET + 2])
    for k in range(3):
        vectors[STEP, k] = _value(body, s, LOADED + k) + mass * _value(body, s, FALLS + k)
        vectors[START_P, 3 + k] = state[L + k] + kick * _value(body, s, LOADED + 3 + k)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        vectors[START_P, k] = mass * state[V + k] + kick * vectors[STEP, k]
        torque = arm[i] * vectors[STEP, j] - arm[j] * vectors[STEP, i]
        vectors[START_P, 3 + k] += kick * torque
    for a in range(6):
        vectors[U, a] = 0.0 if body.dofs[a] else _value(body, s, LED + a)
    _velocities_of(body, START_P)
    u = vectors[U]
    speed = sqrt(u[3] ** 2 + u[4] ** 2 + u[5] ** 2) * body.constants[BOUND]
    body.constants[SPEED_AT_MOST] = sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2) + speed


@noinline
def _velocities_of(body, row):
    """Solve M U = P for the free components of U; the others are given."""
    vectors, M, J = body.vectors, body.matrices[0], body.matrices[1]
    for a in range(6):
        for b in range(6):
            J[a, b] = M[a, b] if body.dofs[a] else (1.0 if a == b else 0.0)
        J[a, 6] = vectors[row, a] if body.dofs[a] else vectors[U, a]
    _solve_system(J)
    for a in range(6):
        vectors[U, a] = J[a, 6]


@noinline
def _finish(body, s, total):
    """Take the momentum that contact leaves, move the body, and publish.

    `total` (6,): impulses of the body on others, about its centre. Returns their product with the
    change of its velocity.
    """
    state, vectors, dt = body.state, body.vectors, s.control.values[DT]
    kick = s.control.step[0].kick
    for k in range(3):
        state[FORCE + k], state[TORQUE + k] = -total[k] / kick, -total[3 + k] / kick
    for a in range(6):
        vectors[STEP, a] = vectors[START_P, a] - total[a]
    _velocities_of(body, STEP)
    u, M, before = vectors[U], body.matrices[0], vectors[TRIAL]
    partly, change = False, 0.0
    for k in range(3):
        change += total[k] * (u[k] - state[V + k]) + total[3 + k] * (u[3 + k] - state[W + k])
        state[V + k], state[W + k] = u[k], u[3 + k]
        state[MOVE + k] = u[k]
        state[L + k] = M[3 + k, 3] * u[3] + M[3 + k, 4] * u[4] + M[3 + k, 5] * u[5]
        partly = partly or not body.dofs[3 + k]
    old = body.matrices[1]
    for a in range(3):
        for b in range(3):
            old[a, b] = state[R + 3 * a + b]
    if partly:
        _turn_by_spin(body, dt)
    else:
        _drift_about(body, 0, 0.5 * dt)
        _drift_about(body, 1, 0.5 * dt)
        _drift_about(body, 2, dt)
        _drift_about(body, 1, 0.5 * dt)
        _drift_about(body, 0, 0.5 * dt)
        _set_spin(body)
    for a in range(3):
        for b in range(3):
            part = 0.0
            for c in range(3):
                part += state[R + 3 * a + c] * old[b, c]
            state[SPREAD + 3 * a + b] = (part - (1.0 if a == b else 0.0)) / dt
        before[a] = state[X + a]
        state[X + a] += dt * u[a]
    _set_angle(state, dt, s.kin.dimension)
    _publish(body, s.control.values)
    return change


@noinline
def _energy(body):
    """Kinetic energy, with the mass matrix at the start of this step."""
    u, M, energy = body.vectors[U], body.matrices[0], 0.0
    for a in range(6):
        for b in range(6):
            energy += 0.5 * u[a] * M[a, b] * u[b]
    return energy


@noinline
def _set_angle(state, dt, dimension):
    if dimension < 3:
        state[ANGLE + 2] += dt * state[W + 2]
        return
    sign = 1.0 if state[Q] >= 0 else -1.0
    size = sqrt(state[Q + 1] ** 2 + state[Q + 2] ** 2 + state[Q + 3] ** 2)
    angle = 2.0 * atan2(size, sign * state[Q])
    for k in range(3):
        state[ANGLE + k] = sign * state[Q + 1 + k] * (angle / size if size > 0 else 2.0)


@noinline
def _publish(body, values):
    for k in range(body.slots.shape[0]):
        column = body.slots[k, 1]
        if column < STATE:
            values[body.slots[k, 0]] = body.state[column]
        else:
            values[body.slots[k, 0]] = _about_origin(body, column - ABOUT_ORIGIN)


@noinline
def _about_origin(body, k):
    """Torque of contact about the origin, from the centre before this step."""
    state, before, i, j = body.state, body.vectors[TRIAL], (k + 1) % 3, (k + 2) % 3
    return state[TORQUE + k] + before[i] * state[FORCE + j] - before[j] * state[FORCE + i]


# --- contact at points ------------------------------------------------------------------------


@noinline
def _place_of(s, points, p):
    return location_at(
        s.basis, s.kin, points.x[s.control.motion[0].now] if s.frame.moves else points.home, p
    )


@point_function(otherwise=True)
def depth_near(shape, kin, x, reach):
    """Depth at `x`; -reach if the surface is further away than that, on either side."""
    return depth(shape, kin, x, reach)


@depth_near.on(Surface)
def _depth_near_faces(shape, kin, x, reach):
    # Testing whether faces enclose a position takes longer than finding that none is near.
    return depth(shape, kin, x, reach) if distance(shape, kin, x, reach) < reach else -reach


@noinline
def _list_point(body, surface, s, block, p):
    """Put a contact of point `p` with a surface into the next row; return whether there is one."""
    kin, state, points, d = s.kin, body.state, block.points, s.kin.dimension
    times, dt = s.control.step[0], s.control.values[DT]
    h, none = s.grids.h[0], zero_vector(s.kin, 0.0)
    x = load_vector(kin, points.x[s.control.motion[0].now], p)
    away = speed = 0.0
    for c in range(d):
        away += (x[c] - state[X + c]) ** 2
        speed += abs(points.v[c, p])
    if away > (body.constants[BOUND] + 2 * h) ** 2:
        return False
    # Surfaces that may meet in this step: most points are far, and a short reach is cheap.
    near = min(2 * dt * (speed + body.constants[SPEED_AT_MOST]), h)
    law, material = state_at(kin, points, block.laws, p)
    ball = radius(kin, volume_of(kin, points, law, material, p), x)
    arm = [x[c] - state[X + c] if c < d else 0.0 for c in range(3)]
    local = _to_start(state, arm[0], arm[1], arm[2])
    y = none._make([local[c] + body.constants[START + c] for c in range(d)])
    within = depth_near(surface.shape, kin, y, near + ball)
    if within <= -near - ball:
        return False
    if within > ball:
        within = depth(surface.shape, kin, y, h + ball)
    step = ASIDE * h
    way = direction_of(slopes(surface.shape, kin, y, h + ball, (within, step)), step)
    if way.squared() == 0:
        if within > 0 and _call(surface.lost, points.id[p]) == 0:
            raise RuntimeError("a point has no way out")
        return False
    out = [way[c] if c < d else 0.0 for c in range(3)]
    normal = _from_start(state, out[0], out[1], out[2])
    contact = body.contacts[body.count[0]]
    for c in range(3):
        contact[NORMAL + c], contact[SOFT_V + c] = normal[c], 0.0
        contact[AT + c] = arm[c] + state[X + c]
    grid = record(s.grids, points.grid[p])
    stencil = locate(s.basis, kin, grid, _place_of(s, points, p))
    for node in range(support(s.basis, kin)):
        n, weight, _ = entry(s.basis, kin, grid, stencil, node)
        for c in range(d):
            contact[SOFT_V + c] += weight * s.nodes.update[n, c]
    stiffness = SOFT * dt * times.kick / (times.contact_dt * times.contact_kick)
    contact[GAP], contact[SOFT_MASS], contact[MU] = -within - ball, points.mass[p], surface.mu
    contact[SHARE], contact[MOST] = stiffness, 0.0
    return True


@noinline
def _list_points(body, surface, s, block, number):
    points = block.points
    for p in range(points.mass.size):
        if surface.members[points.id[p]] and _list_point(body, surface, s, block, p):
            body.which[body.count[0], 0], body.which[body.count[0], 1] = number, p
            body.which[body.count[0], 2] = surface.slot
            body.count[0] += 1


@noinline
def _give_to_points(body, s, block, number, measures):
    """Give the impulses of contacts to the nodes of the points of a block; or sum their work."""
    kin, nodes, points, d = s.kin, s.nodes, block.points, s.kin.dimension
    kick, work = s.control.step[0].kick, 0.0
    for i in range(body.count[0]):
        if body.which[i, 0] != number:
            continue
        p, contact = body.which[i, 1], body.contacts[i]
        grid = record(s.grids, points.grid[p])
        stencil = locate(s.basis, kin, grid, _place_of(s, points, p))
        for node in range(support(s.basis, kin)):
            n, weight, _ = entry(s.basis, kin, grid, stencil, node)
            for c in range(d):
                if nodes.sums[n, MASS] > 0 and not s.bodies.held[n, c]:
                    impulse = weight * contact[IMPULSE + c]
                    change = of_change(kin) + c
                    if measures:
                        # The mean of the velocities before and after the step, as for loads.
                        work += impulse * (nodes.update[n, c] - 0.5 * nodes.update[n, change])
                    else:
                        nodes.update[n, c] += impulse / nodes.sums[n, MASS]
                        nodes.update[n, change] += impulse / nodes.sums[n, MASS]
        if measures:
            for c in range(d):
                s.control.values[body.which[i, 2] + c] += contact[IMPULSE + c] / kick
    add_to(s.control.totals, WORK, work)


# --- contact at nodes -------------------------------------------------------------------------


@noinline
def _lead_nodes(body, s):
    """Give the nodes of a body's field its velocity, as contact at nodes reads it."""
    first = of_momentum(s.kin)
    for r in range(1, 1 + s.spans[0, 0]):
        for n in range(s.spans[r, 0], s.spans[r, 1]):
            mass = s.nodes.sums[n, MASS]
            if n // s.contact.stride == body.field and mass > 0:
                _set_lever(body, node_position(record(s.grids, body.field), n))
                for k in range(s.kin.dimension):
                    v = _velocity_there(body, body.vectors[U], k)
                    s.nodes.sums[n, first + k], s.nodes.update[n, k] = mass * v, v


@noinline
def _list_nodes(body, s):
    """List the nodes where a body meets fields that yield."""
    contact, nodes, d = s.contact, s.nodes, s.kin.dimension
    step = int(s.control.values[TIMESTEP]) + 1
    count = list_pairs(Bodies(contact, s.kin, nodes), s.grids, s.spans, body.pairs)
    for q in range(count):
        n, m = body.pairs.nodes[q, 0], body.pairs.nodes[q, 1]
        sign = 1.0
        if m // contact.stride == body.field:
            n, m, sign = m, n, -1.0
        a, b = n // contact.stride, m // contact.stride
        if a != body.field or contact.rigid[b]:
            continue
        row = body.contacts[body.count[0]]
        x = node_position(record(s.grids, a), n)
        for c in range(3):
            row[AT + c] = x[c] if c < d else 0.0
            row[NORMAL + c] = sign * body.pairs.normals[q, c] if c < d else 0.0
            row[SOFT_V + c] = nodes.update[m, c] if c < d else 0.0
        last = abs(contact.touched[n, b] if a < b else contact.touched[m, a])
        memory = max(contact.memory[a], contact.memory[b])
        lasts = last > 0 and last >= step - memory
        row[GAP] = 0.0 if lasts else max(body.pairs.gaps[q], 0.0)
        row[SOFT_MASS], row[MU], row[SHARE] = nodes.sums[m, MASS], contact.friction[a, b], 1.0
        row[MOST] = 0.0
        body.count[0] += 1


@noinline
def _reaction(body, s):
    """Put the impulses of contact at nodes, about the centre, into row SUM."""
    total, state, values = body.vectors[SUM], body.state, s.control.values
    kick, force, torque = s.control.step[0].kick, s.contact.slot, s.contact.torque
    for k in range(3):
        total[k] = -kick * values[force[body.field] + k]
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        about = state[X + i] * total[j] - state[X + j] * total[i]
        total[3 + k] = -kick * values[torque[body.field] + k] - about


@noinline
def _follow(s, n, again):
    """Let a node of a body follow the surface that it touches, for the velocity that deforms this.

    A light body may be faster than the surface until the gap is closed: straining it by the body's
    velocity would add more energy than the body has. `again`: v* of this step is known.
    """
    contact, nodes = s.contact, s.nodes
    for body in s.bodies.bodies:
        if n // contact.stride == body.field and nodes.sums[n, MASS] > 0:
            for other in range(contact.slot.size):
                m = n + (other - body.field) * contact.stride
                if not contact.rigid[other] and nodes.sums[m, MASS] > 0:
                    for k in range(s.kin.dimension):
                        v = nodes.update[m, k] if again else nodes.velocity[m, k]
                        nodes.velocity[n, k] = v


# --- rows -------------------------------------------------------------------------------------


@kernel
def _meet(s):
    """Find the velocities of all bodies at the end of the step."""
    for body in s.bodies.bodies:
        _start(body, s)
        body.count[0] = 0
        for surface in body.surfaces:
            for c in range(s.kin.dimension):
                s.control.values[surface.slot + c] = 0.0
            for number, block in enumerate(s.blocks):
                _list_points(body, surface, s, block, number)
        if isinstance(s.contact, SeparateFields):
            _lead_nodes(body, s)
            _list_nodes(body, s)
        _solve(body, body.count[0], s.control.values[DT])
        if isinstance(s.contact, SeparateFields):
            _lead_nodes(body, s)
        else:
            for number, block in enumerate(s.blocks):
                _give_to_points(body, s, block, number, False)


@kernel
def _part(s):
    energy = 0.0
    for body in s.bodies.bodies:
        if isinstance(s.contact, SeparateFields):
            _reaction(body, s)
        else:
            for number, block in enumerate(s.blocks):
                _give_to_points(body, s, block, number, True)
        change = _finish(body, s, body.vectors[SUM])
        if isinstance(s.contact, SeparateFields):
            # Contact took the velocity at the end of the step, not the mean of both ends.
            add_to(s.control.totals, WORK, -0.5 * change)
        energy += _energy(body)
    s.control.energy[0].of_bodies = energy


def _lead_point(s, block, p):
    """Give a point of a body its mean velocity in the step, which displaces it exactly."""
    for body in s.bodies.bodies:
        if body.ids[0] <= block.points.id[p] < body.ids[1]:
            _lead(body, s, block.points, p)


@noinline
def _lead(body, s, points, p):
    state, d, now = body.state, s.kin.dimension, s.control.motion[0].now
    before = body.vectors[TRIAL]
    for c in range(d):
        v = state[MOVE + c]
        for k in range(d):
            v += state[SPREAD + 3 * c + k] * (points.x[now, k, p] - before[k])
        points.v[c, p] = v


FreeBodies.rows_first = (Once(_meet),)  # type: ignore[attr-defined]
FreeBodies.rows_last = (Once(_part), each_point(_lead_point, Rigid))  # type: ignore[attr-defined]
FreeBodies.rows_before = (  # type: ignore[attr-defined]
    each_node(lambda s, n: _follow(s, n, False)),
)
FreeBodies.rows_after = (  # type: ignore[attr-defined]
    each_node(lambda s, n: _follow(s, n, True)),
)
BodiesAtPoints.rows_last = (  # type: ignore[attr-defined]
    *FreeBodies.rows_last,  # type: ignore[attr-defined]
    AtNodes(POST_CONTACT, ON_UPDATE),
)
BodiesAtPoints.rows_before = BodiesAtPoints.rows_after = ()  # type: ignore[attr-defined]
