"""A solid whose points are put somewhere else than into cells."""

from typing import Annotated

import numpy as np

from karamelo_py.language.signature import Positive
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.material import Material
from karamelo_py.scene.placement import Placement
from karamelo_py.scene.solid import Solid


class Ring(Solid):
    """A ring of points in the plane, as squares one beside the other.

    Parameters
    ----------
    x, y, R
        Centre and radius.
    count
        Number of points.
    material
        What they are made of.
    h
        Cell size.

    Example
    -------
    solid(hoop, ring, 0.5, 0.5, 0.3, 40, steel, 0.1)
    """

    source = "R"  # what an error about the places of points marks

    def __init__(
        self, hub: Hub, x: float, y: float, R: Annotated[float, Positive],
        count: Annotated[int, Positive], material: Material, h: Annotated[float, Positive],
    ):  # fmt: skip
        super().__init__(hub, material, h, None)
        angle = 2 * np.pi * np.arange(count) / count
        places = np.column_stack([x + R * np.cos(angle), y + R * np.sin(angle)])
        inside = hub.domain.contains(places)
        half = np.full(2, np.pi * R / count)
        lo, hi = places.min(axis=0) - half, places.max(axis=0) + half
        outside = count - np.count_nonzero(inside)
        self.put(hub, Placement(places[inside], 4 * half.prod(), half, lo, hi, outside))

    def described(self) -> str:
        """Where the points come from, for errors and warnings."""
        return "ring"

    def wanted(self) -> str:
        """What would give points."""
        return "a ring within the domain"
