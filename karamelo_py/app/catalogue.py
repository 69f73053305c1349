"""karamelo-py styles and karamelo-py help."""

import inspect
import re
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import groupby
from pathlib import Path

from karamelo_py.language import registry, rules
from karamelo_py.language.help import Help, describe
from karamelo_py.language.signature import FORMS, Parameter
from karamelo_py.output.console import Console
from karamelo_py.script.errors import ScriptError, codes, instead, meant, table

COMMAND = "command"
PROGRAM = "karamelo-py"
STYLES_USAGE = "karamelo-py styles [FAMILY]"
HELP_USAGE = "karamelo-py help COMMAND, karamelo-py help STYLE, or karamelo-py help FAMILY STYLE"
_WIDEST = 88  # characters per line
_FILLERS = {"a", "an", "the", "one", "of", "or"}


def families() -> list[str]:
    return sorted(registry.families(), key=lambda family: (family != COMMAND, family))


def _form(family: str, word: str) -> Callable | None:
    """Return the form of the command `family` that `word` selects, such as method(auto)."""
    if not registry.knows(COMMAND, family):
        return None
    return FORMS.get(registry.find(COMMAND, family), {}).get(word)


def help_of(family: str, name: str) -> Help:
    if form := _form(family, name):
        return describe(form, family)
    target = registry.find(family, name)
    try:
        return describe(target, name if family == COMMAND else f"{family} {name}")
    except TypeError as error:
        raise ScriptError(
            f"{family} '{name}' of {registry.origin(family, name)} has a signature that cannot be "
            f"understood: {error}"
        ) from error


def describe_parameter(parameter: Parameter) -> str:
    family, text, default = parameter.kind.family, parameter.text, parameter.default
    if text == "anything":  # the command or style itself checks the value
        return ""
    parts = ["one of " + ", ".join(registry.names(family)) if family else text]
    if parameter.variadic and parts[0].startswith("one of "):
        parts = ["some of" + parts[0].removeprefix("one of")]
    elif parameter.variadic:
        parts.append("any number of them")
    if parameter.optional:
        if isinstance(default, bool):
            default = str(default).lower()
        elif isinstance(default, float):
            default = f"{default:g}"
        parts.append("may be left out" if default is None else f"{default} when left out")
    return ("; " if parts[0].startswith(("one of ", "some of ")) else ", ").join(parts)


def described(parameters: Iterable[Parameter]) -> Iterator[tuple[list[Parameter], list[str]]]:
    """Yield groups of parameters with a common description, with the lines of types and text.

    A first sentence of the description that only repeats the types is omitted.
    """
    for text, same in groupby(parameters, key=lambda p: p.description or describe_parameter(p)):
        group = list(same)
        names: dict[str, list[str]] = {}
        for each in group:
            names.setdefault(describe_parameter(each), []).append(each.name)
        kinds = [f"{', '.join(names[k])}: {k}" if len(names) > 1 else k for k in names if k]
        text = text if group[0].description else ""
        first, *rest = re.split(r"(?<=\.)\s+", text, maxsplit=1)
        if _words(first) <= _words(" ".join(kinds)):
            text = "".join(rest)
        yield group, [*kinds, *filter(None, [text])]


def _words(text: str) -> set[str]:
    return set(re.findall(r"\w+", text.lower())) - _FILLERS


def print_styles(words: Sequence[str]) -> int:
    if len(words) > 1:
        raise ScriptError(f"too many arguments: {' '.join(words)}", expected=STYLES_USAGE)
    page = _Page()
    for index, family in enumerate([_family(words[0])] if words else families()):
        page.say("\n" * (index > 0) + _plural(family), "bold")
        page.rows([(name, family, name) for name in registry.names(family)])
    return 0


