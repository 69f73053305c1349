"""The scene, as seen by lower layers."""

from pathlib import Path
from typing import Any, Protocol


class Scene(Protocol):
    """The hub (:mod:`karamelo_py.scene.hub`), as lower layers know it."""

    console: Any
    settings: Any
    folder: Path
    mark: Any
    rehearsing: bool
    checking: bool
    interpreter: Any
    domain: Any
    announced_dimension: int | None
    regions: Any
    materials: Any
    parts: Any
    solids: Any
    groups: Any
    fixes: Any
    computes: Any
    dumps: Any
    values: Any
    functions: dict[str, Any]
    asked: set[str]
    update: Any
    output: Any
    fields: Any
    waiting: Any

    @property
    def simulation(self) -> Any:
        """The arrays of the present scene, with its steps."""

    @property
    def lattices(self) -> list:
        """The grids of the domain or the method."""

    def require_domain(self) -> Any:
        """Return the domain; raise ScriptError without one."""

    def refresh_values(self) -> None:
        """Let computes and fixes measure the present state."""

    def warn(
        self, message: str, mark: Any = None, hint: str | None = None, expected: str | None = None
    ) -> None:
        """Print a warning about the place `mark`, with a hint and the correct form."""

    def rehearse(self) -> None:
        """Execute the rest of the script once without effects, to find mistakes."""
