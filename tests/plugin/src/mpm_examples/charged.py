"""fix charged: a force by a field of the points' own, their charge, which leaks away."""

from karamelo_py.compiler.fields import Field
from karamelo_py.kernels.equations.internal_force import Force, WorkOfForces
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.modify import Fix, vector_hook
from karamelo_py.script.expressions import Expression


class Charge(Field):
    """Charge of a point, of that which it begins with."""

    columns = ("charge",)
    start = 1.0


def repel(mass, position, charge, force, values, dt):
    """f = m k q x, and dq/dt = -leak q."""
    k, leak = values
    return force + mass * charge * k * position, charge / (1 + leak * dt)


class Charged(Fix):
    """Drive charged points away from the origin; their charge leaks away.

    Parameters
    ----------
    k
        Force per mass and distance at full charge: a number or a formula.
    leak
        Share of the charge that is lost per time, likewise.

    Example
    -------
    fix(dust, charged, all, 4, 0.5)

    Notes
    -----
    The column charge of dumps shows what is left.
    """

    published = ()
    point_fields = (Charge, Force, WorkOfForces)
    initial_integrate = vector_hook(
        repel, reads=("mass", "position", Charge, Force), writes=(Force, Charge)
    )

    def __init__(self, hub, group: ParticleGroup, k: Expression, leak: Expression):
        super().__init__(hub, group)
        self.formulas = (Expression(k), Expression(leak))
