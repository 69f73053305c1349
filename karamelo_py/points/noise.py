"""Motion through the grid that a body bears: it adds to noise that the grid does not see.

Measured with disks of rubber and of metal, 4 to 16 cells across the radius, that vibrate by 0.01 to
2 % while they drift or turn (docs/energy-measurements.md).
"""

from math import inf
from typing import Any, NamedTuple

from karamelo_py.language.rules import known_failure


class Borne(NamedTuple):
    """Cells crossed times c dt/h up to which energy is kept, with two points per cell or one."""

    drift: tuple[float, float]  # by the centre of mass in the plane and in space, musl and usf
    line: float  # by how much less that is in 1D
    averaged: tuple[float, float]  # the same as `drift` with usavg
    rim: tuple[float, float]  # by the rim of a body that turns, with musl and usf
    rim_averaged: tuple[float, float]  # the same with usavg
    fastest: float = inf  # times the speed of waves, from where on a drift feeds nothing
    damps: bool = False  # whether a drift beyond that damps what vibrates in space


JUMPS = Borne((4, 2), 3, (35, 35), (15, 1.5), (inf, 7))  # functions whose gradients jump
BOXES = Borne((18, 18), 6, (inf, inf), (60, 25), (inf, inf))
QUADRATIC = Borne((54, 20), 6, (inf, inf), (inf, 25), (inf, inf))
CUBIC = Borne((135, 70), 6, (inf, inf), (inf, inf), (inf, inf), fastest=1, damps=True)


def borne(basis: Any) -> Borne:
    """Look up what is known of these functions: the basis says it, or what is like it does."""
    usual = BOXES if basis.steep_edge else QUADRATIC
    usual = JUMPS if getattr(basis, "gradient_jumps", False) else usual
    return getattr(basis, "borne", usual)


GROWS = "noise of the velocities that the grid does not see grows with each cell"
TURNS = "turns by about {angle:.2g} rad, its rim at {speed:.2g} times the speed of waves"
WITH = "with {scene.transfer_name} and {scene.basis_name} functions"


def drifts(transfer: type) -> None:
    """Let bodies that drift with `transfer` be judged."""
    known_failure(
        transfer,
        "noise of a drift",
        when=_drift,
        reason="a body drifts at {speed:.2g} times the speed of waves through about {cells:.0f} "
        f"cells, and with {{schemes}} {GROWS}: {{gains}}",
        cause="a drift through the grid, at {speed:.2g} times the speed of waves: with {schemes} "
        f"and {{scene.basis_name}} functions {GROWS}",
        cure="{cure}",
    )


def turns(transfer: type) -> None:
    """Let bodies that turn with `transfer`, or with one that needs this field, be judged."""
    known_failure(
        transfer,
        "noise of a turn",
        when=_turn,
        reason=f"a body {TURNS} through about {{cells:.0f}} cells, and {WITH} it {{ends}} on the "
        "way",
        cause=f"a turn: a body {TURNS}, {WITH}",
        cure="{cure}",
    )


def _drift(transfer: Any, scene: Any) -> dict[str, Any] | None:
    if scene.drift is None:
        return None
    averages = scene.scheme.traits.bears_drift
    gains = "if it vibrates, that gains a tenth to several times its energy"
    cure = "scheme(usavg), with which it grows ten times less, or not"
    if borne(scene.basis).damps and scene.d == 3:
        gains = "it damps what vibrates (to 0.85 of its energy where that was tried)"
        cure = "method tlmpm"
    elif averages:
        cure = "quadratic-spline in the place of the basis"
    schemes = "usavg" if averages else "musl and usf"
    return {**scene.drift._asdict(), "schemes": schemes, "gains": gains, "cure": cure}


def _turn(transfer: Any, scene: Any) -> dict[str, Any] | None:
    turn, cure = scene.rotation, "or method tlmpm"
    if turn is None:
        return None
    if scene.sparse:
        cure = f"{scene.corners} points per cell, {cure}"
    elif turn.noisy:
        cure = f"quadratic-spline in the place of the basis, {cure}"
    ends = "loses points at its rim" if turn.torn else "gains a tenth of its energy or more"
    return {**turn._asdict(), "ends": ends, "cure": cure}
