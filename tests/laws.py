"""One point of a law, driven through strains; numbers of the tests of laws."""

import re

import numpy as np
import pytest
from tensors import flat, symmetric_matrix

from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    initial_state,
    jacobian,
    kirchhoff_stress,
)

TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def start(law, kin):
    """The state before the first step."""
    return initial_state(law, kin, 1.0)


def isochoric(e):
    """An increment of strain along x that keeps the volume."""
    return np.diag([e, -e / 2, -e / 2])


def stretched(law, kin, state, full, steps, dt=1.0):
    """The state after `steps` equal increments, each a (3, 3) velocity gradient times dt."""
    dl = flat(kin, np.asarray(full, float))
    for _ in range(steps):
        state = advance(law, kin, state, dl, dt)
    return state


def closed_to(law, kin, state, j, steps=1, dt=1.0):
    """The state when the volume ratio has come to `j` along x, from det F."""
    ratio = (j / jacobian(law, kin, state)) ** (1 / steps)
    return stretched(law, kin, state, np.diag([ratio - 1, 0, 0]), steps, dt)


def worked(law, kin, state, full, steps, dt=1.0):
    """The state after `steps` increments, and the work by the mean of old and new stress."""
    work = 0.0
    full = np.asarray(full, float)
    strain = (full + full.T) / 2
    # The increment I + dl acts on a volume that grows on the way: tau : ln(I + dl) to 2nd order.
    strain = strain - full @ full / 2
    for _ in range(steps):
        before = symmetric_matrix(kin, kirchhoff_stress(law, kin, state))
        state = stretched(law, kin, state, full, 1, dt)
        after = symmetric_matrix(kin, kirchhoff_stress(law, kin, state))
        work += np.sum((before + after) / 2 * strain)
    return state, work


def stress(law, kin, state):
    """(3, 3) Cauchy stress."""
    return symmetric_matrix(kin, cauchy_stress(law, kin, state))


def pressure_of(law, kin, state):
    return -np.trace(stress(law, kin, state)) / 3


def mises(law, kin, state):
    full = stress(law, kin, state)
    s = full - np.trace(full) / 3 * np.eye(3)
    return np.sqrt(1.5 * np.sum(s * s))


def integrated(rate, y, end, steps=20_000):
    """y(end) of dy/dt = rate(t, y) from y at 0, by the classical method of Runge and Kutta."""
    h = end / steps
    y = np.asarray(y, float)
    for k in range(steps):
        t = k * h
        a = rate(t, y)
        b = rate(t + h / 2, y + h / 2 * a)
        c = rate(t + h / 2, y + h / 2 * b)
        d = rate(t + h, y + h * c)
        y = y + h / 6 * (a + 2 * b + 2 * c + d)
    return y


def lanes_are_the_point_function(run_script, run_interpreted, script):
    """Compiled, in lanes, a scene with logged energies Es and Ed dissipates as interpreted."""
    slow, fast = run_interpreted(script).log, run_script(script, folder="compiled").log
    assert slow["Ed"][-1] > 0
    for name in ("Es", "Ed"):
        assert fast[name] == pytest.approx(slow[name], rel=1e-8)
    return fast


def leaning_is_reported(run_interpreted, script, straight, leaning):
    script = script.replace(straight, leaning)
    script = re.sub(r"run\(\d+\)", "run(1)", script)
    assert "shear out of its plane" in run_interpreted(script, status=None).err
