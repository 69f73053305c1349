"""The gallery: a page for each scene of inputs/, with picture, what its head says, and the script.

Pages are written to docs/gallery/generated before Sphinx reads its sources. A scene without a
picture of its own shows that of the scene whose name its own begins with.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

FOLDERS = ("gallery", "comparison")  # of pictures, below docs/_static
TOC = "```{toctree}\n:hidden:\n:maxdepth: 1\n\n%s\n```"


def write_gallery(docs: Path) -> None:
    """Write a page for each scene, and the gallery of all."""
    folder = docs / "gallery" / "generated"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    scenes = sorted((docs.parent / "inputs").glob("in.*"))
    names = [path.name.removeprefix("in.") for path in scenes]
    rows = []
    for name, path in zip(names, scenes, strict=True):
        title, text = head_of(path.read_text(encoding="utf-8"))
        shown = picture_of(name, docs / "_static")
        image = f"/_static/{shown.relative_to(docs / '_static')}" if shown else ""
        page = [f"# {name}", title]
        if image:
            page.append(f"```{{image}} {image}\n:alt: {title}\n:width: 600px\n```")
        page.append(f"```text\n{text}\n```" if text else "")
        page.append(f"```{{literalinclude}} ../../../inputs/in.{name}\n:language: karamelo\n```")
        content = "\n\n".join(part for part in page if part) + "\n"
        (folder / f"{name}.md").write_text(content, encoding="utf-8")
        cell = f"[![{name}]({image})](generated/{name}.md)" if image else ""
        rows.append(f"| {cell} | [`in.{name}`](generated/{name}.md): {title} |")
    table = "\n".join(["| | |", "|---|---|", *rows])
    toc = TOC % "\n".join(f"{name}" for name in names)
    (folder / "index.md").write_text(
        f"# Gallery\n\nThe scenes of `inputs/`; numbers beside those of others are in "
        f"[Comparison](../../comparison.md).\n\n{table.replace('(generated/', '(')}\n\n{toc}\n",
        encoding="utf-8",
    )


def head_of(text: str) -> tuple[str, str]:
    """The first sentence of a script's head, and the rest of the comment."""
    lines = re.match(r"(#[^\n]*\n)*", text)[0].splitlines()
    plain = [line.removeprefix("#").removeprefix(" ").rstrip() for line in lines]
    end = next((k for k, line in enumerate(plain) if not line), len(plain))
    return " ".join(plain[:end]), "\n".join(plain[end:]).strip("\n")


def picture_of(name: str, static: Path) -> Path | None:
    """The picture of a scene, or of the one that it is a kind of."""
    while name:
        for folder in FOLDERS:
            if (path := static / folder / f"{name}.png").is_file():
                return path
        name = name.rpartition("_")[0]
    return None


def setup(app):
    """Write the pages when a build begins."""
    app.connect("builder-inited", lambda app: write_gallery(Path(app.srcdir)), priority=800)
    return {"parallel_read_safe": True}
