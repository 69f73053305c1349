"""F-bar: volume changes averaged over neighbouring points.

The volume ratio J_p of an increment becomes the average over the nodes of Jbar_i = sum_q N_iq V_q
J_q / sum_q N_iq V_q (after Coombs et al. 2018, "Overcoming volumetric locking in material point
methods", eq. 23, who average over a cell).
"""

from typing import NamedTuple

from karamelo_py.compiler import fma, real
from karamelo_py.compiler.fields import Field, StepField, SummedField, field, pair
from karamelo_py.kernels import equations as eq
from karamelo_py.kernels.equations.node_updates import node_task
from karamelo_py.kernels.records import row
from karamelo_py.points import laws
from karamelo_py.points.frames import force_stress, scaled_increment
from karamelo_py.points.kinematics import I, nothing


class VolumeRatio(StepField):
    start = 1.0


class VolumeCorrection(StepField):
    """Relative volume that another equation adds to the strain of this step."""


class NodalMean(SummedField):
    """Sums of weighted values and of weights at a node; later their ratio, the mean."""

    shape = pair


class AveragedStress(StepField):
    pass


class PressureBeside(Field):
    """Averaged pressure minus the point's pressure, as used in the last forces."""


class NodalStress(SummedField):
    """Nodal sums of N V times mean stress and of N V, then the mean."""

    shape = NodalMean.shape


class PointByPoint(NamedTuple):
    in_lanes = True


class FBar(NamedTuple):
    """Averages volume changes, to avoid volumetric locking.

    Volume rates d_p become sum_i N_ip sum_q N_iq V_q d_q / sum_q N_iq V_q. This map is
    self-adjoint: if the mean stress is averaged in the same way, the power of nodal forces is the
    power of the averaged strain.
    """

    in_lanes = True
    point_fields = (VolumeRatio, AveragedStress)
    node_fields = (NodalMean, NodalStress)


class FBarOfSoil(FBar):
    """F-bar for laws whose yield surface uses part of the averaged pressure.

    With the pressure of the point only, soil that dilates less than in associated flow would lose
    strength in stripes
    (:func:`~karamelo_py.points.laws.strengths.frictional.fraction_by_dilatancy`).
    """

    point_fields = (*FBar.point_fields, PressureBeside)


@eq.reads("mass", "state", "material", "volume ratio")
def volumes(pt):
    """Return the volume after and before the trial increment."""
    law, state = pt.law_and_state
    volume = eq.mass(pt) * laws.specific_volume(law) * laws.jacobian(law, pt.kin, state)
    return volume * pt.of(VolumeRatio)[0, pt.p], volume


class Volumes(eq.ExtensiveQuantity):
    says = "volumes to grid"
    takes = eq.of_point(volumes=volumes)
    gives = (eq.Sum(eq.whole(NodalMean), lambda pt, node: tuple([node.N * V for V in pt.volumes])),)


@eq.reads()
def mean_stress(pt):
    """Return volume times mean Kirchhoff stress, and present volume; () without F-bar."""
    if not isinstance(pt.w.averaging, FBar):
        return ()
    law, state = pt.law_and_state
    volume = eq.mass(pt) * laws.specific_volume(law)
    tau = laws.kirchhoff_stress(law, pt.kin, state).mean_of_stretching()
    return volume * tau, volume * laws.jacobian(law, pt.kin, state)


@eq.reads("mass", "state", "material", "deformation gradient", "averaged stress")
def minus_V_stress_beside(pt):
    """Return -V times (averaged mean stress minus the point's), a tensor."""
    _, _, f = pt.law_state_F
    V_tau, present = mean_stress(pt)
    change = present * pt.of(AveragedStress)[0, pt.p] - V_tau
    return force_stress(pt.w.frame, pt.kin, nothing(pt.kin) - change * I, f)


class AveragedForce(eq.ExtensiveQuantity):
    not_at_corners = ("moments",)
    says = "internal force of the averaged mean stress"
    adds = True
    takes = eq.of_point(minus_V_stress=minus_V_stress_beside)
    gives = (eq.Sum(eq.FORCE, lambda pt, node: pt.minus_V_stress.dot(node.strain_N)),)


class SetMeanStress(eq.Task):
    says = "averaged mean stress"
    reads = ("x", "state", "material")
    writes = ("averaged stress", "pressure beside")

    def empty(task, w, x):
        return real(0, x[0])

    def gathered(task, node, total):
        return fma(node.N, row(node.of(NodalStress), node.i, 0, (total,))[0], total)

    def updated(task, pt, total, totals, fastest):
        pt.of(AveragedStress)[0, pt.p] = total
        beside = pt.of(PressureBeside)
        if beside is not None:
            law, state = pt.law_and_state
            mean = laws.cauchy_stress(law, pt.kin, state).mean_of_stretching()
            beside[0, pt.p] = mean - total
        return eq.Report(real(0, pt.dt), fastest)


def no_ratio(w, template):
    return (real(0, template),) if isinstance(w.averaging, FBar) else ()


def gathered_ratio(node, total):
    if not len(total):
        return total
    (mean,) = row(node.of(NodalMean), node.i, 0, total)
    return (fma(node.N, mean, total[0]),)


def averaged(pt, dl, ratio):
    """Scale `dl` to the averaged volume change; in the total frame, scale F + dl."""
    if not len(ratio) or laws.is_rigid(pt.w.laws):
        return dl
    _, _, f = pt.law_state_F
    trial = pt.of(VolumeRatio)[0, pt.p]
    return scaled_increment(pt.w.frame, pt.kin, dl, f, ratio[0] / trial)


def corrected(pt, dl, f):
    """Scale `dl` by a point's `VolumeCorrection`, if there is one."""
    for more in pt.load(VolumeCorrection, (pt.dt,)):
        per_axis = more / len(dl.axes)
        dl = (1 + per_axis) * dl + per_axis * (I if pt.w.frame.moves else f)
    return dl


@node_task
class TakeMean(NamedTuple):
    of = NodalMean
    goes_through = ("nodal mean", "nodal mean")

    def at_node(task, kin, nodes, n, dt):
        sums = field(nodes.fields, task.of)
        if sums[n, 1] > 0:
            sums[n, 0] /= sums[n, 1]


class TakeMeanStress(TakeMean):
    of = NodalStress
    goes_through = ("nodal stress", "nodal stress")
