"""Pictures of points in 1D, 2D and 3D, by Matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product
from types import SimpleNamespace
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axis import Axis
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.transforms import Transform
from PIL import Image

from karamelo_py.output.outlines import (
    FINE,
    Front,
    Tool,
    corners,
    outlines,
    scattered,
    smoothed,
    split,
)
from karamelo_py.output.snapshots import Snapshot
from karamelo_py.output.units import LENGTHS, labelled, suited

# Colour-blind safe (Okabe & Ito 2008).
SOLIDS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")
MOST_IN_LEGEND = 16
MARGIN = 4
MARKS = 1 << 16
MOST_CELLS = 1 << 23
HIDDEN = (0.0, 0.0, 0.0, 0.25)
# Diameter of a circle with the area of a unit square.
ROUND = np.sqrt(4 / np.pi)
STEPS = (1, 2, 2.5, 5, 10)  # intervals of ticks / power of ten
# Direction towards the light: right, up, towards the viewer.
LIGHT = np.array([-0.35, 0.6, 0.72])
AMBIENT = 0.5
LIT = 8  # number of points from which on a body has a lit surface


Window = Sequence[tuple[float | None, float | None]]


class Options(NamedTuple):
    column: str
    label: str
    solids: tuple[str, ...] = ()
    limits: tuple[float | None, float | None] = (None, None)  # None: widened to include all values
    symmetric: bool = False  # limits symmetric about 0
    cmap: str = "viridis"
    azimuth: float = -60.0
    elevation: float = 30.0
    axes: bool = True
    lengths: str = ""  # unit of lengths
    mirror: bool = False
    window: Window = ()  # limits of x, y, z; None: limits of the domain
    log: bool = False  # logarithmic colours; values <= 0 get the lowest colour
    quantile: float = 0.0  # fraction of the values that may lie beyond each limit
    fontsize: float = 9.0
    pointsize: float = 1.0  # diameter / size of a material point
    outlines: bool = False


class DrawnPoints(Artist):
    def __init__(self, picture: Picture):
        super().__init__()
        self.picture = picture
        self.rows = np.empty((3, 0))
        self.lines = LineCollection(
            [], colors="black", capstyle="round", linewidths=0.1 * picture.options.fontsize
        )
        picture.axes.add_collection(self.lines, autolim=False)
        self.lines.set_visible(False)
        self.set_zorder(picture.artist.get_zorder())
        picture.artist.set_visible(False)

    def draw(self, renderer: RendererBase) -> None:
        if not self.get_visible():
            return
        artist, many = self.picture.artist, self.rows.shape[1] > MARKS
        artist.set_visible(True)
        if many:  # a .pdf or .svg gets an image, as viewers are slow with so numerous circles
            renderer.start_rasterizing()
        for first in range(0, self.rows.shape[1], MARKS):
            self.picture.draw(self.rows[:, first : first + MARKS])
            artist.draw(renderer)
        if many:
            renderer.stop_rasterizing()
        artist.set_visible(False)
        self.lines.set_visible(True)
        self.lines.draw(renderer)
        self.lines.set_visible(False)


class Picture:
    """Axes, labels and colour bar, with the points of a state on top.

    Most of the time is spent drawing the axes, so their pixels are stored until the limits change.
    """

    def __init__(self, domain: Any, size: tuple[float, float], dpi: int, options: Options):
        self.domain = _zoomed(domain, options.window, mirror=options.mirror)
        self.options = options
        self.small = options.fontsize - 1
        self.figure = Figure(figsize=size, dpi=dpi, layout="constrained")
        self.canvas = FigureCanvasAgg(self.figure)
        self.axes = self.figure.add_subplot()
        self.limits: tuple[float, float] | None = None
        self.beyond = (False, False)
        self.scale: Any = None
        self._laid_out = False
        self._widest = 0.0
        self._background: Any = None
        self.axes.tick_params(labelsize=self.small)
        self.title = self.axes.set_title("step 0, time 0", fontsize=options.fontsize)
        self.artist = self._prepare()
        self.marks = DrawnPoints(self)
        self.axes.add_artist(self.marks)
        if not options.axes:
            self.axes.set_axis_off()
        self._add_legend()

    cuts = False
    _prepare: Callable[[], Any]  # returns a new artist that draws the points
    # Function that returns the rows of the visible points among x (n, 3), in drawing order.
    _rows: Callable[[np.ndarray, np.ndarray, np.ndarray, float], np.ndarray]
    draw: Callable[[np.ndarray], None]
    _apply_limits: Callable[[float, float], None]

    def _apply_beyond(self, below: bool, above: bool) -> None:
        """Draw arrows at the ends of the colour bar beyond which there are values."""

    def _name_lengths(self, axis: Axis, name: str) -> None:
        """Label an axis in a unit that suits the numbers; without units, in a power of 1000."""
        factor, name = self._lengths_as(name)
        if factor != 1:
            axis.set_major_formatter(FuncFormatter(lambda value, _: _number(value * factor)))
        axis.set_label_text(name, fontsize=self.options.fontsize)

    def _lengths_as(self, name: str) -> tuple[float, str]:
        size = max(map(abs, (*self.domain.lo, *self.domain.hi)), default=1.0)
        if self.options.lengths:
            factor, unit = suited(self.options.lengths, size, LENGTHS)
            return factor, labelled(name, unit)
        power = 3 * int(np.floor(np.log10(size) / 3)) if size else 0
        small_or_large = 0 < size < 1e-2 or size >= 1e5
        return (10.0**-power, f"{name} / 1e{power}") if small_or_large else (1.0, name)

    def _add_legend(self) -> None:
        names = self.options.solids[:MOST_IN_LEGEND]
        if len(names) < 2:
            return
        dots = [
            Line2D([], [], marker="o", linestyle="", color=SOLIDS[k % len(SOLIDS)], label=name)
            for k, name in enumerate(names)
        ]
        self.figure.legend(
            handles=dots, loc="outside right upper", frameon=False, fontsize=self.small
        )

    def show(self, snapshot: Snapshot, side: float, title: str, tools: Sequence[Tool] = ()) -> None:
        if not self._laid_out:
            self._lay_out()
        everything = snapshot.columns
        if self.options.mirror:
            everything = {
                name: np.concatenate([-column if name == "x" else column, column])
                for name, column in everything.items()
            }
        columns = in_window(everything, self.options.window)
        values = columns[self.options.column]
        if self.options.log:
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.log10(values)
        if not self.options.solids:
            limits = self._limits(values)
            if limits != self.limits:
                self.limits = limits
                self._apply_limits(*limits)
                self._background = None
            finite = values[np.isfinite(values)]
            beyond = bool((finite < limits[0]).any()), bool((finite > limits[1]).any())
            if beyond != self.beyond:
                self.beyond = beyond
                self._apply_beyond(*beyond)
                self._background = None
        self._entitle(title)
        values = np.where(values == -np.inf, self.limits[0], values) if self.limits else values
        x = np.column_stack([columns[name] for name in "xyz"])
        self.marks.rows = self._rows(columns["id"], x, values, side)
        if self.options.outlines:
            if not self.cuts:
                columns = everything
                x = np.column_stack([columns[name] for name in "xyz"])
            kinds = columns["type"]
            self._outline([x[kinds == kind] for kind in np.unique(kinds)], tools, side)

    def _outline(self, bodies: list[np.ndarray], tools: Sequence[Tool], side: float) -> None:
        """Draw lines around points (n, 3) of bodies, and around tools."""

    def _entitle(self, text: str) -> None:
        self.title.set(text=text, fontsize=self.options.fontsize)
        whole = self.figure.bbox.width - 2 * MARGIN
        wide = self.title.get_window_extent(self.canvas.get_renderer()).width
        if wide > whole:
            self.title.set_fontsize(float(self.title.get_fontsize()) * whole / wide)
        self._widest = max(self._widest, min(wide, whole))  # titles must not jump when labels grow
        box = self.axes.get_window_extent()
        half = self._widest / 2 + MARGIN
        at = np.clip(box.x0 + box.width / 2, half, max(half, self.figure.bbox.width - half))
        self.title.set_x((at - box.x0) / box.width)

    def begin_with(self, limits: tuple[float, float] | None) -> None:
        self.limits = limits
        if limits is not None:
            if not self._laid_out:
                self._lay_out()
            self._apply_limits(*limits)
            self._background = None

    def _limits(self, values: np.ndarray) -> tuple[float, float]:
        grown_to = grown(self.limits, within(values, self.options.quantile))
        if self.options.symmetric:
            furthest = max(-grown_to[0], grown_to[1])
            grown_to = -furthest, furthest
        lo, hi = (
            end if fixed is None else np.log10(fixed) if self.options.log else fixed
            for end, fixed in zip(grown_to, self.options.limits, strict=True)
        )
        return (lo, hi) if hi > lo else (min(lo, hi), min(lo, hi) + (abs(lo) or 1.0))

    def save_png(self, file: BinaryIO, compression: int) -> None:
        if self._background is None:
            self.title.set_animated(True)
            self.marks.set_animated(True)
            self.canvas.draw()
            self._background = self.canvas.copy_from_bbox(self.figure.bbox)
        self.canvas.restore_region(self._background)
        self.axes.draw_artist(self.title)
        self.axes.draw_artist(self.marks)
        # Three channels suffice, as pictures are opaque.
        pixels = np.asarray(self.canvas.buffer_rgba())[:, :, :3]
        image = Image.fromarray(np.ascontiguousarray(pixels))
        image.save(file, format="PNG", compress_level=compression)

    def _lay_out(self) -> None:
        """Reserve space for the widest labels, so that nothing moves between pictures."""
        if self.scale is not None:
            self._apply_limits(*((-5.2, -4.8) if self.options.log else (-2.5e-4, 2.5e-4)))
        if engine := self.figure.get_layout_engine():
            for _ in range(2):  # the first layout changes the aspect ratio, which moves the axes
                engine.execute(self.figure)
            self.figure.set_layout_engine("none")
        self.figure.draw_without_rendering()
        self._make_room_at_left()
        if self.scale is not None:
            axes = self.scale.axes
            if axes is not self.axes:  # the axes of the colour bar must not be taller
                bar, box = axes.get_position(), self.axes.get_position()
                high = min(bar.height, box.height)
                low = box.y0 + (box.height - high) / 2
                axes.set_box_aspect(None)
                axes.set_position((bar.x0, low, bar.width, high))
            at = axes.transAxes.inverted().transform((self.scale.label.get_position()[0], 0))
            self.scale.set_label_coords(at[0], 0.5)
        self._laid_out = True

    def _make_room_at_left(self) -> None:
        label = self.axes.yaxis.label
        out = MARGIN - label.get_window_extent(self.canvas.get_renderer()).x0
        if out <= MARGIN or not self.axes.axison or not label.get_text():
            return
        box, fraction = self.axes.get_position(), out / self.figure.bbox.width
        self.axes.set_position((box.x0 + fraction, box.y0, box.width - fraction, box.height))
        self.figure.draw_without_rendering()

    def _points_per_unit(self) -> float:
        box = self.axes.get_position()
        lo, hi = self.axes.get_xlim()
        return box.width * self.figure.get_figwidth() * 72 / (hi - lo)


def grown(limits: tuple[float, float] | None, values: np.ndarray) -> tuple[float, float]:
    """Return limits widened to include the finite values.

    Limits are rounded outwards to multiples of 2^k / 8, so that they change rarely.
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


