"""load_path and element: one point of a material against closed forms, and what is refused."""

import re
from itertools import pairwise

import numpy as np
import pandas
import pytest
from conftest import INPUTS

from comparisons.results import read_log
from karamelo_py.run import element

K, G, Y = 160e9, 80e9, 400e6
E = 9 * K * G / (3 * K + G)
NU = (3 * K - 2 * G) / (2 * (3 * K + G))
STEEL = f"""
eos(bulk, linear, 7850, {K})
strength(mild, plastic, {G}, {Y})
material(steel, eos-strength, bulk, mild)
"""


@pytest.fixture(autouse=True)
def drawn_by_the_example_alone(request, monkeypatch):
    """A picture takes longer than most of the tests."""
    if request.node.name != "test_the_example":
        monkeypatch.setattr(element.Response, "draw", lambda *_: None)


@pytest.fixture
def answer(run_script):
    """``answer(script, ID)``: the table of an element after a script."""

    def run(script, ID):
        return read_log(run_script(script).folder / f"element_{ID}.txt")

    return run


def test_the_example(run_script, monkeypatch):
    """inputs/in.element: every closed form to the second order of strains of one per cent."""
    drawn, save = [], element.savefig

    def kept(figure, path):
        drawn.append(figure)
        save(figure, path)

    monkeypatch.setattr(element, "savefig", kept)
    result = run_script(INPUTS / "in.element")
    assert len(drawn) == 6
    for figure in drawn:  # labels do not touch
        for axes in figure.axes:
            lo, hi = axes.get_xlim()
            shown = [t for t in axes.get_xticklabels() if lo <= t.get_position()[0] <= hi]
            boxes = [label.get_window_extent() for label in shown]
            assert all(a.x1 < b.x0 for a, b in pairwise(boxes))
    assert result.err == ""
    assert "Young's modulus of steel, E = 205714285714" in result.out
    assert "element shear: steel (eos-strength: linear, plastic), plane-strain" in result.out

    def table(ID):
        assert not re.search(r"-0\s", (result.folder / f"element_{ID}.txt").read_text())
        assert (result.folder / f"element_{ID}.png").read_bytes().startswith(b"\x89PNG")
        return read_log(result.folder / f"element_{ID}.txt")

    t = table("tension")
    elastic = (t.time <= 1) & (t.exx < 0.99 * Y / E)
    assert np.polyfit(t.exx[elastic], t.sxx[elastic], 1)[0] == pytest.approx(E, rel=1e-3)
    assert t.eyy[elastic] == pytest.approx(-NU * t.exx[elastic], rel=2e-3)
    assert np.abs(t.syy).max() < 1e-6 * Y and np.abs(t.szz).max() < 1e-6 * Y
    assert t.q.max() == pytest.approx(Y, rel=1e-9)
    assert t.sxx[t.time == 1] == pytest.approx([Y], rel=1e-9)
    # Released along E, without further plastic strain; back on the same line to the same yield.
    [before], [after] = np.flatnonzero(t.time == 1), np.flatnonzero(t.time == 2)
    assert t.sxx[after] == pytest.approx(0, abs=1e-6 * Y)
    assert t.exx[before] - t.exx[after] == pytest.approx(Y / E, rel=2e-3)
    assert t.ep[before] == t.ep[after] == pytest.approx(0.01 - Y / E, rel=2e-3)
    assert t.ep[-1] == pytest.approx(0.02 - Y / E, rel=2e-3)
    # What is not given back was Y times the plastic strain.
    assert t.work[-1] - t.stored[-1] == pytest.approx(Y * t.ep[-1], rel=5e-3)

    t = table("triaxial")
    assert t.p[t.time == 1] == pytest.approx([1e8], rel=1e-9)
    assert t.J[t.time == 1] == pytest.approx([1 - 1e8 / K], rel=1e-9)
    assert t.syy[t.time >= 1] == pytest.approx(np.full(201, -1e8), rel=1e-6)
    assert t.sxx[-1] == pytest.approx(-1e8 - Y, rel=1e-9)
    assert t.p[-1] == pytest.approx(1e8 + Y / 3, rel=1e-9)

    t = table("oedometer")
    below = np.abs(t.exx) < 0.99 * Y / (2 * G)
    slopes = [np.polyfit(t.exx[part], t.sxx[part], 1)[0] for part in (below, ~below)]
    assert slopes == pytest.approx([K + 4 / 3 * G, K], rel=1e-2)
    assert t.sxx[-1] == pytest.approx(-2 / 3 * Y - K * (1 - t.J[-1]), rel=1e-8)

    t = table("shear")
    assert t.sxy[1] == pytest.approx(G * 1e-4, rel=1e-6)
    assert t.sxy[-1] == pytest.approx(Y / np.sqrt(3), rel=1e-3)  # the rest is normal stress
    assert t.q[-1] == pytest.approx(Y, rel=1e-9)

    t = table("turned")
    assert t.syy[-1] == pytest.approx(t.sxx[t.time == 1][0], rel=1e-9)
    assert abs(t.sxx[-1]) < 1e-6 * Y and t.J[-1] == pytest.approx(t.J[20], rel=1e-9)

    t = table("rubber")
    lam, g = 1e6 * 0.3 / (1.3 * 0.4), 1e6 / 2.6
    a = (1 + np.log(2) / 1000) ** 1000
    bb = t.J[-1] / a  # square of the stretch across, at which there is no stress across
    assert g * (bb - 1) + lam * np.log(a * bb) == pytest.approx(0, abs=1e-3)  # of 1e6
    assert t.sxx[-1] == pytest.approx((g * (a * a - 1) + lam * np.log(a * bb)) / (a * bb))
    # The work of conservative forces is what is stored.
    assert t.work[-1] == pytest.approx(t.stored[-1], rel=1e-3)


