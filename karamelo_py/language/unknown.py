"""Names that nothing answers to, or that cannot be given: what may have been meant."""

import re
from collections.abc import Iterable
from typing import Any, Protocol

from karamelo_py.language import registry
from karamelo_py.language.own_words import in_own_words
from karamelo_py.script.errors import ScriptError, meant, nearest
from karamelo_py.script.evaluation import usage
from karamelo_py.script.expression_mistakes import BLOCKS, NO_BLOCKS
from karamelo_py.script.expressions import SEEDS
from karamelo_py.script.functions import CONSTANTS, FUNCTIONS, RESERVED, WORDS
from karamelo_py.script.other_programs import ENERGIES, KARAMELO_COMMANDS, instead
from karamelo_py.script.syntax import Assignment, Call

MEANINGS = {
    "time": "the time of the run",
    "timestep": "the number of the step",
    "dt": "the time step",
    "PI": "the number pi",
}


class Names(Protocol):
    """What names mean while a script runs."""

    hub: Any
    variables: dict[str, Any]
    statement: Any  # in progress
    frames: list[Any]  # scripts in progress, the innermost last

    def knows(self, name: str) -> bool:
        """Whether a name means something in an expression."""


def unknown_statement(script: Names, name: str) -> ScriptError:
    """The error for a statement that is no more than a name nobody knows."""
    meaning = "quit" if name.lower() in ("exit", "stop", "end") else name
    known = ["quit", *registry.names("command"), *script.variables]
    return ScriptError(
        f"'{name}' is neither a command nor a variable",
        expected="name = expression, or command(arguments)",
        hint=instead("command", name) or meant(meaning, known),
    )


def unknown_call(script: Names, name: str, place: Any, statement: bool) -> ScriptError:
    """The error for a call of what is no command, or no function."""
    commands = registry.names("command")
    what = "command" if statement else "function"
    other = in_own_words(script, name) or instead("command", name) if statement else None
    if script.knows(name) and not other:
        return ScriptError(
            f"'{name}' is not a {what} but a variable",
            place=place,
            expected="an operator between the name and the parenthesis",
            hint=f"{name}*(...)",
        )
    if name in BLOCKS:
        other = NO_BLOCKS
    known = commands if statement else [*FUNCTIONS, *commands]
    shown = commands if statement else sorted(FUNCTIONS)
    return ScriptError(
        f"unknown {what} '{name}'",
        place=place,
        expected="one of " + ", ".join(shown),
        hint=other or meant(name, known),
    )


def no_value(name: str, place: Any) -> ScriptError:
    """The error for a command that gives no value in an expression."""
    return ScriptError(
        f"{name}(...) gives no value",
        place=place,
        expected="a function, or a command that gives a value, such as value(...)",
        hint=f"{name}(...) stands on a line of its own",
    )


def unknown_name(script: Names, name: str, place: Any) -> ScriptError:
    """The error for a name in an expression."""
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
            expected=usage(name),
        )
    other = _not_published(script, name, place)
    if other:
        return other
    further_down = defined_later(script, name)
    if further_down:
        return further_down(place)
    if name == "i":
        return ScriptError(
            "'i' is the number of a point in Karamelo, which no formula knows here",
            place=place,
            expected="a formula of positions",
            hint="mod(sin(12.9898*x0 + 78.233*y0)*43758.5453, 1) scatters over 0 to 1 as well",
        )
    published = [value for value in script.hub.values.names() if value not in SEEDS]
    known = [*script.variables, *published, *SEEDS, *CONSTANTS]
    by_style = _values_by_style(script)
    close = (
        "time"
        if name == "t"
        else nearest(name, known) or by_style.get(nearest(name, by_style) or "")
    )
    later = {} if close else _further_down(script)
    first = ENERGIES.get(name) or f"set it first: {name} = ..."
    hint = f"did you mean '{close}'?" if close else first
    if below := nearest(name, later):
        hint = f"did you mean '{below}', which stands further down, in line {later[below]}?"
    if re.match("leq|geq", name) and not close:
        hint = f"{name[:3]} stands in front of a bound in fix velocity_nodes only"
    if name.upper() in WORDS:
        hint = f"write {name.upper()}"
    if re.match("[vcf]_", name):  # as in LAMMPS
        own = [n for n in known if n == name[2:]]
        own = own or [n for n in known if re.fullmatch(f"{re.escape(name[2:])}_[^_]+", n)]
        hint = f"write {' or '.join(own)}" if own else ENERGIES.get(name[2:], hint)
    if name.lower() in ("true", "false"):
        hint = f"write {int(name.lower() == 'true')}"
        own = script.statement
        if isinstance(own, Assignment) and own.right.code.strip() == name:
            hint = f'write "{name.lower()}", in quotes'
    return ScriptError(
        f"unknown name '{name}'",
        place=place,
        expected=f"a variable that is set ({listed(script.variables)}), a value of a fix or a "
        f"compute ({listed(published)}), or x, y, z, x0, y0, z0, time, timestep, dt, PI",
        hint=hint,
    )


