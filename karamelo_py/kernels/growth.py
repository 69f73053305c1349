"""Growth of energy, defined once: for the watch over a run, for stability maps and for `-keeps`.

Energy grows by how much its mean over a later stretch of a run exceeds that over the first one, as
a share of a unit. Means, since a single look (or row of a log) shows the shortest waves, too, and
where bodies meet what is not there. The watch knows the work of loads, and what of the energy is
drift: its unit is the largest energy that there was by then, less drift, so that what is loaded
from rest has one. A log has a column alone: there the unit is the mean over the first stretch.
"""

WITHIN = 0.1  # of the unit: more growth than that since the start is told, and is not kept


def growth(first, later, unit):
    """Share of the unit by which a later mean exceeds the first."""
    return (later - first) / unit


def keeps(first, later, unit, within=WITHIN):
    """Compare growth with a share of the unit; NaN is not kept."""
    return later - first <= within * unit
