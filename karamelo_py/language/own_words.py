"""Write lines in the place of older forms of Karamelo, in the words of the script at hand."""

from collections.abc import Sequence
from typing import Any

from karamelo_py.language import registry
from karamelo_py.script.other_programs import table
from karamelo_py.script.syntax import CommandCall

# Words that stood in the place of the style region in 2020, and what fills the same.
SHAPES = dict.fromkeys(("block", "box", "rectangle"), "block") | {
    "cylinder": "cylinder",
    "sphere": "sphere",
}
FLIPS = ("FLIP", "AFLIP", "ASFLIP")


def words_of(statement: Any) -> list[str]:
    """List the arguments of a call, as they are written."""
    arguments = statement.arguments if isinstance(statement, CommandCall) else ()
    return [" ".join(argument.code.split()) for argument in arguments]


def in_own_words(script: Any, name: str) -> str | None:
    """Write the line for a command of Karamelo that a script calls and that is not one here."""
    calls = [s for frame in script.frames for s in frame.statements if isinstance(s, CommandCall)]
    own = next((call for call in calls if call.name == "method"), None)
    asked = [c for c in (script.statement, *calls) if isinstance(c, CommandCall) and c.name == name]
    before, rest = words_of(own), words_of(asked[0] if asked else None)
    where = f"in the place of line {own.place.line}" if own else "before the first solid"
    if name == "method_modify" and rest:
        if registry.knows("method", rest[0]):
            before, rest = [rest[0], *before[1:]], rest[1:] or before[1:] or ["FLIP"]
        elif not registry.knows("transfer", rest[0]):  # a share alone
            rest = [*(before[1:3] if len(before) > 2 else ("FLIP", "linear")), *rest]
        if len(rest) == 1 or not registry.knows("basis", rest[1]):
            rest.insert(1, before[2] if len(before) > 2 else "linear")
        if len(rest) == 2 and rest[0] in FLIPS:
            rest.append(before[3] if len(before) > 3 else "0.99")
        return f"method({', '.join([*(before[:1] or ['tlmpm']), *rest])}), {where}"
    if name == "partition_domain" and len(before) > 2:
        line = ", ".join([*before[:2], "linear", *before[3:]])
        return f"method({line}), {where}: with linear weights no point acts across a line of nodes"
    return None


def filled(statement: Any) -> str | None:
    """Write a region and a solid for ``solid(ID, block, xlo, ..., ppc, material, h)``."""
    ID, shape, *numbers = words_of(statement)
    if len(numbers) < 6 or shape not in SHAPES:
        return None
    inside, points = ", ".join(numbers[:-3]), ", ".join(numbers[-3:])
    return f"region(box, {SHAPES[shape]}, {inside}), and solid({ID}, region, box, {points})"


def longer(name: str, given: Sequence[Any]) -> str | None:
    """Write the line of a law (`name`: ``eos shock``) that was `given` fewer arguments."""
    forms = table()["shorter"].get(name)
    if forms is None or not given:
        return None
    family, style = name.split()
    says, line = forms.get(str(len(given)), forms["else"])
    ID = words_of(given[0].statement)[:1] or ["ID"]
    words = line.format(*(argument.text for argument in given))
    return f"{says}{family}({ID[0]}, {style}, {words})"
