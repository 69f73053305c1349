"""Rules on motion through the grid that feeds what the grid does not see of velocities."""

from typing import Any

from karamelo_py.language.rules import gain, known_failure
from karamelo_py.points.basis.noise import borne

GROWS = "what the grid does not see of the velocities grows with each cell"


def _drift(transfer: Any, scene: Any) -> dict[str, Any] | None:
    """What the words on a drift say, and its share."""
    if scene.drift is None:
        return None
    averages = getattr(scene.scheme, "bears_drift", False)
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
    """What the words on a turn say, and its share."""
    turn = scene.rotation
    if turn is None:
        return None
    cures = ["or method tlmpm"]
    if scene.sparse:
        cures.insert(0, f"{scene.corners} points a cell")
    elif turn.noisy:
        cures.insert(0, "quadratic-spline in the place of the basis")
    ends = "loses points at its rim" if turn.torn else "gains a tenth of its energy or more"
    return {**turn._asdict(), "ends": ends, "cure": ", ".join(cures)}


TURNS = "turns by about {angle:.2g} rad, its rim at {speed:.2g} times the speed of waves"
WITH = "with {scene.transfer_name} and {scene.basis_name} functions"


def _loud(found: dict[str, Any] | None) -> dict[str, Any] | None:
    return found if found and found["share"] > 1 else None


def drifts(transfer: type) -> None:
    """Let bodies that drift with `transfer` be judged."""
    known_failure(
        transfer,
        "noise of a drift",
        when=lambda transfer, scene: _loud(_drift(transfer, scene)),
        reason="a body drifts at {speed:.2g} times the speed of waves through about {cells:.0f} "
        f"cells, and with {{schemes}} {GROWS}: {{gains}}",
        cure="{cure}",
    )
    gain(
        transfer,
        when=_drift,
        cause="a drift through the grid, at {speed:.2g} times the speed of waves: with {schemes} "
        f"and {{scene.basis_name}} functions {GROWS}",
        cure="{cure}",
    )


def turns(transfer: type) -> None:
    """Let bodies that turn with `transfer`, or with one that needs this field, be judged."""
    known_failure(
        transfer,
        "noise of a turn",
        when=lambda transfer, scene: _loud(_turn(transfer, scene)),
        reason=f"a body {TURNS} through about {{cells:.0f}} cells, and {WITH} it {{ends}} on the "
        "way",
        cure="{cure}",
    )
    gain(transfer, when=_turn, cause=f"a turn: a body {TURNS}, {WITH}", cure="{cure}")