def within(values: np.ndarray, fraction: float) -> np.ndarray:
    finite = values[np.isfinite(values)]
    return np.quantile(finite, [fraction, 1 - fraction]) if fraction and len(finite) else finite


def in_window(columns: dict[str, np.ndarray], window: Window) -> dict[str, np.ndarray]:
    for name, ends in zip("xyz", window, strict=False):
        for end, out in zip(ends, (np.less, np.greater), strict=True):
            if end is not None:
                seen = ~out(columns[name], end)
                columns = {key: of[seen] for key, of in columns.items()}
    return columns


def _zoomed(domain: Any, window: Window, *, mirror: bool) -> Any:
    if not window and not mirror:
        return domain
    lo, hi = np.array(domain.lo, float), np.array(domain.hi, float)
    if mirror:
        lo[0] = -hi[0] if not window or window[0][1] is None else -window[0][1]
    for k, (low, high) in zip(range(len(lo)), window, strict=False):
        lo[k] = lo[k] if low is None else low
        hi[k] = hi[k] if high is None else high
    return SimpleNamespace(dimension=domain.dimension, lo=lo, hi=hi)


def make(domain: Any, size: tuple[float, float], dpi: int, options: Options) -> Picture:
    kind = {1: LinePicture, 2: PlanePicture, 3: SpacePicture}[domain.dimension]
    return kind(domain, size, dpi, options)


