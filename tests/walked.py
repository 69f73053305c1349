"""Syntax trees of the package, parsed once in a process.

Tests that read them are of the xdist_group "house", which runs in one.
"""

import ast
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "karamelo_py"
MODULES = sorted(PACKAGE.rglob("*.py"))


@cache
def walked(module: Path) -> list[ast.AST]:
    """All nodes of a module, the module itself first."""
    return list(ast.walk(ast.parse(module.read_text("utf-8"))))
