"""dump movie: the pictures of dump pyplot, one after the other in one file."""

from functools import cached_property

from karamelo_py.output.files import Frames, movie_format
from karamelo_py.styles.dumps.pyplot import PyPlot

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

    @cached_property
    def frames(self) -> Frames:
        """The pictures so far."""
        return Frames(FRAMES_PER_SECOND)

    def check_format(self) -> str:
        """Read the format that the file name asks for."""
        return movie_format(self.file)

    def write(self) -> None:
        """Draw the present state as the next frame."""
        self.frames.add(self.draw)

    def finish(self) -> None:
        """Write the movie of all frames so far."""
        self.frames.save(self.path())
