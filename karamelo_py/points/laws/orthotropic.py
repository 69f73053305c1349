"""Orthotropic and transversely isotropic elasticity: wood, plies, slate."""

from collections import namedtuple
from collections.abc import Callable
from itertools import combinations_with_replacement
from math import cos, radians, sin
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, inner, total
from karamelo_py.points.laws import LawTraits
from karamelo_py.points.laws.elastic import OfDeformation
from karamelo_py.points.laws.leaning import warn_of_leaning
from karamelo_py.points.laws.oriented import Axes, oriented
from karamelo_py.points.laws.parameters import AboveZero, ByName
from karamelo_py.script.errors import ScriptError

# Components in Voigt's order.
VOIGT = (0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)
INDEX = (0, 5, 4), (5, 1, 3), (4, 3, 2)  # numbers of components in Voigt's order
PAIRS = tuple(combinations_with_replacement(range(6), 2))
STIFFNESS = tuple(
    tuple(2 + PAIRS.index((min(a, b), max(a, b))) for b in range(6)) for a in range(6)
)
COUPLED = 1e-9  # relative out-of-plane shear that counts as 0

_Fields = namedtuple(
    "_Fields", ("specific_volume", "fastest", *(f"c{a + 1}{b + 1}" for a, b in PAIRS))
)


class Directional(OfDeformation, _Fields):
    __slots__ = ()
    in_lanes = True
    traits = LawTraits(rebounds=True)


class Orthotropic(NamedTuple):
    """Elastic solid with three perpendicular axes of different stiffness, for small strains.

    Parameters
    ----------
    rho
        Density before deformation.
    E1, E2, E3
        Young's moduli along the three axes of the material.
    nu12, nu13, nu23
        Poisson's ratios; nu12: contraction along 2 over stretch along 1.
    G12, G13, G23
        Shear moduli.
    angle, tilt, spin
        Rotation of the axes from x, y, z in degrees: by `angle` about z, by `tilt` about the new
        axis 1, by `spin` about the new axis 3.
    axes
        Axes that may differ from point to point: an angle about z in degrees, or two vectors, along
        axis 1 and towards axis 2; numbers, or formulas of x0, y0, z0. `angle`, `tilt` and `spin`
        are then relative to these axes.

    Example
    -------
    material(spruce, orthotropic, 450, 11e9, 0.6e9, 0.9e9, 0.4, 0.4, 0.3, 0.7e9, 0.6e9, 0.07e9)
    material(log, orthotropic, 450, 9e9, 6e8, 9e8, 0.4, 0.4, 0.3, 7e8, 6e8, 7e7, axes=(90*x0))
    material(ply, orthotropic, 1600, 140e9, 9e9, 9e9, 0.3, 0.3, 0.4, 5e9, 5e9, 3e9, 30)

    Notes
    -----
    The second Piola-Kirchhoff stress is linear in the Green-Lagrange strain, S = C:E, with the
    stiffness C of Lekhnitskii (1963, section 5). The axes rotate with the body. In axisymmetry, x,
    y and z are the radial, axial and hoop directions. In 2D, one axis should be z (`tilt` 0 or 90
    with `spin` 0); otherwise the body shears out of plane.

    See Also
    --------
    transverse, hill, tsai-hill, hashin, saint-venant-kirchhoff, plane_stress
    """

    rho: AboveZero
    E1: AboveZero
    E2: AboveZero
    E3: AboveZero
    nu12: float
    nu13: float
    nu23: float
    G12: AboveZero
    G13: AboveZero
    G23: AboveZero
    angle: float = 0.0
    tilt: float = 0.0
    spin: float = 0.0
    axes: ByName[Axes | None] = None

    def checked(self):
        """Refuse constants for which a strain would have negative energy."""
        moduli = (self.E1, self.E2, self.E3, self.G23, self.G13, self.G12)
        compliance = np.diag([1 / modulus for modulus in moduli])
        compliance[0, 1] = compliance[1, 0] = -self.nu12 / self.E1
        compliance[0, 2] = compliance[2, 0] = -self.nu13 / self.E1
        compliance[1, 2] = compliance[2, 1] = -self.nu23 / self.E2
        least = np.linalg.eigvalsh(compliance[:3, :3] * min(moduli[:3])).min()
        if not least > 1e-9:
            pairs = {
                f"nu{a + 1}{b + 1}": (f"E{a + 1}/E{b + 1}", moduli[a] / moduli[b])
                for a, b in ((0, 1), (0, 2), (1, 2))
            }
            wrong = [name for name, (_, most) in pairs.items() if getattr(self, name) ** 2 >= most]
            raise ScriptError(
                "with these Poisson's ratios some strain would release energy",
                argument=[*wrong, "nu12"][0],
                expected=f"{wrong[0]}^2 < {pairs[wrong[0]][0]}"
                if wrong
                else "smaller ratios: nu12^2 E2/E1 + nu13^2 E3/E1 + nu23^2 E3/E2 "
                "+ 2 nu12 nu13 nu23 E3/E1 < 1",
                hint="nu12 = nu21 E1/E2: the ratio belongs to a pull along the first axis",
            )
        C = rotated(np.linalg.inv(compliance), axes(self.angle, self.tilt, self.spin))
        return oriented(of_stiffness(1 / self.rho, C), self.axes)


def of_stiffness(specific_volume: float, C: np.ndarray) -> Directional:
    numbers = [C[VOIGT[a] + VOIGT[b]] for a, b in PAIRS]
    return Directional(specific_volume, fastest(C), *map(float, numbers))


