"""PIC and FLIP: the point takes the nodal velocity, or its change."""

from math import exp, pi
from types import MappingProxyType
from typing import Annotated, NamedTuple

from karamelo_py.compiler import real
from karamelo_py.language.kinds import Constraint
from karamelo_py.language.rules import gain, known_failure
from karamelo_py.points import noise
from karamelo_py.points.transfers import TransferTraits, in_step, lost_fractions, updated_velocity

Share = Constraint("from 0 (PIC) to 1 (pure FLIP)", lambda value: 0 <= value <= 1)
SWING = 0.05  # strain of vibrations that eventually break bodies
LAG = 0.03  # lost fraction of a free body's angular velocity, for a warning
BRAKED = 0.05  # lost fraction of rotational energy, for a warning
BARELY = 0.01  # revolutions below which rotational energy is not relevant
TURNS = 1.5  # revolutions of a free body above which the loss with FLIP is relevant


class PIC(NamedTuple):
    """PIC: v_p = v_pic, the updated nodal velocity at the point.

    PIC is very stable and dissipative: each step smooths the velocity over a cell and loses angular
    momentum (Harlow 1964).

    Example
    -------
    method(ulmpm, PIC, linear)
    """

    traits = TransferTraits()
    in_lanes = True


class FLIP(NamedTuple):
    """FLIP: v_p = (1 - alpha) v_pic + alpha (v_p + dv); alpha = 0 is PIC.

    FLIP conserves energy well, but retains noise in the null space of the grid, which a little PIC
    (alpha = 0.99) damps (Brackbill & Ruppel 1986).

    Parameters
    ----------
    alpha
        FLIP coefficient.
    variant
        Also map the velocity gradient from points to nodes: TFLIP.

    Example
    -------
    method(ulmpm, FLIP, linear, 0.99)
    """

    alpha: Annotated[float, Share]

    traits = TransferTraits(retains=True)
    in_lanes = True
    variants = MappingProxyType({"gradient-enhanced": "TFLIP"})


class FLIPPerTime(NamedTuple):
    """FLIP with damping per unit time, not per step: alpha applies to a stable step.

    In a shorter step, alpha^(dt / stable dt) is used. With plain FLIP the fraction 1 - alpha is
    removed in each step, so half the step doubles the damping rate.

    Parameters
    ----------
    alpha
        FLIP coefficient for a stable step.

    Example
    -------
    method(ulmpm, FLIP/per-time, linear, 0.99)

    See Also
    --------
    transfer FLIP
    """

    alpha: Annotated[float, Share]

    traits = TransferTraits(retains=True, per_time=True)
    in_lanes = True


@in_step.on(FLIPPerTime)
def _in_step_flip_per_time(transfer, kept):
    return transfer._replace(alpha=real(kept, transfer.alpha))


def take_nodal_velocity(transfer: type) -> None:
    lost_fractions.on(transfer)(_lost_fractions_pic)
    updated_velocity.on(transfer)(_updated_velocity_pic)


def _lost_fractions_pic(transfer, template):
    return 1.0, 1.0


def _updated_velocity_pic(transfer, v, v_pic, dv):
    return v_pic


def blend(transfer: type) -> None:
    updated_velocity.on(transfer)(_updated_velocity_flip)
    lost_fractions.on(transfer)(_lost_fractions_flip)


def _updated_velocity_flip(transfer, v, v_pic, dv):
    alpha = transfer.alpha
    return (1 - alpha) * v_pic + alpha * (v + dv)


def _lost_fractions_flip(transfer, template):
    # With P = S S+ from points to points, v becomes alpha v + (1 - alpha) P v + S dv.
    alpha = transfer.alpha
    return (1 - alpha) * (1 + alpha), (1 - alpha) * (1 - alpha)


