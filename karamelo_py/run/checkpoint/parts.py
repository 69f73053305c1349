"""States of the parts of a scene, for rollback and restart files.

A class lists the attributes of its state; names in base classes are added::

    class Dose(Compute):
        remembers = ("total",)

Attributes may be numbers, texts, bytes, arrays, NumPy's random generators, lists, tuples, sets and
dictionaries of these, and objects whose class has ``remembers``. The optional methods ``resumed()``
and ``filed()`` are called after a part is restored and before a file stores it. If another script
reads a restart file, outputs begin new files and restore only the names in ``carries``.
"""

from __future__ import annotations

import copy
import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.kernels.step import DONE
from karamelo_py.language.faults import fault
from karamelo_py.output.rhythm import Rhythmic
from karamelo_py.run.state import SceneState
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Publisher
from karamelo_py.script.errors import ScriptError

WITH_STYLE = (Publisher, Rhythmic)
OUTPUTS = ("dump", "log", "curve", "restart")
CLOCK_VALUES = ("time", "timestep", "dt")  # stored with the arrays of a state, not here

Key = tuple[str, str, str]  # family, ID and style
Memory = dict[str, Any]  # state of a part, in JSON types


class PartStates(NamedTuple):
    parts: dict[Key, Memory]
    arrays: list[np.ndarray]  # indexed by the numbers in `parts`
    values: dict[str, float]

    @classmethod
    def of(cls, hub: Hub, families: tuple[str, ...] = ()) -> PartStates:
        arrays: list[np.ndarray] = []
        parts = {
            key: state_of(item, arrays, grows=key[0] in OUTPUTS)
            for key, item in parts_of(hub)
            if not families or key[0] in families
        }
        names = (name for name in hub.values.names() if not families and name not in CLOCK_VALUES)
        return cls(parts, arrays, {name: hub.values.get(name) for name in names})

    def give(self, hub: Hub, *, cut: bool = False, anew: bool = False) -> None:
        """Restore all parts; with `cut`, outputs continue in their files, or start `anew`."""
        for name, value in self.values.items():
            if name in hub.values:
                hub.values.set(name, value)
        for key, item in parts_of(hub):
            if key not in self.parts:
                continue
            state, begins = self.parts[key], anew and key[0] in OUTPUTS
            if begins:
                state = {name: state[name] for name in named(item, "carries") if name in state}
            give_state(item, state, self.arrays)
            has_file = hub.settings.comm.leads or key[0] not in OUTPUTS
            if (cut or anew) and not begins and has_file and hasattr(item, "resumed"):
                item.resumed()


def named(item: object, where: str = "remembers") -> tuple[str, ...]:
    return _named_by(type(item), where)


@functools.cache
def _named_by(kind: type, where: str) -> tuple[str, ...]:
    names = (name for c in reversed(kind.__mro__) for name in vars(c).get(where, ()))
    return tuple(dict.fromkeys(names))


def parts_of(hub: Hub) -> Iterator[tuple[Key, object]]:
    return ((key, item) for key, item in _all_parts(hub) if named(item))


def _all_parts(hub: Hub) -> Iterator[tuple[Key, object]]:
    yield ("update", "", ""), hub.update
    yield ("method", "", ""), hub.update.method
    for catalogue in hub.catalogues:
        for ID, item in catalogue.items():
            style = item.style if isinstance(item, WITH_STYLE) else ""
            yield (catalogue.kind, ID, style or type(item).__name__), item
    for curve in hub.output.plots.values():
        yield ("curve", curve.id, ""), curve
    for item in hub.output.last:
        yield ("restart", str(item.file), ""), item
        # The log comes last, because it shows values of the parts before it.
    yield ("log", "", ""), hub.output.log


def state_of(item: object, arrays: list[np.ndarray], *, grows: bool = False) -> Memory:
    memory: Memory = {}
    for name in named(item):
        value = getattr(item, name)
        if named(value):
            memory[name] = {"part": state_of(value, arrays, grows=grows)}
        elif grows and type(value) is list:
            memory[name] = Grown(value, len(value), arrays)
        else:
            try:
                memory[name] = plain(value, arrays)
            except TypeError as error:
                mark = item.mark if isinstance(item, WITH_STYLE) else None
                why = fault(type(item).__name__, f"remembers: {name} is {error}", mark)
                memory[name] = Unwritable(_copied(value), why)
    return memory


def give_state(item: object, state: Memory, arrays: list[np.ndarray]) -> None:
    for name in named(item):
        kept, present = state.get(name, item), getattr(item, name)
        if isinstance(kept, dict) and "part" in kept:
            if named(present):
                give_state(present, kept["part"], arrays)
        elif kept is not item and not named(present):
            setattr(item, name, value_of(kept, arrays))


