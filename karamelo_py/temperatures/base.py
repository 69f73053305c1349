"""Base of the styles of temperature."""

from __future__ import annotations

from karamelo_py.part import Part


class Temperature(Part):
    """A temperature; `law` selects functions of `karamelo_py.points.materials.temperatures`."""

    script_kind = "the ID of a temperature"
    catalogue = "temperatures"
