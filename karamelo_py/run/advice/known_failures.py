"""What is known to fail before it runs: combinations, with the reason and the cure.

A rule looks at a scene that is about to run and says what will go wrong, by the name that the
documentation has for the failure. `karamelo-py check` tells it, and a run before its first step,
once.
"""

from collections.abc import Callable, Iterator
from math import isfinite
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.output.units import DENSITY, STRESS, VELOCITY
from karamelo_py.points.basis.bernstein_quadratic import BernsteinQuadratic
from karamelo_py.points.basis.cpgimp import CPGIMPDiagonal
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.laws import law_kind, specific_volume
from karamelo_py.points.laws.eos.fluid import Tait
from karamelo_py.points.laws.eos.ideal_gas import IdealGas
from karamelo_py.points.laws.eos.shock import Shock
from karamelo_py.points.transfers.asflip import ASFLIP
from karamelo_py.points.transfers.flip import FLIP
from karamelo_py.points.transfers.mls import MLS
from karamelo_py.points.transfers.pic import PIC
from karamelo_py.run.advice.conflicts import warn_about_velocities
from karamelo_py.run.advice.facts import Foreseen
from karamelo_py.run.advice.large_steps import duration_of_later, warn_about_steps
from karamelo_py.run.advice.noise import ELASTIC, noises
from karamelo_py.run.advice.resting import UNITS, warn_about_rest
from karamelo_py.run.diagnosis.explain import no_number
from karamelo_py.run.simulation import Simulation
from karamelo_py.run.timestep import blows_up, elastic_speed, one_a_cell, sparse
from karamelo_py.scene.group import NOTHING_THERE, NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.schemes.usl import USL
from karamelo_py.script.errors import ScriptError

TURN = 0.3  # angle, in radian, beyond which a scene is said to turn
STRETCH = 0.3  # strain beyond which one is said to stretch
SWING = 0.05  # strain of vibrations that bodies do not bear for long
SEPARATE = 0.1  # of ASFLIP's strength of separation, which elastic bodies bear
SMALL_SHARE = 0.3  # of the stable step, with which impacts keep the energy
DENSITIES = 10.0, 1e5  # kg/m^3, of all but gases: foams to beyond osmium
GAS = 1e-3  # kg/m^3, from where on
IMPOSSIBLE = 30.0  # times the speed of waves: mm/s in the place of m/s make 1000 of 1
SPEEDS = 1.0, 5e4  # m/s, of waves: jelly to beyond diamond


class Failure(NamedTuple):
    """What will go wrong, why, and what to write instead."""

    name: str
    reason: str
    cure: str
    place: Any = None


def _affine_noise(s: Foreseen) -> Iterator[Failure]:
    if not s.moments:
        return
    boxes = s.basis.steep_edge and s.basis.cells > 1  # ugimp, cpgimp
    if boxes and isinstance(s.scheme, USL) and not isinstance(s.transfer, MLS):
        yield Failure(
            "affine noise",
            f"{s.words} with {s.method.basis_name} functions and usl: in some places of the grid "
            "the moments of points at an edge push nodes with next to no mass, and a body breaks "
            "within two periods",
            "scheme(musl), or a spline in the place of the basis",
        )
    if not s.vanishing:
        return
    cure = "quadratic-spline in the place of the basis, or method tlmpm"
    if not s.transfer.inverts_spread or isinstance(s.transfer, MLS):
        yield Failure(
            "affine noise",
            f"{s.words} with {s.method.basis_name} functions grows in a body that drifts, at any "
            "step and with every scheme: turned inside out after a few dozen steps",
            cure,
        )
    elif s.d == 3 or hasattr(s.transfer, "alpha"):
        yield Failure(
            "affine noise",
            f"{s.words} with {s.method.basis_name} functions gains energy, since the velocity that "
            "deforms the points leaves their moments out (a disk in space by a sixth in a turn)",
            cure,
        )


def _noise(s: Foreseen) -> Iterator[Failure]:
    for noise in noises(s):
        if noise.share > 1:
            yield Failure(*noise.words)


def _large_vibration(s: Foreseen) -> Iterator[Failure]:
    """Told by docs/energy.md: nothing of FLIP and its kin lasts there but usl, which damps."""
    kept = isinstance(s.transfer, (FLIP, ASFLIP)) and s.transfer.alpha > 0.9
    damps = isinstance(s.scheme, USL) and not sparse(s.hub)
    if not (s.moves and kept and s.solids(*ELASTIC)) or damps:
        return
    strain, periods = s.vibration
    if strain > SWING and periods > 2:
        yield Failure(
            "large vibrations",
            f"a body will vibrate by about {strain:.1g} of strain for about {periods:.0f} periods, "
            f"and with {s.words} elastic bodies that do so while they move through the grid break "
            "after 2 to 50 periods (by 0.14, drifting)",
            "method tlmpm, or scheme(usl) with two points a cell and direction, which damps",
        )


