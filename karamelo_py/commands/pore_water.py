"""Command pore_water."""

from typing import Annotated

from karamelo_py.language.signature import Positive
from karamelo_py.points.laws import is_rigid, specific_volume
from karamelo_py.points.laws.pore_water import ConstantPermeability, KozenyCarman
from karamelo_py.run.lower.pore_water import PoreWater, oedometric_modulus
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.script.errors import ScriptError

LEAST, MOST = 0.01, 0.9
HEAVIEST = 3.2  # density of grains / density of water; in soils it is 2.6 to 2.8
SOFTEST = 1e-3  # bulk modulus of the water / oedometric modulus of the soil
SLOWEST, FASTEST = 1e-13, 10.0  # conductivities in m/s


def pore_water(
    hub: Hub, material: Material, *,
    n: float,
    permeability: Annotated[float, Positive] | None = None,
    intrinsic: Annotated[float, Positive] | None = None,
    viscosity: Annotated[float, Positive] = 1e-3,
    K: Annotated[float, Positive] = 2.2e9,
    rho: Annotated[float, Positive] = 1000.0,
    gravity: Annotated[float, Positive] = 9.81,
    kozeny: bool = False,
    suction: Annotated[float, Positive] | None = None,
) -> None:  # fmt: skip
    """Fill the pores of a material with water: consolidation, seepage, undrained loads.

    Parameters
    ----------
    material
        The soil skeleton: any solid material. Its density is the dry density, (1 - n) times the
        density of the grains; its stress is the effective stress.
    n
        Porosity before deformation, from 0.01 to 0.9.
    permeability
        Hydraulic conductivity k in m/s (Darcy): porosity times relative velocity of the water = k
        times hydraulic gradient.
    intrinsic
        Permeability in m^2, instead of the conductivity.
    viscosity
        Viscosity of the water in Pa s, with ``intrinsic``.
    K
        Bulk modulus of the water.
    rho
        Density of the water.
    gravity
        Gravity in the definition of the conductivity. This gravity is not a load (see fix
        body_force).
    kozeny
        true: the permeability follows n^3/(1 - n)^2 (Kozeny & Carman).
    suction
        Let soil above the water table be unsaturated (load steps only): at a pore pressure p < 0,
        saturation and relative permeability are exp(p/suction) (Gardner 1958).

    Example
    -------
    material(clay, linear, 1590, 1e7, 0)
    pore_water(clay, n=0.4, permeability=1e-3)
    pore_water(sand, n=0.42, intrinsic=1e-11, viscosity=1e-3, kozeny=true)

    Notes
    -----
    Points contain soil and pore water; nodes have separate velocities of soil and water (Jassim,
    Stolle & Vermeer 2013; Bandara & Soga 2015). Columns: ``pore_pressure``, ``saturation``,
    ``porosity``, ``water_content`` (mass of the water per unit volume before deformation), and
    ``wx``, ``wy``, ``wz``, the Darcy velocity (porosity times the velocity of the water relative to
    the soil). ``s11`` ... is the effective stress, ``t11`` ... the total stress.

    Surfaces are impermeable, except at nodes of a fix pore_pressure. Loads on a surface act on the
    soil; a fix that holds nodes holds the soil, and its reaction includes the water. Fix body_force
    acts on soil and water. Computes of mass, momentum and energy (linear_momentum, kinetic_energy,
    ...) count the soil alone; the stored energy includes the compressed water. The energy balance
    includes the water, its drag, inflow and outflow.

    The stable step is set by the fast compression wave (about 1850 m/s in water-saturated soil),
    not by the drag. With N cells along a drainage path of length L, consolidation to Tv = 1 takes
    about 1.1 N L c/c_v steps, where c is the wave speed and c_v the coefficient of consolidation.
    With scheme(semi-implicit), it takes 1.2 N L c/c_v steps with the wave speed c of the dry soil.
    If too many steps are needed, as at 1e-9 m/s, use scheme(quasi-static), or multiply the
    densities by a factor, as in inputs/in.terzaghi.

    Use this command before the first solid of the material. It needs method ulmpm or tlmpm with
    FLIP or PIC and linear, quadratic-spline or cubic-spline, scheme musl, semi-implicit or
    quasi-static, and a scene in 1D, plane strain or 3D (with semi-implicit and linear also
    axisymmetric or cylindrical). With ulmpm and linear, results lose accuracy at strains above 10
    %.

    See Also
    --------
    fix pore_pressure, fix initial_pore_pressure, material, scheme semi-implicit
    """
    if (permeability is None) == (intrinsic is None):
        message = "the permeability is " + ("given twice" if intrinsic else "missing")
        expected = "permeability=... in m/s, or intrinsic=... in m^2"
        raise ScriptError(message, argument="permeability", expected=expected)
    if not LEAST <= n <= MOST:
        message = f"the porosity is {n:g}"
        expected = f"a number from {LEAST:g} to {MOST:g}: volume of pores / whole volume"
        raise ScriptError(message, argument="n", expected=expected)
    if is_rigid(material.whole):
        raise ScriptError(
            f"material '{material.id}' is rigid, and water would not flow through it",
            argument="material",
            expected="a material that deforms",
        )
    if material.fluid is not None:
        raise ScriptError(
            f"material '{material.id}' has pore water already",
            argument="material",
            expected="one pore_water for each material",
        )
    for solid in hub.solids.values():
        if solid.material is material:
            raise ScriptError(
                f"solid '{solid.id}' has this material already",
                argument="material",
                expected="pore_water before the solid",
                code="too-late",
            )
    drag = rho * gravity / permeability if permeability else viscosity / (intrinsic or 1.0)
    conductivity = rho * gravity / drag
    if not SLOWEST <= conductivity <= FASTEST:
        name = "permeability" if permeability else "intrinsic"
        other = (
            "intrinsic=..., the permeability in m^2" if permeability else "permeability=... in m/s"
        )
        hub.warn(
            f"the hydraulic conductivity is {conductivity:.3g} m/s, outside the range of soils, "
            f"{SLOWEST:g} to {FASTEST:g}",
            hint=f"{other}, if {name} is in the wrong unit",
        )
    dry = 1 / float(specific_volume(material.whole))
    grains = dry / (1 - n) / rho
    if grains > HEAVIEST:
        hub.warn(
            f"the grains of '{material.id}' would be {grains:.2g} times as dense as water: "
            f"density {dry:g} divided by 1 - n",
            hint="a material takes the dry density, (1 - n) times the density of its grains",
        )
    M = oedometric_modulus(material.whole)
    if K < SOFTEST * M:
        hub.warn(
            f"water with K = {K:g} is {M / K:.2g} times softer than the soil '{material.id}', and "
            "would carry no load",
            hint="K=2.2e9 for water, in Pa",
        )
    k = KozenyCarman() if kozeny else ConstantPermeability()
    suction = K if suction is None else suction
    material.fluid = PoreWater(n, drag, K, rho, k, suction, hub.update)
