"""method ulmpm: updated Lagrangian, one grid for the whole domain."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from karamelo_py.domain import RELATIVE_TOLERANCE

if TYPE_CHECKING:
    from karamelo_py.domain import Domain
    from karamelo_py.hub import Hub


class ULMPM:
    """Updated Lagrangian MPM: weights follow the present positions, all solids share one grid.

    Solids that meet on the grid move together there: contact without slip and without further
    definition.

    Parameters
    ----------
    basis
        The basis class, a product of one function a direction.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)
    """

    def __init__(self, hub: Hub, basis: type):
        self.basis = basis

    def make_basis(self, domain: Domain, real: type) -> Any:
        """The basis on the grid of `domain`, its numbers in the precision `real`."""
        size = (domain.hi - domain.lo) / domain.h
        reach = float(np.abs([domain.lo, domain.hi]).max()) / domain.h
        _, ny, nz = domain.shape
        return self.basis(
            *(real(x) for x in domain.lo),
            h=real(domain.h),
            inv_h=real(1 / domain.h),
            nx=int(domain.cells[0]),
            ny=int(domain.cells[1]),
            nz=int(domain.cells[2]),
            lx=real(size[0]),
            ly=real(size[1]),
            lz=real(size[2]),
            slack=real(max(RELATIVE_TOLERANCE, 8 * np.finfo(real).eps * reach)),
            step_x=int(ny * nz),
            step_y=int(nz),
        )
