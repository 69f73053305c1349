"""The pages of messages have every message that the program makes."""

import re
import sys
from pathlib import Path

import pytest
import test_script_errors as wrong

from karamelo_py.language import registry, rules
from karamelo_py.script.errors import ScriptError

ROOT = Path(__file__).parent.parent
# They read the package once, in one process.
pytestmark = pytest.mark.xdist_group("messages")


@pytest.fixture(scope="module")
def messages():
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        import messages
    finally:
        sys.path.pop(0)
    return messages


def test_messages_of_wrong_scripts_are_on_a_page(messages, tmp_path):
    """Those of some 200 wrong scripts, each found by its own words."""
    scripts = [text for text, *_ in (*wrong.SYNTAX, *wrong.NAMES, *wrong.VALUES, *wrong.LAMMPS)]
    scripts += [wrong.SCENE + text for text, *_ in wrong.COMMANDS]
    said = set()
    for script in scripts:
        with pytest.raises(ScriptError) as caught:
            wrong.run(script, tmp_path)
        said |= {error.message for error in (caught.value, *caught.value.others)}
    assert len(said) > 100
    listed = messages.messages()
    missing = [one for one in said if not any(message.matches(one) for message in listed)]
    assert missing == []


def test_known_failures_are_on_a_page(messages):
    """Each rule of advice that a part of the program declares."""
    for family in registry.families():
        for name in registry.names(family):
            registry.find(family, name)
    own = [
        f"{name}: {reason}"
        for (kind, part), told in rules._rules.items()
        if kind == "failure" and part.__module__.startswith("karamelo_py.")
        for _, name, reason, _ in told
    ]
    assert len(own) > 20
    listed = {message.text for message in messages.messages()}
    assert {re.sub(r"\{[^{}]+\}", "…", text) for text in own} <= listed


def test_a_message_that_is_not_made_is_not_found(messages):
    said = "the moon is made of cheese"
    assert not any(message.matches(said) for message in messages.messages())


def test_pages_of_messages_are_written(messages, tmp_path):
    messages.write_pages(tmp_path / "generated", tmp_path / "messages.js")
    pages = {path.stem for path in (tmp_path / "generated").glob("*.md")}
    assert pages == {page for page, *_ in messages.PAGES}
    text = "".join(path.read_text("utf-8") for path in (tmp_path / "generated").glob("*.md"))
    count = len(messages.messages())
    assert text.count("\n## ") == count > 400
    index = (ROOT / "docs" / "messages" / "index.md").read_text("utf-8")
    assert pages == set(re.findall(r"^generated/([\w-]+)$", index, re.M))
    assert (tmp_path / "messages.js").read_text("utf-8").count("generated/") == count
