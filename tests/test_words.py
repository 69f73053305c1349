"""Words that an engineer would not use in README and docs: counts that may only fall.

A limit is the number that was there when it was written. Lower it with the text; code is left out.
"""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PAGES += [*sorted((ROOT / "docs" / "howto").glob("*.md"))]
PAGES += [*sorted((ROOT / "docs" / "house").glob("*.md"))]
CODE = re.compile(r"^ *```.*?^ *```|`[^`\n]+`|\]\([^)]*\)", re.S | re.M)

# The expression, what to write, and the limit.
EXPRESSIONS = {
    r"in space(?! and time)": ("in 3D", 0),
    r"in the plane(?! of)": ("in 2D", 0),
    r"linear functions|these functions|functions whose gradients?": ("linear basis", 19),
    r"in (?:the |their |its )?place of": ("instead of", 0),
    r"beside": ("next to, with, versus", 18),
    r"behind(?! (?:(?:a|the|that) )?(?:shock|wave|plane|edge|body|rubb|impen))": ("after", 2),
    r"of (?:its|their|his|one's) own": ("separate, or nothing", 0),
    r"(?:that|those) of": ("repeat the noun", 8),
    r"shares?": ("fraction; FLIP coefficient", 12),
    r"keeps?(?! [\d.]+ \|)": ("conserves, stores, retains", 2),
    r"from nowhere": ("spurious energy gain", 2),
    r"averaged volumes|volumes averaged": ("F-bar", 6),
    r"swings?|whirls?": ("sloshes, oscillates; vortex", 6),
    r"turns?(?! (?:inside|back))": ("rotates; revolution", 15),
    r"nobody": ("is not tracked", 1),
    r"bears?|borne": ("sustains", 5),
    r"is (?:told|said)": ("is reported", 3),
    r"so many": ("a number", 0),
    r"stands?": ("is, appears", 3),
    r"go(?:es)? on": ("continues", 3),
    r"cures?|remed(?:y|ies)": ("fix", 0),
}


def prose(page):
    """The text of a page without code and targets of links; lines stay where they are."""
    return CODE.sub(lambda found: "\n" * found[0].count("\n"), page.read_text("utf-8"))


@pytest.fixture(scope="module")
def texts():
    return {page.relative_to(ROOT): prose(page) for page in PAGES}


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_expressions_only_fall(texts, expression):
    write, limit = EXPRESSIONS[expression]
    found = [
        f"{page}:{text.count(chr(10), 0, hit.start()) + 1}: {hit[0]}"
        for page, text in texts.items()
        for hit in re.finditer(rf"\b(?:{expression})\b", text, re.I)
    ]
    told = "\n".join([f"write {write}: {len(found)} of {limit} allowed", *found])
    assert len(found) <= limit, told


def test_code_is_left_out(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("a share\n```text\nbeside\n```\n[see](x.md#in-space) `keeps`, so\n", "utf-8")
    assert prose(page) == "a share\n\n\n\n[see , so\n"
