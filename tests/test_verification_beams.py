"""Beams and bars of inputs/ by many methods, against finite elements.

What is published about them is in comparisons/.
"""

import os
from dataclasses import replace
from pathlib import Path

import fem
import numpy as np
import pytest
from conftest import INPUTS, ROOT
from verification import (
    CPDI_Q,
    CPDI_R,
    LINEAR,
    STRETCH,
    TOTAL,
    TOTAL_BERNSTEIN,
    TOTAL_CPDI,
    TOTAL_CUBIC,
    UGIMP,
    run_scene,
    table,
)

from comparisons import exact
from karamelo_py.scene.meshes.reading import read

# A mesh of others, which lies beside the repository.
SHARED = Path(os.environ.get("KARAMELO_PY_SHARED", ROOT.parent / "shared")) / "reference" / "data"

# --- Cantilever, 2D -----------------------------------------------------------------------------


def lowest(log, until: float) -> tuple[float, float]:
    """(time, displacement) of the first minimum; the log has its size."""
    early = log.Time < until
    return exact.minimum(log.Time[early], -log.tip_s[early])


@pytest.fixture(scope="module")
def cantilever_witness():
    """Own finite elements, 32 x 8; the published curve is theirs within reading it off."""
    return fem.cantilever()


# Without published numbers, finite elements count.
# (way, root of the mean square of the distance from the curve in m)
SWING_BACK = [(CPDI_R, 0.25), (CPDI_Q, 0.25), (STRETCH, 0.25), (TOTAL, 0.1), (TOTAL_CPDI, 0.1)]


@pytest.mark.full
@pytest.mark.parametrize(("way", "most"), table(*SWING_BACK))
def test_cantilever_swings_back(run_script, cantilever_witness, way, most):
    """The curve of finite elements; of the swing of 3.3 m four cells over the height are a coarse
    beam. Found: 0.22 to 0.23 m in updated, 0.03 to 0.07 m in total Lagrangian methods.
    """
    log = run_scene(run_script, "cantilever", way).log
    time, tip = cantilever_witness
    expected = np.interp(log.Time, time, tip)
    assert np.sqrt(((log.tip_s - np.abs(expected)) ** 2).mean()) < most
    assert log.tip_s[log.Time > 2].min() < 0.15


@pytest.mark.full
def test_cantilever_with_the_linear_basis_does_not_swing_back(run_script, cantilever_witness):
    """It sinks about as deep as it should and then stays down by more than a metre (CFL 0.1).

    Points that cross cells in the bent, stretched and compressed fibres lose the stiffness.
    """
    log = run_scene(run_script, "cantilever", LINEAR).log
    time, tip = cantilever_witness
    assert lowest(log, 1.5)[1] == pytest.approx(tip[time < 1.5].min(), rel=0.03)
    late = (log.Time > 2.2) & (log.Time < 2.8)
    assert tip[(time > 2.2) & (time < 2.8)].max() > -0.05
    assert log.tip_s[late].min() > 0.5


# --- Cantilever of tetrahedra -------------------------------------------------------------------


def test_geometry_of_the_beam_gives_tetrahedra_of_its_volume():
    """4 x 1 x 1, exactly: its faces are flat."""
    pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
    mesh = read(INPUTS / "cantilever.geo", 3)
    corners = mesh.points[np.concatenate([c.nodes for c in mesh.cells if c.type == "tetra"])]
    edges = corners[:, 1:] - corners[:, :1]
    volumes = np.linalg.det(edges) / 6
    assert 400 < len(volumes) < 1500
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(4, rel=1e-9)


@pytest.mark.full
def test_cantilever_of_tetrahedra(run_script, cantilever_witness):
    """The elements near the lower edge sink as finite elements do, within 6 %.

    Their mean lies up to 0.15 m behind the end: 4 % of the length.
    """
    log = run_scene(run_script, "cantilever_tets", None).log
    time, tip = cantilever_witness
    assert lowest(log, 1.5)[1] == pytest.approx(tip[time < 1.5].min(), rel=0.06)
    assert log.tip_s[log.Time > 2].min() < 0.3


@pytest.mark.full
@pytest.mark.parametrize(
    ("refine", "transfer", "alpha"), [(1, "FLIP", 1), (2, "FLIP", 1), (4, "APIC", "mechanical")]
)
def test_cantilever_of_1041_tetrahedra(run_script, cantilever_witness, refine, transfer, alpha):
    """The mesh and the three grids of Sinaie et al. 2017: 3.07, 3.16 and 3.16 m, found 3.29.

    Four hundredths are the place (see above), the rest of the first is its cell, a quarter of the
    depth wide. On the finest grid FLIP tangles a domain at 1.98 s, on the way back.
    """
    mesh = SHARED / "cantilever_1041_tets.msh"
    if not mesh.exists():
        pytest.skip(f"no {mesh}: that mesh is not part of the repository")
    words = {"mesh": mesh, "refine": refine, "transfer": transfer, "alpha": alpha}
    log = run_scene(run_script, "cantilever_tets", None, **words).log
    time, tip = cantilever_witness
    assert lowest(log, 1.5)[1] == pytest.approx(tip[time < 1.5].min(), rel=0.07)


# --- Vertical bar -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def bar_witness():
    """Own finite elements; a published curve is 3 % deeper (see test_exact)."""
    return fem.vertical_bar()


HOLD = [
    (TOTAL_CUBIC,),
    (TOTAL_BERNSTEIN,),
    (replace(CPDI_R, domains="R8"),),
    (replace(CPDI_Q, domains="H8"),),
    (replace(TOTAL_CPDI, domains="R8"),),
]


@pytest.mark.full
@pytest.mark.parametrize(("way",), table(*HOLD))
def test_vertical_bar_holds_together_by_other_methods(run_script, bar_witness, way):
    """Eight cells; the scene itself, by tlmpm with linear functions, is in comparisons/."""
    log = run_scene(run_script, "vertical_bar", way, refine=2).log
    moment, depth = exact.minimum(*bar_witness)
    found_moment, found = lowest(log, 0.15)
    assert found == pytest.approx(depth, rel=0.02)
    assert found_moment == pytest.approx(moment, rel=0.05)


@pytest.mark.full
@pytest.mark.parametrize(("way",), table((LINEAR,), (UGIMP,)))
def test_vertical_bar_breaks(run_script, way):
    """Points farther apart than a function reaches lose sight of each other and fall freely."""
    result = run_scene(run_script, "vertical_bar", way, status=1)
    assert "leaves the domain" in result.err
    assert result.log.tip_s.max() > 2.2  # 1.66 m where the bar holds