def _number(value: float, _: object = None) -> str:
    if value == 0 or 1e-4 <= abs(value) < 1e6:
        return f"{value:.8g}"
    short = np.format_float_scientific(value, precision=7, trim="-", exp_digits=1)
    return short.replace("+", "")  # writes 2.5e6, not 2.5e+6


def _power(value: float, _: object = None) -> str:
    return _number(float(f"{10.0**value:.3g}"))


def _arrows(shown: ScalarMappable, of_bar: Transform) -> list[Polygon]:
    looks = {"transform": of_bar, "clip_on": False, "edgecolor": "black", "linewidth": 0.8}
    ends = [(end, [(0, end), (0.5, end + 0.06 * way), (1, end)]) for end, way in ((0, -1), (1, 1))]
    colours = shown.get_cmap()
    return [Polygon(xy, visible=False, fc=colours(float(end)), **looks) for end, xy in ends]


class PlanePicture(Picture):
    def _prepare(self) -> Any:
        lo, hi = self.domain.lo, self.domain.hi
        self.axes.set_xlim(lo[0], hi[0])
        self.axes.set_ylim(lo[1], hi[1])
        self.axes.set_aspect("equal")
        self._name_lengths(self.axes.xaxis, "x")
        self._name_lengths(self.axes.yaxis, "y")
        return self._scatter()

    def _scatter(self) -> Any:
        self.colours = to_rgba_array(SOLIDS)
        self.norm = Normalize(0.0, 1.0)
        if not self.options.solids:
            shown = ScalarMappable(self.norm, self.options.cmap)
            bar = self.figure.colorbar(
                shown, ax=self.axes, shrink=0.8,
                ticks=MaxNLocator(7, steps=STEPS, integer=self.options.log),  # whole powers of ten
                format=FuncFormatter(_power if self.options.log else _number),
            )  # fmt: skip
            bar.set_label(self.options.label, fontsize=self.options.fontsize)
            bar.ax.tick_params(labelsize=self.small)
            self.scale = bar.ax.yaxis
            self.arrows = [bar.ax.add_patch(arrow) for arrow in _arrows(shown, bar.ax.transAxes)]
        return self.axes.scatter([], [], lw=0)

    def _apply_limits(self, lo: float, hi: float) -> None:
        if self.norm.vmin is not None and hi > self.norm.vmin:
            self.norm.vmax, self.norm.vmin = hi, lo
        else:
            self.norm.vmin, self.norm.vmax = lo, hi

    def _apply_beyond(self, below: bool, above: bool) -> None:
        for arrow, shows in zip(self.arrows, (below, above), strict=True):
            arrow.set_visible(shows)

    def _rows(self, ids: np.ndarray, x: np.ndarray, values: np.ndarray, side: float) -> np.ndarray:
        # Points have a minimum size, larger for few points.
        least = 0.8 + 4 / np.sqrt(max(len(x), 1))
        size = max(ROUND * side * self._points_per_unit(), least) * self.options.pointsize
        self.artist.set_sizes([size**2])
        if self.limits and not self.options.solids:
            values = (values - self.limits[0]) / (self.limits[1] - self.limits[0])
        return np.array([*x.T[:2], values], np.float32)[:, np.argsort(ids)]

    def _outline(self, bodies: list[np.ndarray], tools: Sequence[Tool], side: float) -> None:
        ends = np.transpose([self.axes.get_xlim(), self.axes.get_ylim()])
        lines = [line for tool in tools for line in tool.lines(*ends)]
        self.marks.lines.set_segments(lines + [line for x in bodies for line in outlines(x[:, :2])])

    def draw(self, rows: np.ndarray) -> None:
        self.artist.set_offsets(rows[:2].T)
        self.artist.set_facecolors(self._colours_of(rows))

    def _colours_of(self, rows: np.ndarray) -> np.ndarray:
        if self.options.solids:
            return self.colours[(rows[2].astype(int) - 1) % len(SOLIDS)]
        return colormaps[self.options.cmap](rows[2])


