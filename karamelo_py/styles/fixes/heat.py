"""Base of fixes that act on heat."""

from typing import Any

from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.script.errors import ScriptError


class HeatFix(Fix):
    """A fix with meaning only where heat flows."""

    published = ("s",)

    def __init__(self, hub: Hub, group: Any, *formulas: Any):
        super().__init__(hub, group)
        if not hub.update.thermal:
            raise ScriptError(
                "the method is mechanical: no heat flows",
                expected="method(..., thermo-mechanical)",
            )
        self.formulas = formulas