class Transverse(NamedTuple):
    """Elastic solid with one distinct direction, such as bedding or fibres, for small strains.

    Parameters
    ----------
    rho
        Density before deformation.
    E, nu
        Young's modulus and Poisson's ratio in planes normal to the direction.
    E3, nu3
        Young's modulus along the direction; contraction across it / stretch along it.
    G3
        Shear modulus of planes that contain the direction.
    angle, tilt
        Rotation of the direction from z, in degrees: by `tilt` about x, then by `angle` about z.
        The normal of bedding that dips by 30 degrees about z has angle 30 and tilt 90.
    axes
        As for orthotropic; `angle` and `tilt` rotate the direction from axis 3 within them.

    Example
    -------
    material(slate, transverse, 2700, 60e9, 0.25, 30e9, 0.15, 15e9, 30, 90)

    Notes
    -----
    The law is orthotropic, with axis 3 along the direction and equal axes 1 and 2.

    See Also
    --------
    orthotropic, jointed, tsai-hill, linear
    """

    rho: AboveZero
    E: AboveZero
    nu: float
    E3: AboveZero
    nu3: float
    G3: AboveZero
    angle: float = 0.0
    tilt: float = 0.0
    axes: ByName[Axes | None] = None

    def checked(self):
        if not -1 < self.nu < 1 or not self.nu3**2 < self.E3 / self.E * (1 - self.nu) / 2:
            raise ScriptError(
                "with these Poisson's ratios some strain would release energy",
                argument="nu3",
                expected="nu above -1 and below 1, and nu3^2 < E3/E (1 - nu)/2",
            )
        across = self.nu3 * self.E / self.E3  # contraction along 3 / stretch across it
        shear = 0.5 * self.E / (1 + self.nu), self.G3, self.G3
        moduli, ratios = (self.E, self.E, self.E3), (self.nu, across, across)
        turns = self.angle, self.tilt, 0.0
        return Orthotropic(self.rho, *moduli, *ratios, *shear, *turns, self.axes).checked()


def axes(angle: float, tilt: float, spin: float) -> np.ndarray:
    """Return the rotation (3, 3) with the material's axes as columns; angles are in degrees."""

    def about(axis: int, degrees: float) -> np.ndarray:
        i, j = [k for k in range(3) if k != axis]
        R, a = np.eye(3), radians(degrees)
        R[i, i] = R[j, j] = cos(a)
        R[i, j], R[j, i] = -sin(a), sin(a)
        return R

    return about(2, angle) @ about(0, tilt) @ about(2, spin)


def rotated(C: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Return the stiffness (3, 3, 3, 3) of a matrix (6, 6), rotated by R."""
    full = np.array(
        [[[[C[INDEX[i][j], INDEX[k][m]] for m in range(3)] for k in range(3)] for j in range(3)]
         for i in range(3)]
    )  # fmt: skip
    return np.einsum("ia,jb,kc,md,abcd->ijkm", R, R, R, R, full, optimize=True)


def fastest(C: np.ndarray) -> float:
    """Return the largest rho c^2 of plane waves: an eigenvalue of C_ijkl n_j n_l over all n."""
    z, turn = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 2 * np.pi, 121))
    r = np.sqrt(1 - z * z)
    n = np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=-1).reshape(-1, 3)
    acoustic = np.einsum("ijkl,nj,nl->nik", C, n, n)
    # The factor covers directions between the samples, which are 3 degrees apart.
    return 1.003 * float(np.linalg.eigvalsh(acoustic).max())


# By dimension: stress components within a body's plane or line, and shears out of it.
OUT_OF_SCENE = {1: ((0,), (3, 4, 5)), 2: ((0, 1, 2, 5), (3, 4)), 3: ((), ())}


def couples(law: Any, scene: Any) -> bool:
    inside, outside = OUT_OF_SCENE[scene.d]
    shears = [abs(law[STIFFNESS[a][b]]) for a in inside for b in outside]
    return max(shears, default=0) > COUPLED * law.fastest


@laws.is_round.on(Directional)
def _is_round_directional(law):
    equal = (((0, 1), (0, 2)), ((1, 1), (2, 2)), ((4, 4), (5, 5)))
    apart = [law[STIFFNESS[a][b]] - law[STIFFNESS[c][d]] for (a, b), (c, d) in equal]
    coupled = [law[STIFFNESS[a][b]] for a in (0, 1, 2) for b in (3, 4, 5)]
    return max(map(abs, (*apart, *coupled))) <= COUPLED * law.fastest


def warn_of_axes(law: type, couples: Callable) -> None:
    cure = "a 3D scene, or axes along x, y and z (in 2D, tilt 0 or 90 with spin 0)"
    warn_of_leaning(law, "axes", couples, cure=cure)


warn_of_axes(Directional, couples)


def stress_of(law, E):
    strain = E.at()

    def component(i, j):
        row = STIFFNESS[INDEX[i][j]]
        return total([law[row[INDEX[k][m]]] * value for (k, m), value in strain.items()])

    return E._make([component(i, j) for i, j in E.places])


@laws.kirchhoff_stress.on(Directional)
def _kirchhoff_stress_directional(law, kin, state):
    S = stress_of(law, laws.elastic_strain(law, kin, state))
    return S.carried(state.F - I)


@laws.energy_density.on(Directional)
def _energy_density_directional(law, kin, state):
    E = laws.elastic_strain(law, kin, state)
    return 0.5 * inner(stress_of(law, E), E)


@laws.wave_speed_squared.on(Directional)
def _wave_speed_squared_directional(law, kin, state):
    # rho_0 c^2 = C_ijkl F_ai F_bk m_j m_l + S_jl m_j m_l with m = F^T n, at most x^2 C + |tau|.
    x = state.F.left_cauchy_green().largest_row_sum()
    tau = laws.kirchhoff_stress(law, kin, state).largest_row_sum()
    return (x * x * law.fastest + tau) * law.specific_volume
