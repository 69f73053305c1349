"""The reference: a page for each command and style, made from its signature and its docstring.

Pages are written to docs/reference/generated before Sphinx reads its sources. Only what karamelo-py
itself brings is described; plug-ins describe themselves (karamelo-py help). Pages of docs/ link to
reference/index.md#fix-body_force, which is there in the source tree, too.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable
from pathlib import Path

from karamelo_py.app.catalogue import COMMAND, described, families, help_of
from karamelo_py.language import registry

TITLES = {
    "command": ("Commands", "What a script can say."),
    "basis": ("Basis functions", "The third argument of [method](command/method.md)."),
    "transfer": (
        "Transfers",
        "The second argument of [method](command/method.md): how velocity comes from the nodes to "
        "the points.",
    ),
    "method": ("Methods", "The first argument of [method](command/method.md)."),
    "scheme": ("Schemes", "The argument of [scheme](command/scheme.md): when the stress follows."),
    "fix": ("Fixes", "What acts on a run: styles of [fix](command/fix.md)."),
    "compute": ("Computes", "What measures a run: styles of [compute](command/compute.md)."),
    "dump": ("Dumps", "Files of snapshots: styles of [dump](command/dump.md)."),
    "region": ("Regions", "Parts of space: styles of [region](command/region.md)."),
    "solid": ("Solids", "Bodies of points: styles of [solid](command/solid.md)."),
    "eos": ("Equations of state", "Pressure and density: styles of [eos](command/eos.md)."),
    "strength": ("Strengths", "Deviatoric stress: styles of [strength](command/strength.md)."),
    "material": ("Materials", "Constitutive laws: styles of [material](command/material.md)."),
}
_CODE = re.compile(r"(``[^`]+``|`[^`]+`)")
_SPECIAL = re.compile(r"([\\*_<>\[\]#|$])")


def write_pages(folder: Path) -> None:
    """Write all pages and indexes to `folder`, which is emptied before."""
    shutil.rmtree(folder, ignore_errors=True)
    own = {family: _own(family) for family in families()}
    own = {family: names for family, names in own.items() if names}
    for family, names in own.items():
        (folder / family).mkdir(parents=True)
        for name in names:
            _write(folder / family / f"{_file(name)}.md", _page(family, name, own))
        _write(folder / f"{family}.md", _index(family, names))
    _write(folder / "index.md", _all(own))


def _own(family: str) -> list[str]:
    names = registry.names(family)
    return [n for n in names if registry.origin(family, n).startswith("karamelo-py ")]


def _file(name: str) -> str:
    return name.replace("/", "-")


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _all(own: dict[str, list[str]]) -> str:
    """All commands and styles on one page, each with a line."""
    parts = ["# Commands and styles", "Each name has a page with its arguments and an example."]
    for family, names in own.items():
        title, text = TITLES.get(family, (family.capitalize(), ""))
        parts += [f"## {title}", text, _table(family, names)]
    return "\n\n".join([*parts, _toctree(own)]) + "\n"


def _index(family: str, names: list[str]) -> str:
    title, text = TITLES.get(family, (family.capitalize(), ""))
    toctree = _toctree(f"{family}/{_file(name)}" for name in names)
    return f"# {title}\n\n{text}\n\n{_table(family, names)}\n\n{toctree}\n"


def _table(family: str, names: list[str]) -> str:
    rows = [
        f"| [`{name}`]({family}/{_file(name)}.md) | {escaped(help_of(family, name).summary)} |"
        for name in names
    ]
    return "\n".join(["| | |", "|---|---|", *rows])


def _toctree(names: Iterable[str]) -> str:
    listed = "\n".join(names)
    return f"```{{toctree}}\n:hidden:\n:maxdepth: 1\n\n{listed}\n```"


def _page(family: str, name: str, own: dict[str, list[str]]) -> str:
    help_ = help_of(family, name)
    parts = [f"# {escaped(help_.name)}", f"```karamelo\n{help_.syntax}\n```"]
    parts.append(escaped(help_.summary))
    if help_.text:
        parts.append(escaped(help_.text))
    if help_.parameters:
        parts.append("## Parameters")
    for group, lines in described(help_.parameters):
        names = ", ".join(f"`{each.name}{'=' * each.keyword}`" for each in group)
        said = [escaped(" ".join(line.split())) for line in lines]
        parts.append(f"{names}\n: " + "\n\n  ".join(said or ["see above"]))
    for title, content in help_.sections.items():
        parts.append(f"## {title}")
        if title == "Example":
            parts.append(f"```karamelo\n{content}\n```")
        elif title == "See Also":
            names = re.split(r"[,\n]+", content)
            parts.append(", ".join(_link(n.strip(), family, own) for n in names if n.strip()))
        else:
            parts.append(escaped(content))
    styles = own.get(name, []) if family == COMMAND else []
    if styles:
        parts.append("## Styles")
        parts.append(", ".join(_link(style, name, own) for style in styles))
    return "\n\n".join(parts) + "\n"


def _link(text: str, family: str, own: dict[str, list[str]]) -> str:
    """A link to what `text` names: a style of this family, a command, or "family style"."""
    first, _, rest = text.partition(" ")
    for home, name in ((family, text), (COMMAND, text), (first, rest)):
        if name in own.get(home, []):
            return f"[{escaped(text)}](../{home}/{_file(name)}.md)"
    raise ValueError(f"See Also of a style of {family} names '{text}', which does not exist")


def escaped(text: str) -> str:
    """Text of a docstring as Markdown: code in back quotes stays, other signs mean themselves."""
    parts = _CODE.split(text)
    return "".join(p if p.startswith("`") else _SPECIAL.sub(r"\\\1", p) for p in parts)


_LINK = re.compile(r"\]\(((?:\.\./)*(?:reference/)?)index\.md#([a-z]+)-([^)]+)\)")


def lead_to_pages(app, docname: str, source: list[str]) -> None:
    """Let links to a style on the page of the reference lead to the page of the style."""

    def page(link: re.Match) -> str:
        known = link[2] in families()
        return f"]({link[1]}generated/{link[2]}/{link[3]}.md)" if known else link[0]

    source[0] = _LINK.sub(page, source[0])


def setup(app):
    """Write the pages before the sources are read."""
    app.connect("source-read", lead_to_pages)
    app.connect(
        "builder-inited", lambda app: write_pages(Path(app.srcdir) / "reference" / "generated")
    )
    return {"parallel_read_safe": True}
