"""Check Gmsh geometries: accept only known commands that describe a shape."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from karamelo_py.script.errors import ScriptError

_TOKEN = re.compile(
    r"""//[^\n]*|/\*.*?(?:\*/|\Z)|"[^"]*"|'[^']*'|(?:\d+\.?\d*|\.\d+)(?:[Ee][+-]?\d+)?"""
    r"""|[A-Za-z_][A-Za-z0-9_]*|\S""",
    re.S,
)
_LONGEST = 1000  # characters; Gmsh cuts longer strings and reads the rest as commands
# When Gmsh skips a condition, loop or macro, it searches for the first letters of these words (and
# of If, For, Macro, Function) and drops the letter after them, which may begin a string.
_ENDS = re.compile(r"EndIf|EndFor|Else|Return")
_LOSES = re.compile(r"(?:^|[^A-Za-z_])[EFIMR]$")
_MAY = "run a program, or read or write a file"
_LISTS = tomllib.loads(Path(__file__).with_name("gmsh_words.toml").read_text(encoding="utf-8"))
_WORDS, _NO_NAMES, _FIELDS = (
    frozenset(_LISTS[name].split()) for name in ("describe", "act", "fields")
)

# Allowed options change only the display.
_GENERAL = re.compile(
    r"ExpertMode|NumThreads|Terminal|Verbosity|SmallAxes|Color|(?:Axes|Light|Trackball)\w*"
    r"|(?:Min|Max|Rotation|RotationCenter|Scale|Translation)[XYZ]|RotationCenterGravity"
)
_OPTION_ACTS = re.compile(r"Command|File(?!Version|s)")
_SPEAKS = frozenset(("Printf", "Error", "Warning"))  # these write to a file if > follows the text
_READS = frozenset(("Include", "Merge", "MergeWithBoundingBox"))
_AFTER_NAMES = frozenset(("In", "Using", "Left", "Right", "Alternate"))
_NAMES = frozenset(("For", "Macro", "Function"))
# Gmsh readers of files without commands, by ending as Gmsh spells it.
_DATA = frozenset(
    ending
    for lower in ("stl", "brep", "iges", "igs", "step", "stp", "unv", "vtk", "mesh", "off", "obj",
                  "med", "bdf", "nas", "ply", "cgns")
    for ending in (f".{lower}", f".{lower.upper()}")
)  # fmt: skip
# Endings of files that may be read if they begin like a mesh.
_KINDS = frozenset(("", ".geo", ".geo_unrolled", ".pos", ".opt", ".msh", ".msh2", ".msh4"))
_MESH = (b"$PTS", b"$NO", b"$PARA", b"$ELM", b"$MeshFormat", b"$Comments")
_PAIRS = {"(": ")", "[": "]", "{": "}"}


class _Token(NamedTuple):
    text: str
    line: int
    file: Path

    @property
    def is_word(self) -> bool:
        return self.text[0].isalpha() or self.text[0] == "_"

    @property
    def is_text(self) -> bool:
        return self.text[0] in "\"'"


def refuse_commands(path: Path, *, trusted: bool = False) -> None:
    """Raise ScriptError for a geometry that does more than describe a shape.

    If `trusted`, refuse only commands that end the program.
    """
    files: dict[Path, list[_Token]] = {}
    _collect(path, files, trusted)
    if not trusted:
        defined = {name for tokens in files.values() for name in _given(tokens)}
        for tokens in files.values():
            for k in range(len(tokens)):
                _check(tokens, k, defined)


def _refuse(token: _Token, reason: str, *, trusted: bool = False) -> None:
    raise ScriptError(
        f"{token.file.name}, line {token.line}: {reason}",
        argument="file",
        expected="a geometry that only describes a shape",
        hint=None if trusted else "the option --trust-geometries allows it",
    )


def _collect(path: Path, files: dict[Path, list[_Token]], trusted: bool) -> None:
    for file in (path, path.with_name(f"{path.name}.opt")):
        if file in files or not file.is_file():
            continue
        tokens = files[file] = list(_tokens(file, trusted))
        for k, token in enumerate(tokens):
            if token.text == "Exit":
                _refuse(token, "Exit would end this program", trusted=trusted)
            if token.text in _READS and not trusted:
                _follow(tokens, k, files)


