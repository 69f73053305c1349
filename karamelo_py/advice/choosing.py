"""``method(auto)``: choose a method by facts from a rehearsal of the script.

The first supported row of :data:`karamelo_py.advice.choices.CHOICES` is chosen.
"""

import copy
from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from itertools import chain
from math import inf, pi
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.advice.basics import is_zero
from karamelo_py.advice.bodies import fixes_at, is_free, yields
from karamelo_py.advice.choices import (
    ALTERNATIVES,
    BY_RULES,
    CHOICES,
    PLAIN,
    RESUMED,
    Choice,
)
from karamelo_py.advice.crossing import boxes_of, meetings
from karamelo_py.advice.facts import SceneFacts
from karamelo_py.points.laws import LawTraits, can, conductivity, law_kind, law_traits, parameter
from karamelo_py.points.laws.eos import taken_heat
from karamelo_py.points.laws.eos.fluid import STEP
from karamelo_py.points.laws.strengths import shear_modulus
from karamelo_py.points.laws.strengths.mu_i import MuI
from karamelo_py.points.laws.viscosity import diffuses_energy
from karamelo_py.run.loop import RunLoop
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid
from karamelo_py.script.errors import ScriptError

# Methods with which to rehearse a scene: the first supported one is used.
NEUTRAL = (
    "method(ulmpm, FLIP, linear, 1)",
    "method(ulmpm/contacts, FLIP, linear, 1)",
    "method(tlmpm, FLIP, linear, 1)",
    "method(ulmpm, FLIP, linear, 1, thermo-mechanical)",
    "method(ulmpm/contacts, FLIP, linear, 1, thermo-mechanical)",
)

CROSSED = 0.1  # number of cells through which stressed material may move
TRANSITS = 10  # transits of a wave through a body in a run below which no load is slow
SLOWLY = 0.4  # change of a slow load in a transit / range of the load
FILLED = 0.85  # area of a block / area of its box, which three Gauss points per cell exceed
FAST = 0.005  # fraction of the wave speed above which impacts cause shocks


class AtFirstRun(Exception):
    def __init__(self, run: RunLoop):
        self.run = run


class Chosen(NamedTuple):
    choice: Choice
    lines: Sequence[str]
    accuracy: float | None = None
    alternatives: tuple[str, ...] = ()  # names of supported set-ups

    @property
    def words(self) -> dict[str, str]:
        reason = ": ".join(filter(None, (self.choice.scene, self.choice.reason(self.lines))))
        words = {"chosen for": reason, "which writes": "; ".join(self.lines)}
        if self.accuracy is not None:
            words["accuracy"] = f"{self.accuracy:g} is the target; not checked (karamelo-py advise)"
        if self.alternatives:
            words["advise tries"] = ", ".join(self.alternatives)
        return words

    @property
    def facts(self) -> dict[str, Any]:
        of = {"lines": list(self.lines), "accuracy": self.accuracy}
        return of | ({"alternatives": list(self.alternatives)} if self.alternatives else {})


