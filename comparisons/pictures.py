"""How pictures of comparisons look: as charts of studies do, also in grey."""

from typing import Any

from cycler import cycler

from karamelo_py.app.studies import look
from karamelo_py.output.plots import real_ticks

# Black is what is exact or measured.
LINES = cycler(color=look.PALETTE[1:7]) + cycler(linestyle=look.DASHES)
STYLE = {"axes.prop_cycle": LINES, "legend.fontsize": 7, "legend.frameon": False}


def coloured(
    axes: Any, x: Any, y: Any, values: Any, name: str, bar: float = 0.04, **words: Any
) -> None:
    """Points in the colours of a value, and a bar (so wide) that says what the colours mean."""
    points = axes.scatter(x, y, c=values, linewidths=0, **words)
    scale = axes.figure.colorbar(points, cax=axes.inset_axes((1 + 0.75 * bar, 0, bar, 1)))
    scale.set_label(name, fontsize=8)
    scale.ax.tick_params(labelsize=7)


def finish(axes: Any, title: str) -> None:
    """A title, real numbers at the ticks, methods in their colours, a legend that hides nothing."""
    axes.set_title(title, fontsize=9)
    for line in axes.get_lines():
        method = str(line.get_label()).partition(",")[0]
        if any(method in family for family in look.FAMILIES):
            line.set_color(look.PALETTE[look.place(method)])
    for axis, ends in ((axes.xaxis, axes.dataLim.intervalx), (axes.yaxis, axes.dataLim.intervaly)):
        if axis.get_scale() == "log":
            look.log_axis(axis, *ends)
        real_ticks(axis)
    if axes.get_legend_handles_labels()[0]:
        axes.figure.legend(loc="outside lower center", ncols=3, markerscale=2)
