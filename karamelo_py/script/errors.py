"""Errors of a script."""

import difflib
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import KW_ONLY, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

_WIDEST_LINE = 160


class Mark(NamedTuple):
    """A place in a script: `line` and `column` count from 1; `text` is the source line."""

    file: str
    line: int
    column: int
    length: int
    text: str


class NoItem(KeyError):
    """A KeyError for a missing item that is printed without quotes."""

    def __str__(self) -> str:
        return self.args[0]


class Quit(Exception):
    """Raised where the script ends normally."""


# SystemExit is raised by exit(), which would end the program silently.
FAILURES = (Exception, SystemExit)


class Pause(Exception):
    """Raised where the script pauses before a run."""


@dataclass(eq=False, repr=False)
class ScriptError(Exception):
    """A mistake in a script or on the command line, for the user to correct.

    Parameters
    ----------
    message
        Description of the mistake in one sentence, without a full stop.
    argument
        Name or index of the wrong argument (from 0; negative from the last one without a name);
        `karamelo_py.language.signature.call` converts it to a mark.
    expected
        A correct argument or form.
    hint
        Fix, such as a line to write instead.
    """

    message: str
    _: KW_ONLY
    mark: Mark | None = None
    argument: str | int | None = None
    expected: str | None = None
    hint: str | None = None
    # The command, printed before the message, and the lines of `include`, printed after it.
    command: str | None = None
    included: list[Mark] = field(default_factory=list)
    others: "list[ScriptError]" = field(default_factory=list)
    # The correct statements, for syntax errors.
    statements: list = field(default_factory=list)
    # Kind of message (codes.toml); wrong word; kind of part it should name; similar known name.
    code: str = ""
    name: str | None = None
    kind: str = ""
    alike: str | None = None
    surplus: int = 0  # number of surplus arguments of a call
    # Likely cause of a failed run, and the command that resumes it.
    cause: str = ""
    resume: str = ""
    # callers of a failing function must not add to the message
    complete: bool = False

    def __str__(self) -> str:
        return self.message

    @property
    def sentence(self) -> str:
        return f"{self.command}: {self.message}" if self.command else self.message

    def render(self) -> str:
        physics = {"code": self.code, "cause": self.cause, "resume": self.resume}
        text = render_message(
            "error", self.sentence, self.mark, self.expected, self.hint, **physics
        )
        for mark in self.included:
            text += f"\n{mark.file}:{mark.line}: the script above is included here"
        return "\n\n".join([text, *(error.render() for error in self.others)])


@contextmanager
def blaming(mark: Mark | None = None, argument: str | None = None) -> Iterator[None]:
    """Add a mark and an argument to script errors that have none."""
    try:
        yield
    except ScriptError as error:
        error.mark = error.mark or mark
        error.argument = argument or error.argument
        raise


def render_message(
    kind: str,
    message: str,
    mark: Mark | None = None,
    expected: str | None = None,
    hint: str | None = None,
    *,
    code: str = "",
    cause: str = "",
    resume: str = "",
) -> str:
    physics = bool(code) and not codes().get(code, {}).get("script")
    lines = [f"{kind}: {message}"]
    if mark is not None:
        lines = [f"{mark.file}:{mark.line}:{mark.column}: {lines[0]}", *_marked(mark)]
    if expected:
        lines.append(f"expected: {expected}")
    if hint and not physics:
        lines.append(f"hint: {hint}")
    further = {"likely cause": cause, "fix": hint if physics else "", "resume": resume}
    further["more"] = f"karamelo-py help {code}" if physics and code in codes() else ""
    lines += [f"  {name}: {text}" for name, text in further.items() if text]
    return "\n".join(lines)