@dataclass
class Grown:
    items: list
    length: int
    arrays: list[np.ndarray]

    def value(self) -> list:
        return self.items[: self.length]

    def plain(self) -> Any:
        return plain(self.value(), self.arrays)


@dataclass
class Unwritable:
    """A value that cannot be stored in a file, and the reason."""

    kept: object
    fault: ScriptError

    def value(self) -> object:
        return _copied(self.kept)

    def plain(self) -> Any:
        raise self.fault


def _copied(value: object) -> object:
    try:
        return copy.deepcopy(value)
    except Exception:
        return value


def _generator(kind: str, state: dict) -> np.random.Generator:
    source = getattr(np.random, kind)()
    source.state = state
    return np.random.Generator(source)


def _random_state(state: dict) -> np.random.RandomState:
    generator = np.random.RandomState()
    generator.set_state(state)
    return generator


# For each type that JSON lacks: functions that convert a value to JSON arguments, and back.
KINDS: dict[type, tuple[Callable, Callable]] = {
    tuple: (list, lambda *items: items),
    set: (list, lambda *items: set(items)),
    dict: (lambda items: [list(item) for item in items.items()], lambda *items: dict(items)),
    complex: (lambda z: [z.real, z.imag], complex),
    bytes: (lambda text: [np.frombuffer(text, np.uint8)], np.ndarray.tobytes),
    bytearray: (lambda text: [np.array(text)], bytearray),
    np.generic: (lambda x: [x.dtype.str, x.item()], lambda kind, x: np.dtype(kind).type(x)),
    np.random.Generator: (
        lambda of: [type(of.bit_generator).__name__, of.bit_generator.state],
        _generator,
    ),
    np.random.RandomState: (lambda of: [of.get_state(legacy=False)], _random_state),
}
MADE = {kind.__name__: make for kind, (_, make) in KINDS.items()}


def plain(value: object, arrays: list[np.ndarray]) -> Any:
    """Convert a value to JSON types; arrays go to `arrays` and are replaced by their indices."""
    kind = np.generic if isinstance(value, np.generic) else type(value)
    if value is None or (isinstance(value, (bool, int, float, str)) and kind is not np.generic):
        return value
    if isinstance(value, np.ndarray):
        arrays.append(value.copy())
        return {"array": len(arrays) - 1}
    if kind is list:
        return [plain(item, arrays) for item in value]
    if kind not in KINDS:
        raise TypeError(f"a {kind.__name__}, which cannot be stored")
    return {kind.__name__: plain(KINDS[kind][0](value), arrays)}


def value_of(kept: object, arrays: list[np.ndarray]) -> Any:
    if isinstance(kept, (Grown, Unwritable)):
        return kept.value()
    if isinstance(kept, list):
        return [value_of(item, arrays) for item in kept]
    if not isinstance(kept, dict):
        return kept
    ((kind, content),) = kept.items()
    return arrays[content].copy() if kind == "array" else MADE[kind](*value_of(content, arrays))


class RollbackPoint:
    def __init__(self, hub: Hub, halve: bool) -> None:
        self.hub, self.halve = hub, halve
        self.halvings = self.returns = 0  # halvings so far in the run; returns to this state so far
        self.arrays: dict[str, np.ndarray] = {}
        self.step = -1
        self._parts: dict[int, PartStates] = {}

    @property
    def parts(self) -> PartStates:
        return self._parts[self.step]

    def keep(self, simulation: SceneState, *, forget: bool = True) -> None:
        """Make the present state the last good one; `forget` drops earlier states of the parts."""
        self.arrays, self.step = simulation.snapshot(self.arrays), simulation.step
        others = {} if forget else self._parts
        self._parts = others | {self.step: PartStates.of(self.hub)}

    def take(self, arrays: dict[str, np.ndarray], step: int, parts: PartStates) -> None:
        self.arrays, self.step, self._parts = arrays, step, {step: parts}

    def note(self, *, always: bool) -> None:
        step = self.hub.update.step
        outputs = (item for key, item in parts_of(self.hub) if key[0] in OUTPUTS)
        if always or any(item.last_step == step for item in outputs):
            self._parts[step] = PartStates.of(self.hub)

    def return_to(self, simulation: SceneState, *, cut: bool = False) -> None:
        """Return to the last good state; with `cut`, outputs are cut at it and continue from it."""
        simulation.restore(self.arrays)
        self.parts.give(self.hub, cut=cut)
        if cut:
            self._parts = {self.step: self.parts}

    def again(self, advance: Callable[[int], int], end: int) -> int:
        """Repeat the steps up to `end`, restoring parts at the noted steps; return the status."""
        update = self.hub.update
        while update.step < end:
            noted = min((step for step in self._parts if update.step < step < end), default=end)
            status = advance(noted - update.step)
            if status != DONE:
                return status
            if update.step in self._parts:
                self._parts[update.step].give(self.hub)
        return DONE
