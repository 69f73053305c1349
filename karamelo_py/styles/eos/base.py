"""Base of the styles of equations of state."""

from __future__ import annotations

from typing import NamedTuple

from karamelo_py.points.laws.viscosity import NoViscosity
from karamelo_py.points.laws.viscosity.artificial import ArtificialViscosity
from karamelo_py.scene.part import Part


class Eos(Part):
    """Base of the styles of equations of state; the class of `law` selects the point functions
    (:mod:`karamelo_py.points.laws.eos`).

    Attributes
    ----------
    viscosity
        The viscous pressure that goes with it (:mod:`karamelo_py.points.laws.viscosity`).
    """

    script_kind = "the ID of an equation of state"
    catalogue = "eos"
    viscosity: NamedTuple = NoViscosity()


def artificial_viscosity(Q1: float, Q2: float) -> NamedTuple:
    """The artificial viscosity with these coefficients; none where both are 0."""
    return ArtificialViscosity(Q1, Q2, 0.0) if Q1 > 0 or Q2 > 0 else NoViscosity()
