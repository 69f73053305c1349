"""How pictures of comparisons look: as charts of studies do, also in grey."""

from textwrap import fill
from typing import Any

import numpy as np
from cycler import cycler
from matplotlib.collections import EllipseCollection

from karamelo_py.app.studies import look
from karamelo_py.output.outlines import outlines, spacing
from karamelo_py.output.plots import real_ticks

# Black is what is exact or measured.
LINES = cycler(color=look.PALETTE[1:7]) + cycler(linestyle=look.DASHES)
STYLE = {"axes.prop_cycle": LINES, "legend.fontsize": 7, "legend.frameon": False}


def coloured(
    axes: Any, x: Any, y: Any, values: Any, name: str, bar: float = 0.04, cmap: str = "viridis",
    limits: tuple[float | None, float | None] = (None, None),
) -> None:  # fmt: skip
    """Points in the colours of a value, and a bar (so wide) that says what the colours mean.

    Disks that touch along the diagonals of a lattice: nothing shows between points.
    """
    places = np.column_stack([x, y])
    size = [np.sqrt(2) * spacing(places, 4)] * len(places)
    points = EllipseCollection(
        size, size, [0] * len(size), units="xy", offsets=places, offset_transform=axes.transData,
        array=np.asarray(values), linewidths=0, cmap=cmap,
    )  # fmt: skip
    points.set_clim(*limits)
    axes.add_collection(points)
    axes.autoscale_view()
    scale = axes.figure.colorbar(points, cax=axes.inset_axes((1 + 0.75 * bar, 0, bar, 1)))
    scale.set_label(name, fontsize=8)
    scale.ax.tick_params(labelsize=7)


def body(axes: Any, x: Any, y: Any, label: str) -> None:
    """A body of points in the plane: its outline, with a light inside."""
    drawn = None
    for line in outlines(np.column_stack([x, y])):
        (drawn,) = axes.plot(
            *line.T,
            color=drawn and drawn.get_color(),
            ls="-",
            lw=1.2,
            label=None if drawn else label,
        )
        axes.fill(*line.T, color="0.93", lw=0)


def finish(axes: Any, about: str) -> None:
    """A title, real numbers at the ticks, methods in their colours, a legend that hides nothing.

    The title is the first line of `about`, up to its colon: the body and what happens to it.
    """
    title = about.splitlines()[0].partition(":")[0].rstrip(".")
    axes.set_title(fill(title, 70), fontsize=9)
    named = {line: str(line.get_label()).partition(",")[0] for line in axes.get_lines()}
    styled = {word for family in look.FAMILIES for word in family}
    known = {line: word for line, word in named.items() if word in styled}
    for line, method in known.items() if len({*known.values()}) == len(known) else ():
        line.set_color(look.PALETTE[look.number(method) or -1])  # black is what is exact
    for axis, ends in ((axes.xaxis, axes.dataLim.intervalx), (axes.yaxis, axes.dataLim.intervaly)):
        if axis.get_scale() == "log":
            drawn = [a for line in axes.get_lines() for a in line.get_data()[axis is axes.yaxis]]
            look.log_axis(axis, *ends, drawn if all(float(a).is_integer() for a in drawn) else None)
        real_ticks(axis)
    marked = [line for line in axes.get_lines() if line.get_marker() == "o"]
    for line, mark in zip(marked, look.MARKERS, strict=False):
        line.set_marker(mark)
    if axes.get_legend_handles_labels()[0]:
        legend = axes.figure.legend(loc="outside lower center", ncols=3)
        for handle in legend.get_lines():
            handle.set_markersize(5)
    axes.figure.draw_without_rendering()  # a flat body leaves a part of its place empty
    used = 1 - axes.get_position(original=True).height + axes.get_position().height
    axes.figure.set_figheight(used * axes.figure.get_figheight())
