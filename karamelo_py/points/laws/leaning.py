"""Warning about directions of a law that are inclined to the plane or line of a scene."""

from collections.abc import Callable
from typing import Any

from karamelo_py.language.rules import known_failure
from karamelo_py.points.laws import law_parts

LEANING: dict[type, Callable[[Any, Any], bool]] = {}  # rules by kind of law


def warn_of_leaning(
    kind: type, of: str, when: Callable[[Any, Any], bool], cure: str, title: str = "directions"
) -> None:
    """Warn if a law of `kind` would shear out of the plane: if ``when(law, scene)`` is True."""
    LEANING[kind] = when
    known_failure(
        kind,
        f"{title} out of the plane",
        when=when,
        reason=f"the {of} of material '{{owner.id}}' are inclined: the body would shear out of its "
        "plane, which {scene.d}D prevents",
        cure=cure,
    )


def leans(law: Any, scene: Any) -> bool:
    """Return True if bodies of `law` would shear out of the plane or line of a `scene`."""
    return any(
        when(part, scene)
        for part in law_parts(law)
        for kind, when in LEANING.items()
        if isinstance(part, kind)
    )
