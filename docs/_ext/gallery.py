"""The gallery: a card for each scene with a picture of its bodies, and a page for every scene.

Pages are written to docs/gallery/generated before Sphinx reads its sources. docs/films.toml says
what a card shows, docs/films.json how large and how long the run of its picture was. A scene of a
kind (`lame_quarter`) without a chart of its own shows that of the scene whose name its own begins
with.
"""

from __future__ import annotations

import json
import re
import shutil
import tomllib
from pathlib import Path

TOC = "```{toctree}\n:hidden:\n:maxdepth: 1\n\n%s\n```"
CARD = """````{{grid-item-card}} {title}
:img-top: /_static/gallery/{name}.png
:link: {name}
:link-type: doc

{shows}

{size}

{tags}
````"""

# Titles of pages and cards, where the name of a scene does not say it to a reader.
TITLES = {
    "axis_aligned": "Pulsating square",
    "axis_aligned_1d": "Pulsating bar",
    "axis_aligned_3d": "Pulsating cube",
    "billet": "Upset billet in 3D",
    "billet_axisymmetric": "Upset billet, axisymmetric",
    "cantilever_tets": "Cantilever of tetrahedra",
    "cold_spray": "Cold spray in 3D",
    "cold_spray_axisymmetric": "Cold spray, axisymmetric",
    "collapse": "Heap of aluminium bars",
    "column": "Column under its weight",
    "cook": "Cook's membrane",
    "dam_ritter": "Long dam break (Ritter)",
    "element": "Laws of materials at a point",
    "energy_disk": "Energy of a moving disk",
    "heat_slab": "Heated slab",
    "hertz": "Disk on a plane (Hertz)",
    "incline": "Disk on an incline",
    "lame": "Thick elastic cylinder (Lamé)",
    "slow_bar": "Slowly vibrating bar",
    "slump": "Slope failure",
    "sod": "Shock tube (Sod)",
    "static_billet": "Upset billet in load steps",
    "static_block": "Block on a plane in load steps",
    "static_collapse": "Soil under its weight in load steps",
    "static_column": "Column under its weight in load steps",
    "static_footing": "Footing in load steps",
    "static_hertz": "Disk on a plane in load steps",
    "static_rough_footing": "Rough footing in load steps",
    "static_slope": "Slope failure in load steps",
    "taylor_bar": "Taylor bar in 3D",
    "taylor_bar_227": "Taylor bar at 227 m/s",
    "taylor_bar_axisymmetric": "Taylor bar, axisymmetric",
    "thick_cylinder": "Thick cylinder that flows",
    "two_disks_2020": "Two disks in the language of 2020",
    "two_disks_karamelo": "Two disks in Karamelo's language",
    "vertical_bar": "Hanging cube",
}


def write_gallery(docs: Path, folder: Path) -> None:
    """Write a page for each scene, and the gallery of all, to `folder`, which is emptied before."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    static = docs / "_static"
    shown = tomllib.loads((docs / "films.toml").read_text(encoding="utf-8"))
    told = json.loads((docs / "films.json").read_text(encoding="utf-8"))
    scenes = {
        path.name.removeprefix("in."): head_of(path.read_text(encoding="utf-8"))
        for path in sorted((docs.parent / "inputs").glob("in.*"))
    }
    for name, (title, text) in scenes.items():
        page = _page(name, title, text, told.get(name), static)
        (folder / f"{name}.md").write_text(page, encoding="utf-8")
    cards = [_card(name, how, told[name]) for name, how in shown.items()]
    others = {name: title for name, (title, _) in scenes.items() if name not in shown}
    rest = [f"| [`in.{name}`]({name}.md) | {title} |" for name, title in others.items()]
    parts = [
        "# Gallery",
        "Choose a card for the script, its pictures and its numbers. Times are those of one thread "
        "of a shared machine, with compilation, for the picture on the card. Numbers beside those "
        "of others are in [Comparison](../../comparison.md).",
        "`````{grid} 1 2 2 2\n:gutter: 3\n\n" + "\n\n".join(cards) + "\n`````",
        "## More scenes",
        "\n".join(["| script | what it is |", "|---|---|", *rest]),
        TOC % "\n".join(sorted(scenes, key=title_of)),
    ]
    (folder / "index.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _card(name: str, how: dict, told: dict) -> str:
    tags = " ".join(f"{{bdg-secondary-line}}`{tag}`" for tag in how["tags"])
    return CARD.format(
        name=name, title=title_of(name), shows=how["shows"], size=_size(told), tags=tags
    )


def _size(told: dict) -> str:
    points = f"{told['points']:,}".replace(",", " ")
    return f"{points} points, {told['seconds']:.0f} s"


def _page(name: str, title: str, text: str, told: dict | None, static: Path) -> str:
    """A scene: what it is, its bodies, how to run it, its chart, its script."""
    parts = [f"# {title_of(name)}", title]
    words = ""
    if told:
        words = "".join(f" -var {key} {value}" for key, value in told["var"].items())
        parts.append(
            f"```{{image}} /_static/gallery/{name}.png\n:alt: {told['text']}\n:width: 560px\n```"
        )
        parts.append(f"{told['text']} The picture: {_size(told)}.")
    parts.append(f"```sh\nkaramelo-py inputs/in.{name}{words}\n```")
    parts.append(f"{{download}}`Download the script <../../../inputs/in.{name}>`")
    if chart := chart_of(name, static):
        image = f"/_static/{chart.relative_to(static)}"
        parts.append("## Comparison with the reference")
        parts.append(f"```{{image}} {image}\n:alt: {title}\n:width: 600px\n```")
    parts += ["## Script"]
    parts += [f"```text\n{text}\n```"] if text else []
    parts.append(f"```{{literalinclude}} ../../../inputs/in.{name}\n:language: karamelo\n```")
    return "\n\n".join(parts) + "\n"


def title_of(name: str) -> str:
    """Give the title of a scene for readers."""
    return TITLES.get(name, name.replace("_", " ").capitalize())


def head_of(text: str) -> tuple[str, str]:
    """The first sentence of a script's head, and the rest of the comment."""
    lines = re.match(r"(#[^\n]*\n)*", text)[0].splitlines()
    plain = [line.removeprefix("#").removeprefix(" ").rstrip() for line in lines]
    end = next((k for k, line in enumerate(plain) if not line), len(plain))
    return " ".join(plain[:end]), "\n".join(plain[end:]).strip("\n")


def chart_of(name: str, static: Path) -> Path | None:
    """The chart of a scene beside its reference, or of the one that it is a kind of."""
    while name:
        if (path := static / "comparison" / f"{name}.png").is_file():
            return path
        name = name.rpartition("_")[0]
    return None


def lead_to_gallery(app, docname: str, source: list[str]) -> None:
    """Let links of the front page to scripts lead to their pages, and to all of them."""
    if docname == "index":
        text = re.sub(r"\]\(\.\./inputs/in\.(\w+)\)", r"](gallery/generated/\1.md)", source[0])
        source[0] = text.replace("](../inputs)", "](gallery/generated/index.md)")


def setup(app):
    """Write the pages when a build begins."""

    def write(app) -> None:
        docs = Path(app.srcdir)
        write_gallery(docs, docs / "gallery" / "generated")

    app.connect("builder-inited", write, priority=800)
    app.connect("source-read", lead_to_gallery)
    return {"parallel_read_safe": True}
