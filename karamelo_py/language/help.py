"""Help about commands and styles, from their signatures and docstrings."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from karamelo_py.language import docstrings, signature


@dataclass(frozen=True)
class Help:
    """The help about a command or style.

    Attributes
    ----------
    syntax
        How it is called.
    summary, text
        First line and the rest of the docstring's head.
    parameters
        With kinds, defaults and descriptions.
    sections
        The other sections of the docstring: Example, Notes, See Also.
    """

    name: str
    syntax: str
    summary: str
    text: str
    parameters: list[signature.Parameter]
    sections: dict[str, str] = field(default_factory=dict)

    @property
    def example(self) -> str:
        """Lines of script."""
        return self.sections.get("Example", "")


def describe(target: Callable, name: str) -> Help:
    """Help about a command or style, from its signature and docstring, and those of its bases."""
    head, sections = docstrings.sections(target.__doc__ or "")
    summary, _, text = head.partition("\n\n")
    descriptions: dict[str, str] = {}
    # What a base class describes holds for the styles made from it.
    for owner in reversed(target.__mro__) if inspect.isclass(target) else (target,):
        for doc in (getattr(vars(owner).get("__init__"), "__doc__", None), owner.__doc__):
            inner = docstrings.sections(doc or "")[1]
            descriptions |= docstrings.descriptions(inner.pop("Parameters", ""))
            if owner is target:
                sections = inner | sections
    sections.pop("Parameters", None)
    shown = signature.documented(target)
    described = [replace(p, description=descriptions.get(p.name, "")) for p in shown]
    return Help(
        name,
        signature.syntax(target, name),
        " ".join(summary.split()),
        text.strip(),
        described,
        sections,
    )
