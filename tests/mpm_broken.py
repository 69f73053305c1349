"""A package of styles that are wrong, each in its way; scripts call them in small letters."""

import sys
from functools import partial
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import point_function
from karamelo_py.compiler.fields import Field
from karamelo_py.kernels.equations.internal_force import Force, WorkOfForces
from karamelo_py.kernels.table import ACCELERATE, SUMS
from karamelo_py.points.basis import BasisTraits
from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.basis.product import along, register
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    column,
    elastic_strain,
    energy_density,
    initial_state,
    jacobian,
    kirchhoff_stress,
    wave_speed_squared,
)
from karamelo_py.points.laws.strengths import remembers, shear_response
from karamelo_py.points.laws.strengths.hardening import flow_stress, radial_return, updated_memory
from karamelo_py.points.transfers import TransferTraits, updated_velocity
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.modify import Compute, Fix, heat_hook, node_hook, point_hook, vector_hook
from karamelo_py.schemes.traits import SchemeTraits
from karamelo_py.script.expressions import Expression
from karamelo_py.styles.dumps.base import Dump


@point_function()
def heat_content(law, kin, state):
    """Known of no law."""


def named(base: type, **classes: dict[str, Any]) -> None:
    """Make classes of `base` here: the name of each, and what stands in it."""
    for name, inside in classes.items():
        globals()[name] = type(name, (base,), inside)


def like(base: type, names: str) -> list[type]:
    """Classes that have nothing but another name than `base`."""
    return [type(name, (base,), {}) for name in names.split()]


# --- hooks
class Spring(Fix):
    def __init__(self, hub, group: ParticleGroup, k: float = 1.0):
        super().__init__(hub, group)
        1 / k

    def initial_integrate(self, points):
        return missing  # noqa


class Group(Fix):
    def __init__(self, hub, group: ParticleGroup):
        super().__init__(hub, group)
        self.formulas = (Expression(1.0),)


def uncompilable(pt):
    return pt.v * len(f"{pt.value:.3e}"), pt.x, 0.0


def at_point(pt):
    return pt.v, pt.x, 1.0


def at_node(node):
    return node.v, node.v_star, node.force, 1.0


def too_few():
    return 0.0, 0.0, 0.0, 0.0


def whole(v, values, dt):
    return v, v


def laid(v, values, dt):
    return 1.0


def counted(v, values, dt):
    return v * len(f"{dt:.3e}")


def turned(v, values, dt):
    return type(v)(-v[0])


V, F = ("velocity",), ("force",)
named(
    Group,
    Light={"post_grid_to_point": point_hook(uncompilable)},
    Misplaced={"post_particles_to_grid": point_hook(at_point)},
    Swapped={"final_integrate": node_hook(at_node)},
    Cold={"supply_heat": point_hook(at_point)},
    Hot={"initial_integrate": heat_hook(at_point)},
    Many={"post_particles_to_grid": node_hook(too_few)},
    Few={"initial_integrate": point_hook(lambda pt: (pt.v, pt.x))},
    Wholly={"initial_integrate": vector_hook(whole, reads=V, writes=V)},
    Heavily={"initial_integrate": vector_hook(laid, reads=("weight",), writes=V)},
    Unnamed={"initial_integrate": vector_hook(lambda v, values, dt: v, reads=V, writes=V)},
    Partly={
        "post_particles_to_grid": vector_hook(partial(laid, dt=0.0), reads=F, writes=F, nodes=True)
    },
    Slightly={"initial_integrate": point_hook(partial(laid, dt=0.0))},
    Fixing={"initial_integrate": vector_hook(laid, reads=V, writes=("mass",))},
    Homeless={"initial_integrate": vector_hook(laid, reads=(Force,), writes=(Force,))},
    Late={
        "point_fields": (Force, WorkOfForces),
        "final_integrate": vector_hook(laid, reads=(Force,), writes=(Force,)),
    },
    Slim={"final_integrate": vector_hook(laid, reads=("mass", "velocity"), writes=V)},
    Nodeless={
        "post_particles_to_grid": vector_hook(laid, reads=("position",), writes=F, nodes=True)
    },
    Early={"post_update_grid_state": vector_hook(laid, reads=F, writes=F, nodes=True)},
    Elsewhere={"final_integrate": vector_hook(laid, reads=F, writes=F, nodes=True)},
    Lawless={"initial_integrate": vector_hook(laid, reads=(heat_content,), writes=V)},
    Dark={"published": (), "initial_integrate": vector_hook(counted, reads=V, writes=V)},
    Turning={"published": (), "initial_integrate": vector_hook(turned, reads=V, writes=V)},
    Silent={"published": ("x",), "initial_integrate": point_hook(at_point, publishes=False)},
)


