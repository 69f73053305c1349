"""The look that all plots share."""

from math import floor, log10
from typing import Any


def blank_figure(width: float, height: float) -> Any:
    """Make an empty figure of Matplotlib, in inches, that needs no display."""
    # Matplotlib takes a third of a second to import: only scenes with plots pay it.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), dpi=150, layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def tick_text(a: float, _: Any = None) -> str:
    """Write a number at an axis: 0.02, 500, 3·10^-7."""
    if a == 0 or 1e-3 <= abs(a) < 1e5:
        return f"{a:g}"
    exponent = floor(log10(abs(a)) + 1e-9)
    lead = a / 10**exponent
    tens = f"10^{{{exponent}}}"
    return f"${tens}$" if abs(lead - 1) < 1e-9 else rf"${lead:g}\cdot{tens}$"


def real_ticks(axis: Any) -> None:
    """Real numbers at the ticks of a linear axis, no power of ten and no sum beside it."""
    from matplotlib.ticker import MaxNLocator, ScalarFormatter

    class WholeNumbers(ScalarFormatter):
        def __call__(self, x: float, pos: int | None = None) -> str:
            largest = abs(self.axis.get_view_interval()).max()
            if largest == 0 or 1e-3 <= largest < 1e5:
                return super().__call__(x, pos)
            return tick_text(float(f"{x / largest:.12f}") * largest)

    if type(axis.get_major_formatter()) is ScalarFormatter:
        whole = WholeNumbers(useOffset=False)
        whole.set_scientific(False)
        axis.set_major_formatter(whole)
        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10]))  # few digits


def tidy(axes: Any) -> None:
    """Draw a light grid, no frame on the far sides, and real numbers at the ticks."""
    real_ticks(axes.xaxis)
    real_ticks(axes.yaxis)
    axes.grid(True, color="0.9", linewidth=0.7)
    axes.spines[["top", "right"]].set_visible(False)