def _follow(tokens: list[_Token], k: int, files: dict[Path, list[_Token]]) -> None:
    token = tokens[k]
    name, end = [*(other.text for other in tokens[k + 1 : k + 3]), "", ""][:2]
    other = token.file.parent / name[1:-1]
    if name[:1] not in ('"', "'") or end != ";" or not other.is_file():
        _refuse(token, f"{token.text} of a file that does not exist, or has no name, might {_MAY}")
    if token.text != "Include" and _is_data(other):
        _collect(other.with_name(f"{other.name}.opt"), files, trusted=False)
    elif token.text != "Include" and other.suffix.lower() not in _KINDS:
        _refuse(token, f"{token.text} of {other.name}, not a geometry or mesh, might {_MAY}")
    else:
        _collect(other, files, trusted=False)


def _is_data(path: Path) -> bool:
    with path.open("rb") as file:
        return path.suffix in _DATA or (path.suffix in _KINDS and file.read(12).startswith(_MESH))


def _tokens(path: Path, trusted: bool) -> Iterator[_Token]:
    code = path.read_bytes().decode("latin-1")
    line, at = 1, 0
    for match in _TOKEN.finditer(code):
        line += code.count("\n", at, match.start())
        at = match.start()
        text, before = match[0], code[max(at - 2, 0) : at]
        is_comment, is_text = text.startswith(("//", "/*")), text[0] in "\"'"
        if (is_comment or is_text) and not trusted:
            long = is_text and (len(text) > _LONGEST or "\n" in text or _ENDS.search(text))
            if long or "\0" in text or _LOSES.search(before):
                suspect = (
                    "a text over several lines, a very long one, or one with words such as EndIf"
                )
                _refuse(_Token(text, line, path), f"{suspect} can hide commands that would {_MAY}")
        if not is_comment:
            yield _Token(text, line, path)


def _after(tokens: list[_Token], k: int) -> int:
    while k < len(tokens) and tokens[k].text in ("~", *_PAIRS):
        opened, depth = tokens[k].text, 0
        closed = _PAIRS.get(opened)
        while closed and k < len(tokens):
            depth += (tokens[k].text == opened) - (tokens[k].text == closed)
            if not depth:
                break
            k += 1
        k += 1
    return k


def _texts(tokens: list[_Token], k: int, count: int) -> list[str]:
    return [*(token.text for token in tokens[k : k + count]), *[""] * count][:count]


def _given(tokens: list[_Token]) -> Iterator[str]:
    constants = False
    for k, token in enumerate(tokens):
        before = tokens[k - 1].text if k else ""
        if token.text == ";":
            constants = False
        elif token.text == "DefineConstant":
            constants = True
        elif token.is_word:
            first, second = _texts(tokens, _after(tokens, k + 1), 2)
            assigned = first == "=" != second or (first in "+-*/" and second == "=" and first)
            listed = constants and before in ("[", "(", ",")
            if assigned or listed or before in _NAMES:
                yield token.text


def _check(tokens: list[_Token], k: int, defined: set[str]) -> None:
    token, word = tokens[k], tokens[k].text
    if not token.is_word:
        return
    before = tokens[k - 1].text if k else ""
    follows = tokens[k + 1] if k + 1 < len(tokens) else token
    if word in _NO_NAMES:
        _refuse(token, f"{word} would {_MAY}")
    if word in _SPEAKS:
        rest = (other.text for other in tokens[k:])
        if ">" in iter(lambda: next(rest, ";"), ";"):
            _refuse(token, f"{word} with > would {_MAY}")
    if word == "Field":
        sign, kind = _texts(tokens, _after(tokens, k + 1), 2)
        if follows.text in _PAIRS and sign == "=" and kind not in _FIELDS:
            _refuse(token, f"a field {kind} might {_MAY}")
    if word == "General":
        sign, option = _texts(tokens, _after(tokens, k + 1), 2)
        if sign == "." and not _GENERAL.fullmatch(option):
            _refuse(token, f"the option General.{option} might {_MAY}")
    if before == ".":
        if _OPTION_ACTS.search(word):
            _refuse(token, f"the option {word} might {_MAY}")
    elif word not in _WORDS | _FIELDS and before not in _NAMES:
        if word not in defined:
            _refuse(token, f"{word} may do more than describe a shape, and might {_MAY}")
        if follows is not token and (
            follows.is_text or (follows.is_word and follows.text not in _AFTER_NAMES)
        ):
            _refuse(token, f"{word} is used as a command, which might {_MAY}")
