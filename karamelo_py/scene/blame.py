"""Which part of a scene an exception comes from, where a plug-in brought that part."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from karamelo_py.compiler.trace import Undefined, places_of
from karamelo_py.language import registry
from karamelo_py.language.faults import KNOWN, TRACEBACK, cause_of, fault
from karamelo_py.language.scene import Scene
from karamelo_py.points.laws import law_kind
from karamelo_py.script.errors import FAILURES


class Part(NamedTuple):
    """A style in use: family and name, its class, and where the script asks for it."""

    name: str
    kind: type
    place: Any


def is_foreign(kind: type) -> bool:
    """Whether a class does not come with the program."""
    return not kind.__module__.startswith(registry.PREFIX)


def foreign_parts(hub: Scene) -> Iterator[Part]:
    """The parts of a scene that plug-ins brought."""
    return (part for part in _parts(hub) if is_foreign(part.kind))


def _parts(hub: Scene) -> Iterator[Part]:
    for family, named in (("fix", hub.fixes), ("compute", hub.computes), ("dump", hub.dumps)):
        for item in named.values():
            yield Part(f"{family} {item.style}", type(item), item.place)
    laws = [part for named in (hub.materials, *hub.parts.values()) for part in named.values()]
    for part in laws:
        yield Part(f"{part.kind} {part.style}", type(part.law), part.place)
    update, method = hub.update, hub.update.method
    if method is not None:
        tags = {"transfer": update.transfer, "basis": method.basis, "method": method}
        for family, tag in tags.items():
            name = registry.name_of(family, type(tag))
            yield Part(f"{family} {name}", type(tag), method.place)
    name = registry.name_of("scheme", type(update.scheme))
    yield Part(f"scheme {name}", type(update.scheme), update.scheme_place)


def part_of_law(hub: Scene, material: Any) -> Part:
    """The part of a material's law that a plug-in brought, or the material itself."""
    kinds = law_kind(material.law)
    own = [part for part in foreign_parts(hub) if part.kind in kinds]
    return own[0] if own else Part(f"material {material.style}", kinds[0], material.place)


@contextmanager
def blamed(hub: Scene, usual: Part | None = None) -> Iterator[None]:
    """Turn an exception in the code of a plug-in into an error of the script that names it.

    Parameters
    ----------
    hub
        The scene.
    usual
        The part at fault where the exception does not show one.
    """
    try:
        yield
    except KNOWN:
        raise
    except FAILURES as error:
        if isinstance(error, Undefined):
            own = [part for part in foreign_parts(hub) if part.kind in error.classes]
            places = [(part, "") for part in own]
        else:
            found = ((_owner(hub, f), f" ({Path(f).name}:{k})") for f, k in places_of(error))
            places = [(part, place) for part, place in found if part is not None]
        places += [(usual, "")] if usual else []
        if not places:
            raise
        part, place = places[0]
        raise fault(part.name, f"{cause_of(error)}{place}", part.place, TRACEBACK) from error


def _owner(hub: Scene, file: str) -> Part | None:
    """The part whose file it is, or else one of whose package it is."""
    path = Path(file).resolve()
    parts = [(part, sys.modules.get(part.kind.__module__)) for part in foreign_parts(hub)]
    for part, module in parts:
        own = getattr(module, "__file__", None)
        if own and Path(own).resolve() == path:
            return part
    for part, _ in parts:
        package = sys.modules.get(part.kind.__module__.partition(".")[0])
        folders = getattr(package, "__path__", ())
        if any(path.is_relative_to(Path(folder).resolve()) for folder in folders):
            return part
    return None
