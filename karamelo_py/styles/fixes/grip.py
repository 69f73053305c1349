"""State of friction at points, see `points.bodies.rub`."""

from typing import Any

from karamelo_py.compiler import importable
from karamelo_py.compiler.fields import Field, field
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.styles.fixes.formulas import judge_friction


class Grip(Field):
    """Columns of a friction state: spring force (d), mean load, unused friction."""

    shape = staticmethod(lambda kin: kin.dimension + 2)


class GripOfTool(Grip):
    """`Grip`, followed by the last position (d) at the tool."""

    shape = staticmethod(lambda kin: 2 * kin.dimension + 2)

    @staticmethod
    def position(kin: Any) -> int | None:
        return kin.dimension + 2


def memory_for(hub: Hub, kind: type) -> type:
    """Return a subclass of `kind` that no other fix uses."""
    taken = {kind for fix in hub.fixes.values() for kind in fix.point_fields}
    k = 1
    while globals().get(f"{kind.__name__}{k}") in taken:
        k += 1
    name = f"{kind.__name__}{k}"
    return importable(__name__, name, lambda: type(name, (kind,), {"__module__": __name__}))


class Gripping(Fix):
    remembers = ("has_touched",)
    has_touched = False  # False: grips in a restart file belong to an earlier fix
    kind_of_grip: type[Grip] = Grip
    grip: type[Grip] | None = None
    memories: tuple[type, ...] = ()  # fields that only this fix uses
    mu = 0.0

    def rubs(self, hub: Hub, mu: float) -> None:
        judge_friction(hub, mu)
        self.mu = mu
        if mu > 0:
            self.grip = memory_for(hub, self.kind_of_grip)
            self.remember(self.grip)

    def remember(self, kind: type) -> None:
        self.memories = (*self.memories, kind)
        self.point_fields = (*self.point_fields, kind)

    def begin_to_touch(self) -> None:
        for kind in () if self.has_touched else self.memories:
            for block in self.hub.simulation.setup.blocks:
                if (memory := field(block.points.fields, kind)) is not None:
                    memory[:] = 0
        self.has_touched = True
