"""python -m comparisons.auto FOLDER [SCENE ...]: the error of ``method(auto)`` and of ten set-ups.

Each script runs in two sizes with each set-up instead of its ``method``, and with the program's
own step. Errors are compared at equal cost, in visited nodes: points times steps times nodes of a
point times visits in a step. Results that the folder has are used, except those of auto.
"""

import contextlib
import io
import json
import os
import re
import resource
import shutil
import signal
import sys
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain
from math import exp, inf, isfinite, log, nan, pi, radians, sqrt
from pathlib import Path
from typing import NamedTuple

import numpy as np

from comparisons import defaults, exact, lesser, slopes
from comparisons.defaults import plane_flow
from comparisons.results import Result
from karamelo_py.app import cli

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
LONGEST = 40  # seconds of processor time for a run


class Scene(NamedTuple):
    """A script with an exact answer, `sizes` of its `variable`, and the error of a run.

    `points` per cell and direction replace those of the script.
    """

    script: str
    error: Callable[[Result], float]
    sizes: tuple[str, str] = ("1", "2")
    variable: str = "refine"
    domain: str = "R4"
    more: tuple = ()  # names and values of variables
    points: int | None = None


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


def of_cantilever(result: Result) -> float:
    """Mean deviation of the tip from finite elements, over its largest way, until it is back."""
    time, tip = exact.cantilever_curve()
    off = abs(result.log.tip_s - abs(np.interp(result.log.Time, time, tip)))
    return off.mean() / abs(tip).max()


def default(name: str, **more) -> Scene:
    refine = defaults.case(name).refine
    sizes = ("1", "2") if len(refine) > 1 else ("0.5", "1")
    return Scene(f"inputs/defaults/in.{name}", partial(of_defaults, name), sizes, **more)


def tube(result: Result) -> float:
    """Mean error of the pressure in the tube of in.strong_shock."""
    last, time = result.snapshots("points")[-1], result.log.Time[-1]
    wanted = exact.riemann((1.0, 1000.0), (1.0, 0.01), 1.4)((last.x - 0.5) / time)[2]
    return off(-last.s11, wanted, last.x > 0)


def off(found: np.ndarray, wanted: np.ndarray, some: np.ndarray) -> float:
    return float(abs(found - wanted)[some].sum() / wanted[some].sum())


