"""One number of a scene beside the number that somebody else found."""

from typing import NamedTuple


class Row(NamedTuple):
    """What was measured in a scene.

    `quantity` names it with its unit; `published` is the number to meet (or the two ends of a
    range), `source` says whose it is; `within` is the relative difference that is allowed to the
    run that was made. A `published` of zero makes `within` absolute.
    """

    quantity: str
    published: float | tuple[float, float]
    computed: float
    within: float
    source: str

    @property
    def difference(self) -> float:
        """Relative to the published number, or to the nearer end of a range; 0 inside a range."""
        low, high = self.published if isinstance(self.published, tuple) else (self.published,) * 2
        nearest = min(max(self.computed, low), high)
        return (self.computed - nearest) / (abs(nearest) or 1.0)

    @property
    def agrees(self) -> bool:
        """Whether the difference is allowed; false for NaN."""
        return abs(self.difference) <= self.within
