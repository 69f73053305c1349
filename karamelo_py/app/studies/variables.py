"""Variables of a study: their values, which go together, and whether a script reads them."""

import re
from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from karamelo_py.output.quantity import KEYWORDS
from karamelo_py.script.errors import ScriptError, meant, plural
from karamelo_py.script.evaluation import evaluate
from karamelo_py.script.functions import CONSTANTS
from karamelo_py.script.parser import parse, parse_text
from karamelo_py.script.syntax import Assignment, CommandCall
from karamelo_py.script.terms import number_of

VALUES = "NAME=value,value,... or NAME=first:last:count"
_NAME = re.compile(r"[^\W\d]\w*")
_MOST = 100_000


def choices(words: Iterable[str], in_step: Container[str] = ()) -> dict[str, list[str]]:
    """The values of each variable: ``N=10,20``, ``xi=0:1:5`` (5 of them), ``basis=linear``.

    Variables that go `in_step` with others may have a value twice.
    """
    found: dict[str, list[str]] = {}
    for word in words:
        name, equals, text = word.partition("=")
        values = [value.strip() for value in text.split(",")]
        if not equals or not name.isidentifier() or not all(values):
            raise ScriptError(f"-var {word}: this is not a list of values", expected=VALUES)
        if name in found:
            raise ScriptError(
                f"-var {name} is given twice", expected=f"all values in one list: {VALUES}"
            )
        found[name] = [each for value in values for each in _spread(name, value)]
        if name not in in_step and len(set(found[name])) < len(found[name]):
            raise ScriptError(f"-var {name} has a value twice: {', '.join(found[name])}")
    return found


def _spread(name: str, value: str) -> list[str]:
    parts = value.split(":")
    if len(parts) == 1:
        return [value]
    ends = [number_of(part) for part in parts[:2]]
    if len(parts) != 3 or None in ends or not parts[2].isdigit() or int(parts[2]) < 2:
        raise ScriptError(
            f"-var {name}={value}: this is not a range",
            expected="first:last:count with at least 2 values, as in 0.1:2:20",
        )
    first, last = ends
    steps = int(parts[2]) - 1
    return [f"{first + (last - first) * k / steps:.10g}" for k in range(steps + 1)]


def cases(
    values: dict[str, list[str]], zipped: Sequence[Sequence[str]] = (), where: Sequence[str] = ()
) -> list[dict[str, str]]:
    """Every combination of values, the first variable changing slowest.

    Parameters
    ----------
    values
        Values of each variable.
    zipped
        Names of variables that go in step: first with first, second with second.
    where
        Conditions in the language of scripts; a combination must fulfil all of them.
    """
    axes: list[list[dict[str, str]]] = []
    for name in values:
        together = next((group for group in zipped if name in group), [name])
        unknown = [other for other in together if other not in values]
        if unknown:
            raise ScriptError(f"-zip: there is no -var {unknown[0]}", expected=", ".join(values))
        if name != next(other for other in values if other in together):
            continue
        lengths = {other: len(values[other]) for other in together}
        if len(set(lengths.values())) > 1:
            raise ScriptError(
                "-zip: " + ", ".join(f"{k} has {plural(n, 'value')}" for k, n in lengths.items()),
                expected="lists of the same length",
            )
        rows = list(zip(*(values[other] for other in together), strict=True))
        if len(set(rows)) < len(rows):
            raise ScriptError("-zip " + ",".join(together) + ": the same combination twice")
        axes.append([dict(zip(together, row, strict=True)) for row in rows])
    for group in zipped:
        unknown = [name for name in group if name not in values]
        if unknown:
            raise ScriptError(f"-zip: there is no -var {unknown[0]}", expected=", ".join(values))
    total = 1
    for axis in axes:
        total *= len(axis)
    if total > _MOST:
        raise ScriptError(f"these are {total} combinations", expected=f"at most {_MOST}")
    words = {value for column in values.values() for value in column}
    found = []
    for parts in product(*axes):
        combined = {name: value for part in parts for name, value in part.items()}
        case = {name: combined[name] for name in values}
        if all(holds(condition, case, words) for condition in where):
            found.append(case)
    if not found:
        raise ScriptError("no combination fulfils -where " + " and ".join(where))
    return found


