"""Draw tables of verification.md: python docs/pictures.py writes docs/_static/convergence.png."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from karamelo_py.app.studies import look
from karamelo_py.output.files import savefig
from karamelo_py.output.plots import blank_figure, tidy

DOCS = Path(__file__).parent
METHODS = ("", "", "", "", "", "", "CPDI R4", "CPDI Q4", "tlmpm linear")  # after those of `look`


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


def panel(axes, lines: dict[str, tuple[list[float], list[float]]]) -> None:
    """Errors over cells by method, and a triangle of second order."""
    cells, errors = ([a for line in lines.values() for a in line[k]] for k in (0, 1))
    look.log_axis(axes.xaxis, min(cells), max(cells), cells)
    look.log_axis(axes.yaxis, min(errors), max(errors))
    ends = []
    for name, (x, y) in lines.items():
        marker = look.number(name.partition(",")[0], METHODS)
        colour = look.PALETTE[marker]
        axes.plot(x, y, color=colour, marker=look.MARKERS[marker], lw=1.5, ms=5)
        ends.append((x[-1], y[-1], name, colour))
    look.slope(axes, [*lines.values()], -2)
    tidy(axes)
    look.direct_labels(axes, ends)


def main() -> None:
    """Convergence of the bases on in.axis_aligned, and of domains on in.column."""
    figure = blank_figure(10.5, 4.6)
    left, right = figure.subplots(1, 2)
    square = {
        name: ([8, 16, 32], numbers(four or two))
        for name, _, _, two, _, four, _ in rows("| basis | G = 1e-4")
    }
    column = {}
    for name, *errors in rows("| cells | 1 | 2"):
        found = [(2**k, float(e)) for k, e in enumerate(errors) if e]
        column[name] = tuple(map(list, zip(*found, strict=True)))
    panel(left, square)
    panel(right, column)
    left.set(title="Pulsating square, G = 0.1", xlabel="cells / side")
    left.set(ylabel="relative error of the displacement")
    right.set(title="Column under its own weight", xlabel="cells / height")
    right.set(ylabel="mean error of the stress / (rho g l0)")
    savefig(figure, DOCS / "_static" / "convergence.png")


if __name__ == "__main__":
    main()
