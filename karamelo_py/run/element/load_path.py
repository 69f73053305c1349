"""A piece of a load path: which strains and stresses a point is brought to, and how."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from karamelo_py.language.signature import Argument
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.region import look_up
from karamelo_py.script.errors import ScriptError

# Components of symmetric tensors, in the order of the point functions.
COMPONENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
NORMAL = COMPONENTS[:3]


@dataclass
class LoadPath:
    """Targets at the end of a piece of path; every strain that is not named stays as it is.

    Parameters
    ----------
    increments
        Number of equal increments.
    duration
        Time it takes.
    strain, stress
        Targets by component.
    shear
        Shear components (of `strain`) that are simple shear, not pure.
    volumetric
        Target of the sum of normal strains, reached by those that are not named; or None.
    turn
        Angle about z by which the point turns meanwhile.

    Raises
    ------
    ScriptError
        If both strain and stress of a component, or too much of the volume, are prescribed.
    """

    increments: int
    duration: float
    strain: Mapping[str, float]
    stress: Mapping[str, float]
    shear: Sequence[str] = ()
    volumetric: float | None = None
    turn: float = 0.0

    id: str = ""
    place: Any = None

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> LoadPath:
        """The load path that `argument` names."""
        return look_up(hub.load_paths, argument)

    def __post_init__(self) -> None:
        for name in self.stress:
            if name in self.strain:
                raise ScriptError(
                    f"strain and stress of the component {name} are both prescribed",
                    argument=f"s{name}",
                    expected=f"s{name}, or the strain of that component",
                )
        if self.volumetric is None:
            return
        normal = [name for name in NORMAL if name in self.stress]
        if normal:
            raise ScriptError(
                f"the volume is prescribed, and s{normal[0]} needs it free",
                argument="volumetric",
                expected="normal strains beside volumetric, no normal stresses",
            )
        if set(NORMAL) <= set(self.strain):
            raise ScriptError(
                "all normal strains are prescribed: the volume follows from them",
                argument="volumetric",
                expected="two normal strains at most beside volumetric",
            )

    def strain_at_end(self, strain: np.ndarray, free: Sequence[str]) -> np.ndarray:
        """(6,) strain at the end, from that at the start; where stress is prescribed, no change.

        `free` are the components of strain that the kinematics has.
        """
        end = strain.copy()
        for name, value in self.strain.items():
            end[COMPONENTS.index(name)] = value
        if self.volumetric is not None:
            rest = [k for k, name in enumerate(NORMAL) if name in free and name not in self.strain]
            end[rest] += (self.volumetric - end[:3].sum()) / len(rest)
        return end
