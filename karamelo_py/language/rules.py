"""Restrictions, known failures, needless costs, causes of energy gain.

A fix, a scheme (in its traits) or a fluid has `Restrictions`. Rules are declared next to the type
of a part, field or law::

    known_failure(
        PIC,
        "angular momentum",
        when=lambda pic, scene: scene.turns,
        reason="PIC removes 1 % or more of the angular momentum of a rotating body",
        cure="APIC or FLIP instead of PIC",
    )

`when` gets the part and the facts of the scene (:class:`karamelo_py.advice.facts.SceneFacts`).
`when` returns True if the rule applies; or numbers by name for its text; or a list of such numbers,
one item per message. Texts can contain these numbers and attributes of ``part``, ``scene`` and
``owner`` (the material of a law) in braces, such as ``{scene.turn:.2g}``. Two names have a meaning:
``mark`` is the location in the script, and ``share`` is the noise divided by the tolerable amount.
"""

import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from math import inf
from typing import Any, NamedTuple

from karamelo_py.script.errors import Mark, ScriptError

When = Callable[[Any, Any], Any]


AS_WRITTEN = {"method": "method({}, ...)", "scheme": "scheme({})"}
FLAT = "1D", "plane-strain", "3D"  # kinematics
HATS_AND_SPLINES = "linear", "quadratic-spline", "cubic-spline"


class Feature(NamedTuple):
    """A feature of a scene, such as its basis, by `name`; the `name` of an option is empty."""

    kind: str
    name: str
    words: str  # text for messages
    instead: str = ""  # replacement of the option
    mark: Mark | None = None


class Restrictions(NamedTuple):
    """Restrictions of a capability. Features that are not mentioned are supported.

    Parameters
    ----------
    option
        Name of the capability in the restrictions of other capabilities.
    instead
        Replacement of the capability, for messages.
    only
        Supported names, by kind of choice (method, basis, transfer, scheme, kinematics).
    without, but
        Unsupported options; `but` replaces the ``instead`` of some options.
    """

    option: str
    instead: str
    only: Mapping[str, Collection[str]] = {}
    without: Collection[str] = ()
    but: Mapping[str, str] = {}

    def exclude(self, feature: Feature) -> bool:
        if feature.name:
            return feature.name not in self.only.get(feature.kind, (feature.name,))
        return feature.kind in self.without or feature.kind in self.but

    def instead_of(self, feature: Feature) -> str:
        kind = feature.kind
        names = [AS_WRITTEN.get(kind, "{}").format(name) for name in self.only.get(kind, ())]
        instead = ", ".join(names[:-1]) + " or " * (len(names) > 1) + "".join(names[-1:])
        return self.but.get(kind) or instead or feature.instead


class Conflict(NamedTuple):
    subject: Feature
    restrictions: Restrictions
    feature: Feature

    @property
    def mark(self) -> Mark | None:
        return self.feature.mark or self.subject.mark

    @property
    def mistake(self) -> tuple:
        """A wrong option conflicts with several parts, and a part with several words of a line."""
        feature, mark = self.feature, self.mark
        return (self.subject.words, mark and mark.line) if feature.name else (feature.words,)


def compare(declared: Mapping[Feature, Restrictions], features: Iterable[Feature]) -> None:
    conflicts: dict[frozenset[str], Conflict] = {}
    features = [*features, *declared]
    excluded: set[str] = set()
    for subject, restrictions in declared.items():
        if subject.words in excluded:
            continue
        for feature in filter(restrictions.exclude, features):
            pair = frozenset((subject.words, feature.words))
            conflicts.setdefault(pair, Conflict(subject, restrictions, feature))
            excluded.add(feature.words)
    mistakes: dict[tuple, list[Conflict]] = {}
    for conflict in conflicts.values():
        mistakes.setdefault(conflict.mistake, []).append(conflict)
    errors = [_error(mistake) for mistake in mistakes.values()]
    for error in errors:
        error.others = errors[1:]
        raise error


def _error(mistake: list[Conflict]) -> ScriptError:
    subjects = dict.fromkeys(conflict.subject.words for conflict in mistake)
    features = dict.fromkeys(conflict.feature.words for conflict in mistake)
    words = mistake if mistake[0].feature.name else mistake[:1]
    instead = dict.fromkeys(one.restrictions.instead_of(one.feature) for one in words)
    verb = "do" if len(subjects) > 1 else "does"
    message = f"{' and '.join(subjects)} {verb} not support {' and '.join(features)}"
    return ScriptError(message, mark=mistake[0].mark, expected=", and ".join(instead))


class Advice(NamedTuple):
    name: str
    reason: str
    cure: str
    share: float = inf
    mark: Any = None

    @property
    def code(self) -> str:
        return code_of(self.name)


def code_of(name: str) -> str:
    """Return the code of a name: shocks-of-material for ``shocks of material 'm'``."""
    words = re.sub(r"'[^']*'( and '[^']*')*", "", name)
    return "-".join(re.findall(r"\w+", words.lower()))


_rules: dict[tuple[str, type], list[tuple[When, str, str, str]]] = {}


def known_failure(
    part: type, name: str, *, when: When, reason: str, cure: str, cause: str = ""
) -> None:
    """Declare a known failure, which is reported at most once, by its name.

    A failure with a `cause` is a source of noise: it is reported if its ``share`` exceeds 1, or as
    the cause of an energy gain.
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
    _rules.setdefault(("suggestion", part), []).append((when, "", cost, instead))


def gain(part: type, *, when: When, cause: str, cure: str) -> None:
    _rules.setdefault(("gain", part), []).append((when, "", cause, cure))


def advice(kind: str, part: Any, owner: Any, scene: Any) -> Iterator[Advice]:
    for one in (part if isinstance(part, type) else type(part)).__mro__:
        for when, *words in _rules.get((kind, one), ()):
            result = when(part, scene)
            for case in result if isinstance(result, list) else [result] if result else []:
                numbers = case if isinstance(case, dict) else {}
                share = numbers.get("share", inf)
                if kind != "failure" or share > 1:
                    names = {"part": part, "owner": owner, "scene": scene, **numbers}
                    mark = numbers.get("mark", getattr(owner or part, "mark", None))
                    name, reason, cure = (text.format(**names) for text in words)
                    yield Advice(name, reason, cure, share, mark)
