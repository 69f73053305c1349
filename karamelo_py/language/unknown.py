"""Suggestions for unknown or unusable names."""

import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from karamelo_py.language import registry
from karamelo_py.script.errors import (
    ScriptError,
    instead,
    meant,
    nearest,
    of_karamelo,
    one_of,
    table,
)
from karamelo_py.script.evaluation import usage
from karamelo_py.script.expressions import FIRST, SEEDS
from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, RESERVED, WORDS
from karamelo_py.script.mistakes import NO_BLOCKS
from karamelo_py.script.syntax import Assignment, CommandCall, Statement

MEANINGS = {
    "time": "the time of the run",
    "timestep": "the number of the step",
    "dt": "the time step",
    "PI": "the number pi",
}


def unknown_statement(script: Any, name: str) -> ScriptError:
    meaning = "quit" if name.lower() in ("exit", "stop", "end") else name
    words = ["quit", *registry.names("command"), *script.variables]
    message = f"'{name}' is neither a command nor a variable"
    hint = instead("command", name) or meant(meaning, words)
    expected, code = "name = expression, or command(arguments)", "unknown-command"
    return ScriptError(message, expected=expected, hint=hint, code=code)


def unknown_call(script: Any, name: str, mark: Any, statement: bool) -> ScriptError:
    commands = registry.names("command")
    kind = "command" if statement else "function"
    other = table()["functions"].get(name)
    if statement:
        other = in_own_words(script, name) or instead("command", name) or as_style(script, name)
    if name == "time" and not statement:
        message, expected = "time(...) is an interval for output, not a number", "a number"
        return ScriptError(message, mark=mark, expected=expected, hint="the number without time()")
    if script.knows(name) and not other:
        message = f"'{name}' is not a {kind} but a variable"
        expected = "an operator between the name and the parenthesis"
        hint, code = f"{name}*(...)", "unknown-command"
        return ScriptError(message, mark=mark, expected=expected, hint=hint, code=code)
    shown = commands if statement else sorted([*FUNCTIONS, "value"])
    return ScriptError(
        f"unknown {kind} '{name}'",
        code="unknown-command",
        name=name,
        kind=kind,
        mark=mark,
        expected=one_of(name, shown, "command") if statement else f"one of {', '.join(shown)}",
        hint=NO_BLOCKS if name in table()["blocks"] else other or meant(name, shown),
    )


def as_style(script: Any, name: str) -> str | None:
    """Write the line that a style used as a command should have been."""
    for family in ("compute", *registry.families()):
        line = instead(family, name) or ""
        if line.startswith(f"{family}("):
            return line
        for style in (name, name.replace("_", "-")) if family != "command" else ():
            if registry.knows(family, style):
                return script.usage(family, style)
    return None


def no_value(name: str, mark: Any) -> ScriptError:
    message, hint = f"{name}(...) gives no value", f"{name}(...) belongs on a separate line"
    expected = "a function, or a command that gives a value, such as value(...)"
    return ScriptError(message, mark=mark, expected=expected, hint=hint)


def unknown_name(script: Any, name: str, mark: Any) -> ScriptError:
    kind = "command" if registry.knows("command", name) else "function"
    if name in WORDS:
        expected = "a number or formula; NULL, INF and EDGE must be whole arguments"
        return ScriptError(f"{name} is not a number", mark=mark, expected=expected)
    if kind == "command" or name in FUNCTIONS:
        expected = f"{name}(...)" if kind == "command" else usage(name)
        message = f"'{name}' is a {kind} and needs parentheses"
        return ScriptError(message, mark=mark, expected=expected)
    if other := _not_published(script, name, mark) or defined_later(script, name, mark):
        return other
    if name == "i":
        return ScriptError(
            "'i' is the number of a point in Karamelo, and not available in formulas here",
            mark=mark,
            expected="a formula of positions",
            hint="mod(sin(12.9898*x0 + 78.233*y0)*43758.5453, 1) gives "
            "pseudo-random numbers between 0 and 1",
        )
    code = script.statement.raw.code if script.statement else ""
    head = re.match(r"\s*([a-z][\w-]*(?:/[\w-]+)*)\s*\(", code)
    if head and re.search("[-/]", head[1]) and (line := as_style(script, head[1])):
        return ScriptError(
            f"'{head[1]}' is not a command", mark=mark, hint=line, code="unknown-command"
        )
    published = [value for value in script.hub.values.names() if value not in SEEDS]
    hint, alike = _meant_by(script, name, [*script.variables, *published, *SEEDS, *CONSTANTS])
    return ScriptError(
        f"unknown name '{name}'",
        mark=mark,
        code="unknown-name",
        name=name,
        alike=alike,
        expected=f"a variable that is set ({listed(script.variables)}), a value of a fix or a "
        f"compute ({listed(published)}), or x, y, z, x0, y0, z0, time, timestep, dt, PI",
        hint=hint,
    )


