"""Colours, markers, axes and labels of charts; a method always has the same colour."""

import hashlib
from collections.abc import Sequence
from math import ceil, floor, log10
from typing import TYPE_CHECKING, Any

import numpy as np

from karamelo_py.output.plots import tick_texts
from karamelo_py.script.terms import number_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

# Colours for colour-blind readers (Okabe & Ito). Each colour has a marker, for prints in grey.
PALETTE = (
    "#000000", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c510a",
    "#7a7a7a",
)  # fmt: skip
MARKERS = ("o", "s", "^", "D", "v", "P", "X", "<", ">")
DASHES = (
    "-", (0, (5, 2)), (0, (1, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (9, 3)), (0, (3, 1, 1, 1, 1, 1)),
)  # fmt: skip
PLOTLY_DASHES = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
PLOTLY_MARKERS = (
    "circle", "square", "triangle-up", "diamond", "triangle-down", "cross", "x",
    "triangle-left", "triangle-right",
)  # fmt: skip
NEAR = 0.02  # fraction of the axes within which ends of lines coincide
PART = 0.105  # fraction of a logarithmic axis that a number of six digits covers
FAMILIES = (
    ("linear", "quadratic-spline", "cubic-spline", "Bernstein-quadratic", "ugimp", "cpgimp"),
    ("FLIP", "APIC", "PIC", "MLS", "TPIC", "TFLIP", "AFLIP", "ASFLIP", "XPIC"),
    ("ulmpm", "tlmpm", "ulcpdi", "tlcpdi", "ulmpm/contacts"),
    ("musl", "usl", "usf", "usavg"),
)


def number(word: str, others: Sequence[str] = ()) -> int:
    """Return the style number of a word: fixed for methods, otherwise by order."""
    for family in FAMILIES:
        if word in family:
            return family.index(word) % len(PALETTE)
    if word in others:
        return list(others).index(word) % len(PALETTE)
    return int(hashlib.sha256(word.encode()).hexdigest(), 16) % len(PALETTE)


def styles(choices: Sequence[dict[str, str]]) -> list[tuple[str, int, int]]:
    """Choose a colour, and the numbers of a marker and of a dash pattern, for each choice.

    The first variable sets colour and marker, the others set the dashes. Known words have fixed
    styles; new words get the next unused style.
    """
    names = list(choices[0]) if choices else []
    if not names:
        return [(PALETTE[0], 0, 0)] * len(choices)
    values = {name: list(dict.fromkeys(choice[name] for choice in choices)) for name in names}
    heads = values[names[0]]
    numbers = len(heads) > 1 and all(number_of(v) is not None for v in heads)
    taken: dict[str, dict[tuple, int]] = {}
    looks = []
    for choice in choices:
        head, *rest = (choice[name] for name in names)
        k = number(head, heads)
        colour = _in_order(head, heads) if numbers else PALETTE[k]
        dashes = taken.setdefault(head, {})
        wanted = sum(number(v, values[n]) for n, v in zip(names[1:], rest, strict=True))
        tries = [(wanted + j) % len(DASHES) for j in range(len(DASHES))]
        free = [j for j in tries if j not in dashes.values()]
        looks.append((colour, k, dashes.setdefault(tuple(rest), (free or tries)[0])))
    return looks


def _in_order(value: str, values: Sequence[str]) -> str:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    ranked = sorted(values, key=number_of)
    return to_hex(colormaps["viridis"](0.85 * ranked.index(value) / (len(ranked) - 1)))


def readable(colour: str) -> str:
    from matplotlib.colors import to_hex, to_rgb

    rgb = np.array(to_rgb(colour))
    while contrast(rgb) < 4.5:
        rgb = 0.95 * rgb
    return to_hex(rgb)


def contrast(rgb: Sequence[float] | np.ndarray) -> float:
    """Return the contrast of an sRGB colour to white, from 0 to 1 (WCAG 2.1)."""
    rgb = np.asarray(rgb, float)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return 1.05 / (float(linear @ (0.2126, 0.7152, 0.0722)) + 0.05)


def log_ticks(low: float, high: float) -> list[float]:
    """Choose round ticks whose labels do not touch."""
    decades = log10(high / low)
    every = 1 if decades < 9 else ceil(decades / 8)
    exponents = range(floor(log10(low)) - 1, ceil(log10(high)) + 1)
    for leads in (
        (1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 6, 8), [k / 2 for k in range(2, 20)],
        [k / 5 for k in range(5, 50)], [k / 20 for k in range(20, 200)],
    ):  # fmt: skip
        ticks = [lead * 10.0**k for k in exponents if k % every == 0 for lead in leads]
        inside = [tick for tick in ticks if low * (1 - 1e-9) <= tick <= high * (1 + 1e-9)]
        chosen = _thinned(inside, low, high)
        if len(chosen) >= 3:
            break
    return chosen


def _thinned(ticks: Sequence[float], low: float, high: float) -> list[float]:
    chosen: list[float] = []
    for tick in ticks:
        if not chosen or tick >= chosen[-1] * (high / low) ** PART:
            chosen.append(tick)
    return chosen


def log_axis(axis: "Axis", low: float, high: float, values: Sequence[float] | None = None) -> None:
    """Make an axis logarithmic; if `values` are few, they get the ticks."""
    from matplotlib.ticker import FixedFormatter, FixedLocator, NullLocator

    axes = axis.axes
    (axes.set_xscale if axis.axis_name == "x" else axes.set_yscale)("log")
    pad = (high / low) ** 0.06 if high > low else 1.5
    low, high = low / pad, high * pad
    (axes.set_xlim if axis.axis_name == "x" else axes.set_ylim)(low, high)
    distinct = sorted(set(values or ()))
    ticks = _thinned(distinct, low, high) if 0 < len(distinct) <= 9 else log_ticks(low, high)
    axis.set_major_locator(FixedLocator(ticks))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FixedFormatter(tick_texts(ticks)))


