"""Motion of free rigid bodies, and the impulses of their contacts.

A contact has a position x, the mass m and velocity v* of the other body, a normal n that points out
of the rigid body, and a gap g. With the rigid body's velocity U = (V, w) at the end of the step,
its velocity at x is A U = V + w x (x - X), and the impulse has a closed form::

    p_n = s m max(n . (A U - v*) - g / dt, 0)
    p_t = m (A U - v* + h)_t, but at most mu p_n

Newton's method solves the body's equations, at most six: M (U - U*) + sum A^T p = 0. As the impulse
is implicit, it does not limit the step. Contact at points has s = 0.1 (dt / dt0)^2, where dt0 is
the unshortened step: an implicit spring of constant stiffness. The slip stretches another such
spring, which gives m h; without it, points that carry a load would creep (`points.bodies.rub`).
Contact at nodes has s = 1, h = 0.

Forces act for the time `kick`, and the body moves for dt. At constant angular momentum it rotates
about one principal axis after another, x/2 y/2 z y/2 x/2 (McLachlan 1993; Touma & Wisdom 1994,
"Lie-Poisson integrators for rigid body dynamics in the solar system"), so the energy of a free top
oscillates by O(dt^2) without drift.
"""

from math import atan2, cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import noinline
from karamelo_py.compiler.programs import call_evaluate
from karamelo_py.kernels.arrays import DT
from karamelo_py.kernels.contact import ListedPairs

_NUMBER, _VECTOR, _MATRIX = (np.float64,), (np.float64, 3), (np.float64, (3, 3))
# Vectors have three components in any dimension. Restart files use this layout.
STATE = np.dtype([
    ("x", *_VECTOR), ("v", *_VECTOR), ("spin", *_VECTOR),  # position, velocity, spin
    ("momentum", *_VECTOR),  # angular momentum
    ("q", np.float64, 4),  # rotation since the start (quaternion)
    ("angle", *_VECTOR),  # 2D: rotation about z, may exceed 2 pi; 3D: rotation vector
    ("force", *_VECTOR), ("torque", *_VECTOR),  # of contact in the step, about the centre
    ("R", *_MATRIX),  # rotation matrix of q
    ("move", *_VECTOR),  # displacement of the centre in this step / dt
    ("spread", *_MATRIX),  # velocity gradient: (rotation in this step - 1) / dt
    ("passes", *_NUMBER),  # Newton iterations in this step
    ("failed", *_NUMBER),  # steps that did not converge
])  # fmt: skip
NUMBERS = STATE.itemsize // 8  # numbers in a state; further indices: torque about the origin
CONSTANTS = np.dtype([
    ("mass", *_NUMBER), ("inertia", *_VECTOR),  # principal moments
    ("axes", *_MATRIX),  # principal axes, as columns
    ("start", *_VECTOR),
    ("bound", *_NUMBER),  # largest distance of a point from x
    ("speed", *_NUMBER),  # upper bound of the speeds of points in this step
    ("offset", *_VECTOR),  # centre of mass minus x, in the initial frame
])  # fmt: skip
CONTACT = np.dtype([
    ("at", *_VECTOR), ("normal", *_VECTOR), ("gap", *_NUMBER),
    ("mass", *_NUMBER), ("v", *_VECTOR),  # mass and velocity of the other body
    ("mu", *_NUMBER), ("share", *_NUMBER),  # fraction s of the approach removed
    ("limit", *_NUMBER), ("reach", *_NUMBER),  # largest friction; radius of a point
    ("hold", *_VECTOR), ("local", *_VECTOR),  # h; position in the body's initial frame
    ("usual", *_NUMBER), ("spare", *_NUMBER),  # mean impulse; friction not used in earlier steps
    ("impulse", *_VECTOR),
    # values of the last iteration:
    ("slip", *_VECTOR), ("speed", *_NUMBER), ("push", *_NUMBER), ("rub", *_NUMBER),
    ("bound", *_NUMBER), ("lean", *_NUMBER),  # largest friction, and its derivative by the push
    ("most", *_NUMBER),  # prescribed bound
    ("block", np.int64), ("point", np.int64), ("number", np.int64),  # of a point, and its id
    ("slot", np.int64),  # slot of the force
    ("torque", np.int64),  # slot of the torque, or 0
    ("area", np.int64), ("face", *_NUMBER),  # slot of the area of contact; area of the point
])  # fmt: skip
PASSES_AT_MOST, HALVINGS, BOUNDS_AT_MOST = 60, 12, 60
SOLVED, GOOD_ENOUGH = 1e-26, 1e-16  # fractions of the initial squared residual
# Formulas of a body: prescribed velocity and spin, force and torque, acceleration
LED, LOADED, FALLS, FORMULAS = 0, 6, 12, 15


