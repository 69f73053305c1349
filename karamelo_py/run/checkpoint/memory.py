"""What parts of a scene remember from step to step, as plain data.

A part names the attributes in which it keeps what it has seen or added up::

    class Dose(Compute):
        remembers = ("total",)

Numbers, texts, bytes, arrays, generators of random numbers of NumPy, lists, tuples, sets and
dictionaries of these can be kept, and objects whose class says in the same way what they remember.
Classes add to what their bases name. After a part has got back what it remembers, its method
``resumed()`` is called where it has one; before a file takes that, ``filed()``. What writes files,
such as a dump, begins them anew in another script (read_restart), and gets back there only what it
names in ``carries``, too.
"""

from typing import Any

import numpy as np

from karamelo_py.language.faults import fault


def remembered(part: Any) -> tuple[str, ...]:
    """Names of the attributes that a part and its bases name in ``remembers``."""
    return _named(part, "remembers")


def carried(part: Any) -> tuple[str, ...]:
    """Names of those attributes that another script goes on with, which begins files anew."""
    return _named(part, "carries")


def _named(part: Any, where: str) -> tuple[str, ...]:
    names = (name for c in reversed(type(part).__mro__) for name in vars(c).get(where, ()))
    return tuple(dict.fromkeys(names))


def memory_of(part: Any, arrays: list[np.ndarray]) -> dict[str, Any]:
    """What a part remembers, as JSON knows it; arrays are put into `arrays` and numbered.

    Raises
    ------
    ScriptError
        If an attribute is there that cannot be written.
    """
    if hasattr(part, "filed"):
        part.filed()
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
    if isinstance(value, complex):
        return {"complex": [value.real, value.imag]}
    if isinstance(value, (bytes, bytearray, np.ndarray)):
        kind = "array" if isinstance(value, np.ndarray) else type(value).__name__
        arrays.append(value if kind == "array" else np.frombuffer(bytes(value), np.uint8))
        return {kind: len(arrays) - 1}
    if isinstance(value, np.random.Generator):
        source = value.bit_generator
        return {"Generator": [type(source).__name__, _written(source.state, arrays)]}
    if isinstance(value, np.random.RandomState):
        return {"RandomState": _written(value.get_state(legacy=False), arrays)}
    if type(value) in (list, tuple, set):
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
    if kind in ("bytes", "bytearray"):
        found = arrays[content].tobytes()
        return found if kind == "bytes" else bytearray(found)
    if kind == "complex":
        return complex(*content)
    if kind == "Generator":
        source = getattr(np.random, content[0])()
        source.state = _read(content[1], arrays)
        return np.random.Generator(source)
    if kind == "RandomState":
        found = np.random.RandomState()
        found.set_state(_read(content, arrays))
        return found
    if kind == "dict":
        return {_read(k, arrays): _read(v, arrays) for k, v in content}
    items = [_read(item, arrays) for item in content]
    return {"tuple": tuple, "set": set, "list": list}[kind](items)
