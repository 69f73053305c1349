"""Command plane_strain."""

from karamelo_py.kernels.export import imposing
from karamelo_py.language.rules import Restrictions
from karamelo_py.points.laws.across import Across, with_stretch
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix, PointsView
from karamelo_py.script.errors import ScriptError, blaming
from karamelo_py.script.expressions import Expression

impose_stretch = imposing(with_stretch)


class StretchAcross(Fix):
    published = ()
    style = "plane_strain"
    point_by_point = conserves = True
    restrictions = Restrictions("ezz", "no plane_strain", without=("gpu", "pore_water"))

    def __init__(self, hub: Hub, ezz: Expression):
        super().__init__(hub, ParticleGroup(hub, everything=True))
        self.formulas, self.mark = (ezz,), hub.mark

    def strain_at(self, time: float) -> float:
        values, now = self.hub.values, self.hub.update.time
        values.set("time", time)
        try:
            return self.formulas[0].evaluate(values)
        finally:
            values.set("time", now)

    def initial_integrate(self, points: PointsView) -> None:
        update = self.hub.update
        # In load steps, time is the end of the step.
        end = update.time + (0.0 if update.scheme.traits.implicit else update.dt)
        ezz = self.strain_at(end)
        if not 0 < 1 + ezz < float("inf"):
            raise ScriptError(
                f"plane_strain: ezz is {ezz:g} at time {end:.6g}",
                mark=self.mark,
                expected="a strain above -1 at all times",
            )
        points.impose(impose_stretch, points.mass * 0 + (1 + ezz), Across)


def plane_strain(hub: Hub, *, ezz: Expression) -> None:
    """Prescribe the strain across the plane of a 2D scene (generalised plane strain).

    Parameters
    ----------
    ezz
        Change of length / initial length across the plane, equal at all points: a formula of time
        that is 0 at the start. The stretch is F_zz = 1 + ezz.

    Example
    -------
    dimension(2, 0, 10, 0, 30, 0.5)
    plane_strain(ezz=1e-3*time)

    Notes
    -----
    Use this command before the first material, with explicit schemes or load steps. The column
    ``thickness`` is F_zz, and s33 is the stress across the plane. Masses, forces and energies refer
    to the initial thickness, 1. The energy balance includes the work of this stress. Rigid solids
    do not stretch. GPUs, pore_water, and points that enter after a run (solid, activate, fix
    inflow) are not supported.

    See Also
    --------
    plane_stress, axisymmetric, material
    """
    domain = hub.require_domain()
    if domain.dimension != 2 or domain.kin.hoops:
        word = domain.kin.word
        message = f"the scene is {word}: plane strain has two directions, x and y"
        raise ScriptError(message, expected="dimension(2, ...) without axisymmetric(true)")
    if domain.thin:
        message = "the scene has plane stress, in which ezz follows from the law"
        raise ScriptError(message, expected="plane_stress(false)")
    if ezz.is_constant and ezz.constant == 0:
        return  # plane strain, without a prescribed ezz
    if domain.across is not None:
        message = f"ezz is prescribed already (line {domain.across.mark.line})"
        raise ScriptError(message, expected="one plane_strain, whose formula depends on time")
    if hub.materials:
        message = f"material '{next(iter(hub.materials))}' is defined already"
        expected = "plane_strain before the first material"
        raise ScriptError(message, expected=expected, code="too-late")
    across = StretchAcross(hub, ezz)
    with blaming(argument="ezz"):
        start = across.strain_at(hub.update.time)
    if start != 0:
        message = f"ezz is {start:g} at the start, where bodies have no strain"
        raise ScriptError(message, argument="ezz", expected="a formula that is 0 at time 0")
    domain.across = across
