"""The page of messages: what their codes mean, and the failures that are known of each part.

It is written from the data that the program itself uses, to docs/messages/generated, before Sphinx
reads its sources.
"""

from __future__ import annotations

from itertools import groupby
from pathlib import Path

from reference_pages import escaped

from karamelo_py.language import registry, rules
from karamelo_py.script.errors import codes

HEAD = "---\ntocdepth: 1\n---\n\n"


def of_codes(title: str, about: str, *, script: bool) -> str:
    """Write the page of the codes of runs, or of scripts."""
    parts = [f"# {title}", about]
    for code, words in codes().items():
        if bool(words.get("script")) == script:
            parts += [f"({code})=", f"## {code}", f"**{escaped(words['title'])}**"]
            parts.append(escaped(" ".join(words["text"].split())))
    return HEAD + "\n\n".join(parts) + "\n"


def of_known_failures() -> str:
    """Write the page of known failures, by the code of their warnings."""
    for family in registry.families():
        for name in registry.names(family):
            registry.find(family, name)
    own = {
        (rules.code_of(name), name, reason, cure)
        for part, name, reason, cure in rules.known_failures()
        if part.__module__.startswith("karamelo_py.")
    }
    parts = [
        "# Known failures",
        "Warnings before the first step: a combination that is known to fail in scenes of this "
        "kind. An ellipsis (…) stands for a number or a name of your script.",
    ]
    for code, some in groupby(sorted(own), key=lambda one: one[0]):
        parts += [f"({code})=", f"## {code}"]
        for _, name, reason, cure in some:
            parts += [escaped(f"{name}: {reason}"), f"Fix: {escaped(cure)}"]
    return HEAD + "\n\n".join(parts) + "\n"


def write_pages(folder: Path) -> None:
    """Write all pages of messages to `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "run": of_codes("Messages of a run", "Errors that stop a run, and warnings.", script=False),
        "script": of_codes("Mistakes in a script", "Found before the first step.", script=True),
        "known-failures": of_known_failures(),
    }
    for old in folder.glob("*.md"):
        old.unlink()
    for name, text in pages.items():
        (folder / f"{name}.md").write_text(text, encoding="utf-8")


def setup(app):
    """Write the pages before the sources are read."""
    folder = Path(app.srcdir) / "messages" / "generated"
    app.connect("builder-inited", lambda app: write_pages(folder))
    return {"parallel_read_safe": True}
