"""Material tsai-hill: failure of laminae and wood."""

from typing import Any, NamedTuple

from karamelo_py.compiler import where
from karamelo_py.points import laws
from karamelo_py.points.kinematics import I, total
from karamelo_py.points.laws.elastic import OfDeformation
from karamelo_py.points.laws.elastic import State as Deformed
from karamelo_py.points.laws.oriented import with_axes_of, without_axes
from karamelo_py.points.laws.orthotropic import Directional, axes, stress_of
from karamelo_py.points.laws.parameters import AboveZero, ByName, MaterialArgument
from karamelo_py.script.errors import ScriptError


class DirectionalBase(MaterialArgument):
    script_kind = "the ID of a material orthotropic or transverse"

    @classmethod
    def refusal(cls, law: Any) -> tuple[str, str] | None:
        fits = isinstance(without_axes(law), Directional)
        return None if fits else ("has no directions", cls.script_kind)


class TsaiHill(NamedTuple):
    """Anisotropic elastic solid that breaks where the stress reaches the strength.

    Parameters
    ----------
    elastic
        ID of a material orthotropic or transverse.
    X
        Strength along axis 1, the fibres.
    Y
        Strength normal to axis 1.
    S
        Shear strength of planes that contain axis 1.
    angle, tilt, spin
        Rotation of the axes of strength from x, y, z in degrees: by `angle` about z, by `tilt`
        about the new axis 1, by `spin` about the new axis 3. The elastic material has separate
        angles; its `axes` apply to both.
    Xc, Yc
        Strengths in compression; default: as in tension.
    residual
        Remaining fraction of the stiffness, above 0 and below 1.

    Example
    -------
    material(lamina, orthotropic, 1600, 140e9, 9e9, 9e9, 0.3, 0.3, 0.4, 5e9, 5e9, 3e9, 30)
    material(ply, tsai-hill, lamina, 2000e6, 50e6, 80e6, 30, Xc=1200e6, Yc=170e6)

    Notes
    -----
    A point breaks when T11 (T11 - T22 - T33)/X^2 + (T22^2 + T33^2)/Y^2 + (1/X^2 - 2/Y^2) T22 T33 +
    (T12^2 + T13^2)/S^2 + (4/Y^2 - 1/X^2) T23^2 exceeds 1, the criterion of Tsai (1968) and Hill
    (1948) for a solid that is isotropic across axis 1 (Jones 1999, "Mechanics of composite
    materials", section 2.9.3). T is the second Piola-Kirchhoff stress; the strengths in tension or
    compression are chosen by the signs of T11 and T22 + T33. After failure, the stress is the
    fraction `residual` of the elastic stress; the energy lost is dissipated. Dump columns:
    `damage`, 0 or 1, and `damage_init`, the largest value of the criterion so far. If points break
    one after the other, the energy of a crack depends on the cell size.

    See Also
    --------
    hashin, orthotropic, transverse, hill, fix erosion
    """

    elastic: DirectionalBase
    X: AboveZero
    Y: AboveZero
    S: AboveZero
    angle: float = 0.0
    tilt: float = 0.0
    spin: float = 0.0
    Xc: ByName[AboveZero | None] = None
    Yc: ByName[AboveZero | None] = None
    residual: ByName[AboveZero] = 0.01

    syntax = "elastic, X, Y, S[, angle][, tilt][, spin][, Xc=X][, Yc=Y][, residual=0.01]"

    def checked(self):
        elastic, X, Y, S, *angles, Xc, Yc, residual = self
        strengths = (X, Y), (X, Yc or Y), (Xc or X, Y), (Xc or X, Yc or Y)
        for along, across in strengths:
            if across >= 2 * along:
                raise ScriptError(
                    f"with {across:g} across and {along:g} along axis 1 some shear would never "
                    "break the solid",
                    argument="Y",
                    expected="a strength across axis 1 below twice the strength along it",
                )
        refuse_whole(residual)
        turn = map(float, axes(*angles).ravel())
        law = without_axes(elastic.whole)
        made = Failing(law, X, Xc or X, Y, Yc or Y, S, residual, Turn(*turn))
        return with_axes_of(elastic.whole, made)


