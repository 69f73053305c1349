"""Strengths linear and fluid."""

from math import sqrt
from typing import NamedTuple

from karamelo_py.language.rules import known_failure
from karamelo_py.points.kinematics import dev, inner
from karamelo_py.points.laws import LawTraits, parameter, specific_volume, strengths
from karamelo_py.points.laws.parameters import AboveZero, FromZero
from karamelo_py.points.laws.strengths.hardening import elastic_trial
from karamelo_py.points.laws.viscosity import damped, inviscid


class Elastic(NamedTuple):
    """Elastic shear without a limit.

    Parameters
    ----------
    G
        Shear modulus.

    Example
    -------
    strength(elastic, linear, 80e9)

    Notes
    -----
    The deviatoric stress rotates with the point (Jaumann rate) and changes by 2 G dev(d) for a
    strain increment d.

    See Also
    --------
    plastic, eos, material eos-strength
    """

    in_lanes = True
    traits = LawTraits(rebounds=True)

    G: AboveZero


@strengths.shear_response.on(Elastic)
def _shear_response_elastic(strength, kin, step, memory, heat):
    return elastic_trial(strength.G, step.s, step.strain), memory, 0


class Viscous(NamedTuple):
    """Shear stress of a Newtonian fluid with a viscosity.

    Parameters
    ----------
    mu
        Dynamic viscosity; 0 for none.

    Example
    -------
    strength(thin, fluid, 1e-3)

    Notes
    -----
    s = 2 mu dev(D), with the strain rate D. Viscosity shortens the stable step unless
    4/3 mu/(rho h), with cell size h, is far below the speed of sound. Viscous work is dissipated.

    See Also
    --------
    eos fluid, eos ideal-gas, material eos-strength
    """

    in_lanes = True
    traits = LawTraits(flows=True)

    mu: float
    cell_size: float  # h, set when the scene is lowered

    @classmethod
    def given(cls, mu: FromZero):
        return cls(mu, 0.0)


SIGNIFICANT = 0.05  # numerical viscosity / viscosity of the fluid, for a warning


def _viscosity(strength, scene):
    """Return the kinematic viscosity, or 0 if shear spreads over less than a cell in the run."""
    laws = [solid.material.whole for solid in scene.hub.solids.values()]
    viscous = [law for law in laws if parameter(law, "strength") is strength]
    nu = max((float(strength.mu * specific_volume(law)) for law in viscous), default=0.0)
    spreads = scene.d > 1 and sqrt(nu * scene.duration) > scene.hub.domain.h
    return nu if spreads and scene.moves and not scene.simulation.implicit else 0.0


def _slows(strength, scene):
    nu, added = _viscosity(strength, scene), scene.grid_viscosity
    if not 0 < SIGNIFICANT * nu < added:
        return None
    return {
        "mark": scene.method.mark, "pic": 1 - scene.kept, "added": added, "nu": nu,
        "more": 100 * added / nu,
    }  # fmt: skip


def _reaches(strength, scene):
    splines = not scene.hats and scene.basis.traits.nodes_per_cell == 1
    moved = splines and scene.moving_walls and _viscosity(strength, scene) > 0
    return moved and {"mark": scene.method.mark}


def _reaches_half_a_cell(strength, scene):
    apart = not scene.hats or scene.method.fields_per_solid or not scene.moving_walls
    inside = not apart and _viscosity(strength, scene) > 0 and scene.faces_in_cells
    return inside and {"mark": scene.method.mark}


FOR_FLUIDS = "method(ulmpm, APIC, linear): between plates, force and velocities within 0.1 %"
known_failure(
    Viscous,
    "viscosity of the grid",
    when=_slows,
    reason="{scene.transfer_name} takes a fraction {pic:.2g} of velocities from the grid in each "
    "step, which adds a kinematic viscosity of {added:.2g}: {more:.0f} % of the fluid's, {nu:.2g}",
    cure=FOR_FLUIDS,
)
known_failure(
    Viscous,
    "rigid walls and splines",
    when=_reaches,
    reason="a rigid solid drags a viscous fluid, and with {scene.basis_name} it extends "
    "0.75 of a cell into it: between plates the force is 18 % too large with 10 cells, 8 % with 20",
    cure=FOR_FLUIDS,
)
known_failure(
    Viscous,
    "rigid faces inside cells",
    when=_reaches_half_a_cell,
    reason="cells hold points of a rigid solid and of a viscous fluid, which sticks to all nodes "
    "of such a cell, on average half a cell from the solid: between plates the force is 11 % too "
    "large with 10 cells",
    cure="faces of rigid solids on lines of the grid, or finer cells",
)
strengths.without_shear_stiffness(Viscous)


@strengths.shear_response.on(Viscous)
def _shear_response_viscous(strength, kin, step, memory, heat):
    new = 2 * strength.mu / step.dt * dev(step.strain)
    return new, memory, inner(new, step.strain)


@inviscid.on(Viscous)
def _inviscid_viscous(strength):
    return strength._replace(mu=0.0)


@strengths.damped_speed_squared.on(Viscous)
def _damped_speed_squared_viscous(strength, squared, density):
    # The viscosity is nu = 4/3 mu/rho.
    return damped(squared, 4 / 3 * strength.mu / (density * strength.cell_size))