class Formulas(NamedTuple):
    evaluate: int  # address of the evaluator
    programs: np.ndarray  # (FORMULAS,) arrays.PROGRAM; begin -1: none
    code: np.ndarray
    numbers: np.ndarray
    scratch: np.ndarray


class Solution(NamedTuple):
    """Work arrays of a step, (6,): translation, then rotation."""

    momentum: np.ndarray  # (6,) momentum without contact
    u: np.ndarray  # (6,) velocities
    trial: np.ndarray
    residual: np.ndarray
    trial_residual: np.ndarray
    total: np.ndarray  # (6,) sum of impulses
    link_impulses: np.ndarray  # (6,) impulses of other bodies
    after: np.ndarray  # (6,) momentum with contact
    before: np.ndarray  # centre before the step, (3,)
    mass: np.ndarray  # (6, 6) mass matrix
    slope: np.ndarray  # (6, 7) matrix of the Newton step, right-hand side in the last column
    jacobian: np.ndarray  # (3, 6): A, whose first half is the unit matrix


class FreeBody(NamedTuple):
    field: int  # velocity field, for contact at nodes
    ids: np.ndarray  # (2,) ids of the body's points: first, end
    dofs: np.ndarray  # (6,) int64: 1 free, 0 prescribed
    constants: np.ndarray  # (1,) CONSTANTS
    state: np.ndarray  # (1,) STATE
    numbers: np.ndarray  # (NUMBERS,) view of the state
    slots: np.ndarray  # (k, 2) slots of published values, indices in `numbers`
    formulas: Formulas
    solution: Solution
    contacts: np.ndarray  # (n,) CONTACT
    words: np.ndarray  # (n, w) int64, view of the contacts
    count: np.ndarray  # (1,) int64
    pairs: ListedPairs  # scratch of contact at nodes
    surfaces: tuple  # `kernels.free_bodies.TouchingSurface`


def index_of(field: str) -> int:
    """Return the index of a field of STATE in `FreeBody.numbers`."""
    return STATE.fields[field][1] // 8  # type: ignore[index]


def new_solution() -> Solution:
    arrays = [np.zeros(6) for _ in range(8)]
    return Solution(*arrays, np.zeros(3), np.zeros((6, 6)), np.zeros((6, 7)), np.eye(3, 6))


def records(kind: np.dtype, count: int = 1) -> Any:
    return np.zeros(count, kind).view(np.recarray)


def cross(a, b, k):
    """Return component `k` of the cross product of vectors (3,)."""
    i, j = (k + 1) % 3, (k + 2) % 3
    return a[i] * b[j] - a[j] * b[i]


@noinline
def _turn_about(state, axis, angle):
    q, c, s = state.q, cos(0.5 * angle), sin(0.5 * angle)
    a, b, d, e = q[0], q[1], q[2], q[3]
    x, y, z = s * axis[0], s * axis[1], s * axis[2]
    a, b, d, e = (
        a * c - b * x - d * y - e * z,
        a * x + b * c + d * z - e * y,
        a * y - b * z + d * c + e * x,
        a * z + b * y - d * x + e * c,
    )
    size = 1.0 / sqrt(a * a + b * b + d * d + e * e)
    q[0], q[1], q[2], q[3] = size * a, size * b, size * d, size * e
    set_matrix(state)


@noinline
def set_matrix(state):
    q, R = state.q, state.R
    a, b, c, d = q[0], q[1], q[2], q[3]
    R[0, 0] = 1 - 2 * (c * c + d * d)
    R[0, 1] = 2 * (b * c - a * d)
    R[0, 2] = 2 * (b * d + a * c)
    R[1, 0] = 2 * (b * c + a * d)
    R[1, 1] = 1 - 2 * (b * b + d * d)
    R[1, 2] = 2 * (c * d - a * b)
    R[2, 0] = 2 * (b * d - a * c)
    R[2, 1] = 2 * (c * d + a * b)
    R[2, 2] = 1 - 2 * (b * b + c * c)


@noinline
def _axis(constants, k):
    return constants.axes[0, k], constants.axes[1, k], constants.axes[2, k]


@noinline
def _along_axis(body, k):
    """Return the angular momentum about principal axis `k`."""
    state, (a, b, c), total = body.state[0], _axis(body.constants[0], k), 0.0
    R, L = state.R, state.momentum
    for i in range(3):
        total += L[i] * (R[i, 0] * a + R[i, 1] * b + R[i, 2] * c)
    return total


