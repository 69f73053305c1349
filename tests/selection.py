"""Which of many combinations run always; ``pytest -m full`` runs the others, too."""

from collections.abc import Iterable, Sequence
from heapq import heapify, heappop, heapreplace
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
    # What a case brings only falls: one that brings the most by its last count, and still does,
    # brings most.
    counts = [(-brings[case].bit_count(), k) for k, case in enumerate(rest)]
    heapify(counts)
    chosen = []
    while missing:
        _, k = counts[0]
        now = -(brings[rest[k]] & missing).bit_count(), k
        if heapreplace(counts, now) == now == counts[0]:
            heappop(counts)
            chosen.append(k)
            missing &= ~brings[rest[k]]
    others = set(range(len(rest))) - set(chosen)
    return [rest[k] for k in chosen], [rest[k] for k in sorted(others)]


def few(values: Iterable, *kept: Any) -> list[Any]:
    """Values of one parameter: those that are kept run always, the others are marked ``full``."""
    return [v if v in kept else pytest.param(v, marks=pytest.mark.full) for v in values]


def parameters(chosen: Sequence[tuple], rest: Sequence[tuple]) -> list[Any]:
    """Parameters of a test, those of the rest marked ``full``."""
    return [*chosen, *(pytest.param(*case, marks=pytest.mark.full) for case in rest)]
