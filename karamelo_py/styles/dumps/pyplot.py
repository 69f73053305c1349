"""dump pyplot: pictures of the points, drawn with Matplotlib."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from karamelo_py.language.signature import OutputFile, Positive
from karamelo_py.output.files import picture_format, savefig, unwarned, whole
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.base import Dump

DPI = 100
# Above this, a width or height is meant in pixels.
MOST_INCHES = 50
LEAST_PIXELS, MOST_PIXELS = 20, 20000
# Fast and nearly as small as the best for pictures of few colours.
PNG_COMPRESSION = 1


class PyPlot(Dump):
    """Draw a picture of the points, coloured by a field or by their solid.

    In 2D and 3D the points are drawn where they are, in 1D the field is drawn over x. The limits
    of the colours grow with what has been seen, so that the pictures of a run can be compared. The
    figure is made once and only its points are drawn anew.

    Parameters
    ----------
    every
        Steps between two pictures. The first and the last state of a run are always drawn.
    file
        File name ending in .png, .pdf or .svg. The first ``*`` becomes the step number; without
        ``*`` each picture takes the place of the one before.
    width, height
        Size of the picture: up to 50 in inches (of 100 pixels), above that in pixels; from 20 to
        20000 pixels.
    field
        What colours the points: any column of dump particle. Without it the solid does (in 1D: vx
        is drawn).

    Example
    -------
    dump(d3, all, pyplot, 100, picture.*.png, 500, 500, seq)
    """

    def __init__(
        self,
        hub: Hub,
        every: Annotated[int, Positive],
        file: OutputFile,
        width: Annotated[float, Positive],
        height: Annotated[float, Positive],
        field: str | None = None,
    ):
        if field is not None:
            self.check_columns([field], hub.fields.particle_names(), first=4)
        super().__init__(hub, every, file)
        self.format = picture_format(self.file)
        self.size = (_inches("width", width), _inches("height", height))
        if field is not None:
            self.warn_of_absent([field], hub.fields.absent_at_points(), "points")
        self.field = field
        self._picture: Any = None

    def write(self) -> None:
        """Draw the present state."""
        # Matplotlib takes a third of a second to import: only scenes with pictures pay it.
        from karamelo_py.styles.dumps import picture

        with unwarned():
            self._draw(picture)

    def _draw(self, picture: Any) -> None:
        if self._picture is None:
            self._picture = picture.make(self.hub.domain, self.size, DPI, self._label())
        fields, update = self.hub.fields, self.hub.update
        x = np.column_stack([fields.particle(name) for name in "xyz"])
        values = fields.particle(self._label())
        size = float(np.median(fields.particle("volume"))) ** (1 / self.hub.domain.dimension)
        title = f"step {update.step}, time {update.time:.6g}"
        self._picture.show(x, values, size, title)
        path = self.path()
        if self.format == "png":
            with whole(path) as file:
                self._picture.save_png(file, PNG_COMPRESSION)
        else:
            savefig(self._picture.figure, path)

    def _label(self) -> str:
        if self.field is not None:
            return self.field
        return "vx" if self.hub.domain.dimension == 1 else "type"


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