@noinline
def _drift_about(body, k, dt):
    angle = dt * _along_axis(body, k) / body.constants[0].inertia[k]
    _turn_about(body.state[0], _axis(body.constants[0], k), angle)


@noinline
def _set_spin(body):
    state, constants = body.state[0], body.constants[0]
    state.spin[:] = 0.0
    for k in range(3):
        axis, spin = from_start(state, _axis(constants, k)), _along_axis(body, k)
        for i in range(3):
            state.spin[i] += axis[i] * spin / constants.inertia[k]


@noinline
def _turn_by_spin(body, dt):
    """Rotate by the spin in the step; used if the rotation is partly prescribed."""
    state = body.state[0]
    w = state.spin
    size = sqrt(w[0] ** 2 + w[1] ** 2 + w[2] ** 2)
    if size > 0:
        axis = to_start(state, (w[0] / size, w[1] / size, w[2] / size))
        _turn_about(state, axis, size * dt)


@noinline
def to_start(state, a):
    """Rotate a vector back to the initial frame."""
    R, (x, y, z) = state.R, a
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@noinline
def from_start(state, a):
    R, (x, y, z) = state.R, a
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@noinline
def place_of(state, constants, x):
    """Return the present position of the point initially at `x` (3,)."""
    begin = constants.start
    way = from_start(state, (x[0] - begin[0], x[1] - begin[1], x[2] - begin[2]))
    return way[0] + state.x[0], way[1] + state.x[1], way[2] + state.x[2]


@noinline
def set_mass(body):
    M, state, constants = body.solution.mass, body.state[0], body.constants[0]
    M[:] = 0.0
    for a in range(3):
        M[a, a] = constants.mass
    for k in range(3):
        axis = from_start(state, _axis(constants, k))
        for a in range(3):
            for b in range(3):
                M[3 + a, 3 + b] += constants.inertia[k] * axis[a] * axis[b]


@noinline
def set_jacobian(body, x):
    """Set A (3, 6), with A U the body's velocity at `x`."""
    A, centre = body.solution.jacobian, body.state[0].x
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        A[k, 3 + i], A[k, 3 + j] = x[j] - centre[j], centre[i] - x[i]


def _columns(k):
    """Return the columns of A that may differ from 0 in row `k`."""
    return k, 4 if k == 0 else 3, 4 if k == 2 else 5


@noinline
def velocity_there(body, u, k):
    """Return component `k` of A U."""
    v = 0.0
    for a in _columns(k):
        v += body.solution.jacobian[k, a] * u[a]
    return v


@noinline
def _bound(c):
    """Return the largest friction impulse, and its derivative by the normal impulse."""
    usual, spare = c.mu * max(c.usual, c.push), c.spare + c.mu * c.push
    bound = min(usual, spare, c.limit)
    return bound, c.mu if bound < c.limit and (spare < usual or c.push > c.usual) else 0.0


@noinline
def _set_impulse(body, u, i, dt, bounded):
    """Set the impulse of contact `i` at the velocities `u`.

    With `bounded`, friction is limited by the normal impulse of an earlier pass.
    """
    c = body.contacts[i]
    slip, normal = c.slip, c.normal
    set_jacobian(body, c.at)
    along = square = 0.0
    for k in range(3):
        slip[k] = velocity_there(body, u, k) - c.v[k]
        along += normal[k] * slip[k]
    c.push = c.share * c.mass * max(along - c.gap / dt, 0.0)
    for k in range(3):
        slip[k] += c.hold[k] - along * normal[k]
        square += slip[k] ** 2
    c.bound, c.lean = _bound(c)
    c.speed, c.rub, most = sqrt(square), 0.0, c.most if bounded else c.bound
    if most > 0 and square > 0:
        c.rub = min(c.mass, most / c.speed)
    for k in range(3):
        c.impulse[k] = c.push * normal[k] + c.rub * slip[k]


@noinline
def residual(body, dt, u, rest, bounded):
    """Put M U - P + sum A^T p into `rest`; return its square, in units of energy."""
    work = body.solution
    M, total, square = work.mass, work.total, 0.0
    total[:] = 0.0
    for i in range(body.count[0]):
        _set_impulse(body, u, i, dt, bounded)
        for k in range(3):
            for a in _columns(k):
                total[a] += work.jacobian[k, a] * body.contacts[i].impulse[k]
    size = M.shape[0]
    for a in range(size):
        rest[a] = total[a] - work.momentum[a]
        for b in range(size):
            rest[a] += M[a, b] * u[b]
        if body.dofs[a]:
            square += rest[a] * rest[a] / M[a, a]
    return square