def test_the_table_is_read_as_the_log_is(run_script):
    folder = run_script(
        STEEL + "load_path(a, 3, exx=-1e-3)\nelement(one, steel, a, kinematics=1D)\n"
    ).folder
    path = folder / "element_one.txt"
    frame = pandas.read_csv(path, sep=r"\s+")
    columns = "time exx eyy ezz sxx syy szz p q J stored work ep dissipated"
    assert list(frame) == columns.split()
    assert np.loadtxt(path, skiprows=1) == pytest.approx(frame.to_numpy())


def test_plane_strain_and_uniaxial_stress(answer):
    """syy = 0 in plane strain: sxx = E/(1 - nu^2) exx, szz = nu sxx."""
    t = answer(
        STEEL + "load_path(a, 5, exx=1e-5, syy=0)\nelement(s, steel, a, kinematics=plane-strain)",
        "s",
    )
    assert t.sxx[-1] == pytest.approx(E / (1 - NU**2) * 1e-5, rel=1e-4)
    assert t.szz[-1] == pytest.approx(NU * t.sxx[-1], rel=1e-4)


def test_volume_is_shared_by_the_strains_that_are_not_named(answer):
    t = answer(
        STEEL + "load_path(a, 5, exx=-3e-4, volumetric=0)\nload_path(b, 4, volumetric=-3e-4)\n"
        "element(u, steel, a, b)",
        "u",
    )
    assert t.eyy[5] == t.ezz[5] == pytest.approx(1.5e-4)
    assert t.p[5] == pytest.approx(0, abs=1e-3 * G * 3e-4)
    assert [t.exx[-1], t.eyy[-1], t.ezz[-1]] == pytest.approx([-4e-4, 0.5e-4, 0.5e-4])
    assert t.p[-1] == pytest.approx(K * 3e-4, rel=1e-3)


@pytest.mark.parametrize("law", ["linear, 1, 1e6, 0.3", "neo-hookean, 1, 1e6, 0.3"])
def test_a_turn_takes_the_stress_along(answer, law):
    """Tension, then a quarter of a turn; without a rate that turns, the stress stays behind."""
    script = "load_path(a, 10, exx=0.1, syy=0, szz=0)\nload_path(b, 90, turn=PI/2)\n"
    t = answer(f"material(m, {law})\n{script}element(t, m, a, b)", "t")
    assert t.syy[-1] == pytest.approx(t.sxx[10], rel=1e-6)
    assert abs(t.sxx[-1]) < 1e-6 * t.syy[-1]
    t = answer(f"material(m, linear, 1, 1e6, 0.3, rate=none)\n{script}element(t, m, a, b)", "t")
    assert t.sxx[-1] == pytest.approx(t.sxx[10], rel=1e-9)


def test_pure_and_simple_shear_differ_by_a_turn(answer):
    """neo-Hookean: simple shear by g gives sxy = G g exactly, and sxx = G g^2."""
    t = answer(
        "material(m, neo-hookean, 1, 2.6, 0.3)\nload_path(a, 7, gxy=0.7)\n"
        "load_path(b, 7, exy=0.35)\nelement(s, m, a)\nelement(p, m, b)",
        "s",
    )
    assert t.sxy[-1] == pytest.approx(0.7)
    assert t.sxx[-1] == pytest.approx(0.49)
    assert t.syy[-1] == pytest.approx(0, abs=1e-12)
    assert t.exy[-1] == pytest.approx(0.35)


def test_what_a_law_offers_is_a_column(answer):
    """Scalars that only some laws have: there where the law has them, else not."""
    path = "load_path(a, 20, exx=0.01, syy=0, szz=0)\n"
    plain = answer(STEEL + path + "element(s, steel, a)", "s")
    assert "ep" in plain and "T" not in plain and "damage" not in plain
    hot = (
        "temperature(heat, plastic_work, 0.9, 500, 50, 0, 300, 1800)\n"
        "damage(cracks, damage_johnson_cook, 0.05, 3.44, -2.12, 0.002, 0.61, 1, 300, 1800)\n"
        "material(hot, eos-strength, bulk, mild, cracks, heat)\n"
    )
    t = answer(STEEL + hot + path + "element(s, hot, a)", "s")
    # Nine tenths of the plastic work become heat.
    assert t.T[-1] == pytest.approx(300 + 0.9 * t.dissipated[-1] / (7850 * 500), rel=1e-6)
    assert (t.damage == 0).all()


