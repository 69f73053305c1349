"""docs/limits.md stays true: what it calls missing is refused, or has no style."""

import re
from pathlib import Path

import pytest

from karamelo_py.language import registry

PAGE = (Path(__file__).parent.parent / "docs" / "limits.md").read_text("utf-8")
ROWS = re.findall(r"^\| ([^|]+?) \| [^|]+ \|$", PAGE, re.M)[1:]
# What a row calls missing: styles that would end it, as (family, part of a name).
STYLES = {
    "separate points for soil": [("method", "two"), ("solid", "water")],
    "cracks in laminae": [("damage", "cohesive"), ("fix", "cohesive")],
    "ignition": [("eos", "ignition")],
    "UMAT": [("material", "umat")],
    "cracks": [("method", "dfg"), ("fix", "crack")],
}
# Lines that must be refused, after a domain in 2D.
LINES = {
    "grids refined": "refine_grid(0.05)",
}


def row_of(begin):
    return [row for row in ROWS if row.startswith(begin)]


@pytest.mark.parametrize("begin", STYLES)
def test_no_style_does_what_is_called_missing(begin):
    assert row_of(begin)
    for family, part in STYLES[begin]:
        assert not [name for name in registry.names(family) if part in name], (family, part)


@pytest.mark.parametrize("begin", LINES)
def test_lines_for_what_is_missing_are_refused(begin, run_interpreted):
    assert row_of(begin)
    domain = "method(ulmpm, FLIP, linear, 1)\ndimension(2, 0, 1, 0, 1, 0.25)\n"
    result = run_interpreted(domain + LINES[begin], status=1)
    assert "error" in result.err


def test_implicit_schemes_are_refused_on_a_gpu(run_script):
    script = """
        method(ulmpm, FLIP, linear, 1)
        scheme(quasi-static)
        dimension(2, 0, 1, 0, 1, 0.25)
        region(r, block, 0, 1, 0, 1)
        material(m, linear, 1000, 1e5, 0.3)
        solid(s, region, r, 2, m, 0.25)
        fix(g, body_force, all, 0, -1)
        run(1)
    """
    assert "quasi-static" in run_script(script, "--gpu", status=1).err


def test_computes_count_the_soil_alone(run_interpreted):
    assert row_of("[water in pores]")
    log = run_interpreted("""
        method(ulmpm, FLIP, linear, 1)
        dimension(1, 0, 3, 0.25)
        region(layer, block, 1, 2)
        material(clay, linear, 1590, 1e7, 0)
        pore_water(clay, n=0.4, permeability=1e-3)
        solid(clay, region, layer, 2, clay, 0.25)
        fix(v, initial_velocity_particles, all, 0.1)
        compute(p, linear_momentum, all)
        compute(k, kinetic_energy, all)
        log_modify(custom, p_x, k)
        run(1)
    """).log
    assert log["p_x"] == pytest.approx([159, 159])
    assert log["k"] == pytest.approx([7.95, 7.95])
