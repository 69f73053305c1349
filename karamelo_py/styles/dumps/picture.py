"""A picture of points whose background is drawn once and then reused."""

from __future__ import annotations

from typing import Any, BinaryIO, NamedTuple

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from karamelo_py.styles.dumps.look import Extent, Look, Seen

# Colour-blind safe (Okabe and Ito 2008); solids take them in turn.
SOLIDS = ("#0072B2", "#E69F00", "#009E73", "#CC79A7", "#56B4E9", "#D55E00", "#F0E442", "#000000")
MOST_IN_LEGEND = 16
MARGIN = 4  # pixels at both sides of a long title


class Options(NamedTuple):
    """What a picture shows and how.

    Attributes
    ----------
    label
        Text beside the colours (or, in 1D, at the ordinate).
    solids
        Names of the solids that colour the points, if a field does not.
    limits
        Ends of the colours; None for ends that grow with what has been seen.
    symmetric
        Whether limits that grow lie about 0.
    cmap
        A colour map of Matplotlib.
    azimuth, elevation
        Angles of view in 3D, in degrees.
    axes
        Whether axes are drawn.
    lengths
        Text behind the names of the axes: the unit.
    """

    label: str
    solids: tuple[str, ...] = ()
    limits: tuple[float | None, float | None] = (None, None)
    symmetric: bool = False
    cmap: str = "viridis"
    azimuth: float = -60.0
    elevation: float = 30.0
    axes: bool = True
    lengths: str = ""


class Marks(Artist):
    """The points of one state: an artist draws some of them after others, and never has all."""

    def __init__(self, picture: Picture):
        super().__init__()
        self.picture = picture
        self.points: Seen | None = None
        self.set_zorder(picture.artist.get_zorder())
        picture.artist.set_visible(False)  # but when this draws

    def draw(self, renderer: Any) -> None:
        """Draw them."""
        if self.points is None or not self.get_visible():
            return
        artist = self.picture.artist
        artist.set_visible(True)
        for rows in self.points.marks(self.picture.look):
            self.picture.place(rows)
            artist.draw(renderer)
        artist.set_visible(False)


