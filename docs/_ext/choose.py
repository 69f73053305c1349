"""The form of "Choose a method": its questions and lines are those of the table of the page."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any


def choices(page: Path) -> dict[str, Any]:
    """Read the questions with their answers, and rows of answers with the lines to write."""
    head = page.read_text(encoding="utf-8").partition("## Why")[0]
    questions = []
    for text in re.findall(r"^\d\. (.*?)(?=^\d\. |\n\n)", head, re.S | re.M):
        asked, said = re.match(r"\*\*(.*?)\*\*(.*)", " ".join(text.split())).groups()
        questions.append({"text": asked, "answers": re.findall(r"`(\w+)`: (.*?)\.(?= `|$)", said)})
    rows = [
        {"answers": [cell.split(", ") for cell in cells], "lines": re.findall("`(.+?)`", line)}
        for *cells, line in re.findall(r"^\| ([a-z, ]+) \| (\w+) \| (\w+) \| (`.+) \|$", head, re.M)
    ]
    return {"questions": questions, "rows": rows}


def write_choices(page: Path, file: Path) -> None:
    """Write the table for the form."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f"const CHOICES = {json.dumps(choices(page))};\n", encoding="utf-8")


def setup(app):
    """Write the table before the sources are read."""

    def write(app) -> None:
        docs = Path(app.srcdir)
        write_choices(docs / "choose.md", docs / "_static" / "generated" / "choose.js")

    app.connect("builder-inited", write)
    return {"parallel_read_safe": True}
