"""Pictures of points on a line, in the plane and in space."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_rgba_array
from matplotlib.patches import Polygon
from matplotlib.ticker import FuncFormatter, MaxNLocator
from matplotlib.transforms import Transform

from karamelo_py.styles.dumps.look import ROUND, Extent, Look, Seen
from karamelo_py.styles.dumps.picture import (
    SOLIDS,
    Options,
    Picture,
)

STEPS = (1, 2, 2.5, 5, 10)  # between ticks
# Towards the light, in a frame of right, up and towards the eye.
LIGHT = np.array([-0.35, 0.6, 0.72])
AMBIENT = 0.5  # light from all sides
LIT = 8  # points, from which on they have a surface


def make(domain: Any, size: tuple[float, float], dpi: int, options: Options) -> Picture:
    """The picture that suits the domain's dimension."""
    kind = {1: Line, 2: Plane, 3: Space}[domain.dimension]
    return kind(domain, size, dpi, options)


def _number(value: float, _: Any = None) -> str:
    return f"{value:.8g}"


def _arrows(shown: ScalarMappable, of_bar: Transform) -> list[Polygon]:
    """Arrows at the lower and the upper end of a bar of colours, not to be seen yet."""
    looks = {"transform": of_bar, "clip_on": False, "edgecolor": "black", "linewidth": 0.8}
    return [
        Polygon(
            [(0, end), (0.5, end + 0.06 * way), (1, end)],
            facecolor=shown.get_cmap()(float(end)),
            visible=False,
            **looks,
        )
        for end, way in ((0, -1), (1, 1))
    ]


class Plane(Picture):
    """2D: the points where they are."""

    def _prepare(self) -> Any:
        lo, hi = self.domain.lo, self.domain.hi
        self.axes.set_xlim(lo[0], hi[0])
        self.axes.set_ylim(lo[1], hi[1])
        self.axes.set_aspect("equal")
        self.axes.set_xlabel("x" + self.options.lengths, fontsize=9)
        self.axes.set_ylabel("y" + self.options.lengths, fontsize=9)
        return self._scatter()

    def _scatter(self) -> Any:
        self.colours = to_rgba_array(SOLIDS)
        self.norm = Normalize(0.0, 1.0)
        if not self.options.solids:
            shown = ScalarMappable(self.norm, self.options.cmap)
            bar = self.figure.colorbar(
                shown,
                ax=self.axes,
                shrink=0.8,
                label=self.options.label,
                ticks=MaxNLocator(7, steps=STEPS),
                format=FuncFormatter(_number),
            )
            bar.ax.tick_params(labelsize=8)
            self.scale = bar.ax.yaxis
            self.arrows = [bar.ax.add_patch(arrow) for arrow in _arrows(shown, bar.ax.transAxes)]
        return self.axes.scatter([], [], lw=0)

    def _apply_limits(self, lo: float, hi: float) -> None:
        self.norm.vmin, self.norm.vmax = lo, hi

    def _apply_beyond(self, below: bool, above: bool) -> None:
        for arrow, shows in zip(self.arrows, (below, above), strict=True):
            arrow.set_visible(shows)

    def _see(self, points: Seen, extent: Extent) -> Look:
        # As large as the material it stands for, and never invisible: least where they are few.
        least = 0.8 + 4 / np.sqrt(max(extent.count, 1))
        size = max(ROUND * points.side * self._pixels_per_unit(), least)
        self.artist.set_sizes([size**2])
        return Look(limits=None if self.options.solids else self.limits)

    def place(self, rows: np.ndarray) -> None:
        """Hand what shows of some points to the artist."""
        self.artist.set_offsets(rows[:2].T)
        self.artist.set_facecolors(self._colours_of(rows))

    def _colours_of(self, rows: np.ndarray) -> np.ndarray:
        """(n, 4) colours."""
        if self.options.solids:
            return self.colours[(rows[2].astype(int) - 1) % len(SOLIDS)]
        return colormaps[self.options.cmap](rows[2])


