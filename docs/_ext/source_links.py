"""Links from equations to the functions that compute them: {src}`kernels/sweep.py:function`.

One page shows the source of all functions that are named so in docs/formulas.md.
"""

from __future__ import annotations

import re
from pathlib import Path

ROLE = re.compile(r"\{src\}`([\w/]+\.py):(\w+)`")
PAGE = "reference/generated/source"


def named_in(text: str) -> list[tuple[str, str]]:
    """Files of the package and names of functions or classes, each once."""
    return list(dict.fromkeys(ROLE.findall(text)))


def anchor(file: str, name: str) -> str:
    """The label of a function."""
    return re.sub(r"[^a-z0-9]+", "-", f"source-{file.removesuffix('.py')}-{name}".lower())


def write_page(docs: Path) -> None:
    """Write the page of all functions."""
    parts = [
        "# Source of the equations",
        "The functions behind [the equations](../../formulas.md).",
    ]
    for file, name in named_in((docs / "formulas.md").read_text(encoding="utf-8")):
        parts.append(f"({anchor(file, name)})=\n## {name}\n\n`karamelo_py/{file}`")
        include = f"```{{literalinclude}} ../../../karamelo_py/{file}"
        parts.append(f"{include}\n:language: python\n:pyobject: {name}\n```")
    (docs / f"{PAGE}.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def source_role(role, rawtext, text, lineno, inliner, options=None, content=()):
    """Link a function to its source."""
    from docutils import nodes  # tests call named_in, and have no docutils

    file, _, name = text.partition(":")
    here = inliner.document.settings.env.docname
    target = "../" * here.count("/") + f"{PAGE}.html#{anchor(file, name)}"
    link = nodes.reference("", "", nodes.literal(text=name), refuri=target, internal=True)
    return [link], []


def setup(app):
    """Write the page after those of the reference, which empty their folder first."""
    app.add_role("src", source_role)
    app.connect("builder-inited", lambda app: write_page(Path(app.srcdir)), priority=850)
    return {"parallel_read_safe": True}
