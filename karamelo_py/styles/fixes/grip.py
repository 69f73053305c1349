"""Memory of fixes for the points that friction holds: see `points.bodies.rub`."""

from karamelo_py.compiler.fields import Field
from karamelo_py.scene.hub import Hub


class Grip(Field):
    """Force of the spring that holds a point (d), its mean load, and friction that was not used."""

    shape = staticmethod(lambda kin: kin.dimension + 2)


class GripOfTool(Grip):
    """The same, and the place (d) where a tool has seen the point last."""

    shape = staticmethod(lambda kin: 2 * kin.dimension + 2)


def grip_for(hub: Hub, kind: type[Grip]) -> type[Grip]:
    """Return the class of a grip that no other fix of the scene has: a point may touch several."""
    taken = {kind for fix in hub.fixes.values() for kind in fix.point_fields}
    k = 1
    while globals().get(f"{kind.__name__}{k}") in taken:
        k += 1
    name = f"{kind.__name__}{k}"
    if name not in globals():  # where kernels, which are cached, find it
        globals()[name] = type(name, (kind,), {"__module__": __name__})
    return globals()[name]