def _meant_by(script: Any, name: str, names: list[str]) -> tuple[str, str | None]:
    statement, energies = script.statement, table()["energies"]
    if isinstance(statement, CommandCall) and statement.name == "material":
        energies = {}  # not energies, as E is a modulus
    if name.lower() in ("true", "false"):
        alone = isinstance(statement, Assignment) and statement.right.code.strip() == name
        said = f'"{name.lower()}", in quotes' if alone else str(int(name[0] in "tT"))
        return f"write {said}", None
    if re.match("[vcf]_", name):  # names as in LAMMPS
        same = [n for n in names if n == name[2:]]
        same = same or [n for n in names if re.fullmatch(f"{re.escape(name[2:])}_[^_]+", n)]
        if same or name[2:] in energies:
            return f"write {' or '.join(same)}" if same else energies[name[2:]], None
    if name.upper() in WORDS:
        return f"write {name.upper()}", None
    by_style = {
        item.style: "_".join(filter(None, (ID, item.published[0])))
        for _, ID, item in _publishing(script)
        if item.published
    }
    close = "time" if name == "t" else nearest(name, names)
    close = close or by_style.get(nearest(name, by_style) or "")
    if close and not (name in energies and close in script.variables):
        return f"did you mean '{close}'?", close
    if re.match("leq|geq", name):
        return f"write {name[:3]} directly before a bound, in fix velocity_nodes only", None
    makes = ("", "fix", "compute")
    later = {ID: line for _, kind, ID, line in _ahead(script) if kind in makes}
    if len(name) > 1 and (below := nearest(name, later)):
        return f"did you mean '{below}', defined further down, in line {later[below]}?", None
    return energies.get(name) or f"set it first: {name} = ...", None


def _publishing(script: Any) -> Iterator[tuple[str, str, Any]]:
    for catalogue in (script.hub.fixes, script.hub.computes):
        for ID, item in catalogue.items():
            yield catalogue.kind, ID, item


def _not_published(script: Any, name: str, mark: Any) -> ScriptError | None:
    for kind, ID, item in _publishing(script):
        if name in (ID, f"{ID}_{name[-1]}"):
            names = [f"{ID}_{s}" if s else ID for s in item.published]
            return ScriptError(
                f"{kind} {item.style} publishes {', '.join(names) or 'nothing'}, not {name}",
                mark=mark,
                hint=meant(name, names) or (f"did you mean '{names[0]}'?" if names else None),
            )
    return None


def _ahead(script: Any, back: int = 0) -> Iterator[tuple[Statement, str, str, int]]:
    """Yield (statement, command or "" for an assignment, ID or name, line) for later statements.

    The innermost script comes first, from `back` statements before its next one.
    """
    for frame in reversed(script.frames):
        for statement in frame.statements[max(frame.next - back, 0) :]:
            line = statement.mark.line
            if isinstance(statement, Assignment):
                yield statement, "", statement.name, line
            elif isinstance(statement, CommandCall) and statement.arguments:
                yield statement, statement.name, statement.arguments[0].code.strip(), line


def line_below(script: Any, kind: str, ID: str) -> int | None:
    lines = (line for _, made, name, line in _ahead(script) if (made, name) == (kind, ID))
    return next(lines, None)


def _needs(script: Any, name: str, other: str) -> bool:
    set_there = [s for s, *_ in _ahead(script) if isinstance(s, Assignment)]
    below = {s.name: set(re.findall(r"\w+", s.right.code)) for s in reversed(set_there)}
    reached: set[str] = set()
    ahead = {name}
    while ahead:
        reached |= ahead
        ahead = set().union(*(below.get(one, set()) for one in ahead)) - reached
    return other in reached


def defined_later(script: Any, name: str, mark: Any) -> ScriptError | None:
    ID = re.sub(r"_[^_]+$", "", name)
    assigned = script.statement.name if isinstance(script.statement, Assignment) else ""
    for statement, kind, made, line in _ahead(script, back=1):
        if kind in ("fix", "compute") and made in (name, ID):
            message = f"'{name}' is used before its {kind} is defined"
            where = f"the {kind} is in line {line}"
        elif not kind and made == name:
            message, where = f"'{name}' is used before it is set", f"it is set in line {line}"
        else:
            continue
        hint = f"move line {line} up"
        if statement.mark == script.hub.mark:
            where, hint = f"it is set in this line, {line}", "give it a value first"
        elif assigned and _needs(script, name, assigned):
            hint = f"'{assigned}' and '{name}' need each other: set one of them without the other"
        expected = f"a name that is defined here; {where}"
        code = "used-before-defined"
        return ScriptError(message, mark=mark, expected=expected, hint=hint, code=code)
    return None


