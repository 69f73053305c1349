"""Every combination of method, basis, transfer, scheme and kinematics runs or is refused.

All of them uncompiled, a pairwise selection compiled; all compiled with ``pytest -m full``.
"""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from combinations import (
    BASES,
    KINEMATICS,
    MESHED,
    SCHEMES,
    SPEED,
    TRANSFERS,
    dimension,
    fits,
    refused,
    scene,
    write_mesh,
)
from states import final_state, same_bits

CASES = [
    (kinematics, *base) for kinematics in KINEMATICS for base in BASES if fits(kinematics, base[2])
]


def named(case: tuple[str, ...]) -> str:
    return " ".join(part for part in case if part)


def pairwise(seed: int = 0) -> list[tuple[str, ...]]:
    """A small selection in which every pair of choices that runs occurs."""
    everything = [
        (*case, transfer, scheme)
        for case in CASES
        for transfer in TRANSFERS
        for scheme in SCHEMES
        if not refused(*case[1:], transfer, scheme)
    ]
    rng = np.random.default_rng(seed)
    rng.shuffle(everything)

    def pairs(case: tuple) -> set:
        parts = (case[0], case[1:4], case[4], case[5])
        return set(itertools.combinations(enumerate(parts), 2))

    missing = set().union(*map(pairs, everything))
    chosen = []
    while missing:
        best = max(everything, key=lambda case: len(pairs(case) & missing))
        chosen.append(tuple(map(str, best)))
        missing -= pairs(best)
    return chosen


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


@pytest.mark.parametrize("case", CASES, ids=named)
def test_uncompiled(case, state_interpreted, run_interpreted, tmp_path):
    """All combinations, interpreted, for two steps."""
    kinematics, kind, basis, option = case
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    for transfer, scheme in itertools.product(TRANSFERS, SCHEMES):
        text = scene(*case, transfer, scheme, mesh=mesh)
        if says := refused(kind, basis, option, transfer, scheme):
            result = run_interpreted(text, status=1)
            assert says in result.err and "hint: " in result.err
            continue
        check(state_interpreted(text), kinematics)


COMPILED = [pytest.param(case, id=named(case)) for case in pairwise()]


def compare(case, state_interpreted, tmp_path):
    """Compiled and interpreted, one and two threads."""
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
    assert dimension(case[0]) >= 1


SELECTION = COMPILED[:: max(1, len(COMPILED) // 2)]


@pytest.mark.parametrize("case", SELECTION)
def test_selection(case, state_interpreted, tmp_path):
    """Some of them, compiled; both numbers of threads give the same bits."""
    one = compare(case, state_interpreted, tmp_path)
    assert same_bits(one, final_state(tmp_path / "in.script", threads=2))
