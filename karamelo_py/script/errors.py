"""Errors of a script, with their place in the text and a remedy.

Remedies are names that are alike, and what says the same here as a word of another program.
"""

import difflib
import re
import tomllib
import unicodedata
from collections.abc import Iterable
from dataclasses import KW_ONLY, dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

_WIDEST_LINE = 160


class Place(NamedTuple):
    """A place in a script: `line` and `column` count from 1, `text` is the whole source line."""

    file: str
    line: int
    column: int
    length: int
    text: str


class NoItem(KeyError):
    """An item that is not there in brackets; its text is the whole message."""

    def __str__(self) -> str:
        return self.args[0]


class Quit(Exception):
    """The statement quit: the script ends here, and that is fine."""


# What code that is not ours may raise: exit() in it would end the program without a word.
FAILURES = (Exception, SystemExit)


class Pause(Exception):
    """The script waits in front of a run."""


@dataclass(eq=False, repr=False)
class ScriptError(Exception):
    """Something in a script (or on the command line) that the user has to change.

    Parameters
    ----------
    message
        What is wrong, in one sentence without a final stop.
    place
        Where; filled in by whoever knows it when the raiser does not.
    argument
        Name or index (from 0, or below 0 from the last without a name) of the argument of a style
        or command that is to blame;
        `karamelo_py.language.signature.call` turns it into a place.
    expected
        What would have been right.
    hint
        What to write instead.
    """

    message: str
    _: KW_ONLY
    place: Place | None = None
    argument: str | int | None = None
    expected: str | None = None
    hint: str | None = None
    # Command or style that complains, put in front of the message.
    command: str | None = None
    # Where scripts include the one that it is in, the nearest first.
    included: list[Place] = field(default_factory=list)
    # Further mistakes of the script, which do not follow from this one.
    others: "list[ScriptError]" = field(default_factory=list)
    # Where the text of a script is wrong: the statements in which it is not.
    statements: list = field(default_factory=list)
    # What kind of message it is (codes.toml). The word at fault, what kind of thing it names, and
    # a known name that is like it.
    code: str = ""
    name: str | None = None
    kind: str = ""
    alike: str | None = None
    # Of a run that went wrong: the likely cause, and the command that resumes.
    cause: str = ""
    resume: str = ""
    # Whether the statement it belongs to is known: nothing outside of it may add to it.
    complete: bool = False

    def __str__(self) -> str:
        return self.message

    @property
    def sentence(self) -> str:
        """The message, after the command or style that complains."""
        if self.command and not self.message.startswith(self.command):
            return f"{self.command}: {self.message}"
        return self.message

    def render(self) -> str:
        """Write the whole message for the user: place, marked line, what was expected, remedy.

        Further mistakes of the script follow.
        """
        physics = {"code": self.code, "cause": self.cause, "resume": self.resume}
        text = render_message(
            "error", self.sentence, self.place, self.expected, self.hint, **physics
        )
        for place in self.included:
            text += f"\n{place.file}:{place.line}: the script above is included here"
        return "\n\n".join([text, *(error.render() for error in self.others)])


def render_message(
    kind: str,
    message: str,
    place: Place | None = None,
    expected: str | None = None,
    hint: str | None = None,
    *,
    code: str = "",
    cause: str = "",
    resume: str = "",
) -> str:
    """Lay out an error or a warning (`kind`) as it is shown to the user.

    With a `code` of a run it is a message of physics: likely cause, fix, the command that resumes.
    """
    physics = bool(code) and not codes().get(code, {}).get("script")
    lines = [f"{kind}: {message}"]
    if place is not None:
        lines = [f"{place.file}:{place.line}:{place.column}: {lines[0]}", *_marked(place)]
    if expected:
        lines.append(f"expected: {expected}")
    if hint and not physics:
        lines.append(f"hint: {hint}")
    further = {"likely cause": cause, "fix": hint if physics else "", "resume": resume}
    further["more"] = f"karamelo-py help {code}" if physics and code in codes() else ""
    lines += [f"  {name}: {text}" for name, text in further.items() if text]
    return "\n".join(lines)


