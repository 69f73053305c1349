"""Plots of logged quantities, and the style of all plots."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import floor, log10
from pathlib import Path
from typing import Any

from karamelo_py.language.scene import Scene
from karamelo_py.output.files import savefig
from karamelo_py.output.quantity import Quantity
from karamelo_py.output.rhythm import ByTime, Rhythmic
from karamelo_py.output.units import labelled
from karamelo_py.script.errors import Mark


@dataclass(eq=False)
class PlottedCurve(Rhythmic):
    remembers = ("points",)

    every: int | ByTime
    x: Quantity
    y: Quantity
    side: str = "left"
    scale: str = "linear"
    label: str | None = None

    def __post_init__(self) -> None:
        self.points: list[tuple[float, float]] = []
        self.id = self.y.name

    def write(self) -> None:
        self.points.append((float(self.x.read()), float(self.y.read())))


class Plots(dict[str, PlottedCurve]):
    def __init__(self, hub: Scene):
        super().__init__()
        self.hub = hub
        self.file: Path | None = None
        self.style = ""
        self.mark: Mark | None = None

    def add(self, ID: str, curve: PlottedCurve) -> None:
        curve.id = ID
        self[ID] = curve

    def finish(self) -> None:
        curves = [curve for curve in self.values() if curve.points]
        if self.file is not None and curves:
            draw(curves, self.hub.folder / self.file, self._labelled)

    def _labelled(self, name: str) -> str:
        units = self.hub.output.units
        parts = {**self.hub.fixes, **self.hub.computes}
        return labelled(name, units.of_value(name, parts)) if units else name


def draw(curves: list[PlottedCurve], path: Path, labelled: Callable[[str], str] = str) -> None:
    by_x: dict[str, list[PlottedCurve]] = {}
    for curve in curves:
        by_x.setdefault(curve.x.name, []).append(curve)
    figure = blank_figure(6.4, 3.8 * len(by_x))
    all_axes = figure.subplots(len(by_x), 1, squeeze=False)[:, 0]
    for axes, (x_name, over_x) in zip(all_axes, by_x.items(), strict=True):
        axes.set_xlabel(labelled(x_name))
        tidy(axes)
        lines: list[Any] = []
        for side in ("left", "right"):
            chosen = [curve for curve in over_x if curve.side == side]
            lines += _over_one_axis(axes, side, chosen, len(lines), labelled) if chosen else []
        above = {"loc": "lower left", "bbox_to_anchor": (0, 1), "ncols": 4}
        axes.legend(handles=lines, **above, frameon=False, fontsize="small")
    savefig(figure, path)


def _over_one_axis(
    axes: Any, side: str, curves: list[PlottedCurve], first: int, labelled: Callable[[str], str]
) -> list:
    if side == "right":
        axes = axes.twinx()
        axes.spines[["top", "left"]].set_visible(False)
    lines = []
    for k, curve in enumerate(curves, first):
        x, y = zip(*curve.points, strict=True)
        marker = "o" if len(x) < 3 else None
        label = f"{curve.id} (right)" if side == "right" else curve.id
        lines += axes.plot(x, y, color=f"C{k}", label=label, linewidth=1.4, marker=marker)
    labels = (curve.label or labelled(curve.y.name) for curve in curves)
    axes.set_ylabel(", ".join(dict.fromkeys(labels)))
    axes.margins(x=0.01)
    if any(curve.scale == "log" for curve in curves):
        axes.set_yscale("log", nonpositive="mask")
    return lines


def blank_figure(width: float, height: float) -> Any:
    # Importing Matplotlib takes 0.3 s.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def in_mathtext(lead: str, exponent: int) -> str:
    """Format lead x 10^exponent, without a `lead` of 1."""
    return rf"${lead}\cdot10^{{{exponent}}}$" if lead else f"$10^{{{exponent}}}$"


def tick_texts(numbers: Sequence[float], power: Callable = in_mathtext) -> list[str]:
    """Format all numbers of an axis in one way: either like 0.02, 500 or like 10^-7, 3·10^-7."""
    plain = all(a == 0 or 1e-4 <= abs(a) < 1e5 for a in numbers)
    return [f"{a:g}" if plain or a == 0 else power(*_parts(a)) for a in numbers]


def _parts(a: float) -> tuple[str, int]:
    exponent = floor(log10(abs(a)) + 1e-9)
    lead = a / 10**exponent
    return "" if abs(lead - 1) < 1e-9 else f"{lead:g}", exponent


def real_ticks(axis: Any) -> None:
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    class WholeNumbers(ScalarFormatter):
        def __call__(self, x: float, pos: int | None = None) -> str:
            assert self.axis is not None
            largest = abs(self.axis.get_view_interval()).max()
            if largest == 0 or 1e-3 <= largest < 1e5:
                return super().__call__(x, pos)
            whole = float(f"{x / largest:.12f}") * largest
            return in_mathtext(*_parts(whole)) if whole else "0"

    if type(axis.get_major_formatter()) is ScalarFormatter:
        whole = WholeNumbers(useOffset=False)
        whole.set_scientific(False)
        axis.set_major_formatter(whole)
        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10]))


def tidy(axes: Any) -> None:
    real_ticks(axes.xaxis)
    real_ticks(axes.yaxis)
    axes.grid(True, color="0.9", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
