"""Which of many combinations run always; ``pytest -m full`` runs the others, too."""

from collections.abc import Iterable, Sequence
from itertools import combinations
from random import Random
from typing import Any

import pytest


def covering(cases: Iterable[tuple], together: int = 1) -> tuple[list[tuple], list[tuple]]:
    """Split cases into few that have every choice that occurs, and the rest.

    Each case is a tuple of choices, of which so many occur `together`: with 2 it is every pair.
    Greedy: of the cases that bring most, the first of a shuffled list.
    """

    rest = list(cases)
    Random(0).shuffle(rest)
    number: dict[Any, int] = {}
    # What a case brings as bits of an integer: thousands of cases are compared.
    brings = {
        case: sum(
            1 << number.setdefault(part, len(number))
            for part in combinations(enumerate(case), together)
        )
        for case in rest
    }
    missing = (1 << len(number)) - 1
    chosen = []
    while missing:
        best = max(rest, key=lambda case: (brings[case] & missing).bit_count())
        chosen.append(best)
        rest.remove(best)
        missing &= ~brings[best]
    return chosen, rest


def few(values: Iterable, *kept: Any) -> list[Any]:
    """Values of one parameter: those that are kept run always, the others are marked ``full``."""
    return [v if v in kept else pytest.param(v, marks=pytest.mark.full) for v in values]


def parameters(chosen: Sequence[tuple], rest: Sequence[tuple]) -> list[Any]:
    """Parameters of a test, those of the rest marked ``full``."""
    return [*chosen, *(pytest.param(*case, marks=pytest.mark.full) for case in rest)]
