"""Every combination of method, basis, transfer, scheme and kinematics runs or is refused.

Interpreted: a selection with every choice, and each refusal once; all if ``-m full``.
Compiled: two, and a selection with every pair of choices if ``-m full``.
"""

from itertools import combinations, product

import numpy as np
import pytest
from combinations import (
    BASES,
    KINEMATICS,
    MESHED,
    ROUND,
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


def selected(together: int) -> list[tuple[str, ...]]:
    """Few combinations in which all choices, so many of them `together`, occur."""
    possible = (
        (kinematics, tuple(base), *way)
        for kinematics, *base in CASES
        for way in WAYS
        if not refused(*base, *way)
    )
    chosen, _ = covering(possible, together)
    return [(kinematics, *base, *way) for kinematics, base, *way in chosen]


PAIRWISE, SELECTED = selected(2), set(selected(1))


def those_of(case: tuple[str, ...]) -> list[str]:
    """The kinematics that its base fits."""
    return [kinematics for kinematics in KINEMATICS if fits(kinematics, case[3])]


def always(case: tuple[str, ...]) -> list[tuple[str, str]]:
    """The ways that run always: those of the selection and, with its first kinematics, refusals."""
    first = case[0] == those_of(case)[0]
    return [
        way for way in WAYS
        if (*case, *way) in SELECTED or (first and refused(*case[1:], *way))
    ]  # fmt: skip


def named(case: tuple[str, ...]) -> str:
    return " ".join(part for part in case if part)


def check(state: dict[str, np.ndarray], kinematics: str) -> None:
    """Mass and momentum are kept, nothing is infinite, and the body has moved."""
    mass, v = state["mass"], state["v"]
    assert all(np.isfinite(array).all() for array in state.values())
    assert state["nodal mass"] == pytest.approx(mass.sum(), rel=1e-13)
    first = 1 if kinematics in ROUND else 0  # radial momentum is not conserved
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
    """Two steps of every method, basis and kinematics, each with every transfer and scheme."""
    run_ways(case, always(case), state_interpreted, run_interpreted, tmp_path)


@pytest.mark.full
@pytest.mark.parametrize("case", CASES, ids=named)
def test_interpreted_in_all_ways(case, state_interpreted, run_interpreted, tmp_path):
    """All the others."""
    ways = [way for way in WAYS if way not in always(case)]
    run_ways(case, ways, state_interpreted, run_interpreted, tmp_path)


def test_every_pair_is_met():
    """Every choice runs, every pair of them if ``-m full``; what is refused is tried once."""
    met: dict[int, set] = {1: set(), 2: set()}
    there: dict[int, set] = {1: set(), 2: set()}
    tried = []
    for case, way in product(CASES, WAYS):
        if refused(*case[1:], *way):
            tried += [(*case[1:], *way)] * (way in always(case))
            continue
        choices = case[0], case[1:], *way
        for together, runs in ((1, way in always(case)), (2, (*case, *way) in PAIRWISE)):
            found = set(combinations(enumerate(choices), together))
            there[together] |= found
            met[together] |= found if runs else set()
    assert met == there
    refusals = [(*base, *way) for base, way in product(BASES, WAYS) if refused(*base, *way)]
    assert sorted(tried) == sorted(refusals)


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
