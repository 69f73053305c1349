"""dump pyplot and movie: pictures of the points, drawn with Matplotlib."""

import re
from functools import cached_property
from typing import Annotated, Any, BinaryIO

import numpy as np

from karamelo_py.language.kinds import In
from karamelo_py.language.signature import OutputFile, Positive
from karamelo_py.output.fields import check_columns
from karamelo_py.output.files import Frames, movie_format, picture_format, savefig, unwarned, whole
from karamelo_py.output.rhythm import Every
from karamelo_py.output.snapshots import Snapshot
from karamelo_py.output.units import labelled
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, meant
from karamelo_py.styles.dumps.base import Dump

DPI = 100
# Above this, a width or height is meant in pixels.
MOST_INCHES = 50
LEAST_PIXELS, MOST_PIXELS = 20, 20000
# Fast and nearly as small as the best for pictures of few colours.
PNG_COMPRESSION = 1
# Components have either sign: their colours are of two kinds, with grey at 0.
SIGNED = re.compile(r"[vfb][xyz](_update)?|[se][123]{2}")
MAP, SIGNED_MAP = "viridis", "coolwarm"
SAMPLE = 1 << 16  # points, about, that say how large one is


class PyPlot(Dump):
    """Draw a picture of the points, coloured by a field or by their solid.

    In 2D and 3D the points are drawn where they are, in 1D the field is drawn over x. The limits
    of the colours grow with what has been seen, so that the pictures of a run can be compared,
    unless they are given. The figure is made once and only its points are drawn anew.

    Parameters
    ----------
    every
        Steps between two pictures, or ``time(T)``. The first and the last state of a run are
        always drawn.
    file
        File name ending in .png, .pdf or .svg. The first ``*`` becomes the step number; without
        ``*`` each picture takes the place of the one before.
    width, height
        Size of the picture: up to 50 in inches (of 100 pixels), above that in pixels; from 20 to
        20000 pixels.
    field
        What colours the points: any column of dump particle. Without it the solid does (in 1D: vx
        is drawn).
    vmin, vmax
        Ends of the colours. Where a picture has values beyond, the bar beside it ends in an arrow.
    cmap
        A colour map of Matplotlib; viridis, or coolwarm for components, which have either sign.
    azimuth, elevation
        In 3D, from where it is seen, in degrees: around z from x on, and above the horizon.
    axes
        false: without axes and numbers.
    title
        What is written above, in front of step and time.

    Example
    -------
    dump(d3, all, pyplot, 100, picture.*.png, 500, 500, seq, vmin=0, vmax=2e5)

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
        field: str | None = None,
        *,
        vmin: float | None = None,
        vmax: float | None = None,
        cmap: str | None = None,
        azimuth: float = -60.0,
        elevation: Annotated[float, In(-90, 90)] = 30.0,
        axes: bool = True,
        title: str | None = None,
    ):
        if field is not None:
            check_columns([field], hub.fields.particle_names(), first=4)
        super().__init__(hub, every, file, *([] if field is None else [field]))
        self.format = self.format_of(self.file)
        self.size = (_inches("width", width), _inches("height", height))
        if field is not None:
            self.warn_of_absent([field], hub.fields.absent_at_points(), "points")
        if vmin is not None and vmax is not None and vmin >= vmax:
            raise ScriptError(
                f"the colours cannot go from {vmin:g} to {vmax:g}",
                argument="vmax",
                expected="a number above vmin",
            )
        self.field = field
        self.limits = (vmin, vmax)
        self.title = title
        self.look = {"azimuth": azimuth, "elevation": elevation, "axes": axes}
        self.symmetric, self.cmap = colours_of(field or "vx", self.limits, cmap)
        self._picture: Any = None
        self._limits: tuple[float, float] | None = None

    @property
    def seen(self) -> tuple[Any, ...]:
        """Limits of the field so far, and what they are those of."""
        limits = self._picture.limits if self._picture is not None else self._limits
        return limits, self._label(), *self.limits

    @seen.setter
    def seen(self, seen: tuple[Any, ...] | None) -> None:
        limits, *of = seen or (None,)
        if of == [self._label(), *self.limits]:  # a script that goes on may show something else
            self._limits = limits
            if self._picture is not None:
                self._picture.begin_with(limits)

    def write(self) -> None:
        with unwarned():
            if self.format == "png":
                with whole(self.path()) as file:
                    self.draw(file)
            else:
                self._draw()
                savefig(self._picture.figure, self.path())

    def draw(self, file: BinaryIO) -> None:
        """Draw the present state as PNG into an open file."""
        with unwarned():
            self._draw()
            self._picture.save_png(file, PNG_COMPRESSION)

    def _draw(self) -> None:
        update = self.hub.update
        if self._picture is None:
            self._picture = self._make()
        title = f"step {update.step}, time {update.time:.6g}"
        if self.hub.output.units is not None:
            title += f" {self.hub.output.units.time}"
        if self.title:
            title = f"{self.title}: {title}"
        snapshot = self.snapshot()
        self._picture.show(snapshot, self.side(snapshot), title)

    def _make(self) -> Any:
        # Matplotlib takes a third of a second to import: only scenes with pictures pay it.
        from karamelo_py.output import pictures

        units = self.hub.output.units
        label = self._label()
        options = pictures.Options(
            label,
            labelled(label, units.of_column(label)) if units else label,
            tuple(self.hub.solids) if label == "type" else (),
            self.limits,
            self.symmetric,
            self.cmap,
            lengths=f" [{units.length}]" if units else "",
            **self.look,
        )
        made = pictures.make(self.hub.domain, self.size, DPI, options)
        made.begin_with(self._limits)
        return made

    def snapshot(self) -> Snapshot:
        """Take what a picture needs of all points, some of them after others."""
        label, domain, update = self._label(), self.hub.domain, self.hub.update
        names = dict.fromkeys(["id", "x", "y", "z", "volume", label])
        tables = self.hub.fields.pieces(to_first=True)
        pieces = [[table.particle(name) for name in names] for table in tables]
        columns = dict(zip(names, map(np.concatenate, zip(*pieces, strict=True)), strict=True))
        return Snapshot(update.step, update.time, columns, domain.lo, domain.hi)

    def take_part(self) -> None:
        for _ in self.hub.fields.pieces(to_first=True):
            pass

    def side(self, snapshot: Snapshot) -> float:
        """Measure the side length of a typical point."""
        columns, domain = snapshot.columns, self.hub.domain
        volume = columns["volume"]
        if domain.axisymmetric:
            x = columns["x"]
            volume = volume / np.maximum(x, 1e-3 * x.max(initial=0.0))  # of a ring, per radian
        some = volume[columns["id"] % -(-self.hub.fields.count // SAMPLE) == 0]
        return float(np.median(some)) ** (1 / domain.dimension) if len(some) else 0.0

    def _label(self) -> str:
        if self.field is not None:
            return self.field
        return "vx" if self.hub.domain.dimension == 1 else "type"


def colours_of(
    column: str, limits: tuple[float | None, float | None], cmap: str | None
) -> tuple[bool, str]:
    """Choose for a column if limits that grow lie about 0, and the colour map."""
    signed = SIGNED.fullmatch(column) is not None
    if cmap is not None:
        from matplotlib import colormaps

        if cmap not in colormaps:
            raise ScriptError(
                f"Matplotlib has no colour map '{cmap}'",
                argument="cmap",
                expected="viridis, coolwarm, magma, gray, jet ...",
                hint=meant(cmap, colormaps),
            )
    # Where the user says about what the colours lie, they do not lie about 0.
    return signed and limits == (None, None), cmap or (SIGNED_MAP if signed else MAP)


def _inches(argument: str, value: float) -> float:
    inches = value if value <= MOST_INCHES else value / DPI
    if not LEAST_PIXELS <= inches * DPI <= MOST_PIXELS:
        raise ScriptError(
            f"a {argument} of {inches * DPI:g} pixels cannot be drawn",
            argument=argument,
            expected=f"up to {MOST_INCHES} in inches (of {DPI} pixels), above that in pixels; "
            f"from {LEAST_PIXELS} to {MOST_PIXELS} pixels",
        )
    return inches


FRAMES_PER_SECOND = 25


class Movie(PyPlot):
    """Draw a movie of the points, as dump pyplot draws pictures: 25 frames in a second.

    The file is written at the end of each run, also of one that breaks off or is interrupted.

    Parameters
    ----------
    every
        Steps between two frames, or ``time(T)``. The first and the last state of a run are
        always drawn.
    file
        File name ending in .gif or, where the program ffmpeg is installed, .mp4.
    vmin, vmax
        Ends of the colours. Without them the colours change when numbers outgrow them.

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
