"""Columns that are asked for by name: what may have been meant by one that is not there."""

import re
from collections.abc import Iterable, Sequence
from typing import Any

from karamelo_py.script.errors import ScriptError, unknown

# Columns, and other words for what they are together.
_QUANTITIES = {
    "s11 s22 s33 s12 s13 s23 seq": ("stress", "sigma", "sig", "p", "pressure"),
    "seq": ("mises", "vonmises", "von_mises", "svm"),
    "e11 e22 e33 e12 e13 e23": ("strain", "eps", "epsilon"),
    "x y z": ("pos", "position", "positions", "coord", "coordinates"),
    "vx vy vz": ("vel", "velocity", "v"),
    "fx fy fz": ("force", "forces", "f"),
    "x y z x0 y0 z0": ("u", "disp", "displacement"),
    "T": ("temp", "temperature"),
}


def check_columns(columns: Sequence[str], known: Sequence[str], *, first: int) -> None:
    """Refuse names that are not `known`; `first` is the place of the first among the arguments."""
    for index, name in enumerate(columns):
        if name not in known:
            raise unknown_column(f"unknown column '{name}'", name, known, argument=first + index)


def unknown_column(message: str, name: str, known: Iterable[str], **where: Any) -> ScriptError:
    """Make the error for a column that is none of the `known`; `where` it stands."""
    known = list(known)
    error = unknown(message, name, known, **where)
    quantity = next((q for q, words in _QUANTITIES.items() if name.lower() in words), "")
    if there := [column for column in quantity.split() if column in known]:
        error.hint = f"did you mean {', '.join(there)}?"
    component = re.fullmatch(r"(s|sigma|stress|e|eps|strain)_?([xyz123])([xyz123])", name.lower())
    if component is not None:
        i, j = sorted("xyz".find(axis) + 1 or int(axis) for axis in component.groups()[1:])
        tensor = "e" if component[1] in ("e", "eps", "strain") else "s"
        error.hint = f"did you mean '{tensor}{i}{j}'?"
    if name[:2] in ("v_", "c_"):  # as in LAMMPS
        error.hint = f"log_modify(custom, step, time, {name[2:]}) writes one number"
    return error
