"""Studies: many runs of one script, and what they show together.

They use what every user has: the script, its variables, the command line, and the log it writes.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

NAMES = ("sweep", "chart", "advise", "stability")


def add_parsers(subparsers: Any) -> None:
    """Give the command line its subcommands for studies."""
    for name in NAMES:
        import_module(f"karamelo_py.app.studies.{name}").add_parser(subparsers)
