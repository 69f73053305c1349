"""Runs statements: keeps variables, finds commands, marks where something is wrong."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from karamelo_py.language import registry, signature
from karamelo_py.language.further_mistakes import further_errors
from karamelo_py.language.replay import Record, Replay, spelled
from karamelo_py.script import expressions
from karamelo_py.script.errors import Pause, Place, Quit, ScriptError, nearest
from karamelo_py.script.expressions import SEEDS, Expression, Formula, Value, mark, number_text
from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, RESERVED, WORDS
from karamelo_py.script.other_programs import KARAMELO_COMMANDS, instead
from karamelo_py.script.parser import parse, parse_expression, parse_text
from karamelo_py.script.syntax import (
    Assignment,
    Binary,
    Call,
    Evaluation,
    Function,
    Name,
    Node,
    Raw,
    Statement,
)

_WORD = r"[^\W\d]\w*"
_LARGEST_SCRIPT = 100_000_000
MEANINGS = {
    "time": "the time of the run",
    "timestep": "the number of the step",
    "dt": "the time step",
    "PI": "the number pi",
}


@runtime_checkable
class Rehearsed(Protocol):
    """A hub on whose copies the rest of a script can be tried."""

    rehearsed: bool

    def rehearsal(self) -> Any:
        """Such a copy."""


@dataclass
class _Frame:
    """A script in progress: its statements and which comes next."""

    statements: list[Statement]
    path: Path | None
    next: int = 0


class Interpreter:
    """Runs a script on a hub.

    Parameters
    ----------
    hub
        What the commands act on; its ``interpreter`` and ``place`` are set.
    presets
        Variables from the command line, as text. The script's own assignment of such a name is
        passed over.

    Attributes
    ----------
    variables : dict
        Numbers, texts and formulas by name.
    files : list of Path
        Scripts that were read.
    record
        What was done so far, for files to go on from.
    replay
        What is gone through once more, until the script is where an earlier run of it left off.
    """

    def __init__(self, hub: Any, presets: Mapping[str, str] | None = None):
        self.hub = hub
        hub.interpreter = self
        self.variables: dict[str, Value] = {}
        self.files: list[Path] = []
        self._presets: dict[str, str] = {}
        self._frames: list[_Frame] = []
        self.statement: Statement | None = None  # the last that was begun
        self.record = Record()
        self.replay: Replay | None = None
        for name, text in (presets or {}).items():
            self._set_preset(name, text)

    @property
    def presets(self) -> dict[str, str]:
        """Variables from the command line, as text."""
        return dict(self._presets)

    # -- running ----------------------------------------------------------------------------------

    def run_file(self, path: str | Path) -> None:
        """Run a script from a file.

        Raises
        ------
        ScriptError
            For a file that cannot be read, and for the first mistake in it.
        """
        path = Path(path)
        self.files.append(path)
        self._run(parse(read_script(path), str(path)), path)

    def run_text(self, text: str, name: str = "<text>") -> None:
        """Run a script that is in memory."""
        self._run(parse(text, name), None)

    @property
    def waits(self) -> bool:
        """Whether a script is in the midst of its statements."""
        return bool(self._frames)

    def include(self, name: str) -> None:
        """Run another script at this place; the name is relative to the script that asks."""
        path = self._included(name, self.folder)
        if any(frame.path and _same(frame.path, path) for frame in self._frames):
            raise ScriptError(
                f"{name} includes itself",
                expected="a script that is not in progress already",
                argument="file",
            )
        try:
            text = read_script(path)
        except ScriptError as error:
            error.argument = "file"
            raise
        self.files.append(path)
        try:
            statements = parse(text, str(path))
        except ScriptError as error:
            error.included = self._including(len(self._frames))
            raise
        self._frames.append(_Frame(statements, path))
        self._go_on(self._frames[-1])
        self._frames.pop()

    def _included(self, name: str, folder: Path) -> Path:
        path = folder / name
        elsewhere = self._working_folder / name
        return elsewhere if elsewhere.is_file() and not path.is_file() else path

    def rehearse(self, hub: Any) -> None:
        """Run all that comes after the statement in progress on another hub.

        The variables there are copies. So mistakes late in a script are found before a long run.

        Raises
        ------
        ScriptError
            For the first mistake, with those behind it that do not follow from it.
        """
        other = self._copy(hub)
        try:
            while other._frames:
                other._go_on(other._frames[-1])
                other._frames.pop()
        except Quit:
            return
        except ScriptError as error:
            error.others = further_errors(other, error)
            raise

    def _copy(self, hub: Any) -> Interpreter:
        """The same place in the script, on another hub."""
        other = Interpreter(hub)
        other.variables = dict(self.variables)
        other.files = list(self.files)
        other._presets = dict(self._presets)
        other._frames = [_Frame(f.statements, f.path, f.next) for f in self._frames]
        other.statement = self.statement
        return other

    @property
    def folder(self) -> Path:
        """Folder of the script in progress."""
        for frame in reversed(self._frames):
            if frame.path is not None:
                return frame.path.parent
        return self._working_folder

    @property
    def _working_folder(self) -> Path:
        return getattr(self.hub, "folder", None) or Path.cwd()

    def _run(self, statements: list[Statement], path: Path | None) -> None:
        self._frames.append(_Frame(statements, path))
        try:
            if self._presets:
                self._refuse_unused_presets(statements)
            self.go_on()
        except ScriptError:
            self._frames.clear()
            raise

    def go_on(self) -> None:
        """Carry out what is left of all scripts in progress, such as one that waits (`Pause`)."""
        try:
            while self._frames:
                self._go_on(self._frames[-1])
                self._frames.pop()
            if self.replay is not None:
                raise self.replay.other_script("this one ends before")
        except Pause:
            raise
        except Quit:
            self._frames.clear()
            if self.replay is not None:
                raise self.replay.other_script("this one ends before") from None
        except ScriptError as error:
            # Once a run has begun, the rest of the script has been tried.
            if isinstance(self.hub, Rehearsed) and not self.hub.rehearsed:
                error.others = further_errors(self._copy(self.hub.rehearsal()), error)
            self._frames.clear()
            raise
        except BaseException:
            self._frames.clear()
            raise

    def _go_on(self, frame: _Frame) -> None:
        while frame.next < len(frame.statements):
            frame.next += 1
            try:
                self.execute(frame.statements[frame.next - 1])
            except Pause:
                # In the script that has the run; those that include it are at their next line.
                if frame is self._frames[-1]:
                    frame.next -= 1
                raise

    def next_statement(self) -> Statement | None:
        """The statement that comes next, in whichever file; it counts as carried out."""
        while self._frames:
            frame = self._frames[-1]
            if frame.next < len(frame.statements):
                frame.next += 1
                return frame.statements[frame.next - 1]
            self._frames.pop()
        return None

    def execute(self, statement: Statement) -> None:
        """Carry out one statement; errors know its place, and which scripts include it."""
        self.statement = statement
        self.hub.place = statement.place
        depth = len(self._frames)
        done = len(self.record.statements)
        try:
            self._execute_recorded(statement)
        except Pause:
            del self.record.statements[done:]
            raise
        except ScriptError as error:
            del self.record.statements[done:]
            error.place = error.place or statement.place
            if not error.included:
                error.included = self._including(depth - 1)
            error.complete = True
            raise
        except RecursionError:
            raise ScriptError(
                "this is nested too deeply", place=statement.place, hint="use more names"
            ) from None

    def _execute_recorded(self, statement: Statement) -> None:
        if isinstance(statement, Call) and registry.knows("command", statement.name):
            command = registry.find("command", statement.name)
            if getattr(command, "may_differ", False):
                self._execute(statement)
                return
        text = spelled(statement)
        self.record.statements.append(text)
        replay = self.replay
        if replay is None:
            self._execute(statement)
            return
        replay.next(text, statement.place)
        last = replay.at_end
        self._execute(statement)
        if last and self.replay is replay:
            raise replay.other_script("there a run stood here", statement.place)

    def _including(self, depth: int) -> list[Place]:
        """The include statements of the first `depth` scripts in progress, the nearest first."""
        frames = self._frames[:depth]
        return [frame.statements[frame.next - 1].place for frame in reversed(frames)]

    def _execute(self, statement: Statement) -> None:
        if isinstance(statement, Assignment):
            self._assign(statement)
        elif isinstance(statement, Call):
            self._call(statement)
        else:
            assert isinstance(statement, Evaluation)
            node = statement.node
            if isinstance(node, Name) and node.name == "quit":
                raise Quit
            if isinstance(node, Name) and not self._means_something(node.name):
                raise self._unknown_statement(node.name)
            if isinstance(node, Binary) and node.operator == "==" and isinstance(node.left, Name):
                right = statement.raw.code[node.right.start : node.right.end]
                raise ScriptError(
                    "this compares and does nothing with the result",
                    place=statement.place,
                    hint=f"an assignment has one =: {node.left.name} = {right}",
                )
            self.evaluate(node, statement.raw)

    def _means_something(self, name: str) -> bool:
        known = self.knows(name) or name in WORDS or name in FUNCTIONS
        return known or registry.knows("command", name) or self._later(name) is not None

    def _unknown_statement(self, name: str) -> ScriptError:
        close = nearest(name, ["quit", *registry.names("command"), *self.variables])
        if name.lower() in ("exit", "stop", "end"):
            close = "quit"
        return ScriptError(
            f"'{name}' is neither a command nor a variable",
            expected="name = expression, or command(arguments)",
            hint=instead("command", name) or _meant(close),
        )

    # -- assignments ------------------------------------------------------------------------------

    def _assign(self, statement: Assignment) -> None:
        name = statement.name
        _check_name(name)
        if name in self._presets:
            # What was a word at first may have become an expression of variables.
            if isinstance(self.variables.get(name), str):
                self.variables[name] = self._preset_value(name)
            return
        if name not in self.variables and (name in FUNCTIONS or registry.knows("command", name)):
            kind = "function" if name in FUNCTIONS else "command"
            self._warn(
                f"'{name}' is a {kind}, too; from here on it means the variable that is assigned "
                f"here, and the {kind} cannot be called"
            )
        if name in self.hub.values and name not in self.variables:
            self._warn(
                f"'{name}' is a value of a fix or a compute; "
                "from here on it means the variable that is assigned here",
                hint="choose another name",
            )
        self.variables[name] = self._right_hand_side(statement.node, statement.right)

    def _right_hand_side(self, node: Node, raw: Raw) -> Value:
        try:
            return self.evaluate(node, raw)
        except ScriptError as error:
            word = raw.code.strip()
            if error.message.startswith("unknown name") and re.fullmatch(r"\w+([-/.]\w+)+", word):
                error.hint = f'a text stands in quotes: "{word}"'
            raise

    def _set_preset(self, name: str, text: str) -> None:
        if not name.isidentifier():
            raise ScriptError(
                f"-var: '{name}' is not the name of a variable",
                expected="letters, digits and _, as in -var h 0.05",
            )
        try:
            _check_name(name)
        except ScriptError as error:
            raise ScriptError(f"-var: {error.message}", hint=error.hint) from None
        self._presets[name] = text
        self.variables[name] = self._preset_value(name)

    def _preset_value(self, name: str) -> Value:
        text = self._presets[name]
        present = self.variables.pop(name, None)
        try:
            raw, node = parse_text(text, "-var " + name)
            return self.evaluate(node, raw)
        except ScriptError as error:
            if error.message.startswith("division by zero"):
                raise
            return text
        finally:
            if present is not None:
                self.variables[name] = present

    def _refuse_unused_presets(self, statements: list[Statement]) -> None:
        """A variable of the command line that nothing reads or assigns is a slip of the pen."""
        words = set(re.findall(_WORD, " ".join(self._presets.values())))
        assigned: dict[str, None] = {}
        if not self._collect(statements, self.folder, words, assigned, []):
            return
        for name in self._presets:
            if name not in words:
                close = nearest(name, assigned)
                raise ScriptError(
                    f"-var {name}: the script has no variable '{name}'",
                    expected=f"one of those that it assigns ({_listed(assigned)})",
                    hint=f"did you mean '{close}'?" if close else None,
                )

    def _collect(
        self, statements: list[Statement], folder: Path, words: set, assigned: dict, seen: list
    ) -> bool:
        """Add the words and assigned names of statements and of all scripts that they include.

        False where a script that is included cannot be told before it is.
        """
        code = statements[0].raw.source.text if statements else ""
        words.update(re.findall(_WORD, re.sub(r'"[^"\n]*"|#[^\n]*', " ", code)))
        for statement in statements:
            if isinstance(statement, Assignment):
                assigned[statement.name] = None
            elif isinstance(statement, Call) and statement.name == "include":
                if not statement.arguments:
                    return False
                path = self._included(statement.arguments[0].code.strip(' "'), folder)
                if path in seen or not path.is_file():
                    return False
                inner = parse(read_script(path), str(path))
                if not self._collect(inner, path.parent, words, assigned, [*seen, path]):
                    return False
        return True

    def _warn(self, message: str, hint: str | None = None) -> None:
        warn = getattr(self.hub, "warn", None)
        if warn is not None:
            warn(message, hint=hint)

    # -- calls ------------------------------------------------------------------------------------

    def _call(self, statement: Call) -> None:
        name = statement.name
        if self.hides(name):
            raise self._unknown_call(name, statement.place, statement=True)
        if registry.knows("command", name):
            arguments = [signature.Argument(raw, self) for raw in statement.arguments]
            signature.call(registry.find("command", name), self.hub, arguments, name)
        elif name in FUNCTIONS:
            # A function alone on a line does nothing, but its mistakes count.
            raw = statement.raw
            self.evaluate(parse_expression(raw), raw)
        else:
            raise self._unknown_call(name, statement.place, statement=True)

    def command(self, node: Function, raw: Raw) -> Value:
        """The value of a call inside an expression that is not a function."""
        name = node.name
        begin = raw.start + node.start
        place = raw.source.place(begin, begin + len(name))
        if not registry.knows("command", name) or self.hides(name):
            raise self._unknown_call(name, place, statement=False)
        target = registry.find("command", name)
        # What gives no value must not be carried out here, least of all a run.
        if getattr(target, "__annotations__", {}).get("return", "") in (None, "None"):
            raise self._no_value(name, place)
        arguments = [
            signature.Argument(Raw(raw.source, raw.start + o.start, raw.start + o.end), self)
            for o in node.operands
        ]
        try:
            value = signature.call(target, self.hub, arguments, name)
        except ScriptError as error:
            error.place = error.place or place
            raise
        if isinstance(value, Expression):
            value = value.formula
        if isinstance(value, (bool, int, float)):
            return float(value)
        if isinstance(value, (str, Formula)):
            return value
        raise self._no_value(name, place)

    def _no_value(self, name: str, place: Any) -> ScriptError:
        return ScriptError(
            f"{name}(...) gives no value",
            place=place,
            expected="a function, or a command that gives a value, such as value(...)",
            hint=f"{name}(...) stands on a line of its own",
        )

    def _unknown_call(self, name: str, place: Any, statement: bool) -> ScriptError:
        commands = registry.names("command")
        what = "command" if statement else "function"
        other = instead("command", name) if statement else None
        if self.knows(name) and not other:
            return ScriptError(
                f"'{name}' is not a {what} but a variable",
                place=place,
                expected="an operator between the name and the parenthesis",
                hint=f"{name}*(...)",
            )
        known = [*commands, *FUNCTIONS] if statement else [*FUNCTIONS, *commands]
        close = nearest(name, known)
        shown = commands if statement else sorted(FUNCTIONS)
        return ScriptError(
            f"unknown {what} '{name}'",
            place=place,
            expected="one of " + ", ".join(shown),
            hint=other or _meant(close),
        )

    # -- expressions ------------------------------------------------------------------------------

    def evaluate(self, node: Node, raw: Raw) -> Value:
        """What an expression stands for now: a number, a text or a formula."""
        return expressions.evaluate(node, raw, self)

    def knows(self, name: str) -> bool:
        """Whether a name means something in an expression."""
        return (
            name in self.variables or name in SEEDS or name in CONSTANTS or name in self.hub.values
        )

    def hides(self, name: str) -> bool:
        """Whether a variable has the name of a function or command, which it hides then."""
        return name in self.variables

    def name(self, name: str, node: Name, raw: Raw) -> Value:
        """What a name in an expression stands for."""
        if name in SEEDS:
            return Formula.seed(name)
        if name in self.variables:
            return self.variables[name]
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in self.hub.values:
            return Formula.seed(name)
        raise self._unknown_name(name, mark(raw, node))

    def _unknown_name(self, name: str, place: Any) -> ScriptError:
        if name in WORDS:
            return ScriptError(
                f"{name} is not a number",
                place=place,
                expected="a number or a formula; NULL, INF and EDGE are words that stand alone, "
                "where a command knows them",
            )
        if registry.knows("command", name):
            return ScriptError(
                f"'{name}' is a command and needs parentheses",
                place=place,
                expected=f"{name}(...)",
            )
        if name in FUNCTIONS:
            return ScriptError(
                f"'{name}' is a function and needs parentheses",
                place=place,
                expected=expressions.usage(name),
            )
        other = self._not_published(name, place)
        if other:
            return other
        later = self._later(name)
        if later:
            return later(place)
        if name == "i":
            return ScriptError(
                "'i' is the number of a point in Karamelo, which no formula knows here",
                place=place,
                expected="a formula of positions",
                hint="mod(sin(12.9898*x0 + 78.233*y0)*43758.5453, 1) scatters over 0 to 1 as well",
            )
        published = [value for value in self.hub.values.names() if value not in SEEDS]
        known = [*self.variables, *published, *SEEDS, *CONSTANTS]
        by_style = self._values_by_style()
        close = (
            "time"
            if name == "t"
            else nearest(name, known) or by_style.get(nearest(name, by_style) or "")
        )
        hint = f"did you mean '{close}'?" if close else f"set it first: {name} = ..."
        if re.match("leq|geq", name) and not close:
            hint = f"{name[:3]} stands in front of a bound in fix velocity_nodes only"
        if name.upper() in WORDS:
            hint = f"write {name.upper()}"
        if name.lower() in ("true", "false"):
            hint = f"write {int(name.lower() == 'true')}"
        return ScriptError(
            f"unknown name '{name}'",
            place=place,
            expected=f"a variable that is set ({_listed(self.variables)}), a value of a fix or a "
            f"compute ({_listed(published)}), or x, y, z, x0, y0, z0, time, timestep, dt, PI",
            hint=hint,
        )

    def _values_by_style(self) -> dict[str, str]:
        """For each style of a fix or compute that publishes: the first value of the last one."""
        items = [
            *getattr(self.hub, "fixes", {}).items(), *getattr(self.hub, "computes", {}).items()
        ]  # fmt: skip
        return {
            item.style: f"{ID}_{item.published[0]}" if item.published[0] else ID
            for ID, item in items
            if item.published
        }

    def _not_published(self, name: str, place: Any) -> ScriptError | None:
        """The error for a value that the fix or compute of this ID does not set."""
        for kind, items in (("fix", "fixes"), ("compute", "computes")):
            for ID, item in getattr(self.hub, items, {}).items():
                if name not in (ID, f"{ID}_{name[-1]}"):
                    continue
                names = [f"{ID}_{s}" if s else ID for s in item.published]
                what = ", ".join(names) or "nothing"
                close = nearest(name, names) or (names[0] if names else None)
                return ScriptError(
                    f"{kind} {item.style} publishes {what}, not {name}",
                    place=place,
                    hint=f"did you mean '{close}'?" if close else None,
                )
        return None

    def _later(self, name: str) -> Any:
        """How to say that `name` is defined further down, if it is."""
        ID = re.sub(r"_[^_]+$", "", name)
        for frame in reversed(self._frames):
            for statement in frame.statements[max(frame.next - 1, 0) :]:
                line = statement.place.line
                if isinstance(statement, Assignment) and statement.name == name:
                    what, where = f"'{name}' is used before it is set", f"it is set in line {line}"
                elif (
                    isinstance(statement, Call)
                    and statement.name in ("fix", "compute")
                    and statement.arguments
                    and statement.arguments[0].code.strip() in (name, ID)
                ):
                    what = f"'{name}' is used before its {statement.name} is defined"
                    where = f"the {statement.name} is in line {line}"
                else:
                    continue
                hint = f"move line {line} up"
                if frame is self._frames[-1] and statement.place == self.hub.place:
                    where, hint = f"it is set in this very line {line}", "give it a value first"
                return lambda place, what=what, where=where, hint=hint: ScriptError(
                    what, place=place, expected=f"a name that is known here; {where}", hint=hint
                )
        return None


def shown(value: Value) -> str:
    """A value as a script would say it."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Formula):
        return value.text
    return number_text(value)


