"""Contact of freely moving rigid bodies, and the rows that they add to a step."""

from math import inf, sqrt
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import caller_of, kernel, noinline, point_function
from karamelo_py.compiler.fields import load_vector
from karamelo_py.compiler.threads import shared_out
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels import arrays, rigid_links
from karamelo_py.kernels import rigid_motion as motion
from karamelo_py.kernels.contact import Bodies, SeparateFields, closing_part, has_nodes, list_pairs
from karamelo_py.kernels.surfaces import Surface, closest, depth, encloses, place_on, slopes
from karamelo_py.kernels.table import AtNodes, InThreads, Once, each_node_apart, each_point
from karamelo_py.kernels.totals import CONTACT_LOSS, WORK, add_to
from karamelo_py.kernels.touching import ASIDE, CALL, direction_of
from karamelo_py.kernels.views import location_at, state_at, volume_of
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.bodies import NEW, face, radius
from karamelo_py.points.grid import node_position, pick
from karamelo_py.points.kinematics import zero_vector
from karamelo_py.points.laws.rigid import Rigid

SOFT = 0.1  # fraction of penetration removed per step
# Columns of `grip`: spring force (3), mean load, unused friction, step of the last touch, position
# in the body (3).
GRIP = 9
ROUNDING = 1e-9  # relative
END = -1  # number of no point, after the last contact of a tile
# Last search for the surface from a point, in the initial frame of the body
SEEN = np.dtype([
    ("at", np.float64, 3),
    ("within", np.float64),  # depth, at most the reach of the search
    ("face", np.int64),  # 1 + nearest face, or 0
])  # fmt: skip
DEEP = 0.125  # penetration in cells above which the spring hardens, for heavy bodies on few points

_call = caller_of(CALL)


class TouchingSurface(NamedTuple):
    """Surface of a body, and the points it touches."""

    shape: arrays.Tag
    members: np.ndarray  # (N,) bool by id
    seen: np.ndarray  # (N,) SEEN by id
    grip: np.ndarray  # (N, GRIP) by id; (0, GRIP) without friction
    mu: float
    limit: float  # largest frictional stress
    slot: int  # slot of the force on points
    torque: int  # slot of the torque, or 0
    area: int  # slot of the area of contact
    lost: int  # address of a function for points from which no direction leads out of the shape


def _stencil_of(s, points, p):
    grid, now = record(s.grids, points.grid[p]), s.control.motion[0].now
    location = location_at(s.basis, s.kin, points.x[now] if s.frame.moves else points.home, p)
    return grid, locate(s.basis, s.kin, grid, location)


def _look(seen, x, within, face):
    for c in range(len(x)):
        seen.at[c] = x[c]
    seen.within, seen.face = within, face + 1


@point_function(otherwise=True)
def touched(shape, kin, x, about, seen):
    """Return the depth at `x`, and the unit direction out (0 if unknown or the surface is far)."""
    close, _, h, _ = about
    within = depth(shape, kin, x, max(close, h))
    _look(seen, x, within, -1)
    return _way_out(shape, kin, x, about, within)


@noinline
def _way_out(shape, kin, x, about, within):
    close, ball, h, _ = about
    if within <= -close:
        return within, x - x
    reach, step = h + ball, ASIDE * h
    if within > ball:
        within = depth(shape, kin, x, reach)
    return within, direction_of(slopes(shape, kin, x, reach, (within, step)), step)


@touched.on(Surface)
def _touched_faces(shape, kin, x, about, seen):
    close, _, h, moved = about
    side = 1.0 if seen.within > 0 else -1.0
    if abs(seen.within) <= moved:  # the point may have passed a face
        side = 1.0 if encloses(kin, shape, x) else -1.0
    square, face = closest(kin, shape, x, max(close, h), seen.face - 1)
    away = sqrt(square)
    _look(seen, x, side * away, face)
    if side < 0 and away > close:
        return -away, x - x
    if face < 0 or not 0.01 * ASIDE * h < away:
        return _way_out(shape, kin, x, about, side * away)
    # finite differences would take six searches
    return side * away, (-side / away) * (x - place_on(kin, shape, face, x))


def _is_near(body, kin, x, p, square):
    """Return True if point `p` is within a distance, given its square, of the body's centre."""
    away = 0.0
    for c in range(kin.dimension):
        away += (x[c, p] - body.state[0].x[c]) ** 2
    return away <= square


