"""Base of the styles of strength."""

from __future__ import annotations

from karamelo_py.scene.part import Part


class Strength(Part):
    """A strength: `law` selects functions of :mod:`karamelo_py.points.laws.strength`."""

    script_kind = "the ID of a strength"
    catalogue = "strengths"
