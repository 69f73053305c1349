"""fix plastic_heat: the heat of plastic work, from stress and plastic strain of the law."""

from typing import Annotated

from karamelo_py.compiler.fields import Field
from karamelo_py.kernels.equations.heat import Supply
from karamelo_py.language.signature import In
from karamelo_py.points.kinematics import dev, von_mises
from karamelo_py.points.laws import cauchy_stress, plastic_strain
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.modify import Fix, vector_hook
from karamelo_py.script.expressions import Expression


class StrainBefore(Field):
    """Plastic strain that a point had one step earlier."""


def heat(volume, stress, strain, before, supply, values, dt):
    """Heating power chi V q dep/dt, with the von Mises stress q; the sum is published."""
    (chi,) = values
    power = chi * volume * von_mises(dev(stress)) * (strain - before) / dt
    return supply + power, strain, power


class PlasticHeat(Fix):
    """Turn a share of the plastic work of points into heat.

    Parameters
    ----------
    chi
        The share (Taylor and Quinney 1934), from 0 to 1: a number or a formula.

    Example
    -------
    fix(warm, plastic_heat, all, 0.9)

    Notes
    -----
    For thermo-mechanical methods. Publishes the heating power as ID_s.
    """

    published = ("s",)
    point_fields = (StrainBefore,)
    supply_heat = vector_hook(
        heat,
        reads=("volume", cauchy_stress, plastic_strain, StrainBefore, Supply),
        writes=(Supply, StrainBefore),
        publishes=True,
    )

    def __init__(self, hub, group: ParticleGroup, chi: Annotated[Expression, In(0, 1)]):
        super().__init__(hub, group)
        self.formulas = (Expression(chi),)