@noinline
def _list_point(body, surface, s, block, contact):
    """Record a contact of a point with a surface; return True if it touches."""
    kin, points, d, p = s.kin, block.points, s.kin.dimension, contact.point
    state, constants = body.state[0], body.constants[0]
    times, dt = s.control.step[0], s.control.values[arrays.DT]
    h, none = s.grids.h[0], zero_vector(s.kin, 0.0)
    x, number = load_vector(kin, points.x[s.control.motion[0].now], p), points.id[p]
    arm = [x[c] - state.x[c] if c < d else 0.0 for c in range(3)]
    local = motion.to_start(state, (arm[0], arm[1], arm[2]))
    y = none._make([local[c] + constants.start[c] for c in range(d)])
    seen = surface.seen[number]
    moved = (1 + ROUNDING) * sqrt((y - none._make([seen.at[c] for c in range(d)])).squared())
    # Reject points that cannot reach the surface: the depth changes by at most `moved`.
    speed = 0.0
    for c in range(d):
        speed += abs(points.v[c, p])
    law, material = state_at(kin, points, block.laws, p)
    volume = volume_of(kin, points, law, material, p)
    ball = radius(kin, volume, x)
    close = min(2 * dt * (speed + constants.speed), h) + ball
    if surface.limit < inf:
        close = max(close, 2 * ball)
    if seen.within + moved < -close:
        return False
    within, way = touched(surface.shape, kin, y, (close, ball, h, moved), seen)
    if way.squared() == 0:
        if within > 0 and _call(surface.lost, number) == 0:
            raise RuntimeError("a point has no way out")
        return False
    out = [way[c] if c < d else 0.0 for c in range(3)]
    normal = motion.from_start(state, (out[0], out[1], out[2]))
    for c in range(3):
        contact.normal[c], contact.v[c] = normal[c], 0.0
        contact.at[c] = arm[c] + state.x[c]
    grid, stencil = _stencil_of(s, points, p)
    for node in range(support(s.basis, kin)):
        n, weight, _ = entry(s.basis, kin, grid, stencil, node)
        for c in range(d):
            contact.v[c] += weight * s.nodes.update[n, c]
    contact.gap, contact.reach = -within - ball, ball
    contact.mass, contact.mu = points.mass[p], surface.mu
    deep = max((within + ball) / (DEEP * h), 1.0)
    fraction = SOFT * dt * times.kick / (times.contact_dt * times.contact_kick)
    contact.share = min(deep * deep * fraction, 1.0)
    contact.most, contact.face, contact.limit = 0.0, face(kin, volume, x), inf
    if kin.hoops:  # the area is on the surface, not at the radius of the point
        contact.face *= max(1 + within * normal[0] / x[0], 0.0) if x[0] > 0 else 1.0
    contact.number = number
    for c in range(3):
        contact.local[c] = local[c]
    _recall(surface.grip, s.control, state, contact)
    return True


@noinline
def _recall(grip, control, state, contact):
    """Restore the friction state of a point that also touched in the last step."""
    contact.usual = contact.spare = 0.0
    contact.hold[:] = 0.0
    step, number = control.values[arrays.TIMESTEP], contact.number
    if number >= len(grip) or grip[number, 5] != step or not step > 0:
        return
    memory, times, at, along = grip[number], control.step[0], contact.local, 0.0
    contact.usual, contact.spare = times.kick * memory[3], times.kick * (1 - NEW) * memory[4]
    stiff = SOFT * times.kick / (times.contact_dt * times.contact_kick)
    slid = motion.from_start(state, (memory[6] - at[0], memory[7] - at[1], memory[8] - at[2]))
    for c in range(3):  # computed from positions, as velocities are noisy
        contact.hold[c] = times.kick / contact.mass * memory[c] + stiff * slid[c]
        along += contact.normal[c] * contact.hold[c]
    for c in range(3):
        contact.hold[c] -= along * contact.normal[c]


@noinline
def _retain(grip, control, contact):
    """Update the friction state of a point, as `points.bodies.rub` does."""
    if contact.number >= len(grip) or not contact.gap < 0:
        return
    memory, kick = grip[contact.number], control.step[0].kick
    mean = contact.usual + NEW * (contact.push - contact.usual)
    bound, square = min(contact.mu * max(mean, contact.push), contact.limit), 0.0
    for c in range(3):
        memory[c], memory[6 + c] = contact.mass / kick * contact.hold[c], contact.local[c]
        square += memory[c] ** 2
    size = sqrt(square) * kick
    for c in range(3):
        memory[c] *= bound / size if size > bound else 1.0
    unused = contact.spare + contact.mu * contact.push - contact.rub * contact.speed
    memory[3], memory[4] = mean / kick, max(unused, 0.0) / kick
    memory[5] = control.values[arrays.TIMESTEP] + 1


