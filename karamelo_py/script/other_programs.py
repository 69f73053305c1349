"""Look up words of other programs, above all of LAMMPS, and what says the same here."""

import tomllib
from functools import cache
from pathlib import Path
from typing import Any


@cache
def table() -> dict[str, Any]:
    """Read the table other_programs.toml; nothing needs it before something is wrong."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def of_karamelo(name: str) -> bool:
    """Tell if a name is that of a command of Karamelo, which no variable there can have."""
    return name in table()["karamelo"].split()


def instead(family: str, name: str) -> str | None:
    """Find what to write here for a command or style of another program; None for other words."""
    return table()["instead"].get(family, {}).get(name)
