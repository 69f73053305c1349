"""Rule on functions that reach over more cells than a grid asks for that no point moves through."""

from typing import Any

from karamelo_py.language.rules import saving


def wide(basis: type) -> None:
    """Let functions of four nodes a direction be judged where no point crosses cells."""
    saving(
        basis,
        when=_seen,
        cost="{scene.basis_name} sees {nodes} nodes a point; in a total Lagrangian method no point "
        "crosses cells, and linear functions, which see {scene.corners}, are of the same order",
        instead="linear in method(...); karamelo-py sweep shows the errors of both",
    )


def _seen(basis: Any, scene: Any) -> dict[str, int] | None:
    return None if scene.moves else {"nodes": (basis.cells + 1) ** scene.d}
