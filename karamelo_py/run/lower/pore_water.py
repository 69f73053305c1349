"""Pore water of a material, and scenes in which it is not supported."""

from typing import NamedTuple

import numpy as np

from karamelo_py.kernels import pore_water as rows
from karamelo_py.language.rules import FLAT, HATS_AND_SPLINES, Restrictions
from karamelo_py.points.kinematics import Space
from karamelo_py.points.laws import initial_state, specific_volume, wave_speed_squared
from karamelo_py.points.laws.pore_water import ConstantPermeability, KozenyCarman, Saturated
from karamelo_py.scene.hub import Update
from karamelo_py.scene.solid import Solid
from karamelo_py.scene.views import PointsView

UNDRAINED, DRAINED = 3e-4, 2.0  # time factors c_v t / H^2
RESTRICTIONS = Restrictions(
    "pore_water", "a dry material",
    only={"method": ("ulmpm", "tlmpm"), "transfer": ("FLIP", "FLIP/per-time", "PIC"),
          "basis": HATS_AND_SPLINES, "scheme": ("musl", "semi-implicit", "quasi-static"),
          "kinematics": FLAT},
    without=("heat", "delete", "reflect", "thin"),
    but={"kinematics": "1D, plane strain or 3D; axisymmetric or cylindrical with semi-implicit "
         "and linear",
         "single": "precision(double): water is stiff",
         "F-bar": "no anti_volumetric_locking: the pressure of the water does not lock"},
)  # fmt: skip


def oedometric_modulus(law: NamedTuple) -> float:
    """Return the modulus M of an undeformed law, which is c^2 times its density."""
    kin = Space()
    return float(wave_speed_squared(law, kin, initial_state(law, kin, 1.0)) / specific_volume(law))


class PoreWater(NamedTuple):
    tag, tag_in_load_steps, tag_of_solution = rows.Water(), rows.SlowWater(), rows.SolvedWater()
    node_fields = rows.Water.node_fields

    n: float
    drag: float
    K: float
    rho: float
    permeability: ConstantPermeability | KozenyCarman
    suction: float
    update: Update

    @property
    def point_fields(self) -> tuple[type, ...]:
        return rows.Water.point_fields[: 2 if self._is_linear else None]

    @property
    def _is_linear(self) -> bool:
        method = self.update.method
        return method is not None and method.basis.traits.gradient_jumps

    @property
    def words(self) -> str:
        return "pore_water" if self.suction == self.K else "pore_water with suction"

    @property
    def restrictions(self) -> Restrictions:
        only = dict(RESTRICTIONS.only)
        if self.suction < self.K:
            only["scheme"] = ("quasi-static",)
        elif self.update.scheme.traits.solves_pressure and self._is_linear:
            only["kinematics"] = *FLAT, "axisymmetric", "cylindrical"
        return RESTRICTIONS._replace(only=only)

    def around(self, law: NamedTuple) -> NamedTuple:
        solved = self.update.scheme.traits.solves_pressure
        fades = min(1.0, (oedometric_modulus(law) / (2 * self.stiffness)) ** 4)
        return Saturated(law, *self[:-1], K_of_waves=0.0 if solved else self.K, fades=fades)

    @property
    def stiffness(self) -> float:
        return self.K / self.n

    def heavier(self, dry: float) -> float:
        return 1 + self.n * self.rho / dry

    def time_scale(self, solid: Solid, duration: float) -> str:
        """Describe the drainage of a solid along its shortest side in a time `duration`."""
        M = oedometric_modulus(solid.material.whole)
        consolidation = M * self.stiffness / (M + self.stiffness) / self.drag
        side = min((solid.hi - solid.lo)[: solid.domain.dimension])
        Tv = consolidation * duration / side**2
        state = "coupled: water flows during the run"
        if Tv < UNDRAINED:
            state = (
                "undrained: less than 2 % of the water flows; a dry material of the saturated "
                f"density, with a bulk modulus {self.stiffness:.3g} larger, is enough"
            )
        elif Tv > DRAINED:
            state = "drained: the dry soil with its weight in water is enough"
        return f"Tv = {Tv:.2g} across the shortest side of '{solid.id}', {state}"

    def set_pressure(self, points: PointsView, pressure: np.ndarray) -> None:
        points.impose(rows.impose_pore_pressure, pressure, Saturated)
