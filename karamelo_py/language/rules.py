"""Rules: what a part of a scene knows of itself, told before a run, by `check`, or of a gain.

A part is a basis, a transfer, a scheme, a method, a field, a law or one of its parts, a fix. Its
rules are declared beside it, those of plug-ins as well::

    known_failure(
        PIC,
        "angular momentum",
        when=lambda pic, scene: scene.turns,
        reason="PIC takes a per cent or more of the angular momentum of a turning body",
        cure="APIC, or FLIP, in the place of PIC",
    )

`when` gets the part and the facts of the scene (:class:`karamelo_py.run.advice.facts.SceneFacts`).
It returns whether the rule speaks, or the numbers for its words, by name, or a list of these, one
for each time that it speaks. Between braces words have these numbers and what ``part``, ``scene``
and ``owner`` have, such as ``{scene.turn:.2g}``; the owner of a law, or of one of its parts, is the
material. Two names mean more: ``place``, the place in the script that is marked (else that of the
fix, the material or the method), and ``share``, of noise how much it takes of what a body bears.
"""

from collections.abc import Callable, Iterator
from math import inf
from typing import Any, NamedTuple


class Rule(NamedTuple):
    """Warn of, save or explain something, where a part of this class is used so.

    Attributes
    ----------
    kind
        ``failure``, ``saving`` or ``gain``.
    name
        Of a failure, which is told once in a script.
    when
        Whether it speaks, and the numbers in its words.
    reason, cure
        Words for what is wrong, or costs, or feeds energy; and for what to write instead.
    """

    kind: str
    name: str
    when: Callable[[Any, Any], Any]
    reason: str
    cure: str


class Advice(NamedTuple):
    """Tell what a rule says of a scene.

    Attributes
    ----------
    share
        Of noise, which feeds energy the sooner the larger it is: how much it takes of what a body
        bears. What fails or feeds for sure has an infinite one.
    place
        Where the script asks for the part, if the part knows.
    """

    name: str
    reason: str
    cure: str
    share: float = inf
    place: Any = None


_rules: dict[type, list[Rule]] = {}


def known_failure(
    part: type, name: str, *, when: Callable[[Any, Any], Any], reason: str, cure: str
) -> None:
    """Declare what is known to go wrong with a part, told before a run."""
    _rules.setdefault(part, []).append(Rule("failure", name, when, reason, cure))


def saving(part: type, *, when: Callable[[Any, Any], Any], cost: str, instead: str) -> None:
    """Declare what a part costs without need, told by `check`."""
    _rules.setdefault(part, []).append(Rule("saving", "", when, cost, instead))


def gain(part: type, *, when: Callable[[Any, Any], Any], cause: str, cure: str) -> None:
    """Declare how a part feeds energy, told where energy comes from nowhere."""
    _rules.setdefault(part, []).append(Rule("gain", "", when, cause, cure))


def advice(kind: str, part: Any, owner: Any, scene: Any) -> Iterator[Advice]:
    """Tell what the rules of one kind say of a part (or of a field, which is a class)."""
    for one in (part if isinstance(part, type) else type(part)).__mro__:
        for rule in _rules.get(one, ()):
            if rule.kind == kind:
                yield from _said(rule, part, owner, scene)


def _said(rule: Rule, part: Any, owner: Any, scene: Any) -> Iterator[Advice]:
    found = rule.when(part, scene)
    if not found:
        return
    for one in found if isinstance(found, list) else [found]:
        numbers = one if isinstance(one, dict) else {}
        named = {"part": part, "owner": owner, "scene": scene, **numbers}
        words = (text.format(**named) for text in (rule.name, rule.reason, rule.cure))
        place = numbers.get("place", getattr(owner or part, "place", None))
        yield Advice(*words, numbers.get("share", inf), place)
