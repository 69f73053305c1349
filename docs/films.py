"""Draw the bodies of the gallery and the films of the front page: python docs/films.py [SCENE ...].

films.toml says, for each scene of inputs/, which variables make it short, and the words of dump
pyplot that suit it. The last state goes to docs/_static/gallery/SCENE.png, a film to
docs/_static/front/SCENE.gif. What the page tells (points, steps, seconds) goes to films.json.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

DOCS = Path(__file__).parent
INPUTS = DOCS.parent / "inputs"
TOLD = DOCS / "films.json"


def main(names: list[str]) -> None:
    """Draw the named scenes, or all."""
    scenes = tomllib.loads((DOCS / "films.toml").read_text(encoding="utf-8"))
    told = json.loads(TOLD.read_text(encoding="utf-8")) if TOLD.exists() else {}
    for name in names or scenes:
        told[name] = draw(name, scenes[name])
        text = json.dumps(dict(sorted(told.items())), indent=1) + "\n"
        TOLD.write_text(text, encoding="utf-8")
        print(name, told[name])


def draw(name: str, how: dict) -> dict:
    """Run a scene with pictures of its own; what there is to tell of the run."""
    text = (INPUTS / f"in.{name}").read_text(encoding="utf-8")
    width, height = how.get("size", [640, 480])
    drawn = f"film.png, {width}, {height}, fontsize=13, {how['look']}"  # read on a small card
    lines = [f"dump(own_picture, all, pyplot, 1000000000, {drawn})"]
    if "film" in how:
        small = f"{0.6 * width:.0f}, {0.6 * height:.0f}"
        lines.append(
            f"dump(own_film, all, movie, time({how['film']}), film.gif, {small}, {how['look']})"
        )
    run = list(re.finditer(r"^run\w*\(", text, re.M))[-1].start()
    last = how.get("run", text[run:])
    # The scene's own pictures are not needed; axes have units.
    before = re.sub(r"^dump\(.*\n", "", text[:run], flags=re.M)
    if not re.search(r"^units\(", before, re.M):
        before = "units(m, kg, s)\n" + before
    with tempfile.TemporaryDirectory() as folder:
        script = INPUTS / f".films.{name}"
        script.write_text(before + "\n".join(lines) + "\n" + last, encoding="utf-8")
        given = how.get("var", {}).items()
        words = [word for key, value in given for word in ("-var", key, str(value))]
        main = "import sys; from karamelo_py.app.cli import main; sys.exit(main())"
        command = [sys.executable, "-c", main, str(script), "-out", folder, "--threads", "1"]
        try:
            begun = time.perf_counter()
            done = subprocess.run([*command, *words], capture_output=True, text=True)
            seconds = time.perf_counter() - begun
        finally:
            script.unlink()
        if done.returncode:
            raise SystemExit(f"{name}: {done.stdout}{done.stderr}")
        for ending, place in (("png", "gallery"), ("gif", "front")):
            if (made := Path(folder) / f"film.{ending}").exists():
                target = DOCS / "_static" / place / f"{name}.{ending}"
                target.parent.mkdir(exist_ok=True)
                target.write_bytes(made.read_bytes())
    points = re.search(r"^ *points +(\d[\d\s]*)$", done.stdout, re.M)
    return {
        "points": int(re.sub(r"\D", "", points[1])) if points else None,
        "seconds": round(seconds, 1),
        "var": how.get("var", {}),
        "text": how["shows"],
        "tags": how.get("tags", []),
    }


if __name__ == "__main__":
    main(sys.argv[1:])
