"""Variables of a study, and options that all studies have."""

import csv
import os
import re
from argparse import ArgumentParser, Namespace
from collections.abc import Container, Iterable, Mapping, Sequence
from contextlib import suppress
from itertools import chain, product, takewhile
from math import prod
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple, NoReturn

from karamelo_py.app.options import LIVE, VARIABLE, above_zero, positive
from karamelo_py.app.studies.case import Launch
from karamelo_py.language import registry
from karamelo_py.language.presets import names_in
from karamelo_py.output.quantity import KEYWORDS
from karamelo_py.output.units import Units
from karamelo_py.script.errors import ScriptError, meant, plural, unknown
from karamelo_py.script.evaluation import evaluate
from karamelo_py.script.functions import CONSTANTS
from karamelo_py.script.parser import parse, parse_text
from karamelo_py.script.reading import read_script
from karamelo_py.script.syntax import CommandCall, FunctionCall, Node, Raw
from karamelo_py.script.terms import number_of

VALUES = "NAME=value,value,... or NAME=first:last:count"
QUEUES = {"slurm": "SLURMCluster", "pbs": "PBSCluster", "lsf": "LSFCluster", "sge": "SGECluster"}
WHERE = f"local, tcp://HOST:PORT of a Dask scheduler, {', '.join(QUEUES)}, or mpi"
_MOST = 100_000


def choices(words: Iterable[str], in_step: Container[str] = ()) -> dict[str, list[str]]:
    """Read values of variables: ``N=10,20``, ``xi=0:1:5`` (5 values), ``basis=linear``.

    Variables that change together with others (`in_step`) may repeat a value.
    """
    variables: dict[str, list[str]] = {}
    for word in words:
        name, equals, text = word.partition("=")
        values = [value.strip() for value in text.split(",")]
        if not equals or not name.isidentifier() or not all(values):
            raise ScriptError(f"-var {word}: this is not a list of values", expected=VALUES)
        if re.fullmatch(r"[1-9]\d*,\d+[eE][+-]?\d+", text):
            hint = f"{text.replace(',', '.')}, or {text.replace(',', '.0,')} for two values"
            raise ScriptError(f"-var {word}: a decimal comma?", expected=hint)
        if name in variables:
            raise ScriptError(
                f"-var {name} is given twice", expected=f"all values in one list: {VALUES}"
            )
        variables[name] = [each for value in values for each in _spread(name, value)]
        if name not in in_step and len(set(variables[name])) < len(variables[name]):
            raise ScriptError(f"-var {name} has a value twice: {', '.join(variables[name])}")
    return variables


def _spread(name: str, value: str) -> list[str]:
    parts = value.split(":")
    if len(parts) == 1:
        return [value]
    ends = [number_of(word) for word in parts[:2]]
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
    """Combine all values; the first variable changes slowest.

    Variables in a group of `zipped` change together; `where` are conditions.
    """
    axes: list[list[dict[str, str]]] = []
    for group in zipped:
        if unknown := [name for name in group if name not in values]:
            raise ScriptError(f"-zip: there is no -var {unknown[0]}", expected=", ".join(values))
    for name in values:
        together = next((group for group in zipped if name in group), [name])
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
    total = prod(map(len, axes))
    if total > _MOST:
        raise ScriptError(f"these are {total} combinations", expected=f"at most {_MOST}")
    words = {value for column in values.values() for value in column}
    selected = []
    for parts in product(*axes):
        combined = {name: value for choice in parts for name, value in choice.items()}
        case = {name: combined[name] for name in values}
        if all(holds(condition, case, words) for condition in where):
            selected.append(case)
    if not selected:
        raise ScriptError("no combination fulfils -where " + " and ".join(where))
    return selected


