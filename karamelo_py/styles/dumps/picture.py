"""A picture of points whose background is drawn once and then reused."""

from __future__ import annotations

from typing import Any, BinaryIO

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import Formatter
from PIL import Image

# Colour-blind safe (Okabe and Ito 2008); solids take them in turn.
SOLIDS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")
MAP = "viridis"
# Angles of view in 3D, as in Matplotlib's own 3D axes.
AZIMUTH, ELEVATION = np.radians(-60.0), np.radians(30.0)


class Numbers(Formatter):
    """Numbers with two decimals (more where they hardly differ); their power of ten stands apart.

    So they keep their width while the limits grow.
    """

    order, decimals = 0, 2

    def set_locs(self, locs: Any) -> None:
        """Find the power of ten of the limits."""
        limits = np.asarray(self.axis.get_view_interval(), float)
        largest, span = abs(limits).max(), np.ptp(limits)
        self.order = int(np.floor(np.log10(largest))) if largest > 0 else 0
        share = span / largest if largest > 0 else 1.0
        self.decimals = 2 + max(0, int(np.ceil(-np.log10(max(share, 1e-9)))) - 1)

    def __call__(self, value: float, pos: int | None = None) -> str:
        """The text of one number."""
        return self.fix_minus(f"{value / 10.0**self.order:.{self.decimals}f}")

    def get_offset(self) -> str:
        """The power of ten."""
        return self.fix_minus(f"1e{self.order}") if self.order else ""


def make(domain: Any, size: tuple[float, float], dpi: int, label: str) -> Picture:
    """The picture that suits the domain's dimension; `label` names the field shown."""
    kind = {1: Line, 2: Plane, 3: Space}[domain.dimension]
    return kind(domain, size, dpi, label)


class Picture:
    """Axes, labels and colour bar as a background, and on it the points of one state.

    Drawing axes with their ticks takes most of Matplotlib's time. They only change when the limits
    of the field do, so their pixels are kept, and a new state costs the points and the title.
    """

    def __init__(self, domain: Any, size: tuple[float, float], dpi: int, label: str):
        self.domain = domain
        self.figure = Figure(figsize=size, dpi=dpi, layout="constrained")
        self.canvas = FigureCanvasAgg(self.figure)
        self.axes = self.figure.add_subplot()
        self.label = label
        self.limits: tuple[float, float] | None = None
        # The axis whose labels change with the limits of the field.
        self.scale: Any = None
        self._laid_out = False
        self._background: Any = None
        self.axes.tick_params(labelsize=8)
        self.title = self.axes.set_title("step 0, time 0", fontsize=9)
        self.artist = self._prepare()

    def _prepare(self) -> Any:
        """Set up axes; return the artist that shows the points."""
        raise NotImplementedError

    def _place(self, x: np.ndarray, values: np.ndarray, size: float) -> None:
        """Hand a state to the artist."""
        raise NotImplementedError

    def _apply_limits(self, lo: float, hi: float) -> None:
        """Take new limits of the field."""
        raise NotImplementedError

    def show(self, x: np.ndarray, values: np.ndarray, size: float, title: str) -> None:
        """Set positions (n, 3), values (n,), side length of a point, and title to draw."""
        if not self._laid_out:
            self._lay_out()
        if self.label != "type":
            limits = grown(self.limits, values)
            if limits != self.limits:
                self.limits = limits
                self._apply_limits(*limits)
                self._background = None
        self.title.set_text(title)
        self._place(x, values, size)

    def save_png(self, file: BinaryIO, compression: int) -> None:
        """Draw the state over the kept background and write it as PNG."""
        if self._background is None:
            self.title.set_animated(True)
            self.artist.set_animated(True)
            self.canvas.draw()
            self._background = self.canvas.copy_from_bbox(self.figure.bbox)
        self.canvas.restore_region(self._background)
        self.axes.draw_artist(self.title)
        self.axes.draw_artist(self.artist)
        # Opaque everywhere, so three channels do.
        pixels = np.asarray(self.canvas.buffer_rgba())[:, :, :3]
        image = Image.fromarray(np.ascontiguousarray(pixels))
        image.save(file, format="PNG", compress_level=compression)

    def _lay_out(self) -> None:
        """Find room for the widest labels, once: nothing moves between the pictures of a run."""
        if self.scale is not None:
            self._apply_limits(-1e-4, 1e-4)
        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")
        if self.scale is not None:
            axes = self.scale.axes
            at = axes.transAxes.inverted().transform((self.scale.label.get_position()[0], 0))
            self.scale.set_label_coords(at[0], 0.5)
        self._laid_out = True

    def _pixels_per_unit(self) -> float:
        """Points (1/72 inch) on paper per unit of x."""
        box = self.axes.get_position()
        lo, hi = self.axes.get_xlim()
        return box.width * self.figure.get_figwidth() * 72 / (hi - lo)


