"""Suggestions of `check`: needless costs, and what to write instead."""

from collections.abc import Iterator
from math import inf
from typing import Any

import numpy as np

from karamelo_py.advice.facts import SceneFacts
from karamelo_py.advice.lesser import lesser_models
from karamelo_py.language.rules import Advice
from karamelo_py.output.rhythm import ByTime
from karamelo_py.run.simulation import Simulation
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import plural

Words = Iterator[tuple[str, str]]

# Seconds on one core (Intel Xeon) per: point and step (linear), line of the log, picture, first
# picture, file of points, number in such a file.
POINT, LINE, PICTURE, DRAWING, FILE, NUMBER = 1e-7, 5e-4, 0.02, 0.5, 3e-4, 3e-7
WORTHWHILE = 10.0  # seconds of output above which there is a suggestion


def seconds_of_step(hub: Hub, count: int) -> float:
    return POINT * count + sum(fix.seconds() for fix in hub.fixes.values())


def suggestions(hub: Hub, simulation: Simulation) -> list[Advice]:
    rules = _unread, _unused, _of_parts, lesser_models, _output
    return [Advice("", *words) for rule in rules for words in rule(hub, simulation)]


def _of_parts(hub: Hub, simulation: Simulation) -> Words:
    advice = SceneFacts(hub, simulation, inf).advice("suggestion")
    return ((each.reason, each.cure) for each in advice)


def _unread(hub: Hub, simulation: Simulation) -> Words:
    for catalogue in (hub.computes, hub.fixes):
        for ID, item in catalogue.items():
            measures = catalogue is hub.computes or not (item.hooks() or item.for_method)
            names = [f"{ID}_{suffix}" if suffix else ID for suffix in item.published]
            if measures and "(" not in ID and names and hub.asked.isdisjoint(names):
                yield (
                    f"{catalogue.kind} {ID} ({item.style}) is measured at each output but never "
                    "shown",
                    f"leave it out, or name {names[0]} in log_modify",
                )


def _unused(hub: Hub, simulation: Simulation) -> Words:
    used = set()
    for scene in (hub, hub.at_end or hub):
        if any(name.endswith("_exx") for name in scene.values.names()):
            return  # only tests of elements may use the material
        materials = [*scene.materials.values()]
        # Compare by identity: fixes have arrays, which cannot be compared with a material.
        of_fixes = {id(value) for fix in scene.fixes.values() for value in vars(fix).values()}
        used |= {(part.kind, part.id) for m in materials for part in m.parts() if part is not m}
        used |= {("material", m.id) for m in materials if id(m) in of_fixes}
        used |= {("material", solid.material.id) for solid in scene.solids.values()}
    for kind, catalogue in {"material": hub.materials, **hub.parts}.items():
        owner = "solid" if kind == "material" else "material"
        for ID in (ID for ID in catalogue if (kind, ID) not in used):
            yield f"no {owner} uses the {kind} {ID}", f"leave it out, or name it in a {owner}"


def _output(hub: Hub, simulation: Simulation) -> Words:
    span = simulation.control.step[0].end_time - hub.update.time
    steps = span / simulation.steps.later_dt
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
    if output > max(WORTHWHILE, stepping):
        lines, tables = round(times(hub.output.log)), round(sum(map(times, files)))
        yield (
            f"output takes about {output:.1g} s on one core, and the steps {stepping:.1g} s: "
            f"{plural(lines, 'line')} of the log, {plural(tables, 'table')} of points, "
            f"{plural(round(pictures), 'picture')}",
            "less often, or none if a study runs the scene many times (errors over the history "
            "are sampled at outputs)",
        )
