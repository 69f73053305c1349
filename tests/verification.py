"""Help for the tests that run the scenes of inputs/ with many methods and on many grids.

A `Way` is a method as a script of inputs/ takes it from the command line. A table of ways becomes
the parameters of a test.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from conftest import INPUTS

from comparisons.results import Result, Table, read_dump

# Transfers that take a share of FLIP.
BLENDS = ("FLIP", "AFLIP", "ASFLIP")


@dataclass(frozen=True)
class Way:
    """kind, basis, transfer, share of FLIP, and the word for domains (R4, stretch, ...)."""

    kind: str = "ulmpm"
    basis: str = "linear"
    transfer: str = "FLIP"
    share: float = 1
    domains: str = "mechanical"

    @property
    def name(self) -> str:
        """Name of the test."""
        words = [self.kind, self.basis, self.transfer]
        return "-".join(words if self.domains == "mechanical" else [*words, self.domains])

    @property
    def variables(self) -> dict[str, Any]:
        """Variables for the command line."""
        alpha = self.share if self.transfer in BLENDS else "mechanical"
        return {
            "kind": self.kind,
            "basis": self.basis,
            "transfer": self.transfer,
            "alpha": alpha,
            "domains": self.domains,
        }


LINEAR = Way()
QUADRATIC = Way(basis="quadratic-spline")
CUBIC = Way(basis="cubic-spline")
BERNSTEIN = Way(basis="Bernstein-quadratic")
UGIMP = Way(basis="ugimp")
STRETCH = Way(basis="cpgimp", domains="stretch")
CPDI_R = Way(kind="ulcpdi", domains="R4")
CPDI_Q = Way(kind="ulcpdi", domains="Q4")
TOTAL = Way(kind="tlmpm")
TOTAL_CUBIC = Way(kind="tlmpm", basis="cubic-spline")
TOTAL_BERNSTEIN = Way(kind="tlmpm", basis="Bernstein-quadratic")
TOTAL_CPDI = Way(kind="tlcpdi", domains="R4")


# Each way takes most of a minute to compile: these run always, the others with ``-m full``.
ALWAYS = (LINEAR,)


def table(*rows: tuple, marks: tuple = (), always: tuple = ALWAYS) -> list:
    """Parameters from rows (way, ...), named by the way; rare ways are marked ``full``."""
    return [
        pytest.param(
            *row,
            id=row[0].name,
            marks=[*marks] if row[0] in always else [pytest.mark.full, *marks],
        )
        for row in rows
    ]


def transfers(*names: str) -> list[Way]:
    """Linear ULMPM with these transfers."""
    return [replace(LINEAR, transfer=name) for name in names]


def run_scene(
    run_script, scene: str, way: Way | None = LINEAR, status: int = 0, **variables: Any
) -> Result:
    """Run inputs/in.`scene` with a way and more variables, in a folder of its own.

    On one thread: the numbers are the same, and nothing is compiled a second time.
    """
    words = {**(way.variables if way else {}), **variables}
    options = ["--threads", "1"]
    options += [part for name, value in words.items() for part in ("-var", name, str(value))]
    folder = "_".join([scene, *(str(value) for value in words.values())]).replace("/", "-")
    return run_script(INPUTS / f"in.{scene}", *options, status=status, folder=folder)


def last_dump(result: Result, name: str) -> Table:
    """The last snapshot of the dump `name`.*.LAMMPS."""
    files = result.folder.glob(f"{name}.*.LAMMPS")
    return read_dump(max(files, key=lambda path: int(path.name.split(".")[-2])))[-1]


def order(sizes, errors) -> float:
    """Slope of log(error) over log(h) by least squares."""
    return float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def errors_on(run_script, scene: str, way: Way, grids, column="error_z", **variables) -> list:
    """The last value of a column of the log for each refinement."""
    return [
        float(run_scene(run_script, scene, way, refine=grid, **variables).log[column][-1])
        for grid in grids
    ]
