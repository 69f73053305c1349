"""Mistakes in arguments, and what to write instead."""

import re
from collections.abc import Sequence
from itertools import pairwise

from karamelo_py.language import registry
from karamelo_py.language.arguments import NUMBER, Argument, with_gap
from karamelo_py.language.kinds import OutputFile, Parameter, Unfit
from karamelo_py.language.scene import Scene
from karamelo_py.language.unknown import longer
from karamelo_py.script.errors import Mark, ScriptError, meant, nearest, table
from karamelo_py.script.terms import number_of


def wrong_count(
    form: str,
    name: str,
    expected: Sequence[Parameter],
    arguments: Sequence[Argument],
    keywords: Sequence[str],
) -> ScriptError:
    first = arguments[0].word() if arguments else None
    is_style = any(registry.knows(family, first or "") for family in registry.families())
    if first and expected and expected[0].kind.family and not is_style:
        registry.find(expected[0].kind.family, first)  # raises an error that suggests similar names
    slots = [p for p in expected if not p.keyword]
    needed = [p for p in slots if not (p.optional or p.variadic)]
    surplus = arguments[len(slots) :] if not any(p.variadic for p in slots) else ()
    mark, hint, missing = None, None, [f"{word}=..." for word in keywords]
    if surplus:
        mark, hint = surplus[0].mark, _of_surplus(surplus[0].text, expected, name)
    elif len(arguments) < len(needed):
        hint = longer(name, arguments) or table()["otherwise"].get(name)
        missing = _named(needed[len(arguments) :], slots)
    if with_gap(arguments):
        hint = None
    elif left_out := _left_out(needed, arguments) if len(arguments) < len(needed) else []:
        before, filled = _filled(needed, arguments, left_out)
        mark, missing = before.mark, _named(left_out, slots)
        hint = hint or (f"{name}({filled})" if filled else None)
    elif missing and not surplus and not keywords:
        misfit = next(
            (a for s, a in zip(needed, arguments, strict=False) if not _fits(s, a.text)), None
        )
        mark = misfit.mark if misfit is not None else None
        hint = hint or _completed(name, needed, arguments, misfit)
    message = f"{'one argument' if len(surplus) == 1 else f'{len(surplus)} arguments'} too many"
    if missing:
        message = f"{', '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
    more = 0 if missing else len(surplus)
    return ScriptError(message, mark=mark, expected=form, hint=hint, code="arguments", surplus=more)


def _of_surplus(text: str, expected: Sequence[Parameter], name: str) -> str | None:
    if text.startswith("(") and (first := next((p.name for p in expected if p.keyword), None)):
        return f"{first}={text}"
    named = [p for p in expected if p.keyword]
    named = [p for p in named if not p.optional] or named
    if number_of(text) is not None and len(named) == 1 and not named[0].kind.words:
        return f"{named[0].name}={text}"
    words = {word: f"{p.name}={word}" for p in expected if p.keyword for word in p.kind.words}
    word = text if text in words else nearest(text, words)
    return words.get(word or "") or table()["surplus"].get(name)


def _left_out(slots: Sequence[Parameter], arguments: Sequence[Argument]) -> list[Parameter]:
    missing, rest = [], list(arguments)
    for slot in slots:
        if rest and _fits(slot, rest[0].text):
            del rest[0]
        else:
            missing.append(slot)
    return [] if rest or missing == slots[len(arguments) :] else missing


def _fits(slot: Parameter, text: str) -> bool:
    if slot.shown != slot.name and slot.kind.text.startswith(("the word ", "one of ")):
        return text in slot.kind.words
    return number_of(text) is None or not slot.kind.text.startswith("the ID of ")


def _completed(
    name: str,
    slots: Sequence[Parameter],
    arguments: Sequence[Argument],
    misfit: Argument | None,
) -> str | None:
    words, rest = [argument.text for argument in arguments], slots[len(arguments) :]
    if misfit is not None:
        solid = misfit._interpreter.hub.solids.get(words[-1])
        region = solid.region.id if solid is not None and solid.region else "regionID"
        given = next((word for word in slots[1].kind.words if word in words), None)
        form = table()["reordered"].get(f"{name} {misfit.text}")
        one, kind = solid.id if solid is not None else "solidID", given or slots[1].kind.words[0]
        return form and form.format(*words, region=region, solid=one, kind=kind)
    if not all(slot.kind.words for slot in rest):
        return None
    return f"{name}({', '.join([*words, *(slot.kind.words[0] for slot in rest)])})"


def _named(missing: Sequence[Parameter], slots: Sequence[Parameter]) -> list[str]:
    words = {word for p in slots if p.shown != p.name for word in p.shown.split("|")}
    return [f"{p.name}ID" if p.shown == p.name in words else p.shown for p in missing]


def _filled(
    slots: Sequence[Parameter], arguments: Sequence[Argument], missing: Sequence[Parameter]
) -> tuple[Argument, str | None]:
    rest, before = iter(arguments), next(k for k, slot in enumerate(slots) if slot in missing)
    words = [p.kind.words[0] if p in missing and p.kind.words else p in missing for p in slots]
    if True in words:
        return arguments[before], None
    return arguments[before], ", ".join(word or next(rest).text for word in words)


