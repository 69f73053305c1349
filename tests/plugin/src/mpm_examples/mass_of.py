"""command mass_of."""

from karamelo_py.scene.hub import Hub
from karamelo_py.scene.solid import Solid


def mass_of(hub: Hub, solid: Solid) -> float:
    """Weigh a solid.

    Parameters
    ----------
    solid
        ID of the solid.

    Example
    -------
    m = mass_of(bar)
    """
    return float(solid.mass.sum())
