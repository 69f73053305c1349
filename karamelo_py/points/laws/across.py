"""Laws of generalised plane strain, with a prescribed stretch F_zz across the plane.

Before each step, `impose_stretch` sets the final stretch. The inner law has the tensors of
`Axisymmetric`.
"""

from typing import Any, NamedTuple

from karamelo_py.points import laws
from karamelo_py.points.laws.thin import WHOLE, Thin, with_strain_across


class Across(Thin):
    """The 3D `law` with a prescribed stretch across the plane."""

    __slots__ = ()


class State(NamedTuple):
    whole: Any  # state of the inner law
    across: Any  # present F_zz
    target: Any  # F_zz at the end of the step
    work: Any  # work of the stress across the plane, per reference volume, since it was last summed


@laws.initial_state.on(Across)
def _initial_state_across(law, kin, template):
    return State(laws.initial_state(law.law, WHOLE, template), 1, 1, 0)


@laws.advance.on(Across)
def _advance_across(law, kin, state, dl, dt):
    new = laws.advance(law.law, WHOLE, state.whole, _strained(law, kin, state, dl), dt)
    return _after(law, state, new)


@laws.advance_fbar.on(Across)
def _advance_fbar_across(law, kin, state, step):
    step = step._replace(dl=_strained(law, kin, state, step.dl))
    return _after(law, state, laws.advance_fbar(law.law, WHOLE, state.whole, step))


def _strained(law, kin, state, dl):
    return with_strain_across(law.law, kin, dl, state.target / state.across - 1)


def _after(law, state, new):
    """Add the work of the mean nominal stress across the plane, tau_zz / F_zz."""
    before = laws.kirchhoff_stress(law.law, WHOLE, state.whole)[2] / state.across
    now = laws.kirchhoff_stress(law.law, WHOLE, new)[2] / state.target
    work = 0.5 * (before + now) * (state.target - state.across)
    return State(new, state.target, state.target, state.work + work)


@laws.wave_speed_squared.on(Across)
def _wave_speed_squared_across(law, kin, state):
    return laws.wave_speed_squared(law.law, WHOLE, state.whole)


@laws.wave_speed_bound.on(Across)
def _wave_speed_bound_across(law, kin, state):
    return laws.wave_speed_bound(law.law, WHOLE, state.whole)


def with_stretch(law, kin, state, stretch):
    return state._replace(target=stretch)
