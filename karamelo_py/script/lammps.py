"""Lines of LAMMPS as they are written here, where that can be said of a line alone."""

import re
from collections.abc import Callable

from karamelo_py.script.other_programs import instead

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_ENDED = {"unfix": "delete_fix", "uncompute": "delete_compute", "undump": "delete_dump"}
_NAMED = ("region", "group", "fix", "compute", "dump", *_ENDED)
_SAID_ANYWAY = ("id", "type", "mol", "element")  # columns of a dump


def line_of(name: str, words: list[str]) -> str | None:
    """What to write for ``name word word``; None where more has to be known than this line."""
    rule = _RULES.get(name)
    return rule(with_name(name, words)) if rule is not None else None


def with_name(command: str, words: list[str]) -> list[str]:
    """The words with an ID that is a name in the place of a number."""
    named = command in _NAMED and re.fullmatch(r"\d\w*", words[0] if words else "")
    return [f"n{words[0]}", *words[1:]] if named else words


def _numbers(words: list[str]) -> bool:
    return all(map(_NUMBER.fullmatch, words))


def _timestep(words: list[str]) -> str | None:
    return f"set_dt({words[0]})" if len(words) == 1 and _numbers(words) else None


def _thermo(words: list[str]) -> str | None:
    return f"set_output({words[0]})" if len(words) == 1 and words[0].isdigit() else None


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
    return "leave it out: points end the run at an edge; or boundary(reflect), boundary(delete)"


def _region(words: list[str]) -> str | None:
    ID, style, *rest = [*words, "", ""][: max(len(words), 2)]
    for option in ("units", "side"):
        if option in rest:
            k = rest.index(option)
            outside, rest = rest[k + 1 : k + 2] == ["out"], rest[:k] + rest[k + 2 :]
            rest += ["exterior"] if option == "side" and outside else []
    end = rest[-1:] if rest[-1:] == ["exterior"] else []
    rest = rest[: len(rest) - len(end)]
    inside = [re.sub("^EDGE$", "INF", word) for word in rest]
    if style == "block" and len(inside) == 6:
        plane, space = ["block", *inside[:4]], ["block", *inside]
    elif style == "sphere" and len(inside) == 4:
        plane, space = ["cylinder", *inside[:2], inside[3]], ["sphere", *inside]
    elif style == "cylinder" and len(inside) == 6 and inside[0] == "z":
        plane, space = ["cylinder", *inside[1:4]], ["cylinder", *inside]
    else:
        return None
    in_plane, in_space = (f"region({', '.join([ID, *form, *end])})" for form in (plane, space))
    return f"{in_plane} in 2D, {in_space} in 3D"


def _fix(words: list[str]) -> str | None:
    if len(words) < 3:
        return None
    ID, group, style, *rest = words
    vector = style == "gravity" and rest[1:2] == ["vector"] and len(rest) == 5
    if vector and _numbers([rest[0], *rest[2:]]):
        direction = [float(word) for word in rest[2:]]
        length = sum(a * a for a in direction) ** 0.5
        pull = [float(rest[0]) * a / length + 0.0 for a in direction] if length > 0 else direction
        return f"fix({ID}, body_force, {group}, {', '.join(f'{a:g}' for a in pull)})"
    if style == "move" and rest[:1] == ["linear"] and len(rest) == 4:
        return f"fix({ID}, velocity_particles, {group}, {', '.join(rest[1:])})"
    return None


def _velocity(words: list[str]) -> str | None:
    if len(words) < 5 or words[1] != "set":
        return None
    return f"fix(v, initial_velocity_particles, {words[0]}, {', '.join(words[2:5])})"


def _dump(words: list[str]) -> str | None:
    if len(words) < 5:
        return None
    ID, group, style, every, file, *columns = words
    own = (instead("dump", style) or "").removeprefix("the style ")
    if not own.startswith("particle"):
        return None
    shown = [c for c in columns if c not in _SAID_ANYWAY] or ["x", "y", "z"]
    return f"dump({', '.join([ID, group, own, every, file, *shown])})"


def _variable(words: list[str]) -> str | None:
    if len(words) < 3 or words[1] not in ("equal", "atom", "index", "string"):
        return None
    text = " ".join(words[2:])
    if words[1] in ("index", "string"):
        return f"{words[0]} = {text}" if _numbers(words[2:]) and len(words) == 3 else None
    if re.search(r"[$\[\]{}]|\b[cf]_", text):
        return None
    return f"{words[0]} = {re.sub(r'v_', '', text).strip(chr(34))}"


def _ended(command: str) -> Callable[[list[str]], str | None]:
    def rule(words: list[str]) -> str | None:
        return f"{command}({words[0]})" if len(words) == 1 else None

    return rule


_RULES = {
    "timestep": _timestep,
    "thermo": _thermo,
    "dimension": _dimension,
    "boundary": _boundary,
    "region": _region,
    "fix": _fix,
    "velocity": _velocity,
    "dump": _dump,
    "variable": _variable,
    **{name: _ended(command) for name, command in _ENDED.items()},
}
