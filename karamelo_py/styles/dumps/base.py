"""What every dump has: a rhythm, a file name with the step in it, checked columns."""

from collections.abc import Sequence
from pathlib import Path

from karamelo_py.language.signature import OutputFile
from karamelo_py.output.rhythm import Every, Rhythmic
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Place, unknown

# Columns, and other words for what they are together.
QUANTITIES = {
    "s11 s22 s33 s12 s13 s23 seq": ("stress", "sigma", "sig"),
    "seq": ("mises", "vonmises", "von_mises", "svm"),
    "e11 e22 e33 e12 e13 e23": ("strain", "eps", "epsilon"),
    "x y z": ("pos", "position", "positions", "coord", "coordinates"),
    "vx vy vz": ("vel", "velocity", "v"),
    "fx fy fz": ("force", "forces", "f"),
    "x y z x0 y0 z0": ("u", "disp", "displacement"),
    "T": ("temp", "temperature"),
}


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
        """Whether the name has a ``*``."""
        return "*" in str(self.file)

    def path(self) -> Path:
        """The file of the present state."""
        return self.hub.folder / str(self.file).replace("*", str(self.hub.update.step), 1)

    def write(self) -> None:
        """Write the present state."""
        raise NotImplementedError

    def finish(self) -> None:
        """Complete what is written; called at the end of each run, also of one that breaks off."""

    def warn_of_absence(self) -> None:
        """Tell that a file to go on in is not as the run left it that is gone on from."""
        self.hub.warn(
            f"{self.path()} is not as the run left it that is gone on from: it begins anew",
            place=self.place,
        )

    def warn_of_absent(self, columns: Sequence[str], absent: Sequence[str], what: str) -> None:
        """Warn of columns that are 0 because no point or node (`what`) keeps them."""
        empty = [name for name in dict.fromkeys(columns) if name in absent]
        if empty:
            self.hub.warn(f"dump: {', '.join(empty)} will be 0: {what} have no such field")

    @staticmethod
    def check_columns(columns: Sequence[str], known: Sequence[str], *, first: int) -> None:
        """Refuse names that are not `known`.

        `first` is the place of the first column among the arguments of the style.

        Raises
        ------
        ScriptError
            Naming the nearest known column.
        """
        for index, name in enumerate(columns):
            if name not in known:
                error = unknown(f"unknown column '{name}'", name, known, argument=first + index)
                quantity = next((q for q, words in QUANTITIES.items() if name.lower() in words), "")
                if columns_of_it := [column for column in quantity.split() if column in known]:
                    error.hint = f"did you mean {', '.join(columns_of_it)}?"
                if name[:2] in ("v_", "c_"):  # as in LAMMPS
                    error.hint = f"log_modify(custom, step, time, {name[2:]}) writes one number"
                raise error
