"""Suggestions: what a scene pays for and could leave out, with the words to write instead."""

import re
from collections.abc import Iterator
from math import inf
from typing import Any

import numpy as np

from karamelo_py.advice.facts import SceneFacts, script_text
from karamelo_py.language.rules import Advice
from karamelo_py.output.rhythm import ByTime
from karamelo_py.points.laws import parameter
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import plural

Words = Iterator[tuple[str, str]]  # the cost, and what to write instead

NEARLY_INCOMPRESSIBLE = 0.4  # Poisson's ratio from which a linear basis locks
LARGE = 100_000  # points from where on their numbers are read from memory
RESOLVED = 1000  # times the distance of neighbouring singles: what a step moves points by, at least
# Seconds of a core (Intel Xeon): a point in a step with a linear basis, a line of the log, a
# picture and the first one, a file of points and a number in it.
POINT, LINE, PICTURE, DRAWING, FILE, NUMBER = 1e-7, 5e-4, 0.02, 0.5, 3e-4, 3e-7
LONG = 0.5  # seconds of output that count


def seconds_of_step(hub: Hub, count: int) -> float:
    """Estimate the seconds of a core that a step takes at least."""
    return POINT * count + sum(fix.seconds() for fix in hub.fixes.values())


def suggestions(hub: Hub, simulation: Any) -> list[Advice]:
    """Find all that is known to be paid for without need, before anything has run."""
    rules = _unread, _of_parts, _averaging, _precision, _output
    return [Advice("", *words) for rule in rules for words in rule(hub, simulation)]


def _of_parts(hub: Hub, simulation: Any) -> Words:
    return ((one.reason, one.cure) for one in SceneFacts(hub, simulation, inf).advice("suggestion"))


def _unread(hub: Hub, simulation: Any) -> Words:
    text = script_text(hub)
    for kind, catalogue in (("compute", hub.computes), ("fix", hub.fixes)):
        for ID, item in catalogue.items():
            measures = kind == "compute" or not (item.hooks() or item.for_method)
            if not measures or "(" in ID or not item.published:
                continue
            defined = rf"\b{kind}\s*\(\s*{re.escape(ID)}\s*,"
            uses = len(re.findall(rf"\b{re.escape(ID)}(?:_\w+)?\b", text))
            if 0 < uses <= len(re.findall(defined, text)):
                suffix = item.published[0]
                name = f"{ID}_{suffix}" if suffix else ID
                yield (
                    f"{kind} {ID} ({item.style}) is measured at each output and shown nowhere",
                    f"leave it out, or name {name} in log_modify",
                )


def _averaging(hub: Hub, simulation: Any) -> Words:
    if not hub.update.anti_locking:
        return
    for solid in hub.solids.values():
        law = solid.material.whole
        moduli = (parameter(law, "lam", None), parameter(law, "G", None))
        if None in moduli or moduli[0] / (2 * sum(moduli)) >= NEARLY_INCOMPRESSIBLE:
            return
    yield (
        "anti_volumetric_locking(true): a visit of the points more, and nothing is nearly "
        "incompressible or flows",
        "leave it out",
    )


def _precision(hub: Hub, simulation: Any) -> Words:
    """Find large scenes whose steps are long enough for single precision."""
    if (
        sum(solid.count for solid in hub.solids.values()) < LARGE
        or hub.settings.precision != "double"
        or simulation.implicit
    ):
        return
    x = max(float(np.abs(solid.x0).max()) for solid in hub.solids.values() if solid.count)
    if simulation.fastest() * simulation.dt > RESOLVED * np.spacing(np.float32(x)):
        yield (
            "double precision: points in single precision take 0.6 of the memory; errors of scenes "
            "with an exact solution change by less than a twentieth or 2e-4",
            "precision(single)",
        )


def _output(hub: Hub, simulation: Any) -> Words:
    """Find output that takes longer than the steps, by rough times of one core."""
    span = simulation.control.clock[0].end_time - hub.update.time
    steps = span / simulation.dt
    if not np.isfinite(steps):
        return
    count = sum(solid.count for solid in hub.solids.values())

    def times(item: Any) -> float:
        every = item.every
        return span / every.span if isinstance(every, ByTime) else steps / every

    drawn = [dump for dump in hub.dumps.values() if dump.style == "pyplot"]
    files = [dump for dump in hub.dumps.values() if dump not in drawn]
    pictures = sum(map(times, drawn)) + (hub.output.plots.file is not None)
    output = LINE * times(hub.output.log) + PICTURE * pictures + DRAWING * (pictures > 0)
    output += sum(times(dump) * (FILE + NUMBER * count * len(dump.columns)) for dump in files)
    stepping = steps * seconds_of_step(hub, count)
    if output > max(LONG, stepping):
        lines, tables = round(times(hub.output.log)), round(sum(map(times, files)))
        yield (
            f"output takes some {output:.1g} s of a core, and the steps {stepping:.1g} s: "
            f"{plural(lines, 'line')} of the log, {plural(tables, 'table')} of points, "
            f"{plural(round(pictures), 'picture')}",
            "less often, or none of it where a study runs the scene many times (errors over the "
            "history are those at outputs)",
        )
