"""What parts of a scene remember from step to step, as plain data.

A part names the attributes in which it keeps what it has seen or added up::

    class Dose(Compute):
        remembers = ("total",)

Numbers, texts, bytes, arrays, lists, tuples and dictionaries of these can be kept, and objects
whose class says in the same way what they remember. Classes add to what their bases name. After a
part has got back what it remembers, its method ``resumed()`` is called where it has one.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from karamelo_py.language.faults import fault


def remembered(part: Any) -> tuple[str, ...]:
    """Names of the attributes that a part and its bases name in ``remembers``."""
    names = (name for c in reversed(type(part).__mro__) for name in vars(c).get("remembers", ()))
    return tuple(dict.fromkeys(names))


def memory_of(part: Any, arrays: list[np.ndarray]) -> dict[str, Any]:
    """What a part remembers, as JSON knows it; arrays are put into `arrays` and numbered.

    Raises
    ------
    ScriptError
        If an attribute is there that cannot be written.
    """
    found = {}
    for name in remembered(part):
        try:
            found[name] = _written(getattr(part, name), arrays)
        except TypeError as error:
            who, place = type(part).__name__, getattr(part, "place", None)
            raise fault(who, f"remembers: {name} is {error}", place) from None
    return found


def _written(value: Any, arrays: list[np.ndarray]) -> Any:
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, (bytes, np.ndarray)):
        kind = "bytes" if isinstance(value, bytes) else "array"
        arrays.append(np.frombuffer(value, np.uint8) if kind == "bytes" else value)
        return {kind: len(arrays) - 1}
    if type(value) in (list, tuple):
        return {type(value).__name__: [_written(item, arrays) for item in value]}
    if type(value) is dict:
        items = value.items()
        return {"dict": [[_written(k, arrays), _written(v, arrays)] for k, v in items]}
    if remembered(value):
        return {"part": memory_of(value, arrays)}
    raise TypeError(f"a {type(value).__name__}, which no file takes")


def remember(part: Any, memory: dict[str, Any], arrays: list[np.ndarray]) -> None:
    """Give a part back what it remembered."""
    for name in remembered(part):
        if name in memory:
            kept = memory[name]
            if isinstance(kept, dict) and "part" in kept:
                if remembered(there := getattr(part, name)):
                    remember(there, kept["part"], arrays)
            elif not remembered(getattr(part, name)):
                setattr(part, name, _read(kept, arrays))


def _read(kept: Any, arrays: list[np.ndarray]) -> Any:
    if not isinstance(kept, dict):
        return kept
    ((kind, content),) = kept.items()
    if kind == "array":
        return arrays[content]
    if kind == "bytes":
        return arrays[content].tobytes()
    if kind == "dict":
        return {_read(k, arrays): _read(v, arrays) for k, v in content}
    items = [_read(item, arrays) for item in content]
    return tuple(items) if kind == "tuple" else items