@noinline
def add_slope(body, i, bounded):
    """Add A^T (dp/dr) A of contact `i` to the slope; its impulse is known."""
    c, A, J = body.contacts[i], body.solution.jacobian, body.solution.slope
    if not (c.push > 0 or c.rub > 0):
        return
    set_jacobian(body, c.at)
    stiff, slips = c.share * c.mass if c.push > 0 else 0.0, 0.0 < c.rub < c.mass
    for k in range(3):
        for j in range(3):
            along = c.normal[k] * c.normal[j]
            slope = stiff * along + c.rub * ((1.0 if k == j else 0.0) - along)
            if slips:
                way = c.slip[k] / c.speed
                slope -= c.rub * way * c.slip[j] / c.speed
                slope += 0.0 if bounded else c.lean * stiff * way * c.normal[j]
            for a in _columns(k):
                for b in _columns(j):
                    J[a, b] += slope * A[k, a] * A[j, b]


@noinline
def solve_system(J):
    """Solve J (m, m + 1) by pivoted elimination; the solution replaces the last column."""
    size = J.shape[0]
    for k in range(size):
        best = k
        for a in range(k + 1, size):
            if abs(J[a, k]) > abs(J[best, k]):
                best = a
        if best != k:
            for b in range(k, size + 1):
                J[k, b], J[best, b] = J[best, b], J[k, b]
        for a in range(k + 1, size):
            factor = J[a, k] / J[k, k]
            if factor != 0:
                for b in range(k, size + 1):
                    J[a, b] -= factor * J[k, b]
    for back in range(size):
        k = size - 1 - back
        for b in range(k + 1, size):
            J[k, size] -= J[k, b] * J[b, size]
        J[k, size] /= J[k, k]


@noinline
def _iterate(body, dt, bounded):
    """Take Newton steps, halved if needed; return True if they have converged."""
    work = body.solution
    M, J, energy = work.mass, work.slope, 0.0
    size = residual(body, dt, work.u, work.residual, bounded)
    for a in range(6):
        energy += work.momentum[a] ** 2 / M[a, a]
    scale = max(size, GOOD_ENOUGH * energy)
    for _ in range(PASSES_AT_MOST):
        if size <= SOLVED * scale:
            return True
        body.state[0].passes += 1
        J[:, :6], J[:, 6] = M, work.residual
        for i in range(body.count[0]):
            add_slope(body, i, bounded)
        for a in range(6):
            if not body.dofs[a]:
                for b in range(6):
                    J[a, b] = J[b, a] = 0.0
                J[a, a], J[a, 6] = 1.0, 0.0
        solve_system(J)
        fraction, better, now = 1.0, False, size
        for _ in range(HALVINGS):
            for a in range(6):
                work.trial[a] = work.u[a] - fraction * J[a, 6]
            now = residual(body, dt, work.trial, work.trial_residual, bounded)
            if now < size:
                better = True
                break
            fraction *= 0.5
        if not better:
            residual(body, dt, work.u, work.residual, bounded)
            return size <= GOOD_ENOUGH * scale
        work.u[:], work.residual[:] = work.trial, work.trial_residual
        size = now
    return False


@noinline
def bounds_are_settled(contacts, count):
    """Bound friction by the last normal impulses; return True if the bounds have not changed."""
    change = largest = 0.0
    for i in range(count):
        c = contacts[i]
        change, largest = max(change, abs(c.bound - c.most)), max(largest, c.bound)
        c.most = c.bound
    return change <= 1e-10 * largest


@noinline
def solve(body, dt):
    state = body.state[0]
    state.passes = 0
    if _iterate(body, dt, False):
        return
    # With friction bounds by the previous normal impulses, the problem is convex.
    for _ in range(BOUNDS_AT_MOST):
        if bounds_are_settled(body.contacts, body.count[0]):
            return
        _iterate(body, dt, True)
    state.failed += 1


@noinline
def _value(body, values, k):
    """Return the present value of formula `k` of a body, 0 if there is none."""
    evaluate, programs, code, numbers, scratch = body.formulas
    program = programs[k]
    if program.begin < 0:
        return 0.0
    if program.begin == program.end:
        return numbers[program.first]
    call_evaluate(
        evaluate, code, numbers, values, scratch,
        program.begin, program.end, program.first, program.last, 1, 6,
    )  # fmt: skip
    return scratch[6, 0]