class SpacePicture(PlanePicture):
    cuts = True

    def _prepare(self) -> Any:
        self.lo, self.hi = np.asarray(self.domain.lo, float), np.asarray(self.domain.hi, float)
        a, e = np.radians([self.options.azimuth, self.options.elevation])
        ca, sa, ce, se = np.cos(a), np.sin(a), np.cos(e), np.sin(e)
        self.view = np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])
        self.middle = 0.5 * (self.lo + self.hi)
        seen = self._project(np.array(list(product(*zip(self.lo, self.hi, strict=True)))))[:, :2]
        if self.options.axes:
            for axis in range(3):
                self._draw_edges(axis, abs(seen).max())
        reach = abs(seen).max(axis=0) * 1.04
        self.axes.set_xlim(-reach[0], reach[0])
        self.axes.set_ylim(-reach[1], reach[1])
        self.axes.set_aspect("equal")
        self.axes.set_axis_off()
        return self._scatter()

    def _project(self, x: np.ndarray) -> np.ndarray:
        return (x - self.middle) @ self.view.T

    def _draw_edges(self, axis: int, reach: float) -> None:
        others = [k for k in range(3) if k != axis]
        edges = []
        for low_high in product(*((self.lo[k], self.hi[k]) for k in others)):
            ends = np.array([self.lo, self.hi])
            ends[:, others] = low_high
            edges.append((ends, self._project(ends)[:, :2]))
            self.axes.plot(*edges[-1][1].T, color="0.75", linewidth=0.7)
        ends, seen = min(edges, key=lambda edge: edge[1][:, 0 if axis == 2 else 1].sum())
        along = seen[1] - seen[0]
        if np.hypot(*along) < 0.1 * reach:
            return
        outward = np.array([along[1], -along[0]]) / np.hypot(*along)
        outward *= np.sign(outward @ seen.mean(axis=0)) or 1.0
        aligned = {
            "ha": "right" if outward[0] < -0.4 else "left" if outward[0] > 0.4 else "center",
            "va": "top" if outward[1] < -0.4 else "bottom" if outward[1] > 0.4 else "center",
            "textcoords": "offset points",
            "fontsize": self.small,
        }
        lo, hi = self.lo[axis], self.hi[axis]
        factor, name = self._lengths_as("xyz"[axis])
        large = self.options.fontsize / 9
        ticks = MaxNLocator(max(2, round(4 / large)), steps=STEPS).tick_values(lo, hi)
        # Near the ends of an edge, ticks of both edges would overlap.
        for tick in ticks[abs(ticks - 0.5 * (lo + hi)) < 0.48 * (hi - lo)]:
            at = seen[0] + along * (tick - lo) / (hi - lo)
            self.axes.plot(*np.array([at, at + 0.02 * reach * outward]).T, color="0.5", lw=0.7)
            number = _number(tick * factor)
            self.axes.annotate(number, at, xytext=tuple(6 * outward), **aligned)
        self.axes.annotate(
            name,
            seen.mean(axis=0),
            xytext=tuple(28 * large * outward),
            **aligned,
            rotation=90 if axis == 2 else 0,
        )

    def _rows(self, ids: np.ndarray, x: np.ndarray, values: np.ndarray, side: float) -> np.ndarray:
        places = self._project(x)
        shows = np.flatnonzero(self._shows(places, side))
        ids, places, values = ids[shows], places[shows], values[shows]
        # Sort from far to near, then by id. As integers, negative floats are ordered by magnitude.
        bits = places[:, 2].astype(np.float32).view(np.int32).astype(np.int64)
        keys = np.where(bits < 0, -0x80000000 - bits, bits) << 32 | ids.astype(np.int64)
        rows = super()._rows(keys, places, values, side)
        if len(x) < LIT:
            return rows
        return np.vstack([rows, self._light(x, side, shows)[np.argsort(keys)]])

    def _shows(self, places: np.ndarray, side: float) -> np.ndarray:
        """Return a mask of points that are not completely hidden, such as those at the surface."""
        # The circle of a point covers the adjacent cells, and lies within three cells.
        low, high = np.transpose([self.axes.get_xlim(), self.axes.get_ylim()])
        cell = side * self.options.pointsize / 5
        if not cell > 0 or np.prod((high - low) / cell) > MOST_CELLS:
            return np.ones(len(places), bool)
        return ~Front(places, low, high, cell, 0).hides(places[:, :2], places[:, 2], around=3)

    def _outline(self, bodies: list[np.ndarray], tools: Sequence[Tool], side: float) -> None:
        low, high = np.transpose([self.axes.get_xlim(), self.axes.get_ylim()])
        fronts = [
            Front(self._project(x), low, high, max(side / 3, (high - low).max() / (2 * FINE)), 2)
            for x in bodies
        ]
        groups = []  # by tool: projected lines, their heights, the surface that hides other tools
        for front in fronts:
            if lines := front.outlines():
                seen = np.concatenate(lines)
                groups.append((lines, seen, front.beside(seen), False))
        for tool in tools:
            if not (lines := list(tool.lines(self.lo, self.hi))):
                continue
            at = np.concatenate(lines)
            # Lines on the far side are hidden by the tool itself.
            nearer = at + 0.01 * np.linalg.norm(np.ptp(at, axis=0)) * self.view[2]
            *places, height = self._project(at).T
            groups.append((lines, np.transpose(places), height, tool.depth(nearer) > 0))
        pieces: list[Any] = []
        for lines, seen, height, behind in groups:
            hidden = behind | np.any([front.hides(seen, height) for front in fronts], axis=0)
            ends = np.cumsum([len(line) for line in lines])[:-1]
            for one in zip(np.split(seen, ends), np.split(hidden, ends), strict=True):
                pieces += split(*one)
        pieces.sort(key=lambda piece: not piece[1])
        self.marks.lines.set_segments([line for line, _ in pieces])
        self.marks.lines.set_color([HIDDEN if hidden else "black" for _, hidden in pieces])

    def _colours_of(self, rows: np.ndarray) -> np.ndarray:
        colours = super()._colours_of(rows)
        if len(rows) > 3:
            colours[:, :3] *= rows[3][:, None]
        return colours

    def _light(self, x: np.ndarray, side: float, some: np.ndarray) -> np.ndarray:
        """Return the light on `some` points; normals point to the side with fewer points."""
        lo, size = x.min(axis=0), np.ptp(x, axis=0)
        cell = max(1.5 * side, size.max() / 120, np.finfo(float).tiny)
        at = (x - lo) / cell + 2
        shape = tuple((at.max(axis=0) + 3).astype(int))
        slopes = [slope.ravel() for slope in np.gradient(smoothed(scattered(at, shape)))]
        around = list(corners(at[some], shape))
        normal = -np.transpose([sum(w * slope[k] for k, w in around) for slope in slopes])
        length = np.linalg.norm(normal, axis=1)
        facing = (normal @ self.view.T) @ (LIGHT / np.linalg.norm(LIGHT))
        facing = np.divide(facing, length, out=np.ones(len(some)), where=length > 0)
        return (AMBIENT + (1 - AMBIENT) * np.clip(facing, 0, 1)).astype(np.float32)


class LinePicture(Picture):
    def _prepare(self) -> Any:
        self.axes.set_xlim(self.domain.lo[0], self.domain.hi[0])
        self._name_lengths(self.axes.xaxis, "x")
        self.axes.set_ylabel(self.options.label, fontsize=self.options.fontsize)
        self.scale = self.axes.yaxis
        self.scale.set_major_formatter(FuncFormatter(_power if self.options.log else _number))
        self.axes.grid(True, color="0.9", linewidth=0.7)
        (artist,) = self.axes.plot([], [], ".", color=SOLIDS[0], markersize=3)
        return artist

    def _apply_limits(self, lo: float, hi: float) -> None:
        self.axes.set_ylim(lo, hi)

    def _rows(self, ids: np.ndarray, x: np.ndarray, values: np.ndarray, side: float) -> np.ndarray:
        return np.array([*x.T[:2], values])[:, np.argsort(ids)]

    def draw(self, rows: np.ndarray) -> None:
        self.artist.set_data(rows[0], rows[2])
