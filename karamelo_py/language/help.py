"""Help from signatures and docstrings."""

import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from karamelo_py.language import signature


@dataclass(frozen=True)
class Help:
    name: str
    syntax: str
    summary: str
    text: str
    parameters: list[signature.Parameter]
    sections: dict[str, str] = field(default_factory=dict)

    @property
    def example(self) -> str:
        return self.sections.get("Example", "")


def describe(target: Callable, name: str) -> Help:
    head, sections = sections_of(target.__doc__ or "")
    summary, _, text = head.partition("\n\n")
    noun = name.removeprefix("delete_").replace("_", " ")
    descriptions = {
        "ID": f"Name of the {noun}.",
        "arguments": "See the page of the style.",
        "active": "Without this command, ``false``.",
    }
    # Derived styles inherit descriptions of parameters.
    for owner in reversed(target.__mro__) if inspect.isclass(target) else (target,):
        init = owner.__init__.__doc__ if "__init__" in vars(owner) else None
        for doc in (init, owner.__doc__):
            inner = sections_of(doc or "")[1]
            descriptions |= _descriptions(inner.pop("Parameters", ""))
            if owner is target:
                sections = inner | sections
    sections.pop("Parameters", None)
    shown = signature.documented(target)
    described = [replace(p, description=descriptions.get(p.name, "")) for p in shown]
    line, first = signature.syntax(target, name), " ".join(summary.split())
    return Help(name, line, first, text.strip(), described, sections)


def sections_of(doc: str) -> tuple[str, dict[str, str]]:
    pieces = re.split(r"^([A-Z][A-Za-z ]+)\n-{3,}$", inspect.cleandoc(doc), flags=re.MULTILINE)
    titles = [title.replace("Examples", "Example") for title in pieces[1::2]]
    texts = (text.strip("\n") for text in pieces[2::2])
    return pieces[0].strip(), dict(zip(titles, texts, strict=True))


def _descriptions(section: str) -> dict[str, str]:
    descriptions: dict[str, str] = {}
    for block in re.split(r"\n(?=\S)", section):
        head, _, text = block.partition("\n")
        for name in filter(str.strip, head.partition(":")[0].split(",")):
            descriptions[name.strip().lstrip("*")] = inspect.cleandoc(text)
    return descriptions
