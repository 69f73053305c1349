"""Scenes with water in the pores: what they do not support."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from karamelo_py.kernels import pore_water as rows
from karamelo_py.language import registry
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.splines import CubicSpline, QuadraticSpline
from karamelo_py.points.kinematics import Space
from karamelo_py.points.laws import initial_state, specific_volume, wave_speed_squared
from karamelo_py.points.laws.pore_water import Saturated
from karamelo_py.points.transfers.flip import FLIP, PIC, FLIPPerTime
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView
from karamelo_py.schemes.musl import MUSL
from karamelo_py.script.errors import Place, ScriptError

METHODS = "ulmpm", "tlmpm"
BASES = Linear, QuadraticSpline, CubicSpline
KINEMATICS = "1D", "plane-strain", "3D"
UNDRAINED, DRAINED = 3e-4, 2.0  # c_v t / H^2
ROWS = rows.AtWater  # registers the rows of such scenes


class PoreWater(NamedTuple):
    """The fluid of a material: numbers of its `Saturated`."""

    n: float
    drag: float
    K: float
    rho: float
    kozeny: float

    def around(self, law: NamedTuple) -> NamedTuple:
        return Saturated(law, *self)

    @property
    def stiffness(self) -> float:
        """Of the water in the pores, per strain."""
        return self.K / self.n

    def heavier(self, dry: float) -> float:
        """Density of soil and water over the `dry` density."""
        return 1 + self.n * self.rho / dry

    def time_scale(self, solid: Solid, duration: float) -> str:
        """Say whether a solid is drained in a time, across its shortest side."""
        law, kin = solid.material.whole, Space()
        M = wave_speed_squared(law, kin, initial_state(law, kin, 1.0)) / specific_volume(law)
        consolidation = M * self.stiffness / (M + self.stiffness) / self.drag
        side = min((solid.hi - solid.lo)[: solid.domain.dimension])
        Tv = consolidation * duration / side**2
        state = "coupled: water flows during the run"
        if Tv < UNDRAINED:
            state = "undrained: less than 2 % of the water flows"
        elif Tv > DRAINED:
            state = "drained: the dry soil and its weight in water would do"
        return f"Tv = {Tv:.2g} across the shortest side of '{solid.id}', {state}"

    def set_pressure(self, points: PointsView, pressure: np.ndarray) -> None:
        """Set the pressure (n,) of the water of points; the dry ones are unaffected."""
        points.impose(rows.impose_pore_pressure, pressure, Saturated)

    def check(self, hub: Hub) -> None:
        """Refuse unsupported combinations, all in one message."""
        errors = [
            ScriptError(f"pore_water does not support {what}", expected=instead, place=place)
            for what, instead, place in _reasons(hub)
        ]
        if errors:
            errors[0].others = errors[1:]
            raise errors[0]


def _reasons(hub: Hub) -> Iterator[tuple[str, str, Place | None]]:
    update, settings = hub.update, hub.settings
    method, basis = update.method, type(update.method.basis)
    name = registry.name_of("method", type(method))
    if name not in METHODS:
        yield f"method {name}", "method(ulmpm, ...) or method(tlmpm, ...)", method.place
    if type(update.transfer) not in (FLIP, FLIPPerTime, PIC):
        transfer = registry.name_of("transfer", type(update.transfer))
        yield f"transfer {transfer}", "FLIP with an alpha after the basis, or PIC", method.place
    if basis not in BASES:
        instead = "linear, quadratic-spline or cubic-spline"
        yield f"the basis {method.basis_name}", instead, method.place
    if type(update.scheme) is not MUSL:
        scheme = registry.name_of("scheme", type(update.scheme))
        yield f"scheme {scheme}", "scheme(musl)", update.scheme_place
    kin = method.kinematics(hub).word
    if kin not in KINEMATICS:
        yield f"{kin} scenes", "plane strain, 3D or 1D", None
    if update.thermal:
        yield "heat conduction", "a mechanical method", method.place
    if update.anti_locking:
        instead = "no anti_volumetric_locking: the pressure of the water does not lock"
        yield "anti_volumetric_locking", instead, None
    if update.boundary != "error":
        yield f"boundary({update.boundary})", "boundary(error)", update.boundary_place
    if settings.precision != "double":
        yield "precision(single)", "double: water is stiff", None
    if settings.comm.size > 1:
        yield "--ranks", "--threads, which divides the points in one process", None
    if settings.engine == "gpu":
        yield "--gpu", "processors, which run the same script", None
