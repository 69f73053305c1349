"""Methods with convected domains: ulcpdi and tlcpdi."""

from typing import Any, ClassVar

import numpy as np

from karamelo_py.points.basis import carried
from karamelo_py.points.basis.cpdi.domains import H8, Q4, R4, R8, T3, Tet4
from karamelo_py.points.transfers.affine import ASFLIP
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.methods.base import Method
from karamelo_py.styles.methods.ulmpm import TLMPM, ULMPM

VARIANTS = {"R4": R4, "Q4": Q4, "T3": T3, "R8": R8, "H8": H8, "Tet4": Tet4}


class Convected(Method):
    """A method with point domains that deform with the points (CPDI).

    Parameters
    ----------
    variant
        Shape of the domains.

    Attributes
    ----------
    variants
        The families of domains by name.
    """

    variants: ClassVar[dict[str, type]] = VARIANTS

    def shapes(self, kin: Any, solid: Solid) -> np.ndarray:
        self._check_elements(kin.dimension, solid)
        return super().shapes(kin, solid)

    def check(self, hub: Hub) -> None:
        super().check(hub)
        self._check_elements(hub.domain.dimension, *hub.solids.values())
        moves_corners = self.frame.moves and carried(self.basis, self.kinematics(hub)) > 0
        if moves_corners and isinstance(hub.update.transfer, ASFLIP):
            raise ScriptError(
                "ASFLIP moves points faster than the grid, and the corners of "
                f"{type(self.basis).__name__} domains, which move with the grid, would not follow",
                hint="AFLIP or another transfer, or domains of the shape "
                + ("R4" if hub.domain.dimension == 2 else "R8"),
            )

    def _check_elements(self, d: int, *solids: Solid) -> None:
        basis = type(self.basis)
        name, element = basis.__name__, basis.element
        if d != basis.dimension:
            fit = [name for name, other in VARIANTS.items() if other.dimension == d]
            raise ScriptError(
                f"domains of the shape {name} are for {basis.dimension} dimensions, and "
                f"this scene has {d}",
                hint=f"one of {', '.join(fit)} instead" if fit
                else "method ulmpm with the basis cpgimp, which is the same in 1D",
            )  # fmt: skip
        elements = {n: v.element for n, v in VARIANTS.items() if v.dimension == d}
        boxes = [n for n, other in elements.items() if other is None or other.box]
        for solid in solids:
            has = f"elements of the kind {solid.shape}"
            if solid.shape == "box":
                fits, has = name in boxes, "boxes"
                hint = f"a mesh of triangles or tetrahedra, or one of the shapes {', '.join(boxes)}"
            else:
                fits = element is not None and element.kind == solid.shape
                fit = [n for n, other in elements.items() if other and other.kind == solid.shape]
                hint = f"{fit[0]} instead of {name}" if fit else "a mesh of linear elements"
            if not fits:
                raise ScriptError(
                    f"points of solid '{solid.id}' have {has} around them, which cannot be "
                    f"converted to {name} domains",
                    mark=solid.mark,
                    hint=hint,
                )


class ULCPDI(Convected, ULMPM):
    """CPDI: each point has a deforming domain, and interacts with the nodes around its corners.

    All solids have one grid. There is no numerical fracture at any stretch, and no jump of forces
    when a point crosses a cell face (Sadeghirad et al. 2011, 2013). Variants:

    ``R4`` and ``R8``
        parallelograms and parallelepipeds that deform with F of their point: robust;
    ``Q4`` and ``H8``
        quadrilaterals and hexahedra whose corners move with the grid: no gaps or overlaps;
    ``T3`` and ``Tet4``
        triangles and tetrahedra of a mesh, whose corners move with the grid.

    Example
    -------
    method(ulcpdi, FLIP, linear, 1, R4)
    method(ulcpdi, FLIP, linear, 1, mechanical, Q4)
    """


class TLCPDI(Convected, TLMPM):
    """Total Lagrangian CPDI: initial domains on a separate grid for each solid.

    Domains do not deform, so they cannot tangle. Solids do not interact on the grid. The variants
    are as in ulcpdi.

    Example
    -------
    method(tlcpdi, FLIP, linear, 1, Q4)
    """
