"""F-bar: changes of volume and mean stresses averaged over the surroundings, where a scene asks."""

from typing import NamedTuple

from karamelo_py.compiler.compile import fma, point_function, real
from karamelo_py.compiler.fields import StepField, SummedField, field, pair
from karamelo_py.compiler.tuples import row
from karamelo_py.kernels.visit import deformation_of, law_of, state_of
from karamelo_py.points.basis import entry
from karamelo_py.points.frames import scaled_increment
from karamelo_py.points.transfers import straining


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


@point_function(otherwise=True)
def no_ratio(averaging, like):
    """Return the start of the gather of the averaged volume ratio; () where none is averaged."""
    return ()


@no_ratio.on(FBar)
def _no_ratio_f_bar(averaging, like):
    return (real(0, like),)


@point_function(otherwise=True)
def gathered_ratio(averaging, w, stencil, k, total):
    """`total` with the ratio of volumes at the k-th node."""
    return total


@gathered_ratio.on(FBar)
def _gathered_ratio_f_bar(averaging, w, stencil, k, total):
    i, weight, _ = entry(w.basis, w.kin, w.grid, stencil, k)
    (mean,) = row(field(w.nodes.fields, NodalMean), i, 0, total)
    return (fma(weight, mean, total[0]),)


@point_function(otherwise=True)
def averaged(averaging, w, p, dl, ratio):
    """`dl` with the change of volume that the surroundings have on average."""
    return dl


@averaged.on(FBar)
def _averaged_f_bar(averaging, w, p, dl, ratio):
    # The ratio of volumes of the increment is replaced by its average over the points nearby,
    # weighted with their volumes (after Coombs et al. 2018, "Overcoming volumetric locking in
    # material point methods", eq. 23; there over the points of a cell). In the total frame, `dl`
    # is dt Fdot, and F + dl is scaled.
    law = law_of(w, p)
    state = state_of(w, law, p, ratio[0])
    f = deformation_of(w.frame, w.kin, law, state, w.points, p)
    own = field(w.points.fields, VolumeRatio)[0, p]
    return scaled_increment(w.frame, w.kin, dl, f, ratio[0] / own)


@point_function(otherwise=True)
def kept_out(averaging, w, gradient):
    """The gradient to gather, or nothing where the transfer has it from v* already."""
    return straining(w.transfer, w.kin, gradient)


@kept_out.on(FBar)
def _kept_out_f_bar(averaging, w, gradient):
    return gradient
