"""Tuples of arrays in kernels: held in memory, passed as one pointer."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from llvmlite import binding, ir
from numba import config, typeof

from karamelo_py.compiler import CannotCompile, at_hand, hold, kernel, llvm, noinline
from karamelo_py.compiler.code import arguments, machine
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.threads import Serial, Threaded, by_team, new_team, shared_out
from karamelo_py.compiler.trace.held import held_type, is_held
from karamelo_py.compiler.trace.session import session


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


@noinline
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


@kernel
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


class Mixed(NamedTuple):
    on: bool
    half: np.float32
    pair: tuple
    array: np.ndarray
    none: None
    small: np.int32
    inner: tuple


@kernel
def _of_python(mixed, whole, out):
    out[0] = mixed.half if mixed.on else 0.0
    out[1] = mixed.pair[0] + 10 * mixed.pair[1][1]
    for i in range(mixed.array.shape[0]):
        for j in range(mixed.array.shape[1]):
            out[2 + 2 * i + j] = mixed.array[i, j]
    out[6] = mixed.small + mixed.inner[0].a[0] + whole
    return mixed.none is None, out.size


def test_python_writes_what_kernels_hold():
    """Numbers of all widths beside each other, arrays with gaps between their rows."""
    gaps = np.arange(12.0).reshape(3, 4)[::2, ::3]
    inner = (Pair(np.full(1, 0.5), np.zeros(0)),)
    mixed = Mixed(True, np.float32(0.25), (3, (1, 2.0)), gaps, None, np.int32(-7), inner)
    for whole in (1, 2):
        out = np.zeros(8)
        assert _of_python(mixed, whole, out) == (True, 8)
        assert out.tolist() == [0.25, 23.0, 0.0, 3.0, 8.0, 11.0, whole - 6.5, 0.0]
    out = np.zeros(8)
    _of_python(mixed._replace(on=False, pair=(np.float32(3), (True, 2))), 1, out)
    assert out[:2].tolist() == [0.0, 23.0]


def test_memory_that_moves_is_noticed():
    """NumPy resizes no array in place that kernels know, and they learn where it is afterwards."""
    out = np.zeros(8)
    mixed = Mixed(True, np.float32(1), (3, (1, 2.0)), np.eye(2), None, np.int32(0), ())
    mixed = mixed._replace(inner=(Pair(np.zeros(1), np.zeros(0)),))
    assert _of_python(mixed, 1, out)[1] == 8
    if not config.DISABLE_JIT:
        with pytest.raises(ValueError, match="resize"):
            out.resize(100_000, refcheck=False)
    arguments.forget_array(out)
    out.resize(100_000, refcheck=False)
    out[:] = 0.0
    assert _of_python(mixed, 1, out)[1] == 100_000
    assert out[0] == 1.0


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_an_array_in_the_place_of_another():
    """What is known of an array is never used for one that comes after it."""
    mixed = Mixed(True, np.float32(1), (3, (1, 2.0)), np.eye(2), None, np.int32(0), ())
    mixed = mixed._replace(inner=(Pair(np.zeros(1), np.zeros(0)),))
    numbers = set()
    for k in range(50):
        out = np.zeros(8 + 1000 * (k % 3))
        numbers.add(id(out))
        assert _of_python(mixed, k, out)[1] == out.size
        assert out[6] == k
        del out
    assert len(numbers) < 50  # Python has used numbers again
    assert not numbers & session.arrays.keys()
    one, other = np.zeros(8), np.zeros(8)
    _of_python(mixed, 1, one)
    session.arrays[id(other)] = session.arrays[id(one)]  # as if nobody had told
    _of_python(mixed, 2, other)
    assert (one[6], other[6]) == (1, 2)
    known = len(_of_python.units)
    other.shape = (8, 1)
    _of_python(mixed, 3, other)
    assert other[6] == 3
    assert len(_of_python.units) == known + 1  # a table is no row of numbers


def literal(model):
    """A struct with the types of its parts in place of their names."""
    if isinstance(model, ir.LiteralStructType):
        return ir.LiteralStructType(map(literal, model.elements))
    is_pointer = isinstance(model, ir.PointerType)
    return literal(model.pointee).as_pointer() if is_pointer else model


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_types_are_laid_as_llvm_lays_them():
    data = binding.create_target_data(str(machine._target().target_data))
    inner = (Pair(np.full(1, 0.5), np.zeros(0)),)
    values = Mixed(True, np.float32(1), (3, (1, 2.0)), np.eye(2), None, np.int32(0), inner)
    for value in (values, setup(), (True, (True, 1.5)), (np.float32(1), np.int8(2))):
        for kind in (typeof(value), held_type(typeof(value))):
            model = llvm.memory_type(kind)
            model = getattr(model, "pointee", model)
            model = literal(model)  # the module of `get_abi_size` knows no names
            end, aligned = arguments._lay(model, 0, [])
            size = -(-end // aligned) * aligned
            assert size == model.get_abi_size(data)


def _count_up(out, factor, k):
    out.a[k] += factor * k


_counted = shared_out(_count_up)


@kernel
def _count_all(mode, out, factor):
    _counted(mode, out.a.size, out, factor)


@pytest.mark.parametrize("mode", [Serial(), Threaded()], ids=["serial", "threaded"])
def test_each_number_is_done_once(mode):
    """By one thread or by several, with the same arguments."""
    out = Pair(np.zeros(1000), np.zeros(1))
    _count_all(mode, out, 2.0)
    assert out.a.tolist() == [2.0 * k for k in range(1000)]


def _count_often(mode, out, factor, times):
    done = 0
    for n in range(times):
        # Loops of all lengths, also of nothing and of less than there are threads.
        _counted(mode, n % 7, out, factor)
        _counted(mode, out.a.size, out, factor)
        done += 1
    return done


_often = by_team(_count_often)


@kernel
def _often_from_python(mode, out, factor, times):
    return _often(mode, out, factor, times)


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_a_team_does_each_number_of_each_loop_once(threads):
    """Also where a thread of the team never begins, since there are fewer than it has."""
    times = 60
    team = new_team(threads)
    for mode in (Threaded(team.ctypes.data), Threaded(), Serial()):
        out = Pair(np.zeros(500), np.zeros(1))
        for _ in range(2):
            assert _often_from_python(mode, out, 2.0, times) == times
        more = [sum(k < n % 7 for n in range(times)) for k in range(500)]
        assert out.a.tolist() == [2 * (times + more[k]) * 2.0 * k for k in range(500)]


@kernel
def _put(a):
    a[0] = 7.0


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_an_array_that_was_made_read_only_is_not_written():
    a = np.zeros(3)
    _put(a)
    a[0] = 0.0
    a.flags.writeable = False
    with pytest.raises(CannotCompile, match="an array that must not be changed"):
        _put(a)
    assert a[0] == 0
    a.flags.writeable = True
    _put(a)
    assert a[0] == 7


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