def refuse_whole(residual: float) -> None:
    if not residual < 1:
        raise ScriptError(
            f"a residual fraction of {residual:g} means no failure",
            argument="residual",
            expected="a number above 0 and below 1",
        )


class Turn(NamedTuple):
    in_lanes = True

    xx: float
    xy: float
    xz: float
    yx: float
    yy: float
    yz: float
    zx: float
    zy: float
    zz: float


class _Fields(NamedTuple):
    elastic: Any
    X: float
    Xc: float
    Y: float
    Yc: float
    S: float
    residual: float
    turn: Turn  # axes of strength, as columns


class Ply(OfDeformation):
    """Base of anisotropic solids that break, with the elastic law in the field `elastic`."""

    __slots__ = ()
    in_lanes = True
    traits = laws.LawTraits()


class Failing(Ply, _Fields):
    """A ply with the criterion of Tsai and Hill."""

    __slots__ = ()


class State(NamedTuple):
    F: Any
    index: Any  # largest value of the criterion so far
    loss: Any  # dissipated energy per reference volume


@laws.initial_state.on(Failing)
def _initial_state_failing(law, kin, template):
    return State(laws.initial_state(law.elastic, kin, template).F, 0, 0)


def piola_stress(law, kin, F):
    return stress_of(law.elastic, laws.elastic_strain(law.elastic, kin, Deformed(F)))


def in_axes(turn, T):
    """Return T11, T22, T33, T12, T13, T23 in the axes of strength."""
    a = T.at()

    def component(p, q):
        pairs = [(i, j) for i in range(3) for j in range(3) if (i, j) in a]
        return total([turn[3 * i + p] * turn[3 * j + q] * a[i, j] for i, j in pairs])

    return [component(p, q) for p, q in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]


def criterion(law, T):
    t11, t22, t33, t12, t13, t23 = in_axes(law.turn, T)
    x = 1 / where(t11 < 0, law.Xc, law.X)
    y = 1 / where(t22 + t33 < 0, law.Yc, law.Y)
    xx, yy = x * x, y * y
    shears = (t12 * t12 + t13 * t13) / (law.S * law.S) + (4 * yy - xx) * t23 * t23
    return (
        t11 * (t11 - t22 - t33) * xx
        + (t22 * t22 + t33 * t33) * yy
        + ((xx - 2 * yy) * t22 * t33 + shears)
    )


def fraction_left(law, index):
    return where(index < 1, 1, law.residual)


@laws.advance.on(Failing)
def _advance_failing(law, kin, state, dl, dt):
    F = state.F.after(dl)
    index = max(state.index, criterion(law, piola_stress(law, kin, F)))
    gone = fraction_left(law, state.index) - fraction_left(law, index)
    return State(F, index, state.loss + gone * laws.energy_density(law.elastic, kin, Deformed(F)))


@laws.kirchhoff_stress.on(Failing)
def _kirchhoff_stress_failing(law, kin, state):
    whole = piola_stress(law, kin, state.F).carried(state.F - I)
    return fraction_left(law, state.index) * whole


@laws.energy_density.on(Failing)
def _energy_density_failing(law, kin, state):
    whole = laws.energy_density(law.elastic, kin, Deformed(state.F))
    return fraction_left(law, state.index) * whole


laws.answers(Failing, {laws.damage_initiation: "index"})
laws.answers(Ply, {laws.dissipated_energy: "loss"})


@laws.damage.on(Ply)
def _damage_ply(law, kin, state):
    return where(laws.damage_initiation(law, kin, state) < 1, 0, 1)


@laws.wave_speed_squared.on(Ply)
def _wave_speed_squared_ply(law, kin, state):
    return laws.wave_speed_squared(law.elastic, kin, Deformed(state.F))


@laws.specific_volume.on(Ply)
def _specific_volume_ply(law):
    return law.elastic.specific_volume


@laws.is_round.on(Ply)
def _is_round_ply(law):
    return laws.is_round(law.elastic)


laws.column(Ply, "damage", laws.damage)
laws.column(Ply, "damage_init", laws.damage_initiation)
