"""Published values, by name."""

from collections.abc import Sequence

import numpy as np

from karamelo_py.script.errors import ScriptError

CAPACITY = 2048
TIME, TIMESTEP, DT = 0, 1, 2
SUFFIXES = ("x", "y", "z", "s", "")


def in_a_row(suffixes: Sequence[str]) -> bool:
    places = [SUFFIXES.index(suffix) for suffix in suffixes if suffix in SUFFIXES]
    return not places or places == list(range(places[0], places[0] + len(suffixes)))


class Values:
    """Named numbers in an array that kernels read and write.

    The array is never reallocated. Slots 0, 1 and 2 are time, timestep (the step number) and dt;
    slots 3 and 4 have no names (`kernels.totals`).
    """

    def __init__(self) -> None:
        self.array = np.zeros(CAPACITY)
        self._slots: dict[str, int] = {}
        self._of: dict[str, dict[str, int]] = {}  # slots by name, for each ID
        self._first: dict[str, int] = {}  # slot of ID_x, even if this name is not published
        self._used = 0
        # Slot of the torque that belongs to a force, by the force's slot x; 0 if there is none.
        self.torques = np.zeros(CAPACITY, np.int64)
        for name in ("time", "timestep", "dt"):
            self.publish(name)
        self._reserve(2)

    def publish(self, name: str, value: float = 0.0) -> int:
        """Publish a number and return its slot. A known name retains its slot."""
        if name not in self._slots:
            self._slots[name] = self._reserve(1)
        slot = self._slots[name]
        self.array[slot] = value
        return slot

    def publish_vector(self, ID: str, suffixes: Sequence[str] = SUFFIXES, *others: str) -> None:
        """Publish ``ID_x`` for the suffix "x" and so on, ``ID`` for "".

        Slots of x, y, z, s are consecutive, even if not all are published; so are slots of other
        suffixes. Names published earlier that are not in `suffixes` or `others` are removed.
        """
        if ID not in self._first:
            self._first[ID] = self._reserve(len(SUFFIXES))
        first, further = self._first[ID], [s for s in suffixes if s not in SUFFIXES]
        begin = self._slots.get(f"{ID}_{further[0]}", -1) if further else 0
        if any(self._slots.get(f"{ID}_{s}") != begin + k for k, s in enumerate(further)):
            begin = self._reserve(len(further))
        places = {s: first + k for k, s in enumerate(SUFFIXES) if s in suffixes}
        places |= {s: begin + k for k, s in enumerate(further)}
        slots = {}
        for suffix, number in places.items():
            name = f"{ID}_{suffix}" if suffix else ID
            self._slots[name] = number
            slots[name] = self.publish(name)
        kept = {f"{ID}_{suffix}" if suffix else ID for suffix in others}
        for name, slot in self._of.get(ID, {}).items():
            if name not in slots.keys() | kept and self._slots.get(name) == slot:
                del self._slots[name]
        self._of[ID] = slots

    def publish_torque(self, ID: str) -> None:
        """Publish ``ID_tx``, ``ID_ty``, ``ID_tz``, the torque about the origin.

        ``ID_t2x``, ... are the torque on the second of two solids.
        """
        first = self._first[ID]
        if not self.torques[first]:
            self.torques[first] = self._reserve(6)
        for k, suffix in enumerate(("tx", "ty", "tz", "t2x", "t2y", "t2z")):
            self._slots[f"{ID}_{suffix}"] = int(self.torques[first]) + k

    def torque_of(self, ID: str) -> np.ndarray:
        """Return a view of the torque (6,), or (0,) if no compute needs it."""
        slot = int(self.torques[self._first[ID]])
        return self.array[slot : slot + 6 * bool(slot)]

    def slot(self, name: str) -> int:
        return self._slots[name]

    def names(self) -> list[str]:
        return list(self._slots)

    def __contains__(self, name: object) -> bool:
        return name in self._slots

    def get(self, name: str) -> float:
        return float(self.array[self.slot(name)])

    def set(self, name: str, value: float) -> None:
        self.array[self.slot(name)] = value

    def _reserve(self, count: int) -> int:
        first = self._used
        if first + count > CAPACITY:
            raise ScriptError(
                f"there are more than {CAPACITY} values of fixes, computes and elements",
                hint="reuse the IDs of deleted fixes and computes, whose values remain in memory; "
                "put further elements (25 values or more each) into another script",
            )
        self._used += count
        return first
