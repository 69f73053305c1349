"""Lines of LAMMPS as they are written here, where that can be said of a line alone."""

import math
import re
from collections.abc import Callable

from karamelo_py.script.lammps_formula import formula_of, free_name
from karamelo_py.script.other_programs import instead

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_ENDED = {"unfix": "delete_fix", "uncompute": "delete_compute", "undump": "delete_dump"}
_NAMED = ("region", "group", "fix", "compute", "dump", *_ENDED)
_SAID_ANYWAY = ("id", "type")  # columns of a dump
_SAME = ("x", "y", "z", "vx", "vy", "vz", "mass")
# LAMMPS counts in units of a lattice where a line does not say otherwise.
_LENGTHS = "with numbers in units of length, not of a lattice"
_NEVER = 10**9  # steps: more than a run has
_SHAPES = {"block": 6, "sphere": 4, "cylinder": 6}  # and how many words say where they are
_PUT_TOGETHER = {"union": "union", "intersect": "intersection"}
_NO_SHAPES = ("cone", "plane", "prism", "ellipsoid")
_REGION = f"region(ID, block, xlo, xhi, ylo, yhi), or cylinder, or sphere, {_LENGTHS}"
_GROUP = "group(ID, particles, region, regionID, all), or with solid, solidID for all"
_GROUPED_BY = (
    "clear", "delete", "dynamic", "empty", "id", "include", "intersect", "molecule", "static",
    "subtract", "type", "union", "variable",
)  # fmt: skip


def line_of(name: str, words: list[str]) -> str | None:
    """What to write for ``name word word``; None where more has to be known than this line."""
    rule = _RULES.get(name)
    return rule(with_name(name, words)) if rule is not None else None


def with_name(command: str, words: list[str]) -> list[str]:
    """The words with an ID that is a name in the place of a number."""
    return [_name(words[0]), *words[1:]] if command in _NAMED and words else words


def _name(ID: str) -> str:
    return f"n{ID}" if re.fullmatch(r"\d\w*", ID) else ID


def _are_names(*words: str) -> bool:
    return all(re.fullmatch(r"[A-Za-z_]\w*", word, re.ASCII) for word in words)


def _numbers(words: list[str], *others: str) -> bool:
    """Whether the words are numbers, or some of the `others`."""
    return all(
        word in others or (_NUMBER.fullmatch(word) and math.isfinite(float(word))) for word in words
    )


def _count(words: list[str]) -> int | None:
    return int(words[0]) if len(words) == 1 and re.fullmatch("[0-9]{1,18}", words[0]) else None


def _lengths_of(options: list[str]) -> str | None:
    """What to add for the unit of length that the options name, None if it is a lattice's."""
    return {"": f", {_LENGTHS}", "units box": ""}.get(" ".join(options))


def _timestep(words: list[str]) -> str | None:
    right = len(words) == 1 and _numbers(words) and float(words[0]) > 0
    return f"set_dt({words[0]})" if right else None


def _thermo(words: list[str]) -> str | None:
    every = _count(words)
    if every == 0:
        return f"set_output({_NEVER}): the first and the last state are logged in any case"
    return None if every is None else f"set_output({every})"


def _dimension(words: list[str]) -> str | None:
    forms = {
        "2": "dimension(2, xlo, xhi, ylo, yhi, h)",
        "3": "dimension(3, xlo, xhi, ylo, yhi, zlo, zhi, h)",
    }
    form = forms.get(" ".join(words))
    return form and f"{form}, with the ends of the domain and the size of its cells"


def _boundary(words: list[str]) -> str | None:
    if not all(re.fullmatch("[pfsm]{1,2}", word) for word in words):
        return None
    none = "no end is periodic here; " if any("p" in word for word in words[:2]) else ""
    return (
        f"{none}leave it out: points end the run at an edge; or boundary(reflect), boundary(delete)"
    )


def _region(words: list[str]) -> str | None:
    if len(words) < 3 or not _are_names(words[0]):
        return None
    ID, style, *rest = words
    if style in _NO_SHAPES:
        return _REGION
    if style in _PUT_TOGETHER:
        return _regions_together(ID, style, rest)
    if style not in _SHAPES:
        return None
    where, options = rest[: _SHAPES[style]], rest[_SHAPES[style] :]
    said = dict(zip(options[::2], options[1::2], strict=False))
    exterior = ["exterior"] if said.pop("side", "in") == "out" else []
    lengths = _lengths_of([word for pair in said.items() for word in pair])
    forms = _forms(style, [re.sub("^EDGE$", "INF", word) for word in where])
    if len(options) % 2 == 0 and lengths is not None and forms:
        lines = (
            f"region({', '.join([ID, *form, *exterior])}) in {d}D" for d, form in forms.items()
        )
        return ", ".join(lines) + lengths
    # A line of this language without its parentheses is that of few words.
    own = len(where) < _SHAPES[style] or options == ["exterior"]
    return None if own and _numbers(where, "INF", "EDGE", *"xyz") else _REGION