class Scouted(SceneFacts):
    """Facts of the scene that decide its method."""

    @cached_property
    def soft(self) -> list:
        return [solid for solid in self.hub.solids.values() if not solid.rigid]

    @cached_property
    def laws(self) -> list:
        return [solid.material.whole for solid in self.soft]

    @cached_property
    def strengths(self) -> list:
        return [part for law in self.laws if (part := parameter(law, "strength", None))]

    implicit = property(lambda s: s.scheme.traits.implicit)
    diffuses = property(lambda s: any(map(diffuses_energy, s.laws)))
    hot = property(
        lambda s: (
            s.diffuses
            or any(can(law, conductivity) and conductivity(law, 1.0) > 0 for law in s.laws)
        )
    )
    elastic_only = property(lambda s: not any(map(yields, s.laws)))
    wet = property(lambda s: any(solid.material.fluid for solid in s.soft))
    gas = property(lambda s: any(can(law, taken_heat) for law in s.laws))
    grains = property(lambda s: any(MuI in law_kind(law) for law in s.laws))

    @property
    def calm(self) -> bool:
        """Return True if one body starts slowly, nothing loads it, and neighbours remain.

        A body that drifts meets a wall, and only artificial viscosity damps the front that follows.
        In 2D and 3D, long paths may belong to vortices.
        """
        held = not (self.burns or self.weighed or self.pressed)
        drifts = any(np.linalg.norm(m.velocity) > 0.1 * self.fastest for m in self.motions)
        damped = all(parameter(law, "viscosity", None) for law in self.laws)
        slow = self.speed < (0.7 if damped else 0.1) and (damped or not drifts)
        path = self.fastest * self.duration
        near = self.d == 1 or all(path < 0.2 * motion.size for motion in self.motions)
        uniform = len(self.soft) == 1 and self.pressure_ratio < STEP
        return self.alone and held and uniform and slow and near

    @property
    def liquid(self) -> bool:
        return any(not (holds_shape(law) or eos_traits(law).of_solids) for law in self.laws)

    @property
    def soil(self) -> bool:
        kinds = [law_kind(law) for law in self.laws if holds_shape(law)]
        return any(law_traits(kind).flows for kind in chain.from_iterable(kinds))

    @property
    def dilates(self) -> bool:
        """Return True if there is soil without friction, or soil that dilates."""
        return all(
            parameter(part, "dilation", 0.0) > 0 or not parameter(part, "friction", 0.0) > 0
            for part in self.strengths
        )

    @property
    def limit_load(self) -> bool:
        """True in load steps of soil that dilates, or that end at its limit load."""
        slow = self.implicit and not self.scheme.traits.inertia
        one = any(solid.ppc == 1 for solid in self.soft)
        return slow and self.soil and not one and (self.dilates or self.scheme.limit == "stop")

    @property
    def pressed(self) -> bool:
        return any(
            len(x) and not all(map(is_zero, fix.formulas))
            for body in self.bodies
            for fix, x in fixes_at(self, body)
        )

    @property
    def shocked(self) -> bool:
        return self.crossing.cells > CROSSED and self.impact > FAST

    @property
    def wall_ahead(self) -> bool:
        """Return True if fixes hold nodes that no body touches yet."""
        near = {fix for body in self.bodies for fix, x in fixes_at(self, body) if len(x)}
        fixes = self.hub.fixes.values()
        return any(f.prescribes_velocity and len(f.nodes) and f not in near for f in fixes)

    @cached_property
    def apart(self) -> bool:
        """Return True if a body starts at a distance from a body that it will meet."""
        boxes = boxes_of([body.motion for body in self.bodies])
        soft = [body for body in self.bodies if not body.solid.rigid]
        times = (meetings(body.motion, boxes, body.solid.h) for body in soft)
        return any((time < self.duration).any() for time in times)

    @property
    def weighed(self) -> bool:
        fixes = self.hub.fixes.values()
        return any(fix.accelerates and not all(map(is_zero, fix.formulas)) for fix in fixes)

    @property
    def led(self) -> bool:
        """Return True if a rigid solid moves as a fix prescribes."""
        fixes = self.hub.fixes.values()
        led = any(fix.leads_points and not all(map(is_zero, fix.formulas)) for fix in fixes)
        return led and len(self.soft) < len(self.hub.solids)

    @property
    def blocks(self) -> bool:
        """Return True if points fill the bounding boxes of all bodies.

        At curved or inclined faces, held nodes act up to a cell inside, with splines further.
        """
        pairs = ((solid.x0, 2 * solid.half_size) for solid in self.soft)
        boxes = ((size, np.ptp(x, axis=0) + size.max(axis=0)) for x, size in pairs)
        return all(np.prod(size, axis=1).sum() > FILLED * np.prod(box) for size, box in boxes)

    @property
    def loaded_slowly(self) -> bool:
        """Return True if bodies start at rest and are held, and loads change little in a transit.

        A transit is the time that waves take along the longest side.
        """
        fixes = self.hub.fixes.values()
        free = any(is_free(self, body) for body in self.bodies)
        if free or self.fastest > 0 or any(f.presses or f.first_step_only for f in fixes):
            return False
        transit = max(motion.size for motion in self.motions) / self.waves
        steps = self.duration / transit
        if steps < TRANSITS:
            return False
        formulas = [f for fix in fixes for f in (*fix.formulas, *fix.components) if not is_zero(f)]
        formulas = [f for f in formulas if "time" in f.names]
        values, now = self.hub.values, self.hub.update.time
        x = np.array([motion.centre for motion in self.motions])
        loads = np.empty((min(int(steps), 100), len(formulas), len(x)))
        for n, load in enumerate(loads):
            values.set("time", now + n * transit)
            for formula, of in zip(formulas, load, strict=True):
                of[:] = formula.evaluate_points(values, x, x)
        values.set("time", now)
        return bool((abs(np.diff(loads, axis=0)).max(0) <= SLOWLY * np.ptp(loads, axis=0)).all())

    rubs = property(lambda s: any(fix.friction is not None for fix in s.hub.fixes.values()))
    # In plane stress and 1D, plastic flow does not constrain the volume of cells.
    narrow = property(lambda s: s.hub.domain.thin or (s.d == 1 and not s.hub.domain.kin.hoops))
    burns = property(lambda s: any(eos_traits(law).burns for law in s.laws))

    @property
    def rolls(self) -> bool:
        return self.rubs and self.d > 1 and any(map(is_round, self.soft))

    @property
    def grid(self) -> str:
        contacts = self.method.fields_per_solid or self.apart or self.rubs
        return "ulmpm/contacts" if contacts else "ulmpm"

    @cached_property
    def alone(self) -> bool:
        touching = {solid.id for fix in self.hub.fixes.values() for solid in fix.solids}
        touching |= {
            solid.id
            for fix in self.hub.fixes.values()
            for solid in self.hub.solids.values()
            if fix.presses or (fix.touches and (fix.touches is solid or fix.group.touches(solid)))
        }
        several = len(self.hub.solids) > 1 and any(ID not in touching for ID in self.hub.solids)
        return not (several or self.wall_ahead or self.hub.domain.periodic)


