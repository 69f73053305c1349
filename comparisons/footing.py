"""Rigid strip pressed into clay: limit load against Prandtl's."""

from math import radians

from comparisons.exact import prandtl_load
from comparisons.row import Row

SMALL = {}


def compare(run, axes, full):
    """Volumes averaged against locking; in full also not, where the load goes on rising."""
    limit = prandtl_load(1)
    cases = {"F-bar": ({}, limit, 0.05)}
    if full:
        words = {"phi": 20, "v": 0.16}
        cases["friction and dilatancy of 20 degrees"] = words, prandtl_load(1, radians(20)), 0.08
        cases["without F-bar"] = {"bar": "false"}, (1.15 * limit, 2 * limit), 0.0
    for name, (words, load, within) in cases.items():
        log = run(**words).log
        late = (log.Time > 0.7) & (log.Time < 0.99)
        source = "locks" if "bar" in words else "Prandtl 1920 (exact)"
        yield Row(f"load / cohesion, {name}", load, log.load[late].mean(), within, source)
        (line,) = axes.plot(log.Time, log.load, lw=1.2, label=name)
        if "bar" not in words:
            axes.axhline(load, color=line.get_color(), lw=0.9, ls=":", label=f"exact, {name}")
    axes.set(xlabel="time (s)", ylabel="load / cohesion")
