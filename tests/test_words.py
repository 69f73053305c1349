"""Words that an engineer would not use in pages and in the package: counts that may only fall.

A limit is the number that was there when it was written. Lower it with the text; code is left out.
"""

import ast
import re
from pathlib import Path

import pytest
from walked import MODULES, PACKAGE, walked

pytestmark = pytest.mark.xdist_group("house")
ROOT = Path(__file__).parent.parent
MADE = {"_build", "generated"}
PAGES = [path for path in sorted((ROOT / "docs").rglob("*.md")) if not MADE & {*path.parts}]
PAGES.append(ROOT / "README.md")
SCENES = sorted((ROOT / "inputs").rglob("in.*"))
CODE = re.compile(r"^ *```.*?^ *```|`[^`\n]+`|\]\([^)]*\)", re.S | re.M)

CODE_IN_TEXT = re.compile(r"``[^`]+``|`[^`\n]+`")

# The expression, what to write, and the limits: of pages, and of the package.
EXPRESSIONS = {
    r"in space(?! and time)": ("in 3D", 0, 0),
    r"in the plane(?! of)": ("in 2D", 0, 0),
    r"linear functions|these functions|functions whose gradients?": ("linear basis", 0, 0),
    r"in (?:the |their |its )?place of": ("instead of", 0, 0),
    r"beside": ("next to, with, versus", 0, 1),
    r"behind(?! (?:(?:a|the|that) )?(?:shock|wave|plane|edge|body|rubb|impen))": ("after", 0, 0),
    r"of (?:its|their|his|one's) own": ("separate, or nothing", 0, 0),
    r"(?:that|those) of": ("repeat the noun", 0, 0),
    r"shares?": ("fraction; FLIP coefficient", 0, 5),
    r"keeps?(?! [\d.]+ \|)": ("conserves, stores, retains", 0, 4),
    r"from nowhere": ("spurious energy gain", 0, 0),
    r"averaged volumes|volumes averaged": ("F-bar", 0, 0),
    r"swings?|whirls?": ("sloshes, oscillates; vortex", 0, 0),
    r"turns?(?! (?:inside|back))": ("rotates; revolution", 0, 8),
    r"nobody": ("is not tracked", 0, 0),
    r"bears?|borne": ("sustains", 0, 0),
    r"is (?:told|said)": ("is reported", 1, 0),
    r"so many": ("a number", 0, 0),
    r"stands?": ("is, appears", 0, 0),
    r"go(?:es)? on": ("continues", 0, 0),
    r"cures?|remed(?:y|ies)": ("fix", 0, 1),
    r"(?:and|or) the like": ("name the others", 0, 0),
    r"for good": ("permanently; dissipated", 0, 0),
    r"anew": ("again, from zero, empty", 0, 0),
    r"further ones": ("others, later ones", 0, 0),
    r"in company|fates?": ("outcome", 0, 0),
}


def prose(page):
    """The text of a page without code and targets of links; lines stay where they are."""
    return CODE.sub(lambda found: "\n" * found[0].count("\n"), page.read_text("utf-8"))


def sentences(module):
    """Docstrings, comments and messages of a module, with their lines; code in them is left out.

    A message is any string that has a space; a comment is what ``ruff format`` lets one be.
    """
    source = module.read_text("utf-8")
    found = [
        (node.lineno, CODE_IN_TEXT.sub("", node.value))
        for node in walked(module)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value
    ]
    comments = re.finditer(r"(?:^ *|  )# (.*)$", source, re.M)
    return found + [(source.count("\n", 0, hit.start()) + 1, hit[1]) for hit in comments]


@pytest.fixture(scope="module")
def texts():
    """Lists of (file, line, text): of pages, and of the package."""
    pages = [(page.relative_to(ROOT), 1, prose(page)) for page in PAGES]
    for scene in SCENES:
        heads = re.sub(r"^[^#\n]*", "", scene.read_text("utf-8"), flags=re.M)
        heads = re.sub(r"-var cure", "", CODE.sub("", heads))
        pages.append((scene.relative_to(ROOT), 1, heads))
    package = [
        (module.relative_to(ROOT), line, text)
        for module in MODULES
        for line, text in sentences(module)
    ]
    tables = [(table.relative_to(ROOT), 1, prose(table)) for table in PACKAGE.rglob("*.toml")]
    return pages, package + tables


@pytest.mark.parametrize("expression", EXPRESSIONS)
def test_expressions_only_fall(texts, expression):
    write, *limits = EXPRESSIONS[expression]
    pattern = re.compile(rf"\b(?:{expression})\b", re.I)
    for where, limit in zip(texts, limits, strict=True):
        hits = [
            f"{path}:{line + text.count(chr(10), 0, hit.start())}: {hit[0]}"
            for path, line, text in where
            for hit in pattern.finditer(text)
        ]
        report = "\n".join([f"write {write}: {len(hits)} of {limit} allowed", *hits])
        assert len(hits) <= limit, report


def test_code_is_left_out(tmp_path):
    page = tmp_path / "page.md"
    page.write_text("a share\n```text\nbeside\n```\n[see](x.md#in-space) `keeps`, so\n", "utf-8")
    assert prose(page) == "a share\n\n\n\n[see , so\n"


def test_sentences_of_a_module(tmp_path):
    module = tmp_path / "module.py"
    module.write_text('"""A ``share`` of it."""\nx = "beside"  # for good\n', "utf-8")
    assert sentences(module) == [(1, "A  of it."), (2, "for good")]