def test_rate_of_the_path(answer):
    t = answer(STEEL + "load_path(a, 4, exx=1e-4, duration=2)\nelement(s, steel, a, a)", "s")
    assert t.time == pytest.approx(np.arange(9) / 2)


def test_a_stress_beyond_yield_is_not_found(run_script):
    """Which path, which increment, and the files show the way there."""
    script = STEEL + "load_path(over, 100, sxx=500e6, syy=0, szz=0)\nelement(s, steel, over)\n"
    result = run_script(script, status=1)
    for words in ("load path 'over'", "increment 81 of 100", "sxx = 4e+08", "^^^^", "hint: "):
        assert words in result.err
    assert read_log(result.folder / "element_s.txt").sxx[-1] == pytest.approx(Y)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("load_path(a, 2, exx=1, sxx=0)", "strain and stress of the component xx are both"),
        ("load_path(a, 2, gxy=1, exy=0)", "gxy and exy are the same strain"),
        ("load_path(a, 2, volumetric=0, sxx=0)", "sxx are both prescribed"),
        ("load_path(a, 2, volumetric=0, exx=0, eyy=0, ezz=0)", "the volume follows from them"),
        ("load_path(a, 2, exx=0, volumetric=0)\nelement(b, steel, a, kinematics=1D)",
         "every normal strain that 1D has"),
        ("load_path(a, 0, exx=0)", "'increments' must be a whole number above 0"),
        ("load_path(a, 2, exx=0)\nelement(b, lead, a)", "unknown material 'lead'"),
        ("element(b, steel, a)", "unknown load path 'a'"),
        ("load_path(a, 2, szz=0)\nelement(b, steel, a, kinematics=plane-strain)",
         "plane-strain has no strain ezz"),
        ("load_path(a, 2, turn=1)\nelement(b, steel, a, kinematics=1D)", "1D cannot rotate"),
        ("load_path(a, 2, exx=0)\nelement(b/c, steel, a)", "formulas could not name the values"),
        ("load_path(a, 2)", "no strain and no stress is prescribed"),
        ("load_path(a, 2, syx=0)", "did you mean 'sxy'?"),
        ("material(tool, rigid, 1)\nload_path(a, 2, exx=0)\nelement(b, tool, a)",
         "material 'tool' is rigid"),
        ("material(wood, orthotropic, 1, 9, 9, 1, 0, 0, 0, 5, 4, 3)\nload_path(a, 2, exx=0)\n"
         "element(b, wood, a, kinematics=uniaxial-stress)", "not the same in y and z"),
        # What follows from a wrong line is not told.
        ("load_path(a, 0, ezz=-0.1)\nelement(b, steel, a)\nprint(value(b_exx))",
         "'increments' must be a whole number above 0"),
        ("load_path(a, 1, exx=-2)\nelement(b, steel, a)", "turned inside out"),
    ],
)  # fmt: skip
def test_what_is_refused(run_script, lines, says):
    result = run_script(STEEL + lines + "\n", status=1)
    assert says in result.err
    assert result.err.count("error:") == 1 and "^" in result.err


def test_check_writes_nothing(run_script, tmp_path):
    from karamelo_py.app.cli import main

    script = tmp_path / "in.check"
    used = "modulus = value(b_sxx/b_exx)\nmaterial(other, neo-hookean, 1000, modulus, 0.3)\n"
    script.write_text(STEEL + "load_path(a, 2, exx=1e-3)\nelement(b, steel, a)\n" + used)
    assert main(["check", str(script)]) == 0
    assert not list(tmp_path.glob("element_*"))


TANGENT = (
    STEEL
    + """
load_path(press, 10, exx=-0.01)
element(pressed, steel, press, kinematics=plane-strain, tangent=true)
"""
)


def test_the_tangent_of_steel_that_flows(run_script):
    """Uniaxial flow changes the pressure alone: K J before the step; shear has G Y/q of the trial.

    The deviator after the step is that before it, so that q = Y + 2 G |e| of the trial.
    """
    lines = run_script(TANGENT).out.splitlines()
    (at,) = [k for k, line in enumerate(lines) if line.split() == ["exx", "eyy", "gxy"]]
    rows = {
        line.split()[0]: [float(x) for x in line.split()[1:]] for line in lines[at + 1 : at + 5]
    }
    for name in ("sxx", "syy", "szz"):
        assert rows[name][0] == pytest.approx(K * 0.999**9, rel=2e-6)
    assert rows["sxy"] == [0, 0, pytest.approx(G * Y / (Y + 2 * G * 1e-3), rel=2e-6)]