def _cell_crossing(s: Foreseen) -> Iterator[Failure]:
    if s.moves and isinstance(s.basis, BernsteinQuadratic):
        yield Failure(
            "points that cross cells",
            "the gradients of Bernstein-quadratic functions jump at cell faces, and points that "
            "cross one feel false forces as large as their stress",
            "method tlmpm, or quadratic-spline in the place of the basis",
        )


def _numerical_fracture(s: Foreseen) -> Iterator[Failure]:
    strain = max(s.impact if len(s.hub.solids) > 1 else 0.0, s.sag)
    if s.moves and isinstance(s.basis, Linear) and s.solids(*ELASTIC) and strain > STRETCH:
        yield Failure(
            "bodies that break without reason",
            f"bodies will strain by about {strain:.1g} (from their speed and weight), and with "
            "linear functions points that lie a cell apart no longer hold together",
            "method tlmpm or ulcpdi, or a spline in the place of the basis",
        )


def _repeated_contact(s: Foreseen) -> Iterator[Failure]:
    """Bodies that have the time to fly through the domain meet each other or its walls again."""
    domain = s.hub.domain
    far = max(domain.hi[: s.d] - domain.lo[: s.d])
    elastic = s.solids(*ELASTIC)
    if not (s.moves and isinstance(s.basis, Linear) and len(elastic) > 1):
        return
    share = s.hub.update.dt_factor
    small = share is not None and share <= SMALL_SHARE
    kept = getattr(s.transfer, "alpha", 0.0)
    way = s.simulation.fastest() * s.duration
    if kept > 0.9 and way > far and not small:
        yield Failure(
            "repeated contact",
            f"{s.words} with linear functions gains energy at each impact of elastic bodies, and "
            "these have the time to meet again and again (two disks in a box for 50 impacts: up to "
            "1.1 times the energy, with a share of 0.99 two to four times)",
            f"quadratic-spline in the place of the basis, or dt_factor({SMALL_SHARE:g})",
        )


def _vanishing_domains(s: Foreseen) -> Iterator[Failure]:
    if isinstance(s.basis, CPGIMPDiagonal) and s.turn > TURN:
        yield Failure(
            "boxes in a turn",
            f"bodies will turn by about {s.turn:.2g} rad, and boxes of the size |F_ii| shrink with "
            "the cosine of that",
            "the variant stretch in the place of diagonal",
        )


def _hourglass(s: Foreseen) -> Iterator[Failure]:
    single = [solid.id for solid in s.hub.solids.values() if one_a_cell(solid)]
    if not s.moves and isinstance(s.basis, Linear) and s.d > 1 and single:
        yield Failure(
            "hourglasses",
            f"one point a cell (solid '{single[0]}') with linear functions that never move feels "
            "no hourglass: its nodes may go to and fro without any force",
            f"{2**s.d} points a cell, or Bernstein-quadratic in the place of the basis",
        )


def _lost_spin(s: Foreseen) -> Iterator[Failure]:
    if isinstance(s.transfer, PIC) and s.turn > TURN:
        yield Failure(
            "angular momentum",
            "PIC takes a per cent or more of the angular momentum of a turning body in every step",
            "APIC, or FLIP, in the place of PIC",
        )


def _loose_points(s: Foreseen) -> Iterator[Failure]:
    solids = s.solids(*ELASTIC)
    if isinstance(s.transfer, ASFLIP) and s.transfer.beta > SEPARATE and s.moves and solids:
        yield Failure(
            "loose points",
            f"ASFLIP moves points apart where they are not pressed together, and solid "
            f"'{solids[0].id}' bears tension: its points lose their places (two rings that bounce "
            "keep a tenth of their speed, with beta = 0.1 as much as with AFLIP)",
            f"AFLIP in the place of ASFLIP, or beta = {SEPARATE:g} behind its share",
        )


def _fast_shocks(s: Foreseen) -> Iterator[Failure]:
    flip = isinstance(s.transfer, FLIP) and s.transfer.alpha > 0.99
    spline = not isinstance(s.basis, Linear)
    if s.moves and not (spline and not flip) and s.solids(Shock) and s.speed > 0.6:
        yield Failure(
            "fast shocks",
            f"points move at {s.speed:.2g} times the speed of waves, and {s.words} with "
            f"{s.method.basis_name} functions carries such a shock 1 to 3 % too fast",
            "method(ulmpm, TPIC, quadratic-spline)",
        )


def _impossible_speeds(s: Foreseen) -> Iterator[Failure]:
    flowing = {IdealGas, Tait}
    solid = any(not flowing & set(law_kind(one.material.law)) for one in s.hub.solids.values())
    if solid and s.speed > IMPOSSIBLE:
        yield Failure(
            "units of velocities",
            f"points move at {s.simulation.fastest():.3g}, {s.speed:.3g} times the speed of waves "
            f"({s.waves:.3g}), which no solid bears when it meets another or a wall. The units of "
            "velocities, densities and moduli may be mixed",
            UNITS,
        )


