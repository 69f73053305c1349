"""Runs statements: keeps variables, finds commands, marks where something is wrong."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from karamelo_py.language import registry, signature
from karamelo_py.language.further_mistakes import further_errors
from karamelo_py.language.replay import Record, Replay, spelled
from karamelo_py.language.unknown import (
    check_name,
    defined_later,
    listed,
    no_value,
    unknown_call,
    unknown_name,
    unknown_statement,
)
from karamelo_py.script import evaluation
from karamelo_py.script.errors import Pause, Place, Quit, ScriptError, nearest
from karamelo_py.script.expressions import SEEDS, Expression, Value
from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, WORDS
from karamelo_py.script.parser import parse, parse_expression, parse_text
from karamelo_py.script.reading import read_script
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
from karamelo_py.script.terms import number_text

_WORD = r"[^\W\d]\w*"


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
        self.frames: list[_Frame] = []
        self._texts: dict[
            str, str
        ] = {}  # variables of the command line that may have to be numbers
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
        return bool(self.frames)

    @property
    def has_more(self) -> bool:
        """Whether statements come behind the present one."""
        return any(frame.next < len(frame.statements) for frame in self.frames)

    def include(self, name: str) -> None:
        """Run another script at this place; the name is relative to the script that asks."""
        path = self._included(name, self.folder)
        if any(frame.path and _same(frame.path, path) for frame in self.frames):
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
            error.included = self._including(len(self.frames))
            raise
        self.frames.append(_Frame(statements, path))
        self._go_on(self.frames[-1])
        self.frames.pop()

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
            while other.frames:
                other._go_on(other.frames[-1])
                other.frames.pop()
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
        other.frames = [_Frame(f.statements, f.path, f.next) for f in self.frames]
        other.statement = self.statement
        return other

    @property
    def folder(self) -> Path:
        """Folder of the script in progress."""
        for frame in reversed(self.frames):
            if frame.path is not None:
                return frame.path.parent
        return self._working_folder

    @property
    def _working_folder(self) -> Path:
        return getattr(self.hub, "folder", None) or Path.cwd()

    def _run(self, statements: list[Statement], path: Path | None) -> None:
        self.frames.append(_Frame(statements, path))
        try:
            if self._presets:
                self._refuse_unused_presets(statements)
            self.go_on()
        except ScriptError:
            self.frames.clear()
            raise

    def go_on(self) -> None:
        """Carry out what is left of all scripts in progress, such as one that waits (`Pause`)."""
        try:
            while self.frames:
                self._go_on(self.frames[-1])
                self.frames.pop()
            if self.replay is not None:
                raise self.replay.other_script("this one ends before")
        except Pause:
            raise
        except Quit:
            self.frames.clear()
            if self.replay is not None:
                raise self.replay.other_script("this one ends before") from None
        except ScriptError as error:
            # Once a run has begun, the rest of the script has been tried.
            if isinstance(self.hub, Rehearsed) and not self.hub.rehearsed:
                error.others = further_errors(self._copy(self.hub.rehearsal()), error)
            self.frames.clear()
            raise
        except BaseException:
            self.frames.clear()
            raise

    def _go_on(self, frame: _Frame) -> None:
        while frame.next < len(frame.statements):
            frame.next += 1
            try:
                self.execute(frame.statements[frame.next - 1])
            except Pause:
                # In the script that has the run; those that include it are at their next line.
                if frame is self.frames[-1]:
                    frame.next -= 1
                raise

    def next_statement(self) -> Statement | None:
        """The statement that comes next, in whichever file; it counts as carried out."""
        while self.frames:
            frame = self.frames[-1]
            if frame.next < len(frame.statements):
                frame.next += 1
                return frame.statements[frame.next - 1]
            self.frames.pop()
        return None

    def execute(self, statement: Statement) -> None:
        """Carry out one statement; errors know its place, and which scripts include it."""
        self.statement = statement
        self.hub.place = statement.place
        depth = len(self.frames)
        done = len(self.record.statements)
        try:
            self._execute_recorded(statement)
        except Pause:
            del self.record.statements[done:]
            raise
        except ScriptError as error:
            del self.record.statements[done:]
            error.place = error.place or statement.place
            self._blame_text(statement, error)
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
        frames = self.frames[:depth]
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
                raise unknown_statement(self, node.name)
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
        return known or registry.knows("command", name) or defined_later(self, name) is not None

    # -- assignments ------------------------------------------------------------------------------

    def _assign(self, statement: Assignment) -> None:
        name = statement.name
        check_name(name)
        if name in self._presets:
            # What was a word at first may have become an expression of variables.
            if isinstance(self.variables.get(name), str):
                self.variables[name] = self._preset_value(name)
            if isinstance(self.variables[name], str):
                self._note_text(name, statement)
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

    def _note_text(self, name: str, statement: Assignment) -> None:
        """Remember a text from the command line for what is a number in the script.

        A method may take either; where it is a mistake, a statement that uses it will tell.
        """
        with suppress(ScriptError):
            if isinstance(self.evaluate(statement.node, statement.right), float):
                self._texts[name] = statement.right.code.strip()

    def _blame_text(self, statement: Statement, error: ScriptError) -> None:
        """Say so where a mistake may come from a text of the command line."""
        for name, own in self._texts.items():
            if re.search(rf"\b{name}\b", spelled(statement)):
                error.hint = (
                    f"-var {name} {self._presets[name]} is a text, and the script has a number "
                    f"there, as in -var {name} {own}"
                )

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
            check_name(name)
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
                    expected=f"one of those that it assigns ({listed(assigned)})",
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
            raise unknown_call(self, name, statement.place, statement=True)
        if registry.knows("command", name):
            arguments = [signature.Argument(raw, self) for raw in statement.arguments]
            signature.call(registry.find("command", name), self.hub, arguments, name)
        elif name in FUNCTIONS:
            # A function alone on a line does nothing, but its mistakes count.
            raw = statement.raw
            self.evaluate(parse_expression(raw), raw)
        else:
            raise unknown_call(self, name, statement.place, statement=True)

    def command(self, node: Function, raw: Raw) -> Value:
        """The value of a call inside an expression that is not a function."""
        name = node.name
        begin = raw.start + node.start
        place = raw.source.place(begin, begin + len(name))
        if not registry.knows("command", name) or self.hides(name):
            raise unknown_call(self, name, place, statement=False)
        target = registry.find("command", name)
        # What gives no value must not be carried out here, least of all a run.
        if getattr(target, "__annotations__", {}).get("return", "") in (None, "None"):
            raise no_value(name, place)
        arguments = [
            signature.Argument(Raw(raw.source, raw.start + o.start, raw.start + o.end), self)
            for o in node.operands
        ]
        try:
            value = signature.call(target, self.hub, arguments, name)
        except ScriptError as error:
            error.place = error.place or place
            raise
        if isinstance(value, (bool, int, float)):
            return float(value)
        if isinstance(value, (str, Expression)):
            return value
        raise no_value(name, place)

    # -- expressions ------------------------------------------------------------------------------

    def evaluate(self, node: Node, raw: Raw) -> Value:
        """What an expression stands for now: a number, a text or a formula."""
        return evaluation.evaluate(node, raw, self)

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
            return Expression.seed(name)
        if name in self.variables:
            return self.variables[name]
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in self.hub.values:
            return Expression.seed(name)
        raise unknown_name(self, name, evaluation.mark(raw, node))


def shown(value: Value) -> str:
    """A value as a script would say it."""
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, Expression):
        return value.text
    return number_text(value)


def _same(a: Path, b: Path) -> bool:
    try:
        return a.samefile(b)
    except OSError:
        return False