def _forms(style: str, where: list[str]) -> dict[int, list[str]]:
    """The arguments of a region, by the number of dimensions; in a plane z is 0."""
    if len(where) != _SHAPES[style]:
        return {}
    along = where[:1] if style == "cylinder" else []
    if not set(along) <= set("xyz") or not _numbers(where[len(along) :], "INF"):
        return {}
    space = {3: [style, *where]}
    if style == "block":
        return {2: ["block", *where[:4]], **space} if _ends(where[4:]) else space
    *centre, radius = where[1:4] if style == "cylinder" else where
    if not _numbers([*centre, radius]) or float(radius) <= 0:
        return {}
    plane = {2: ["cylinder", *centre[:2], radius]}
    if style == "sphere":
        return {**plane, **space} if float(centre[2]) == 0 else space
    return {**plane, **space} if where[0] == "z" and _ends(where[4:]) else space


def _ends(words: list[str]) -> bool:
    """Whether these are a lower and an upper end with 0 between them."""
    lo = -math.inf if words[0] == "INF" else float(words[0])
    hi = math.inf if words[1] == "INF" else float(words[1])
    return lo <= 0 <= hi


def _regions_together(ID: str, style: str, rest: list[str]) -> str:
    count, parts = _count(rest[:1]), [_name(word) for word in rest[1:]]
    if count is None or count < 2 or len(parts) != count or not _are_names(*parts):
        return f"region(ID, {_PUT_TOGETHER[style]}, regionID, regionID)"
    return f"region({', '.join([ID, _PUT_TOGETHER[style], *parts])})"


def _group(words: list[str]) -> str | None:
    numbered = len(words) == 3 and words[1] == "region" and not _are_names(words[2])
    if numbered and _are_names(words[0], _name(words[2])):
        return f"group({words[0]}, particles, region, {_name(words[2])}, all)"
    return _GROUP if words[1:2] and words[1] in _GROUPED_BY else None


def _fix(words: list[str]) -> str | None:
    if len(words) < 3 or not _are_names(words[0], _name(words[1])):
        return None
    ID, group, style, *rest = words
    group = _name(group)
    vector = style == "gravity" and rest[1:2] == ["vector"] and len(rest) == 5
    if vector and _numbers([rest[0], *rest[2:]]):
        direction = [float(word) for word in rest[2:]]
        length = math.hypot(*direction)
        if not 0 < length < math.inf:
            return None
        pull = [float(rest[0]) * a / length + 0.0 for a in direction]
        space = " in 3D" if pull[2] else ""
        return f"fix({ID}, body_force, {group}, {', '.join(f'{a:.15g}' for a in pull)}){space}"
    lengths = _lengths_of(rest[4:])
    moves = style == "move" and rest[:1] == ["linear"] and len(rest) > 3
    if moves and lengths is not None and _numbers(rest[1:4], "NULL"):
        return f"fix({ID}, velocity_particles, {group}, {', '.join(rest[1:4])}){lengths}"
    return None


def _velocity(words: list[str]) -> str | None:
    lengths = _lengths_of(words[5:])
    if len(words) < 5 or words[1] != "set" or lengths is None:
        return None
    group, set_to = _name(words[0]), words[2:5]
    if not _are_names(group) or not _numbers(set_to, "NULL"):
        return None
    # A name for each line that another does not undo.
    given = "".join(axis for axis, word in zip("xyz", set_to, strict=True) if word != "NULL")
    ID = f"v{given if given != 'xyz' else ''}_{group}"
    return f"fix({ID}, initial_velocity_particles, {group}, {', '.join(set_to)}){lengths}"


def _dump(words: list[str]) -> str | None:
    own = (instead("dump", words[2]) or "").removeprefix("the style ") if words[2:] else ""
    if not own:
        return None
    ID, group, _, every, file, *columns = [*words, "", ""] if len(words) < 5 else words
    if re.search(r"\.gz$", file) and own == "particle":  # LAMMPS goes by the ending
        own = "particle/gz"
    whole = own.startswith("particle") and _are_names(ID) and re.fullmatch(r"[\w./*+-]+", file)
    if not whole or not _count([every]) or re.search(r"\.(bin|zst)$", file):
        return f"dump(ID, all, {own}, every, file, ...)"
    shown = [c for c in columns if c in _SAME] or ["x", "y", "z"]
    unknown = [c for c in columns if c not in (*_SAME, *_SAID_ANYWAY)]
    without = f", without {' '.join(unknown)}" if unknown else ""
    points = "" if group == "all" else ", of all points"
    return f"dump({', '.join([ID, 'all', own, every, file, *shown])}){without}{points}"


def _variable(words: list[str]) -> str | None:
    if len(words) < 3 or not free_name(words[0]):
        return None
    name, style, *rest = words
    if style in ("index", "string"):
        return f"{name} = {rest[0]}" if len(rest) == 1 and _numbers(rest) else None
    if style not in ("equal", "atom"):
        return None
    text = formula_of(" ".join(rest), of_points=style == "atom")
    return text and f"{name} = {text}"


def _ended(command: str) -> Callable[[list[str]], str | None]:
    def rule(words: list[str]) -> str | None:
        return f"{command}({words[0]})" if len(words) == 1 and _are_names(words[0]) else None

    return rule


_RULES = {
    "timestep": _timestep,
    "thermo": _thermo,
    "dimension": _dimension,
    "boundary": _boundary,
    "region": _region,
    "group": _group,
    "fix": _fix,
    "velocity": _velocity,
    "dump": _dump,
    "variable": _variable,
    **{name: _ended(command) for name, command in _ENDED.items()},
}
