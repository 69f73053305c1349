"""Plots of logged quantities against each other, drawn with Matplotlib when a run ends."""

from pathlib import Path
from typing import Any

from karamelo_py.language.scene import Scene
from karamelo_py.output.files import FORMATS, savefig
from karamelo_py.output.plot_style import blank_figure, tidy
from karamelo_py.output.quantity import Quantity
from karamelo_py.output.rhythm import Rhythmic
from karamelo_py.output.units import labelled
from karamelo_py.script.errors import Place

__all__ = ["FORMATS", "Plots", "PlottedCurve"]


class PlottedCurve(Rhythmic):
    """One curve: `y` against `x`, a point at every `every` steps.

    `side` is that of the axis of y, left or right; `scale` is linear or log.
    """

    remembers = ("points",)

    def __init__(
        self, every: int, x: Quantity, y: Quantity, side: str = "left", scale: str = "linear"
    ):
        self.every = every
        self.x = x
        self.y = y
        self.side = side
        self.scale = scale
        self.points: list[tuple[float, float]] = []
        self.last_step: int | None = None
        self.id = y.name
        self.place: Place | None = None

    def write(self) -> None:
        """Collect the point of the present state."""
        self.points.append((float(self.x.read()), float(self.y.read())))


class Plots(dict[str, PlottedCurve]):
    """The curves of a scene by their IDs, and the file they are drawn to.

    Curves over the same quantity share one pair of axes; each further quantity gets axes of its
    own below. Without a file the curves are collected only.
    """

    def __init__(self, hub: Scene):
        super().__init__()
        self.hub = hub
        self.file: Path | None = None
        self.place: Place | None = None  # of save_plot

    def add(self, ID: str, curve: PlottedCurve) -> None:
        """File a curve under `ID`, which must be new."""
        curve.id = ID
        self[ID] = curve

    def finish(self) -> None:
        """Draw every curve that has points to the file; without file or points do nothing."""
        by_x: dict[str, list[PlottedCurve]] = {}
        for curve in self.values():
            if curve.points:
                by_x.setdefault(curve.x.name, []).append(curve)
        if self.file is None or not by_x:
            return
        figure = blank_figure(6.4, 3.8 * len(by_x))
        all_axes = figure.subplots(len(by_x), 1, squeeze=False)[:, 0]
        for axes, (x_name, curves) in zip(all_axes, by_x.items(), strict=True):
            axes.set_xlabel(self._labelled(x_name))
            lines = []
            for side in ("left", "right"):
                chosen = [curve for curve in curves if curve.side == side]
                # Colours go on from one side to the other.
                lines += self._draw(axes, side, chosen, first=len(lines)) if chosen else []
            # Above the curves, where it hides none.
            above = {"loc": "lower left", "bbox_to_anchor": (0, 1), "ncols": 4}
            axes.legend(handles=lines, **above, frameon=False, fontsize="small")
        savefig(figure, self.hub.folder / self.file)

    def _draw(self, axes: Any, side: str, curves: list[PlottedCurve], first: int) -> list:
        """Draw curves over one axis of y; return their lines."""
        tidy(axes)
        if side == "right":
            axes = axes.twinx()
            axes.spines[["top", "left"]].set_visible(False)
        lines = []
        for k, curve in enumerate(curves, first):
            x, y = zip(*curve.points, strict=True)
            marker = "o" if len(x) < 3 else None
            label = f"{curve.id} (right)" if side == "right" else curve.id
            lines += axes.plot(x, y, color=f"C{k}", label=label, linewidth=1.4, marker=marker)
        axes.set_ylabel(", ".join(dict.fromkeys(self._labelled(curve.y.name) for curve in curves)))
        axes.margins(x=0.01)
        if any(curve.scale == "log" for curve in curves):
            axes.set_yscale("log", nonpositive="mask")
        return lines

    def _labelled(self, name: str) -> str:
        units = self.hub.output.units
        parts = {**self.hub.fixes, **self.hub.computes}
        return labelled(name, units.of_value(name, parts)) if units else name
