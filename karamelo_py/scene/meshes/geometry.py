"""Commands in a geometry of Gmsh's language that do more than describe a shape."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from karamelo_py.script.errors import ScriptError

# The comments, texts, words and signs of Gmsh's language: a text may have either kind of quotes.
_TOKEN = re.compile(
    r"""//[^\n]*|/\*.*?(?:\*/|\Z)|"[^"]*"|'[^']*'|[A-Za-z_][A-Za-z0-9_]*|[0-9,{}+*-]+|\S""", re.S
)
_NOTHING = ("//", "/*", *"0123456789,{}+*-")  # how tokens begin that do nothing
_MAY = "run a program or write a file"
_LONGEST = 1000  # characters: Gmsh ends a text that is much longer, and reads the rest as commands
# Words that run programs, write files or end the process.
_ACTS = frozenset((
    "SystemCall", "NonBlockingSystemCall", "System", "OnelabRun", "Parse", "CreateDir", "Plugin",
    "Save", "Print", "Exit", "ShapeFromFile",
))  # fmt: skip
_SPEAKS = frozenset(("Printf", "Error", "Warning"))  # to files, with a > behind
_READS = frozenset(("Include", "Merge"))
# Options that name files to write and programs to run.
_OPTIONS = re.compile(r"(?:General\.\w*(?:File|Save|Editor|Command|Executable|Browser)|Solver\.)")
# What a file that is read may be. Gmsh takes what it does not know for its own language, and so
# does the check, of those too that are named like meshes.
_KINDS = frozenset((
    "", ".geo", ".geo_unrolled", ".pos", ".opt", ".msh", ".msh2", ".msh4", ".stl", ".step", ".stp",
    ".iges", ".igs", ".brep", ".vtk", ".unv", ".mesh", ".med", ".cgns", ".off", ".bdf", ".nas",
))  # fmt: skip


class _Token(NamedTuple):
    text: str
    line: int


def refuse_commands(
    path: Path, *, trusted: bool = False, seen: frozenset[Path] = frozenset()
) -> None:
    """Refuse a geometry that would do more than describe one, in files that it reads, too.

    Of a `trusted` one only what would end this program is refused.

    Raises
    ------
    ScriptError
        Naming file, line and word.
    """
    path = path.resolve()
    if path in seen:
        return
    seen |= {path}
    # Gmsh reads a file of options beside the geometry by itself.
    for file in (path, path.with_name(f"{path.name}.opt")):
        if file.is_file():
            tokens = list(_tokens(file))
            for k, token in enumerate(tokens):
                _check(file, tokens, k, token, trusted, seen)


def _tokens(path: Path) -> Iterator[_Token]:
    code = path.read_bytes().decode("latin-1")
    line, at = 1, 0
    for match in _TOKEN.finditer(code):
        line += code.count("\n", at, match.start())
        at = match.start()
        if not match[0].startswith(_NOTHING):
            yield _Token(match[0], line)


def _check(
    path: Path, tokens: list[_Token], k: int, token: _Token, trusted: bool, seen: frozenset[Path]
) -> None:
    """Refuse the token `k` where it would do something."""
    word, what = token.text, ""
    if trusted and word != "Exit":
        return
    if word in _ACTS:
        what = f"{word} would {'end this program' if word == 'Exit' else _MAY}"
    elif word[0] in "\"'" and (len(word) > _LONGEST or "\n" in word):
        what = f"a text over several lines, or a very long one, can hide what would {_MAY}"
    elif word in _SPEAKS:
        rest = (other.text for other in tokens[k:])
        what = f"{word} with > would {_MAY}" if ">" in iter(lambda: next(rest, ";"), ";") else ""
    elif word in ("General", "Solver"):
        option = "".join(other.text for other in tokens[k : k + 3])
        what = f"{option} would let Gmsh {_MAY}" if _OPTIONS.match(option) else ""
    elif word in _READS:
        name, end = [*(other.text for other in tokens[k + 1 : k + 3]), "", ""][:2]
        other = path.parent / name[1:-1]
        if name[:1] not in ('"', "'") or end != ";" or not other.is_file():
            what = f"{word} of a file that is not there, or not named, might {_MAY}"
        elif other.suffix.lower() not in _KINDS:
            what = f"{word} of {other.name}, which is no geometry or mesh, might {_MAY}"
        else:
            refuse_commands(other, seen=seen)
    if what:
        raise ScriptError(
            f"{path.name}, line {token.line}: {what}",
            argument="file",
            expected="a geometry that describes a shape and no more",
            hint=None if trusted else "the option --trust-geometries lets it",
        )