def is_round(solid: Solid) -> bool:
    """Return True if all points are within 1.1 radii of a ball of the solid's volume."""
    d, unit = solid.x0.shape[1], pi if solid.x0.shape[1] == 2 else 4 / 3 * pi
    radius = (solid.volume0.sum() / unit) ** (1 / d)
    away = np.linalg.norm(solid.x0 - solid.x0.mean(axis=0), axis=1)
    return bool(away.max() < 1.05 * radius)


def holds_shape(law: tuple) -> bool:
    strength = parameter(law, "strength", None)
    return strength is None or shear_modulus(strength) > 0


def eos_traits(law: tuple) -> LawTraits:
    return law_traits(parameter(law, "eos", None))


def scouted(hub: Hub, lines: Sequence[str]) -> Scouted | None:
    """Execute the rest of the script on a copy of the scene; return None if it has no run."""
    other, settings = hub.rehearsal(), copy.copy(hub.settings)
    other.scouting, other.settings = True, settings
    settings.comm, settings.ranks = SerialComm(), 1
    settings.engine, settings.card = "processor", None
    try:
        hub.interpreter.rehearse(other, lines)
    except AtFirstRun as reached:
        run, simulation = reached.run, other.simulation
        simulation.begin(run.end_time)
        steps = inf if run.steps is None else run.steps
        duration = min(run.end_time - simulation.time, steps * simulation.steps.later_dt)
        return Scouted(other, simulation, duration)
    return None


def choose(hub: Hub, name: str, accuracy: float | None) -> Chosen:
    """Choose a row for this scene; mistakes in later lines of the script raise ScriptError.

    `name` is `BY_RULES` or one of `ALTERNATIVES`. With a target `accuracy`, ``check`` also finds
    the alternatives that the scene supports.
    """
    if hub.restart is not None and (lines := hub.restart.content["chosen"]):
        return Chosen(RESUMED, lines, accuracy)  # a longer run could choose another row
    if hub.rehearsing:
        return Chosen(PLAIN, PLAIN.lines)
    facts = _facts(hub)
    if facts is None:
        return Chosen(PLAIN, PLAIN.lines, accuracy)
    if name != BY_RULES:
        lines = _written(ALTERNATIVES[name], facts)
        return Chosen(PLAIN._replace(scene=f"-var auto {name}"), lines, accuracy)
    rows = ((choice, _written(choice.lines, facts)) for choice in CHOICES if choice.when(facts))
    fit = (Chosen(choice, lines, accuracy) for choice, lines in rows if _runs(hub, lines))
    plain = (lines for lines in (PLAIN.lines, *zip(NEUTRAL)) if _runs(hub, lines))
    chosen = next(fit, None) or Chosen(PLAIN, next(plain, PLAIN.lines), accuracy)
    if accuracy is None or not hub.checking:
        return chosen
    named = {other: _written(lines, facts) for other, lines in ALTERNATIVES.items()}
    others = {other: lines for other, lines in named.items() if lines != tuple(chosen.lines)}
    supported = (other for other, lines in others.items() if _runs(hub, lines))
    return chosen._replace(alternatives=(BY_RULES, *supported))


def _runs(hub: Hub, lines: Sequence[str]) -> bool:
    with suppress(ScriptError):
        scouted(hub, lines)
        return True
    return False


def _written(lines: Sequence[str], facts: Scouted) -> tuple[str, ...]:
    first, *others = (line.format(grid=facts.grid) for line in lines)
    heat = ", thermo-mechanical" * facts.hot
    if facts.hub.update.scheme_mark is not None:  # the script sets a scheme
        others = [line for line in others if not line.startswith("scheme(")]
    if facts.hub.update.fixed_dt is not None or facts.hub.update.dt_factor is not None:
        others = [line for line in others if not line.startswith("dt_factor(")]
    return f"{first[:-1]}{heat})", *others


def _facts(hub: Hub) -> Scouted | None:
    errors = []
    for line in NEUTRAL:
        try:
            return scouted(hub, (line,))
        except ScriptError as error:
            errors.append(error)
    # Others may be about the method of the rehearsal, not about the script.
    raise min(errors, key=lambda error: len(error.others))
