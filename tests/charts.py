"""What a chart must have for print: units, numbers, contrast, and labels that do not overlap."""

import re

from matplotlib.colors import to_rgb

CONTRAST = 4.5  # WCAG 2.1, level AA, of text


def luminance(colour):
    """Relative luminance (WCAG 2.1)."""
    linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in to_rgb(colour)]
    return sum(share * c for share, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one, other):
    """The ratio of two luminances."""
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def _texts(axes):
    """All that is written along the axes, as far as it is seen."""
    for axis, ends in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        low, high = sorted(ends)
        ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
        yield from (
            label
            for tick in ticks
            for label in (tick.label1, tick.label2)
            if low <= tick.get_loc() <= high and label.get_text() and label.get_visible()
        )
        yield axis.label
    yield axes.title


# Quantities without a unit, apart from ratios.
DIMENSIONLESS = re.compile(
    r"cells|points per cell|stretch|FLIP coefficient|fraction of .*|shear|damage|density, pressure"
    r"|.*strain|.*error.*|.* / .*"
)


def has_unit(label):
    """Return True for a label that ends with a unit or names a number."""
    return bool(re.search(r"\([^()]+\)$", label) or DIMENSIONLESS.fullmatch(label))


def faults(figure):
    """What is wrong with a figure, in words."""
    figure.canvas.draw()
    found, boxes = [], []
    for axes in figure.axes:
        written = [text for text in _texts(axes) if text.get_text()]
        for axis, name in ((axes.xaxis, "x"), (axes.yaxis, "y")):
            label = axis.label.get_text()
            bar = axes.get_label() == "<colorbar>"
            if label and not has_unit(label):
                found.append(f"no unit: {label!r}")
            if not label and not bar:
                found.append(f"no label along {name}")
            numbers = [t.get_text() for t in (*axis.get_ticklabels(), *axis.get_ticklabels(True))]
            if not any(numbers) and not bar:
                found.append(f"no numbers along {name}")
        for text in written:
            if contrast(text.get_color(), figure.get_facecolor()) < CONTRAST:
                found.append(f"little contrast: {text.get_text()!r} in {text.get_color()}")
            boxes.append((text.get_text(), text.get_window_extent()))
    for k, (one, box) in enumerate(boxes):
        for other, against in boxes[k + 1 :]:
            if box.overlaps(against) and box.shrunk(0.9, 0.9).overlaps(against):
                found.append(f"{one!r} lies on {other!r}")
    return found
