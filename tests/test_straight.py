"""What is interpreted on straight functions has the bits of what is interpreted plainly."""

from typing import NamedTuple

import numpy as np
import pytest
from states import same_bits
from straight import write
from test_tiles import KINDS, passing

from karamelo_py.compiler.compile import point_function, real


class Doubling(NamedTuple):
    """A tag."""


@point_function()
def applied(tag, x): ...


@applied.on(Doubling)
def _applied_doubling(tag, x):
    return real(2, x) * x


def give(tag, array, p, q, x):
    """Reads what it may have written just before."""
    if x > 0:
        array[p, 0] += applied(tag, x)
        array[q, 0] += applied(tag, x)
    return array[p, 0]


def test_a_function_is_written_down():
    """Calls that are chosen by type are gone, and what is one place in an array stays one."""
    seen = []
    array = np.array([[1.0, 0.0], [5.0, 0.0]])
    made = write(give, (Doubling(), array, 0, 1, 3.0), lambda *other: seen.append(other[-1]))
    assert array.tolist() == [[1, 0], [5, 0]]  # on a copy
    assert applied not in made.__globals__.values()
    assert made(Doubling(), array, 1, 1, 1.5) == 11
    assert array.tolist() == [[1, 0], [11, 0]]
    # The question was answered before anything was stored.
    made(Doubling(), array, 0, 1, -1.0)
    assert seen == [-1.0] and array[0, 0] == 1


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_bits(state_interpreted, kind):
    script = passing(**KINDS[kind])
    assert same_bits(state_interpreted(script), state_interpreted(script, plainly=True))
