"""Formulas of LAMMPS as they are written here, where all that stands in them is the same."""

import re

from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, WORDS
from karamelo_py.script.other_programs import KARAMELO_COMMANDS

# LAMMPS's log is that of base 10. Its round takes halves away from zero, and % the sign of the
# first operand: these are not the same.
_FUNCTIONS = {
    "ln": "log",
    "log": "log10",
    **{
        name: name
        for name in (
            "abs", "acos", "asin", "atan", "atan2", "ceil", "cos", "exp", "floor", "sin", "sqrt",
            "tan",
        )
    },
}  # fmt: skip
_ALWAYS = {"PI", "time", "dt"}
_OF_POINTS = {"x", "y", "z"}
_TAKEN = {
    *FUNCTIONS, *CONSTANTS, *WORDS, *KARAMELO_COMMANDS, *_ALWAYS, *_OF_POINTS, "x0", "y0", "z0",
    "timestep", "and", "or", "not",
}  # fmt: skip
_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_COMPARISON = r"[=!<>]=|[<>]"
_TOKEN = re.compile(rf"\s*({_NUMBER}|[A-Za-z_]\w*|{_COMPARISON}|&&|\|\||[-+*/^(),])\s*", re.ASCII)
_OPERAND = re.compile(rf"{_NUMBER}|\w+|\)")


def free_name(name: str) -> bool:
    """Whether a variable may have this name."""
    return bool(re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII)) and name not in _TAKEN


def formula_of(text: str, *, of_points: bool) -> str | None:
    """A formula of a variable of LAMMPS, None where something in it is not known to be the same.

    Parameters
    ----------
    text
        As it stands in the line, perhaps in quotes.
    of_points
        Whether it is of the style atom, in which x, y and z are positions.
    """
    quoted = re.fullmatch(r"\"([^\"]*)\"|'([^']*)'", text)
    tokens = _tokens((quoted[1] or quoted[2] or "") if quoted else text)
    if tokens is None or not _one_order(tokens):
        return None
    same = _ALWAYS | (_OF_POINTS if of_points else set())
    ours = []
    for k, token in enumerate(tokens):
        after = tokens[k + 1 : k + 2]
        if not re.match(r"[A-Za-z_]", token):
            word = token
        elif after == ["("]:
            word = _FUNCTIONS.get(token)
        elif token.startswith("v_"):
            word = token[2:] if free_name(token[2:]) else None
        else:
            word = token if token in same else None
        if word is None:
            return None
        spaced = re.fullmatch(rf"{_COMPARISON}|&&|\|\|", word)
        ours.append(f" {word} " if spaced else f"{word} " if word == "," else word)
    return "".join(ours)


def _tokens(text: str) -> list[str] | None:
    """The words and signs of a formula, None where it is none."""
    tokens: list[str] = []
    end = 0
    while match := _TOKEN.match(text, end):
        two = bool(tokens) and _OPERAND.fullmatch(tokens[-1])
        called = match[1] == "(" and two and re.match("[A-Za-z_]", tokens[-1])
        begins = re.match(r"[\w.(]", match[1])
        if begins if two and not called else not (two or begins or match[1] in "+-"):
            return None
        tokens.append(match[1])
        end = match.end()
    depth = 0
    for token in tokens:
        depth += (token == "(") - (token == ")")
        if depth < 0:
            return None
    whole = end == len(text) and depth == 0 and tokens and _OPERAND.fullmatch(tokens[-1])
    return tokens if whole and tokens.count(",") == tokens.count("atan2") else None


def _one_order(tokens: list[str]) -> bool:
    """Whether both programs carry out the operations in the same order.

    LAMMPS takes signs before powers, powers from left to right, and ``<`` before ``==``.
    """
    compared = [token for token in tokens if re.fullmatch(_COMPARISON, token)]
    if len(compared) > 1 and {"==", "!="} & set(compared):
        return False
    for k, token in enumerate(tokens):
        if token != "^":
            continue
        first = _begin_of_operand(tokens, k)
        before = tokens[first - 1] if first else ""
        signed = before in ("-", "+") and (first == 1 or not _OPERAND.fullmatch(tokens[first - 2]))
        if signed or before == "^":
            return False
    return True


def _begin_of_operand(tokens: list[str], end: int) -> int:
    """Where the operand in front of `end` begins, the name of a function with it."""
    k, depth = end - 1, 0
    while k > 0:
        depth += (tokens[k] == ")") - (tokens[k] == "(")
        if depth == 0:
            break
        k -= 1
    called = tokens[k] == "(" and k > 0 and re.match("[A-Za-z_]", tokens[k - 1])
    return k - 1 if called else k
