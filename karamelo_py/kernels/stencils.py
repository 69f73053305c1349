"""Gather from the nodes of a stencil and scatter to them: node by node, or all at once.

All at once go sums along the arms of a stencil, what is affine, and the corners of domains.
"""

from karamelo_py.compiler.compile import (
    all_lanes,
    point_function,
    prefetch_records,
    shared,
)
from karamelo_py.compiler.lanes import EightLanes, FourLanes
from karamelo_py.kernels.affine import (
    affine_parts,
    gathered_at_once_all,
    gathered_by_arms,
    give_affine,
)
from karamelo_py.kernels.arrays import Tag
from karamelo_py.kernels.corners import (
    all_by_corners,
    gather_corners,
    in_block,
    scatter_corners,
    shows_corners,
)
from karamelo_py.kernels.g2p import empty_all, gathered_all
from karamelo_py.kernels.lanes import OneByOne
from karamelo_py.kernels.p2g import scattered_all
from karamelo_py.kernels.visit import Work, all_records_of
from karamelo_py.points.basis import entry, support
from karamelo_py.points.basis.cpdi import CornerStencil
from karamelo_py.points.basis.cpdi.block import block_of, is_one_block, is_whole, of_one
from karamelo_py.points.basis.product import Stencil, evenly, sees_same_nodes, with_one_node


@shared
def _gather(tasks, w, stencil, totals):
    for k in range(support(w.basis, w.kin)):
        totals = gathered_all(tasks, w, stencil, k, totals)
    return totals


@shared
def _scatter(quantities, w, stencil, loads):
    for k in range(support(w.basis, w.kin)):
        scattered_all(quantities, w, stencil, k, loads)


@shared
def _even(w, stencil, asked):
    """Return True if D^-1 is the same for all points in lanes, or nothing depends on it."""
    return all_lanes(evenly(w.basis, w.grid, stencil)) if asked else True


@point_function(tags=2, otherwise=True)
def gather_nodes(lanes: Tag, stencil: tuple, tasks: tuple, w: Work, totals: tuple) -> tuple:
    """Add the parts of all nodes of the stencil to the totals of the tasks."""
    return _gather(tasks, w, stencil, totals)


@gather_nodes.on(OneByOne, Stencil)
def _gather_nodes_one_by_one_stencil(lanes, stencil, tasks, w, totals):
    if not _even(w, stencil, len(gathered_by_arms(w))):
        return _gather(tasks, w, stencil, totals)
    return _gather_parts(tasks, w, stencil, totals)


@gather_nodes.on(FourLanes, Stencil)
@gather_nodes.on(EightLanes, Stencil)
def _gather_nodes_lanes_stencil(lanes, stencil, tasks, w, totals):
    if not _even(w, stencil, len(gathered_by_arms(w))):
        return _gather(tasks, w, stencil, totals)
    # Sorted points mostly see the same nodes: their records are loaded once for all lanes.
    if sees_same_nodes(stencil):
        return _gather_parts(tasks, w, with_one_node(stencil), totals)
    _ask_ahead(tasks, w, stencil)
    return _gather_parts(tasks, w, stencil, totals)


@gather_nodes.on(OneByOne, CornerStencil)
def _gather_nodes_one_by_one_corner_stencil(lanes, stencil, tasks, w, totals):
    if all_by_corners(tasks, w):
        return gather_corners(tasks, w, stencil, totals)
    return _gather(tasks, w, stencil, totals)


@gather_nodes.on(FourLanes, CornerStencil)
@gather_nodes.on(EightLanes, CornerStencil)
def _gather_nodes_lanes_corner_stencil(lanes, stencil, tasks, w, totals):
    by_corners = all_by_corners(tasks, w)
    if by_corners and shows_corners(tasks, w):
        return gather_corners(tasks, w, stencil, totals)
    block = block_of(w.kin, w.grid, stencil)
    if is_one_block(block):
        return _gather(tasks, in_block(w), of_one(block), totals)
    if by_corners:
        return gather_corners(tasks, w, stencil, totals)
    return _gather(tasks, w, stencil, totals)


