"""Limits of drift and rotation through the grid, which amplify null-space noise.

The limits were measured with disks of rubber and metal, with 4 to 16 cells in the radius, that
vibrate with strains of 0.01 to 2 % (docs/energy-measurements.md).
"""

from math import inf
from typing import Any, NamedTuple

from karamelo_py.language.rules import known_failure


class DriftLimits(NamedTuple):
    """Largest (cells crossed) x c dt/h that conserves energy, for 2 and 1 points per cell."""

    drift: tuple[float, float]  # limits of the centre of mass in 2D and 3D, musl and usf
    line: float  # limit in 1D
    averaged: tuple[float, float]  # `drift` of usavg
    rim: tuple[float, float]  # limits of the rim of a rotating body, musl and usf
    rim_averaged: tuple[float, float]  # `rim` of usavg
    fastest: float = inf  # drift / wave speed above which no noise is added
    damps: bool = False  # True if, in 3D, a faster drift damps vibrations


JUMPS = DriftLimits((4, 2), 3, (35, 35), (15, 1.5), (inf, 7))  # for bases with gradient jumps
BOXES = DriftLimits((18, 18), 6, (inf, inf), (60, 25), (inf, inf))
QUADRATIC = DriftLimits((54, 20), 6, (inf, inf), (inf, 25), (inf, inf))
CUBIC = DriftLimits((135, 70), 6, (inf, inf), (inf, inf), (inf, inf), fastest=1, damps=True)


def drift_limits(basis: Any) -> DriftLimits:
    traits = basis.traits
    usual = BOXES if traits.steep_edge else QUADRATIC
    return traits.drift_limits or (JUMPS if traits.gradient_jumps else usual)


GROWS = "velocity noise in the null space of the grid grows with each cell"
TURNS = "rotates by about {angle:.2g} rad, its rim at {speed:.2g} times the wave speed"
WITH = "with {scene.transfer_name} and the basis {scene.basis_name}"


def warn_of_drift(transfer: type) -> None:
    known_failure(
        transfer,
        "noise of a drift",
        when=_drift,
        reason="a body drifts at {speed:.2g} times the wave speed through about {cells:.0f} "
        f"cells, and with {{schemes}} {GROWS}: {{gains}}",
        cause="a drift through the grid, at {speed:.2g} times the wave speed: with {schemes} "
        f"and the basis {{scene.basis_name}}, {GROWS}",
        cure="{cure}",
    )


def warn_of_rotation(transfer: type) -> None:
    known_failure(
        transfer,
        "noise of a rotation",
        when=_turn,
        reason=f"a body {TURNS} through about {{cells:.0f}} cells; {WITH} it {{ends}} on the way",
        cause=f"a body {TURNS}, {WITH}",
        cure="{cure}",
    )


def _drift(transfer: Any, scene: Any) -> dict[str, Any] | None:
    if scene.drift is None:
        return None
    averages = scene.scheme.traits.allows_drift
    gains = "a vibration gains 0.1 to several times its energy"
    cure = "scheme(usavg), with which noise grows ten times less or not at all"
    if drift_limits(scene.basis).damps and scene.d == 3:
        gains = "vibrations are damped (to 0.85 of their energy in tests)"
        cure = "method tlmpm"
    elif averages:
        cure = "quadratic-spline"
    schemes = "usavg" if averages else "musl and usf"
    return {**scene.drift._asdict(), "schemes": schemes, "gains": gains, "cure": cure}


def _turn(transfer: Any, scene: Any) -> dict[str, Any] | None:
    turn, cure = scene.rotation, "or method tlmpm"
    if turn is None:
        return None
    if scene.sparse:
        cure = f"{scene.corners} points per cell, {cure}"
    elif turn.noisy:
        cure = f"quadratic-spline, {cure}"
    ends = "loses points at its rim" if turn.torn else "gains 10 % of its energy or more"
    return {**turn._asdict(), "ends": ends, "cure": cure}
