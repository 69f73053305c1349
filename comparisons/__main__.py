"""python -m comparisons [SCENE ...] [--small]: run scenes, compare them, draw pictures.

Pictures, logs and dumps go to ``--folder``, else to a new temporary folder. With ``--write`` the
pictures and the table go to docs/comparison.md, for the authors of the program; scenes that are not
named keep what the table said about them before.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from shutil import rmtree
from types import ModuleType
from typing import Any

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import comparisons
from comparisons.pictures import STYLE, finish
from comparisons.results import Result
from comparisons.row import Row

HERE = Path(__file__).parent
DOCS = HERE.parent / "docs"
PICTURES = DOCS / "_static" / "comparison"
INPUTS = HERE.parent / "inputs"
TOOLS = (
    "__main__",
    "auto",
    "field",
    "balance",
    "cost",
    "defaults",
    "exact",
    "faces",
    "lesser",
    "lines",
    "peers",
    "pictures",
    "results",
    "row",
    "slopes",
)


def scenes() -> list[str]:
    """Names of the scenes that have something to compare."""
    return sorted(m.name for m in iter_modules(comparisons.__path__) if m.name not in TOOLS)


def scene(name: str) -> ModuleType:
    """The comparison of a scene."""
    return import_module(f"comparisons.{name}")


def runner(name: str, folder: Path, size: dict[str, Any]) -> Callable[..., Result]:
    """``run(**variables)`` for a scene: the script by the command line, in a folder of its own.

    ``run(scene=...)`` runs another one, to compare with.
    """

    def run(scene: str = name, **variables: Any) -> Result:
        words = {**size, **variables}
        place = folder / "_".join([scene, *(f"{k}={v}" for k, v in words.items())]).replace(
            "/", "-"
        )
        rmtree(place, ignore_errors=True)  # a longer run before may have left later snapshots
        place.mkdir(parents=True)
        options = [part for k, v in words.items() for part in ("-var", k, str(v))]
        command = [sys.executable, "-m", "karamelo_py.app.cli"]
        command += [str(INPUTS / f"in.{scene}"), *options]
        done = subprocess.run(command, cwd=place, capture_output=True, text=True, check=False)
        if done.returncode:
            sys.exit(f"{' '.join(command[3:])}\n{done.stderr}")
        return Result(done.returncode, done.stdout, done.stderr, place)

    return run


def compare(name: str, folder: Path, pictures: Path, full: bool) -> list[Row]:
    """Run a scene, save its picture, return its rows."""
    module = scene(name)
    run = runner(name, folder, {} if full else module.SMALL or {})
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6, 4), layout="constrained")
        rows = list(module.compare(run, axes, full))
        finish(axes, module.__doc__)
        figure.savefig(pictures / f"{name}.png", dpi=110, bbox_inches="tight")
    plt.close(figure)
    return rows


HEAD = """# Comparison with published results

Written by `python -m comparisons --write`, which runs every scene at its published size and draws
the pictures. `python -m comparisons SCENE ...` runs some of them and changes no file. Differences
are relative to the published number, or to the nearer end of a range.
"""


def published(row: Row) -> str:
    """The published number or range."""
    ends = row.published if isinstance(row.published, tuple) else (row.published,)
    return " to ".join(f"{end:.4g}" for end in ends)


def section(name: str, rows: list[Row]) -> str:
    """The part of docs/comparison.md about a scene."""
    title = (scene(name).__doc__ or name).splitlines()[0]
    lines = [f"## `in.{name}`", "", title, ""]
    lines += ["| quantity | published | computed | difference | source |", "|---|---|---|---|---|"]
    for row in rows:
        # Relative to zero there is nothing to divide by.
        difference = f"{100 * row.difference:+.1f} %" if row.published else f"{row.difference:+.2g}"
        cells = (row.quantity, published(row), f"{row.computed:.4g}", difference, row.source)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", f"![{title}](_static/comparison/{name}.png)", ""])


def sections(text: str) -> dict[str, str]:
    """The parts of docs/comparison.md by the names of their scenes."""
    parts = ["## " + part for part in text.split("\n## ")[1:]]
    return {part.split("`")[1].removeprefix("in."): part.rstrip() + "\n" for part in parts}


def main() -> None:
    """Run scenes, write the page and the pictures."""
    parser = argparse.ArgumentParser(prog="python -m comparisons", description=__doc__)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="all, if none is named")
    parser.add_argument(
        "--small", action="store_true", help="at the size of the tests; writes no page"
    )
    parser.add_argument("--write", action="store_true", help="write docs/comparison.md, pictures")
    parser.add_argument("--folder", type=Path, help="of pictures, logs and dumps")
    options = parser.parse_args()
    if unknown := set(options.scenes) - set(scenes()):
        parser.error(f"unknown scene '{unknown.pop()}'; there are {', '.join(scenes())}")
    page = DOCS / "comparison.md"
    found = sections(page.read_text(encoding="utf-8")) if page.exists() else {}
    writes = options.write and not options.small
    folder = (options.folder or Path(tempfile.mkdtemp(prefix="comparisons-"))).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    for name in options.scenes or scenes():
        print(f"in.{name}", flush=True)
        print("  quantity: published | computed")
        rows = compare(name, folder, PICTURES if writes else folder, not options.small)
        for row in rows:
            mark = "ok" if row.agrees else f"NOT within {row.within:g}"
            print(f"  {row.quantity}: {published(row)} | {row.computed:.4g}  {mark}", flush=True)
        if writes:
            found[name] = section(name, rows)
            text = "\n".join([HEAD, *(found[key] for key in sorted(found))])
            page.write_text(text, encoding="utf-8")
    print(f"pictures, logs and dumps: {folder}")


if __name__ == "__main__":
    main()
