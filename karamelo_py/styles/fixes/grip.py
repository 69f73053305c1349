"""Memory of fixes for the points held by friction: see `points.bodies.rub`."""

from karamelo_py.compiler.fields import Field, field
from karamelo_py.compiler.trace import one_at_a_time
from karamelo_py.scene.hub import Hub


class Grip(Field):
    """Spring force that holds a point (d), its mean load, and its unused friction."""

    shape = staticmethod(lambda kin: kin.dimension + 2)


class GripOfTool(Grip):
    """As `Grip`, with the last position (d) of the point at the tool."""

    shape = staticmethod(lambda kin: 2 * kin.dimension + 2)


def clear_grips(hub: Hub, grip: type[Grip]) -> None:
    """Let all points go: the grips of a file belong to an earlier fix."""
    for block in hub.simulation.setup.blocks:
        if (held := field(block.points.fields, grip)) is not None:
            held[:] = 0


def grip_for(hub: Hub, kind: type[Grip]) -> type[Grip]:
    """Return a grip class that no other fix of the scene uses: a point may touch several."""
    taken = {kind for fix in hub.fixes.values() for kind in fix.point_fields}
    k = 1
    while globals().get(f"{kind.__name__}{k}") in taken:
        k += 1
    name = f"{kind.__name__}{k}"
    with one_at_a_time:
        if name not in globals():  # for cached kernels to find it
            globals()[name] = type(name, (kind,), {"__module__": __name__})
        return globals()[name]
