"""Draw the tables of verification.md: python docs/pictures.py writes docs/_static/*.png."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

sys.path.insert(0, str(Path(__file__).parents[1]))

from comparisons.pictures import STYLE

matplotlib.use("Agg")
import matplotlib.pyplot as plt

DOCS = Path(__file__).parent


def rows(start: str) -> list[list[str]]:
    """Cells of the table whose head begins with `start`, without the head."""
    lines = (DOCS / "verification.md").read_text(encoding="utf-8").splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith(start)) + 2
    table = []
    for line in lines[first:]:
        if not line.startswith("|"):
            return table
        table.append([cell.strip() for cell in line.strip("|").split("|")])
    return table


def numbers(cell: str) -> list[float]:
    """The numbers in a cell."""
    return [float(word) for word in cell.split(",")] if cell else []


def slope(axes, h: list[float], error: float) -> None:
    """A dashed line of second order through the last point."""
    axes.plot(h, [error * (x / h[-1]) ** 2 for x in h], "k--", lw=0.8, label="second order")


def main() -> None:
    """Convergence of the bases on in.axis_aligned, and of domains on in.column."""
    plt.rcParams.update({**STYLE, "font.size": 9})
    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 5), layout="constrained")
    h = [1 / 8, 1 / 16, 1 / 32]
    for name, _, _, two, _, four, _ in rows("| basis | G = 1e-4"):
        left.loglog(h, numbers(four or two), "o-", ms=3, label=name)
    slope(left, h, 4e-3)
    left.set(
        title="in.axis_aligned, G = 0.1", xlabel="cell / side (1)", ylabel="relative error (1)"
    )
    left.set_ylim(top=50)
    left.legend(loc="upper left", ncols=2)
    for name, *errors in rows("| cells | 1 | 2"):
        found = [(1 / 2**k, float(e)) for k, e in enumerate(errors) if e]
        right.loglog(*zip(*found, strict=True), "o-", ms=3, label=name)
    slope(right, [1 / 4, 1 / 256], 1e-5)
    right.set(
        title="in.column",
        xlabel="cell / height (1)",
        ylabel="mean error of the stress / (rho g l0) (1)",
    )
    right.legend()
    figure.savefig(DOCS / "_static" / "convergence.png", dpi=110)


if __name__ == "__main__":
    main()
