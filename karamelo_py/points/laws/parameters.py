"""Checks and conversions of parameters."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, TypeVar

from karamelo_py.language.arguments import Argument, look_up
from karamelo_py.language.rules import known_failure
from karamelo_py.language.scene import Scene
from karamelo_py.language.signature import ByName as ByName
from karamelo_py.language.signature import Keyword, NonNegative, Positive
from karamelo_py.script.errors import ScriptError

AboveZero = Annotated[float, Positive]
FromZero = Annotated[float, NonNegative]
Type = TypeVar("Type")
Temperature = Annotated[Type, Keyword("T")]  # annotation of the field initial_temperature


class MaterialArgument:
    """Script argument: the ID of a material of a suitable kind."""

    script_kind: ClassVar[str] = "the ID of a material"

    @classmethod
    def from_script(cls, hub: Scene, argument: Argument) -> Any:
        material = look_up(hub.materials, argument)
        if refusal := cls.refusal(material.whole):
            message = f"material '{material.id}' {refusal[0]}"
            raise ScriptError(message, mark=argument.mark, expected=refusal[1])
        return material

    @classmethod
    def refusal(cls, law: Any) -> tuple[str, str] | None:
        """Return what is wrong with a law and what is expected, or None if it is suitable."""


LOCKED = 0.49  # Poisson's ratio above which a linear basis is 20 % too stiff


def lame_parameters(E: float, nu: float) -> tuple[float, float]:
    """Return Lame's parameters lambda and G; raise ScriptError unless -1 < nu < 0.5."""
    if not -1 < nu < 0.5:
        raise ScriptError(
            f"Poisson's ratio {nu:g} is impossible",
            argument="nu",
            expected="a number above -1 and below 0.5",
        )
    return E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))


def warn_of_locking(law: type) -> None:
    """Warn of a nearly incompressible `law` with fields ``lam`` and ``G``."""

    def keeps_volume(law, scene):
        nu = law.lam / (2 * (law.lam + law.G))
        return scene.locks and nu >= LOCKED and {"nu": nu, "mark": scene.method.mark}

    known_failure(
        law,
        "locking",
        when=keeps_volume,
        reason="Poisson's ratio of material '{owner.id}' is {nu:.9g}; with the basis "
        "{scene.basis_name} without F-bar, cells cannot bend or spread at constant volume: bodies "
        "are too stiff (a block under a strip of 8 cells: 19 % at 0.49, 87 % at 0.499)",
        cure="anti_volumetric_locking(true), or quadratic-spline",
    )


def check_temperatures(Tr: float, Tm: float, name: str = "Tr") -> None:
    if not Tm > Tr:
        raise ScriptError(
            f"the melting temperature Tm = {Tm:g} is not above {name} = {Tr:g}",
            argument="Tm",
            expected=f"a number above {Tr:g}",
        )


def reference_rate(epsdot0: float, factor: float, name: str) -> float:
    """Return the epsdot0 of 1 + `factor` ln(rate/epsdot0), which may be 0 if `factor` is 0."""
    if epsdot0 > 0:
        return epsdot0
    if factor:
        raise ScriptError(
            f"rate dependence, {name} = {factor:g}, needs a reference rate",
            argument="epsdot0",
            expected=f"a number above 0, or {name} = 0",
        )
    return 1.0


@dataclass(frozen=True)
class Numbers:
    """Constant sequence of numbers (a curve or a formula), an array in kernels.

    Tables of several laws pad the sequence with its last number; laws that need the length store
    the length.
    """

    values: tuple[float, ...]

    def __len__(self) -> int:
        return len(self.values)

    def __getitem__(self, k: int) -> float:
        return self.values[k]

    def filled(self, length: int) -> list[float]:
        return [*self.values, *self.values[-1:] * (length - len(self.values))]