def check_name(name: str) -> None:
    kinds = {
        "a logical operator": name in ("and", "or", "not"),
        MEANINGS.get(name, ""): name in MEANINGS,
        "a coordinate of points": name in SEEDS - FIRST,
        "a word of the language": name in WORDS or name == "quit",
        "a command": registry.knows("command", name) and of_karamelo(name),
        "a function": name in RESERVED,
    }
    meaning = next((kind for kind, applies in kinds.items() if applies), "")
    if not meaning:
        return
    free = f"another name, such as {name}_1 or my_{name}"
    other = f"{name}(...) calls it" if meaning == "a command" else instead("command", name)
    message = f"'{name}' is {meaning} and cannot be assigned"
    expected = "a name that is not in use"
    hint = f"{other}; or choose {free}" if other else f"choose {free}"
    raise ScriptError(message, code="taken-name", name=name, expected=expected, hint=hint)


def listed(names: Iterable[str]) -> str:
    text = ", ".join(names) or "none so far"
    return text if len(text) < 200 else text[:200].rsplit(",", 1)[0] + ", ..."


# Names of shapes in scripts of 2020; the solid style is now ``region``.
SHAPES = dict.fromkeys(("block", "box", "rectangle"), "block") | {
    "cylinder": "cylinder",
    "sphere": "sphere",
}
FLIPS = ("FLIP", "AFLIP", "ASFLIP")
# Names of reference and melting temperature in Karamelo scripts.
OWN_NAMES = {"T0": ("T0", "Tr", "Troom"), "Tm": ("Tm", "Tmelt", "Tmelting")}


def words_of(statement: Any) -> list[str]:
    arguments = statement.arguments if isinstance(statement, CommandCall) else ()
    return [" ".join(argument.code.split()) for argument in arguments]


def in_own_words(script: Any, name: str) -> str | None:
    calls = [s for frame in script.frames for s in frame.statements if isinstance(s, CommandCall)]
    method = next((call for call in calls if call.name == "method"), None)
    asked = [c for c in (script.statement, *calls) if isinstance(c, CommandCall) and c.name == name]
    before, rest = words_of(method), words_of(asked[0] if asked else None)
    where = f"instead of line {method.mark.line}" if method else "before the first solid"
    if name == "method_modify" and rest:
        if registry.knows("method", rest[0]):
            before, rest = [rest[0], *before[1:]], rest[1:] or before[1:] or ["FLIP"]
        elif not registry.knows("transfer", rest[0]):
            rest = [*(before[1:3] if len(before) > 2 else ("FLIP", "linear")), *rest]
        if len(rest) == 1 or not registry.knows("basis", rest[1]):
            rest.insert(1, before[2] if len(before) > 2 else "linear")
        if len(rest) == 2 and rest[0] in FLIPS:
            rest.append(before[3] if len(before) > 3 else "0.99")
        return f"method({', '.join([*(before[:1] or ['tlmpm']), *rest])}), {where}"
    if name == "partition_domain" and len(before) > 2:
        line = ", ".join([*before[:2], "linear", *before[3:]])
        return f"method({line}), {where}: with a linear basis no point acts across a line of nodes"
    return None


def filled(statement: Any) -> str | None:
    """Rewrite ``solid(ID, block, xlo, ..., ppc, material, h)`` as a region and a solid."""
    ID, shape, *numbers = words_of(statement)
    if len(numbers) < 6 or shape not in SHAPES:
        return None
    inside, points = ", ".join(numbers[:-3]), ", ".join(numbers[-3:])
    return f"region(box, {SHAPES[shape]}, {inside}), and solid({ID}, region, box, {points})"


def longer(name: str, arguments: Sequence[Any]) -> str | None:
    forms = table()["shorter"].get(name)
    if forms is None or not arguments:
        return None
    family, style = name.split()
    count = str(len(arguments))
    if count not in forms and "else" not in forms:
        return None
    says, line = forms.get(count) or forms["else"]
    ID = words_of(arguments[0].statement)[:1] or ["ID"]
    script = arguments[0]._interpreter
    temperatures = {
        name: next(filter(script.knows, candidates), name) for name, candidates in OWN_NAMES.items()
    }
    words = line.format(*(argument.text for argument in arguments), **temperatures)
    return f"{says}{family}({ID[0]}, {style}, {words})"


def renamed(family: str, style: str, ID: str, words: Sequence[str]) -> str | None:
    form = table()["renamed"].get(f"{family} {style}")
    try:
        return form and f"{family}({form.format(*words, ID=ID, all=', '.join(words))})"
    except IndexError:
        return None


def size_of_cells(script: Any) -> tuple[str, int | None]:
    solids = (words_of(s) for s, kind, *_ in _ahead(script) if kind == "solid")
    size = next((words[5 if len(words) == 7 else -1] for words in solids if len(words) > 4), "h")
    return size, line_below(script, "", size)
