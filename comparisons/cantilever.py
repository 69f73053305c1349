"""Cantilever under a suddenly applied weight: lowest point, by CPDI and cpgimp."""

from comparisons.exact import minimum
from comparisons.row import Row

WYSER = "Wyser et al. 2020"
SMALL = None  # a coarser beam is another one
CPDI = {"kind": "ulcpdi", "domains": "Q4"}
CPGIMP = {"basis": "cpgimp", "domains": "stretch"}


def compare(run, axes, full):
    """With the law in rate form as published, and with the neo-Hookean one of the reference."""
    cases = {
        "CPDI": (CPDI | {"law": "linear"}, -3.310, 1.070, 0.002, WYSER),
        "cpgimp": (CPGIMP | {"law": "linear"}, -3.319, 1.065, 0.002, WYSER),
        "CPDI, neo-hookean": (CPDI, -3.28, 1.06, 0.01, "finite elements (Sadeghirad et al. 2011)"),
    }
    for name, (words, depth, moment, within, source) in cases.items():
        log = run(T=3 if name == "CPDI, neo-hookean" else 1.4, **words).log
        early = log.Time < 1.5
        when, lowest = minimum(log.Time[early], -log.tip_s[early])
        yield Row(f"lowest point, {name} (m)", depth, lowest, within, source)
        yield Row(f"time of the lowest point, {name} (s)", moment, when, within, source)
        axes.plot(log.Time, -log.tip_s, lw=1, label=name)
        axes.plot(moment, depth, "k+", ms=7, label="published" if name == "CPDI" else None)
    axes.set(xlabel="time (s)", ylabel="height of the lower corner (m)")
