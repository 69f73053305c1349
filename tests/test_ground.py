"""The scenes of the how-tos on soil and rock, against theory."""

import re
import shutil
from pathlib import Path

import pytest
from conftest import INPUTS

from karamelo_py.scene.terrain import read_raster

HOWTO = Path(__file__).parent.parent / "docs" / "howto"


def scene(page, *changes):
    text = (HOWTO / page).read_text("utf-8")
    (script,) = re.findall(r"^```karamelo\n(.*?)^```", text, re.S | re.M)
    for old, new in changes:
        assert old in script
        script = script.replace(old, new)
    return script


WET = (
    ("solid(sand", "pore_water(sand, n=0.4, permeability=1e-4)\nsolid(sand"),
    ("compute(F", "region(top, block, -INF, INF, H, INF)\ngroup(top, nodes, region, top, all)\n"
     "fix(drain, pore_pressure, top, 0)\ncompute(F"),
    ("set_dt(1)", "set_dt(1e5)"), ("travel/20", "travel/20e5"),
)  # fmt: skip
FULL = pytest.mark.full


@pytest.mark.parametrize(
    ("way", "n", "changes", "K", "within"),
    [
        (-1, 6, (), 1 / 3, 0.02),
        pytest.param(-1, 10, (), 1 / 3, 0.01, marks=FULL),
        pytest.param(1, 10, (), 3, 0.03, marks=FULL),
        pytest.param(-1, 10, WET, 0.625 / 3 + 0.625, 0.03, marks=FULL),
        pytest.param(1, 10, (*WET, ("run(20)", "run(16)")), 3 * 0.625 + 0.625, 0.03, marks=FULL),
    ],
)
def test_earth_pressure(run_script, way, n, changes, K, within):
    """Rankine 1857; the force acts at a third of the height."""
    script = scene("retaining-wall.md", *changes)
    log = run_script(script, "-var", "way", str(way), "-var", "n", str(n)).log
    assert log["K"][-1] == pytest.approx(K, rel=within)
    assert log["up"][-1] == pytest.approx(1 / 3, abs=0.015)


@pytest.mark.full
@pytest.mark.parametrize(("way", "K", "within"), [(-1, 0.294, 0.03), (1, 4.29, 0.03)])
def test_a_rough_wall_on_a_rough_base_rubs(run_script, way, K, within):
    """Lancellotta 2002 (exact for sand without weight under a load on its surface)."""
    page = (HOWTO / "retaining-wall.md").read_text("utf-8")
    ((travel, T, *lines),) = map(
        str.splitlines, re.findall(r"^```text\n(travel.*?)^```", page, re.S | re.M)
    )
    script = re.sub(r"^(scheme|set_dt).*\n", "", scene("retaining-wall.md"), flags=re.M)
    script = re.sub(r"^travel.*", f"{travel}\n{T}", script, flags=re.M)
    for line in lines:  # in place of the line of this command, and of this fix
        start = re.escape(re.match(r"fix\(\w+|[a-z_]+", line)[0])
        script = re.sub(rf"^{start}\b.*", line, script, flags=re.M)
    script = re.sub(r"^run\(.*", lines[-1], script, flags=re.M)
    log = run_script(script, "-var", "way", str(way)).log
    half = log["Time"] > log["Time"].max() / 2
    assert log["K"][half].mean() == pytest.approx(K, rel=within)
    assert 0.87 < -way * log["wall_y"][half].mean() / log["wall_x"][half].mean() / 0.268 < 1


def test_an_excavation_loads_its_strut(run_script):
    """Force of the strut E A/L times its shortening, the motion of the wall (Hooke)."""
    text = (run_script(scene("excavation.md")).folder / "log.mpm").read_text("utf-8")
    rows = [line.split() for line in text.splitlines() if line[:1].isdigit()]
    before, end = (float(row[2]) for row in (rows[-6], rows[-1]))
    assert before > 1.5e-4 and end < 1e-4  # the strut is there while the wall goes back
    assert float(rows[-1][3]) == pytest.approx(1e9 * 0.5 / 3 * (before - end), rel=0.05)


@pytest.mark.full
def test_a_slope_stands_dry_and_fails_wet(run_script):
    moved = {}
    for below in ("dry", "wet"):
        toe = run_script(scene("wet-slope.md"), "-var", "below", below, folder=below).log["toe_x"]
        moved[below] = toe[-1] - toe[0]
    assert abs(moved["dry"]) < 0.2 < 3 < moved["wet"] < 4


@pytest.mark.full
def test_a_landslide_stops_where_friction_has_taken_its_energy(run_script, tmp_path):
    """Height over distance of its centre (Heim 1932): 0.25, and more by the work inside."""
    (tmp_path / "run").mkdir()
    for name in ("slip.asc", "surface.asc"):
        shutil.copy(INPUTS / name, tmp_path / "run")
    result = run_script(scene("landslide.md"))
    log = result.log
    assert log["Ek"][-1] < 1e-6 * log["Ek"].max()
    fallen, gone = log["at_z"][2] - log["at_z"][-1], log["at_x"][-1] - log["at_x"][2]
    assert 0.25 < fallen / gone < 0.29
    names = sorted(result.folder.glob("deposit.*.asc"), key=lambda p: int(p.name.split(".")[1]))
    first, last = (read_raster(name).heights.sum() for name in (names[0], names[-1]))
    assert last == pytest.approx(first, rel=0.02)
    ground, surface = (read_raster(INPUTS / name).heights for name in ("slip.asc", "surface.asc"))
    assert first == pytest.approx((surface - ground).sum(), rel=0.02)


@pytest.mark.full
def test_a_hopper_is_fed(run_script):
    """Mass of whole layers: density, width, speed and time."""
    log = run_script(scene("inflow.md")).log
    assert log["feed_mass"][-1] == 1600 * 0.2 * 0.5 * 2
    assert log["out_mass"][-1] > 200
