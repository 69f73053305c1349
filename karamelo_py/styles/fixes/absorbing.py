"""Fix absorbing: edges through which waves leave."""

from math import sqrt
from typing import Annotated, Literal

import numpy as np

from karamelo_py.compiler import where
from karamelo_py.compiler.fields import Field, vector
from karamelo_py.kernels.equations.mass_momentum import Normal
from karamelo_py.language.rules import Restrictions
from karamelo_py.points.kinematics import Space, total
from karamelo_py.points.laws import initial_state, shear_part, specific_volume, wave_speed_squared
from karamelo_py.scene.group import NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.lattice import Lattice
from karamelo_py.scene.material import Material
from karamelo_py.scene.modify import LAST, Fix, vector_hook
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.fixes.edges import SIDES

LAYERS = 3.5  # largest extent of an edge's nodes along the normal, in cells


class Support(Field):
    """Force that balances the initial force on a node; NaN before the first step."""

    shape = vector
    start = float("nan")


def absorb(mass, v, force, normal, support, values, dt):
    """Apply dashpots rho c A; of `normal` (rho A), only the component along the axis is used."""
    axis, along, across = values
    weight = total([where(axis == k, abs(area), 0) for k, area in enumerate(normal)])
    made = type(v)
    balance = made(*[where(a == a, a, -now) for a, now in zip(support, force, strict=True)])
    left = force + balance
    rates = [weight / mass * where(axis == k, along, across) for k in range(len(v))]
    damped = [dashpot(rates[k], mass, v[k], left[k], dt) for k in range(len(v))]
    reaction = balance + made(*damped)
    return force + reaction, balance, reaction


def dashpot(rate, mass, v, force, dt):
    """Return -rate m (v + v')/2, where v' is the velocity due to this force and `force`."""
    half = 0.5 * dt * rate
    return (-1 / (1 + half)) * (rate * mass * v + half * force)


class Absorbing(Fix):
    """Let waves leave through nodes at an edge: dashpots (Lysmer & Kuhlemeyer 1969).

    Parameters
    ----------
    material
        The material at the edge; its wave speeds determine the dashpots.
    side
        Outward direction of the edge.

    Example
    -------
    fix(out, absorbing, right, steel, xhi)

    Notes
    -----
    The traction is -rho c v, where c is the P wave speed for the normal velocity and the S wave
    speed for the tangential velocity. A pulse 20 cells long at normal incidence reflects 0.2 % of
    its energy. Plane waves at up to 45 degrees reflect at most 1.4 % (P) and 4.7 % (S, at 30
    degrees), or 0.2 % with a layer of fix mass_damping. In saturated ground, soil and water move
    together at the edge.

    A constant force balances the force on each node in the first step, so that ground with an
    initial stress (fix initial_stress) stays at rest. Loads applied later, such as weight, slowly
    push the edge outwards.

    Publishes the force of the edge as ID_x, ID_y, ID_z. The fix is accurate in tlmpm, and in ulmpm
    while points move less than half a cell.

    See Also
    --------
    mass_damping, velocity_nodes, local_damping, initial_stress
    """

    published = ("x", "y", "z")
    node_fields = (Normal, Support)
    restrictions = Restrictions("absorbing", "no absorbing", without=("semi-implicit",))
    order = LAST
    exerts = True

    post_particles_to_grid = vector_hook(
        absorb,
        reads=("mass", "velocity", "force", Normal, Support),
        writes=("force", Support),
        publishes=True,
        nodes=True,
    )

    def __init__(
        self, hub: Hub, group: NodeGroup, material: Material, side: Annotated[str, Literal[SIDES]]
    ):
        super().__init__(hub, group)
        axis = SIDES.index(side) // 2
        if axis >= hub.domain.dimension:
            message = f"the scene has no direction {side[0]}"
            expected = ", ".join(SIDES[: 2 * hub.domain.dimension])
            raise ScriptError(message, argument="side", expected=expected)
        self.side, self.material = side, material
        self.formulas = tuple(map(Expression, (float(axis), *speeds(material))))

    def defined(self) -> None:
        if self.hub.domain.h is not None:
            self.group.refuse_past_domain()
            for lattice in self.hub.lattices:
                self._check_side(lattice)

    def _check_side(self, lattice: Lattice) -> None:
        nodes, axis = self.group.nodes, SIDES.index(self.side) // 2
        here = nodes[(nodes >= lattice.first) & (nodes < lattice.first + lattice.node_count)]
        solids = self.hub.solids.values()
        if not len(here) or not solids:
            return
        x = lattice.positions(here)[:, axis]
        middle = 0.5 * (min(s.lo[axis] for s in solids) + max(s.hi[axis] for s in solids))
        outer = x.mean() < middle if self.side.endswith("lo") else x.mean() > middle
        if np.ptp(x) <= LAYERS * self.hub.domain.h and outer:
            return
        raise ScriptError(
            f"the nodes lie at {self.side[0]} = {x.min():.4g} to {x.max():.4g}, not at a "
            f"single edge on the side {self.side} of the bodies",
            argument="side",
            expected="a group of nodes at an edge, and the side that it faces",
        )


def speeds(material: Material) -> tuple[float, float]:
    """Return P and S wave speeds, in saturated soil multiplied by saturated / dry density."""
    law, kin = material.whole, Space()
    state = initial_state(law, kin, 1.0)
    fast, slow = wave_speed_squared(law, kin, state), 0.5 * shear_part(law, kin, state)
    if material.fluid is None:
        return sqrt(fast), sqrt(slow)
    heavier = material.fluid.heavier(1 / specific_volume(law))
    stiffer = material.fluid.stiffness * specific_volume(law)
    return sqrt((fast + stiffer) * heavier), sqrt(slow * heavier)
