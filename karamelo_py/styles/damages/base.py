"""Base of the styles of damage."""

from __future__ import annotations

from karamelo_py.scene.part import Part


class Damage(Part):
    """A damage: `law` selects functions of :mod:`karamelo_py.points.laws.damages`."""

    script_kind = "the ID of a damage"
    catalogue = "damages"
