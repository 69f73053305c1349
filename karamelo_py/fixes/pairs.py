"""What fixes between two solids share."""

from __future__ import annotations

from karamelo_py.script.errors import ScriptError
from karamelo_py.solid import Solid


def check_pair(solid1: Solid, solid2: Solid) -> None:
    """Refuse a pair that is one solid twice."""
    if solid1 is solid2:
        raise ScriptError(
            f"'{solid2.id}' is named twice",
            argument="solid2",
            expected="another solid than the first",
        )
