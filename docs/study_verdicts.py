"""Hold what karamelo-py advise and stability say against full sweeps, on scenes hard to judge.

``python docs/study_verdicts.py FOLDER [NAME ...]`` runs all variants of each scene, asks advise as
if none had been run, draws the maps, runs all of their cells, and prints the tables of
docs/study-verdicts.md. What was run before in the folder is used.
"""

import contextlib
import io
import os
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.app.cli import main
from karamelo_py.app.studies import records
from karamelo_py.app.studies.advise import Adviser, Candidate, ChoiceRuns, forecast, sureness
from karamelo_py.app.studies.curves import Family, Table, column, errors
from karamelo_py.output.files import read_json

SIZES = "points", "steps"
ROOT = Path(__file__).resolve().parent.parent
COST = "particle_steps"  # which do not depend on what else a machine does


class Scene(NamedTuple):
    """A script, its variables, the error, targets, and what makes it hard."""

    script: str
    words: str
    accuracy: str
    targets: tuple[float, ...]
    hard: str


TWO = "-var basis=linear,quadratic-spline"
KINDS = "-var kind=ulmpm,tlmpm -var basis=linear"
# The rules of advise were made with these in view.
KNOWN = {
    "cantilever": Scene(
        "inputs/in.cantilever", f"-var T=1.3 -var refine=0.5,0.75,1,1.5,2 {KINDS}",
        "off=abs(max:tip_s/3.305 - 1)", (1e-2, 2e-3), "the error changes its sign"),
    "column": Scene(
        "inputs/in.column", f"-var refine=0.25,0.5,1,2 {TWO},cubic-spline", "share", (1e-2, 4e-3),
        "noise of points that cross cells, a floor"),
    "bar": Scene(
        "inputs/in.vibrating_bar", f"-var refine=0.25,0.5,1,2,4 {KINDS}", "err_history",
        (0.02, 4e-3), "errors change sign"),
    "disk": Scene(
        "inputs/in.spinning_disk", "-var refine=0.5,1,2 -var transfer=PIC,APIC -var basis=linear",
        "lost=abs((Ek + Es)/(first:Ek + first:Es) - 1)", (0.1,), "damping by the transfer"),
    "sod": Scene(
        "inputs/in.sod", f"-var refine=0.25,0.5,1,2 {TWO}", "err", (0.02, 0.05),
        "a shock, first order"),
    "slab": Scene(
        "inputs/in.heat_slab", f"-var refine=0.25,0.5,1,2 {TWO}", "off=abs(heat/exact - 1)",
        (1e-3, 1e-4), "heat driven by a boundary"),
    "lame": Scene(
        "inputs/in.lame", f"-var refine=0.25,0.5,1 {TWO}", "off=abs(pressure/exact - 1)",
        (0.01, 2e-3), "a driven pressure that oscillates"),
    "incline": Scene(
        "inputs/in.incline", f"-var angle=45 -var mu=0.1 -var refine=0.25,0.5,1 {TWO}",
        "off=abs(v_x/exact - 1)", (1e-3,), "weight against friction"),
    "shear": Scene(
        "inputs/in.shear_heating", f"-var refine=0.5,1,2 {TWO}",
        "off=abs((T - 298)/(exact - 298) - 1)", (1e-4,), "driven walls, plastic heat"),
    "cylinder": Scene(
        "inputs/in.thick_cylinder", f"-var refine=0.25,0.5,1 {TWO}",
        "off=abs(max:pressure/0.80038 - 1)", (0.01,), "a limit load"),
}  # fmt: skip
# These were written, with their targets, when the rules were there; some rules were mended by them.
FRESH = {
    "oblique": Scene(
        "docs/verdicts/in.oblique", f"-var refine=0.5,1,2,4 {TWO},cubic-spline", "err_history",
        (0.05, 0.02), "edges inclined to the grid"),
    "pulse": Scene(
        "docs/verdicts/in.pulse", f"-var refine=0.5,1,2,4,8 -var kind=ulmpm,tlmpm {TWO}", "err",
        (0.05, 5e-3), "driven by its end"),
    "sphere": Scene(
        "docs/verdicts/in.sphere", f"-var refine=0.5,1,2,4 {TWO},cubic-spline", "err_history",
        (0.02, 5e-3), "a round edge, an axis"),
    "cube": Scene(
        "docs/verdicts/in.cube",
        "-var N=3,4,6,8,12 -var transfer=FLIP,PIC,APIC -var alpha=1,mechanical,mechanical"
        " -zip transfer,alpha", "err_history", (0.01, 2e-3), "3D, damping by the transfer"),
    "couette": Scene(
        "docs/verdicts/in.couette", f"-var refine=0.5,1,2,4 {TWO},cubic-spline", "err",
        (0.05, 0.01), "a viscous fluid dragged by a wall"),
    "rebound": Scene(
        "docs/verdicts/in.rebound",
        "-var refine=0.5,1,2,4,8 -var transfer=FLIP,APIC -var alpha=1,mechanical"
        " -zip transfer,alpha", "off=abs(back - 1)", (0.1, 0.02), "contact with a wall"),
    "piston": Scene(
        "docs/verdicts/in.piston", f"-var refine=0.5,1,2,4 {TWO}", "off=abs(p/exact - 1)",
        (0.05, 5e-3), "a gas pressed by a body"),
}  # fmt: skip
# And these after that: of all rules the upper bound of a forecast alone was made with them in view.
AFTER = {
    "collision": Scene(
        "docs/verdicts/in.collision", f"-var refine=0.5,1,2,4,8 {TWO}", "err", (0.15, 0.05),
        "shocks in two bodies"),
    "expansion": Scene(
        "docs/verdicts/in.expansion", f"-var refine=0.5,1,2,4 {TWO}", "err", (0.08, 0.03),
        "points fly through cells"),
    "cooling": Scene(
        "docs/verdicts/in.cooling", f"-var refine=0.5,1,2,4 {TWO}", "off=abs(mean/exact - 1)",
        (0.01, 1e-3), "heat through a round surface"),
}  # fmt: skip
# Written, with their targets, when the bounds of forecasts were what they are; nothing was changed.
UNSEEN = {
    "plastic_wave": Scene(
        "docs/verdicts/in.plastic_wave", f"-var refine=0.5,1,2,4 {TWO}", "err", (0.05, 0.02),
        "a plastic wave after an elastic wave"),
    "organ": Scene(
        "docs/verdicts/in.organ", f"-var refine=0.5,1,2,4 {TWO},cubic-spline", "err_history",
        (0.05, 5e-3), "sound in a gas"),
    "shear_wave": Scene(
        "docs/verdicts/in.shear_wave", f"-var refine=0.5,1,2,4 {KINDS}", "err_history",
        (0.05, 5e-3), "points cross cells, in shear alone"),
    "rotor": Scene(
        "docs/verdicts/in.rotor", f"-var refine=0.5,1,2,4,8 -var kind=ulmpm,tlmpm {TWO}", "err",
        (0.01, 1e-3), "a load step, implicit, about an axis"),
}  # fmt: skip
GROUPS = {
    "seen before": KNOWN, "new, rules changed after them": FRESH, "new after these changes": AFTER,
    "unseen": UNSEEN,
}  # fmt: skip
SCENES = KNOWN | FRESH | AFTER | UNSEEN
ALL = f"{TWO},cubic-spline"
BY_TRANSFER = "-var transfer=FLIP,PIC,APIC -var alpha=1,mechanical,mechanical -zip transfer,alpha"
# A script, its variables, and an error that shows where a run has blown up.
MAPS = {
    "map_pulse": ("in.pulse", f"-var CFL=0.2:2.6:13 {ALL} -var refine=4", "err"),
    "map_sphere": ("in.sphere", f"-var CFL=0.2:2.6:13 {ALL} -var refine=4", "err_history"),
    "map_couette": ("in.couette", f"-var CFL=0.2:2.6:13 {ALL}", "err"),
    "map_cube": ("in.cube", f"-var CFL=0.2:2.2:11 -var N=8 {BY_TRANSFER}", "err_history"),
    "map_rebound": ("in.rebound", f"-var CFL=0.2:2.2:11 {BY_TRANSFER}",
                    "grown=(Ek + Es)/(first:Ek + first:Es)"),
}  # fmt: skip
BLOWN = 3  # times the error of the shortest step: more is none of the method's
VERDICTS = ("right", "not sure", "by chance", "wrong")
WORDS = ("sure", "almost sure", "likely", "uncertain", "not sure", "nothing")


