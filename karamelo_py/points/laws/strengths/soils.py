"""Base of the strengths of soils: their angles, and softening to a residual strength."""

from math import radians
from typing import NamedTuple

from karamelo_py.script.errors import ScriptError


class Residual(NamedTuple):
    """Strength at the end of softening: that of the peak where there is none."""

    cohesion: float
    phi: float  # radians
    softening: float  # 1 / plastic strain at the end, 0 for none


def angles(cohesion: float, phi: float, psi: float) -> tuple[float, float]:
    """Angles of friction and dilatancy in radians.

    Raises
    ------
    ScriptError
        For angles that no soil has, and where there would be no strength at all.
    """
    _check_phi("phi", phi)
    if not 0 <= psi <= phi:
        raise ScriptError(
            f"the angle of dilatancy psi = {psi:g} is impossible with phi = {phi:g}",
            argument="psi",
            expected=f"an angle from 0 to {phi:g} degrees: beyond, flow would make energy",
        )
    if cohesion == 0 and phi == 0:
        raise ScriptError(
            "without cohesion and friction there is no strength",
            argument="cohesion",
            expected="a cohesion or a friction angle above 0, or strength(ID, fluid, 0)",
        )
    return radians(phi), radians(psi)


def residual(
    cohesion: float, phi: float, to_cohesion: float | None, to_phi: float | None, over: float | None
) -> Residual:
    """Strength at the end of softening, from what the script says.

    Raises
    ------
    ScriptError
        If something is missing, or a residual is above the peak.
    """
    if to_cohesion is None and to_phi is None:
        if over is not None:
            raise ScriptError(
                "softening needs a residual strength",
                argument="softening",
                expected="residual_cohesion=... or residual_phi=..., or both",
            )
        return Residual(cohesion, radians(phi), 0.0)
    if over is None:
        raise ScriptError(
            "softening needs the plastic strain at which the residual strength is reached",
            argument="residual_cohesion" if to_cohesion is not None else "residual_phi",
            expected="softening=plastic strain",
        )
    for name, peak, value in (("cohesion", cohesion, to_cohesion), ("phi", phi, to_phi)):
        if value is not None and value > peak:
            raise ScriptError(
                f"the residual {name} {value:g} is above its peak, {peak:g}",
                argument=f"residual_{name}",
                expected=f"a number from 0 to {peak:g}",
            )
    return Residual(
        cohesion if to_cohesion is None else to_cohesion,
        radians(phi if to_phi is None else to_phi),
        1 / over,
    )


def _check_phi(name: str, phi: float) -> None:
    if not 0 <= phi < 90:
        raise ScriptError(
            f"the friction angle {name} = {phi:g} is impossible",
            argument=name,
            expected="an angle in degrees, from 0 to below 90",
        )
