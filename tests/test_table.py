"""A scheme's table: what shares a visit, and what does not."""

import pytest

from karamelo_py.kernels.equations.internal_force import InternalForce
from karamelo_py.kernels.equations.mass_momentum import MassMomentum
from karamelo_py.kernels.equations.move import Move
from karamelo_py.kernels.equations.node_updates import NodalUpdate
from karamelo_py.kernels.equations.strain import (
    SecondStrain,
    Strain,
    StrainInMove,
    StrainOfLastStep,
)
from karamelo_py.kernels.sweep import OldWeights, PresentWeights
from karamelo_py.kernels.table import (
    FORCE,
    MASS_AND_MOMENTUM,
    SUMS,
    Gather,
    NodeTask,
    Sweep,
    fused,
    staged,
)
from karamelo_py.schemes.musl import MUSL
from karamelo_py.schemes.usavg import USAVG
from karamelo_py.schemes.usf import USF
from karamelo_py.schemes.usl import USL


def sweeps(rows):
    return [row for row in rows if isinstance(row, Sweep)]


def kinds(sweep):
    return [type(tag) for tag in (*sweep.visit.tasks, *sweep.visit.quantities)]


def test_usl_visits_the_points_once():
    """Sulsky, Chen & Schreyer 1994: all that points do follows from one nodal velocity."""
    (only,) = sweeps(fused(USL.rows))
    assert kinds(only) == [Move, StrainInMove, MassMomentum, InternalForce]
    assert only.only_if_more


def test_musl_visits_them_twice_and_stages_are_parts_of_these():
    visits = [sweep.visit for sweep in sweeps(fused(MUSL.rows))]
    assert len(visits) == 2
    assert all(sweep.visit in visits for sweep in sweeps(staged(MUSL.rows)))


def test_parts_of_a_step_of_other_lengths_do_not_share_a_visit():
    first, second = sweeps(
        fused((SUMS, NodeTask(NodalUpdate()), Gather(Move()), Gather(Strain(), 0.5)))
    )
    assert (kinds(first), first.share) == ([Move], 1.0)
    assert (second.share, second.scatters) == (0.5, True)
    assert type(second.visit.tasks[0]) is Strain


@pytest.mark.parametrize("rows_of", [fused, staged])
def test_velocities_of_the_last_step_are_of_the_places_after_it(rows_of):
    """Of both visits of usavg that strain, and of the one of usf, the first alone."""
    for scheme, expected in (USF, [StrainOfLastStep]), (USAVG, [StrainOfLastStep, SecondStrain]):
        found = [sweep for sweep in sweeps(rows_of(scheme.rows)) if sweep.gathers]
        strains = [kind for sweep in found for kind in kinds(sweep) if "Strain" in kind.__name__]
        assert strains == expected
        assert [sweep.of_last_step for sweep in found if StrainOfLastStep in kinds(sweep)] == [True]


def test_a_scatter_may_stand_alone():
    """Force apart from mass, and a step that ends at the nodes."""
    rows = (
        MASS_AND_MOMENTUM,
        FORCE,
        NodeTask(NodalUpdate()),
        Gather(Move()),
        NodeTask(NodalUpdate()),
    )
    force, move, sums = sweeps(fused(rows))
    assert (force.gathers, force.scatters, force.moves) == (False, True, False)
    assert (move.gathers, move.scatters) == (True, False)
    assert (sums.gathers, sums.scatters, sums.only_if_more) == (False, True, True)
    assert [type(s.visit.weights) for s in sweeps(staged(rows))[:2]] == [PresentWeights, OldWeights]
