"""Compiled monitor of energy and temperatures.

Kinetic plus stored plus dissipated energy minus the work of loads must not grow. Velocities belong
to the middle of a step and stresses to its end, so two consecutive steps are combined, with
second-order accuracy. Growth is relative to the energy without the drift of centres of mass, which
could hide vibrations. The checks also count the cells through which stressed material moves
(`note_crossing`), as a linear basis in the updated frame then loses stress.
"""

from math import exp, inf, sqrt

from karamelo_py.compiler import all_lanes, at_hand, kernel, noinline, real
from karamelo_py.compiler.fields import field, load, load_vector, store
from karamelo_py.compiler.lanes import added, of_present
from karamelo_py.compiler.threads import shared_out
from karamelo_py.kernels import totals
from karamelo_py.kernels.arrays import TIME, TIMESTEP, first_from, known_to_laws, matter_of
from karamelo_py.kernels.equations.internal_force import WorkOfForces
from karamelo_py.kernels.equations.node_updates import WorkAtNodes
from karamelo_py.kernels.equations.pore_water import RelativeVelocity
from karamelo_py.kernels.equations.transfer_loss import TransferLoss
from karamelo_py.kernels.equations.twist import VelocityAround
from karamelo_py.kernels.lanes import lanes_with, points_from
from karamelo_py.kernels.records import put_at
from karamelo_py.kernels.views import state_at
from karamelo_py.points.basis.linear import PER_CELL
from karamelo_py.points.kinematics import dot, free_from
from karamelo_py.points.laws import (
    dissipated_energy,
    energy_density,
    heat_capacity,
    is_rigid,
    specific_volume,
    temperature,
)
from karamelo_py.points.laws.across import Across
from karamelo_py.points.laws.pore_water import Saturated, water_content

LOOK = 10  # steps between checks
FEW = 3  # number of first checks compared before the first window is full
LOOKS = 10  # checks per window
GROWTH = 0.01  # growth per window for a warning
WITHIN = 0.1  # growth since the start for a warning
DRIFTING = 1e-3  # smallest unit / drift energy; relevant vibrations exceed it
BOUND = 10.0  # gain / (initial energy + work of loads) above which a run stops
ROUND_OFF = 1e-14  # fraction of m c^2 below which energy is noise
COARSE = 1000.0  # strain in units of round-off below which it is noise
ENERGIES, OF_SOLID = 3, 6  # columns of tile reports
HEAT_NOISE = 1e-4  # tolerated fraction of a uniform temperature
OVERSHOOT = 0.1  # overshoot / range of source temperatures above which a run stops
# Tolerated step / stable step of conduction, up to which null-space temperatures decay
# (measured with 2 points per cell: 4, and 5.8 without convection).
BORNE = 4.0


def solid_of(firsts, number):
    return first_from(firsts, 0, firsts.size, number + 1) - 1


def energies_of(kin, points, laws, p):
    """Return mass, velocity, kinetic, elastic, and elastic plus dissipated energy of a point."""
    law, state = state_at(kin, points, laws, p)
    mass = real(of_present(p, points.mass[p]), 0.0)
    v = tuple([real(x, 0.0) for x in load_vector(kin, points.v, p)])
    elastic = energy_density(law, kin, state)
    energy = elastic + dissipated_energy(law, kin, state)
    volume = mass * real(specific_volume(law), 0.0)
    return mass, v, 0.5 * mass * dot(v, v), volume * real(elastic, 0.0), volume * real(energy, 0.0)


@shared_out
def _look_at_shares(matter, gone, tiling, firsts, k):
    (kin, points, laws), tiling = at_hand(matter), at_hand(tiling)
    lanes = lanes_with((), laws, points.mass)
    for position in range(tiling.share[k], tiling.share[k + 1]):
        t = tiling.order[position]
        start, end = tiling.range[t, 0], tiling.range[t, 1]
        solid = solid_of(firsts, points.id[start])
        begin, behind = firsts[solid], firsts[solid + 1]
        kinetic = stored = lost = 0.0
        total = (0.0,) * (2 + 2 * kin.dimension)
        for q in range(start, end, lanes.width):
            p = points_from(lanes, q, end)
            mass, v, of_motion, elastic, of_strain = energies_of(kin, points, laws, p)
            kinetic, stored = added(kinetic, of_motion), added(stored, of_strain)
            for one in load(gone, p, (mass,)):
                lost = added(lost, real(of_present(p, one), 0.0))
            weighed = (mass, *[mass * x for x in v], elastic, *[elastic * x for x in v])
            more = zip(total, weighed, strict=True)
            total = tuple([added(old, x) for old, x in more])
            if not all_lanes((points.id[p] >= begin) & (points.id[p] < behind)):
                solid = -1
        put_at(tiling.report, t, ENERGIES, (kinetic, stored, lost, solid, *total))


