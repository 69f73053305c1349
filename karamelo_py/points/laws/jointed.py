"""Material jointed: rock with a plane of weakness (ubiquitous joints)."""

from math import radians, sqrt, tan
from typing import Any, NamedTuple

from karamelo_py.compiler import where
from karamelo_py.points import laws
from karamelo_py.points.kinematics import (
    I,
    det,
    dev,
    inner,
    inv,
    nothing,
    symmetric_tensor,
    total,
    tr,
    unit,
)
from karamelo_py.points.laws import Absent
from karamelo_py.points.laws.leaning import warn_of_leaning
from karamelo_py.points.laws.oriented import Axes, oriented
from karamelo_py.points.laws.orthotropic import axes as rotation
from karamelo_py.points.laws.parameters import (
    AboveZero,
    ByName,
    FromZero,
    lame_parameters,
    warn_of_locking,
)
from karamelo_py.points.laws.strengths import FrictionTrial, pressure_response
from karamelo_py.points.laws.strengths.mohr_coulomb import MohrCoulomb
from karamelo_py.points.laws.thin import has_short_trials
from karamelo_py.script.errors import ScriptError

ALIGNED = 1e-9  # component of the normal that counts as 0
PASSES = 2  # iterations of the return to two yield surfaces


class RockBetweenJoints(MohrCoulomb):
    __slots__ = ()


class JointedConstants(NamedTuple):
    """Rock with one set of parallel joints, which can slip and open.

    Parameters
    ----------
    rho
        Density.
    E, nu
        Young's modulus and Poisson's ratio of the rock.
    cohesion, phi
        Cohesion and friction angle of the joints; the angle is in degrees, below 90.
    angle, tilt
        Rotation of the joints' normal from z, in degrees: by `tilt` about x, then by `angle` about
        z. Joints that dip by 30 degrees about z have angle 30 and tilt 90.
    psi
        Angle of dilatancy of the joints, from 0 to phi.
    tension
        Tension that the joints sustain, at most cohesion/tan(phi).
    matrix_cohesion, matrix_phi, matrix_psi
        Cohesion, friction and dilatancy of the rock between the joints (strength mohr-coulomb);
        without a cohesion or friction angle, the rock is elastic.
    axes
        As for orthotropic: `angle` and `tilt` rotate the normal from axis 3 within them.

    Example
    -------
    material(slate, jointed, 2700, 60e9, 0.25, 1e6, 30, 60, 90)
    material(shale, jointed, 2500, 20e9, 0.25, 1e6, 25, 30, 90, matrix_cohesion=9e6, matrix_phi=35)

    Notes
    -----
    With traction t_n (tension positive) and shear tau on the joints, tau + t_n tan(phi) <= cohesion
    and t_n <= tension; beyond them the stress returns by slip and opening. A specimen with joints
    whose normal is at an angle b to the load fails at s1 - s3 = 2 (c + s3 tan(phi)) / ((1 -
    tan(phi) cot(b)) sin(2 b)) or, if that is more, at the strength of the rock (Jaeger 1960, "Shear
    failure of anisotropic rocks", Geol. Mag. 97). The stress rotates with the point (Jaumann rate).
    The joints are material planes, whose normal follows the deformation. A joint that has opened
    sustains pressure again at once, without closing first. Dump columns: `slip` and `opening`, the
    sums of plastic shear and plastic extension on the joints, and `ep`, the equivalent plastic
    strain of rock with a strength.

    In 2D the normal should be in the xy plane or along z, in 1D along an axis; otherwise the body
    shears out of plane.

    See Also
    --------
    transverse, strength mohr-coulomb, fix initial_stress
    """

    rho: AboveZero
    E: AboveZero
    nu: float
    cohesion: FromZero
    phi: FromZero
    angle: float = 0.0
    tilt: float = 0.0
    psi: ByName[FromZero] = 0.0
    tension: ByName[FromZero] = 0.0
    matrix_cohesion: ByName[FromZero | None] = None
    matrix_phi: ByName[FromZero | None] = None
    matrix_psi: ByName[FromZero | None] = None
    axes: ByName[Axes | None] = None

    def checked(self):
        rho, E, nu, cohesion, phi, *angles, psi, tension = self[:9]
        matrix_cohesion, matrix_phi, matrix_psi, axes = self[9:]
        if not phi < 90:
            raise ScriptError(
                f"the friction angle phi = {phi:g} is impossible",
                argument="phi",
                expected="an angle in degrees, from 0 to below 90",
            )
        if psi > phi:
            raise ScriptError(
                f"the angle of dilatancy psi = {psi:g} is impossible with phi = {phi:g}",
                argument="psi",
                expected=f"an angle from 0 to {phi:g} degrees: slip would generate energy beyond",
            )
        friction = tan(radians(phi))
        if tension * friction > cohesion * (1 + 1e-9):
            raise ScriptError(
                f"joints with this cohesion and friction slip before a tension of {tension:g}",
                argument="tension",
                expected=f"at most cohesion/tan(phi), {cohesion / friction:g}",
            )
        lam, G = lame_parameters(E, nu)
        matrix: Any = Absent()
        if matrix_cohesion is not None or matrix_phi is not None:
            soil = matrix_cohesion or 0.0, matrix_phi or 0.0, matrix_psi or 0.0
            try:
                matrix = RockBetweenJoints(*MohrCoulomb.given(G, *soil))
            except ScriptError as error:
                error.argument = f"matrix_{error.argument}"
                raise
        elif matrix_psi is not None:
            raise ScriptError(
                "the rock between the joints is elastic and does not dilate",
                argument="matrix_psi",
                expected="matrix_cohesion=... and matrix_phi=... as well",
            )
        normal = map(float, rotation(*angles, 0.0)[:, 2])
        kind = Jointed if isinstance(matrix, Absent) else YieldingBetween
        joints = cohesion, friction, tan(radians(psi)), tension
        return oriented(kind(1 / rho, lam, G, *joints, *normal, matrix), axes)


