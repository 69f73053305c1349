"""Tools as stiff as a step allows, with friction."""

from karamelo_py.kernels.equations.internal_force import ContactLoss
from karamelo_py.kernels.tools import Press, PressStiffly
from karamelo_py.styles.fixes.grip import GripOfTool, Gripping
from karamelo_py.styles.fixes.tools.base import ShapedTool, ToolFix


class StiffTool(Gripping, ToolFix):
    by_sizes = True
    impulsive = True
    kind_of_grip = GripOfTool
    point_fields = (*ToolFix.point_fields, ContactLoss)


class StiffShape(StiffTool, ShapedTool):
    kind_of_press: type[Press] = PressStiffly

    def _press(self, row: int, values: tuple) -> Press:
        self.begin_to_touch()
        return super()._press(row, values)
