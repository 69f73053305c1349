"""Heat: capacity and heat of nodes, conduction, and the temperature of points.

C_i = sum_p N_ip C_p, C_i T_i = sum_p N_ip C_p (T_p + grad T_p (X_i - x_p)), flow to a node -sum_p
k_p V_p grad T_p grad N_ip. After Sulsky, Zhou & Schreyer 1995 (FLIP); Wallstedt & Guilkey 2007
(gradients at points); Tao et al. 2016, "A generalized interpolation material point method for
coupled thermo-mechanical processes".
"""

from karamelo_py.compiler import fma, real, round_off, where
from karamelo_py.compiler.fields import Field, StepField, pair, scalar, store, vector
from karamelo_py.compiler.lanes import of_present
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.arrays import of_force
from karamelo_py.kernels.equations.fbar import NodalMean
from karamelo_py.points import laws
from karamelo_py.points.frames import inverse_stretch_squared, pulled_back
from karamelo_py.points.kinematics import Line

# Heat flow is stored in the column where a 1D force would be.
HEAT = eq.NodeColumns("sums", lambda kin: 0, pair, lambda kin: of_force(Line()))
FLOW = eq.NodeColumns("sums", HEAT.end, scalar, lambda kin: of_force(Line()) + 1)


class Temperature(StepField):
    pass


class Capacity(StepField):
    pass


class Conductance(StepField):
    """Conductivity times volume of a point."""


class Volume(StepField):
    pass


class Supply(StepField):
    """Heating power that fixes supply to a point."""

    columns = ("gamma",)


class TemperatureShare(StepField):
    """Fraction of the nodal temperature change that a point takes."""


class HeatGradient(Field):
    shape = vector


FIELDS = Temperature, Capacity, Conductance, Volume, Supply, TemperatureShare, HeatGradient
HEATED = Capacity, Temperature, Volume, Supply, TemperatureShare  # in the order of `HeatedPoints`


def at_least_round_off(weight):
    """Return `weight`, or round-off if larger: nodes with only gradients need a temperature."""
    return max(weight, round_off(weight))


@eq.reads("mass", "state", "material", "deformation gradient")
def content(pt):
    """Store and return heat capacity, conductivity times volume, and temperature of a point."""
    (law, state, f), mass, p = pt.law_state_F, pt.w.points.mass[pt.p], pt.p
    volume = mass * laws.specific_volume(law) * laws.jacobian(law, pt.kin, state)
    T = laws.temperature(law, pt.kin, state)
    capacity = mass * laws.heat_capacity(law, pt.dt)
    inverse_square = (
        pt.w.grid.inv_h * pt.w.grid.inv_h * inverse_stretch_squared(pt.w.frame, pt.kin, f, pt.dt)
    )
    most = 1 / (real(4 * pt.kin.dimension, pt.dt) * pt.dt * inverse_square)
    conductance = volume * laws.conductivity_now(law, pt.kin, state, most)
    pt.of(Temperature)[0, p] = T
    pt.of(Capacity)[0, p] = capacity
    pt.of(Conductance)[0, p] = conductance
    pt.of(Volume)[0, p] = volume
    # initial values; fixes change them
    pt.of(Supply)[0, p] = real(0, pt.dt)
    pt.of(TemperatureShare)[0, p] = real(1, pt.dt)
    return of_present(p, capacity), of_present(p, conductance), T


@eq.reads("heat gradient")
def heat_gradient(pt):
    return pt.load(HeatGradient, pt.v)


def temperature_at(pt, node):
    _, _, T = pt.content
    for axis in range(len(pt.gradient)):
        T = fma(pt.gradient[axis], node.arm[axis], T)
    return T


def heat_at(pt, node):
    capacity = at_least_round_off(node.N) * pt.content[0]
    return capacity, capacity * temperature_at(pt, node)


def mean_at(pt, node):
    conductance = at_least_round_off(node.N) * pt.content[1]
    return conductance * temperature_at(pt, node), conductance


class HeatContent(eq.ExtensiveQuantity):
    """Scatters heat capacity, and heat extrapolated by gradients."""

    not_at_corners = ("anything",)
    says = "heat to grid"
    also_reads = ("x",)
    takes = eq.of_point(content=content, gradient=heat_gradient)
    gives = (eq.Sum(HEAT, heat_at), eq.Sum(eq.whole(NodalMean), mean_at))


@eq.reads("state", "material", "deformation gradient", "heat gradient", "conductance")
def flow(pt):
    """Return the heat flow of a point times its volume, (d,)."""
    _, _, f = pt.law_state_F
    against = pulled_back(pt.w.frame, pt.kin, heat_gradient(pt), f)
    return -of_present(pt.p, pt.of(Conductance)[0, pt.p]) * against


@eq.reads()
def supply(pt):
    return of_present(pt.p, pt.of(Supply)[0, pt.p])


def flow_at(pt, node):
    total = at_least_round_off(node.N) * pt.supply
    for axis in range(len(pt.flow)):
        total = fma(pt.flow[axis], node.grad_N[axis], total)
    return (total,)


class HeatFlow(eq.ExtensiveQuantity):
    not_at_corners = ("anything",)
    says = "heat flow"
    takes = eq.of_point(flow=flow, supply=supply)
    gives = (eq.Sum(FLOW, flow_at),)


class TemperatureGradient(eq.Task):
    not_at_corners = ("anything",)
    says = "gradient of temperature"
    reads = ("x",)
    writes = ("heat gradient",)

    def empty(task, w, x):
        return x - x

    def gathered(task, node, total):
        # the gradient of a scalar has no hoop component in axisymmetry
        return total + node.w.nodes.velocity[node.i, 0] * node.grad_N.planar()

    def updated(task, pt, total, totals, fastest):
        store(pt.of(HeatGradient), pt.p, total)
        return eq.Report(real(0, pt.dt), fastest)


class Warming(eq.Task):
    not_at_corners = ("anything",)
    says = "temperature"
    reads = (
        "x", "state", "material", "temperature", "capacity", "conductance", "temperature share",
    )  # fmt: skip
    writes = ("state",)

    def empty(task, w, x):
        zero = x[0] - x[0]
        return zero, zero

    def gathered(task, node, total):
        weight = at_least_round_off(node.N)
        change, mean = total
        mean = fma(weight, node.of(NodalMean)[node.i, 0], mean)
        return fma(weight, node.w.nodes.update[node.i, 1], change), mean

    def updated(task, pt, total, totals, fastest):
        """Store the new temperature; report how much faster heat flows than before deformation."""
        law, state, f = pt.law_state_F
        T, p = pt.of(Temperature)[0, pt.p], pt.p
        capacity = pt.of(Capacity)[0, p]
        some = capacity > 0
        rate = pt.of(Conductance)[0, p] / where(some, capacity, real(1, capacity))
        hidden = (
            real(4 * pt.kin.dimension, pt.dt) * (rate * pt.w.grid.inv_h * pt.w.grid.inv_h) * pt.dt
        )
        change = total[0] + min(hidden, real(1, hidden)) * (total[1] - T)
        T = where(some, fma(pt.of(TemperatureShare)[0, p], change, T), T)
        store(pt.w.points.state, p, laws.with_temperature(law, pt.kin, state, T))
        faster = laws.jacobian(law, pt.kin, state) * inverse_stretch_squared(
            pt.w.frame, pt.kin, f, pt.dt
        )
        return eq.Report(real(0, pt.dt) * T, max(fastest, faster))