def slope(axes: "Axes", lines: Sequence[tuple[np.ndarray, np.ndarray]], exponent: float) -> None:
    p, falls = abs(exponent), exponent < 0
    logs = [np.log([x, y]) for x, y in lines]
    low, high = min(x.min() for x, _ in logs), max(x.max() for x, _ in logs)
    bottom, top = np.log(axes.get_ylim())
    left = low + 0.5 * (high - low)
    right = min(left + 0.25 * (high - low), left + 0.3 * (top - bottom) / p)
    below = []
    for x, y in logs:
        rank = np.argsort(x)
        at = [each for each in np.linspace(left, right, 9) if x.min() <= each <= x.max()]
        below += [*np.interp(at, x[rank], y[rank])]
    head = min(below, default=bottom) - 0.05 * (top - bottom)
    foot = head - p * (right - left)
    corner = left if falls else right
    shape = np.exp([(corner, head), (corner, foot), (right + left - corner, foot)])
    axes.fill(*shape.T, facecolor="0.93", edgecolor="0.4", linewidth=0.8, zorder=1)
    axes.annotate(
        f"{p:g}", (np.exp(corner), np.exp((head + foot) / 2)), xytext=(-4 if falls else 4, 0),
        textcoords="offset points", ha="right" if falls else "left", va="center", fontsize=8,
    )  # fmt: skip
    axes.annotate(
        "1", (np.exp((left + right) / 2), np.exp(foot)), xytext=(0, -3),
        textcoords="offset points", ha="center", va="top", fontsize=8,
    )  # fmt: skip
    axes.set_ylim(bottom=np.exp(min(bottom, foot - 0.07 * (top - bottom))))


def apart(wanted: Sequence[float], gap: float, low: float, high: float) -> np.ndarray:
    """Move values so that they are in order, `gap` or more apart, and within `low` and `high`."""
    rank = np.argsort(wanted, kind="stable")
    count = max(len(rank) - 1, 1)
    steps = min(gap, (high - low) / count) * np.arange(len(rank))
    # After the least distances are subtracted, positions only have to increase.
    shifted = np.maximum.accumulate(np.asarray(wanted, float)[rank] - steps)
    shifted = np.maximum(np.minimum(shifted, high - steps[-1]), low)
    result = np.empty(len(shifted))
    result[rank] = shifted + steps
    return result


def direct_labels(axes: "Axes", ends: Sequence[tuple[float, float, str, str]]) -> None:
    if not ends:
        return
    axes.autoscale_view()
    to_axes = axes.transData + axes.transAxes.inverted()
    names: dict[tuple[str, str, int, int], list[str]] = {}
    positions: dict[tuple[str, str, int, int], Any] = {}
    for x, y, name, colour in ends:
        position = to_axes.transform((x, y))
        head, _, rest = name.partition(", ")
        key = (head, colour, *np.rint(position / NEAR).astype(int).tolist())
        names.setdefault(key, []).append(rest)
        positions.setdefault(key, position)
    at = np.array(list(positions.values()))
    size = 9 if len(at) <= 16 else 7
    places = apart(at[:, 1], 0.0052 * size, 0.0, 1.0)
    for ((head, colour, *_), rests), (x, y), position in zip(
        names.items(), at, places, strict=True
    ):
        name = ", ".join(filter(None, (head, " / ".join(dict.fromkeys(rests)))))
        axes.plot(
            [x, 1.0, 1.03], [y, position, position], transform=axes.transAxes, clip_on=False,
            color=colour, linewidth=0.6, alpha=0.6, zorder=1,
        )  # fmt: skip
        axes.text(
            1.04, position, name, transform=axes.transAxes, color=readable(colour), fontsize=size,
            va="center",
        )  # fmt: skip