def _other_units(s: Foreseen) -> Iterator[Failure]:
    """Of materials whose numbers are in others than those that `units` names."""
    units = s.hub.output.units
    for solid in s.hub.solids.values() if units else ():
        law = solid.material.law
        density = units.si(DENSITY) / float(specific_volume(law))
        speed = units.si(VELOCITY) * elastic_speed(s.simulation, solid)[0]
        least = GAS if IdealGas in law_kind(law) else DENSITIES[0]
        odd = []
        if not least <= density <= DENSITIES[1]:
            odd.append(f"density is {density:.3g} kg/m^3")
        if speed != 0 and not SPEEDS[0] <= speed <= SPEEDS[1]:  # 0 is rigid
            odd.append(f"speed of waves is {speed:.3g} m/s")
        if odd:
            yield Failure(
                f"units of material '{solid.material.id}'",
                f"with units({', '.join(units[:3])}) its {' and its '.join(odd)}, such as no real "
                "material has",
                f"in {units.name(DENSITY)} water has the density {1e3 / units.si(DENSITY):.3g}; "
                f"1 GPa is {1e9 / units.si(STRESS):.3g} {units.name(STRESS)}",
                solid.material.place,
            )


RULES: tuple[Callable[[Foreseen], Iterator[Failure]], ...] = (
    _affine_noise,
    _cell_crossing,
    _numerical_fracture,
    _repeated_contact,
    _noise,
    _large_vibration,
    _vanishing_domains,
    _hourglass,
    _lost_spin,
    _loose_points,
    _fast_shocks,
    _impossible_speeds,
    _other_units,
)


def warn(hub: Hub, simulation: Simulation, duration: float, halves: bool) -> None:
    """Tell what will go wrong in a run of `duration`, and the next; each failure once in a script.

    Raises
    ------
    ScriptError
        If temperatures would swing, in a run that does not halve its step then, or if points have
        velocities that are no numbers.
    """
    _warn_about_groups(hub)
    refuse_endless_speeds(hub, simulation)
    scene = Foreseen(hub, simulation, duration)
    scene.duration += _gone(hub, simulation) + duration_of_later(hub, simulation)
    if scene.waves > 0 and blows_up(hub, simulation):
        scene.duration = 0.0  # it never comes so far
    warn_about_steps(hub, simulation, halves)
    _warn_about_precision(scene)
    warn_about_velocities(hub, simulation)
    warn_about_rest(hub, simulation, duration)
    for rule in RULES:
        for failure in rule(scene):
            if failure.name not in hub.update.foreseen:
                hub.update.foreseen.append(failure.name)
                hub.warn(
                    f"{failure.name}: {failure.reason}",
                    place=failure.place or hub.update.method.place,
                    hint=failure.cure,
                )


def refuse_endless_speeds(hub: Hub, simulation: Simulation) -> None:
    """Refuse velocities of points that are no numbers, with the formula that they come from.

    Raises
    ------
    ScriptError
        If there are some.
    """
    if not isfinite(simulation.fastest()):
        found = no_number(
            hub,
            simulation,
            f"points have a velocity that is not a number at time {simulation.time:.6g}",
            "look for a formula that gives NaN or infinity, such as a division by zero",
        )
        raise ScriptError(found.message, place=found.place, hint=found.hint)


def _gone(hub: Hub, simulation: Simulation) -> float:
    """How long the solids have moved: since the last fix has come."""
    fixes, update = list(hub.fixes.values()), hub.update
    known, since = update.moving
    if any(all(fix is not other for other in known) for fix in fixes):
        since = simulation.time
    update.moving = fixes, since
    return simulation.time - since


def _warn_about_precision(s: Foreseen) -> None:
    """Say so when single precision cannot hold what a step adds to a position."""
    if s.hub.settings.precision != "single":
        return
    x = max((max(-one.low.min(), one.high.max()) for one in s.motions), default=0.0)
    step, spacing = s.simulation.fastest() * s.simulation.dt, float(np.spacing(np.float32(x)))
    if 0 < step < 16 * spacing:
        s.hub.warn(
            f"a step moves points by {step:.2g} at most, and in single precision positions have "
            f"a spacing of {spacing:.2g}: motion will be lost to rounding",
            hint="precision(double), or a domain around the origin",
        )


def _warn_about_groups(hub: Hub) -> None:
    """Say so, once, where the solids have brought no nodes to a group that waited for them."""
    for group in hub.groups.values():
        if isinstance(group, NodeGroup) and group.awaits_solids and not len(group):
            group.awaits_solids = False
            hub.warn(f"group '{group.id}' holds no nodes; {NOTHING_THERE}", place=group.place)