def unknown_keyword(
    word: str, argument: Argument, expected: Sequence[Parameter], owner: str, form: str
) -> ScriptError:
    by_name = [p.name for p in expected if not p.variadic]
    longer = next((f"did you mean '{name}'?" for name in by_name if name.startswith(word)), None)
    turned = next((f"did you mean '{n}'?" for n in by_name if n == word[:1] + word[:0:-1]), None)
    same = table()["synonyms"].get(word, "").split()
    same_hint = next((f"write {name}=..." for name in same if name in by_name), None)
    hint = same_hint or turned or meant(word, by_name) or longer
    hint = hint or table()["otherwise"].get(owner)
    choices = ", ".join(f"{n}=..." for n in by_name)
    if not hint and any(p.variadic for p in expected):
        choices, hint = form, f"arguments of {owner} are given by position"
    elif not hint and argument.knows(word):
        hint = "a comparison is written =="
    message = f"no argument is named '{word}'"
    mark = argument.mark
    code = "arguments"
    return ScriptError(message, mark=mark, expected=choices, hint=hint, code=code, name=word)


def swapped(
    hub: Scene, expected: list[Parameter], bound: dict[str, list[Argument]], wrong: Parameter
) -> str | None:
    def fits(parameter: Parameter, argument: Argument) -> bool:
        kind = parameter.kind
        if argument.is_null:
            return kind.nullable
        if kind.text.startswith(OutputFile.script_kind) and NUMBER.fullmatch(argument.text):
            return False
        try:
            kind.convert(hub, argument)
        except (Unfit, ScriptError):
            return False
        return not kind.family or registry.knows(kind.family, argument.word() or "")

    single = [p for p in expected if len(bound.get(p.name, ())) == 1 and not p.variadic]
    if wrong not in single:
        return None
    (first,) = bound[wrong.name]
    for other in single:
        (second,) = bound[other.name]
        if (
            other != wrong
            and not fits(other, second)
            and fits(wrong, second)
            and fits(other, first)
        ):
            right = f"{wrong.name} {second.text}, {other.name} {first.text}"
            return f"swap {first.text} and {second.text}: {right}"
    family, after = [p.kind.family for p in (*single, *single)][:2]
    word = bound[single[0].name][0].text
    if family and registry.knows(after or "", word):
        return f"{word} is a {after}; a {family} comes first: {', '.join(registry.names(family))}"
    return None


def comma_in_number(arguments: Sequence[Argument], surplus: int) -> str | None:
    """Suggest 0.5 for 0,5, and 12500 for 12,500.

    A comma counts as a decimal comma if the line has blanks after its other commas, or if the
    surplus arguments are exactly such decimals.
    """
    adjacent = [
        (one, two) for one, two in pairwise(arguments)
        if one.mark.column + one.mark.length + 1 == two.mark.column
        and one.text.lstrip("+-").isdigit() and two.text.isdigit()
    ]  # fmt: skip
    exact = len(adjacent) == surplus
    if not adjacent or not (exact or ", " in adjacent[0][0].mark.text):
        return None
    if not exact and any(
        re.fullmatch(r"\d{3}", two.text) and int(one.text) for one, two in adjacent
    ):
        return "commas separate arguments: a million is 1e6 or 1000000"
    if len(adjacent) != 1 and not exact:  # e.g. 0,1, 0,1 can be read in several ways
        return None
    return "with a decimal point: " + ", ".join(f"{one.text}.{two.text}" for one, two in adjacent)


def in_parentheses(arguments: Sequence[Argument]) -> str | None:
    """Suggest velocity=(0, -2) for velocity=0, -2, and n=0.4 for n=0,4."""
    for one, two in pairwise(arguments):
        if (named := one.keyword()) and NUMBER.fullmatch(two.text):
            name, first = named[0], named[1].text
            vector = f"in parentheses: {name}=({first}, {two.text})"
            begins = one.mark.column + one.mark.length + 1
            decimal = first.isdigit() and two.text.isdigit() and begins == two.mark.column
            return (
                f"with a decimal point: {name}={first}.{two.text}; {vector}" if decimal else vector
            )
    return None


def decimal_of_name(arguments: Sequence[Argument], wrong: ScriptError) -> str | None:
    """Suggest x=0.5 for x=0,5 if the 5 is the wrong argument."""
    for one, two in pairwise(arguments):
        named, begins = one.keyword(), one.mark.column + one.mark.length + 1
        touching = two.mark == wrong.mark and begins == two.mark.column
        if named and touching and named[1].text.lstrip("+-").isdigit() and two.text.isdigit():
            return f"with a decimal point: {named[0]}={named[1].text}.{two.text}"
    return None


def misfit(
    parameter: Parameter, argument: Argument, number: int | None, unfit: Unfit
) -> ScriptError:
    which = f"argument {number} '{parameter.name}'" if number else f"'{parameter.name}'"
    family, text, hint = parameter.kind.family, parameter.text, unfit.hint
    if family and NUMBER.fullmatch(argument.text):
        text, hint = f"one of {', '.join(registry.names(family))}", None
    if "time(T)" in text and (number_of(argument.text) or 0) > 0:
        hint = f"time({argument.text}) is a time"
    message, mark = f"{which} must be {text}, not {unfit.got}", unfit.mark or argument.mark
    return ScriptError(message, mark=mark, expected=text, hint=hint, code="argument")


def guilty(
    error: ScriptError, arguments: Sequence[Argument], bound: dict[str, list[Argument]]
) -> Mark | None:
    if isinstance(error.argument, int) and error.argument < len(arguments):
        plain = [argument for argument in arguments if argument.keyword() is None]
        return (arguments if error.argument >= 0 else plain)[error.argument].mark
    if isinstance(error.argument, str) and bound.get(error.argument):
        return bound[error.argument][0].mark
    words = (error.name, f'"{error.name}"')
    return next((a.mark for a in arguments if a.text in words), None)
