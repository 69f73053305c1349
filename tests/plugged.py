"""Plug-ins put into a folder as pip would install them, without building anything."""

import shutil
import tomllib
from pathlib import Path

PLUGIN = Path(__file__).parent / "plugin"


def install(folder: Path) -> Path:
    """Put the example package into a folder; returns the folder."""
    project = tomllib.loads((PLUGIN / "pyproject.toml").read_text("utf-8"))["project"]
    source = PLUGIN / "src" / "mpm_examples"
    shutil.copytree(source, folder / source.name, ignore=shutil.ignore_patterns("__pycache__"))
    return offer(folder, project["name"], project["version"], project["entry-points"])


def offer(folder: Path, name: str, version: str, styles: dict[str, dict[str, str]]) -> Path:
    """Write the metadata of a package: its styles by the groups of their families."""
    info = folder / f"{name.replace('-', '_')}-{version}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = []
    for group, named in styles.items():
        lines += [f"[{group}]", *(f"{style} = {value}" for style, value in named.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return folder
