"""dump pyplot and movie."""

import re
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any, BinaryIO, Literal

import numpy as np

from karamelo_py.language.kinds import In
from karamelo_py.language.signature import OutputFile, Positive
from karamelo_py.output.fields import ColumnFormula, ShownColumn, check_columns
from karamelo_py.output.files import Frames, movie_format, picture_format, savefig, unwarned, whole
from karamelo_py.output.point_table import PointTable
from karamelo_py.output.quantity import Caption
from karamelo_py.output.rhythm import Every
from karamelo_py.output.snapshots import Snapshot
from karamelo_py.output.units import labelled, time_text
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, meant
from karamelo_py.styles.dumps.base import Dump

DPI = 100
# Larger widths and heights are taken as pixels.
MOST_INCHES = 50
LEAST_PIXELS, MOST_PIXELS = 20, 20000
PNG_COMPRESSION = 1
# Signed components have a diverging colour map that is grey at 0.
SIGNED = re.compile(r"[vfb][xyz](_update)?|[se][123]{2}")
MAP, SIGNED_MAP = "viridis", "coolwarm"
EDGES = ("xmin", "ymin", "zmin"), ("xmax", "ymax", "zmax")
SAMPLE = 1 << 16  # points that are sampled to find the typical size


class PyPlot(Dump):
    """Draw a picture of the points, coloured by a field or by their solid.

    In 1D the field is drawn as a curve against x.

    Parameters
    ----------
    every
        Steps between two pictures, or ``time(T)``. The first and the last state of a run are drawn.
    file
        File name ending in .png, .pdf or .svg. The first ``*`` becomes the step number; without
        ``*`` each picture replaces the previous one.
    width, height
        Size of the picture: up to 50 in inches (of 100 pixels), above 50 in pixels, at most 20000.
    field
        Column of dump particle that is shown by colour, or a formula of columns, groups and solids
        (1 for their points, else 0), time and published values. Default: the solid (in 1D: vx).
    vmin, vmax
        Limits of the colours. By default they widen from picture to picture to include all values
        so far. If values exceed the limits, the colour bar ends in an arrow.
    cmap
        A Matplotlib colour map; default viridis, or coolwarm for components with either sign.
    azimuth, elevation
        Viewing direction in 3D, in degrees: the angles around z from x, and above the horizon.
    axes
        false: without axes and numbers.
    title
        Text above the picture, before step and time. A name or formula in braces is replaced by its
        value, as in "force {press_y} N"; write a literal brace twice. Text between dollar signs is
        set as mathematics, as in "$v_{max}$".
    label
        Label of the colour bar, such as "stress (MPa)"; default: the column.
    only
        Draw only points that meet this condition on columns, groups, solids: ``not tool && y > 0``.
    xmin, xmax, ymin, ymax, zmin, zmax
        Limits of the view; default: the domain.
    scale
        log: colours show the logarithm of the field.
    quantile
        Fraction of the values below the lower colour limit, and above the upper one, such as 0.01.
    dpi
        Pixels per inch, by default 100. With 300, a width of 600 gives 1800 pixels.
    fontsize
        Font size in points.
    pointsize
        Size of the drawn points relative to the material points; 1.4 fills all gaps.
    mirror
        true: in an axisymmetric scene, draw the points on both sides of the axis.
    outlines
        true: lines around each solid, and around the regions, walls and rigid tools of fixes.

    Example
    -------
    dump(d3, all, pyplot, 100, picture.*.png, 500, 500, seq, vmin=0, vmax=2e5)
    dump(d4, all, pyplot, 100, paper.*.pdf, 5, 4, seq, only=s1 && x > 0, quantile=0.01)

    See Also
    --------
    dump movie
    """

    remembers = carries = ("seen",)
    format_of = staticmethod(picture_format)

    def __init__(
        self,
        hub: Hub,
        every: Every,
        file: OutputFile,
        width: Annotated[float, Positive],
        height: Annotated[float, Positive],
        field: ShownColumn | None = None,
        *,
        vmin: float | None = None,
        vmax: float | None = None,
        cmap: str | None = None,
        azimuth: float = -60.0,
        elevation: Annotated[float, In(-90, 90)] = 30.0,
        axes: bool = True,
        title: str | None = None,
        label: str | None = None,
        only: ColumnFormula | None = None,
        xmin: float | None = None, xmax: float | None = None,
        ymin: float | None = None, ymax: float | None = None,
        zmin: float | None = None, zmax: float | None = None,
        scale: Literal["linear", "log"] = "linear",
        quantile: Annotated[float, In(0, 0.4)] = 0.0,
        dpi: Annotated[int, In(20, 2400)] = DPI,
        fontsize: Annotated[float, In(1, 100)] = 9.0,
        pointsize: Annotated[float, Positive] = 1.0,
        mirror: bool = False,
        outlines: bool = False,
    ):  # fmt: skip
        self.formula = field if isinstance(field, ShownColumn) else None
        columns = self.formula.columns if self.formula else [] if field is None else [field]
        check_columns(columns, hub.fields.shown_names(), first=4)
        super().__init__(hub, every, file, *columns)
        self.format_of(self.file)
        if mirror and not (hub.domain and hub.domain.kin.hoops):
            raise ScriptError(
                "only an axisymmetric scene can be mirrored at its axis",
                argument="mirror",
                expected="axisymmetric(true), or no mirror",
            )
        self.size = (_inches("width", width, dpi), _inches("height", height, dpi))
        self.warn_of_absent(columns, hub.fields.absent_at_points(), "points")
        self.field = self.formula.text if self.formula else field
        self.title, self.only, self.dpi = title and Caption(hub, title), only, dpi
        self.look = look_of(
            self.field or "vx",
            hub.domain.dimension if hub.domain else None,
            vmin=vmin, vmax=vmax, cmap=cmap, azimuth=azimuth, elevation=elevation, axes=axes,
            label=label, window=((xmin, xmax), (ymin, ymax), (zmin, zmax)), scale=scale,
            quantile=quantile, fontsize=fontsize, pointsize=pointsize, mirror=mirror,
            outlines=outlines,
        )  # fmt: skip
        self.limits = self.look["limits"]
        self._picture: Any = None
        self._limits: tuple[float, float] | None = None

    @property
    def seen(self) -> tuple[Any, ...]:
        limits = self._picture.limits if self._picture is not None else self._limits
        return limits, self._label(), *self._marks()

    @seen.setter
    def seen(self, seen: tuple[Any, ...] | None) -> None:
        limits, *of = seen or (None,)
        if of == [self._label(), *self._marks()]:  # a resumed script may choose another field
            self._limits = limits
            if self._picture is not None:
                self._picture.begin_with(limits)

    def _marks(self) -> list[Any]:
        more = [self.look[name] for name in ("log", "quantile") if self.look[name]]
        return [*self.limits, *more]

    def write(self) -> None:
        self.save(self.path())

    def save(self, path: Path) -> None:
        with unwarned():
            if picture_format(path) == "png":
                with whole(path) as file:
                    self.draw(file)
            else:
                self._draw()
                savefig(self._picture.figure, path)

    def draw(self, file: BinaryIO) -> None:
        with unwarned():
            self._draw()
            self._picture.save_png(file, PNG_COMPRESSION)

    def _draw(self) -> None:
        update = self.hub.update
        if self._picture is None:
            self._picture = self._make()
        units = self.hub.output.units
        title = title_of(update.step, update.time, units.time if units else "")
        if self.title:
            title = f"{self.title}: {title}"
        snapshot = self.snapshot()
        fixes = self.hub.fixes.values() if self.look["outlines"] else ()
        self._picture.show(snapshot, self.side(snapshot), title, tools_of(fixes))

    def _make(self) -> Any:
        # Importing Matplotlib takes 0.3 s.
        from karamelo_py.output import pictures

        units = self.hub.output.units
        label = self._label()
        look = {"label": labelled(label, units.of_column(label)) if units else label}
        options = pictures.Options(
            label,
            solids=tuple(self.hub.solids) if label == "type" else (),
            lengths=units.length if units else "",
            **(look | self.look),
        )
        made = pictures.make(self.hub.domain, self.size, self.dpi, options)
        made.begin_with(self._limits)
        return made

    def snapshot(self) -> Snapshot:
        label, domain, update = self._label(), self.hub.domain, self.hub.update
        names = dict.fromkeys(["id", "type", "x", "y", "z", "volume", label])
        pieces = [self._chosen(table, names) for table in self.hub.fields.pieces(to_first=True)]
        columns = dict(zip(names, map(np.concatenate, zip(*pieces, strict=True)), strict=True))
        return Snapshot(update.step, update.time, columns, domain.lo, domain.hi)

    def _chosen(self, table: PointTable, names: Iterable[str]) -> list[np.ndarray]:
        of = self.formula
        columns = [
            of.of(table) if of and name == of.text else table.particle(name) for name in names
        ]
        return columns if self.only is None else [c[self.only.holds(table)] for c in columns]

    def take_part(self) -> None:
        for _ in self.hub.fields.pieces(to_first=True):
            pass

    def side(self, snapshot: Snapshot) -> float:
        columns, domain = snapshot.columns, self.hub.domain
        volume = columns["volume"]
        if hoops := domain.kin.hoops:
            x = columns["x"]
            volume = volume / np.maximum(x, 1e-3 * x.max(initial=0.0)) ** hoops  # area of a ring
        some = volume[columns["id"] % -(-self.hub.fields.count // SAMPLE) == 0]
        return float(np.median(some)) ** (1 / domain.dimension) if len(some) else 0.0

    def _label(self) -> str | ShownColumn:
        if self.field is not None:
            return self.field
        return "vx" if self.hub.domain.dimension == 1 else "type"


def title_of(step: int, time: float, unit: str) -> str:
    if unit:
        return f"t = {time_text(time, unit)}"
    return f"step {step}" + ("" if np.isnan(time) else f", time {time:.6g}")


def tools_of(fixes: Iterable[Any]) -> list[Any]:
    from karamelo_py.output.outlines import Tool

    return [
        Tool(
            lambda x, of=fix.depth_of: of(SimpleNamespace(position=x)),
            fix.faces_of and fix.faces_of(),
        )
        for fix in fixes
        if fix.depth_of is not None
    ]


def look_of(
    column: str,
    dimension: int,
    *,
    vmin: float | None,
    vmax: float | None,
    cmap: str | None,
    label: str | None,
    window: tuple[tuple[float | None, float | None], ...],
    scale: str,
    outlines: bool,
    **look: Any,
) -> dict[str, Any]:
    """Check the keywords and return the settings of a picture."""
    ranges = ((vmin, vmax), "vmin", "vmax"), *zip(window, *EDGES, strict=True)
    for (first, last), low, high in ranges:
        if first is not None and last is not None and first >= last:
            range_of = "colours" if low == "vmin" else "picture"
            message = f"the {range_of} cannot go from {first:g} to {last:g}"
            raise ScriptError(message, argument=high, expected=f"a number above {low}")
    if outlines and dimension == 1:
        message = "outlines are drawn in 2D and 3D, and this scene is 1D"
        raise ScriptError(message, argument="outlines", expected="false")
    log = scale == "log"
    if log and min((end for end in (vmin, vmax) if end is not None), default=1.0) <= 0:
        message = "a logarithmic scale needs colour limits above 0"
        raise ScriptError(message, argument="vmin", expected="colour limits above 0")
    signed = SIGNED.fullmatch(column) is not None and not log
    if cmap is not None:
        from matplotlib import colormaps

        if cmap not in colormaps:
            raise ScriptError(
                f"Matplotlib has no colour map '{cmap}'",
                argument="cmap",
                expected="viridis, coolwarm, magma, gray, jet ...",
                hint=meant(cmap, colormaps),
            )
    symmetric = signed and (vmin, vmax) == (None, None)
    look |= {"limits": (vmin, vmax), "symmetric": symmetric, "log": log}
    look["outlines"] = outlines
    look |= {"cmap": cmap or (SIGNED_MAP if signed else MAP)}
    look |= {"window": window if any(end is not None for ends in window for end in ends) else ()}
    return look if label is None else look | {"label": label}


def _inches(argument: str, value: float, dpi: int) -> float:
    inches = value if value <= MOST_INCHES else value / DPI
    if not LEAST_PIXELS <= inches * dpi <= MOST_PIXELS:
        raise ScriptError(
            f"a {argument} of {inches * dpi:g} pixels cannot be drawn",
            argument=argument,
            expected=f"up to {MOST_INCHES} in inches (of {DPI} pixels), above that in pixels; "
            f"from {LEAST_PIXELS} to {MOST_PIXELS} pixels",
        )
    return inches


FRAMES_PER_SECOND = 25


class Movie(PyPlot):
    """Draw a movie of the points with 25 pictures per second, as dump pyplot draws them.

    The file is written at the end of each run, even if the run failed or was interrupted.

    Parameters
    ----------
    every
        Steps between two frames, or ``time(T)``. The first and the last state of a run are drawn.
    file
        File name ending in .gif or, if the program ffmpeg is installed, .mp4.
    vmin, vmax
        Limits of the colours. By default the range grows; in ``karamelo-py view`` it is constant.

    Example
    -------
    dump(d3, all, movie, 100, disks.gif, 500, 500, seq, vmin=0, vmax=2e5)

    See Also
    --------
    dump pyplot
    """

    remembers = ("frames",)
    format_of = staticmethod(movie_format)

    @cached_property
    def frames(self) -> Frames:
        return Frames(FRAMES_PER_SECOND)

    def write(self) -> None:
        self.frames.add(self.draw)

    def finish(self) -> None:
        self.frames.save(self.path())
