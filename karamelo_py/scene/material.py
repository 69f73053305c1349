"""Materials and parts of materials that a script has named: entries of catalogues."""

from typing import NamedTuple

from karamelo_py.language import registry
from karamelo_py.language.arguments import Named
from karamelo_py.points.laws.thin import Thin


class MaterialPart(Named):
    """A named law or part of a law, of a `kind` such as ``eos`` and a `style`.

    `made` is the return value of the style: the law, or `laws` by kind if it brings several.
    `given` are the values of its arguments by name.
    """

    def __init__(
        self,
        kind: str,
        style: str,
        made: "NamedTuple | dict[str, NamedTuple]",
        given: dict | None = None,
    ):
        self.kind = kind
        self.style = style
        self.given = given or {}
        self.laws = made if isinstance(made, dict) else {kind: made}

    @property
    def law(self) -> NamedTuple:
        """The NamedTuple of parameters, whose class selects point functions (`points.laws`)."""
        return self.laws[self.kind]


class Material(MaterialPart):
    """A material."""

    script_kind = "the ID of a material"
    catalogue = "materials"
    thin = False  # its bodies have no stress across

    @property
    def whole(self) -> NamedTuple:
        """The law in three dimensions."""
        return self.laws[self.kind]

    @property
    def law(self) -> NamedTuple:
        """The law of its points."""
        return Thin(self.whole) if self.thin else self.whole

    @property
    def words(self) -> str:
        """ID, style, and the styles of its parts: ``steel (eos-strength: linear, plastic)``."""
        styles = [
            registry.name_of(kind, type(part))
            for kind, part in zip(self.whole._fields, self.whole, strict=True)
            if isinstance(part, tuple) and part and registry.names(kind)
        ]
        parts = ", ".join(styles)
        return f"{self.id} ({self.style}{': ' if parts else ''}{parts})"