def _is_near_tile(body, s, tiling, t, square):
    """Return True if points of tile `t` may be within a distance, given its square, of the body."""
    if not s.frame.moves:  # tiles are of reference locations
        return True
    grid, away, d = record(s.grids, tiling.grid[t]), 0.0, s.kin.dimension
    for c in range(d):
        low, at = pick(c, grid.x0, grid.y0, grid.z0), body.state[0].x[c]
        first, last = [low + tiling.box[t, k] * grid.spacing for k in (c, d + c)]
        away += max(max(first - at, at - last), 0.0) ** 2
    return away <= square


@shared_out
def _list_tile(body, surface, s, block, t):
    """List contacts of a tile's points, the first one at the tile's first point."""
    points, x, tiling = block.points, block.points.x[s.control.motion[0].now], block.tiling
    square = (body.constants[0].bound + 2 * s.grids.h[0]) ** 2
    first, end = tiling.range[t, 0], tiling.range[t, 1]
    found = body.count[0] + first
    for p in range(first, end if _is_near_tile(body, s, tiling, t, square) else first):
        contact = body.contacts[found]
        contact.point = p
        if _is_near(body, s.kin, x, p, square) and surface.members[points.id[p]]:
            found += 1 if _list_point(body, surface, s, block, contact) else 0
    if found < body.count[0] + end:
        body.contacts[found].point = END


@noinline
def _list_points(body, surface, s, block, mode):
    first, tiles, points_of = body.count[0], block.tiling.count[0], block.tiling.range
    _list_tile(mode, tiles, body, surface, s, block)
    for t in range(tiles):
        for q in range(first + points_of[t, 0], first + points_of[t, 1]):
            if body.contacts[q].point == END:
                break
            body.words[body.count[0]] = body.words[q]
            contact = body.contacts[body.count[0]]
            contact.slot, contact.torque = surface.slot, surface.torque
            contact.area = surface.area
            body.count[0] += 1


@noinline
def _limit_friction(body, surface, kick, first):
    """Distribute the area of the surface over the points that touch it.

    A layer one point thick has the area of the surface, but some of its points do not touch.
    """
    layer = pressed = 0.0
    for i in range(first, body.count[0]):
        contact = body.contacts[i]
        layer += contact.face if contact.gap < contact.reach else 0.0
        pressed += contact.face if contact.gap < 0 else 0.0
    most = kick * surface.limit * (layer / pressed if pressed > 0 else 1.0)
    for i in range(first, body.count[0]):
        body.contacts[i].limit = most * body.contacts[i].face


@noinline
def _hold(s, slot, x, c, force):
    """Add a component of a force to the reaction of the fix that holds a node at `x`."""
    values, turning = s.control.values, s.bodies.torques[slot]
    values[slot + c] += force
    if turning:
        i, j = (c + 1) % 3, (c + 2) % 3
        values[turning + i] += (x[j] if j < s.kin.dimension else 0.0) * force
        values[turning + j] -= (x[i] if i < s.kin.dimension else 0.0) * force


@noinline
def _give_to_points(body, s, block, number, measures):
    kin, nodes, points, d = s.kin, s.nodes, block.points, s.kin.dimension
    kick = s.control.step[0].kick
    for i in range(body.count[0]):
        contact = body.contacts[i]
        if contact.block != number:
            continue
        p = contact.point
        grid, stencil = _stencil_of(s, points, p)
        for node in range(support(s.basis, kin)):
            n, weight, _ = entry(s.basis, kin, grid, stencil, node)
            for c in range(d):
                impulse, reaction = weight * contact.impulse[c], s.bodies.held[n, c]
                if reaction and measures:
                    _hold(s, reaction - 1, node_position(grid, n), c, -impulse / kick)
                elif nodes.sums[n, arrays.MASS] > 0 and not (reaction or measures):
                    change = impulse / nodes.sums[n, arrays.MASS]
                    nodes.update[n, c] += change
                    nodes.update[n, arrays.of_change(kin) + c] += change
        if measures:
            s.control.values[contact.area] += contact.face if contact.push > 0 else 0.0
            for c in range(d):
                s.control.values[contact.slot + c] += contact.impulse[c] / kick
            for c in range(3 if contact.torque else 0):
                torque = motion.cross(contact.at, contact.impulse, c) / kick
                s.control.values[contact.torque + c] += torque