class NamesOfCase:
    """The names in a formula of an option: numbers and texts, and words that stand for themselves.

    Parameters
    ----------
    option
        Whose formula it is, for messages.
    known
        Values of the names.
    words
        Words that may stand in the formula without quotes.
    """

    def __init__(self, option: str, known: Mapping[str, Any], words: Iterable[str] = ()):
        self.option, self.known, self.words = option, {**CONSTANTS, **known}, words

    def name(self, name: str, node: Any, raw: Any) -> Any:
        if name in self.known:
            value = self.known[name]
            plain = number_of(value) if isinstance(value, str) else value
            return value if plain is None else plain
        if name in self.words:
            return name
        raise ScriptError(
            f"{self.option}: unknown name '{name}'",
            expected="a variable of the study, or one of its values (in quotes where it has signs "
            'such as -): basis == "quadratic-spline"',
            hint=meant(name, [*self.known, *self.words]),
        )

    def hides(self, name: str) -> bool:
        """No command has the name of a function here."""
        return False

    def command(self, node: Any, raw: Any) -> Any:
        raise ScriptError(f"{self.option}: unknown function '{node.name}'")


def holds(condition: str, case: Mapping[str, str], words: Iterable[str] = ()) -> bool:
    """Evaluate a condition in the language of scripts for a case."""
    raw, node = parse_text(condition, "-where")
    value = evaluate(node, raw, NamesOfCase("-where", case, words))
    if not isinstance(value, float):
        raise ScriptError(f"-where {condition} is neither true nor false")
    return value != 0


def check_script(path: Path, names: Iterable[str]) -> None:
    """See that a script reads each of these variables."""
    read: set[str] = set()
    assigned: set[str] = set()
    if not _collect(path, read, assigned, set()):
        return
    for name in names:
        if name not in read:
            what = "sets it and never reads it" if name in assigned else "has no such variable"
            raise ScriptError(
                f"-var {name}: {path} {what}",
                expected="one of " + ", ".join(sorted(assigned & read)),
                hint=meant(name, sorted((assigned & read) - {name})),
            )


def texts(path: Path) -> list[str]:
    """The text of a script and of those that it includes."""
    seen: set[Path] = set()
    _collect(path, set(), set(), seen)
    return [each.read_text(encoding="utf-8", errors="replace") for each in sorted(seen)]


def logged(path: Path) -> list[str] | None:
    """The headings of the log columns that a script names; None if it is not known beforehand."""
    headings = ["Step", "dt", "Time"]
    for statement in parse(path.read_text(encoding="utf-8", errors="replace"), str(path)):
        if isinstance(statement, CommandCall) and statement.name == "include":
            return None
        if isinstance(statement, CommandCall) and statement.name == "log_modify":
            words = ["".join(raw.code.split()).strip('"') for raw in statement.arguments[1:]]
            headings += [KEYWORDS.get(word, word) for word in words]
    return headings


def computes(path: Path) -> list[str]:
    """The IDs of the computes of a script and of those that it includes, as far as known."""
    return [
        statement.arguments[0].code.strip()
        for text in texts(path)
        for statement in parse(text, str(path))
        if isinstance(statement, CommandCall)
        and statement.name == "compute"
        and statement.arguments
    ]


def _collect(path: Path, read: set[str], assigned: set[str], seen: set[Path]) -> bool:
    """Gather the names of a script and what it includes; False if not all of it is known."""
    if path in seen:
        return True
    seen.add(path)
    known = True
    for statement in parse(path.read_text(encoding="utf-8", errors="replace"), str(path)):
        code = statement.raw.code
        if isinstance(statement, Assignment):
            assigned.add(statement.name)
            code = statement.right.code
        elif isinstance(statement, CommandCall):
            code = ", ".join(raw.code for raw in statement.arguments)
            if statement.name == "include":
                other = path.parent / code.strip().strip('"')
                known = other.is_file() and _collect(other, read, assigned, seen) and known
        code = re.sub(r'"[^"]*"', "", re.sub(r"#[^\n]*", "", code))
        read.update(_NAME.findall(code))
    return known
