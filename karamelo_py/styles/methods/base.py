"""Base of methods."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from karamelo_py.kernels.equations.corrected_acceleration import Acceleration, Sides
from karamelo_py.kernels.equations.fbar import FBar, FBarOfSoil, PointByPoint
from karamelo_py.language import registry
from karamelo_py.language.rules import Restrictions
from karamelo_py.points.basis.cpdi import Element
from karamelo_py.points.frames import Updated
from karamelo_py.points.laws import can
from karamelo_py.points.laws.strengths import fbar_fraction, initial_memory
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import Mark, ScriptError

LOADS = ("ContactForce", "ContactTorque")
CORRECTED = Restrictions(
    "mass=corrected", "mass=lumped",
    # FLIP is excluded: vibrating bodies would gain energy. Bases of variable spread are excluded,
    # and contact, as its forces come later in a step: the lowest cells of a block at rest would
    # have 5 % less stress, and 23 % less on a wall with a bound.
    only={"transfer": ("APIC", "AFLIP", "ASFLIP", "MLS", "TPIC", "TFLIP"),
          "basis": ("quadratic-spline", "cubic-spline"), "method": ("ulmpm", "tlmpm")},
    without=("periodic", "pore_water", "implicit", "yielding walls"),
)  # fmt: skip


def publish_loads(hub: Hub, solid: Solid) -> None:
    for load in LOADS:
        hub.values.publish_vector(f"{load}_{solid.id}", ("x", "y", "z"))


def slots_of_loads(hub: Hub, solid: Solid) -> list[int]:
    return [hub.values.slot(f"{load}_{solid.id}_x") for load in LOADS]


def takes_average(law: Any) -> bool:
    """Return True if the yield surface of a law uses the averaged pressure (F-bar)."""
    if not can(law, fbar_fraction):
        return False
    return bool(fbar_fraction(law.strength, initial_memory(law.strength, 1.0)) > 0)


class NoContact(NamedTuple):
    rows = rows_before = rows_after = rows_work = ()


class Method:
    """Base of the method styles.

    Parameters
    ----------
    heat
        Whether heat also flows between points.

    Attributes
    ----------
    basis, basis_name
        Tag of the basis, and its name in scripts
    corrected
        Whether accelerations are corrected for the lumped masses.
    frame
        Whether weights are computed at present or reference positions.
    own_grids
        Whether each solid has a separate grid over its bounding box.
    fields_per_solid
        Whether each solid has a velocity field on the grid of the domain.
    """

    basis: NamedTuple
    basis_name = ""
    thermal = False
    mark: Mark | None = None
    marks: Mapping[str, Mark] = {}  # places of the words of method(...), by family
    corrected = False
    frame: NamedTuple = Updated()
    own_grids: ClassVar[bool] = False
    fields_per_solid: ClassVar[bool] = False

    def __init__(self, hub: Hub, heat: Literal["mechanical", "thermo-mechanical"] = "mechanical"):
        self.thermal = heat == "thermo-mechanical"

    @property
    def node_fields(self) -> tuple[type, ...]:
        return (Acceleration, Sides) if self.corrected else ()

    @property
    def regular_points(self) -> bool:
        """True if points are domains that must tile a cell."""
        return bool(self.basis.traits.shape)

    def contact_between(self, hub: Hub, lattices: Sequence[Lattice]) -> NamedTuple:
        """Return the tag of contact between solids."""
        return NoContact()

    def begin(self, hub: Hub, contact: NamedTuple) -> None:
        """Before every run, update `contact` from the fixes."""

    def remembered(self, contact: NamedTuple, spans: np.ndarray) -> list[np.ndarray]:
        """Return the contact state that the next step needs, for node ranges `spans` (k, 2)."""
        return []

    def resume(self, contact: NamedTuple, before: NamedTuple) -> None:
        """Copy the contact state from `before`, the contact of the previous lowering."""

    def welcome(self, hub: Hub, solid: Solid) -> None:
        """Prepare the method for a new solid."""

    def lattices(self, hub: Hub) -> list[Lattice]:
        domain = hub.domain
        ends = domain.with_images() if domain.periodic else (domain.lo, domain.hi)
        return [self._lattice(domain.dimension, *ends, domain.h)]

    def rigid_fields(self, hub: Hub) -> np.ndarray:
        """Return a mask (F,) of velocity fields of rigid solids, or (0,) without such fields."""
        return np.zeros(0, bool)

    def lattice_of(self, hub: Hub, solid: Solid) -> int:
        return 0

    def held_with(self, hub: Hub, nodes: np.ndarray) -> np.ndarray:
        """Return the nodes to hold if a fix prescribes all velocity components of `nodes`."""
        return nodes

    def kinematics(self, hub: Hub) -> Any:
        return hub.domain.kin

    def averaging(self, hub: Hub) -> NamedTuple:
        """Return the tag of averaging, `FBar` if volume changes are averaged."""
        if not hub.update.anti_locking:
            return PointByPoint()
        laws = [solid.material.law for solid in hub.solids.values()]
        steps = not hub.update.scheme.traits.implicit
        return FBarOfSoil() if steps and any(map(takes_average, laws)) else FBar()

    def places(self, kin: Any, solid: Solid, real: type) -> np.ndarray:
        """Return initial positions and domain shapes of a solid, (n, w)."""
        return np.concatenate([solid.x0, self.shapes(kin, solid)], axis=1).astype(real)

    def shapes(self, kin: Any, solid: Solid) -> np.ndarray:
        """Return domain shapes (n, s), as the basis stores them."""
        basis, half = type(self.basis), solid.half_size
        n, d = half.shape
        unit = np.eye(d)
        parts = [np.empty((n, 0))]
        for field in basis.traits.shape:
            if field == "corners":
                corners = _corners(basis.element, solid)
                parts.append(corners.reshape(n, corners.shape[1] * d))
            elif field == "half_edges":
                parts.append((half[:, :, None] * unit).reshape(n, d * d))
            elif field == "deformation":
                parts.append(np.tile(unit.ravel(), (n, 1)))
            else:
                parts.append(getattr(solid, field))
        return np.concatenate(parts, axis=1)

    def _lattice(
        self, dimension: int, lo: Sequence[float], hi: Sequence[float], h: float
    ) -> Lattice:
        basis = type(self.basis)
        return Lattice(dimension, lo, hi, h, basis.traits.nodes_per_cell, basis.traits.least_nodes)

    def check(self, hub: Hub) -> None:
        """Raise ScriptError for incompatible options; this is called before every run."""
        transfer, basis, scheme = hub.update.transfer, self.basis, hub.update.scheme
        if scheme.traits.implicit:
            return  # implicit schemes have other transfers, which are checked elsewhere
        unsteady = (
            transfer.traits.inverts_spread and not basis.traits.steady_moment and self.frame.moves
        )
        if unsteady and not scheme.traits.maps_velocity_again:
            raise ScriptError(
                f"{registry.name_of('transfer', type(transfer))} with the basis {self.basis_name} "
                f"and {registry.name_of('scheme', type(scheme))} is unstable: the matrix D of "
                "affine transfers vanishes at nodes, where moments then act on almost no mass",
                hint="scheme(musl), or quadratic-spline, or method tlmpm",
            )


def _corners(element: Element, solid: Solid) -> np.ndarray:
    """Return corners (n, c, d) of elements or boxes, oriented for volumes >= 0."""
    corners = solid.corners
    if corners is None:
        corners = solid.x0[:, None, :] + np.array(element.box) * solid.half_size[:, None, :]
    corners = corners.astype(float)
    edges = np.stack([corners[:, b] - corners[:, a] for a, b in element.edges], axis=1)
    negative = np.linalg.det(edges) < 0
    corners[negative] = corners[negative][:, element.mirrored]
    return corners
