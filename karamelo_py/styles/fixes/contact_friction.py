"""fix contact/friction: Coulomb friction between two solids with velocity fields of their own."""

from math import inf
from typing import Annotated, Literal

from karamelo_py.language.signature import NonNegative
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.fixes.friction import judge_friction
from karamelo_py.styles.fixes.pairs import check_pair


class ContactFriction(Fix):
    """Let two solids rub where they touch on the grid (method ulmpm/contacts).

    Parameters
    ----------
    solid1, solid2
        IDs of the two solids. Other pairs stay frictionless; a pair has one fix.
    mu
        Coefficient of friction (Coulomb): the force along the surface is at most mu times the
        force across it. The words ``no-slip`` let the solids stick while they are pressed together.

    Example
    -------
    fix(rub, contact/friction, block, base, 0.3)

    Notes
    -----
    Publishes the contact force of solid2 on solid1 as ID_x, ID_y, ID_z.

    The work of friction heats solids that have a temperature: half each, or all the one that has.
    In methods with ``thermo-mechanical`` it is shared by the effusivities sqrt(kappa rho cp), as
    between half-spaces.

    See Also
    --------
    contact/minimize_penetration, method ulmpm/contacts
    """

    syntax = "solid1, solid2, mu|no-slip"
    published = ("x", "y", "z")
    for_method = True

    def __init__(
        self,
        hub: Hub,
        solid1: Solid,
        solid2: Solid,
        mu: Annotated[float, NonNegative] | Literal["no-slip"],
    ):
        super().__init__(hub)
        check_pair(solid1, solid2)
        method = hub.update.method
        if not method.fields_per_solid:
            raise ScriptError(
                "contact/friction is for solids with velocity fields of their own",
                expected="method(ulmpm/contacts, ...)",
                hint="in ulmpm solids that meet on the grid stick together; "
                "for tlmpm there is fix contact/minimize_penetration",
            )
        a, b = (method.lattice_of(hub, solid) for solid in (solid1, solid2))
        if a == b:
            raise ScriptError(
                f"solids '{solid1.id}' and '{solid2.id}' are glued together: they never slide",
                argument="solid2",
            )
        self.solids = (solid1, solid2)
        self.friction = inf if mu == "no-slip" else float(mu)
        if mu != "no-slip":
            judge_friction(hub, self.friction)
