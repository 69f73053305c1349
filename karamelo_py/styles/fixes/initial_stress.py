"""fix initial_stress: stress of points before the first step."""

from karamelo_py.kernels.laws import elastic_law
from karamelo_py.points.laws import can, with_stress
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression

NAMES = ("11", "22", "33", "23", "13", "12")


class InitialStress(Fix):
    """Give points a Cauchy stress before the first step after this line, and never again.

    Parameters
    ----------
    sxx, syy, szz, syz, sxz, sxy
        Components: numbers or formulas of x, y, z, x0, y0, z0; tension is positive. NULL leaves a
        component alone. Shear components that the dimension does not have must be NULL or 0.

    Example
    -------
    fix(geostatic, initial_stress, soil, 0.4*2000*9.81*y0, 2000*9.81*y0, 0.4*2000*9.81*y0, 0, 0, 0)

    Notes
    -----
    The stress of a hyperelastic material (neo-hookean) follows from its deformation and cannot be
    set.
    """

    published = ()
    first_step_only = True
    point_by_point = True

    def __init__(
        self,
        hub: Hub,
        group: ParticleGroup,
        sxx: Expression | None,
        syy: Expression | None,
        szz: Expression | None,
        syz: Expression | None,
        sxz: Expression | None,
        sxy: Expression | None,
    ):
        super().__init__(hub, group)
        self.formulas = (sxx, syy, szz, syz, sxz, sxy)
        for solid in hub.solids.values():
            if group.touches(solid) and not can(elastic_law(solid.material.law), with_stress):
                raise ScriptError(
                    f"the stress of solid '{solid.id}' follows from its deformation "
                    "and cannot be set",
                    argument="group",
                    expected="points of a material in rate form, such as linear or eos-strength",
                )

    def initial_integrate(self, points: PointsView) -> None:
        x, x0 = points.position, points.reference_position
        given = {
            name: formula.evaluate_points(self.hub.values, x, x0)
            for name, formula in zip(NAMES, self.formulas, strict=True)
            if formula is not None
        }
        points.set_stress(given)
