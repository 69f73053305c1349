"""Command-line variables, which override assignments."""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

from karamelo_py.language import registry, signature
from karamelo_py.language.unknown import check_name
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.expressions import Value
from karamelo_py.script.parser import parse, parse_text
from karamelo_py.script.reading import read_script
from karamelo_py.script.syntax import Assignment, CommandCall, Statement

_WORD = r"[^\W\d]\w*"
_NAMED = re.compile(rf"({_WORD})\s*=(?!=)\s*(.*)", re.DOTALL)


def names_in(statements: Iterable[Statement]) -> tuple[set[str], dict[str, None], dict[str, str]]:
    """Return names that statements use, names that they assign, and hints about argument names.

    In a formula (quoted or not), numbers of the call (``mu=4e5``) take precedence over variables.
    """
    read: set[str] = set()
    assigned: dict[str, None] = {}
    hints: dict[str, str] = {}
    for statement in statements:
        name = statement.name if isinstance(statement, CommandCall) else ""
        raws = [*statement.arguments] if isinstance(statement, CommandCall) else [statement.raw]
        if isinstance(statement, Assignment):
            assigned[statement.name] = None
            raws = [statement.right]
        codes = [re.sub(r'("[^"\n]*")|#[^\n]*', r"\1", raw.code).strip() for raw in raws]
        named = [m.groups() if (m := _NAMED.match(code)) else ("", code) for code in codes]
        expected = []
        with suppress(StopIteration, TypeError):  # there is no style, or a broken one
            style = next(code for code in codes[:2] if registry.knows(name, code))
            expected = signature.parameters(registry.find(name, style))
        formula = any(p.kind.with_numbers for p in expected)
        in_formulas = {word for word, _ in named if formula} - {p.name for p in expected}
        for word, value in named:
            words = set(re.findall(_WORD, value if formula else re.sub(r'"[^"\n]*"', " ", value)))
            read |= words if word in in_formulas - {""} else words - in_formulas
            hint = f"write {word} = {value} on a separate line, and {word}={word} in {name}(...)"
            hints[word] = hint
    return read, assigned, hints


class Presets(dict[str, str]):
    """Command-line variables: texts by name."""

    def __init__(self, script: Any, texts: Mapping[str, str]):
        super().__init__(texts)
        self._script = script
        # Texts that are used where a number is needed, and variables that have caused mistakes.
        self._texts: dict[str, str] = {}
        self.blamed: set[str] = set()
        # The presets on which each variable depends.
        self._made_of: dict[str, dict[str, None]] = {name: {name: None} for name in texts}
        if isinstance(texts, Presets):  # the presets of the copied script
            vars(self).update(vars(texts), _script=script, _made_of=dict(texts._made_of))
            return
        expected = "letters, digits and _, as in -var h 0.05"
        for name in texts:
            if not name.isidentifier():
                message = f"-var: '{name}' is not the name of a variable"
                raise ScriptError(message, expected=expected)
            try:
                check_name(name)
            except ScriptError as error:
                raise ScriptError(f"-var: {error.message}", hint=error.hint) from None
            script.variables[name] = self._value(name)

    def _value(self, name: str) -> Value:
        variables = self._script.variables
        present = variables.pop(name, None)
        try:
            raw, node = parse_text(self[name], "-var " + name)
            return self._script.evaluate(node, raw)
        except ScriptError as error:
            if error.code == "division-by-zero":
                raise
            return self[name]
        finally:
            if present is not None:
                variables[name] = present

    def stand_for(self, statement: Assignment) -> None:
        name, variables = statement.name, self._script.variables
        # The text may now be an expression of variables that have values.
        if isinstance(variables.get(name), str):
            variables[name] = self._value(name)
        if isinstance(variables[name], str):
            # If the text had to be a number, the command that uses it reports the mistake.
            in_script = None
            with suppress(ScriptError):
                in_script = self._script.evaluate(statement.node, statement.right)
            if isinstance(in_script, float):
                parse_text(self[name], "-var " + name)
                self._texts[name] = statement.right.code.strip()

    def follow(self, statement: Assignment) -> None:
        if self:
            self._made_of[statement.name] = self._in(statement.right.code)

    def _in(self, code: str) -> dict[str, None]:
        words = re.findall(_WORD, re.sub(r'"[^"]*"', " ", code))
        return {name: None for word in words for name in self._made_of.get(word, ())}

    def blame(self, statement: Statement, error: ScriptError) -> None:
        mark = error.mark
        if mark not in (None, statement.mark) and not error.hint:
            marked = mark.text[mark.column - 1 : mark.column - 1 + mark.length]
            if options := ", ".join(f"-var {name} {self[name]}" for name in self._in(marked)):
                error.hint = f"{marked} comes from {options}"
        for name, number in self._texts.items():
            if re.search(rf"\b{name}\b", statement.spelled()):
                self.blamed.add(name)
                text = f"-var {name} {self[name]} is a text"
                error.hint = f"{text}, but the script has a number, as in -var {name} {number}"

    def refuse_unused(self, statements: list[Statement]) -> None:
        scripts = list(self._scripts(statements, self._script.folder)) if self else [None]
        if None in scripts:
            return
        read, assigned, hints = names_in(chain(*filter(None, scripts)))
        read.update(assigned, re.findall(_WORD, " ".join(self.values())))
        for name in self:
            if name not in read:
                error = unknown(f"-var {name}: the script has no variable '{name}'", name, assigned)
                error.hint = hints.get(name, error.hint)
                raise error

    def _scripts(
        self, statements: list[Statement], folder: Path, outer: tuple[Path, ...] = ()
    ) -> Iterator[list[Statement] | None]:
        yield statements
        for statement in statements:
            if not (isinstance(statement, CommandCall) and statement.name == "include"):
                continue
            name = statement.arguments[0].code.strip(' "') if statement.arguments else ""
            path = self._script.included(name, folder)
            if path in outer or not path.is_file():
                yield None
            else:
                inner = parse(read_script(path), str(path))
                yield from self._scripts(inner, path.parent, (*outer, path))
