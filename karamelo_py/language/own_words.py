"""What to write in the place of older forms of Karamelo, in the words of the script at hand."""

from collections.abc import Sequence
from typing import Any

from karamelo_py.language import registry
from karamelo_py.script.other_programs import SHORTER
from karamelo_py.script.syntax import Call

# Words that stood in the place of the style region in 2020, and what fills the same.
SHAPES = {
    "block": "block",
    "box": "block",
    "rectangle": "block",
    "cylinder": "cylinder",
    "sphere": "sphere",
}
FLIPS = ("FLIP", "AFLIP", "ASFLIP")


def words_of(statement: Any) -> list[str]:
    """The arguments of a call, as they are written."""
    arguments = statement.arguments if isinstance(statement, Call) else ()
    return [" ".join(argument.code.split()) for argument in arguments]


def in_own_words(script: Any, name: str) -> str | None:
    """What to write for a command of Karamelo that is not one here; None for other words.

    Parameters
    ----------
    script
        The interpreter of a script that has a call of the command.
    """
    calls = [s for frame in script.frames for s in frame.statements if isinstance(s, Call)]
    own = next((call for call in calls if call.name == "method"), None)
    asked = [c for c in (script.statement, *calls) if isinstance(c, Call) and c.name == name]
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
    """A region and a solid for ``solid(ID, block, xlo, ..., ppc, material, h)``."""
    ID, shape, *numbers = words_of(statement)
    if len(numbers) < 6 or shape not in SHAPES:
        return None
    inside, points = ", ".join(numbers[:-3]), ", ".join(numbers[-3:])
    return f"region(box, {SHAPES[shape]}, {inside}), and solid({ID}, region, box, {points})"


def longer(name: str, given: Sequence[Any]) -> str | None:
    """The line for a law that was written with fewer arguments, such as ``eos shock``.

    Parameters
    ----------
    name
        Family and style.
    given
        What stands behind the style.
    """
    forms = SHORTER.get(name)
    if forms is None or not given:
        return None
    family, style = name.split()
    says, line = forms.get(len(given), forms[None])
    ID = words_of(given[0].statement)[:1] or ["ID"]
    words = ", ".join(line).format(*(argument.text for argument in given))
    return f"{says}{family}({ID[0]}, {style}, {words})"