@noinline
def start_step(body, control):
    """Find momentum and velocities without contact."""
    state, work, constants = body.state[0], body.solution, body.constants[0]
    kick, values, mass = control.step[0].kick, control.values, constants.mass
    set_mass(body)
    c, load = constants.offset, work.after
    arm = from_start(state, (c[0], c[1], c[2]))
    for k in range(3):
        load[k] = _value(body, values, LOADED + k) + mass * _value(body, values, FALLS + k)
        moment = _value(body, values, LOADED + 3 + k)
        work.momentum[3 + k] = state.momentum[k] + kick * moment
    for k in range(3):
        work.momentum[k] = mass * state.v[k] + kick * load[k]
        work.momentum[3 + k] += kick * cross(arm, load, k)
    for a in range(6):
        work.u[a] = 0.0 if body.dofs[a] else _value(body, values, LED + a)
    _velocities_of(body, work.momentum)
    u = work.u
    speed = sqrt(u[3] ** 2 + u[4] ** 2 + u[5] ** 2) * constants.bound
    constants.speed = sqrt(u[0] ** 2 + u[1] ** 2 + u[2] ** 2) + speed


@noinline
def _velocities_of(body, momentum):
    """Solve M U = P for the free components of U; the others are prescribed."""
    work = body.solution
    M, J, size = work.mass, work.slope, work.mass.shape[0]
    for a in range(size):
        for b in range(size):
            J[a, b] = M[a, b] if body.dofs[a] else (1.0 if a == b else 0.0)
        J[a, 6] = momentum[a] if body.dofs[a] else work.u[a]
    solve_system(J)
    work.u[:] = J[:, 6]


@noinline
def work_of(body):
    """Return half of the work that the contact in the step would do at the present velocity."""
    state, total, work = body.state[0], body.solution.total, 0.0
    for k in range(3):
        work += 0.5 * (total[k] * state.v[k] + total[3 + k] * state.spin[k])
    return work


@noinline
def finish_step(body, control, dimension):
    """Set the momentum after contact, move the body, and publish its values."""
    state, work, values = body.state[0], body.solution, control.values
    kick, dt, total = control.step[0].kick, values[DT], work.total
    for k in range(3):
        state.force[k] = (work.link_impulses[k] - total[k]) / kick
        state.torque[k] = (work.link_impulses[3 + k] - total[3 + k]) / kick
    for a in range(6):
        work.after[a], work.link_impulses[a] = work.momentum[a] - total[a], 0.0
    _velocities_of(body, work.after)
    u, M, partly = work.u, work.mass, False
    for k in range(3):
        state.v[k], state.spin[k] = u[k], u[3 + k]
        state.momentum[k] = M[3 + k, 3] * u[3] + M[3 + k, 4] * u[4] + M[3 + k, 5] * u[5]
        partly = partly or not body.dofs[3 + k]
    move(body, dt, dimension, partly)
    publish(body, values)


@noinline
def move(body, dt, dimension, by_spin):
    """Move a body by its velocity; rotate it by its spin or, if free, by its angular momentum."""
    state, old = body.state[0], body.solution.slope
    old[:3, :3] = state.R
    if by_spin:
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
            rotation = 0.0
            for c in range(3):
                rotation += state.R[a, c] * old[b, c]
            state.spread[a, b] = (rotation - (1.0 if a == b else 0.0)) / dt
        body.solution.before[a] = state.x[a]
        state.move[a] = body.solution.u[a]
        state.x[a] += dt * state.move[a]
    _set_angle(state, dt, dimension)


@noinline
def publish(body, values):
    for k in range(body.slots.shape[0]):
        column = body.slots[k, 1]
        about = _about_origin(body, column - NUMBERS) if column >= NUMBERS else body.numbers[column]
        values[body.slots[k, 0]] = about


@noinline
def kinetic_energy(body):
    """Return the kinetic energy, with the mass matrix at the start of this step."""
    u, M, energy = body.solution.u, body.solution.mass, 0.0
    for a in range(6):
        for b in range(6):
            energy += 0.5 * u[a] * M[a, b] * u[b]
    return energy


@noinline
def _set_angle(state, dt, dimension):
    if dimension < 3:
        state.angle[2] += dt * state.spin[2]
        return
    q = state.q
    sign = 1.0 if q[0] >= 0 else -1.0
    size = sqrt(q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
    angle = 2.0 * atan2(size, sign * q[0])
    for k in range(3):
        state.angle[k] = sign * q[1 + k] * (angle / size if size > 0 else 2.0)


@noinline
def _about_origin(body, k):
    """Return the torque of contact about the origin, with the centre before this step."""
    state, before, i, j = body.state[0], body.solution.before, (k + 1) % 3, (k + 2) % 3
    return state.torque[k] + before[i] * state.force[j] - before[j] * state.force[i]
