"""Rigid strip that is pressed into clay: the load when it yields, against Prandtl."""

from __future__ import annotations

from comparisons.exact import prandtl_load
from comparisons.row import Row

SMALL = {}


def compare(run, axes, full):
    """Volumes averaged against locking; in full also not, where the load goes on rising."""
    limit = prandtl_load(1)
    cases = {"volumes averaged": ({}, limit, 0.05)}
    if full:
        cases["volumes not averaged"] = {"bar": "false"}, (1.15 * limit, 2 * limit), 0.0
    for name, (words, load, within) in cases.items():
        log = run(**words).log
        late = (log.Time > 0.7) & (log.Time < 0.99)
        source = "locks" if words else "Prandtl 1920 (exact)"
        yield Row(f"load / c, {name}", load, log.load[late].mean(), within, source)
        axes.plot(log.Time, log.load, lw=1, label=name)
    axes.axhline(limit, color="k", lw=1, ls="--", label="2 + pi")
    axes.set(xlabel="time (s)", ylabel="load / c")
