"""Base of the styles of temperature."""

from __future__ import annotations

from karamelo_py.scene.part import Part


class Temperature(Part):
    """A temperature; `law` selects functions of `karamelo_py.points.laws.temperatures`."""

    script_kind = "the ID of a temperature"
    catalogue = "temperatures"
