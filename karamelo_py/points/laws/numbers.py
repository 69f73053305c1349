"""A parameter of a law that is several numbers: a curve, a formula."""

from collections.abc import Iterable


class Numbers:
    """Numbers in a row, which do not change; kernels see an array.

    Laws of one kind may have rows of different lengths: the shorter ones are filled up with their
    last number, so that a law that has to know the length keeps it beside.
    """

    def __init__(self, values: Iterable[float]):
        self.values = tuple(float(value) for value in values)

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, k: int) -> float:
        return self.values[k]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Numbers) and self.values == other.values

    def __hash__(self) -> int:
        return hash(self.values)

    def __repr__(self) -> str:
        return f"Numbers({self.values})"

    def filled(self, length: int) -> list[float]:
        """The numbers, the last one repeated up to `length`."""
        return [*self.values, *self.values[-1:] * (length - len(self.values))]
