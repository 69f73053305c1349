"""Rules that parts of a scene declare: known failures, needless costs, causes of energy gain.

A part is a basis, transfer, scheme, method, field, law or part of a law, or a fix. Rules are
declared next to it, also in plug-ins::

    known_failure(
        PIC, "angular momentum", when=lambda pic, scene: scene.turns, reason="PIC removes 1 % or
        more of the angular momentum of a rotating body", cure="APIC or FLIP instead of PIC",
    )

`when` gets the part and the facts of the scene (:class:`karamelo_py.advice.facts.SceneFacts`). It
returns whether the rule applies, or the numbers for its words by name, or a list of these, one per
message. Braces in words take these numbers and attributes of ``part``, ``scene`` and ``owner`` (of
a law or its parts, the material), such as ``{scene.turn:.2g}``. Two names are special: ``place``,
the marked place in the script (default: of the fix, material or method), and ``share``, the size of
noise over the tolerable amount.
"""

import re
from collections.abc import Callable, Iterator
from math import inf
from typing import Any, NamedTuple

When = Callable[[Any, Any], Any]


class Advice(NamedTuple):
    name: str
    reason: str
    cure: str
    share: float = inf
    place: Any = None

    @property
    def code(self) -> str:
        """The name in kebab case, without names of the script."""
        return code_of(self.name)


def code_of(name: str) -> str:
    """``shocks of material 'm'`` is shocks-of-material."""
    words = re.sub(r"'[^']*'( and '[^']*')*", "", name)
    return "-".join(re.findall(r"\w+", words.lower()))


_rules: dict[tuple[str, type], list[tuple[When, str, str, str]]] = {}


def known_failure(
    part: type, name: str, *, when: When, reason: str, cure: str, cause: str = ""
) -> None:
    """Declare a known failure, reported once by its name.

    With a `cause`, it is noise: reported if its ``share`` exceeds 1, and as the cause of a gain.
    """
    _rules.setdefault(("failure", part), []).append((when, name, reason, cure))
    if cause:
        gain(part, when=when, cause=cause, cure=cure)


def known_failures() -> Iterator[tuple[type, str, str, str]]:
    for (kind, part), some in _rules.items():
        for _, *words in some if kind == "failure" else ():
            name, reason, cure = (re.sub(r"\{[^{}]+\}", "…", text) for text in words)
            yield part, name, reason, cure


def suggestion(part: type, *, when: When, cost: str, instead: str) -> None:
    """Declare a needless cost, for `check`."""
    _rules.setdefault(("suggestion", part), []).append((when, "", cost, instead))


def gain(part: type, *, when: When, cause: str, cure: str) -> None:
    """Declare a likely cause of a spurious energy gain, with its fix."""
    _rules.setdefault(("gain", part), []).append((when, "", cause, cure))


def advice(kind: str, part: Any, owner: Any, scene: Any) -> Iterator[Advice]:
    """About a part (or a field, which is a class)."""
    for one in (part if isinstance(part, type) else type(part)).__mro__:
        for when, *words in _rules.get((kind, one), ()):
            result = when(part, scene)
            for case in result if isinstance(result, list) else [result] if result else []:
                numbers = case if isinstance(case, dict) else {}
                share = numbers.get("share", inf)
                if kind != "failure" or share > 1:
                    names = {"part": part, "owner": owner, "scene": scene, **numbers}
                    place = numbers.get("place", getattr(owner or part, "place", None))
                    name, reason, cure = (text.format(**names) for text in words)
                    yield Advice(name, reason, cure, share, place)
