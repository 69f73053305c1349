"""strength tabulated: hardening by a curve of measured points."""

from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np

from karamelo_py.language.signature import Positive, TableFile
from karamelo_py.points.laws.numbers import Numbers
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import flow_stress, radial_return
from karamelo_py.script.errors import ScriptError


class Tabulated(NamedTuple):
    """Flow stress by plastic strain, as measured: straight lines between points of a curve.

    Parameters
    ----------
    G
        Shear modulus.
    curve
        Plastic strain and flow stress, in turn, from strain 0 on; or the name of a file with a line
        for each point, the two numbers with blanks or a comma between. Lines that begin with #
        are comments.

    Example
    -------
    strength(steel, tabulated, 80e9, 0, 350e6, 0.02, 420e6, 0.1, 510e6, 0.4, 600e6)

    Notes
    -----
    Beyond the last point the flow stress stays. It may fall, but not so steeply that a point could
    not follow: by less than 3 G for each unit of plastic strain. With ``strength(steel, tabulated,
    80e9, curve.txt)`` the points are read from a file. Each step solves for the plastic strain with
    the flow stress at its end.

    See Also
    --------
    plastic, swift, johnson_cook, formula
    """

    G: float
    strain: Numbers
    stress: Numbers
    count: float

    syntax = "G, ep1, Y1[, ep2, Y2, ...] | file"

    @classmethod
    def given(cls, G: Annotated[float, Positive], *curve: float | TableFile):
        """The law from the points of its curve."""
        points = _points(curve)
        _check(points, G)
        return cls(G, Numbers(points[:, 0]), Numbers(points[:, 1]), len(points))


def _points(curve: tuple) -> np.ndarray:
    """(n, 2) plastic strain and flow stress."""
    if len(curve) == 1 and isinstance(curve[0], Path):
        path = curve[0]
        try:
            text = path.read_text(encoding="utf-8").replace(",", " ")
            points = np.loadtxt(text.splitlines(), ndmin=2)
        except ValueError as error:
            raise ScriptError(f"{path}: {error}", argument="curve") from None
        if points.shape[1:] != (2,):
            raise ScriptError(f"{path} has no two numbers in a line", argument="curve")
    elif any(isinstance(value, Path) for value in curve) or not curve or len(curve) % 2:
        raise ScriptError(
            "a curve is made of pairs of numbers, or is one file",
            argument="curve",
            expected="ep1, Y1, ep2, Y2, ..., or the name of a file",
        )
    else:
        points = np.array(curve, float).reshape(-1, 2)
    return points


def _check(points: np.ndarray, G: float) -> None:
    strain, stress = points.T
    if not len(points) or strain[0] != 0:
        raise ScriptError(
            "the curve does not begin where plastic flow does",
            argument="curve",
            expected="a first point at the plastic strain 0, with the yield stress",
        )
    if not (np.diff(strain) > 0).all():
        raise ScriptError("plastic strains of the curve do not rise", argument="curve")
    if not (stress > 0).all():
        raise ScriptError("a flow stress of the curve is not above 0", argument="curve")
    if not (np.diff(stress) > -3 * G * np.diff(strain)).all():
        raise ScriptError(
            "the curve falls by more than 3 G for each unit of plastic strain", argument="curve"
        )


remembers(Tabulated, ep=0.0)
shear_response.on(Tabulated)(radial_return)


@flow_stress.on(Tabulated)
def _flow_stress_tabulated(strength, memory, known, increment, heat, dt):
    x = memory.ep + increment
    last = int(strength.count) - 1
    for k in range(last):
        above = strength.strain[k + 1]
        if x < above:
            low = strength.stress[k]
            slope = (strength.stress[k + 1] - low) / (above - strength.strain[k])
            return low + slope * (x - strength.strain[k]), slope
    return strength.stress[last], 0 * x
