"""F-bar: changes of volume and mean stresses averaged over the surroundings, where a scene asks."""

from typing import NamedTuple

from karamelo_py.compiler.compile import fma, real, shared
from karamelo_py.compiler.fields import StepField, SummedField, field, pair
from karamelo_py.compiler.tuples import row
from karamelo_py.kernels.visit import deformed_state
from karamelo_py.points.basis import entry
from karamelo_py.points.frames import scaled_increment


class VolumeRatio(StepField):
    """Ratio of volumes of the trial increment of a point."""

    start = 1.0


class NodalMean(SummedField):
    """Sum of weight times value, and of weights, at a node; then the mean in place of the first.

    Of ratios of volumes, weighted with volumes (F-bar); of temperatures, weighted with conductance.
    """

    shape = pair


class AveragedStress(StepField):
    """Mean stress of a point and its surroundings."""


class NodalStress(SummedField):
    """Sum of weight, volume and mean stress, and of weight and volume; then the mean."""

    shape = NodalMean.shape


class PointByPoint(NamedTuple):
    """Every point has its own change of volume."""

    in_lanes = True


class FBar(NamedTuple):
    """Changes of volume are averaged over the surroundings, against volumetric locking.

    With d_p the rate of volume of a point and V_p its volume, the average is
    sum_i N_ip sum_q N_iq V_q d_q / sum_q N_iq V_q. Weighted with volumes it is its own adjoint: the
    mean stress averaged alike makes the forces whose power is that of the averaged strain.
    """

    in_lanes = True
    point_fields = (VolumeRatio, AveragedStress)
    node_fields = (NodalMean, NodalStress)


@shared
def no_ratio(w, like):
    """Return the start of the gather of the averaged volume ratio; () where none is averaged."""
    return (real(0, like),) if isinstance(w.averaging, FBar) else ()


@shared
def gathered_ratio(w, stencil, k, total):
    """`total` with the ratio of volumes at the k-th node, where it is averaged."""
    if not len(total):
        return total
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    (mean,) = row(field(w.nodes.fields, NodalMean), i, 0, total)
    return (fma(weight, mean, total[0]),)


@shared
def averaged(w, p, dl, ratio):
    """`dl` with the change of volume that the surroundings have on average, where there is one."""
    if not len(ratio):
        return dl
    # The ratio of volumes of the increment is replaced by its average over the points nearby,
    # weighted with their volumes (after Coombs et al. 2018, "Overcoming volumetric locking in
    # material point methods", eq. 23; there over the points of a cell). In the total frame, `dl`
    # is dt Fdot, and F + dl is scaled.
    _, _, f = deformed_state(w, p, ratio[0])
    own = field(w.points.fields, VolumeRatio)[0, p]
    return scaled_increment(w.frame, w.kin, dl, f, ratio[0] / own)
