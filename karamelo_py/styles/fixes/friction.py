"""Checks of fixes with Coulomb friction."""

from karamelo_py.scene.hub import Hub

# Rubber on dry concrete has 1, clean metals that weld 1.5.
USUAL = 2.0


def judge_friction(hub: Hub, mu: float) -> None:
    """Tell of a coefficient that no pair of materials has."""
    if mu > USUAL:
        hub.warn(
            f"the coefficient of friction is {mu:g}: measured ones stay below 1.5",
            hint=f"a share of the pressing force: {mu / 100:g} is {mu:g} %" if mu >= 5 else None,
        )