def _values_by_style(script: Names) -> dict[str, str]:
    """For each style of a fix or compute that publishes: the first value of the last one."""
    items = [
        *getattr(script.hub, "fixes", {}).items(), *getattr(script.hub, "computes", {}).items()
    ]  # fmt: skip
    return {
        item.style: f"{ID}_{item.published[0]}" if item.published[0] else ID
        for ID, item in items
        if item.published
    }


def _not_published(script: Names, name: str, place: Any) -> ScriptError | None:
    """The error for a value that the fix or compute of this ID does not set."""
    for kind, items in (("fix", "fixes"), ("compute", "computes")):
        for ID, item in getattr(script.hub, items, {}).items():
            if name not in (ID, f"{ID}_{name[-1]}"):
                continue
            names = [f"{ID}_{s}" if s else ID for s in item.published]
            what = ", ".join(names) or "nothing"
            return ScriptError(
                f"{kind} {item.style} publishes {what}, not {name}",
                place=place,
                hint=meant(name, names) or (f"did you mean '{names[0]}'?" if names else None),
            )
    return None


def _further_down(script: Names) -> dict[str, int]:
    """Variables, fixes and computes that the script makes further down, with their lines."""
    found = {}
    for frame in script.frames:
        for statement in frame.statements[frame.next :]:
            if isinstance(statement, Assignment):
                found[statement.name] = statement.place.line
            elif isinstance(statement, Call) and statement.name in ("fix", "compute"):
                ID = statement.arguments[0].code.strip() if statement.arguments else ""
                found[ID] = statement.place.line
    return found


def line_below(script: Any, kind: str, ID: str) -> int | None:
    """The line further down that defines a part of this kind and ID, if there is one."""
    for frame in reversed(getattr(script, "frames", ())):
        for statement in frame.statements[frame.next :]:
            made = isinstance(statement, Call) and statement.name == kind
            if made and statement.arguments and statement.arguments[0].code.strip() == ID:
                return statement.place.line
    return None


def _needs(script: Names, name: str, other: str) -> bool:
    """Whether the variable `name`, as it is set further down, comes to need `other`."""
    behind = [s for frame in script.frames for s in frame.statements[frame.next :]]
    set_there = [s for s in reversed(behind) if isinstance(s, Assignment)]
    below = {s.name: set(re.findall(r"\w+", s.right.code)) for s in set_there}
    reached: set[str] = set()
    ahead = {name}
    while ahead:
        reached |= ahead
        ahead = set().union(*(below.get(one, set()) for one in ahead)) - reached
    return other in reached


def defined_later(script: Names, name: str) -> Any:
    """How to say that `name` is defined further down, if it is."""
    ID = re.sub(r"_[^_]+$", "", name)
    own = script.statement.name if isinstance(script.statement, Assignment) else ""
    for frame in reversed(script.frames):
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
            if frame is script.frames[-1] and statement.place == script.hub.place:
                where, hint = f"it is set in this very line {line}", "give it a value first"
            elif own and _needs(script, name, own):
                hint = f"'{own}' and '{name}' need each other: set one of them without the other"
            return lambda place, what=what, where=where, hint=hint: ScriptError(
                what, place=place, expected=f"a name that is known here; {where}", hint=hint
            )
    return None


def check_name(name: str) -> None:
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


def listed(names: Iterable[str]) -> str:
    text = ", ".join(names) or "none so far"
    return text if len(text) < 200 else text[:200].rsplit(",", 1)[0] + ", ..."
