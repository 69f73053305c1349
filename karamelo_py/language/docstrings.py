"""Docstrings in NumPy's form: their head, sections, and descriptions of parameters."""

import inspect
import re


def sections(doc: str) -> tuple[str, dict[str, str]]:
    """Split a docstring into its head, and sections by title."""
    pieces = re.split(r"^([A-Z][A-Za-z ]+)\n-{3,}$", inspect.cleandoc(doc), flags=re.MULTILINE)
    titles = [title.replace("Examples", "Example") for title in pieces[1::2]]
    texts = (text.strip("\n") for text in pieces[2::2])
    return pieces[0].strip(), dict(zip(titles, texts, strict=True))


def descriptions(section: str) -> dict[str, str]:
    """Read descriptions by name, from a section in NumPy's form."""
    found: dict[str, str] = {}
    for block in re.split(r"\n(?=\S)", section):
        head, _, text = block.partition("\n")
        for name in filter(str.strip, head.partition(":")[0].split(",")):
            found[name.strip().lstrip("*")] = inspect.cleandoc(text)
    return found
