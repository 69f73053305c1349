"""The domain and its background grid."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from karamelo_py.kernels.equations.periodic import GHOSTS
from karamelo_py.language.rules import Restrictions
from karamelo_py.language.scene import Scene
from karamelo_py.language.unknown import words_of
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.scene.lattice import RELATIVE_TOLERANCE, Lattice
from karamelo_py.script.errors import Mark, ScriptError

NO_F_BAR = {"F-bar": "no anti_volumetric_locking: thin bodies do not lock"}
TWIST = Restrictions(
    "twist", "axisymmetric(true) without twist, or 3D",
    only={"method": ("ulmpm", "tlmpm", "ulmpm/contacts")},
    without=("series", "corners", "mass=corrected", "periodic", "rigid_body", "newmark"),
    but={
        "tools": "ulmpm/contacts with fix contact/friction, which also acts around the axis, or "
                 "fix angular_velocity_nodes",
        "rigid": "a stiff solid, or nodes held by fix angular_velocity_nodes",
        "yielding walls": "velocities without geq, leq and mu, or ulmpm/contacts with fix "
                          "contact/friction",
    },
)  # fmt: skip
THIN = Restrictions("thin", "plane strain or 1D strain", but=NO_F_BAR)


class Domain:
    """A box with a grid of square cells, which begins at the lower corner of the box.

    If a side is not a multiple of `h`, the grid extends past the upper corner by less than a cell.
    `lo` and `hi` (3,) are 0 in unused directions. If `h` is not given, the first solid sets it.
    """

    thin = False
    thickness = 1.0  # thickness in 2D, cross-section in 1D
    across: Any = None  # fix that prescribes the strain normal to a 2D scene
    mark: Mark | None = None
    periodic: tuple[int, ...] = ()  # periodic directions
    shear = 0.0  # velocity gradient dvx/dy of periodic images
    node_fields: tuple[type, ...] = ()

    def __init__(self, dimension: int, lo: Sequence[float], hi: Sequence[float], h: float | None):
        self.dimension = dimension
        self.kin: Any = KINEMATICS[dimension]()
        self.lo, self.hi = np.zeros((2, 3))
        self.lo[:dimension], self.hi[:dimension] = lo, hi
        self.h: float | None = None
        if h is not None:
            self.set_cell_size(h)

    def set_cell_size(self, h: float) -> None:
        self.lattice = Lattice(self.dimension, self.lo, self.hi, h)
        self.h = self.lattice.h

    @property
    def tolerance(self) -> float:
        size = self.h if self.h is not None else float((self.hi - self.lo).max()) * 1e-3
        return RELATIVE_TOLERANCE * size

    def cells_of_period(self, k: int) -> int:
        return round((self.hi[k] - self.lo[k]) / (self.h or 1.0))

    def with_images(self) -> tuple[np.ndarray, np.ndarray]:
        """Return both ends (3,) of the grid, including images beyond periodic directions."""
        more = np.zeros(3)
        more[list(self.periodic)] = GHOSTS * (self.h or 0.0)
        return self.lo - more, self.hi + more

    def depth(self, x: np.ndarray) -> np.ndarray | float:
        """Return volume / area (2D) or volume / length (1D) at positions `x` (n, d).

        In axisymmetry, the factor is the length or area per radian.
        """
        hoops = self.kin.hoops
        return x[:, 0].astype(float) ** hoops if hoops else self.thickness

    def contains(self, x: np.ndarray) -> np.ndarray:
        """Return the mask (n,) of positions `x` (n, >= dimension) in the closed box."""
        inside = np.ones(len(x), dtype=bool)
        for axis in range(self.dimension):
            inside &= x[:, axis] >= self.lo[axis] - self.tolerance
            inside &= x[:, axis] <= self.hi[axis] + self.tolerance
        return inside


def _around(hub: Scene, dimension: int) -> str | None:
    _, *words = words_of(hub.interpreter.statement) or [""]
    if words[:1] == ["block"]:
        ends = words[1 : 1 + 2 * dimension]
    elif words[:1] == ["cylinder"] and dimension == 3 and len(words) > 6:
        along, a, b, R, *ends = words[1:7]
        across = [f"{a} - {R}", f"{a} + {R}", f"{b} - {R}", f"{b} + {R}"]
        k = 2 * "xyz".find(along)
        ends = [*across[:k], *ends, *across[k:]]
    else:
        return None
    if len(ends) < 2 * dimension or "INF" in ends:
        return None
    line = f"dimension({dimension}, {', '.join(ends)}, h)"
    return f"{line} is as large as this {words[0]}; moving bodies need a larger one"


def no_domain(hub: Scene) -> ScriptError:
    if announced := hub.announced_dimension:
        ends = [f"{axis}{end}" for axis in "xyz"[:announced] for end in ("min", "max")]
        return ScriptError(
            f"the domain has no size yet: dimension({announced}) only sets the number of "
            "directions",
            expected=f"create_domain({', '.join(ends)}, h) before this line, or instead "
            f"dimension({announced}, {', '.join(ends)}, h)",
            hint=_around(hub, announced),
        )
    return ScriptError(
        "there is no domain yet",
        expected="dimension(...) before this line, such as dimension(2, xmin, xmax, ymin, ymax, h)",
    )


def require_grid(hub: Scene) -> Domain:
    domain = hub.require_domain()
    if domain.h is None:
        raise ScriptError(
            "the grid has no cell size yet",
            expected="h as the last argument of create_domain, or a solid before this line",
        )
    return domain
