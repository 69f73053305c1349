"""python -m comparisons.auto FOLDER [SCENE ...]: the error of ``method(auto)`` beside ten set-ups.

Each script runs in two sizes with each set-up in the place of its ``method``, and with the
program's own step. Errors are compared at equal cost, in visited nodes: points times steps times
nodes of a point times visits in a step. What the folder holds from before is used.
"""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from math import exp, inf, isfinite, log, nan
from pathlib import Path
from typing import NamedTuple

from comparisons import defaults
from comparisons.results import Result

ROOT = Path(__file__).parent.parent
SETUPS = {
    "auto": "method(auto)",
    "linear": "method(ulmpm, FLIP, linear, 1)",
    "linear .99": "method(ulmpm, FLIP, linear, 0.99)",
    "quadratic .99": "method(ulmpm, FLIP, quadratic-spline, 0.99)",
    "quadratic usavg": "method(ulmpm, FLIP, quadratic-spline, 1)\nscheme(usavg)",
    "APIC quadratic": "method(ulmpm, APIC, quadratic-spline)",
    "APIC cubic": "method(ulmpm, APIC, cubic-spline)",
    "cpgimp": "method(ulmpm, FLIP, cpgimp, 0.99)",
    "cpdi": "method(ulcpdi, FLIP, linear, 1, {domain})",
    "tlmpm FLIP": "method(tlmpm, FLIP, linear, 1)",
    "tlmpm APIC": "method(tlmpm, APIC, linear)",
}
VISITS = {"usl": 2, "musl": 4, "usf": 4, "usavg": 6}
EXACT = 1e-3  # errors below count as this
LONGEST = 60.0  # seconds for a run


class Scene(NamedTuple):
    """A script with an exact answer, `sizes` of its `variable`, and the error of a run."""

    script: str
    error: Callable[[Result], float]
    sizes: tuple[str, str] = ("1", "2")
    variable: str = "refine"
    domain: str = "R4"
    more: tuple[str, ...] = ()


def last(name: str, over: str = "", exact: float | None = None) -> Callable[[Result], float]:
    """Last value of a column, or its deviation from that of another, or from a number."""

    def error(result: Result) -> float:
        value = result.log[name][-1]
        wanted = result.log[over][-1] if over else exact
        return abs(value if wanted is None else value / wanted - 1)

    return error


def extreme(name: str, exact: float, result: Result) -> float:
    """Deviation of the largest value of a column."""
    return abs(max(abs(result.log[name])) / exact - 1)


def lost(names: tuple[str, ...], result: Result) -> float:
    """Energy gained or lost on the way, over that at first."""
    of = sum(result.log[name] for name in names)
    return max(abs(of / of[0] - 1))


def of_defaults(name: str, result: Result) -> float:
    """Error of a scene of docs/defaults.md."""
    case = defaults.case(name)
    return abs(case.error(case.measure(result)))


def default(name: str, **more) -> Scene:
    refine = defaults.case(name).refine
    sizes = ("1", "2") if len(refine) > 1 else ("0.5", "1")
    return Scene(f"inputs/defaults/in.{name}", partial(of_defaults, name), sizes, **more)