def print_help(
    words: list[str],
    commands: Iterable[str] = (),
    manuals: Callable[[], Mapping[str, tuple[str, str]]] = dict,
) -> int:
    """Print help on a command, style, argument or topic. Return the exit status.

    `manuals` returns, for each subcommand, its summary and its help text.
    """
    if len(words) == 2 and (family := _singular(words[0])) in families():
        try:
            with registry.modules_of(Path()):
                return _explain(family, words[1])
        except ScriptError as error:
            if error.hint or not _about(" ".join(words)):
                raise
    name = " ".join(words)
    homes = [family for family in families() if registry.knows(family, name)]
    if COMMAND in homes or len(homes) == 1:
        return _explain(homes[0], name)
    if homes:
        raise ScriptError(
            f"'{name}' has several meanings: {', '.join(homes)}",
            expected=" or ".join(f"karamelo-py help {family} {name}" for family in homes),
        )
    if _singular(name) in families():
        return print_styles([name])
    if name in codes():
        return _explain_code(name, codes()[name]["title"], codes()[name]["text"])
    for answer in (text for text, alike in table()["answers"].items() if name.lower() in alike):
        return _explain_code(name, answer, "")
    for targets in (text for text, alike in table()["first"].items() if name.lower() in alike):
        named = [target.split() for target in targets.split(", ")]
        return _list(f"Commands about {name}", named, manuals())
    fewer = [" ".join(words[:k] + words[k + 1 :]) for k in range(len(words) * (len(words) > 2))]
    said = next(filter(_about, [name, *fewer]), name)
    arguments, related = _arguments(name), _about(said)
    failures = [words for _, *words in rules.known_failures() if rules.code_of(words[0]) == name]
    for about, reason, cure in failures[:1]:
        _explain_code(name, f"known failure: {about}", f"{reason}.\n\nFix: {cure}")
    programs, seeks = manuals(), _patterns(said)
    first = [(f, n) for f, n in related if all(s.search(f"{n} {_summary(f, n)[0]}") for s in seeks)]
    if arguments and first:
        _list(f"Commands about {said}", first, programs)
        _Page().say()
        related = [one for one in related if one not in first]
    if arguments:
        _explain_argument(name, arguments)
    if related := [*related, *_subcommands(said, programs)]:
        known = arguments or failures
        _list("\nSee also" if known else f"Commands about {said}", related, programs)
    if arguments or related or failures:
        return 0
    if len(words) > 1 and meant(words[0], families()):
        raise _unknown("family", words[0], families())
    names = {n for f in families() for n in registry.names(f)}
    raise _unknown("command or style", name, names.union(commands))


def _list(title: str, named: Iterable[Sequence[str]], manuals: Mapping[str, tuple]) -> int:
    page = _Page()
    page.say(title, "bold")
    page.rows([(f"{family} {name}", family, name) for family, name in named if family != PROGRAM])
    for name in (name for family, name in named if family == PROGRAM):
        page.say(f"  {PROGRAM} {name}  {manuals[name][0]}")
    return 0


def _explain_code(code: str, title: str, text: str) -> int:
    page = _Page()
    page.say(code, "bold")
    page.paragraph(f"{title}\n\n{text}".strip())
    return 0


def _family(word: str) -> str:
    family = _singular(word)
    if family not in families():
        raise _unknown("family", word, families())
    return family


def _singular(word: str) -> str:
    """Return the name of a family; fixes, Fix and fix give fix."""
    word = word.lower()
    return next((family for family in families() if word in (family, _plural(family))), word)


def _plural(family: str) -> str:
    usual = family + ("es" if family.endswith(("x", "s")) else "s")
    return {"basis": "bases", "eos": "eos"}.get(family, usual)


def _unknown(noun: str, name: str, names: Iterable[str]) -> ScriptError:
    names, columns = sorted(names), table()["columns"].items()
    meanings = (f"the column {c} of dumps and pictures" for c, w in columns if name.lower() in w)
    return ScriptError(
        f"unknown {noun} '{name}'",
        expected="one of " + ", ".join(names) if noun == "family" else HELP_USAGE,
        hint=next(meanings, None)
        or next(filter(None, (instead(family, name) for family in families())), None)
        or meant(name, names)
        or "karamelo-py styles lists them all",
    )


def _summary(family: str, name: str) -> tuple[str, bool]:
    try:
        target = registry.find(family, name)
    except ScriptError as error:
        return f"broken: {error.message}", True
    first = inspect.cleandoc(target.__doc__ or "").partition("\n\n")[0]
    return " ".join(first.split()), False