@shared
def _ask_ahead(tags, w, stencil):
    """Ask the memory for records of nodes behind the last of a stencil: the others were seen."""
    last = entry(w.basis, w.kin, w.grid, stencil, support(w.basis, w.kin) - 1)[0]
    for array in all_records_of(tags, w.nodes):
        if array is not None:
            prefetch_records(array, last)


@shared
def _gather_parts(tasks, w, stencil, totals):
    """Gather affine parts from all nodes at once, the rest node by node."""
    found = gathered_at_once_all(tasks, w, stencil, totals)
    rest = [k for k, total in enumerate(found) if not len(total)]
    own = _gather(tuple([tasks[k] for k in rest]), w, stencil, tuple([totals[k] for k in rest]))
    return tuple([own[rest.index(k)] if k in rest else total for k, total in enumerate(found)])


@point_function(tags=2, otherwise=True)
def scatter_nodes(lanes: Tag, stencil: tuple, quantities: tuple, w: Work, loads: tuple) -> None:
    """Scatter the loads of the quantities to all nodes of the stencil."""
    _scatter(quantities, w, stencil, loads)


@scatter_nodes.on(FourLanes, Stencil)
@scatter_nodes.on(EightLanes, Stencil)
def _scatter_nodes_lanes_stencil(lanes, stencil, quantities, w, loads):
    parts = affine_parts(quantities, w, stencil, loads)
    if not _even(w, stencil, any(len(part) and len(part[-1]) for part in parts)):
        _scatter(quantities, w, stencil, loads)
    elif sees_same_nodes(stencil):
        _scatter_parts(lanes, quantities, w, with_one_node(stencil), loads, parts)
    else:
        _ask_ahead(quantities, w, stencil)
        _scatter_parts(lanes, quantities, w, stencil, loads, parts)


@scatter_nodes.on(OneByOne, CornerStencil)
def _scatter_nodes_one_by_one_corner_stencil(lanes, stencil, quantities, w, loads):
    if all_by_corners(quantities, w):
        scatter_corners(quantities, w, stencil, loads)
    else:
        _scatter(quantities, w, stencil, loads)


@scatter_nodes.on(FourLanes, CornerStencil)
@scatter_nodes.on(EightLanes, CornerStencil)
def _scatter_nodes_lanes_corner_stencil(lanes, stencil, quantities, w, loads):
    block = block_of(w.kin, w.grid, stencil)
    if is_one_block(block):
        _scatter_block(lanes, quantities, w, of_one(block), loads)
    elif is_whole(block):
        _scatter_block(lanes, quantities, w, block, loads)
    elif all_by_corners(quantities, w):
        scatter_corners(quantities, w, stencil, loads)
    else:
        _scatter(quantities, w, stencil, loads)


@shared
def _scatter_block(lanes, quantities, w, block, loads):
    at = in_block(w)
    _scatter_parts(lanes, quantities, at, block, loads, affine_parts(quantities, at, block, loads))


@shared
def _scatter_parts(lanes, quantities, w, stencil, loads, parts):
    """Scatter affine parts to all nodes at once, the rest node by node."""
    known = tuple([part for part in parts if len(part)])
    if len(known):
        give_affine(lanes, w, stencil, known)
    rest = [k for k, part in enumerate(parts) if not len(part)]
    if len(rest):
        _scatter(tuple([quantities[k] for k in rest]), w, stencil, tuple([loads[k] for k in rest]))


@shared
def gathered_by(lanes: Tag, tasks: tuple, w: Work, stencil: tuple, x: tuple) -> tuple:
    """Gather the totals of the tasks over the nodes of a stencil."""
    return gather_nodes(lanes, stencil, tasks, w, empty_all(tasks, w, x))
