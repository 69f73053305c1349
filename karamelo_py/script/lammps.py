"""Lines of LAMMPS as they are written here, where that can be said of a line alone."""

import math
import re

from karamelo_py.script import grammar, syntax
from karamelo_py.script.errors import instead, of_karamelo, table
from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, WORDS
from karamelo_py.script.syntax import Mistake

_UNSIGNED = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?[0-2]?\d?\d)?"
_ZERO = r"[+-]?(?=[.0]*0)[.0]+(?:[eE][+-]?\d+)?"
_NUMBER = rf"[+-]?{_UNSIGNED}"
# What <names> stand for in the patterns of the table.
_MACROS = {
    "ID": r"\w+",
    "number": _NUMBER,
    "zero": _ZERO,
    "positive": rf"\+?(?!{_ZERO}(?:\s|$)){_UNSIGNED}",
    "end": rf"(?:{_NUMBER}|INF)",
    "lower": rf"(?:-{_UNSIGNED}|{_ZERO}|INF)",
    "upper": rf"(?:\+?{_UNSIGNED}|{_ZERO}|INF)",
    "component": rf"(?:{_NUMBER}|NULL)",
    "units": "(?P<options> units box)?",
    "options": "(?P<options>(?: side (?:in|out)| units box)*)",
}
_NAMED = ("region", "group", "fix", "compute", "dump", "unfix", "uncompute", "undump")
# LAMMPS counts in units of a lattice where a line does not say otherwise.
_LENGTHS = ", with numbers in units of length, not of a lattice"
_COLUMNS, _SAID_ANYWAY = ("x", "y", "z", "vx", "vy", "vz", "mass"), ("id", "type")
# LAMMPS's log is that of base 10. Its round takes halves away from zero, and % the sign of the
# first operand: these are not the same.
_SAME = "abs acos asin atan atan2 ceil cos exp floor sin sqrt tan"
_FUNCTIONS = {"ln": "log", "log": "log10"} | {name: name for name in _SAME.split()}
_TAKEN = {
    *FUNCTIONS, *CONSTANTS, *WORDS, "time", "timestep", "dt", "x", "y", "z", "x0", "y0", "z0",
    "and", "or", "not",
}  # fmt: skip
_COMPARISON = r"[=!<>]=|[<>]"
_TOKEN = re.compile(rf"\s*({_UNSIGNED}|[A-Za-z_]\w*|{_COMPARISON}|&&|\|\||[-+*/^(),])", re.ASCII)


def line_of(name: str, words: list[str]) -> str | None:
    """Write ``name word word`` as it is here; None where more has to be known than this line."""
    given = with_name(name, words)
    if name == "dump":
        return _dump(given)
    if name == "variable":
        return _variable(given)
    if name == "region":
        given[1:] = ["INF" if word == "EDGE" else word for word in given[1:]]
    line = " ".join([name, *given])
    for rule in table()["line"]:
        pattern = re.sub("(?<!P)<(ID|[a-z]+)>", lambda macro: _MACROS[macro[1]], rule["lammps"])
        if match := re.fullmatch(pattern, line, re.ASCII):
            return _filled(rule["here"], match)
    return None


def with_name(command: str, words: list[str]) -> list[str]:
    """Put a name in the place of a number, where it is an ID."""
    return [_name(words[0]), *words[1:]] if command in _NAMED and words else [*words]


def _name(ID: str) -> str:
    return f"n{ID}" if re.fullmatch(r"\d\w*", ID) else ID


class _WordList(str):
    """Words that a template writes with commas between them, as IDs where it asks for these."""

    def __format__(self, spec: str) -> str:
        return ", ".join(map(_name, self.split()) if spec == "ID" else self.split())


def _filled(template: str, match: re.Match) -> str | None:
    """Fill the groups of a line into what is written here."""
    found = match.groupdict()
    options, given = found.get("options") or "", (found.get("given") or "").split()
    axes = "".join(axis for axis, word in zip("xyz", given, strict=False) if word != "NULL")
    more = {
        "outside": ", exterior" if "side out" in options else "",
        "lengths": "" if "units box" in options else _LENGTHS,
        "axes": axes if axes != "xyz" else "",  # a name for each line that another does not undo
    }
    if "pull" in found:
        more["pull"] = _pull(*(float(word) for word in found["pull"].split() if word != "vector"))
    if more.get("pull", "") is None:
        return None
    return template.format(*map(_WordList, match.groups(default="")), **more) or None