@kernel
def _sum_energies(mode, matter, gone, tiling, control):
    _look_at_shares(mode, tiling.count[1], matter, gone, tiling, control.firsts)
    for t in range(tiling.count[0]):
        totals.add_to(control.totals, totals.KINETIC, tiling.report[t, ENERGIES])
        totals.add_to(control.totals, totals.STORED, tiling.report[t, ENERGIES + 1])
        totals.add_to(control.totals, totals.TRANSFER_LOSS, tiling.report[t, ENERGIES + 2])


MORE = VelocityAround, RelativeVelocity, WorkOfForces


def more_of(block):
    """Return the law and the fields that add kinds of energy or work, or empty tuples."""
    law = block.laws if isinstance(block.laws, (Across, Saturated)) else ()
    return law, tuple([one for one in block.points.fields if type(one) in MORE])


def take_more(kin, points, more, p):
    """Return energy of rotation and water, and work of forces and water, which is set to 0."""
    laws, (around, relative, work) = more[0], [field(more[1], kind) for kind in MORE]
    kinetic = done = 0.0
    if around is not None:
        v = float(around[0, p])
        kinetic += 0.5 * float(points.mass[p]) * v * v
    if isinstance(laws, Saturated):
        law, state = state_at(kin, points, laws, p)
        v = load_vector(kin, points.v, p) + load_vector(kin, relative, p)
        mass = points.mass[p] * specific_volume(law) * water_content(law, kin, state)
        kinetic += float(0.5 * mass * dot(v, v))
    if isinstance(laws, Across):
        law, state = state_at(kin, points, laws, p)
        done += float(points.mass[p] * specific_volume(law) * state.work)
        store(points.state, p, state._replace(work=0))
    if work is not None:
        done += float(work[0, p])
        work[0, p] = 0
    return kinetic, done


@kernel
def _add_more(kin, points, more, tiling, control):
    points, more = at_hand(points), at_hand(more)
    for t in range(tiling.count[0]):
        kinetic = done = 0.0
        for p in range(tiling.range[t, 0], tiling.range[t, 1]):
            of_motion, of_forces = take_more(kin, points, more, p)
            kinetic, done = kinetic + of_motion, done + of_forces
        totals.add_to(control.totals, totals.KINETIC, kinetic)
        totals.add_to(control.totals, totals.WORK, done)
    totals.carry(control.totals[totals.WORK])


@kernel
def _take_work_at_nodes(spans, work, control):
    for r in range(1, 1 + spans[0, 0]):
        for n in range(spans[r, 0], spans[r, 1]):
            counted = totals.counts(control.ranks, n)
            totals.add_to(control.totals, totals.WORK, float(work[n, 0]) if counted else 0.0)
            work[n, 0] = 0
    totals.carry(control.totals[totals.WORK])


def sum_energies(s, mode):
    """Sum kinetic, stored plus dissipated energy, and work in the clock, without rigid solids."""
    s.control.totals[: totals.WORK] = 0
    s.control.totals[totals.TRANSFER_LOSS] = 0
    for block in s.blocks:
        if not is_rigid(block.laws):
            gone = field(block.points.fields, TransferLoss)
            _sum_energies(mode, matter_of(s.kin, block), gone, block.tiling, s.control)
        if any(more_of(block)):
            points, more = known_to_laws(block.points), more_of(block)
            _add_more(s.kin, points, more, block.tiling, s.control)
    at_nodes = field(s.nodes.fields, WorkAtNodes)
    if at_nodes is not None:
        _take_work_at_nodes(s.spans, at_nodes, s.control)
    take_energies(s)


def take_energies(s):
    totals.collect(s.control.ranks, s.control, totals.KINETIC, 5)
    energy, answer = s.control.energy[0], s.control.answer
    energy.kinetic = answer[totals.KINETIC]
    energy.stored = answer[totals.STORED] + energy.born_with
    energy.work = answer[totals.WORK]
    energy.lost_by_transfer = energy.lost_with_deleted + answer[totals.TRANSFER_LOSS]


@kernel
def _add_momenta(d, motion, tiling, control):
    """Add mass and momentum of each solid, elastic energy, and elastic energy times velocity."""
    (ids, masses, v), firsts, sums = motion, control.firsts, control.answer
    last = control.values.size + (firsts.size - 1) * (1 + d)
    for t in range(tiling.count[0]):
        for k in range(1 + d):
            totals.add_to(control.totals, last + k, tiling.report[t, OF_SOLID + 2 + d + k])
        solid = int(tiling.report[t, OF_SOLID])
        if solid >= 0:
            for k in range(1 + d):
                sums[k] = tiling.report[t, OF_SOLID + 1 + k]
        else:
            sums[: 1 + d] = begin = end = 0
            for p in range(tiling.range[t, 0], tiling.range[t, 1]):
                if not begin <= ids[p] < end:
                    _add_momentum(control, solid, d)
                    solid = solid_of(firsts, ids[p])
                    begin, end = firsts[solid], firsts[solid + 1]
                mass = float(masses[p])
                sums[0] += mass
                for k in range(d):
                    sums[1 + k] += mass * float(v[k, p])
        _add_momentum(control, solid, d)