class Jointed(NamedTuple):
    style = "jointed"
    in_lanes = True

    specific_volume: float
    lam: float
    G: float
    cohesion: float
    friction: float  # tan(phi)
    dilation: float  # tan(psi)
    tension: float
    nx: float  # normal of the joints before deformation
    ny: float
    nz: float
    matrix: Any


class YieldingBetween(Jointed):
    """Jointed rock that yields between its joints, too."""

    __slots__ = ()
    scalarised = ("advance",)


class State(NamedTuple):
    F: Any
    sigma: Any  # Cauchy stress
    slip: Any
    opening: Any
    ep: tuple  # equivalent plastic strain of the rock, if the rock has a strength
    loss: Any  # dissipated energy per reference volume


warn_of_locking(Jointed)


def leans(law: Any, scene: Any) -> bool:
    parts = [abs(x) > ALIGNED for x in (law.nx, law.ny, law.nz)]
    return {1: sum(parts) > 1, 2: parts[2] and sum(parts) > 1, 3: False}[scene.d]


warn_of_leaning(
    Jointed,
    "joints",
    leans,
    cure="a 3D scene, or a normal in the xy plane or along z (in 2D, tilt 0 or 90)",
    title="joints",
)


@laws.is_round.on(Jointed)
def _is_round_jointed(law):
    return max(abs(law.ny), abs(law.nz)) <= ALIGNED


laws.answers(
    Jointed,
    {
        has_short_trials: True,
        laws.deformation: "F",
        laws.cauchy_stress: "sigma",
        laws.dissipated_energy: "loss",
    },
)


@laws.initial_state.on(Jointed)
def _initial_state_jointed(law, kin, template):
    ep = (0.0,) if isinstance(law, YieldingBetween) else ()
    return State(unit(kin), nothing(kin), 0, 0, ep, 0)


def normal_of_joints(law, F):
    """Return the unit normal (3,) of the material planes, along F^-T n."""
    back, n = inv(F).at(), (law.nx, law.ny, law.nz)
    inside = [i for i in range(3) if (i, i) in back]
    made = [
        total([back[j, i] * n[j] for j in inside if (j, i) in back]) if i in inside else n[i]
        for i in range(3)
    ]
    size = 1 / sqrt(total([x * x for x in made]))
    return [size * x for x in made]


class OnJoints(NamedTuple):
    sigma: Any
    slip: Any
    opening: Any
    along: Any  # slip as a vector (3,)


def slipped(law, kin, trial, n):
    """Return the stress with slip on joints, rotated only by the spin of the rock.

    The velocity gradient of a slip rate g along m is g m n; its skew part does not rotate the rock
    (as in crystals: Asaro 1983, "Micromechanics of crystals and polycrystals").
    """
    along = returned_to_joints(law, trial, n).along
    back = kin.Tensor._make([-along[i] * n[j] for i, j in kin.Tensor.places])
    return returned_to_joints(law, trial.turned(back), n)


