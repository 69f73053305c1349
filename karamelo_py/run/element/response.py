"""Response of a point: a table of its strains, stresses and energies, and a picture of it."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from karamelo_py.output.files import savefig, whole
from karamelo_py.output.plots import blank_figure, tidy
from karamelo_py.points import laws as materials
from karamelo_py.run.element.load_path import COMPONENTS
from karamelo_py.run.element.point import Point

WIDTH = 17  # as many as a number of ten digits, its sign and its exponent take, and a blank


def pressure(point: Point) -> float:
    """-tr(stress)/3."""
    return -float(point.stress[:3].sum()) / 3


def von_mises_stress(point: Point) -> float:
    """sqrt(3/2 s:s), s the deviatoric stress."""
    xx, yy, zz, *shear = point.stress
    normal = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2
    return float(np.sqrt(normal / 2 + 3 * np.sum(np.square(shear))))


def columns(point: Point) -> dict[str, Callable[[], float]]:
    """Return the columns that are written of a point, by name."""
    law, kin = point.law, point.kin
    count = len(kin.symmetric_names)
    found: dict[str, Callable[[], float]] = {"time": lambda: point.time}
    for k, name in enumerate(COMPONENTS[:count]):
        found[f"e{name}"] = lambda k=k: point.strain[k]
    for k, name in enumerate(COMPONENTS[:count]):
        found[f"s{name}"] = lambda k=k: point.stress[k]
    found["p"] = lambda: pressure(point)
    found["q"] = lambda: von_mises_stress(point)
    found["J"] = lambda: materials.jacobian(law, kin, point.state)
    found["stored"] = lambda: materials.energy_density(law, kin, point.state)
    found["work"] = lambda: point.work
    for name, what in materials.columns_of(law).items():
        found[name] = lambda what=what: materials.shown(what, law, kin, point.state)
    return found


class Response:
    """The answer of a point so far, a row for each increment.

    Attributes
    ----------
    names
        Names of the columns.
    rows
        Lists of their values.
    """

    def __init__(self, point: Point):
        self._columns = columns(point)
        self.names = list(self._columns)
        self.rows: list[list[float]] = []
        self.observe()

    def observe(self) -> None:
        """Add the present state."""
        # A zero is added so that none is negative.
        self.rows.append([float(value()) + 0.0 for value in self._columns.values()])

    def last(self) -> dict[str, float]:
        """The last row, by column."""
        return dict(zip(self.names, self.rows[-1], strict=True))

    def write(self, path: Path) -> None:
        """Write the table, in the form of the log: a line of names, a line for each row."""
        formats = [f"%-{WIDTH}.10g"] * (len(self.names) - 1) + ["%.10g"]
        header = "".join(name.ljust(WIDTH) for name in self.names).rstrip()
        with whole(path) as file:
            np.savetxt(file, self.rows, fmt=formats, delimiter="", header=header, comments="")

    def draw(self, path: Path, title: str) -> None:
        """Draw the stresses over the strain that changes most, and q over p."""
        table = dict(zip(self.names, np.transpose(self.rows), strict=True))
        strains = [name for name in self.names if name.startswith("e") and name[1:] in COMPONENTS]
        driven = max(strains, key=lambda name: np.ptp(table[name]))
        stresses = [f"s{name[1:]}" for name in strains]
        largest = max(float(np.abs(table[name]).max()) for name in stresses)
        figure = blank_figure(9.6, 4.0)
        left, right = figure.subplots(1, 2)
        # Dashes let a curve show that lies under another.
        for name, dashes in zip(stresses, ("-", "--", ":") * 2, strict=False):
            if np.abs(table[name]).max() > 1e-6 * largest:
                left.plot(table[driven], table[name], dashes, label=name, linewidth=1.4)
        left.set_xlabel(driven)
        left.set_ylabel("Cauchy stress")
        right.plot(table["p"], table["q"], linewidth=1.4)
        right.plot(table["p"][:1], table["q"][:1], "o", color="0.3", label="start")
        right.set_xlabel("pressure p")
        right.set_ylabel("von Mises stress q")
        for axes in (left, right):
            tidy(axes)
            # Room for labels such as 0.0025 side by side, and powers of ten for longer ones.
            axes.locator_params(axis="x", nbins=6)
            axes.ticklabel_format(scilimits=(-3, 4))
            if axes.get_legend_handles_labels()[0]:
                axes.legend(frameon=False)
        figure.suptitle(title)
        savefig(figure, path)
