"""Every combination of method, basis, transfer, scheme and kinematics runs or is refused.

Interpreted: each combination with one of the kinematics in turn, with the others if ``-m full``.
Compiled: two, and a pairwise selection if ``-m full``.
"""

from itertools import product

import numpy as np
import pytest
from combinations import (
    BASES,
    KINEMATICS,
    MESHED,
    SCHEMES,
    SPEED,
    TRANSFERS,
    fits,
    refused,
    scene,
    write_mesh,
)
from selection import covering
from states import final_state

CASES = [
    (kinematics, *base) for kinematics in KINEMATICS for base in BASES if fits(kinematics, base[2])
]
WAYS = list(product(TRANSFERS, SCHEMES))
PAIRWISE = [
    (kinematics, *base, *way)
    for kinematics, base, *way in covering(
        (kinematics, tuple(base), *way)
        for kinematics, *base in CASES
        for way in WAYS
        if not refused(*base, *way)
    )[0]
]


def its_turn(case: tuple[str, ...]) -> list[tuple[str, str]]:
    """The ways that run with the kinematics of a case: each goes with one of those of its base."""
    kinematics, *base = case
    those = [k for k in KINEMATICS if fits(k, case[3])]
    place = those.index(kinematics) + BASES.index(tuple(base))
    return [way for k, way in enumerate(WAYS) if (k + k // len(SCHEMES) - place) % len(those) == 0]


def named(case: tuple[str, ...]) -> str:
    return " ".join(part for part in case if part)


def check(state: dict[str, np.ndarray], kinematics: str) -> None:
    """Mass and momentum are kept, nothing is infinite, and the body has moved."""
    mass, v = state["mass"], state["v"]
    assert all(np.isfinite(array).all() for array in state.values())
    assert state["nodal mass"] == pytest.approx(mass.sum(), rel=1e-13)
    first = 1 if kinematics == "axisymmetric" else 0  # radial momentum is not conserved
    momentum = mass @ v
    for k in range(first, v.shape[1]):
        assert momentum[k] == pytest.approx(mass.sum() * SPEED[k], rel=1e-12)
    assert state["time"] == pytest.approx([0.002, 2])


def run_ways(case, ways, state_interpreted, run_interpreted, tmp_path):
    """Run a case with transfers and schemes, or see that they are refused."""
    kinematics, kind, basis, option = case
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    for way in ways:
        text = scene(*case, *way, mesh=mesh)
        if says := refused(kind, basis, option, *way):
            result = run_interpreted(text, status=1)
            assert says in result.err and "hint: " in result.err
        else:
            check(state_interpreted(text), kinematics)


@pytest.mark.parametrize("case", CASES, ids=named)
def test_interpreted(case, state_interpreted, run_interpreted, tmp_path):
    """Two steps of every method, basis, transfer and scheme."""
    run_ways(case, its_turn(case), state_interpreted, run_interpreted, tmp_path)


@pytest.mark.full
@pytest.mark.parametrize("case", CASES, ids=named)
def test_interpreted_with_all_kinematics(case, state_interpreted, run_interpreted, tmp_path):
    """All the others."""
    ways = [way for way in WAYS if way not in its_turn(case)]
    run_ways(case, ways, state_interpreted, run_interpreted, tmp_path)


def test_every_way_has_its_turn():
    """With each base, every transfer and scheme runs once; each pair with a kinematics occurs."""
    turns = [(case, way) for case in CASES for way in its_turn(case)]
    assert sorted((case[1:], way) for case, way in turns) == sorted(product(BASES, WAYS))
    for part in (0, 1):
        met = {(case[0], way[part]) for case, way in turns}
        assert met == set(product(KINEMATICS, (TRANSFERS, SCHEMES)[part]))


COMPILED = [pytest.param(case, id=named(case)) for case in PAIRWISE]


def compare(case, state_interpreted, tmp_path):
    """Compiled and interpreted."""
    option = case[3]
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    text = scene(*case, mesh=mesh)
    script = tmp_path / "in.script"
    script.write_text(text)
    compiled = final_state(script)
    check(compiled, case[0])
    interpreted = state_interpreted(text)
    for name, array in compiled.items():
        scale = max(np.abs(array).max(), 1e-300)
        # Only the compiler's fused multiply-add makes a difference.
        assert np.abs(array - interpreted[name]).max() <= 1e-11 * scale, name
    return compiled


@pytest.mark.full
@pytest.mark.parametrize("case", COMPILED)
def test_pairwise(case, state_interpreted, tmp_path):
    """A selection with every pair of choices, compiled."""
    compare(case, state_interpreted, tmp_path)


# What other tests do not compile: the schemes usf and usavg, the transfers TPIC and AFLIP.
SELECTION = [
    ("axisymmetric", "tlmpm", "quadratic-spline", "", "TPIC", "usf"),
    ("line", "ulmpm", "cubic-spline", "", "AFLIP", "usavg"),
]


@pytest.mark.parametrize("case", SELECTION, ids=named)
def test_selection(case, state_interpreted, tmp_path):
    """Two of them, compiled. That threads make no difference, test_identical.py says."""
    compare(case, state_interpreted, tmp_path)