def returned_to_joints(law, sigma, n):
    """Return the stress that the joints sustain, with slip and opening of the step.

    If both limits are exceeded, the traction is returned to their corner. Neither multiplier is
    negative there if the return to the slip limit alone leaves too much tension.
    """
    a, places = sigma.at(), sigma.places
    t = [total([a[i, j] * n[j] for j in range(3) if (i, j) in a]) for i in range(3)]
    tension = total([x * y for x, y in zip(t, n, strict=True)])
    shear = [x - tension * y for x, y in zip(t, n, strict=True)]
    squared = total([x * x for x in shear])
    sheared = squared > 0
    size = sqrt(where(sheared, squared, 1))
    tau = where(sheared, size, 0)
    across = law.lam + 2 * law.G
    excess = tau + law.friction * tension - law.cohesion
    slip = max(excess, 0) / (law.G + across * law.friction * law.dilation)
    opens = tension - across * law.dilation * slip > law.tension
    corner = law.cohesion - law.friction * law.tension
    slip = where(opens, max(tau - corner, 0) / law.G, slip)
    opening = where(opens, (tension - law.tension) / across - law.dilation * slip, 0)
    extension = opening + law.dilation * slip
    m = [x / size for x in shear]
    flow = sigma._make(
        [
            2 * law.G * (extension * n[i] * n[j] + 0.5 * slip * (n[i] * m[j] + m[i] * n[j]))
            for i, j in places
        ]
    )
    sustained = sigma - flow - law.lam * extension * I
    return OnJoints(sustained, slip, extension, [slip * x for x in m])


def strain_of(law, sigma):
    mean = law.lam / (3 * law.lam + 2 * law.G) * tr(sigma)
    return 0.5 / law.G * (sigma - mean * I)


@laws.advance.on(Jointed)
def _advance_jointed(law, kin, state, dl, dt):
    F = state.F.after(dl)
    eps = dl.strain_at_end()
    trial = state.sigma.turned(dl) + (2 * law.G * eps + law.lam * tr(eps) * I)
    n = normal_of_joints(law, F)
    if not len(state.ep):
        sigma, slip, opening, _ = slipped(law, kin, trial, n)
        ep = state.ep
    else:
        sigma, slip, opening, flow = trial, 0, 0, nothing(kin)
        for _ in range(PASSES):
            old = sigma
            whole = FrictionTrial(dev(old), -1 / 3 * tr(old), law.lam + 2 / 3 * law.G)
            s, p = pressure_response(law.matrix, kin, whole, 0.0)
            sigma = s - p * I
            flow = flow + 0.5 / law.G * (whole.s - s)
            sigma, more_slip, more_opening, _ = slipped(law, kin, sigma, n)
            slip, opening = slip + more_slip, opening + more_opening
        ep = (state.ep[0] + sqrt(2 / 3 * inner(flow, flow)),)
    work = det(F) * inner(sigma, strain_of(law, trial - sigma))
    return State(F, sigma, state.slip + slip, state.opening + opening, ep, state.loss + work)


@laws.jacobian.on(Jointed)
def _jacobian_jointed(law, kin, state):
    return det(state.F)


@laws.kirchhoff_stress.on(Jointed)
def _kirchhoff_stress_jointed(law, kin, state):
    return det(state.F) * state.sigma


@laws.wave_speed_squared.on(Jointed)
def _wave_speed_squared_jointed(law, kin, state):
    return (law.lam + 2 * law.G) * law.specific_volume * det(state.F)


@laws.shear_part.on(Jointed)
def _shear_part_jointed(law, kin, state):
    return 2 * law.G * law.specific_volume * det(state.F)


@laws.elastic_strain.on(Jointed)
def _elastic_strain_jointed(law, kin, state):
    return strain_of(law, state.sigma)


@laws.energy_density.on(Jointed)
def _energy_density_jointed(law, kin, state):
    return 0.5 * det(state.F) * inner(state.sigma, strain_of(law, state.sigma))


@laws.plastic_strain.on(YieldingBetween)
def _plastic_strain_jointed(law, kin, state):
    return sum(state.ep)


@laws.with_stress.on(Jointed)
def _with_stress_jointed(law, kin, state, stress):
    return state._replace(sigma=symmetric_tensor(kin, stress))


laws.column(Jointed, "slip")
laws.column(Jointed, "opening")
laws.column(YieldingBetween, "ep", laws.plastic_strain)
laws.no_columns(RockBetweenJoints)
