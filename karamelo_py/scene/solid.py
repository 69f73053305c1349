"""Solids: bodies of material points."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from karamelo_py.kernels.equations.transfer_loss import TransferLoss
from karamelo_py.language.arguments import Named
from karamelo_py.language.by_dimension import finite
from karamelo_py.language.scene import Scene
from karamelo_py.points.laws import (
    can,
    constrained_velocity,
    is_rigid,
    law_parts,
    parameter,
    specific_volume,
)
from karamelo_py.points.laws.doubts import reference_temperatures
from karamelo_py.points.laws.temperatures import initial_heat
from karamelo_py.scene.domain import Domain
from karamelo_py.scene.lattice import CHUNK
from karamelo_py.scene.material import Material
from karamelo_py.scene.placement import MAX_POINTS, Placement
from karamelo_py.scene.region import Region
from karamelo_py.script.errors import ScriptError, plural

_SAMPLE = 5000
COLD, WARM = 60.0, 200.0  # K: a T0 below COLD is in Celsius if other solids are warmer by WARM


class Solid(Named):
    """Base of solid styles, which create their points and call `put`.

    Parameters
    ----------
    material
        Material of the points.
    h
        Cell size; if solids have a common grid (ulmpm), the cell size of the domain.
    T0
        Initial temperature; default: the material's.
    GlueToSolid
        Earlier solid whose velocity field this solid uses, in methods with a field per solid.
    """

    catalogue = "solids"
    source = "region"  # name of the argument for the points, for messages
    # Volume of all points, and volume of the shape in a file; per radian if axisymmetric.
    volumes: tuple[float, float] | None = None
    elements = ""
    region: Region | None = None
    ppc, cut = 0, False  # points per cell and direction; True if clipped at the edge of the region
    warm = False  # True if points have different temperatures

    @property
    def rigid(self) -> bool:
        return can(self.material.law, constrained_velocity)

    @property
    def counts_transfer(self) -> bool:
        """Return True if the energy that its points lose in the transfer can be counted."""
        law = self.material.filled
        return TransferLoss.needed(law) and not is_rigid(law)

    def __init__(
        self,
        hub: Scene,
        material: Material,
        h: float,
        T0: float | None,
        glued_to: "Solid | None" = None,
    ):
        self.domain = hub.require_domain()
        for name, value in (("h", h), ("T0", T0)):
            if value is not None:
                finite(hub, value, name)
        self.h = _cell_size(hub, self.domain, h)
        self.material = material
        self.T0 = T0
        self.glued_to = glued_to
        if glued_to is not None and not hub.update.method.fields_per_solid:
            hub.warn(
                "GlueToSolid has no effect: with this method all solids have one velocity field",
                hint="leave it out",
            )
        self._compare_temperatures(hub)
        self.index = len(hub.solids)
        self.initial: dict[str, np.ndarray] = {}  # initial columns (n,) of points
        self.first_id = sum(other.count for other in hub.solids.values())

    def _compare_temperatures(self, hub: Scene) -> None:
        # Only warn, as Karamelo scripts give T0 in mechanical runs, too.
        if hub.update.thermal and self.T0 and not can(self.material.law, initial_heat):
            hub.warn(
                f"T0 = {self.T0:g} has no effect: the material has no temperature",
                hint="material(ID, linear, rho, E, nu, cp, kappa), or temperature(...) with "
                "eos-strength",
            )
        T0 = self.T0 if can(self.material.law, initial_heat) else None
        melting = [parameter(law, "Tm", math.inf) for law in self.material.whole]
        Tm = min(melting, default=math.inf)
        if T0 is not None and T0 < 0:
            hub.warn(
                f"T0 = {T0:g} is below absolute zero, unless it has another origin",
                hint="temperatures in kelvin throughout: T0, Tr, Tm",
            )
        elif T0 is not None and Tm <= T0:
            hub.warn(
                f"T0 = {T0:g} is not below the melting temperature {Tm:g}: "
                "the solid has no strength from the start",
                hint="all temperatures on the same scale",
            )
        first = max(reference_temperatures(self.material.law).values(), default=-math.inf)
        if T0 is not None and 0 < T0 < COLD and first - T0 > WARM:
            hub.warn(
                f"T0 = {T0:g}, but temperatures of the material start at {first:g}",
                hint="kelvin throughout, or degrees Celsius throughout",
            )
        starts = [parameter(law, "initial_temperature", 1) for law in law_parts(self.material.law)]
        if self.T0 is None and 0 in starts:
            begins = "has no thermal stress at" if self.warm else "starts at"
            hub.warn(
                f"the solid {begins} the temperature 0: neither it nor its material sets one",
                hint="give T0 after the cell size",
            )

    def put(self, hub: Scene, placement: Placement, *, may_be_empty: bool = False) -> None:
        """Store the points. Raises ScriptError for no or too many points, and for radii below 0."""
        count, d = len(placement.x0), self.domain.dimension
        if not count and not may_be_empty:
            raise ScriptError(
                "the solid has no points: "
                + ("all of them lie outside the domain" if placement.outside else self.why_empty()),
                argument=self.source,
                expected=self.wanted(),
            )
        if self.first_id + count > MAX_POINTS:
            raise ScriptError(f"the scene has more than {MAX_POINTS} points", argument="h")
        volume = np.asarray(placement.volume, float)
        if self.domain.kin.hoops:
            radius = placement.x0[:][:, 0]
            if count and radius.min() <= 0:  # a point on the axis would have no mass
                raise ScriptError(
                    f"points at x = {radius.min():g}: x is the radius here "
                    f"({self.domain.kin.word}), and points lie at x > 0",
                    argument=self.source,
                    expected=f"a {self.described().split()[0]} at x >= 0",
                )
            volume = volume * self.domain.depth(placement.x0[:])
        else:
            volume = volume * self.domain.thickness
        # As in `Placement`, but per radian if axisymmetric; read-only. Equal values occur once.
        self.places = placement.x0
        self.volume0 = np.broadcast_to(volume, (count,))
        self.mass = np.broadcast_to(volume / float(specific_volume(self.material.law)), (count,))
        self.half_size = np.broadcast_to(placement.half_size, (count, d))
        self.shape, self.corners = placement.shape, placement.corners
        self.lo, self.hi = placement.lo, placement.hi
        if placement.outside:
            uncounted = math.isinf(placement.outside)
            points = "points" if uncounted else plural(placement.outside, "point")
            hub.warn(
                f"{points} of {self.described()} outside the domain left out of the solid",
                hint=f"make the domain larger or the {self.described().split()[0]} smaller",
            )

    described: Callable[[], str]
    why_empty: Callable[[], str]
    wanted: Callable[[], str]

    @property
    def count(self) -> int:
        return len(self.places)

    @property
    def x0(self) -> np.ndarray:
        """Initial positions (n, d); for large solids, each access computes them."""
        return self.places[:]

    def x0_of(self, numbers: np.ndarray) -> np.ndarray:
        positions = np.empty((len(numbers), self.domain.dimension))
        for begin in range(0, len(numbers), CHUNK):
            some = numbers[begin : begin + CHUNK]
            positions[begin : begin + CHUNK] = self.places[some[0] : some[-1] + 1][some - some[0]]
        return positions

    def pieces(self) -> Iterator[tuple[int, np.ndarray]]:
        for first in range(0, self.count, CHUNK):
            yield first, self.places[first : first + CHUNK]


def solid_with(hub: Scene, number: int) -> Solid:
    return [solid for solid in hub.solids.values() if solid.first_id <= number][-1]


def named(hub: Scene, number: int) -> str:
    return f"point {number + 1} of solid '{solid_with(hub, number).id}'"


def words_of_volumes(hub: Scene) -> str:
    words = [
        f"{s.id} {s.volumes[0]:.6g} of {s.volumes[1]:.6g} in its file{s.elements}"
        for s in hub.solids.values()
        if s.volumes
    ]
    return ", ".join(words[:4]) + (f" and {len(words) - 4} more solids" if len(words) > 4 else "")


def own_grids(hub: Scene) -> bool:
    return hub.update.method is not None and hub.update.method.own_grids


def _cell_size(hub: Scene, domain: Domain, h: float) -> float:
    if domain.h is None:
        domain.set_cell_size(h)
    if own_grids(hub):
        return float(h)
    assert domain.h is not None
    if abs(h - domain.h) > 1e-9 * domain.h:
        raise ScriptError(
            f"cell size {h:g} differs from the domain's, {domain.h:g}, "
            "which is common to all solids",
            argument="h",
            expected=f"{domain.h:g}, as in dimension(...)",
        )
    return domain.h


def warn_of_coinciding(hub: Scene, new: Solid, ID: str) -> None:
    for other in hub.solids.values():
        absent = np.isin(np.arange(other.count) + other.first_id, hub.waiting).all()
        if other is not new and not absent and coinciding(new, other):
            hub.warn(
                f"points of solid '{ID}' coincide with points of solid '{other.id}': the mass "
                "there is doubled",
                hint="another region for one of them, or region(ID, difference, ...)",
            )


def coinciding(a: Solid, b: Solid) -> bool:
    """Return True if points of the two solids coincide; large solids are sampled."""
    lo = np.maximum(a.lo, b.lo) - a.domain.tolerance
    hi = np.minimum(a.hi, b.hi) + a.domain.tolerance
    if not a.count or not b.count or (lo > hi).any():
        return False
    of_a = np.concatenate([_within(x, lo, hi) for _, x in a.pieces()])
    sample = _keys(of_a[:: max(1, len(of_a) // _SAMPLE)], a.h)
    return any(np.isin(sample, _keys(_within(x, lo, hi), a.h)).any() for _, x in b.pieces())


def _within(x: np.ndarray, lo: np.ndarray, hi: np.ndarray) -> np.ndarray:
    return x[((x >= lo) & (x <= hi)).all(axis=1)]


def _keys(x: np.ndarray, h: float) -> np.ndarray:
    """Return hashes (n,) of positions, which ignore round-off."""
    places = np.rint(x * (1e4 / h)).astype(np.int64)
    # Primes make hashes of different positions differ; overflow does no harm.
    return places @ np.array([1, 1_000_003, 998_244_353_001], np.int64)[: x.shape[1]]
