"""What threads share out, and what becomes of a task that fails."""

import numpy as np
import pytest
from numba import config

from karamelo_py.compiler import kernel, shared
from karamelo_py.compiler.threads import Serial, Threaded, by_team, new_team, shared_out

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


@shared
def put(out, limit, k):
    """The square of k; none from `limit` on."""
    if k >= limit:
        raise ValueError("beyond the limit")
    out[k] = k * k


_put_all = shared_out(put)


@kernel
def squares(mode, out, limit):
    """The squares of numbers."""
    _put_all(mode, out.size, out, limit)
    return out.size


@pytest.mark.parametrize("mode", [Serial(), Threaded()], ids=["one", "all"])
def test_what_fails_in_a_thread_is_raised(mode):
    new_team(2)  # the loop may come from the cache
    out = np.zeros(100, np.int64)
    assert squares(mode, out, 100) == 100
    assert out.tolist() == [k * k for k in range(100)]
    with pytest.raises(ValueError, match="beyond the limit"):
        squares(mode, out, 60)
    assert squares(mode, out, 100) == 100


def several(mode, out, limit, times):
    """The squares of numbers, several times."""
    for _ in range(times):
        _put_all(mode, out.size, out, limit)
    return times


_by_team = by_team(several)


@kernel
def by_several(mode, out, limit, times):
    """By a team of threads."""
    return _by_team(mode, out, limit, times)


@pytest.mark.parametrize("size", [1, 100])
def test_what_fails_in_a_team_is_raised(size):
    """Also in the loops of one number, which its leader does alone; and nobody waits for ever."""
    team = new_team(2)
    mode, out = Threaded(team.ctypes.data), np.zeros(size, np.int64)
    for _ in range(3):
        assert by_several(mode, out, size, 5) == 5
        assert out.tolist() == [k * k for k in range(size)]
        with pytest.raises(ValueError, match="beyond the limit"):
            by_several(mode, out, size // 2, 5)


def count_turn(out, k):
    out[k] += 1


_count_all = shared_out(count_turn)


def in_many_loops(mode, out, times):
    """Loops of few and of many indices in turn."""
    for turn in range(times):
        _count_all(mode, 1 + turn % out.size, out)
    return times


_many_by_team = by_team(in_many_loops)


@kernel
def many_loops(mode, out, times):
    return _many_by_team(mode, out, times)


@pytest.mark.parametrize(("threads", "times"), [(2, 4000), (7, 800)])
def test_stress_of_the_protocol_of_teams(threads, times):
    """Every index of many loops is done once, also by more threads than there are cores."""
    team = new_team(threads)
    mode, out = Threaded(team.ctypes.data), np.zeros(40, np.int64)
    assert many_loops(mode, out, times) == times
    assert out.tolist() == [times - times // 40 * k for k in range(40)]
