"""The watch over energy and temperatures: every so many steps, inside the compiled loop.

Kinetic plus stored plus dissipated energy less the work of the loads cannot grow. Velocities belong
to the middles of steps and stresses to their ends, more or less by the scheme: the stored energy of
two steps in a row gives that of the middle, to second order. Sums go through the points in the
order of their tiles, the same on any number of threads.

Growth is measured by the energy that bodies have besides their drift, the motion of their centres
of mass: large as that may be, from the start or by loads, it cannot hide what vibrates.
"""

from __future__ import annotations

from math import inf

import numpy as np

from karamelo_py.compiler.compile import over_blocks, shared
from karamelo_py.compiler.fields import load, load_vector
from karamelo_py.compiler.loops import entered, subkernel
from karamelo_py.compiler.tuples import record
from karamelo_py.kernels.arrays import TIMESTEP
from karamelo_py.kernels.totals import KINETIC, STORED, WORK, add_to, agree_on_heat, collect
from karamelo_py.points.kinematics import dimension, free_from
from karamelo_py.points.laws import (
    dissipated_energy,
    energy_density,
    heat_capacity,
    initial_state,
    specific_volume,
    temperature,
)

LOOK = 10  # steps between two looks
LOOKS = 10  # looks that are averaged, in a window of 100 steps
GROWTH = 0.01  # of the largest energy so far, in a window: more is told
DRIFTING = 1e-3  # of the energy of bodies that drift, which hides what they vibrate by
BOUND = 10.0  # times the energy that there was and that loads have brought: more stops the run
ROUND_OFF = 1e-14  # of m c^2: energies below are noise
COARSE = 1000.0  # round-off errors: a strain of so many is noise, too
LAST = 2**62  # no id of a point is so large
HEAT_NOISE = 1e-4  # of a temperature: what does not count where all are alike
OVERSHOOT = 0.1  # of the range of temperatures that sources allow: more stops the run
# Steps so many times the stable one of conduction are borne: what nodes do not show of the points'
# temperatures is levelled (measured with two points a cell: 4 and 5.8 with and without convection).
BORNE = 4.0


@entered
def _sum_energies(kin, points, laws, tiling, control):
    for t in range(tiling.count[0]):
        kinetic = 0.0
        stored = 0.0
        for p in range(tiling.range[t, 0], tiling.range[t, 1]):
            law = record(laws, points.material[p])
            mass = points.mass[p]
            state = load(points.state, p, initial_state(law, kin, mass))
            v = load_vector(kin, points.v, p)
            squared = 0.0
            for k in range(dimension(kin)):
                squared += float(v[k]) * float(v[k])
            kinetic += 0.5 * float(mass) * squared
            energy = energy_density(law, kin, state) + dissipated_energy(law, kin, state)
            stored += float(mass) * float(specific_volume(law)) * float(energy)
        add_to(control.totals, KINETIC, kinetic)
        add_to(control.totals, STORED, stored)


@over_blocks
def _sum_blocks(block, s):
    _sum_energies(s.kin, block.points, block.laws, block.tiling, s.control)


@entered
def _clear(control):
    control.totals[KINETIC] = 0
    control.totals[STORED] = 0


@entered
def _take_sums(control):
    clock, answer = control.clock[0], control.answer
    clock.kinetic = answer[KINETIC]
    clock.stored = answer[STORED] + clock.born_with
    clock.work = answer[WORK]


@shared
def sum_energies(s):
    """Energies of all points, kinetic and stored plus dissipated, and the work into the clock."""
    _clear(s.control)
    _sum_blocks(s)
    collect(s.control.ranks, s.control, KINETIC, 3)
    _take_sums(s.control)


@entered
def _add_momenta(kin, points, tiling, control):
    """Mass and momentum of each solid, to the totals behind those of the published values."""
    firsts, sums, d = control.firsts, control.answer, dimension(kin)
    row, begin, end = control.values.size, 0, 0
    sums[: 1 + d] = 0
    for t in range(tiling.count[0]):
        for p in range(tiling.range[t, 0], tiling.range[t, 1]):
            if not begin <= points.id[p] < end:
                _add_momentum(control, row, d)
                k = np.searchsorted(firsts, points.id[p], side="right")
                row = control.values.size + (k - 1) * (1 + d)
                begin, end = firsts[k - 1], firsts[k] if k < firsts.size else LAST
            mass = float(points.mass[p])
            sums[0] += mass
            for k in range(d):
                sums[1 + k] += mass * float(points.v[k, p])
        _add_momentum(control, row, d)


@subkernel
def _add_momentum(control, row, d):
    for k in range(1 + d):
        add_to(control.totals, row + k, control.answer[k])
        control.answer[k] = 0


@over_blocks
def _add_blocks(block, s):
    _add_momenta(s.kin, block.points, block.tiling, s.control)


@entered
def _clear_momenta(control):
    control.totals[control.values.size :] = 0


@entered
def _take_drift(kin, control):
    d, energy = dimension(kin), 0.0
    for k in range(control.firsts.size):
        mass = control.answer[k * (1 + d)]
        for i in range(free_from(kin), d):
            momentum = control.answer[k * (1 + d) + 1 + i]
            energy += 0.5 * momentum * momentum / mass if mass > 0 else 0.0
    control.clock[0].of_drift = energy