V, IN, D, M = "docs/verdicts/in", "inputs/in", "inputs/defaults/in", "inputs/models/in"
OWN = "comparisons/scenes/in"
SEEN = {
    **{
        name: default(name)
        for name in (
            "clamp", "cut", "faces", "footing_friction", "noh", "plane_flow", "plates", "punch",
            "rods", "slide", "slope_10", "slope_20", "slope_20_free", "slope_20_soft", "slope_33",
            "slope_surface", "slosh", "taylor_green", "throw", "turns",
        )
    },
    "strong_shock": default("strong_shock")._replace(error=tube),
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
    "cantilever": Scene(f"{IN}.cantilever", of_cantilever, ("0.5", "1"), more=("T", "2.6")),
    "column": Scene(f"{IN}.column", last("share"), ("0.5", "1")),
    "vertical_bar": Scene(
        f"{IN}.vertical_bar", partial(extreme, "tip_s", 1.662), ("0.5", "1"), domain="R8"),
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


def slope(angle: float, mu: float) -> Scene:
    """Another slope of docs/defaults.md."""
    error = partial(slopes.friction, angle=angle, mu=mu)
    return Scene(f"{D}.slope_20", error, more=("angle", angle, "mu", mu))


def model(name: str, of: Callable[[Result], float], sizes: tuple[str, str], **more) -> Scene:
    """A lesser model of docs/lesser.md."""
    return Scene(f"{M}.{name}", of, sizes, "n", more=tuple(chain(*more.items())))


def front(result: Result) -> float:
    return abs(result.log.front_x[-1] / (2 * sqrt(9.81) * result.log.Time[-1]) - 1)


def force_of_hertz(result: Result, way: float = 0.02) -> float:
    """Deviation of the mean of the last tenth, or of the last load step."""
    force = result.log.force
    wanted = exact.hertz_load(way, 1.0, 1e6 / (1 - 0.3**2))
    return abs(force[-max(1, len(force) // 10) :].mean() / wanted - 1)


def detonation(result: Result) -> float:
    """Mean error of the pressure in the release and ahead of the front."""
    speed, p, _ = exact.release_of_tnt()
    last, time = result.snapshots("tnt")[-1], result.log.Time[-1]
    s = last.x / time
    wanted = np.interp(s, speed[::-1], p[::-1], right=0.0)
    return off(last.p, wanted, s > 0.6 * speed[0])


HALF, ONE = ("0.5", "1"), ("1", "2")
UNSEEN = {
    "slope_15": slope(15, 0.05),
    "slope_27": slope(27, 0.25),
    "slope_40": slope(40, 0.6),
    "roll_20": Scene(f"{IN}.incline", last("v_x", "exact"), HALF, more=("angle", 20, "mu", 0.4)),
    "slide_35": Scene(f"{IN}.incline", last("v_x", "exact"), HALF, more=("angle", 35, "mu", 0.15)),
    "short_long": Scene(f"{OWN}.short_long", last("off"), ONE),
    "hertz": Scene(f"{IN}.hertz", force_of_hertz, ("0.25", "0.5")),
    "static_hertz": Scene(f"{IN}.static_hertz", force_of_hertz, HALF),
    "slosh_deep": Scene(f"{D}.slosh", partial(of_defaults, "slosh"), HALF, more=("H", 1)),
    "four_vortices": Scene(f"{D}.taylor_green", last("off"), ONE, more=("k", 2 * pi)),
    "poiseuille": Scene(f"{OWN}.poiseuille", last("err"), ONE),
    "still_water": Scene(f"{OWN}.still_water", last("err"), ONE),
    "dam_ritter": Scene(f"{IN}.dam_ritter", front, ("0.25", "0.5")),
    "noh_plane": Scene(f"{OWN}.noh_plane", last("ratio", exact=1.0), ONE),
    "blast": model("blast", lambda r: abs(lesser.radius_of_shock(r) / 0.7579 - 1), ("20", "40")),
    "tnt_slab": Scene(f"{IN}.tnt_slab", detonation, HALF),
    "plane_flow_23": Scene(
        f"{D}.plane_flow", partial(plane_flow.scatter, degrees=23), more=("angle", radians(23))),
    "granular_column": Scene(f"{IN}.granular_column", last("runout", exact=1.2), ("0.25", "0.5")),
    "footing_30": Scene(
        f"{D}.footing_friction",
        lambda r: abs(r.log.load[r.log.Time > 0.8].mean() / exact.prandtl_load(1, radians(30)) - 1),
        HALF, more=("phi", 30, "v", 0.16)),
    "rough_footing": Scene(f"{IN}.static_rough_footing", last("load", exact=2 + pi), HALF),
    "cavity": model("cavity", last("p", exact=1.3728), ("8", "16")),
    "disk_limit": model("disk", last("Time", exact=3.2582), ("5", "10"), law="plastic"),
    "torsion": model("torsion", last("err"), ("4", "8")),
    "taylor": Scene(f"{M}.taylor", last("err"), HALF),
    "impact": model("impact", last("err"), ("4", "8")),
    "plates_1500": Scene(f"{D}.plates", partial(of_defaults, "plates"), HALF, more=("v", 1500)),
    "flyer": Scene(f"{IN}.flyer", partial(extreme, "u_x", 0.4), HALF),
    "bar_wave": model("bar", last("err"), ("8", "16")),
    "wave_along": model("bar", last("err"), ("8", "16"), law="along"),
    "lame_1d": Scene(f"{M}.lame", last("err"), HALF, more=("model", "cylindrical")),
    "lame_quarter": Scene(f"{M}.lame", last("err"), HALF, more=("model", "quarter")),
    "shell_1d": Scene(f"{M}.shell", last("err"), HALF),
    "shell": Scene(f"{M}.shell", last("err"), HALF, more=("model", "axisymmetric")),
    "oblique_11": Scene(f"{V}.oblique", last("err_history"), HALF, more=("angle", 0.2)),
    "resting_disk": Scene(
        f"{IN}.energy_disk", lambda r: abs(r.log.E[-60:].mean() / r.log.E[:60].mean() - 1),
        ("5", "10"), "n", more=("periods", 10, "moving", 0, "strain", 0.05)),
    "two_rods": Scene(f"{D}.rods", partial(of_defaults, "rods"), ONE, more=("v", 0.02, "L", 15)),
    "beam": model("beam", last("err"), ("8", "16")),
    "kirsch": model("kirsch", last("peak", exact=3.0), ("6", "10")),
    "static_column": Scene(f"{IN}.static_column", last("share"), ("8", "16"), "N"),
    "slow_bar": Scene(f"{IN}.slow_bar", last("v_x", "exact"), ("500", "1000"), "N"),
}  # fmt: skip

MONATOMIC = 5 / 3
# Not looked at before the rules were final, but for hertz_light.
HELD_OUT = {
    "slope_12": slope(12, 0.1),
    "slope_24": slope(24, 0.3),
    "roll_30": Scene(f"{IN}.incline", last("v_x", "exact"), HALF, more=("angle", 30, "mu", 0.6)),
    "slide_25": Scene(f"{IN}.incline", last("v_x", "exact"), HALF, more=("angle", 25, "mu", 0.1)),
    "hertz_light": Scene(
        f"{IN}.hertz", partial(force_of_hertz, way=0.01), ("0.25", "0.5"), more=("d", 0.01)),
    "static_hertz_light": Scene(
        f"{IN}.static_hertz", partial(force_of_hertz, way=0.01), HALF, more=("d", 0.01)),
    "thin_ring": Scene(f"{M}.lame", last("err"), HALF, more=("model", "cylindrical", "b", 1.5)),
    "thick_shell": Scene(f"{M}.shell", last("err"), HALF, more=("b", 4)),
    "static_column_soft": Scene(
        f"{IN}.static_column", last("share"), ("8", "16"), "N",
        more=("H", 10, "E", 1e4, "g", 9.81)),
    "pressed": model("pressed", last("err"), ("8", "16"), c="1.4"),
    "cylinder_3": Scene(
        f"{IN}.thick_cylinder", partial(extreme, "pressure", 2 / sqrt(3) * log(3)), HALF,
        more=("b", 3, "U", 0.015)),
    "beam_long": model("beam", last("err"), ("8", "16"), L="8"),
    "slow_bar_5": Scene(
        f"{IN}.slow_bar", last("v_x", "exact"), ("500", "1000"), "N",
        more=("periods", 5, "courant", 50)),
    "slosh_shallow": Scene(f"{D}.slosh", partial(of_defaults, "slosh"), ONE, more=("H", 0.25)),
    "still_deep": Scene(f"{OWN}.still_water", last("err"), HALF, more=("H", 1)),
    "poiseuille_thin": Scene(f"{OWN}.poiseuille", last("err"), ONE, more=("mu", 0.5)),
    "couette_late": Scene(f"{V}.couette", last("err"), ("0.5", "1"), more=("T", 0.3)),
    "nine_vortices": Scene(f"{D}.taylor_green", last("off"), ONE, more=("k", 3 * pi)),
    "sod_late": Scene(f"{IN}.sod", last("err"), HALF, more=("T", 0.2)),
    "blast_early": model(
        "blast", lambda r: abs(lesser.radius_of_shock(r) / 0.35**0.4 - 1), ("20", "40"),
        end="0.35"),
    "tnt_thin": Scene(f"{IN}.tnt_slab", detonation, HALF, more=("L", 0.05)),
    "organ_argon": Scene(f"{V}.organ", last("err_history"), more=("g", MONATOMIC)),
    "piston_fast": Scene(f"{V}.piston", last("p", "exact"), more=("T", 20)),
    "expansion_argon": Scene(f"{V}.expansion", last("err"), more=("g", MONATOMIC)),
    "plates_900": Scene(f"{D}.plates", partial(of_defaults, "plates"), HALF, more=("v", 900)),
    "flyer_slow": Scene(f"{IN}.flyer", partial(extreme, "u_x", 0.3), HALF, more=("v", 0.3)),
    "impact_hard": model("impact", last("err"), ("4", "8"), H="20e9"),
    "torsion_soft": model("torsion", last("err"), ("4", "8"), k="0.05"),
    "bar_across": model("bar", last("err"), ("8", "16"), law="across"),
    "oblique_20": Scene(f"{V}.oblique", last("err_history"), HALF, more=("angle", radians(20))),
    "square_20": Scene(f"{IN}.axis_aligned", last("error_z"), HALF, more=("G", "0.02")),
    "square_1d_50": Scene(f"{IN}.axis_aligned_1d", last("error_z"), more=("G", "0.05")),
    "rebound_long": Scene(f"{V}.rebound", last("back", exact=1.0), ("2", "4"), more=("L", 2)),
    "disk_2": Scene(
        f"{IN}.energy_disk", lambda r: abs(r.log.E[-60:].mean() / r.log.E[:60].mean() - 1),
        ("5", "8"), "n", more=("periods", 15, "strain", 0.02)),
    "plane_flow_26": Scene(
        f"{D}.plane_flow", partial(plane_flow.scatter, degrees=26), more=("angle", radians(26))),
    "cooling_steel": Scene(f"{V}.cooling", last("mean", "exact"), more=("kappa", 50)),
}  # fmt: skip
# Not looked at before the rules that choose for them.
LATER = {
    "throw_far": default("throw", more=("T", 0.8, "G", 6)),
    "shear_wave_45": Scene(f"{V}.shear_wave", last("err_history"), more=("nu", 0.45)),
    "oblique_40": Scene(f"{V}.oblique", last("err_history"), HALF, more=("angle", radians(40))),
    "disk_45": Scene(
        f"{IN}.spinning_disk", partial(lost, ("Ek", "Es")), more=("turns", 2, "nu", 0.45)),
    "disk_5": Scene(
        f"{IN}.energy_disk", lambda r: abs(r.log.E[-60:].mean() / r.log.E[:60].mean() - 1),
        ("5", "8"), "n", more=("periods", 10, "strain", 0.05)),
    "square_100": Scene(f"{IN}.axis_aligned", last("error_z"), HALF, more=("G", 0.1)),
    "bar_3d": Scene(f"{OWN}.bar_3d", last("err"), ("8", "16"), "n"),
    "expansion_heavy": Scene(f"{V}.expansion", last("err"), more=("g", 1.2)),
    "tnt_thick": Scene(f"{IN}.tnt_slab", detonation, HALF, more=("L", 0.2)),
    "blast_late": model(
        "blast", lambda r: abs(lesser.radius_of_shock(r) / 0.8**0.4 - 1), ("20", "40"), end="0.8"),
    "rebound_short": Scene(f"{V}.rebound", last("back", exact=1.0), ("2", "4"), more=("L", 0.5)),
}  # fmt: skip
SCENES = {**SEEN, **UNSEEN, **HELD_OUT, **LATER}


def script_of(scene: Scene, lines: str, total: bool) -> str:
    """The script with another method, and with the program's own choices besides.

    Loads of some scripts depend on whether the frame is the `total` one.
    """
    path = ROOT / scene.script
    text = re.sub(
        r"^include\(([\w.]+)\)$", lambda m: (path.parent / m[1]).read_text(encoding="utf-8"),
        path.read_text(encoding="utf-8"), flags=re.M,
    )  # fmt: skip
    text = re.sub(r"^eulerian = .*", f"eulerian = {int(not total)}", text, flags=re.M)
    own = r"^(anti_volumetric_locking|precision)\(.*\n"
    if re.search(r"^scheme\((quasi-static|newmark)", text, re.M):
        lines = "\n".join(line for line in lines.split("\n") if not line.startswith("scheme"))
    else:
        own = r"^(anti_volumetric_locking|precision|scheme|dt_factor|set_dt)\(.*\n"
    text = re.sub(own, "", text, flags=re.M)
    lines = lines.format(domain=scene.domain)
    if scene.points is not None:
        text = re.sub(r"^(ppc +=) \d", rf"\1 {scene.points}", text, flags=re.M)
        of_solids = r"^(solid\(\w+, region, \w+), \d,"
        text = re.sub(of_solids, rf"\1, {scene.points},", text, flags=re.M)
    if "(ulmpm/contacts" in text:  # its fixes need the fields of solids
        lines = lines.replace("(ulmpm,", "(ulmpm/contacts,")
    if "thermo-mechanical" in text and "auto" not in lines:
        lines = re.sub(r"\)$", ", thermo-mechanical)", lines, count=1, flags=re.M)
    return re.sub(r"^method\(.*$", lines, text, flags=re.M)


def forked(words: Sequence[str], place: Path) -> int | None:
    """Run the program in a fork of this process; its status, or None if it took too long."""
    pid = os.fork()
    if not pid:
        status = 1
        resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST))
        try:
            os.chdir(place)
            for name, at in (("out", 1), ("err", 2)):
                os.dup2(os.open(name, os.O_CREAT | os.O_WRONLY), at)
            status = cli.main([*words])
        except SystemExit as end:
            status = end.code if isinstance(end.code, int) else 1
        except BaseException:
            traceback.print_exc()
        sys.stdout.flush()
        os._exit(status or 0)
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return None if status in (-signal.SIGKILL, -signal.SIGXCPU) else status


def run(scene: Scene, name: str, setup: str, size: str, folder: Path, total: bool = True) -> dict:
    """Run a script; its error, cost and words, of which the folder has a copy."""
    place = folder / name / re.sub(r"\W+", "_", setup) / size
    known = place / "found.json"
    lines, auto = SETUPS[setup], setup == "auto"
    text = script_of(scene, lines, total if auto else "tlmpm" in lines)
    if known.exists() and not auto:
        return json.loads(known.read_text())
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    for part in (ROOT / scene.script).parent.iterdir():
        if part.is_file() and not part.name.startswith("in."):
            shutil.copy(part, place)
    script = place / f"in.{name}"
    script.write_text(text, encoding="utf-8")
    words = [str(script), "--threads", "1"]
    variables = (scene.variable, size, *scene.more)
    for variable, value in zip(variables[::2], variables[1::2], strict=True):
        words += ["-var", variable, str(value)]
    found = {"error": nan, "cost": nan, "seconds": nan, "method": "", "status": "too long"}
    status = forked(words, place)
    out, err = ((place / stream).read_text("utf-8") for stream in ("out", "err"))
    if status is not None:
        if "pass through each other" in out + err:
            found["status"] = "bodies pass through each other"
        elif status:
            found["status"] = (re.findall(r"error: (.*)", err) or ["?"])[0][:90]
        else:
            found |= measured(scene, Result(0, out, err, place))
    if "eulerian" in text and auto and total and "ulmpm" in found["method"]:
        return run(scene, name, setup, size, folder, total=False)
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
    method = runs[0]["method"]
    return {"error": error, "cost": cost, "seconds": seconds, "method": method, "status": ""}


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


WARM = """\
method(auto)
dimension(1, 0, 1, 0.1)
region(line, block, 0, 1)
material(m, linear, 1, 1, 0)
solid(bar, region, line, 2, m, 0.1)
run(1)
"""


def warm(folder: Path) -> None:
    """Run a small scene in this process: forks of it need not import the program."""
    folder.mkdir(parents=True, exist_ok=True)
    script = folder / "in.warm"
    script.write_text(WARM, encoding="utf-8")
    with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        cli.main([str(script), "--threads", "1"])


def main() -> None:
    folder, *names = sys.argv[1:]
    warm(Path(folder))
    for group in (LATER, HELD_OUT, UNSEEN, SEEN):
        ratios = []
        for name in group:
            if not names or name in names:
                text, ratio = row(name, Path(folder))
                ratios.append(ratio)
                print(text, flush=True)
        good = sum(ratio <= 1.2 for ratio in ratios)
        print(f"{good} of {len(ratios)} within 1.2", flush=True)


if __name__ == "__main__":
    main()