class Verdict(NamedTuple):
    """What advise said for a target, and what the sweep shows."""

    target: float
    word: str  # one of WORDS
    choice: str
    error: float
    excess: float  # its cost over that of the cheapest that meets the target, not by chance
    verdict: str  # one of VERDICTS
    forecast: tuple[float, ...] = ()  # the lower bound, what is expected, the upper bound


class Replay:
    """The runs of a table, as a study in which none of them is known."""

    def __init__(self, table: Table):
        self.rows, self.names = table.rows, table.variables
        self.folder = table.path.with_suffix("")

    def knows(self, case: Mapping[str, str]) -> bool:
        """Tell that a case has to be run."""
        return False

    def run(self, cases: Sequence[Mapping[str, str]]) -> list[Mapping[str, Any]]:
        """Give the rows of cases."""
        return [
            next(row for row in self.rows if all(row[n] == v for n, v in case.items()))
            for case in cases
        ]


def sweep(name: str, scene: Scene) -> tuple[Table, str]:
    """Run all variants of a scene; returns their table and the column of the error."""
    path = Path(f"{name}.csv")
    words = [str(ROOT / scene.script), *scene.words.split(), "-record", scene.accuracy]
    with contextlib.redirect_stdout(io.StringIO()):
        main(["sweep", *words, "-jobs", "1", "-o", str(path)])
    variables = [*read_json(path.with_suffix(".json"))["variables"]]
    return Table(records.read(path), variables, path), scene.accuracy.partition("=")[0]


