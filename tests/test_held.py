"""Tuples of arrays in kernels: held in memory, passed as one pointer."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import config, typeof

from karamelo_py.compiler.compile import entered, kernel, subkernel
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.held import at_hand, held_type, hold, is_held


class Pair(NamedTuple):
    a: np.ndarray
    b: np.ndarray


class Dose(NamedTuple):
    array: Any


class Glow(NamedTuple):
    array: Any


class Setup(NamedTuple):
    on: bool
    factor: float
    pair: Pair
    none: None
    fields: tuple


@subkernel
def _filled(s, k):
    s = at_hand(s)
    if s.on:
        for i in range(s.pair.a.size):
            s.pair.b[i] += s.factor * s.pair.a[i] + s[2][0][i] + k
    field(s.fields, Glow)[0] = len(s.fields)
    return field(s.fields, Dose) is None


@kernel
def _held_once(s):
    held = hold(s)
    first = _filled(held, 0.0)
    return _filled(hold(held), 1.0) and first


@entered
def _from_anywhere(s):
    return _filled(s, 0.0)


@kernel
def _from_a_kernel(s):
    return _from_anywhere(Setup(s.on, 2 * s.factor, s.pair, s.none, s.fields))


def setup(on=True) -> Setup:
    return Setup(on, 3.0, Pair(np.arange(4.0), np.zeros(4)), None, (Glow(np.zeros(1)),))


def test_items_are_read_and_arrays_written():
    s = setup()
    assert _held_once(s)
    assert list(s.pair.b) == [1 + 8 * i for i in range(4)]
    assert s.fields[0].array[0] == 1


def test_python_and_kernels_enter_alike():
    one, other = setup(), setup()
    assert _from_anywhere(one)
    assert _from_a_kernel(other)
    assert list(one.pair.b) == [4 * i for i in range(4)]
    assert list(other.pair.b) == [7 * i for i in range(4)]
    off = setup(False)
    _from_anywhere(off)
    assert not off.pair.b.any()


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_what_is_held():
    """Tuples with arrays in them, at any depth; their type tells what is in them."""
    held = held_type(typeof(setup()))
    assert is_held(held)
    assert held.instance_class is Setup
    assert is_held(held[held.fields.index("pair")])
    assert is_held(held[held.fields.index("fields")])
    assert held_type(held) == held
    assert held != held_type(typeof(setup()._replace(factor=1)))
    assert held_type(typeof((1, 2.0))) == typeof((1, 2.0))


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_classes_of_one_name_are_two():
    """As a plug-in's may be: what is chosen by class must not be that of the other."""

    def made():
        class Tag(NamedTuple):
            number: float

        class Kit(NamedTuple):
            tag: Tag
            array: Any

        return Kit(Tag(1.0), np.zeros(2))

    one, other = (held_type(typeof(made())) for _ in range(2))
    assert one != other
    assert one.instance_class is not other.instance_class
    with_tags = [held_type(typeof(Setup(True, tag, setup().pair, None, ()))) for tag in
                 (made().tag, made().tag)]  # fmt: skip
    assert with_tags[0] != with_tags[1]
