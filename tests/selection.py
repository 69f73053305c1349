"""Which of many combinations run always; ``pytest -m full`` runs the others, too."""

from collections.abc import Iterable, Sequence
from itertools import combinations
from random import Random
from typing import Any

import pytest


def covering(
    cases: Iterable[tuple],
) -> tuple[list[tuple], list[tuple]]:
    """Split cases into few that have every pair of choices that occurs, and the rest.

    Each case is a tuple of choices. Greedy: of the cases that bring most pairs, the first of a
    shuffled list.
    """

    rest = list(cases)
    Random(0).shuffle(rest)
    number: dict[Any, int] = {}
    # The pairs of a case as bits of an integer: thousands of cases are compared.
    brings = {
        case: sum(
            1 << number.setdefault(pair, len(number)) for pair in combinations(enumerate(case), 2)
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


def parameters(chosen: Sequence[tuple], rest: Sequence[tuple]) -> list[Any]:
    """Parameters of a test, those of the rest marked ``full``."""
    return [*chosen, *(pytest.param(*case, marks=pytest.mark.full) for case in rest)]