class NamesOfCase:
    def __init__(self, option: str, values: Mapping[str, Any], words: Iterable[str] = ()):
        self.option, self.values, self.words = option, {**CONSTANTS, **values}, words

    def name(self, name: str, node: Node, raw: Raw) -> Any:
        if name in self.values:
            value = self.values[name]
            plain = number_of(value) if isinstance(value, str) else value
            return value if plain is None else plain
        if name in self.words:
            return name
        raise ScriptError(
            f"{self.option}: unknown name '{name}'",
            expected="a variable of the study, or one of its values (in quotes where it has signs "
            'such as -): basis == "quadratic-spline"',
            hint=meant(name, [*self.values, *self.words]),
        )

    def hides(self, name: str) -> bool:
        return False

    def command(self, node: FunctionCall, raw: Raw) -> NoReturn:
        raise ScriptError(f"{self.option}: unknown function '{node.name}'")


def holds(
    condition: str, case: Mapping[str, str], words: Iterable[str] = (), option: str = "-where"
) -> bool:
    raw, node = parse_text(condition, option)
    value = evaluate(node, raw, NamesOfCase(option, case, words))
    if not isinstance(value, float):
        raise ScriptError(f"{option} {condition} is neither true nor false")
    return value != 0


def title_of(script: Path) -> str:
    """Return the first sentence of a script's comment, or the name of the file."""
    lines = read_script(script).splitlines() if script.is_file() else []
    head = " ".join(line.strip("# ") for line in takewhile(re.compile(r"#+ *\w").match, lines))
    return fill(re.split(r"[.:](?:\s|$)", head)[0], 80) or script.name


class ScriptFiles:
    def __init__(self, path: Path):
        self.path = path
        self.statements: dict[Path, list[Any]] = {}
        self.all_known = True  # False if an include has no fixed name
        self._read(path)

    def _read(self, path: Path) -> None:
        if path in self.statements:
            return
        self.statements[path] = parse(read_script(path), str(path))
        for call in self.calls("include", path):
            other = path.parent / ", ".join(raw.code for raw in call.arguments).strip().strip('"')
            if other.is_file():
                self._read(other)
            else:
                self.all_known = False

    def calls(self, name: str, path: Path) -> list[CommandCall]:
        statements = self.statements[path]
        return [s for s in statements if isinstance(s, CommandCall) and s.name == name]

    def texts(self) -> tuple[str, ...]:
        return tuple(map(read_script, sorted(self.statements)))

    def check(self, names: Iterable[str]) -> None:
        read, assigned, hints = names_in(chain(*self.statements.values()))
        for name in names:
            if name not in read and self.all_known:
                fault = "sets it and never reads it" if name in assigned else "has no such variable"
                settable = sorted(assigned.keys() & read)
                error = unknown(f"-var {name}: {self.path} {fault}", name, settable)
                error.hint = hints.get(name, error.hint)
                raise error

    def logged(self) -> list[str] | None:
        """Return the log columns that the script names, or None if it has includes."""
        if self.calls("include", self.path):
            return None
        headings = ["Step", "dt", "Time"]
        for call in self.calls("log_modify", self.path):
            words = ["".join(raw.code.split()).strip('"') for raw in call.arguments[1:]]
            headings += [KEYWORDS.get(word, word) for word in words]
        return headings

    def computes(self) -> list[str]:
        return [words[0] for words in self.words("compute")]

    def words(self, name: str) -> list[list[str]]:
        calls = [call for path in sorted(self.statements) for call in self.calls(name, path)]
        arguments = [[raw.code.strip().strip('"') for raw in call.arguments] for call in calls]
        return [words for words in arguments if words]

    def unit(self, name: str) -> str:
        reduction, _, column = name.rpartition(":")
        if reduction not in ("", "max", "min", "mean", "first", "last"):
            return ""
        parts = {
            words[0]: registry.find(family, words[1])
            for family in ("fix", "compute") for words in self.words(family)
            if len(words) > 1 and registry.knows(family, words[1])
        }  # fmt: skip
        for words in self.words("units"):
            with suppress(TypeError, KeyError):
                return Units(*words).of_value(column.lower() if column == "Time" else column, parts)
        return ""