V, IN = "docs/verdicts/in", "inputs/in"
SCENES = {
    **{
        name: default(name)
        for name in (
            "clamp", "cut", "faces", "footing_friction", "noh", "plane_flow", "plates", "punch",
            "rods", "slide", "slope_10", "slope_20", "slope_20_free", "slope_20_soft", "slope_33",
            "slope_surface", "slosh", "strong_shock", "taylor_green", "throw", "turns",
        )
    },
    "collision": Scene(f"{V}.collision", last("err"), ("2", "4")),
    "cooling": Scene(f"{V}.cooling", last("mean", "exact")),
    "couette": Scene(f"{V}.couette", last("err")),
    "cube": Scene(f"{V}.cube", last("err_history"), ("4", "8"), "N", "R8"),
    "expansion": Scene(f"{V}.expansion", last("err")),
    "oblique": Scene(f"{V}.oblique", last("err_history")),
    "organ": Scene(f"{V}.organ", last("err_history")),
    "piston": Scene(f"{V}.piston", last("p", "exact")),
    "plastic_wave": Scene(f"{V}.plastic_wave", last("err")),
    "pulse": Scene(f"{V}.pulse", last("err"), ("2", "4")),
    "rebound": Scene(f"{V}.rebound", last("back", exact=1.0), ("2", "4")),
    "rotor": Scene(f"{V}.rotor", last("err"), ("2", "4")),
    "shear_wave": Scene(f"{V}.shear_wave", last("err_history")),
    "sphere": Scene(f"{V}.sphere", last("err_history")),
    "axis_aligned": Scene(f"{IN}.axis_aligned", last("error_z"), ("0.5", "1"), more=("G", "0.05")),
    "axis_aligned_1d": Scene(f"{IN}.axis_aligned_1d", last("error_z"), more=("G", "0.1")),
    "axis_aligned_3d": Scene(f"{IN}.axis_aligned_3d", last("error_z"), ("0.5", "1"), domain="R8"),
    "bar": Scene(f"{IN}.vibrating_bar", last("err_history"), ("0.4", "1")),
    "cantilever": Scene(
        f"{IN}.cantilever", partial(extreme, "tip_s", 3.305), ("0.5", "1"), more=("T", "1.3")),
    "column": Scene(f"{IN}.column", last("share"), ("0.5", "1")),
    "vertical_bar": Scene(
        f"{IN}.vertical_bar", partial(extreme, "tip_s", 1.7146), ("0.5", "1"), domain="R8"),
    "sod": Scene(f"{IN}.sod", last("err"), ("0.5", "1")),
    "vortex": Scene(f"{IN}.vortex", last("error_z"), ("0.5", "1")),
    "disk": Scene(f"{IN}.spinning_disk", partial(lost, ("Ek", "Es")), more=("turns", "5")),
    "energy_disk": Scene(
        f"{IN}.energy_disk", lambda r: abs(r.log.E[-60:].mean() / r.log.E[:60].mean() - 1),
        ("4", "8"), "n", more=("periods", "20")),
    "heat_slab": Scene(f"{IN}.heat_slab", last("heat", "exact"), ("0.5", "1")),
    "lame": Scene(f"{IN}.lame", last("pressure", "exact"), ("0.5", "1")),
    "shear_heating": Scene(f"{IN}.shear_heating", last("T", "exact"), ("0.5", "1")),
    "cylinder": Scene(
        f"{IN}.thick_cylinder", partial(extreme, "pressure", 0.80038), ("0.5", "1")),
    "incline": Scene(f"{IN}.incline", last("v_x", "exact"), ("0.5", "1"), more=("angle", "45")),
}  # fmt: skip


def script_of(scene: Scene, setup: str, total: bool) -> str:
    """The script with another method, and with the program's own choices besides.

    Loads of some scripts depend on whether the frame is the `total` one.
    """
    path = ROOT / scene.script
    text = re.sub(
        r"^include\((.*)\)$", lambda m: (path.parent / m[1]).read_text(encoding="utf-8"),
        path.read_text(encoding="utf-8"), flags=re.M,
    )  # fmt: skip
    text = re.sub(r"^eulerian = .*", f"eulerian = {int(not total)}", text, flags=re.M)
    implicit = re.search(r"^scheme\((quasi-static|newmark)", text, re.M)
    own = r"^(anti_volumetric_locking|precision)\(.*\n"
    if not implicit:
        own = r"^(anti_volumetric_locking|precision|scheme|dt_factor|set_dt)\(.*\n"
        text = re.sub(r"^scheme\(.*\n", "", text, flags=re.M)
    else:
        setup = setup.split("\n")[0]
    text = re.sub(own, "", text, flags=re.M)
    lines = setup.format(domain=scene.domain)
    if "(ulmpm/contacts" in text:  # its fixes need the fields of solids
        lines = lines.replace("(ulmpm,", "(ulmpm/contacts,")
    if "thermo-mechanical" in text and "auto" not in setup:
        lines = re.sub(r"\)$", ", thermo-mechanical)", lines, count=1, flags=re.M)
    return re.sub(r"^method\(.*$", lines, text, flags=re.M)