@shared
def _sum_drift(s):
    """Kinetic energy of the centres of mass of the solids, into the clock."""
    _clear_momenta(s.control)
    _add_blocks(s)
    own = s.control.values.size
    collect(s.control.ranks, s.control, own, s.control.totals.shape[0] - own)
    _take_drift(s.kin, s.control)


@shared
def _sum_before(s, step):
    """The energies of a step whose next is looked at."""
    sum_energies(s)
    clock = s.control.clock[0]
    clock.stored_before = clock.stored
    clock.stored_at = step


@shared
def unit_of(clock):
    """What growth of energy is measured by: the most that there was, of a drift no more than so."""
    return max(clock.largest_own, DRIFTING * clock.largest_energy, clock.energy_floor)


@entered
def judge(control):
    """Take the present sums into account; whether energy keeps within its bound."""
    clock = control.clock[0]
    at_middle = clock.level * clock.stored + (1 - clock.level) * clock.stored_before
    balance = clock.kinetic + at_middle - clock.work
    if clock.looks == 0:
        clock.first_balance = balance
        clock.first_work = clock.work
    clock.looks += 1
    clock.balance = balance
    clock.supplied = max(clock.supplied, abs(clock.work - clock.first_work))
    clock.largest_energy = max(
        clock.largest_energy, abs(clock.kinetic), abs(clock.stored), clock.supplied
    )
    own = max(abs(clock.stored), clock.kinetic - clock.of_drift)
    clock.largest_own = max(clock.largest_own, own)
    # Means of windows: a single look shows the shortest waves, too.
    clock.sum_of_balance += balance
    if clock.looks % LOOKS == 0:
        mean = clock.sum_of_balance / LOOKS
        clock.sum_of_balance = 0.0
        if clock.looks == LOOKS:
            clock.first_mean = clock.largest_mean = mean
        unit = unit_of(clock)
        growth = (mean - clock.largest_mean) / unit
        clock.windows = clock.windows + 1 if growth > GROWTH else 0
        clock.growth = growth
        clock.grown = (mean - clock.first_mean) / unit
        clock.largest_mean = max(clock.largest_mean, mean)
    given = abs(clock.first_balance) + clock.supplied
    return not balance - clock.first_balance > max(BOUND * given, clock.energy_floor)


@entered
def _range_of_heat(kin, points, laws, control):
    clock = control.clock[0]
    for p in range(points.mass.size):
        law = record(laws, points.material[p])
        mass = points.mass[p]
        capacity = heat_capacity(law, mass)
        if capacity > 0:
            state = load(points.state, p, initial_state(law, kin, mass))
            T = float(temperature(law, kin, state))
            # So written, NaN is noticed.
            clock.T_low = T if not clock.T_low <= T else clock.T_low
            clock.T_high = T if not clock.T_high >= T else clock.T_high
            work = dissipated_energy(law, kin, state) * specific_volume(law)
            clock.own_heat = max(clock.own_heat, float(work) / float(capacity))


@over_blocks
def _range_blocks(block, s):
    _range_of_heat(s.kin, block.points, block.laws, s.control)


@shared
def measure_heat(s):
    """Lowest and highest temperature of all points, into the clock."""
    clock = s.control.clock[0]
    clock.T_low, clock.T_high, clock.own_heat = inf, -inf, 0.0
    _range_blocks(s)


@shared
def look_at_heat(s):
    """Whether all temperatures are between what fixes, sources and the initial state allow."""
    clock = s.control.clock[0]
    if clock.watch_heat == 0 or int(s.control.values[TIMESTEP]) % LOOK != 0:
        return True
    measure_heat(s)
    agree_on_heat(s.control.ranks, s.control)
    largest = max(abs(clock.coldest), abs(clock.hottest))
    room = OVERSHOOT * (clock.hottest - clock.coldest + clock.own_heat) + HEAT_NOISE * largest
    above = clock.hottest + clock.own_heat + room
    return clock.T_low >= clock.coldest - room and clock.T_high <= above


@shared
def begin_to_look(s, level, anew):
    """Before a run: the stored energy of the present state, where a look is due after a step.

    `level` is the share of a stored energy in that of the velocities' time. With `anew` the balance
    starts from here.
    """
    clock = s.control.clock[0]
    clock.level = level
    if anew:
        clock.looks = 0
        clock.windows = 0
        clock.growth = clock.grown = clock.supplied = 0.0
        clock.sum_of_balance = clock.largest_energy = clock.largest_own = 0.0
    step = int(s.control.values[TIMESTEP])
    if step % LOOK == 0 and (anew or clock.stored_at != step):
        _sum_before(s, step)


@shared
def look(s):
    """Look at the energy where it is due; whether it keeps within its bound."""
    clock = s.control.clock[0]
    if clock.watch_energy == 0:
        return True
    step = int(s.control.values[TIMESTEP])
    if step % LOOK == 0:
        _sum_before(s, step)
    elif step % LOOK == 1 and clock.stored_at == step - 1:
        sum_energies(s)
        _sum_drift(s)
        return judge(s.control)
    return True
