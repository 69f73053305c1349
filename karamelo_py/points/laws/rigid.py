"""Bodies that move as they are told: no stress, and a velocity that nothing changes."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.compiler.compile import real
from karamelo_py.points.kinematics import zero_symmetric
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    driven,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    specific_volume,
    wave_speed_squared,
)


class Rigid(NamedTuple):
    """The state is empty: there is nothing to remember."""

    specific_volume: float  # volume per mass


@initial_state.on(Rigid)
def _(law, kin, like):
    return ()


@advance.on(Rigid)
def _(law, kin, state, dl, dt):
    return ()


@driven.on(Rigid)
def _(law, own, given):
    return own


@cauchy_stress.on(Rigid)
@kirchhoff_stress.on(Rigid)
@elastic_strain.on(Rigid)
def _(law, kin, state):
    return zero_symmetric(kin, law.specific_volume)


@jacobian.on(Rigid)
def _(law, kin, state):
    return real(1, law.specific_volume)


@wave_speed_squared.on(Rigid)
@energy_density.on(Rigid)
def _(law, kin, state):
    return real(0, law.specific_volume)


@specific_volume.on(Rigid)
def _(law):
    return law.specific_volume