class Undirected(Fix):
    post_particles_to_grid = node_hook(at_node)

    def __init__(self, hub, group: ParticleGroup):
        super().__init__(hub, group)


class Viewless(Group):
    def initial_integrate(self): ...


class Orphan(Fix):
    def __init__(self, hub, group: ParticleGroup):
        self.formulas = (Expression(1.0),)

    def initial_integrate(self, points): ...


class Idle(Fix):
    published = ()

    def initial_integrat(self, points): ...


class Misspelt(Group):
    published = ()

    def initial_integrate(self, points): ...

    def post_gird_to_point(self, points): ...

    def _post_process(self): ...

    def position_of(self): ...


class Blurred(Group):
    published = ()

    def initial_integrate(self, points): ...

    def post_update_grid(self, nodes): ...


class Stop(Group):
    def initial_integrate(self, points):
        points.velocity[:] = 0


class Ids(Group):
    def final_integrate(self, points):
        points.velocity[:, 0] = points.ids


class Weigh(Group):
    def initial_integrate(self, points):
        points.mass[:] = 0


class Leaving(Group):
    def initial_integrate(self, points):
        sys.exit("bye")


class Silenced(Group):
    def initial_integrate(self, points):
        raise SystemExit(0)


class Gauge(Compute):
    published = ("x",)

    def refresh(self):
        self.publish("s", 1)


class Mute(Compute):
    published = ("x",)

    def refresh(self):
        self.last = 1


# --- fields
class Formless(NamedTuple):
    array: Any


class Wordy(Field):
    columns = "dose"


class Sized(Field):
    def start(kin):
        return 1.0, 2.0


class Unshaped(Field):
    def shape(kin):
        return kin.dimensions


class Taken(Field):
    columns = ("vx",)


class Other(Field):
    columns = ("dose",)


class Second(Other):
    pass


named(
    Group,
    Bare={"point_fields": Other},
    Formless={"point_fields": (Formless,)},
    OneWord={"point_fields": (Wordy,)},
    Clashing={"point_fields": (Taken,)},
    Doubled={"point_fields": (Sized,)},
    Lost={"node_fields": (Unshaped,)},
    Nodal={"node_fields": (Taken,)},
    First={"published": (), "point_fields": (Other,)},
    Again={"point_fields": (Second,)},
)


# --- laws
class Law(NamedTuple):
    """E and nothing else."""

    E: float
    specific_volume = 1.0


Motionless, Growing, Raising, Short, Uncompiled, Hiding, Double = like(
    Law, "Motionless Growing Raising Short Uncompiled Hiding Double"
)
for kind in (Motionless, Growing, Raising, Short, Uncompiled):
    initial_state.on(kind)(lambda law, kin, like: (like,))
    cauchy_stress.on(kind)(lambda law, kin, state: kin.Symmetric._make((state[0],) * 3))
    kirchhoff_stress.on(kind)(lambda law, kin, state: kin.Symmetric._make((state[0],) * 3))
    elastic_strain.on(kind)(lambda law, kin, state: kin.Symmetric._make((state[0],) * 3))
    jacobian.on(kind)(lambda law, kin, state: state[0])
    energy_density.on(kind)(lambda law, kin, state: state[0])
    wave_speed_squared.on(kind)(lambda law, kin, state: law.E)
for kind in (Short, Uncompiled):
    advance.on(kind)(lambda law, kin, state, dl, dt: state)
advance.on(Growing)(lambda law, kin, state, dl, dt: (*state, dt))
cauchy_stress.on(Short)(lambda law, kin, state: (state[0], state[0]))