def warn_of_vibrations(transfer: type) -> None:
    """Warn of large vibrations, which are damped only by usl."""
    known_failure(
        transfer,
        "large vibrations",
        when=lambda transfer, scene: (
            scene.moves
            and transfer.alpha > 0.9
            and scene.elastic
            and not (scene.scheme.traits.damps and not scene.sparse)
            and scene.vibration.strain > SWING
            and scene.vibration.periods > 2
        ),
        reason="a body will vibrate with a strain of about {scene.vibration.strain:.1g} for about "
        "{scene.vibration.periods:.0f} periods; with {scene.transfer_name}, elastic bodies that "
        "vibrate while they move through the grid break after 2 to 50 periods (at 0.14, drifting)",
        cure="method tlmpm, or scheme(usl), which damps, with two points per direction",
    )


def _turns_away(transfer, scene):
    return scene.moves and transfer.alpha > 0.9 and not scene.moments and scene.free_turns > TURNS


def warn_of_lost_angular_momentum(transfer: type) -> None:
    """Warn of bodies that rotate freely many times.

    Points move with the grid velocity u but store v, so each step changes the angular momentum by
    the sum of m u x v dt. Limits are from 2D disks with 4 and 8 cells in the radius and a Young's
    modulus of 100 times the rotational energy per unit volume (R4, splines, linear basis).
    """
    known_failure(
        transfer,
        "angular momentum",
        when=_turns_away,
        reason="a body rotates freely, {scene.free_turns:.2g} times, and {scene.transfer_name} "
        "loses angular momentum: in the first revolution 10 % with 4 cells across the radius, "
        "2 % with 8, after ten nearly all",
        cure="method tlmpm with APIC, or APIC with quadratic-spline; with ulcpdi and R4, APIC "
        "instead of {scene.transfer_name}",
    )
    gain(
        transfer,
        when=lambda transfer, scene: _turns_away(transfer, scene) and {"share": 0.5},
        cause="a body has rotated freely, {scene.free_turns:.2g} times; {scene.transfer_name} "
        "moves points with a velocity that differs from the stored one",
        cure="APIC instead of {scene.transfer_name}, best with method tlmpm",
    )


def _lags(transfer, scene):
    lag = scene.lag
    return lag.fraction > LAG and 2 * pi * lag.turns > 1


def _brakes(transfer, scene):
    """Return the energy loss of a free rotation, 2 (1 - alpha) times the lag per step."""
    lag, simulation = scene.lag, scene.simulation
    if not lag.turns > BARELY:
        return None
    step = simulation.steps.limit if transfer.traits.per_time else simulation.dt
    gone = 1 - exp(-2 * (1 - transfer.alpha) * lag.fraction * scene.duration / step)
    return {"gone": 100 * gone} if gone > BRAKED else None


def warn_of_slow_rotation(transfer: type) -> None:
    """Warn of free rotations in the total frame.

    As points do not move with the velocity that they store, a square of n cells rotates too slowly
    by the fraction 2.3/n^2 (14.6, 3.9, 1.0 % with 4, 8, 16 cells).
    """
    known_failure(
        transfer,
        "slow rotation",
        when=_lags,
        reason="a body rotates freely, {scene.lag.turns:.2g} times; {scene.transfer_name} moves "
        "its points with the grid velocity, which rotates {scene.lag.percent:.2g} % too slowly",
        cure="APIC instead of {scene.transfer_name} (rotation and energy within 0.1 %)",
    )
    known_failure(
        transfer,
        "braked rotation",
        when=_brakes,
        reason="a body rotates freely, {scene.lag.turns:.2g} times, and FLIP {part.alpha:g} will "
        "remove about {gone:.0f} % of its rotational energy",
        cure="APIC instead of {scene.transfer_name}, or FLIP 1",
    )


known_failure(
    PIC,
    "angular momentum",
    when=lambda pic, scene: scene.turns,
    reason="PIC removes 1 % or more of the angular momentum of a rotating body in every step",
    cure="APIC or FLIP instead of PIC",
)
take_nodal_velocity(PIC)

for _flip in (FLIP, FLIPPerTime):
    blend(_flip)
    warn_of_vibrations(_flip)
    warn_of_lost_angular_momentum(_flip)
    warn_of_slow_rotation(_flip)
    noise.warn_of_drift(_flip)
    noise.warn_of_rotation(_flip)
