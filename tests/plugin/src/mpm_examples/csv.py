"""dump csv."""

import numpy as np

from karamelo_py.styles.dumps.base import OfPoints, TableDump


class Csv(OfPoints, TableDump):
    """Write the material points as a table with commas.

    Parameters
    ----------
    every
        Steps between two snapshots, or ``time(T)``.
    file
        File name; its ``*`` becomes the step number.
    columns
        What to write of each point, as in dump particle.

    Example
    -------
    dump(d, all, csv, 100, points.*.csv, x, vx)
    """

    def write(self) -> None:
        """Write the present state."""
        points = self.table()
        rows = np.column_stack([points.ids, *points.columns])
        header = ",".join(["id", *self.columns])
        np.savetxt(self.path(), rows, "%.10g", ",", header=header, comments="")
