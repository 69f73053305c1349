"""Execution of statements."""

import inspect
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from karamelo_py.language import registry, signature, unknown
from karamelo_py.language.further_mistakes import errors_of_text, further_errors
from karamelo_py.language.presets import Presets
from karamelo_py.language.replay import Record, Replay
from karamelo_py.script import evaluation, syntax
from karamelo_py.script.errors import Mark, Pause, Quit, ScriptError, blaming
from karamelo_py.script.expressions import FIRST, SEEDS, Expression, Value
from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, WORDS
from karamelo_py.script.parser import parse, parse_expression
from karamelo_py.script.reading import read_script


@dataclass
class _Frame:
    statements: list[syntax.Statement]
    path: Path | None
    next: int = 0


def _code_of(error: ScriptError, statement: syntax.Statement) -> str:
    code = "operand"
    if isinstance(statement, syntax.CommandCall):
        code = "not-possible"
        lines = {argument.mark[:2] for argument in statement.arguments}
        mark = error.mark
        inside = mark and mark[:2] in lines and mark != statement.mark
        if inside or error.argument is not None:
            code = "argument"
    return code


class Interpreter:
    """Executes scripts on a hub, whose ``interpreter`` and ``mark`` it sets."""

    def __init__(self, hub: Any, presets: Mapping[str, str] | None = None):
        self.hub = hub
        self.variables: dict[str, Value] = {}
        hub.interpreter = self
        self.files: list[Path] = []
        self.frames: list[_Frame] = []
        self.by_statement = False  # True if `next_statement` enters included scripts
        self.statement: syntax.Statement | None = None
        self.record = Record()  # executed statements, for restart files
        self.replay: Replay | None = None
        # Presets override assignments.
        self.presets = Presets(self, presets or {})

    def run_file(self, path: str | Path) -> None:
        path = Path(path)
        self.files.append(path)
        self._run(read_script(path), str(path), path)

    def run_text(self, text: str, name: str = "<text>") -> None:
        self._run(text, name)

    @property
    def waits(self) -> bool:
        return bool(self.frames)

    @property
    def has_more(self) -> bool:
        return any(frame.next < len(frame.statements) for frame in self.frames)

    def include(self, name: str) -> None:
        path = self.included(name, self.folder)
        exists = path.exists()
        if any(exists and frame.path and frame.path.samefile(path) for frame in self.frames):
            message = f"{name} includes itself"
            expected = "a script that is not in progress already"
            raise ScriptError(message, expected=expected, argument="file")
        with blaming(argument="file"):
            text = read_script(path)
        self.files.append(path)
        try:
            statements = parse(text, str(path))
        except ScriptError as error:
            error.included = self._including(len(self.frames))
            raise
        self.frames.append(_Frame(statements, path))
        if not self.by_statement:
            self._go_on(self.frames[-1])
            self.frames.pop()

    def included(self, name: str, folder: Path) -> Path:
        path = folder / name
        elsewhere = self.hub.folder / name
        return elsewhere if elsewhere.is_file() and not path.is_file() else path

    def perform(self, lines: Sequence[str]) -> None:
        for statement in parse("\n".join(lines)):
            assert isinstance(statement, syntax.CommandCall)
            self._call(statement)

    def rehearse(self, hub: Any, first: Sequence[str] = ()) -> None:
        """Execute the rest of the script on another hub, to find mistakes."""
        other = self._copy(hub)
        try:
            other.perform(first)
            other._finish()
        except Quit:
            return
        except ScriptError as error:
            error.others = further_errors(other, error)
            raise

    def _copy(self, hub: Any) -> "Interpreter":
        other = Interpreter(hub, self.presets)
        other.variables = dict(self.variables)
        other.files = list(self.files)
        other.frames = [_Frame(f.statements, f.path, f.next) for f in self.frames]
        other.statement = self.statement
        return other

    @property
    def folder(self) -> Path:
        paths = (frame.path.parent for frame in reversed(self.frames) if frame.path)
        return next(paths, self.hub.folder)

    @property
    def folders(self) -> list[Path]:
        return [self.hub.folder, Path(), self.folder]

    def _run(self, text: str, name: str, path: Path | None = None) -> None:
        try:
            statements = parse(text, name)
        except ScriptError as error:
            error.others = errors_of_text(self, error)
            raise
        self.frames.append(_Frame(statements, path))
        try:
            self.presets.refuse_unused(statements)
            self.go_on()
        except ScriptError:
            self.frames.clear()
            raise

    def go_on(self) -> None:
        try:
            self._finish()
        except Pause:
            raise
        except Quit:
            self.frames.clear()
            self.hub.answered = True
        except ScriptError as error:
            # At a run, the rest of the script has already been rehearsed.
            if not self.hub.rehearsed:
                error.others = further_errors(self._copy(self.hub.rehearsal()), error)
            self.frames.clear()
            raise
        except BaseException:
            self.frames.clear()
            raise
        if self.replay is not None:
            raise self.replay.other_script("this script ends earlier")

    def _finish(self) -> None:
        while self.frames:
            self._go_on(self.frames[-1])
            self.frames.pop()

    def _go_on(self, frame: _Frame) -> None:
        while frame.next < len(frame.statements):
            frame.next += 1
            try:
                self.execute(frame.statements[frame.next - 1])
            except Pause:
                # The innermost script repeats its line; the scripts that include it do not.
                if frame is self.frames[-1]:
                    frame.next -= 1
                raise

    def next_statement(self) -> syntax.Statement | None:
        """Return the next statement, of the script or an included file."""
        while self.frames:
            frame = self.frames[-1]
            if frame.next < len(frame.statements):
                frame.next += 1
                return frame.statements[frame.next - 1]
            self.frames.pop()
        return None

    def execute(self, statement: syntax.Statement) -> None:
        self.statement = statement
        self.hub.mark = statement.mark
        depth = len(self.frames)
        done = len(self.record.statements)
        try:
            with registry.modules_of(self.folder, Path()):
                self._execute_recorded(statement)
        except Pause:
            self.record.forget_from(done)
            raise
        except ScriptError as error:
            self.record.forget_from(done)
            error.mark = error.mark or (None if error.complete else statement.mark)
            self.presets.blame(statement, error)
            for wrong in (error, *error.others):
                wrong.included = wrong.included or self._including(depth - 1)
                wrong.code = wrong.code or _code_of(wrong, statement)
            error.complete = True
            raise
        except RecursionError:
            message, hint = "the expression is nested too deeply", "use more names"
            raise ScriptError(message, mark=statement.mark, hint=hint, code="syntax") from None

    def _execute_recorded(self, statement: syntax.Statement) -> None:
        name = statement.name if isinstance(statement, syntax.CommandCall) else ""
        is_command = registry.knows("command", name)
        command = registry.find("command", name) if is_command else None
        differs = registry.differences(command)
        if isinstance(differs, bool):
            return self._execute(statement)
        text, replay = statement.spelled(differs), self.replay
        self.record.statements.append(text)
        if replay is None:
            return self._execute(statement)
        replay.next(text, statement.mark)
        last = replay.at_end
        self._execute(statement)
        if last and self.replay is replay:
            raise replay.other_script("that script has a run here", statement.mark)

    def _including(self, depth: int) -> list[Mark]:
        frames = self.frames[:depth]
        return [frame.statements[frame.next - 1].mark for frame in reversed(frames)]

    def _execute(self, statement: syntax.Statement) -> None:
        if isinstance(statement, syntax.Assignment):
            return self._assign(statement)
        if isinstance(statement, syntax.CommandCall):
            return self._call(statement)
        assert isinstance(statement, syntax.Evaluation)
        node = statement.node
        if isinstance(node, syntax.Name) and node.name == "quit":
            raise Quit
        if isinstance(node, syntax.Name) and not self.means_something(node.name):
            raise unknown.unknown_statement(self, node.name)
        equal = node if isinstance(node, syntax.BinaryOperation) and node.operator == "==" else None
        if equal and isinstance(left := equal.left, syntax.Name):
            right = statement.raw.code[equal.right.start : equal.right.end]
            message = "the result of this comparison is not used"
            hint = f"an assignment has one =: {left.name} = {right}"
            raise ScriptError(message, mark=statement.mark, hint=hint)
        self.evaluate(node, statement.raw)

    def _assign(self, statement: syntax.Assignment) -> None:
        name = statement.name
        unknown.check_name(name)
        if name in self.presets:
            return self.presets.stand_for(statement)
        if name not in self.variables:
            means = "from here on it means this variable"
            if name in FUNCTIONS or registry.knows("command", name):
                kind = "function" if name in FUNCTIONS else "command"
                message = f"'{name}' is a {kind}, too; {means}, and the {kind} cannot be called"
                self.hub.warn(message, hint=None)
            other = "a coordinate of points before the first step, too" if name in FIRST else ""
            if other := other or ("a value of a fix or a compute" * (name in self.hub.values)):
                self.hub.warn(f"'{name}' is {other}; {means}", hint="choose another name")
        try:
            self.variables[name] = self.evaluate(statement.node, statement.right)
        except ScriptError as error:
            word, letters = statement.right.code.strip(), r"[^\W\d]\w*"  # not numbers, as in L/20
            if error.code == "unknown-name" and re.fullmatch(
                rf"{letters}([-/.]\w+)*[-/.]{letters}", word
            ):
                error.hint = f'put text in quotes: "{word}"'
            raise
        self.presets.follow(statement)

    def _call(self, statement: syntax.CommandCall) -> None:
        name, raw = statement.name, statement.raw
        if self.hides(name) or not (name in FUNCTIONS or registry.knows("command", name)):
            raise unknown.unknown_call(self, name, statement.mark, statement=True)
        if registry.knows("command", name):
            arguments = [signature.Argument(raw, self) for raw in statement.arguments]
            signature.call(registry.find("command", name), self.hub, arguments, name)
        else:
            # A function alone on a line has no effect, but its mistakes are still errors.
            self.evaluate(parse_expression(raw), raw)

    def evaluate(self, node: syntax.Node, raw: syntax.Raw) -> Value:
        if isinstance(node, syntax.NumberLiteral):  # a shortcut, as most arguments are numbers
            return node.value
        return evaluation.evaluate(node, raw, self)

    def usage(self, family: str, style: str) -> str:
        return signature.syntax(registry.find(family, style), f"{family} {style}")

    def knows(self, name: str) -> bool:
        return (
            name in self.variables or name in SEEDS or name in CONSTANTS or name in self.hub.values
        )

    def hides(self, name: str) -> bool:
        return name in self.variables

    def name(self, name: str, node: syntax.Name, raw: syntax.Raw) -> Value:
        if name in self.variables:
            return self.variables[name]
        if name in SEEDS:
            return Expression.seed(name)
        if name in CONSTANTS:
            return CONSTANTS[name]
        if name in self.hub.values:
            self.hub.asked.add(name)
            return Expression.seed(name)
        raise unknown.unknown_name(self, name, evaluation.mark_of(raw, node))

    def means_something(self, name: str) -> bool:
        meaningful = self.knows(name) or name in WORDS or name in FUNCTIONS
        return (
            meaningful
            or registry.knows("command", name)
            or bool(unknown.defined_later(self, name, None))
        )

    def command(self, node: syntax.FunctionCall, raw: syntax.Raw) -> Value:
        name = node.name
        begin = raw.start + node.start
        mark = raw.source.mark(begin, begin + len(name))
        if not registry.knows("command", name) or self.hides(name):
            raise unknown.unknown_call(self, name, mark, statement=False)
        target = registry.find("command", name)
        # A command without a value must not be executed within an expression.
        if inspect.get_annotations(target).get("return", "") in (None, "None"):
            raise unknown.no_value(name, mark)
        arguments = [
            signature.Argument(syntax.Raw(raw.source, raw.start + o.start, raw.start + o.end), self)
            for o in node.operands
        ]
        with blaming(mark):
            value = signature.call(target, self.hub, arguments, name)
        if isinstance(value, (int, float)):
            return float(value)
        if not isinstance(value, (str, Expression)):
            raise unknown.no_value(name, mark)
        return value