def _pull(size: float, *direction: float) -> str | None:
    length = math.hypot(*direction)
    if not 0 < length < math.inf:
        return None
    pull = [size * a / length + 0.0 for a in direction]
    return ", ".join(f"{a:.15g}" for a in pull) + ")" + (" in 3D" if pull[2] else "")


def _dump(given: list[str]) -> str | None:
    own = (instead("dump", given[2]) or "").removeprefix("the style ") if given[2:] else ""
    if not own:
        return None
    ID, group, _, every, file, *columns = [*given, "", ""] if len(given) < 5 else given
    if file.endswith(".gz") and own == "particle":  # LAMMPS goes by the ending
        own = "particle/gz"
    whole = own.startswith("particle") and re.fullmatch(r"[A-Za-z_]\w*", ID, re.ASCII)
    readable = re.fullmatch(r"[\w./*+-]+(?<!\.bin)(?<!\.zst)", file)
    if not (whole and readable and re.fullmatch("[0-9]{1,18}", every) and int(every)):
        return f"dump(ID, all, {own}, every, file, ...)"
    shown = [c for c in columns if c in _COLUMNS] or ["x", "y", "z"]
    unknown = [c for c in columns if c not in (*_COLUMNS, *_SAID_ANYWAY)]
    without = f", without {' '.join(unknown)}" if unknown else ""
    points = "" if group == "all" else ", of all points"
    return f"dump({', '.join([ID, 'all', own, every, file, *shown])}){without}{points}"


def _variable(given: list[str]) -> str | None:
    if len(given) < 3 or not _is_free(given[0]):
        return None
    name, style, *rest = given
    text = " ".join(rest)
    if style in ("index", "string"):
        return f"{name} = {text}" if re.fullmatch(_NUMBER, text, re.ASCII) else None
    if style not in ("equal", "atom"):
        return None
    formula = _formula(re.sub(r"\A([\"'])([^\"']*)\1\Z", r"\2", text), of_points=style == "atom")
    return formula and f"{name} = {formula}"


def _is_free(name: str) -> bool:
    """Tell if a variable may have this name."""
    known = name in _TAKEN or of_karamelo(name)
    return bool(re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII)) and not known


def _formula(text: str, *, of_points: bool) -> str | None:
    """Write a formula of LAMMPS as it is here; None where something in it may not be the same.

    Of the style atom (`of_points`) x, y and z are positions.
    """
    same = {"PI", "time", "dt", *("xyz" if of_points else "")}
    tokens = _TOKEN.findall(text)
    compared = [token for token in tokens if re.fullmatch(_COMPARISON, token)]
    mixed = len(compared) > 1 and {"==", "!="} & {*compared}
    if mixed or _TOKEN.sub("", text).strip() or re.search(r"[\w.]\s+[\w.]", text):
        return None
    ours = ""
    for token, after in zip(tokens, [*tokens[1:], ""], strict=True):
        word: str | None = token
        if after == "(" and (token[0].isalpha() or token[0] == "_"):
            word = _FUNCTIONS.get(token)
        elif token.startswith("v_"):
            word = token[2:] if _is_free(token[2:]) else None
        elif token[0].isalpha() or token[0] == "_":
            word = token if token in same else None
        if word is None:
            return None
        spaced = re.fullmatch(rf"{_COMPARISON}|&&|\|\|", word)
        ours += f" {word} " if spaced else f"{word} " if word == "," else word
    try:
        tree = grammar.parser_of("expression").parse(ours)
    except (grammar.refused(), Mistake):
        return None
    return ours if "**" not in ours and _one_order(tree) else None


def _one_order(node: syntax.Node) -> bool:
    """Tell if both programs carry out the operations of a formula in the same order.

    LAMMPS takes signs before powers, powers from left to right, and ``<`` before ``==``.
    """

    def power(operand: syntax.Node) -> bool:
        bare = isinstance(operand, syntax.BinaryOperation) and operand.end == operand.right.end
        return bare and operand.operator == "^"

    if isinstance(node, syntax.UnaryOperation):
        return not power(node.operand) and _one_order(node.operand)
    if isinstance(node, syntax.BinaryOperation):
        chained = node.operator == "^" and power(node.right)
        return not chained and _one_order(node.left) and _one_order(node.right)
    if isinstance(node, syntax.FunctionCall):
        takes, given = FUNCTIONS[node.name], len(node.operands)
        return takes.least <= given <= takes.most and all(map(_one_order, node.operands))
    return True