class Plane(Picture):
    """2D: the points where they are."""

    def _prepare(self) -> Any:
        lo, hi = self.domain.lo, self.domain.hi
        self.axes.set_xlim(lo[0], hi[0])
        self.axes.set_ylim(lo[1], hi[1])
        self.axes.set_aspect("equal")
        self.axes.set_xlabel("x", fontsize=9)
        self.axes.set_ylabel("y", fontsize=9)
        return self._scatter()

    def _scatter(self) -> Any:
        if self.label == "type":
            norm = Normalize(-0.5, len(SOLIDS) - 0.5)
            return self.axes.scatter([], [], c=[], cmap=ListedColormap(SOLIDS), norm=norm, lw=0)
        self.norm = Normalize(0.0, 1.0)
        artist = self.axes.scatter([], [], c=[], cmap=MAP, norm=self.norm, lw=0)
        bar = self.figure.colorbar(
            artist, ax=self.axes, shrink=0.8, label=self.label, format=Numbers()
        )
        bar.ax.tick_params(labelsize=8)
        self.scale = bar.ax.yaxis
        self.scale.get_offset_text().set_size(8)
        return artist

    def _apply_limits(self, lo: float, hi: float) -> None:
        self.norm.vmin, self.norm.vmax = lo, hi

    def _place(self, x: np.ndarray, values: np.ndarray, size: float) -> None:
        self._set(x[:, :2], values, size)

    def _set(self, xy: np.ndarray, values: np.ndarray, size: float) -> None:
        self.artist.set_offsets(xy)
        if self.label == "type":
            values = (values - 1) % len(SOLIDS)
        self.artist.set_array(values)
        # As large as the material it stands for, and never invisible.
        self.artist.set_sizes([max(size * self._pixels_per_unit(), 0.8) ** 2])


class Space(Plane):
    """3D: the points seen from above and aside, the farthest first, in the frame of the domain."""

    def _prepare(self) -> Any:
        lo, hi = self.domain.lo, self.domain.hi
        ca, sa, ce, se = np.cos(AZIMUTH), np.sin(AZIMUTH), np.cos(ELEVATION), np.sin(ELEVATION)
        # Rows: right, up and towards the eye.
        self.view = np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])
        self.middle = 0.5 * (np.asarray(lo) + np.asarray(hi))
        corners = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)])
        seen = self._project(lo + corners * (np.asarray(hi) - lo))
        for i in range(8):
            for j in range(i):
                if abs(corners[i] - corners[j]).sum() == 1:
                    self.axes.plot(*seen[[i, j], :2].T, color="0.75", linewidth=0.7)
        for name, axis in zip("xyz", np.eye(3, dtype=int), strict=True):
            # Written at the edges that meet in the corner nearest to the reader, z at the left end.
            start = np.array([1, 0, 0]) if name == "y" else np.zeros(3, dtype=int)
            at = seen[[int(np.dot(c, (4, 2, 1))) for c in (start, start + axis)], :2].mean(axis=0)
            low, high = (float(b[int(np.argmax(axis))]) for b in (lo, hi))
            self.axes.annotate(
                f"{name}: {low:g} .. {high:g}",
                at,
                xytext=(0, -9) if name != "z" else (-9, 0),
                textcoords="offset points",
                ha="center" if name == "z" else ("right" if name == "x" else "left"),
                va="center",
                rotation=90 if name == "z" else 0,
                fontsize=8,
            )
        reach = abs(seen[:, :2]).max(axis=0) * 1.08
        self.axes.set_xlim(-reach[0], reach[0])
        self.axes.set_ylim(-reach[1], reach[1])
        self.axes.set_aspect("equal")
        self.axes.set_axis_off()
        return self._scatter()

    def _project(self, x: np.ndarray) -> np.ndarray:
        return (x - self.middle) @ self.view.T

    def _place(self, x: np.ndarray, values: np.ndarray, size: float) -> None:
        seen = self._project(x)
        order = np.argsort(seen[:, 2], kind="stable")
        self._set(seen[order, :2], values[order], size)


class Line(Picture):
    """1D: the field over x."""

    def _prepare(self) -> Any:
        self.axes.set_xlim(self.domain.lo[0], self.domain.hi[0])
        self.axes.set_xlabel("x", fontsize=9)
        self.axes.set_ylabel(self.label, fontsize=9)
        self.scale = self.axes.yaxis
        self.scale.set_major_formatter(Numbers())
        self.scale.get_offset_text().set_size(8)
        self.axes.grid(True, color="0.9", linewidth=0.7)
        (artist,) = self.axes.plot([], [], ".", color=SOLIDS[0], markersize=3)
        return artist

    def _apply_limits(self, lo: float, hi: float) -> None:
        self.axes.set_ylim(lo, hi)

    def _place(self, x: np.ndarray, values: np.ndarray, size: float) -> None:
        self.artist.set_data(x[:, 0], values)


def grown(limits: tuple[float, float] | None, values: np.ndarray) -> tuple[float, float]:
    """Limits that hold the old ones and the finite values.

    They are rounded outwards to eighths of a power of two, so that they change rarely while a field
    grows and the pictures of a run stay comparable.
    """
    finite = values[np.isfinite(values)]
    lo, hi = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    if limits is not None:
        if limits[0] <= lo and hi <= limits[1]:
            return limits
        lo, hi = min(lo, limits[0]), max(hi, limits[1])
    span = hi - lo
    if span <= 1e-12 * max(abs(lo), abs(hi)):
        span = abs(hi) or 1.0
    unit = 2.0 ** (np.ceil(np.log2(span)) - 3)
    lo, hi = np.floor(lo / unit) * unit, np.ceil(hi / unit) * unit
    return float(lo), float(hi if hi > lo else lo + unit)
