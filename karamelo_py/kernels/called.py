"""Python hooks called by address from compiled steps, before points are mapped to nodes."""

from typing import NamedTuple

from numba import types

from karamelo_py.compiler import caller_of, kernel
from karamelo_py.compiler.fields import field
from karamelo_py.kernels import arrays
from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.heat import at_heat_nodes, at_heated_points
from karamelo_py.kernels.hook_loop import add_work, at_nodes, at_points, clear_forces

CALL = types.int64(types.int64)

_call = caller_of(CALL)


class CalledHooks(NamedTuple):
    compiled: NamedTuple
    address: int  # address of a function ``(stage)`` that returns 1, or 0 on failure


@kernel
def _act(address, stage):
    if _call(address, stage) == 0:
        raise RuntimeError("a hook has failed")


@at_points.on(CalledHooks)
def _at_points_called(hooks, stage, then, s):
    if stage == arrays.INITIAL_INTEGRATE:
        for block in s.blocks:
            clear_forces(s.kin, field(block.points.fields, Force), block.points.mass.size)
    at_points(hooks.compiled, stage, then, s)
    if stage == arrays.INITIAL_INTEGRATE:
        _act(hooks.address, stage)


def _by_compiled_hooks(function):
    @function.on(CalledHooks)
    def act(hooks, *rest):
        function(hooks.compiled, *rest)


for _function in (at_nodes, add_work, at_heat_nodes, at_heated_points):
    _by_compiled_hooks(_function)
