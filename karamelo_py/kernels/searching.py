"""Places in rows of numbers that ascend."""

from karamelo_py.compiler.loops import noinline


@noinline
def first_from(ascending, begin, end, x):
    """The first place of these whose number is not below `x`; NumPy's search compiles for 0.4 s."""
    while begin < end:
        middle = (begin + end) // 2
        if ascending[middle] < x:
            begin = middle + 1
        else:
            end = middle
    return begin