def _marked(place: Place) -> list[str]:
    """Write the source line and, below it, carets under the marked word."""
    text, start = place.text.rstrip(), place.column - 1
    length = max(place.length, 1)
    if len(text) > _WIDEST_LINE:
        cut = max(0, start - _WIDEST_LINE // 2)
        end = cut + _WIDEST_LINE
        shown = ("..." if cut else "") + text[cut:end] + ("..." if end < len(text) else "")
        start += (3 if cut else 0) - cut
        length = min(length, max(end - cut - start, 1))
        text = shown
    # Tabs are kept so that the carets line up whatever the width of a tab on this terminal.
    before = "".join(c if c == "\t" else " " * _width(c) for c in text[:start].ljust(start))
    carets = "^" * max(sum(_width(c) for c in text[start : start + length]), 1)
    number = str(place.line)
    margin = " " * max(len(number), 5)
    # Control characters could garble the terminal.
    shown = re.sub(r"[^\t]", lambda c: c[0] if c[0].isprintable() else "\ufffd", text)
    return [f"{number:>5} | {shown}", f"{margin} | {before}{carets}"]


def _width(character: str) -> int:
    if unicodedata.combining(character):
        return 0
    return 2 if unicodedata.east_asian_width(character) in "WF" else 1


def meant(name: str, names: Iterable[str]) -> str | None:
    """Write ``did you mean '...'?`` with those of `names` most like `name`; None without any."""
    like = [(n, difflib.SequenceMatcher(None, n, name).ratio()) for n in nearest_few(name, names)]
    close = [f"'{n}'" for n, ratio in like if ratio == like[0][1]]
    return f"did you mean {' or '.join(close)}?" if close else None


def one_of(name: str, names: Iterable[str], family: str = "", page: str = "") -> str:
    """Write ``one of a, b, c``; of many those most like `name`, their number and what lists all."""
    names = list(dict.fromkeys(names))
    close = ", ".join(nearest_few(name, names))
    if len(names) <= 12 or not (close or family):
        return "one of " + ", ".join(names) if names else "one that there is (none so far)"
    listed = f"{len(names)} in all{page and f': see {page}'}"
    listed = f"karamelo-py styles {family} lists all {len(names)}" if family else listed
    return f"one of {close}, ... ({listed})" if close else listed


def plural(count: float, noun: str) -> str:
    """Write ``1 cell``, ``2 cells``."""
    return f"{count:g} {noun}" if count == 1 else f"{count:.0f} {noun}s"


def unknown(
    message: str, name: str, known: Iterable[str], hint: str | None = None, **where: Any
) -> ScriptError:
    """Make the error for a `name` that is none of the `known`, `where` it stands."""
    known = list(known)
    few = nearest_few(name, known)
    return ScriptError(
        message,
        name=name,
        alike=few[0] if few else None,
        expected=one_of(name, known),
        hint=meant(name, known) or hint,
        **where,
    )


def nearest_few(name: str, names: Iterable[str]) -> list[str]:
    """Up to three of `names` that are like `name`, the one most like it first."""
    names = list(names)
    first = nearest(name, names)
    begin = [n for n in names if len(name) > 1 and n.lower().startswith(name.lower())]
    like = difflib.get_close_matches(name, names, n=3, cutoff=0.6)
    return list(dict.fromkeys([*([first] if first else []), *like, *begin]))[:3]


def nearest(name: str, names: Iterable[str]) -> str | None:
    """Find the one of `names` most like `name`, or None when none is alike."""
    names = list(names)
    lowered = name.lower()
    for candidate in names:
        if candidate.lower() == lowered and candidate != name:
            return candidate
    # Of short names a longer one says something else: Ek_s is not Es.
    like = names if len(name) > 3 else [n for n in names if len(n) - len(name) < 2]
    by_lower = {candidate.lower(): candidate for candidate in like}
    for word, among in (name, {n: n for n in like}), (lowered, by_lower):
        if close := difflib.get_close_matches(word, among, n=1, cutoff=0.6):
            return among[close[0]]
    # A part of the name: cubic of cubic-spline.
    by_lower = {candidate.lower(): candidate for candidate in names}
    parts = (c for c in by_lower if len(lowered) > 2 and lowered in re.split("[-_/ ]", c))
    return by_lower.get(next(parts, ""))


# ---- words of other programs, above all of LAMMPS -----------------------------------------------


@cache
def table() -> dict[str, Any]:
    """Read the table other_programs.toml; nothing needs it before something is wrong."""
    path = Path(__file__).with_name("other_programs.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


@cache
def codes() -> dict[str, dict[str, Any]]:
    """Read codes.toml: what each code of a message means."""
    path = Path(__file__).with_name("codes.toml")
    return tomllib.loads(path.read_text(encoding="utf-8"))


def of_karamelo(name: str) -> bool:
    """Tell if a name is that of a command of Karamelo, which no variable there can have."""
    return name in table()["karamelo"].split()


def instead(family: str, name: str) -> str | None:
    """Find what to write here for a command or style of another program; None for other words."""
    return table()["instead"].get(family, {}).get(name)