class Space(Plane):
    """3D: the points seen from outside, the farthest first, in the frame of the domain."""

    def _prepare(self) -> Any:
        self.lo, self.hi = np.asarray(self.domain.lo, float), np.asarray(self.domain.hi, float)
        a, e = np.radians([self.options.azimuth, self.options.elevation])
        ca, sa, ce, se = np.cos(a), np.sin(a), np.cos(e), np.sin(e)
        # Rows: right, up and towards the eye.
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
        """The four edges along an axis; ticks at the lowest one, of z at the leftmost."""
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
            return  # seen from its end
        outward = np.array([along[1], -along[0]]) / np.hypot(*along)
        outward *= np.sign(outward @ seen.mean(axis=0)) or 1.0
        aligned = {
            "ha": "right" if outward[0] < -0.4 else "left" if outward[0] > 0.4 else "center",
            "va": "top" if outward[1] < -0.4 else "bottom" if outward[1] > 0.4 else "center",
            "textcoords": "offset points",
            "fontsize": 8,
        }
        lo, hi = self.lo[axis], self.hi[axis]
        ticks = MaxNLocator(4, steps=STEPS).tick_values(lo, hi)
        # Those of two edges would cover each other at their common end.
        for tick in ticks[abs(ticks - 0.5 * (lo + hi)) < 0.48 * (hi - lo)]:
            at = seen[0] + along * (tick - lo) / (hi - lo)
            self.axes.plot(*np.array([at, at + 0.02 * reach * outward]).T, color="0.5", lw=0.7)
            self.axes.annotate(_number(tick), at, xytext=tuple(6 * outward), **aligned)
        self.axes.annotate(
            "xyz"[axis] + self.options.lengths,
            seen.mean(axis=0),
            xytext=tuple(28 * outward),
            **aligned,
            rotation=90 if axis == 2 else 0,
        )

    def _see(self, points: Seen, extent: Extent) -> Look:
        look = super()._see(points, extent)._replace(view=self.view, middle=self.middle)
        self.light = None
        if extent.count < LIT:
            return look
        size = extent.hi - extent.lo
        cell = max(1.5 * points.side, size.max() / 120, np.finfo(float).tiny)
        shape = tuple(((size / cell).astype(int) + 5).tolist())
        look = look._replace(lo=extent.lo, cell=cell, shape=shape)
        self.light = self._light(points.counts(look).reshape(shape))
        return look

    def _colours_of(self, rows: np.ndarray) -> np.ndarray:
        colours = super()._colours_of(rows)
        if self.light is not None:
            colours[:, :3] *= self.light[rows[3].astype(int)][:, None]
        return colours

    def _light(self, counts: np.ndarray) -> np.ndarray:
        """How much light falls on each cell: a surface looks where there are fewer points."""
        density = counts.astype(float)
        for axis in range(3):
            for _ in range(2):
                density = 0.5 * density + 0.25 * (
                    np.roll(density, 1, axis) + np.roll(density, -1, axis)
                )
        there = np.flatnonzero(counts)
        normal = -np.column_stack([slope.ravel()[there] for slope in np.gradient(density)])
        length = np.linalg.norm(normal, axis=1)
        facing = (normal @ self.view.T) @ (LIGHT / np.linalg.norm(LIGHT))
        facing = np.divide(facing, length, out=np.ones(len(there)), where=length > 0)
        light = np.zeros(counts.size)
        light[there] = AMBIENT + (1 - AMBIENT) * np.clip(facing, 0, 1)
        return light


class Line(Picture):
    """1D: the field over x."""

    def _prepare(self) -> Any:
        self.axes.set_xlim(self.domain.lo[0], self.domain.hi[0])
        self.axes.set_xlabel("x" + self.options.lengths, fontsize=9)
        self.axes.set_ylabel(self.options.label, fontsize=9)
        self.scale = self.axes.yaxis
        self.scale.set_major_formatter(FuncFormatter(_number))
        self.axes.grid(True, color="0.9", linewidth=0.7)
        (artist,) = self.axes.plot([], [], ".", color=SOLIDS[0], markersize=3)
        return artist

    def _apply_limits(self, lo: float, hi: float) -> None:
        self.axes.set_ylim(lo, hi)

    def _see(self, points: Seen, extent: Extent) -> Look:
        return Look(kind=float)

    def place(self, rows: np.ndarray) -> None:
        """Hand what shows of some points to the artist."""
        self.artist.set_data(rows[0], rows[2])