def read_script(path: Path) -> str:
    """The text of a script file.

    Raises
    ------
    ScriptError
        If there is no such file, it cannot be read, or it is no text.
    """
    try:
        if path.is_dir():
            raise ScriptError(f"{path} is a folder", expected="the name of a script")
        if path.stat().st_size > _LARGEST_SCRIPT:
            raise ScriptError(f"{path} is too large for a script", expected="at most 100 MB")
        data = path.read_bytes()
    except FileNotFoundError:
        parent = path.parent
        siblings = sorted(p.name for p in parent.iterdir()) if parent.is_dir() else []
        close = difflib.get_close_matches(path.name, siblings, n=1)
        raise ScriptError(
            f"there is no file {path}"
            if parent.is_dir()
            else f"there is no file {path}: the folder {parent} does not exist",
            expected="the name of a script",
            hint=f"did you mean {parent / close[0]}?" if close else None,
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise ScriptError(f"{path} cannot be read: {reason}") from None
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace")
    if b"\0" in data:
        raise ScriptError(f"{path} is not a text file", expected="a script")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        # Old editors write comments in Latin-1, where every byte is a character.
        return data.decode("latin-1")


def _meant(close: str | None) -> str | None:
    return f"did you mean '{close}'?" if close else None


def _check_name(name: str) -> None:
    """Refuse to assign what already means something else."""
    if name in ("and", "or", "not"):
        what = "a logical operator"
    elif name in MEANINGS:
        what = MEANINGS[name]
    elif name in SEEDS:
        what = "a coordinate of points"
    elif name in WORDS or name == "quit":
        what = "a word of the language"
    elif registry.knows("command", name) and name in KARAMELO_COMMANDS:
        what = "a command"
    elif name in RESERVED:
        what = "a function"
    else:
        return
    free = f"another name, such as {name}_1 or my_{name}"
    other = f"{name}(...) calls it" if what == "a command" else instead("command", name)
    raise ScriptError(
        f"'{name}' is {what} and cannot be assigned",
        expected="a name that is free",
        hint=f"{other}; or choose {free}" if other else f"choose {free}",
    )


def _same(a: Path, b: Path) -> bool:
    try:
        return a.samefile(b)
    except OSError:
        return False


def _listed(names: Iterable[str]) -> str:
    text = ", ".join(names) or "none so far"
    return text if len(text) < 200 else text[:200].rsplit(",", 1)[0] + ", ..."