def adviser_of(table: Table, family: Family, target: float) -> Adviser:
    """Make an adviser that knows no run of a table."""
    work: dict[str, tuple[float, ...]] = {}  # of each size: most points and steps
    for row, *sizes in zip(table.rows, *(column(table.rows, n) for n in SIZES), strict=True):
        before = work.get(row[family.along], (0.0, 0.0))
        work[row[family.along]] = tuple(np.fmax(before, sizes))
    fine = sorted(work, key=work.__getitem__)
    others = [name for name in table.variables if name != family.along]
    choices = dict.fromkeys(tuple(row[name] for name in others) for row in table.rows)
    runs = [ChoiceRuns(dict(zip(others, choice, strict=True))) for choice in choices]
    goal = {"accuracy": family.accuracy, "cost": COST, "target": target}
    return Adviser(Replay(table), (family.along, fine), runs, **goal)


def judge(table: Table, accuracy: str, target: float) -> Verdict:
    """Ask advise for a target, and compare what it says with all runs of a table."""
    family = Family(table, accuracy, COST)
    adviser = adviser_of(table, family, target)
    adviser.pilot(3)
    best = adviser.best()
    met = sure_to_meet(family, target)
    if best is None:
        found = "right" if not met else "not sure" if adviser.hopeful() else "wrong"
        return Verdict(target, "nothing", "", np.nan, np.nan, found)
    case = {**best.choice.values, **adviser.at(best.step)}
    (row,) = Replay(table).run([case])
    error, word = abs(errors([row], accuracy)[0]), sureness(adviser, best).partition(":")[0]
    excess = float(column([row], COST)[0] / min(column(met, COST))) if met else np.nan
    found = "right" if row in met else "by chance" if error <= target else "wrong"
    if word in ("uncertain", "not sure"):
        found = "not sure"
    choice = " ".join(value for name, value in case.items() if name in (*family.by, family.along))
    bounds = ()
    if best.forecast and word != "not sure":
        bounds = best.forecast.low, best.forecast.error, best.forecast.high
    return Verdict(target, word, choice, error, excess, found, bounds)


def foretold(table: Table, accuracy: str) -> list[tuple[bool, bool]]:
    """Compare forecasts, from three runs of a choice or more, with the next run.

    Returns of each whether advise doubts it, and whether the error was between its bounds.
    """
    adviser, found = adviser_of(table, Family(table, accuracy, COST), target=0.0), []
    for step, x in enumerate(adviser.xs[1:], 1):
        for choice in adviser.choices:
            adviser.go_on(choice)
        for choice in adviser.choices:
            known = adviser.xs[:step], choice.rows, accuracy, COST
            (next_run,) = Replay(table).run([{**choice.values, **adviser.at(step)}])
            error, said = (
                abs(errors([next_run], accuracy)[0]),
                forecast(x, *known, highest=choice.highest),
            )
            if step > 2 and said and np.isfinite(error):
                doubts = adviser.doubts(Candidate(choice, step, said.cost, said.error, said))
                found.append((bool(doubts), bool(said.low <= error <= said.high)))
    return found


def sure_to_meet(family: Family, target: float) -> list[Mapping[str, str]]:
    """Find the runs that meet a target, and not by chance: all finer ones do, too, or their errors
    fall as those of their functions."""
    found = []
    for line in family.lines:
        finer = np.argsort(column(line.rows, "points"), kind="stable")
        for place, k in enumerate(finer):
            stays = place < len(finer) - 1 and (line.error[finer[place:]] <= target).all()
            if line.error[k] <= target and (stays or not line.chance[k]):
                found.append(line.rows[k])
    return found


