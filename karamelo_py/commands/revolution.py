"""Commands axisymmetric, cylindrical, spherical."""

from karamelo_py.commands.thin import refuse_across, refuse_uneven
from karamelo_py.points.kinematics import KINEMATICS, Axisymmetric, Cylindrical, Spherical
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, plural


def axisymmetric(hub: Hub, active: bool, *, twist: bool = False) -> None:
    """Make x the radius and y the axis of symmetry.

    Parameters
    ----------
    active
        ``true``, or ``false`` for plane strain (the default).
    twist
        Also allow rotation around the axis, by a different angle at each point: torsion, spinning
        bodies, swirling fluids.

    Example
    -------
    dimension(2, 0, 10, 0, 30, 0.5)
    axisymmetric(true)
    axisymmetric(true, twist=true)

    Notes
    -----
    Use this command before the first solid, in a 2D domain with x >= 0. Points carry the volume and
    mass of one radian: multiply forces and energies by 2 pi for the whole body.

    With twist, z is the circumferential direction: components 13 and 23 are the shears r-theta and
    z-theta of cylindrical coordinates. The third component of fix initial_velocity_particles is the
    velocity around the axis, and fix angular_velocity_nodes holds and rotates nodes. The third
    component of force_nodes, force_particles, body_force and edge_traction acts around the axis;
    its torque per radian is published as ID_z. Points have the columns ``vtheta``, the velocity
    around the axis, and ``twist``, the angle of rotation in radians. compute angular_momentum
    publishes the angular momentum about the axis as ID_y, conserved to round-off.

    Load steps (scheme quasi-static) also solve for the rotation of the nodes. In ulmpm/contacts,
    fix contact/friction also acts around the axis: ContactTorque_ID_y is the torque about the axis.
    Twist cannot be combined with scheme newmark, contact in load steps, contact between points or
    with surfaces, tools, walls with bounds or friction, rigid solids, periodic directions or CPDI.

    See Also
    --------
    dimension, cylindrical, spherical, fix angular_velocity_nodes
    """
    if twist and not active:
        message = "only a body of revolution can twist around its axis"
        raise ScriptError(message, argument="twist", expected="axisymmetric(true, twist=true)")
    _set(hub, active, Twisted() if twist else Axisymmetric())


def cylindrical(hub: Hub, active: bool) -> None:
    """Make a 1D scene a cylinder or tube: x is the distance from its axis.

    Example
    -------
    dimension(1, 0, 10, 0.1)
    cylindrical(true)

    Notes
    -----
    Use this command before the first solid, in a 1D domain with x >= 0. The hoop strain is the
    radial displacement / r (component 22); there is no strain along the axis (33). Points carry
    the volume and mass of one radian and of unit length, r dr: multiply by 2 pi for the whole ring.
    A node at x = 0 does not move.

    See Also
    --------
    spherical, axisymmetric, dimension
    """
    _set(hub, active, Cylindrical())


def spherical(hub: Hub, active: bool) -> None:
    """Make a 1D scene a sphere or spherical shell: x is the distance from its centre.

    Example
    -------
    dimension(1, 0, 10, 0.1)
    spherical(true)

    Notes
    -----
    Use this command before the first solid, in a 1D domain with x >= 0. The hoop strains,
    components 22 and 33, are the radial displacement / r. Points carry the volume and mass of
    one steradian, r^2 dr: multiply by 4 pi for the whole sphere. A node at x = 0 does not move.
    Materials must behave in the same way in y and z. At a Poisson's ratio near 0.5, and in plastic
    flow of metals, a linear basis locks: use anti_volumetric_locking(true).

    See Also
    --------
    cylindrical, axisymmetric, dimension
    """
    _set(hub, active, Spherical())


SPACES = {1: "one: the radius", 2: "two: radius and axis"}
INSTEAD = {1: "cylindrical(true) or spherical(true)", 2: "axisymmetric(true)"}


def _set(hub: Hub, active: bool, kin: Axisymmetric | Cylindrical | Spherical) -> None:
    domain, d, name = hub.require_domain(), kin.dimension, kin.word
    same = type(domain.kin) is type(kin) if active else isinstance(domain.kin, type(kin))
    written = "axisymmetric(true, twist=true)" if isinstance(kin, Twisted) else f"{name}(true)"
    if active and domain.dimension != d:
        has = plural(domain.dimension, "dimension")
        message = f"the domain has {has}, but must have {SPACES[d]}"
        expected = f"dimension({d}, ...) before {written}"
        hint = INSTEAD.get(domain.dimension)
        raise ScriptError(message, argument="active", expected=expected, hint=hint)
    if active and domain.lo[0] < 0:
        message = f"the domain begins at x = {domain.lo[0]:g}, and x is a radius"
        expected = f"dimension({d}, 0, ...), or more than 0 instead of 0"
        raise ScriptError(message, argument="active", expected=expected)
    if active and domain.thin:
        thin = {1: "uniaxial_stress", 2: "plane_stress"}[d]
        message = f"the scene has {thin.replace('_', ' ')}, which has no hoop stress"
        raise ScriptError(message, argument="active", expected=f"{thin}(false)")
    refuse_across(domain, active)
    if active and domain.kin.hoops and not same:
        message = f"the scene is {domain.kin.word} already"
        expected = f"{domain.kin.word.split()[0]}(false) first, or no {written}"
        raise ScriptError(message, argument="active", expected=expected)
    if hub.solids and active != same:
        message, expected = "the solids already have points", "before the first solid"
        expected = f"{name}({str(active).lower()}) {expected}"
        raise ScriptError(message, argument="active", expected=expected, code="too-late")
    if active != same:
        domain.kin = kin if active else KINEMATICS[d]()
    for material in hub.materials.values():
        refuse_uneven(hub, material, "active")