def add_family(parser: ArgumentParser, values: str = VALUES) -> None:
    parser.set_defaults(zip=[])
    parser.add_argument("script", type=Path, help="the script")
    parser.add_argument(
        *VARIABLE, action="append", default=[], metavar="NAME=VALUES",
        help=f"values of a variable of the script: {values}; again for each variable",
    )  # fmt: skip
    parser.add_argument(
        "-jobs", type=positive, help="runs at once (default: as many as there are cores)"
    )
    parser.add_argument(
        "--threads", type=positive, default=None, help="threads of each run (default: 1)"
    )
    parser.add_argument(
        "-limit", type=above_zero, metavar="SECONDS", help="stop a run that takes longer"
    )
    parser.add_argument("-on", metavar="WHERE", help=f"run the cases elsewhere: {WHERE}")
    parser.add_argument(
        "-keep", action="append", default=[], metavar="FILES",
        help="files of each run that return from -on besides the log: 'dump*'",
    )  # fmt: skip
    parser.add_argument("-again", action="store_true", help="repeat runs of earlier studies, too")
    parser.add_argument(
        *LIVE, action="store_true", help="show the running study on a page in a browser"
    )


def add_axes(parser: ArgumentParser) -> None:
    parser.add_argument(
        "-axes",
        metavar="X,Y",
        help="labels of the axes: 'time (s),F (N)'; an empty label leaves the usual one, a label "
        "with commas needs double quotes",
    )
    parser.add_argument("-title", help="title (the first sentence of the script)")


def along(options: Namespace, x: str, y: str) -> tuple[str, str]:
    words = split(options.axes or ",")
    if len(words) != 2:
        raise ScriptError(f"-axes {options.axes}", expected="two, such as -axes 'time (s),F (N)'")
    return words[0] or x, words[1] or y


def split(text: str) -> list[str]:
    return [word.strip() for word in next(csv.reader([text], skipinitialspace=True), [])]


def names(text: str) -> list[str]:
    return list(filter(None, split(text)))


def add_steps(parser: ArgumentParser) -> None:
    parser.add_argument(
        "-zip", action="append", default=[], metavar="A,B",
        help="variables that change together: their first values, then their second, ...",
    )  # fmt: skip


def add_combinations(parser: ArgumentParser) -> None:
    add_steps(parser)
    parser.add_argument(
        "-where", action="append", default=[], metavar="CONDITION",
        help="run only combinations with: 'N < 40 || basis == linear'",
    )  # fmt: skip


def zipped(options: Namespace) -> list[list[str]]:
    return [names(group) for group in options.zip]


class StudyPlan(NamedTuple):
    values: dict[str, list[str]]
    script: ScriptFiles
    launch: Launch
    jobs: int  # runs at once
    timed: bool = False


def family(options: Namespace, *, timed: bool = False, repeat: int = 1) -> StudyPlan:
    script, threads = ScriptFiles(options.script), options.threads or 1
    in_step = {name for group in zipped(options) for name in group}
    values = choices(options.var, in_step)
    if not values:
        raise ScriptError("nothing varies", expected=f"-var {VALUES}")
    script.check(values)
    launch = Launch(script.path, threads, repeat, options.limit, script.texts())
    if timed and (options.jobs or 1) > 1:
        raise ScriptError("-time runs one at a time", expected="-time without -jobs")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
    jobs = 1 if timed else options.jobs or max(1, cores // threads)
    return StudyPlan(values, script, launch, jobs, timed)


def out_file(path: Path, *suffixes: str) -> Path:
    if suffixes and path.suffix.lower() not in suffixes:
        raise ScriptError(f"-o {path}: unknown kind of file", expected=", ".join(suffixes))
    if not path.parent.is_dir():
        raise ScriptError(f"the folder {path.parent} does not exist", hint=f"mkdir {path.parent}")
    if path.is_dir():
        raise ScriptError(f"{path} is a folder", expected="the name of a file")
    return path
