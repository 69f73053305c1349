"""What a run leaves behind, read back: the table of its log and the snapshots of its dumps."""

import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np


class Table(dict):
    """Columns by name: a log or one snapshot of a dump."""

    def __getattr__(self, name: str) -> np.ndarray:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"no column {name}; there are {', '.join(self)}") from None


def read_log(path: Path) -> Table:
    """The table of log.mpm; lines that begin with # repeat headers."""
    lines = path.read_text(encoding="utf-8").splitlines()
    rows = [line.split() for line in lines[1:] if not line.startswith("#")]
    columns = np.array(rows, float).reshape(len(rows), -1).T
    return Table(zip(lines[0].split(), columns, strict=True))


def read_dump(path: Path) -> list[Table]:
    """The snapshots of a LAMMPS dump, each with TIMESTEP, TIME and its columns in order of ids."""
    opener = gzip.open if path.suffix == ".gz" else open
    with opener(path, "rt", encoding="utf-8") as file:
        lines = file.read().splitlines()
    snapshots, time = [], 0.0
    k = 0
    while k < len(lines):
        assert lines[k].startswith("ITEM: "), lines[k]
        item = lines[k][len("ITEM: ") :]
        if item == "TIMESTEP":
            snapshot = Table(TIMESTEP=int(lines[k + 1]), TIME=time)
            snapshots.append(snapshot)
            k += 2
        elif item == "TIME":
            time = float(lines[k + 1])  # it stands before the step
            k += 2
        elif item.startswith("NUMBER OF ATOMS"):
            count = int(lines[k + 1])
            k += 2
        elif item.startswith("BOX BOUNDS"):
            k += 4
        elif item.startswith("ATOMS"):
            names = item.split()[1:]
            rows = np.array([line.split() for line in lines[k + 1 : k + 1 + count]], float)
            rows = rows[np.argsort(rows[:, 0])]
            snapshot.update(zip(names, rows.T, strict=True))
            k += 1 + count
        else:
            k += 2
    return snapshots


@dataclass
class Result:
    """A finished run: exit status, what it said, and the folder that holds its files."""

    status: int
    out: str
    err: str
    folder: Path

    @property
    def log(self) -> Table:
        """The table in log.mpm."""
        return read_log(self.folder / "log.mpm")

    def dump(self, name: str) -> Table:
        """The last (or only) snapshot in a dump."""
        return read_dump(self.folder / name)[-1]

    def snapshots(self, name: str) -> list[Table]:
        """The snapshots of the dump `name`.*.LAMMPS, in order of steps."""
        files = self.folder.glob(f"{name}.*.LAMMPS")
        return [read_dump(f)[-1] for f in sorted(files, key=lambda f: int(f.name.split(".")[-2]))]
