"""Named materials and their parts."""

from collections.abc import Iterator
from typing import Any, NamedTuple

from karamelo_py.language import registry
from karamelo_py.language.arguments import Named


class MaterialPart(Named):
    """A named law, or component of a law.

    `kind` is a family such as ``eos``, and `style` its member.

    `made` is the law, or several laws by kind; `arguments` are the part's arguments in the script.
    """

    def __init__(
        self,
        kind: str,
        style: str,
        made: "NamedTuple | dict[str, NamedTuple]",
        arguments: dict | None = None,
    ):
        self.kind = kind
        self.style = style
        self.arguments = arguments or {}
        self.laws = made if isinstance(made, dict) else {kind: made}

    @property
    def law(self) -> NamedTuple:
        return self.laws[self.kind]

    def parts(self) -> Iterator["MaterialPart"]:
        """Yield this part, the parts it consists of, and their parts."""
        yield self
        for value in self.arguments.values():
            for one in value if isinstance(value, tuple) else (value,):
                if isinstance(one, MaterialPart):
                    yield from one.parts()


class Material(MaterialPart):
    script_kind = "the ID of a material"
    catalogue = "materials"
    flat: type | None = None  # wraps the law for thin bodies and generalised plane strain
    fluid: Any = None  # pore water; ``around(law)`` wraps the law

    @property
    def whole(self) -> NamedTuple:
        return self.laws[self.kind]

    @property
    def law(self) -> NamedTuple:
        return self.flat(self.whole) if self.flat else self.filled

    @property
    def filled(self) -> NamedTuple:
        return self.whole if self.fluid is None else self.fluid.around(self.whole)

    @property
    def words(self) -> str:
        styles = [
            name
            for kind, law in zip(self.whole._fields, self.whole, strict=True)
            if isinstance(law, tuple) and law
            if registry.knows(kind, name := registry.name_of(kind, type(law)))
        ]
        parts = ", ".join(styles)
        return f"{self.id} ({self.style}{': ' if parts else ''}{parts})"