def run(
    scene: Scene, name: str, setup: str, size: str, folder: Path, frame: str = "tlmpm"
) -> dict:
    """Run a script; its error, cost and words, of which the folder has a copy."""
    place = folder / name / re.sub(r"\W+", "_", setup) / size
    known = place / "found.json"
    chosen = SETUPS[setup] if setup != "auto" else frame
    text = script_of(scene, SETUPS[setup], "tlmpm" in chosen)
    if known.exists() and (setup != "auto"):
        return json.loads(known.read_text())
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    script = place / f"in.{name}"
    script.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "karamelo_py.app.cli", str(script), "--threads", "1"]
    command += ["-var", scene.variable, size]
    command += ["-var", *scene.more] if scene.more else []
    found = {"error": nan, "cost": nan, "seconds": nan, "method": "", "status": ""}
    try:
        done = subprocess.run(
            command, cwd=place, capture_output=True, text=True, check=False, timeout=LONGEST
        )
    except subprocess.TimeoutExpired:
        found["status"] = "too long"
    else:
        if "pass through each other" in done.stdout + done.stderr:
            found["status"] = "bodies pass through each other"
        elif done.returncode:
            found["status"] = (re.findall(r"error: (.*)", done.stderr) or ["?"])[0][:90]
        else:
            found |= measured(scene, Result(0, done.stdout, done.stderr, place))
    if "eulerian" in text and setup == "auto" and frame not in found["method"] != "":
        return run(scene, name, setup, size, folder, "ulmpm")
    known.write_text(json.dumps(found))
    for path in place.iterdir():
        if path != known and path != script:
            path.unlink()
    return found


def measured(scene: Scene, result: Result) -> dict:
    runs = json.loads((result.folder / "run.json").read_text())["runs"]
    cost = seconds = 0.0
    for one in runs:
        visits = next((n for word, n in VISITS.items() if f" {word}" in one["method"]), 4)
        cost += one["points"] * one["steps"] * one["nodes_per_point"] * visits
        seconds += one["processor_s_in_steps"]
    try:
        error = scene.error(result)
    except (KeyError, ValueError, IndexError, OSError) as wrong:
        return {"status": f"{type(wrong).__name__} {wrong}"[:90]}
    return {"error": error, "cost": cost, "seconds": seconds, "method": runs[0]["method"]}


def at(cost: float, runs: list[dict]) -> float:
    """Error at a cost, on the line through two runs or beyond, with at most 8 times its cost."""
    (c1, e1), (c2, e2) = ((one["cost"], max(one["error"], EXACT)) for one in runs)
    if not all(map(isfinite, (c1, c2, e1, e2))):
        return inf
    slope = min(max(log(e2 / e1) / log(c2 / c1), -1.5), 0.0) if c2 != c1 else 0.0
    step = min(max(log(cost / c2), log(1 / 8)), log(8))
    return max(e2 * exp(slope * step), EXACT)


def row(name: str, folder: Path) -> tuple[str, float]:
    """Compare auto with the best set-up at its cost."""
    scene = SCENES[name]
    runs = {s: [run(scene, name, s, size, folder) for size in scene.sizes] for s in SETUPS}
    mine = runs.pop("auto")[-1]
    others = {s: at(mine["cost"], some) for s, some in runs.items()}
    best = min(others, key=others.__getitem__)
    error = max(mine["error"], EXACT)
    ratio = error / others[best] if isfinite(error) else inf
    chosen = mine["method"] or mine["status"]
    best_error = f"{100 * others[best]:.2g} %"
    cells = name, chosen, f"{100 * error:.2g} %", best, best_error, f"{ratio:.2f}"
    return f"| {' | '.join(cells)} |", ratio


def main() -> None:
    folder, *names = sys.argv[1:]
    ratios = []
    for name in names or SCENES:
        text, ratio = row(name, Path(folder))
        ratios.append(ratio)
        print(text, flush=True)
    good = sum(ratio <= 1.2 for ratio in ratios)
    print(f"{good} of {len(ratios)} within 1.2")


if __name__ == "__main__":
    main()