@noinline
def _work_on_points(body, s, block, number, now):
    """Add the work on points, with mean nodal velocities; `now` (N, d) are those after the step."""
    kin, nodes, points, work = s.kin, s.nodes, block.points, 0.0
    first = arrays.of_momentum(kin)
    for i in range(body.count[0]):
        contact = body.contacts[i]
        if contact.block != number:
            continue
        grid, stencil = _stencil_of(s, points, contact.point)
        for node in range(support(s.basis, kin)):
            n, weight, _ = entry(s.basis, kin, grid, stencil, node)
            mass = nodes.sums[n, arrays.MASS]
            for c in range(kin.dimension):
                if mass > 0 and not s.bodies.held[n, c]:
                    mean = 0.5 * (nodes.sums[n, first + c] / mass + now[n, c])
                    work += weight * contact.impulse[c] * mean
    add_to(s.control.totals, WORK, work)
    add_to(s.control.totals, CONTACT_LOSS, -work)


@noinline
def _lead_nodes(body, s):
    first = arrays.of_momentum(s.kin)
    for r in range(1, 1 + s.spans[0, 0]):
        reached = has_nodes(s.contact, s.spans, r, body.field)
        for n in range(s.spans[r, 0], s.spans[r, 1] if reached else 0):
            mass = s.nodes.sums[n, arrays.MASS]
            if n // s.contact.stride == body.field and mass > 0:
                motion.set_jacobian(body, node_position(record(s.grids, body.field), n))
                for k in range(s.kin.dimension):
                    v = motion.velocity_there(body, body.solution.u, k)
                    s.nodes.sums[n, first + k], s.nodes.update[n, k] = mass * v, v


@noinline
def _list_nodes(body, s):
    contact, nodes, d = s.contact, s.nodes, s.kin.dimension
    step = int(s.control.values[arrays.TIMESTEP]) + 1
    at_nodes = Bodies(contact, s.kin, nodes)
    count = list_pairs(at_nodes, s.grids, s.spans, body.pairs, body.field)
    for q in range(count):
        n, m = body.pairs.nodes[q, 0], body.pairs.nodes[q, 1]
        sign = 1.0
        if m // contact.stride == body.field:
            n, m, sign = m, n, -1.0
        a, b = n // contact.stride, m // contact.stride
        if a != body.field or contact.rigid[b]:
            continue
        one = body.contacts[body.count[0]]
        x = node_position(record(s.grids, a), n)
        for c in range(3):
            one.at[c] = x[c] if c < d else 0.0
            one.normal[c] = sign * body.pairs.normals[q, c] if c < d else 0.0
            one.v[c] = nodes.update[m, c] if c < d else 0.0
        last = abs(contact.touched[n, b] if a < b else contact.touched[m, a])
        memory = max(contact.memory[a], contact.memory[b])
        lasts = last > 0 and last >= step - memory
        closing = closing_part(Bodies(contact, s.kin, nodes), (n, m), x, s.grids.h[0])
        one.gap = (closing if lasts else 1.0) * max(body.pairs.gaps[q], 0.0)
        one.mass, one.mu, one.share = nodes.sums[m, arrays.MASS], contact.friction[a, b], 1.0
        one.most, one.usual, one.spare, one.limit = 0.0, 0.0, 0.0, inf
        one.hold[:] = 0.0
        body.count[0] += 1


@noinline
def _reaction(body, s):
    total, centre, values = body.solution.total, body.state[0].x, s.control.values
    kick, force, torque = s.control.step[0].kick, s.contact.slot, s.contact.torque
    for k in range(3):
        total[k] = -kick * values[force[body.field] + k]
    for k in range(3):
        total[3 + k] = -kick * values[torque[body.field] + k] - motion.cross(centre, total, k)


@noinline
def _add_links(body, s):
    impulses, centre, values = body.solution.link_impulses, body.state[0].x, s.control.values
    kick, force, torque = s.control.step[0].kick, s.contact.slot, s.contact.torque
    for k in range(3):
        turning = impulses[3 + k] + motion.cross(centre, impulses, k)
        values[force[body.field] + k] += impulses[k] / kick
        values[torque[body.field] + k] += turning / kick


@noinline
def _follow(s, n, again):
    """Let a node of a body follow the surface that it touches, in the velocity that strains points.

    A light body may be faster than the surface until the gap is closed. If the surface were
    strained by the velocity of the body, this would add more energy than the body has. `again`: the
    updated velocity v* is known and used.
    """
    contact, nodes = s.contact, s.nodes
    for body in s.bodies.bodies:
        if n // contact.stride == body.field and nodes.sums[n, arrays.MASS] > 0:
            for other in range(contact.slot.size):
                m = n + (other - body.field) * contact.stride
                if not contact.rigid[other] and nodes.sums[m, arrays.MASS] > 0:
                    for k in range(s.kin.dimension):
                        v = nodes.update[m, k] if again else nodes.velocity[m, k]
                        nodes.velocity[n, k] = v


