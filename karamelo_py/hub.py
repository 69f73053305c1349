"""The hub (Karamelo's Pointers): what every command and style may see."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from karamelo_py.script.errors import Place, ScriptError, nearest, render_message
from karamelo_py.script.values import Values


class Catalogue(dict):
    """Named parts of a scene, in creation order; items keep their ``id`` and ``place``."""

    def __init__(self, kind: str, hub: Hub):
        super().__init__()
        self.kind = kind
        self.hub = hub

    def add(self, ID: str, item: Any, *, replace: bool = False) -> Any:
        """File `item` under `ID`; a second use of an ID is an error unless `replace`."""
        if ID in self and not replace:
            before = getattr(self[ID], "place", None)
            where = f" (line {before.line})" if before else ""
            raise ScriptError(f"{self.kind} ID '{ID}' is already used{where}", argument="ID")
        item.id = ID
        item.place = self.hub.place
        self[ID] = item
        return item

    def __missing__(self, ID: str) -> Any:
        known = ", ".join(self) or f"none: no {self.kind} is defined yet"
        close = nearest(ID, self)
        raise ScriptError(
            f"unknown {self.kind} '{ID}'",
            expected=f"one of {known}" if self else known,
            hint=f"did you mean '{close}'?" if close else None,
        )

    def remove(self, ID: str) -> None:
        """Forget `ID`; unknown is an error."""
        self[ID]
        del self[ID]


class Settings:
    """What the command line or the script chose about how to compute."""

    def __init__(self) -> None:
        self.threads: int | None = None
        self.precision = "double"
        self.debug = False