def _marked(mark: Mark) -> list[str]:
    text, start = mark.text.rstrip(), mark.column - 1
    length = max(mark.length, 1)
    if len(text) > _WIDEST_LINE:
        cut = max(0, start - _WIDEST_LINE // 2)
        end = cut + _WIDEST_LINE
        shown = ("..." if cut else "") + text[cut:end] + ("..." if end < len(text) else "")
        start += (3 if cut else 0) - cut
        length = min(length, max(end - cut - start, 1))
        text = shown
    # Tabs are copied, so that carets are aligned for any tab width.
    before = "".join(c if c == "\t" else " " * _width(c) for c in text[:start].ljust(start))
    carets = "^" * max(sum(_width(c) for c in text[start : start + length]), 1)
    number = str(mark.line)
    margin = " " * max(len(number), 5)
    # Control characters in a line could garble the terminal.
    shown = re.sub(r"[^\t]", lambda c: c[0] if c[0].isprintable() else "\ufffd", text)
    return [f"{number:>5} | {shown}", f"{margin} | {before}{carets}"]


def _width(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


def meant(name: str, names: Iterable[str], form: str = "{}") -> str | None:
    """Suggest ``did you mean '...'?`` with the most similar names, each written in a form."""
    ratios = [(n, difflib.SequenceMatcher(None, n, name).ratio()) for n in nearest_few(name, names)]
    close = [f"'{form.replace('{}', n)}'" for n, ratio in ratios if ratio == ratios[0][1]]
    return f"did you mean {' or '.join(close)}?" if close else None


def one_of(name: str, names: Iterable[str], family: str = "", page: str = "") -> str:
    """Return ``one of a, b, c``; if there are many, the closest ones and where all are listed."""
    names = list(dict.fromkeys(names))
    close = ", ".join(nearest_few(name, names))
    if len(names) <= 12 or not (close or family):
        return "one of " + ", ".join(names) if names else "an existing one (none so far)"
    listed = f"{len(names)} in all{page and f': see {page}'}"
    listed = f"karamelo-py styles {family} lists all {len(names)}" if family else listed
    return f"one of {close}, ... ({listed})" if close else listed


def plural(count: float, noun: str) -> str:
    return f"{count:g} {noun}" if count == 1 else f"{count:.0f} {noun}s"


def unknown(
    message: str, name: str, names: Iterable[str], hint: str | None = None, **where: Any
) -> ScriptError:
    names = list(names)
    few = nearest_few(name, names)
    return ScriptError(
        message,
        name=name,
        alike=few[0] if few else None,
        expected=one_of(name, names),
        hint=meant(name, names) or hint,
        **where,
    )


def nearest_few(name: str, names: Iterable[str]) -> list[str]:
    names = list(names)
    first = nearest(name, names)
    begin = [n for n in names if len(name) > 1 and n.lower().startswith(name.lower())]
    similar = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    return list(dict.fromkeys([*([first] if first else []), *similar, *begin]))[:3]


def nearest(name: str, names: Iterable[str]) -> str | None:
    names = list(names)
    lowered = name.lower()
    for candidate in names:
        if candidate.lower() == lowered and candidate != name:
            return candidate
    # Do not suggest a short name for a longer one: Ek_s does not mean Es.
    candidates = names if len(name) > 3 else [n for n in names if len(n) - len(name) < 2]
    by_lower = {candidate.lower(): candidate for candidate in candidates}
    for word, among in (name, {n: n for n in candidates}), (lowered, by_lower):
        if close := difflib.get_close_matches(word, among, n=1, cutoff=0.6):
            return among[close[0]]
    # Suggest a name that contains the word: cubic-spline for cubic.
    by_lower = {candidate.lower(): candidate for candidate in names}
    parts = (c for c in by_lower if len(lowered) > 2 and lowered in re.split("[-_/ ]", c))
    return by_lower.get(next(parts, ""))


@cache
def table() -> dict[str, Any]:
    path = Path(__file__).with_name("other_programs.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


@cache
def codes() -> dict[str, dict[str, Any]]:
    path = Path(__file__).with_name("codes.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


def of_karamelo(name: str) -> bool:
    return name in table()["karamelo"].split()


def instead(family: str, name: str) -> str | None:
    return table()["instead"].get(family, {}).get(name)
