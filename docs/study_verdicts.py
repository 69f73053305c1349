"""Hold the verdicts of karamelo-py advise against full sweeps, on scenes that are hard to judge.

``python docs/study_verdicts.py FOLDER [NAME ...]`` runs advise and then all other variants of each
scene, and prints the table of docs/studies.md. What was run before in the folder is used.
"""

import contextlib
import io
import os
import re
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from karamelo_py.app.cli import main
from karamelo_py.app.studies import records
from karamelo_py.app.studies.curves import Family, Table, column

INPUTS = Path(__file__).resolve().parent.parent / "inputs"
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
SCENES = {
    "cantilever": Scene(
        "in.cantilever", f"-var T=1.3 -var refine=0.5,0.75,1,1.5,2 {KINDS}",
        "off=abs(max:tip_s/3.305 - 1)", (1e-2, 2e-3), "the error changes its sign"),
    "column": Scene(
        "in.column", f"-var refine=0.25,0.5,1,2 {TWO},cubic-spline", "share", (1e-2, 4e-3),
        "noise of points that cross cells, a floor"),
    "bar": Scene(
        "in.vibrating_bar", f"-var refine=0.25,0.5,1,2,4 {KINDS}", "err_history", (0.02, 4e-3),
        "errors turn round"),
    "disk": Scene(
        "in.spinning_disk", "-var refine=0.5,1,2 -var transfer=PIC,APIC -var basis=linear",
        "lost=abs((Ek + Es)/(first:Ek + first:Es) - 1)", (0.1,), "damping by the transfer"),
    "sod": Scene(
        "in.sod", f"-var refine=0.25,0.5,1,2 {TWO}", "err", (0.02, 0.05), "a shock: order one"),
    "slab": Scene(
        "in.heat_slab", f"-var refine=0.25,0.5,1,2 {TWO}", "off=abs(heat/exact - 1)", (1e-3, 1e-4),
        "heat that is driven in"),
    "lame": Scene(
        "in.lame", f"-var refine=0.25,0.5,1 {TWO}", "off=abs(pressure/exact - 1)", (0.01, 2e-3),
        "a pressure that is driven up and swings"),
    "incline": Scene(
        "in.incline", f"-var angle=45 -var mu=0.1 -var refine=0.25,0.5,1 {TWO}",
        "off=abs(v_x/exact - 1)", (1e-3,), "weight against friction"),
    "shear": Scene(
        "in.shear_heating", f"-var refine=0.5,1,2 {TWO}",
        "off=abs((T - 298)/(exact - 298) - 1)", (1e-4,), "driven walls, plastic heat"),
    "cylinder": Scene(
        "in.thick_cylinder", f"-var refine=0.25,0.5,1 {TWO}", "off=abs(max:pressure/0.80038 - 1)",
        (0.01,), "a limit load"),
}  # fmt: skip


VERDICTS = ("right", "not sure", "by chance", "wrong")


class Verdict(NamedTuple):
    """What advise said for a target, and what the sweep shows."""

    target: float
    word: str  # "none" where nothing was advised
    choice: str
    error: float
    excess: float  # its cost over that of the cheapest that meets the target, not by chance
    verdict: str  # one of VERDICTS


def run(words: Sequence[str]) -> str:
    """Carry out a command line; returns what it prints."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        main(list(words))
    return said.getvalue()


def judge(name: str, scene: Scene) -> list[Verdict]:
    """Ask advise for each target, then run all variants, and compare."""
    out = ["-o", f"{name}.csv", "-jobs", "1"]
    base = [str(INPUTS / scene.script), *scene.words.split(), *out]
    ask = ["advise", *base, "-accuracy", scene.accuracy, "-cost", COST, "-target"]
    said = {target: run([*ask, f"{target:g}"]) for target in scene.targets}
    run(["sweep", *base, "-record", scene.accuracy])
    rows, made = records.read(Path(f"{name}.csv")), records.beside(Path(f"{name}.csv"))
    return [
        verdict(target, text, Table(rows, [*made["variables"]])) for target, text in said.items()
    ]


def verdict(target: float, said: str, table: Table) -> Verdict:
    """Compare what advise said with a table of all variants."""
    accuracy = re.search(r"for (\w+) <=|reach (\w+) <=", said)
    accuracy = accuracy[1] or accuracy[2]
    family = Family(table, accuracy, COST)
    good = {id(row) for row in table.rows if abs(records.value(row, accuracy) or np.inf) <= target}
    lucky = {
        id(row)
        for line in family.lines
        for row, why in zip(line.rows, line.chance, strict=True)
        if why
    }
    sure = [row for row in table.rows if id(row) in good - lucky]
    least = min(column(sure, COST), default=np.inf)
    word = re.search(r"^(sure|almost sure|likely|uncertain|not sure)\b", said, re.M)
    if word is None or "no variant is expected" in said:
        right = not sure or "may do, at about" in said
        return Verdict(target, "none", "", np.nan, np.nan, "right" if right else "wrong")
    values = dict(re.findall(r'^  (\w+) = "?([^"\n]+)"?$', said, re.M))
    row = next(row for row in table.rows if all(row[n] == v for n, v in values.items()))
    error = abs(records.value(row, accuracy) or np.nan)
    excess = float(column([row], COST)[0]) / least if sure else np.nan
    if word[1] in ("uncertain", "not sure"):
        found = "not sure"
    elif id(row) in good:
        found = "by chance" if id(row) in lucky else "right"
    else:
        found = "wrong"
    differing = {n: v for n, v in values.items() if len({row[n] for row in table.rows}) > 1}
    return Verdict(target, word[1], " ".join(differing.values()), error, excess, found)


def line(scene: Scene, one: Verdict) -> str:
    """Write a row of the table."""
    numbers = [f"{number:.2g}" if np.isfinite(number) else "" for number in (one.error, one.excess)]
    advice = f"{one.choice} ({one.word})" if one.choice else "nothing"
    cells = [f"`{Path(scene.script).name}`", scene.hard, f"{one.target:g}", advice, *numbers]
    return "| " + " | ".join([*cells, one.verdict]) + " |"


def table(names: Mapping[str, Scene]) -> str:
    """Make the table of scenes."""
    head = "| scene | what is hard | target | advice | its error | cost over the least | verdict |"
    found = [(scene, one) for name, scene in names.items() for one in judge(name, scene)]
    counts = Counter(one.verdict for _, one in found)
    last = "| all |" + " |" * 5 + " " + ", ".join(f"{counts[v]} {v}" for v in VERDICTS) + " |"
    rows = [line(scene, one) for scene, one in found]
    return "\n".join([head, "|---|---|---|---|---|---|---|", *rows, last])


if __name__ == "__main__":
    os.chdir(sys.argv[1])
    print(table({name: SCENES[name] for name in sys.argv[2:] or SCENES}))
