"""Plots of logged quantities against each other, drawn with Matplotlib when a run ends."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from karamelo_py.language.scene import Scene
from karamelo_py.output.figures import blank_figure, tidy
from karamelo_py.output.files import FORMATS, savefig
from karamelo_py.output.quantity import Quantity
from karamelo_py.script.errors import Place

__all__ = ["FORMATS", "Curve", "Plots"]


class Curve:
    """One curve: `y` against `x`, a point at every `every` steps."""

    def __init__(self, every: int, x: Quantity, y: Quantity):
        self.every = every
        self.x = x
        self.y = y
        self.points: list[tuple[float, float]] = []
        self.last_step: int | None = None
        self.id = y.name

    def write(self) -> None:
        """Collect the point of the present state."""
        self.points.append((float(self.x.read()), float(self.y.read())))


class Plots:
    """The curves of a scene and the file they are drawn to.

    Curves over the same quantity share one pair of axes; each further quantity gets axes of its
    own below. Without a file the curves are collected only.
    """

    def __init__(self, hub: Scene):
        self.hub = hub
        self.file: Path | None = None
        self.place: Place | None = None  # of save_plot
        self._curves: dict[str, Curve] = {}

    def __iter__(self) -> Iterator[Curve]:
        return iter(self._curves.values())

    def __contains__(self, item: object) -> bool:
        return any(curve is item for curve in self)

    def __len__(self) -> int:
        return len(self._curves)

    def add(self, ID: str, curve: Curve) -> None:
        """File a curve under `ID`, which must be new."""
        curve.id = ID
        self._curves[ID] = curve

    def ids(self) -> list[str]:
        """IDs of the curves."""
        return list(self._curves)

    def save(self) -> None:
        """Draw every curve that has points to the file; without file or points do nothing."""
        if self.file is None or not any(curve.points for curve in self):
            return
        by_x: dict[str, list[Curve]] = {}
        for curve in self:
            if curve.points:
                by_x.setdefault(curve.x.name, []).append(curve)
        figure = blank_figure(6.4, 3.8 * len(by_x))
        all_axes = figure.subplots(len(by_x), 1, squeeze=False)[:, 0]
        for axes, (x_name, curves) in zip(all_axes, by_x.items(), strict=True):
            for curve in curves:
                x, y = zip(*curve.points, strict=True)
                axes.plot(x, y, label=curve.id, linewidth=1.4, marker="o" if len(x) < 3 else None)
            axes.set_xlabel(x_name)
            axes.set_ylabel(", ".join(dict.fromkeys(curve.y.name for curve in curves)))
            axes.margins(x=0.01)
            tidy(axes)
            axes.legend(frameon=False)
        savefig(figure, self.hub.folder / self.file)
