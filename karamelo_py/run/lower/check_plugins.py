"""Parts of plug-ins are tried on one point, in plain Python, before loops are compiled with them.

What is missing, or of the wrong length, so ends in a message about the part, not about a loop.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from karamelo_py.compiler.tuples import flat, record
from karamelo_py.kernels.laws import law_in, law_on
from karamelo_py.kernels.visit import place_at
from karamelo_py.language.faults import fault
from karamelo_py.points import laws
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.basis.product import Along, along
from karamelo_py.points.kinematics import tensor, vector
from karamelo_py.points.transfers import updated_velocity
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import PartInUse, attributed, foreign_parts, is_foreign

TENSORS = (laws.cauchy_stress, laws.kirchhoff_stress, laws.elastic_strain)
NUMBERS = (laws.jacobian, laws.wave_speed_squared, laws.energy_density)


def try_parts(hub: Hub, setup: Any) -> None:
    """Try the laws, the basis and the transfer of a scene that plug-ins brought."""
    for solid in hub.solids.values():
        if any(is_foreign(kind) for kind in laws.law_kind(solid.material.law)):
            _try_law(hub, setup, solid)
    if is_foreign(type(setup.basis)):
        _try_basis(hub, setup)
    if is_foreign(type(setup.transfer)):
        part = _part_of(hub, [type(setup.transfer)])
        v = vector(setup.kin, (_one(setup),) * setup.kin.dimension)
        with _trial(hub, part):
            _expect(part, updated_velocity, updated_velocity(setup.transfer, v, v, v), len(v))


def _part_of(hub: Hub, kinds: Iterable[type]) -> PartInUse | None:
    """Find the part of a plug-in that is of one of these classes."""
    return next((part for part in foreign_parts(hub) if part.kind in kinds), None)


def _one(setup: Any) -> Any:
    return setup.nodes.sums.dtype.type(1)


@contextmanager
def _trial(hub: Hub, part: PartInUse) -> Iterator[None]:
    """Tell of faults; numbers that one point happens not to stand are not what this is about."""
    with attributed(hub, part), np.errstate(all="ignore"):
        try:
            yield
        except ArithmeticError:
            return
        except ValueError as error:
            if str(error) != "math domain error":  # what is returned has another shape
                raise


def _expect(part: PartInUse, function: Any, given: Any, count: int) -> None:
    got = len(given) if isinstance(given, tuple) else type(given).__name__
    if got != count:
        what = f"{function.__name__} has to return a tuple of {count}, not {got}"
        raise fault(part.name, what, part.place)


def _try_law(hub: Hub, setup: Any, solid: Any) -> None:
    material, kinds = solid.material, laws.law_kind(solid.material.law)
    usual = PartInUse(f"material {material.style}", kinds[0], material.place)
    part = _part_of(hub, kinds) or usual
    kin, one = setup.kin, _one(setup)
    law = law_in(law_on(solid.material.law, solid.h, solid.T0), type(one))
    size = len(kin.Symmetric.places)
    for strain in (0, 1e-3):
        dl = (type(one)(strain),) * kin.tensor_size
        with _trial(hub, part):
            state = laws.initial_state(law, kin, one)
            after = laws.advance(law, kin, state, tensor(kin, dl), one)
            if len(flat(after)) != len(flat(state)):
                what = f"what a point remembers is {len(flat(state))} numbers at first and "
                what += f"{len(flat(after))} after a step: their number must not change"
                raise fault(part.name, what, part.place)
            for function in TENSORS:
                found = function(law, kin, after)
                _expect(part, function, found, size)
                if not isinstance(found, kin.Symmetric):
                    what = f"{function.__name__} has to return a symmetric tensor, not a tuple"
                    raise fault(part.name, what, part.place)
            for function in NUMBERS:
                function(law, kin, after)
            laws.specific_volume(law)


def _try_basis(hub: Hub, setup: Any) -> None:
    basis, kin, points = setup.basis, setup.kin, setup.blocks[0].points
    if not len(points.id):
        return
    part = _part_of(hub, [type(basis)])
    grid = record(setup.grids, points.grid[0])
    with _trial(hub, part):
        where = points.x[0] if points.home is None else points.home
        at = place_at(basis, kin, where, 0)
        line = along(basis, kin, grid, at, 0) if along.defined(type(basis)) else None
        if line is not None and not set(Along._fields) <= set(getattr(line, "_fields", ())):
            raise fault(part.name, "along has to return an Along", part.place)
        stencil = locate(basis, kin, grid, at)
        for k in range(support(basis, kin)):
            entry(basis, kin, grid, stencil, k)