@noinline
def _add_momentum(control, solid, d):
    row = control.values.size + solid * (1 + d)
    for k in range(1 + d):
        totals.add_to(control.totals, row + k, control.answer[k])
        control.answer[k] = 0


def _sum_drift(s):
    control, d = s.control, s.kin.dimension
    first_row = control.values.size
    control.totals[first_row:] = 0
    for block in s.blocks:
        points = block.points
        if not is_rigid(block.laws):
            _add_momenta(d, (points.id, points.mass, points.v), block.tiling, control)
    take_drift(s)


def take_drift(s):
    control, d = s.control, s.kin.dimension
    first_row = control.values.size
    totals.collect(control.ranks, control, first_row, control.totals.shape[0] - first_row)
    energy = 0.0
    for k in range(control.firsts.size - 1):
        mass = control.answer[k * (1 + d)]
        for i in range(free_from(s.kin), d):
            momentum = control.answer[k * (1 + d) + 1 + i]
            energy += 0.5 * momentum * momentum / mass if mass > 0 else 0.0
    control.energy[0].of_drift = energy
    note_crossing(control, d)


def note_crossing(control, d):
    """Add the path (in cells) that elastic energy has moved since the last check.

    New energy has no path; vibrations renew the energy within a wave period.
    """
    energy, row = control.energy[0], (control.firsts.size - 1) * (1 + d)
    now, before = control.answer[row], energy.elastic
    lasting = control.values[TIME] - energy.time_of_look
    energy.time_of_look = control.values[TIME]
    energy.elastic = max(now, 0.0)
    if not now > 0:
        return
    moved = 0.0
    for i in range(d):
        moved += (control.answer[row + 1 + i] / now) ** 2
    cells = lasting / control.step[0].spacing
    renewed = (
        min(max((energy.kinetic - energy.of_drift) / now, 0.0), 1.0) * lasting / energy.to_and_fro
    )
    # Energy lost by the linear basis does not count as energy that has left.
    stays = max(1 - 2 * PER_CELL * sqrt(moved) * cells, 0.0)
    stays = exp(-renewed) * min(stays, now / before if before > 0 else 0.0)
    for i in range(d):
        energy.carried[0, i] = stays * energy.carried[0, i] + control.answer[row + 1 + i] * cells


def _sum_before(s, mode, step):
    sum_energies(s, mode)
    note_before(s.control.energy[0], step)


def note_before(energy, step):
    energy.stored_before = energy.stored
    energy.moving_before = energy.kinetic - energy.work
    energy.lost_before = energy.lost_by_transfer
    energy.stored_at = step


def growth(first, later, unit):
    return (later - first) / unit


def keeps(first, later, unit, within=WITHIN):
    """Return True if growth is within a fraction of the unit, False for NaN."""
    return later - first <= within * unit


def unit_of(energy):
    """Return the largest energy; drift counts only up to a limit."""
    return max(energy.largest_own, DRIFTING * energy.largest_energy, energy.energy_floor)


