"""Free rigid bodies in scenes of inputs/: exact solutions, experiments, published formulas."""

import re

import numpy as np
import pytest
from conftest import INPUTS

pytestmark = pytest.mark.xdist_group("rigid scenes")
FULL = pytest.mark.full


def late(log, name, since):
    """The mean of a column from a part of the run on."""
    return log[name][log.Time > since * log.Time[-1]].mean()


@pytest.mark.parametrize(("refine", "within"), [(1, 0.02), pytest.param(2, 0.03, marks=FULL)])
def test_a_heavy_disk_bends_a_beam(run_script, refine, within):
    """P L^3/(192 E I) and shear (Timoshenko 1921); weight, contact and supports balance."""
    log = run_script(INPUTS / "in.heavy_disk", "-var", "refine", f"{refine}").log
    assert late(log, "deflection", 0.9) == pytest.approx(log.exact[-1], rel=within)
    assert late(log, "d_fy", 0.9) == pytest.approx(2000, rel=0.01)
    assert late(log, "clamp_y", 0.9) == pytest.approx(2000, rel=0.05)


@pytest.mark.parametrize(
    ("change", "within"),
    [
        ({"refine = 1": "refine = 2/3"}, 0.1),
        pytest.param({}, 0.1, marks=FULL),
        pytest.param({"H      = 0.1": "H      = 0.03"}, 0.1, marks=FULL),
        pytest.param({"ball   = 7800": "ball   = 2500"}, 0.1, marks=FULL),
        pytest.param({"H      = 0.1": "H      = 0.3"}, 0.15, marks=FULL),
    ],
)
def test_a_ball_comes_to_rest_in_grains(run_script, change, within):
    """Depths measured by Uehara et al. 2003 scatter by about 10 % about their formula."""
    text = (INPUTS / "in.crater").read_text("utf-8")
    for old, new in change.items():
        assert old in text
        text = text.replace(old, new)
    log = run_script(text).log
    assert log.depth[-1] == pytest.approx(log.law[-1], rel=within)
    weight = late(log, "b_fy", 0.8) / 9.81 * 2 * np.pi
    density = 2500 if "2500" in str(change) else 7800
    assert weight == pytest.approx(density * np.pi / 6 * 0.0254**3, rel=0.1)


@pytest.mark.parametrize(
    ("refine", "mu"), [(0.75, 0), *(pytest.param(1, mu, marks=FULL) for mu in (0, 1))]
)
def test_a_t_bar_in_clay(run_script, refine, mu):
    """6 + pi if smooth, 4 sqrt(2) + 2 pi if rough (Randolph & Houlsby 1984)."""
    words = ("-var", "refine", f"{refine}", "-var", "mu", f"{mu}", "-var", "far", "0.15")
    exact = 4 * np.sqrt(2) + 2 * np.pi if mu else 6 + np.pi
    log = run_script(INPUTS / "in.penetrometer", *words).log
    assert late(log, "N", 0.6) == pytest.approx(exact, rel=0.07 if mu else 0.05)


@pytest.mark.parametrize("refine", [0.75, pytest.param(1, marks=FULL)])
def test_a_sphere_sinks_in_a_viscous_liquid(run_script, refine):
    """Stokes 1851 with walls (Haberman & Sayre 1958): as a sphere with half a cell more radius."""
    words = ("-var", "refine", f"{refine}", "-var", "T", "1.5")
    log = run_script(INPUTS / "in.sinking_sphere", *words).log
    speed = late(log, "speed", 0.8) / log.law[-1]
    assert 0.76 < speed < 0.88
    assert log.b_fy[-1] == pytest.approx(11 * 0.89 * 2 / 3, rel=0.02)  # its weight per radian


@pytest.mark.parametrize("refine", [1, pytest.param(1.5, marks=FULL)])
def test_a_projectile_goes_through_a_plate(run_script, refine):
    """181.1 m/s remain (Borvik et al. 2002), and of 350 what Recht & Ipson (1963) say."""
    remains, plug = [], 0.012 * np.pi * 0.01**2 * 7850
    for speed in (285.4, 350):
        words = ("-var", "refine", f"{refine}", "-var", "v", f"{speed}")
        result = run_script(INPUTS / "in.perforation", *words, folder=f"v{speed}")
        remains.append(-result.log.b_vy[-1])
        assert np.ptp(result.log.momentum) < 1e-8 * abs(result.log.momentum[0])
        lost = float(re.search(r"^ +energy +(\S+) %", result.out, re.M)[1])
        assert abs(lost) < 2
    assert remains[0] == pytest.approx(181.1, rel=0.06 if refine > 1 else 0.15)
    part = 0.197 / (0.197 + plug)
    limit = 285.4**2 - (remains[0] / part) ** 2
    assert remains[1] == pytest.approx(part * np.sqrt(350**2 - limit), rel=0.05)