def cells(scene: Scene, one: Verdict) -> list[str]:
    """Write a row of the table of scenes."""
    numbers = [f"{number:.2g}" if np.isfinite(number) else "" for number in (one.error, one.excess)]
    advice = f"{one.choice} ({one.word})" if one.choice else "nothing"
    script = f"`{Path(scene.script).name}`"
    return [script, scene.hard, f"{one.target:g}", advice, *numbers, one.verdict]


def between(table: Table, accuracy: str) -> list[float]:
    """Choose a target between any two errors of a table, and one below all."""
    found = np.unique(np.abs(errors(table.rows, accuracy)))
    found = found[np.isfinite(found) & (found > 0)]
    return [0.9 * found[0], *(1.001 * found)]


def written(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Write a table of Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def tables(groups: Mapping[str, Mapping[str, Scene]]) -> str:
    """Make the table of targets of scenes, and that of words over all targets that differ."""
    rows, words, next_runs = [], [], []
    for title, scenes in groups.items():
        named, wide, compared = [], [], []
        for name, scene in scenes.items():
            table, accuracy = sweep(name, scene)
            found = [judge(table, accuracy, target) for target in scene.targets]
            rows += [cells(scene, one) for one in found]
            named += found
            compared += foretold(table, accuracy)
            wide += [judge(table, accuracy, target) for target in between(table, accuracy)]
        rows.append([f"all: {title}", *[""] * 5, counted(named)])
        held = [[ok for doubts, ok in compared if doubts == some] for some in (False, True)]
        next_runs.append([title, *(f"{sum(some)} of {len(some)}" for some in held)])
        for word in WORDS:
            if said := [one for one in wide if one.word == word]:
                words.append([title, word, str(len(said)), counted(said), within(said)])
    heads = ["scene", "difficulty", "target", "advice", "its error", "cost / lowest cost"]
    heads_of_words = ["scenes", "word", "targets", "verdicts", "below the upper bound"]
    heads_of_next = ["scenes", "between the bounds", "of forecasts called `not sure`"]
    parts = ([*heads, "verdict"], rows), (heads_of_words, words), (heads_of_next, next_runs)
    return "\n\n".join(written(*part) for part in parts)


def counted(verdicts: Sequence[Verdict]) -> str:
    """Count verdicts, for a cell."""
    counts = Counter(one.verdict for one in verdicts)
    return ", ".join(f"{counts[v]} {v}" for v in VERDICTS if counts[v])


def within(verdicts: Sequence[Verdict]) -> str:
    """Count forecasts whose run had an error below the upper bound, for a cell."""
    foretold = [one for one in verdicts if one.forecast]
    below = sum(one.error <= one.forecast[2] for one in foretold)
    return f"{below} of {len(foretold)}" if foretold else ""


def chart(name: str, script: str, words: str, accuracy: str) -> list[str]:
    """Draw a map and run all of its cells; returns the row of its table.

    A run has blown up where the program has stopped it, or its error is `BLOWN` times that of the
    shortest step of its row.
    """
    table, error = sweep(name, Scene("docs/verdicts/" + script, words, accuracy, (), ""))
    with contextlib.redirect_stdout(io.StringIO()):
        path = str(ROOT / "docs/verdicts" / script)
        main(["stability", path, *words.split(), "-jobs", "1", "-o", f"{name}_said.png"])
    said = {
        tuple(row[n] for n in table.variables): row
        for row in records.read(Path(f"{name}_said.csv"))
    }
    lines = Family(table, error, COST, along="CFL").lines
    counts, ran = Counter(), 0
    for line in lines:
        for row, size in zip(line.rows, line.error, strict=True):
            told = said[tuple(row[n] for n in table.variables)]
            ran += told["run"] == "yes"
            counts[told["class"], bool(size <= BLOWN * line.error[0])] += 1  # False for NaN, too
    cells = [f"`{script}`", f"{len(table.rows)}, {ran} of them run"]
    cells += [f"{counts[k, True]} and {counts[k, False]}" for k in ("stable", "damped")]
    failed = [counts["failed", ok] + counts["growing", ok] for ok in (True, False)]
    return [*cells, *(f"{a} and {b}" for a, b in (failed, [counts["short", ok] for ok in (1, 0)]))]


if __name__ == "__main__":
    os.chdir(sys.argv[1])
    asked = sys.argv[2:] or [*SCENES, *MAPS]
    chosen = {
        title: {name: group[name] for name in group if name in asked}
        for title, group in GROUPS.items()
    }
    if chosen := {title: group for title, group in chosen.items() if group}:
        print(tables(chosen) + "\n")
    if maps := [chart(name, *MAPS[name]) for name in asked if name in MAPS]:
        print(written(["map of", "cells", "stable", "damped", "growing, failed", "short"], maps))