@kernel
def judge(control):
    """Update the balance; return True if the energy is within its bound."""
    energy = control.energy[0]
    # Mean of the balances at mid-step (stored energy interpolated) and at the end (kinetic energy).
    # The balances oscillate by (omega dt)^2/8 in opposite phase, their mean by (omega dt)^3/16.
    moving = energy.kinetic - energy.work
    balance = moving + energy.level * (energy.moving_before - moving)
    balance += energy.stored_before + energy.level * (energy.stored - energy.stored_before)
    # Growth is judged without the loss in the transfer, which also removes noise as it appears.
    lost = energy.lost_by_transfer
    lost += energy.level * (energy.lost_before - lost)
    if energy.looks == 0:
        energy.first_lost = lost
        energy.first_balance = balance
        energy.first_work = energy.work
    energy.looks += 1
    energy.last_but_one, energy.last_balance = energy.last_balance, energy.balance
    energy.balance = balance
    energy.lost_but_one, energy.last_lost, energy.lost_now = energy.last_lost, energy.lost_now, lost
    energy.supplied = max(energy.supplied, abs(energy.work - energy.first_work))
    energy.largest_energy = max(
        energy.largest_energy,
        abs(energy.kinetic),
        abs(energy.stored),
        energy.supplied,
        energy.of_bodies,
    )
    # A rigid body may have far more energy than the body that it hits.
    vibrating = max(abs(energy.stored), energy.kinetic - energy.of_drift, energy.of_bodies)
    energy.largest_own = max(energy.largest_own, vibrating)
    way = 0.0
    for i in range(3):
        way += energy.carried[0, i] * energy.carried[0, i]
    if energy.elastic > 0:
        way = sqrt(way) / energy.elastic
        loss = energy.elastic * (exp(2 * PER_CELL * way) - 1) / unit_of(energy)
        if loss > energy.lost:
            energy.lost = loss
            energy.crossed = way
            # compares means, as a single check contains the shortest waves
    unit = unit_of(energy)
    if energy.looks == FEW:
        energy.first_few = energy.first_mean = energy.largest_mean = (
            balance + energy.last_balance + energy.last_but_one
        ) / FEW
    if energy.looks >= 2 * FEW:
        # Use the minimum, since single checks have errors in collisions; store it, since the last
        # check alone should not decide.
        least = min(balance, energy.last_balance, energy.last_but_one)
        energy.grown = max(energy.grown, growth(energy.first_few, least, unit))
    energy.sum_of_balance += balance
    if energy.looks % LOOKS == 0:
        mean = energy.sum_of_balance / LOOKS
        energy.sum_of_balance = 0.0
        if energy.looks == LOOKS:
            energy.first_mean = energy.largest_mean = mean
        energy.growth = growth(energy.largest_mean, mean, unit)
        energy.windows = energy.windows + 1 if energy.growth > GROWTH else 0
        energy.grown = max(energy.grown, growth(energy.first_mean, mean, unit))
        energy.largest_mean = max(energy.largest_mean, mean)
    reference = abs(energy.first_balance) + energy.supplied
    # also False for NaN
    return balance - energy.first_balance <= max(BOUND * reference, energy.energy_floor)


@kernel
def _range_of_heat(kin, points, laws, control):
    heat = control.heat[0]
    for p in range(points.mass.size):
        law, state = state_at(kin, points, laws, p)
        capacity = heat_capacity(law, points.mass[p])
        if capacity > 0:
            T = float(temperature(law, kin, state))
            # `not <=` stores NaN, too
            heat.T_low = T if not heat.T_low <= T else heat.T_low
            heat.T_high = T if not heat.T_high >= T else heat.T_high
            work = dissipated_energy(law, kin, state) * specific_volume(law)
            heat.own_heat = max(heat.own_heat, float(work) / float(capacity))


def measure_heat(s):
    heat = s.control.heat[0]
    heat.T_low, heat.T_high, heat.own_heat = inf, -inf, 0.0
    for block in s.blocks:
        _range_of_heat(s.kin, known_to_laws(block.points), block.laws, s.control)


def look_at_heat(s):
    """Return True if temperatures are within the bounds from fixes, sources and initial state."""
    heat = s.control.heat[0]
    if heat.watch_heat == 0 or int(s.control.values[TIMESTEP]) % LOOK != 0:
        return True
    measure_heat(s)
    totals.agree_on_heat(s.control.ranks, s.control)
    largest = max(abs(heat.coldest), abs(heat.hottest))
    room = OVERSHOOT * (heat.hottest - heat.coldest + heat.own_heat) + HEAT_NOISE * largest
    above = heat.hottest + heat.own_heat + room
    return heat.T_low >= heat.coldest - room and heat.T_high <= above


def begin_to_look(s, mode, level, anew):
    """Store energies if a check is due; `level` is the weight of the final stored energy."""
    energy = s.control.energy[0]
    energy.level = level
    if anew:
        energy.looks = 0
        energy.windows = 0
        energy.growth = energy.grown = energy.supplied = 0.0
        energy.sum_of_balance = energy.largest_energy = energy.largest_own = 0.0
        energy.of_bodies = 0.0
        energy.time_of_look = s.control.values[TIME]
    step = int(s.control.values[TIMESTEP])
    if step % LOOK == 0 and (anew or energy.stored_at != step):
        _sum_before(s, mode, step)


def look(s, mode):
    energy = s.control.energy[0]
    if energy.watch_energy == 0:
        return True
    step = int(s.control.values[TIMESTEP])
    if step % LOOK == 0:
        _sum_before(s, mode, step)
    elif step % LOOK == 1 and energy.stored_at == step - 1:
        sum_energies(s, mode)
        _sum_drift(s)
        return judge(s.control)
    return True


def look_at_end(s, mode):
    """Check the energy after an implicit step, whose velocities and stresses have the same time."""
    if s.control.energy[0].watch_energy == 0:
        return True
    _sum_before(s, mode, int(s.control.values[TIMESTEP]))
    _sum_drift(s)
    return judge(s.control)
