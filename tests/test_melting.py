"""What always melts into its callers is not compiled on its own."""

from __future__ import annotations

import pytest
from numba import config, njit

from karamelo_py.compiler import melting
from karamelo_py.compiler.compile import kernel, shared


@shared
def doubled(x):
    return 2 * x


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_what_melts(monkeypatch):
    """A helper of point functions melts; a kernel, and a function of anybody else, do not."""
    seen = {}
    melts = melting.melts

    def watched(library):
        seen[library.name] = melts(library)
        return seen[library.name]

    monkeypatch.setattr(melting, "melts", watched)

    @njit
    def plain(x):
        return x + 1

    def called(x):
        return doubled(x) + 1

    assert plain(1) == 2
    assert kernel(called)(3) == 7
    names = {name.rpartition(".")[2]: result for name, result in seen.items()}
    assert names["doubled"]
    assert not names["called"]
    assert not names["plain"]