@advance.on(Raising)
def _advance_raising(law, kin, state, dl, dt):
    return unknown  # noqa


@wave_speed_squared.on(Uncompiled)
def _wave_speed_squared_uncompiled(law, kin, state):
    return law.E * len(f"{law.E:.3e}")


column(Hiding, "seq", energy_density)
column(Double, "dose", energy_density)


class Forgetful(NamedTuple):
    """A strength."""

    G: float


class Less(NamedTuple):
    """One of the two numbers that a point remembers at first."""

    ep: Any


remembers(Forgetful, ep=0.0, R=0.0)
shear_response.on(Forgetful)(radial_return)
flow_stress.on(Forgetful)(lambda strength, *others: (strength.G, strength.G))
updated_memory.on(Forgetful)(lambda strength, memory, increment, dt: Less(memory.ep))


# The last of them remembers nothing of its own.
Endless, Uncountable, Lone, Misnaming, Renaming, Misshapen = like(
    Forgetful, "Endless Uncountable Lone Misnaming Renaming Misshapen"
)


class Constant(NamedTuple):
    """A strength that remembers a number, and forgets to update it."""

    G: float


for kind in (Lone, Misnaming, Renaming, Constant):
    remembers(kind, ep=0.0, R=0.0)
    shear_response.on(kind)(radial_return)
flow_stress.on(Lone)(lambda strength, *others: strength.G)
flow_stress.on(Misnaming)(lambda strength, before, *others: (before.memory.R1, strength.G))
updated_memory.on(Renaming)(lambda strength, memory, *others: memory._replace(R1=0.0))
shear_response.on(Misshapen)(lambda strength, kin, step, *others: (step.s, ()))
flow_stress.on(Constant)(
    lambda strength, before, *others: (strength.G + before.memory.R, strength.G)
)


for kind, number in ((Endless, inf), (Uncountable, nan)):
    remembers(kind, ep=0.0)
    shear_response.on(kind)(radial_return)
    flow_stress.on(kind)(lambda strength, *others, number=number: (number, strength.G))


# --- parts of a step
class Basis(NamedTuple):
    traits = BasisTraits(cells=1, least_nodes=2, steady_moment=True, steep_edge=True)


Pathless, Tuple, Heavy, Slanted, Narrow, Precise = like(
    Basis, "Pathless Tuple Heavy Slanted Narrow Precise"
)


class Vague(NamedTuple): ...


class Distorted(Basis):
    gradient_jump = True


class Lazy(NamedTuple):
    traits = TransferTraits()


class Loose(Lazy):
    inverts_spread = True


class Stray(NamedTuple):
    G: float

    ring = False


class Rowless(NamedTuple): ...


class Wrong(NamedTuple):
    traits = SchemeTraits()
    rows = (SUMS, "twice")


class Grounded(NamedTuple):
    traits = SchemeTraits()
    rows = ACCELERATE


register(Pathless, 2)
register(Tuple, 2)
along.on(Tuple)(lambda basis, kin, grid, place, direction: (0, 0.5, (0.5, 0.5), (-1.0, 1.0), ()))


def hats(weight=1.0, slope=1.0, nodes=2):
    """Hats that are none."""

    def along_of(basis, kin, grid, place, direction):
        hat = along(Linear(), kin, grid, place, direction)
        left, right = hat.weights
        g = hat.gradients[0]
        weights = (left * weight, right, right)[:nodes]
        return hat._replace(weights=weights, gradients=(g, -g * slope, g)[:nodes])

    return along_of


for kind, shape in (
    (Heavy, hats(weight=1.1)),
    (Slanted, hats(slope=1.1)),
    (Narrow, hats(nodes=3)),
    (Precise, hats(weight=np.float64(1))),
):
    register(kind, 2)
    along.on(kind)(shape)


class Absent(Lazy): ...


updated_velocity.on(Absent)(lambda transfer, v, old, new: (None,) * len(v))


# --- others
class Torn(Dump):
    def write(self):
        raise KeyError("lost")


def forget(hub):
    """Do nothing well."""
    return {}["it"]
