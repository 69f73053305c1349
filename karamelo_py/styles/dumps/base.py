"""The base of dumps: a rhythm, a file name with the step in it, checked columns."""

from collections.abc import Sequence
from pathlib import Path

from karamelo_py.language.signature import OutputFile
from karamelo_py.output.files import discarded, folder_of_discarded
from karamelo_py.output.log import begins_anew
from karamelo_py.output.rhythm import Every, Rhythmic
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Place


class Dump(Rhythmic):
    """Base of the dump styles: override `write`, which is called when the dump is due.

    Parameters
    ----------
    every
        Steps between two snapshots, or ``time(T)``. The first and the last state of a run are
        always written.
    file
        File name. The first ``*`` becomes the step number; without ``*`` all snapshots follow each
        other in one file.
    columns
        What to write, as the style understands it.
    """

    style = ""
    place: Place | None = None

    def __init__(
        self,
        hub: Hub,
        every: Every,
        file: OutputFile,
        *columns: str,
    ):
        self.hub = hub
        self.every = every
        self.file = Path(file)
        hub.output.check_file(self.file)
        self.columns = columns
        self.last_step: int | None = None

    @property
    def one_file_per_step(self) -> bool:
        """Tell if the name has a ``*``."""
        return "*" in str(self.file)

    def path(self) -> Path:
        """The file of the present state."""
        folder, file = folder_of_discarded(), self.file
        folder, file = (self.hub.folder, file) if folder is None else (folder, file.name)
        return folder / str(file).replace("*", str(self.hub.update.step), 1)

    def write(self) -> None:
        """Write the present state."""
        raise NotImplementedError

    def take_part(self) -> None:
        """Do the same as the first of several processes, which alone keeps what is written."""
        with discarded():
            self.write()

    def finish(self) -> None:
        """Complete what is written; called at the end of each run, also of one that breaks off."""

    def warn_of_absence(self) -> None:
        """Tell that a file to go on in is not as the run left it that is gone on from."""
        self.hub.warn(begins_anew(self.path()), place=self.place)

    def warn_of_absent(self, columns: Sequence[str], absent: Sequence[str], what: str) -> None:
        """Warn of columns that are 0 because no point or node (`what`) keeps them."""
        empty = [name for name in dict.fromkeys(columns) if name in absent]
        if empty:
            self.hub.warn(f"dump: {', '.join(empty)} will be 0: {what} have no such field")