def _explain(family: str, name: str) -> int:
    help_ = help_of(family, name)
    page = _Page()
    page.say(help_.name, "bold")
    origin = (COMMAND, family) if _form(family, name) else (family, name)
    page.say(f"from {registry.origin(*origin)}")
    page.say()
    page.say(f"  {help_.syntax}")
    for text in filter(None, (help_.summary, help_.text)):
        page.say()
        page.paragraph(text)
    if help_.parameters:
        page.heading("Parameters")
        for group, lines in described(help_.parameters):
            names = (f"{each.name}=" if each.keyword else each.name for each in group)
            page.say(f"  {', '.join(names)}")
            for line in lines:
                page.paragraph(line, indent=6)
            if group[0].kind.family:
                page.say(f"      karamelo-py help {group[0].kind.family} NAME explains one.")
    for title, content in help_.sections.items():
        page.heading(title)
        if title == "Example":
            for line in content.splitlines():
                page.say(f"  {line}")
        else:
            page.paragraph(content, indent=2)
    return 0


def _about(word: str) -> list[tuple[str, str]]:
    begins = _patterns(word)
    matches: list[list[tuple[str, str]]] = [[], [], [], []]
    for family in families():
        for name in registry.names(family):
            summary, broken = _summary(family, name)
            text = "" if broken else registry.find(family, name).__doc__ or ""
            texts = name, f"{name} {summary}", f"{name} {text}"
            levels = (k for k in range(3) if all(each.search(texts[k]) for each in begins))
            matches[next(levels, 3)].append((family, name))
    return matches[0] + matches[1] or matches[2]


def _patterns(word: str) -> list[re.Pattern]:
    topics = {synonym: topic for topic, alike in table()["topics"].items() for synonym in alike}
    word = topics.get(word.lower(), word)
    words = [term for term in word.split() if len(term) > 2] or [word]
    sought = [re.escape(topics.get(term.lower(), term)) for term in words]
    return [re.compile(rf"(?<![^\W_]){term}", re.IGNORECASE) for term in sought]


def _subcommands(word: str, manuals: Mapping[str, tuple[str, str]]) -> Iterable[tuple[str, str]]:
    begins = _patterns(word)
    texts = [(name, f"{name} {text}") for name, (_, text) in manuals.items()]
    return [(PROGRAM, name) for name, text in texts if all(each.search(text) for each in begins)]


def _arguments(word: str) -> dict[str, Parameter]:
    parameters = {}
    for family in families():
        for name in registry.names(family):
            with suppress(ScriptError):  # plug-ins may be broken
                help_ = help_of(family, name)
                for parameter in help_.parameters:
                    if word == parameter.name or word in parameter.kind.words:
                        parameters[help_.name] = parameter
    return {owner: p for owner, p in parameters.items() if p.name == word} or parameters


def _explain_argument(word: str, parameters: dict[str, Parameter]) -> None:
    page = _Page()
    owner, parameter = max(parameters.items(), key=lambda item: len(item[1].description))
    page.say(word, "bold")
    page.say()
    of = f"{parameter.name}, an argument of " if word != parameter.name else "an argument of "
    page.paragraph(of + ", ".join(parameters))
    page.say()
    for line in next(described([parameter]))[1]:
        page.paragraph(line, indent=6)
    page.say()
    page.say(f"karamelo-py help {owner} explains the rest.")


class _Page(Console):
    def _write(self, text: str) -> None:
        super()._write(text)
        if self._broken:
            raise BrokenPipeError  # ends quietly: nothing else is left to do

    def heading(self, text: str) -> None:
        self.say()
        self.say(text, "bold")

    def paragraph(self, text: str, indent: int = 0) -> None:
        width = min(self._rich.width if self.terminal else _WIDEST, _WIDEST) - indent
        for index, block in enumerate(text.replace("``", "").split("\n\n") if text else ()):
            if index:
                self.say()
            for line in textwrap.wrap(" ".join(block.split()), width):
                self.say(" " * indent + line)

    def rows(self, listed: Sequence[tuple[str, str, str]]) -> None:
        origins = [registry.origin(family, name) for _, family, name in listed]
        widths = [max(map(len, column), default=0) for column in ([s for s, *_ in listed], origins)]
        for (shown, family, name), origin in zip(listed, origins, strict=True):
            self.row(shown.ljust(widths[0]), origin.ljust(widths[1]), *_summary(family, name))

    def row(self, name: str, origin: str, summary: str, broken: bool) -> None:
        if not self.terminal:
            self.say(f"  {name}  {origin}  {summary}")
            return
        from rich.text import Text

        text = Text.assemble("  ", (name, "cyan"), "  ", (origin, "dim"), "  ")
        text.append(summary, style="red" if broken else None)
        self._rich.print(text, soft_wrap=broken, no_wrap=not broken, overflow="ellipsis")