class Picture:
    """Axes, labels and colour bar as a background, and on it the points of one state.

    Drawing axes with their ticks takes most of Matplotlib's time. They only change when the limits
    of the field do, so their pixels are kept, and a new state costs the points and the title.
    """

    def __init__(self, domain: Any, size: tuple[float, float], dpi: int, options: Options):
        self.domain = domain
        self.options = options
        self.figure = Figure(figsize=size, dpi=dpi, layout="constrained")
        self.canvas = FigureCanvasAgg(self.figure)
        self.axes = self.figure.add_subplot()
        self.limits: tuple[float, float] | None = None
        self.beyond = (False, False)
        # The axis whose labels change with the limits of the field.
        self.scale: Any = None
        self._laid_out = False
        self._widest = 0.0  # of the titles, in pixels
        self._background: Any = None
        self.axes.tick_params(labelsize=8)
        self.title = self.axes.set_title("step 0, time 0", fontsize=9)
        self.artist = self._prepare()
        self.marks = Marks(self)
        self.axes.add_artist(self.marks)
        self.look = Look()
        if not options.axes:
            self.axes.set_axis_off()
        self._add_legend()

    def _prepare(self) -> Any:
        """Set up axes; return the artist that shows the points."""
        raise NotImplementedError

    def _see(self, points: Seen, extent: Extent) -> Look:
        """How these points are seen."""
        raise NotImplementedError

    def place(self, rows: np.ndarray) -> None:
        """Hand what shows of some points to the artist."""
        raise NotImplementedError

    def _apply_limits(self, lo: float, hi: float) -> None:
        """Take new limits of the field."""
        raise NotImplementedError

    def _apply_beyond(self, below: bool, above: bool) -> None:
        """Mark the ends of the colours beyond which there are values."""

    def _add_legend(self) -> None:
        """Names of the solids, beside the picture."""
        names = self.options.solids[:MOST_IN_LEGEND]
        if len(names) < 2:
            return
        dots = [
            Line2D([], [], marker="o", linestyle="", color=SOLIDS[k % len(SOLIDS)], label=name)
            for k, name in enumerate(names)
        ]
        self.figure.legend(handles=dots, loc="outside right upper", frameon=False, fontsize=8)

    def show(self, points: Seen, title: str) -> None:
        """Set points and title to draw."""
        if not self._laid_out:
            self._lay_out()
        extent = points.extent()
        if not self.options.solids:
            limits = self._limits(extent.ends)
            if limits != self.limits:
                self.limits = limits
                self._apply_limits(*limits)
                self._background = None
            if (found := beyond(limits, extent.ends)) != self.beyond:
                self.beyond = found
                self._apply_beyond(*found)
                self._background = None
        self._entitle(title)
        self.look = self._see(points, extent)
        self.marks.points = points

    def _entitle(self, text: str) -> None:
        """Write the title above the axes, and where that is too narrow within the picture."""
        self.title.set_text(text)
        whole = self.figure.bbox.width - 2 * MARGIN
        wide = self.title.get_window_extent(self.canvas.get_renderer()).width
        if wide > whole:
            self.title.set_fontsize(self.title.get_fontsize() * whole / wide)
        self._widest = max(self._widest, min(wide, whole))  # what is shorter does not jump back
        box = self.axes.get_window_extent()
        half = self._widest / 2 + MARGIN
        at = np.clip(box.x0 + box.width / 2, half, max(half, self.figure.bbox.width - half))
        self.title.set_x((at - box.x0) / box.width)

    def begin_with(self, limits: tuple[float, float] | None) -> None:
        """Let limits that grow begin with those that a picture had before."""
        self.limits = limits
        if limits is not None:
            if not self._laid_out:
                self._lay_out()
            self._apply_limits(*limits)
            self._background = None

    def _limits(self, values: np.ndarray) -> tuple[float, float]:
        grown_to = grown(self.limits, values)
        if self.options.symmetric:
            furthest = max(-grown_to[0], grown_to[1])
            grown_to = -furthest, furthest
        lo, hi = (
            own if fixed is None else fixed
            for own, fixed in zip(grown_to, self.options.limits, strict=True)
        )
        return (lo, hi) if hi > lo else (min(lo, hi), min(lo, hi) + (abs(lo) or 1.0))

    def save_png(self, file: BinaryIO, compression: int) -> None:
        """Draw the state over the kept background and write it as PNG."""
        if self._background is None:
            self.title.set_animated(True)
            self.marks.set_animated(True)
            self.canvas.draw()
            self._background = self.canvas.copy_from_bbox(self.figure.bbox)
        self.canvas.restore_region(self._background)
        self.axes.draw_artist(self.title)
        self.axes.draw_artist(self.marks)
        # Opaque everywhere, so three channels do.
        pixels = np.asarray(self.canvas.buffer_rgba())[:, :, :3]
        image = Image.fromarray(np.ascontiguousarray(pixels))
        image.save(file, format="PNG", compress_level=compression)

    def _lay_out(self) -> None:
        """Find room for the widest labels, once: nothing moves between the pictures of a run."""
        if self.scale is not None:
            self._apply_limits(-2.5e-5, 2.5e-5)
        for _ in range(2):  # a second time where the aspect of the axes has moved them
            self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")
        self._make_room_at_left()
        if self.scale is not None:
            axes = self.scale.axes
            if axes is not self.axes:  # a colour bar, no higher than the axes
                own, beside = axes.get_position(), self.axes.get_position()
                high = min(own.height, beside.height)
                low = beside.y0 + (beside.height - high) / 2
                axes.set_box_aspect(None)
                axes.set_position((own.x0, low, own.width, high))
            at = axes.transAxes.inverted().transform((self.scale.label.get_position()[0], 0))
            self.scale.set_label_coords(at[0], 0.5)
        self._laid_out = True

    def _make_room_at_left(self) -> None:
        """Narrow axes of equal units may be laid out with the name of y outside the picture."""
        label = self.axes.yaxis.label
        out = MARGIN - label.get_window_extent(self.canvas.get_renderer()).x0
        if out <= MARGIN or not self.axes.axison or not label.get_text():
            return
        box, share = self.axes.get_position(), out / self.figure.bbox.width
        self.axes.set_position((box.x0 + share, box.y0, box.width - share, box.height))
        self.figure.draw_without_rendering()

    def _pixels_per_unit(self) -> float:
        """Points (1/72 inch) on paper per unit of x."""
        box = self.axes.get_position()
        lo, hi = self.axes.get_xlim()
        return box.width * self.figure.get_figwidth() * 72 / (hi - lo)


def beyond(limits: tuple[float, float], ends: np.ndarray) -> tuple[bool, bool]:
    """Whether values lie below the limits, and above."""
    return bool((ends < limits[0]).any()), bool((ends > limits[1]).any())


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