@noinline
def _list_contacts(body, s, mode):
    body.count[0] = 0
    for surface in body.surfaces:
        s.control.values[surface.area] = 0.0
        for c in range(s.kin.dimension):
            s.control.values[surface.slot + c] = 0.0
        for c in range(3 if surface.torque else 0):
            s.control.values[surface.torque + c] = 0.0
        first = body.count[0]
        for number, block in enumerate(s.blocks):
            begin = body.count[0]
            _list_points(body, surface, s, block, mode)
            for i in range(begin, body.count[0]):
                body.contacts[i].block = number
        _limit_friction(body, surface, s.control.step[0].kick, first)
    if isinstance(s.contact, SeparateFields):
        _lead_nodes(body, s)
        _list_nodes(body, s)


@noinline
def _push(body, s):
    if isinstance(s.contact, SeparateFields):
        _lead_nodes(body, s)
    else:
        for number, block in enumerate(s.blocks):
            _give_to_points(body, s, block, number, False)


@kernel
def _meet(s, mode):
    bodies, links = s.bodies.bodies, s.bodies.links
    if isinstance(links, rigid_links.Links):
        for body in bodies:
            motion.start_step(body, s.control)
        if rigid_links.find(links, bodies, s.control, s.kin):
            for body in bodies:
                _list_contacts(body, s, mode)
            rigid_links.solve(links, bodies, s.control)
            for body in bodies:
                _push(body, s)
            return
    for body in bodies:
        motion.start_step(body, s.control)
        _list_contacts(body, s, mode)
        motion.solve(body, s.control.values[arrays.DT])
        _push(body, s)


@kernel
def _part(s):
    energy = 0.0
    for body in s.bodies.bodies:
        if isinstance(s.contact, SeparateFields):
            _reaction(body, s)
            _add_links(body, s)
        else:
            for number, block in enumerate(s.blocks):
                _give_to_points(body, s, block, number, True)
            for surface in body.surfaces:
                for i in range(body.count[0]):
                    if body.contacts[i].slot == surface.slot:
                        _retain(surface.grip, s.control, body.contacts[i])
        before = motion.work_of(body)
        motion.finish_step(body, s.control, s.kin.dimension)
        add_to(s.control.totals, CONTACT_LOSS, before + motion.work_of(body))
        energy += motion.kinetic_energy(body)
    s.control.energy[0].of_bodies = energy


def _lead_point(s, block, p):
    """Give a point of a body its mean velocity in the step, for an exact displacement."""
    points, d, now = block.points, s.kin.dimension, s.control.motion[0].now
    for body in s.bodies.bodies:
        state, before = body.state[0], body.solution.before
        for c in range(d if body.ids[0] <= points.id[p] < body.ids[1] else 0):
            v = state.move[c]
            for k in range(d):
                v += state.spread[c, k] * (points.x[now, k, p] - before[k])
            points.v[c, p] = v


def _count_work(velocity_of):
    @kernel
    def count(s):
        for body in s.bodies.bodies:
            for number, block in enumerate(s.blocks):
                _work_on_points(body, s, block, number, velocity_of(s.nodes))

    return (Once(count),)


class NoBodies(NamedTuple):
    rows_first = rows_last = rows_before = rows_after = rows_work = ()


class FreeBodies(NamedTuple):
    """Free rigid bodies, and the rows that they add to a step."""

    bodies: tuple[motion.FreeBody, ...]
    held: np.ndarray  # (N, d) 1 + slot of the reaction where v is prescribed, else 0
    torques: np.ndarray  # (values,) slot of the torque of a force's slot, or 0
    links: rigid_links.NoLinks | rigid_links.Links
    rows_first = (InThreads(_meet),)
    rows_last = Once(_part), each_point(_lead_point, Rigid)
    rows_before = (each_node_apart(lambda s, n: _follow(s, n, False)),)
    rows_after = (each_node_apart(lambda s, n: _follow(s, n, True)),)
    rows_work = ()


class BodiesAtPoints(FreeBodies):
    """Bodies without contact at nodes."""

    rows_last = (*FreeBodies.rows_last, AtNodes(arrays.POST_CONTACT, arrays.ON_UPDATE))
    rows_before = ()
    rows_after = _count_work(lambda nodes: nodes.velocity)
    rows_work = _count_work(lambda nodes: nodes.update)
