"""A step on a GPU: thread functions for a point, a cell, a node, or the clock.

A cell consists of the points with the same nodes, and has the number of the first node. Before each
scatter, points are sorted by cell, then by id. A thread per cell sums over points, then a thread
per node sums over cells. No two threads add to the same number, so results are reproducible and
independent of the order in memory. `outcome` (5,) contains errors and extremes.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.compiler import index, real, where
from karamelo_py.compiler.gpu import counted, raise_to
from karamelo_py.compiler.lanes import room_for
from karamelo_py.compiler.tuples import flat, nested_as, record
from karamelo_py.kernels import sweep
from karamelo_py.kernels.arrays import DT, TIME, Nodes
from karamelo_py.kernels.clock import finish, kick, last_step_size, step_size
from karamelo_py.kernels.equations import load_all, node_array, scattered_all, updated_all
from karamelo_py.kernels.equations.node_updates import at_node
from karamelo_py.kernels.lanes import OneByOne
from karamelo_py.kernels.stencils import gathered_by
from karamelo_py.kernels.step import ABOVE_LIMIT, DONE, MOST_ABOVE_LIMIT, SHRUNK, SMALLEST, STOPPED
from karamelo_py.kernels.sums import columns_in_turn
from karamelo_py.kernels.views import PointView, location_at, node_of
from karamelo_py.points.basis import entry, locate, support
from karamelo_py.points.basis.cpdi import of_corner
from karamelo_py.points.basis.product import digits, node_number
from karamelo_py.points.grid import inside

MOVED, RATE, WRONG, STATUS, DRIFT = range(5)  # in `outcome`; STATUS: 0, or 1 + a status of steps
BEHIND = 2.0**53  # above all point ids
CHUNK = 64  # items summed per thread
WARP = 32  # threads that read memory together
REGISTERS = {4: 200, 8: 130}  # numbers that a cell's thread may sum, by bytes of a number
OCCUPIED = 1 << 40  # added to `CellLists.sums` per occupied cell


# Names shown by `karamelo-py bench`.
STAGES = {
    "gather_point": "gather from the nodes, update of points",
    "load_point": "loads of points",
    "scatter_cell": "sums of cells",
    "sum_node": "sums at nodes",
    "visit_node": "updates of nodes",
    "visit_member": "fixes at nodes",
    "visit_point": "fixes at points",
    "visit_each_node": "contact, axis",
    "visit_each_point": "contact, axis",
    **dict.fromkeys(
        ("count_point", "sum_counts", "sum_sums", "sum_before", "place_list", "list_point",
         "sort_cell", "age_node", "mark_nodes"), "lists of points by cell",
    ),
}  # fmt: skip
OTHERS = "clock, reports, totals"


class CellLists(NamedTuple):
    """The n points of a block by cell, for N nodes; corner c of point p has the index c n + p."""

    count: np.ndarray  # (N,) int32: points of each cell not yet listed
    number: np.ndarray  # (n,) int32: cell of each point
    first: np.ndarray  # (N + 1,) int32: cell c has order[first[c]:first[c + 1]]
    box: np.ndarray  # (N + 1,) int32: index of an occupied cell, or -1; then the count
    cell: np.ndarray  # (boxes,) int32
    order: np.ndarray  # (n,) int32
    sums: np.ndarray  # (m,) int64: counts plus OCCUPIED per chunk, level by level
    before: np.ndarray  # (m,) int64: prefix sums
    loads: np.ndarray  # (numbers, n): unweighted loads
    boxes: np.ndarray  # (columns, boxes): sums for some nodes of a cell


def nodes_in_cell(basis: Any, kin: Any) -> int:
    return basis.line_nodes**kin.dimension


@functools.cache  # a single stage for all launches
def while_steps_go_on(function: Callable) -> Callable:
    def go_on(i, outcome, *arguments):
        if outcome[STATUS] == 0:
            function(i, outcome, *arguments)

    for name in ("__name__", "__qualname__", "__module__"):
        setattr(go_on, name, getattr(function, name))
    return go_on


def goes_wrong(outcome, number):
    raise_to(outcome, WRONG, BEHIND - float(number))


def _report(outcome, number, moved, rate, stride):
    if sweep.is_good(stride, moved, rate):
        raise_to(outcome, MOVED, float(moved))
        raise_to(outcome, RATE, float(rate))
    else:
        goes_wrong(outcome, number)


def is_last(s):
    """Return True in the last step, which leaves no sums for a next step."""
    values = s.control.values
    return values[TIME] + values[DT] >= s.control.step[0].end_time


class Stage:
    """A pass over the points, as thread functions.

    `columns` are (array, column, whether it adds) of the node columns that it sums; the nodes of a
    cell are summed in `parts`.
    """

    def __init__(self, row: Any, s: Any):
        basis, kin, quantities = s.basis, s.kin, row.visit.quantities
        self.row, self.at = row, row.at or (lambda s: s)
        present = ["sums", "velocity", *(type(one) for one in self.at(s).nodes.fields)]
        self.lists = isinstance(row.visit.weights, sweep.PresentWeights)  # sorts points by cell
        self.columns = columns_in_turn(quantities, kin, present)
        self.support = nodes_in_cell(basis, kin)
        size = s.nodes.sums.itemsize
        words = size // 4 * len(self.columns) * self.support
        self.parts = max(1, -(-words // REGISTERS[size]))
        self.corners = int(support(basis, kin)) // self.support  # listed per point
        self.scatters = bool((row.scatters or row.only_if_more) and quantities)
        self._point_functions()

    def _point_functions(self) -> None:
        row, at, lists, corners, count = self.row, self.at, self.lists, self.corners, self.support
        tasks, quantities, keeps = row.visit.tasks, row.visit.quantities, self.scatters

        def context(s):
            whole = last_step_size(s) if row.of_last_step else step_size(s)
            dt = whole if row.share == 1 else real(row.share, whole) * whole
            return sweep.context_of(at(s), sweep.Extent(dt, row.gathers, row.scatters, row.moves))

        def point(s, block, p):
            c, points = context(s), block.points
            grid = record(c.grids, index(points.grid[p]))
            locations = sweep.locations_of(c.frame, points, c.now, c.then)
            return c, PointView(sweep.work_of(c, grid, c.nodes, block, locations), (), p, c.dt)

        def location_of(pt):
            w = pt.w
            locations = w.locations.y if lists and w.frame.moves else w.locations.where
            return location_at(w.basis, w.kin, locations, pt.p)

        def keep(pt, cells):
            if keeps:
                for k, number in enumerate(flat(load_all(quantities, pt))):
                    cells.loads[k, pt.p] = number

        def load_of_point(s, block, i):
            return flat(load_all(quantities, point(s, block, index(i))[1]))

        def load_point(i, outcome, s, block, cells):
            keep(point(s, block, index(i))[1], cells)

        def gather_point(i, outcome, s, block, cells):
            c, pt = point(s, block, index(i))
            pt = pt._replace(stencil=sweep.stencil_of(pt.w, pt.p))
            x = sweep.position_of(pt.w, pt.p)
            totals = gathered_by(OneByOne(), tasks, pt.w, pt.stencil, x)
            # Start from zero, as a running maximum would depend on the order of threads.
            moved, rate = updated_all(tasks, pt, totals, real(0, c.dt))
            _report(outcome, block.points.id[pt.p], moved, rate, c.stride)
            keep(pt, cells)

        def count_point(i, outcome, s, block, cells):
            points = block.points
            c, pt = point(s, block, index(i))
            where = location_of(pt)
            is_inside = inside(pt.w.grid, c.kin, where)
            for k in range(corners):
                number = 0  # outside: the run ends
                if is_inside:
                    stencil = locate(c.basis, c.kin, pt.w.grid, where)
                    number = entry(c.basis, c.kin, pt.w.grid, stencil, k * count)[0]
                cells.number[index(k * points.mass.size + i)] = number
                counted(cells.count, number, 1)
            if not is_inside:
                goes_wrong(outcome, points.id[pt.p])

        self._point, self._location = point, location_of
        self.load, self.load_point = load_of_point, load_point
        self.gather, self.count = gather_point, count_point

    def scatter(self, section: int) -> Callable:
        point, location, quantities = self._point, self._location, self.row.visit.quantities
        columns, only_if_more, corners = self.columns, self.row.only_if_more, self.corners
        count, (begin, end) = self.support, self.nodes_of(section)
        filled = tuple(dict.fromkeys(name for name, _, _ in columns))
        widths = tuple(max(c for n, c, _ in columns if n == name) + 1 for name in filled)

        def room_of(name, rooms, otherwise):
            return rooms[filled.index(name)] if name in filled else otherwise

        def nodes_for(nodes, rooms):
            fields = [type(one)(room_of(type(one), rooms, one.array)) for one in nodes.fields]
            sums, velocity = room_of("sums", rooms, nodes.sums), nodes.velocity
            return Nodes(sums, nodes.update, room_of("velocity", rooms, velocity), tuple(fields))

        def scatter_cell(i, outcome, s, block, cells):
            if i >= cells.box[cells.box.size - 1] or (only_if_more and is_last(s)):
                return
            cell = cells.cell[i]
            first, last = cells.first[cell], cells.first[cell + 1]
            size = block.points.mass.size
            p, corner = _point_and_corner(corners, size, cells.order[first])
            c, pt = point(s, block, p)
            rooms = tuple([room_for(width, (c.dt,) * count) for width in widths])
            for name, column, _ in columns:
                for k in range(begin, end):
                    room_of(name, rooms, None)[k, column] = c.dt - c.dt
            out = pt.w._replace(nodes=nodes_for(pt.w.nodes, rooms))
            template = load_all(quantities, pt)  # only its shape is used
            for q in range(first, last):
                behind = cells.order[min(q + 1, last - 1)]  # next point, to be prefetched
                here = pt._replace(p=p)
                stencil = locate(out.basis, out.kin, out.grid, location(here))
                seen = stencil if corners == 1 else of_corner(stencil, corner)
                numbers = tuple([cells.loads[k, p] for k in range(len(flat(template)))])
                for k in range(begin, end):
                    node = node_of(out, seen, k)._replace(i=index(k))  # index within the cell
                    scattered_all(quantities, nested_as(template, numbers), node)
                p, corner = _point_and_corner(corners, size, behind)
            for j, (name, column, _) in enumerate(columns):
                for k in range(begin, end):
                    row = j * (end - begin) + k - begin
                    cells.boxes[row, index(i)] = room_of(name, rooms, None)[k, column]

        return scatter_cell

    @property
    def numbers(self) -> int:
        return len(self.columns) * -(-self.support // self.parts)

    def nodes_of(self, section: int) -> tuple[int, int]:
        count = self.support
        return count * section // self.parts, count * (section + 1) // self.parts

    def sum(self, section: int, anew: bool) -> Callable:
        """Return the function of a node that sums over cells, from zero if `anew`."""
        columns, only_if_more, at = self.columns, self.row.only_if_more, self.at
        begin, end = self.nodes_of(section)

        def sum_node(i, outcome, s, cells, use):
            if use[i] == 0 or (only_if_more and is_last(s)):
                return
            grid = _grid_of(s.grids, i)
            totals = (real(0, s.nodes.sums[0, 0]),) * len(columns)
            for k in range(begin, end):
                cell = i - _steps_to(s, grid, k)
                totals = _with_cell(totals, cells, cell, k - begin, end - begin)
            for (name, column, add), value in zip(columns, totals, strict=True):
                array = node_array(at(s).nodes, name)
                if add or not anew:
                    array[index(i), column] += value
                else:
                    array[index(i), column] = value

        return sum_node

    def age(self) -> Callable:
        """Return the function that lowers a node's mark: 2 in use, 1 to be cleared, 0 unused."""
        only_if_more = self.row.only_if_more

        def age_node(i, outcome, s, use):
            if use[i] > 0 and not (only_if_more and is_last(s)):
                use[i] -= 1

        return age_node

    def mark(self) -> Callable:
        count, only_if_more = self.support, self.row.only_if_more

        def mark_nodes(i, outcome, s, cells, use):
            if i >= cells.box[cells.box.size - 1] or (only_if_more and is_last(s)):
                return
            cell = cells.cell[i]
            grid = _grid_of(s.grids, cell)
            for k in range(count):
                use[index(cell + _steps_to(s, grid, k))] = 2

        return mark_nodes


def _grid_of(grids, n):
    g = 0
    for k in range(1, grids.first.size):
        if grids.first[k] <= n:
            g = k
    return record(grids, index(g))


def _steps_to(s, grid, k):
    return node_number(grid, 0, digits(k, s.basis.line_nodes, s.kin.dimension))


def _with_cell(totals, cells, cell, first, step):
    """Add a cell's sums, from rows `first`, `first` + `step`, ... of its box."""
    box = cells.box[index(max(cell, 0))]
    occupied = (box >= 0) & (cell >= 0)
    at = index(max(box, 0))
    sums = [cells.boxes[j * step + first, at] for j in range(len(totals))]
    return tuple([t + where(occupied, x, t - t) for t, x in zip(totals, sums, strict=True)])


def _weight(number):
    return int(number) + (OCCUPIED if number > 0 else 0)


def sum_counts(i, outcome, cells):
    total = 0
    for c in range(i * CHUNK, min((i + 1) * CHUNK, cells.count.size)):
        total += _weight(cells.count[c])
    cells.sums[i] = total


def sum_sums(i, outcome, cells, level):
    """Sum the `i`-th chunk of a level into the next level (prefix sums by chunks).

    `level`: index of its first sum, number of sums, index of the first sum of the next level.
    """
    begin, count, above = level
    total = 0
    for k in range(i * CHUNK, min((i + 1) * CHUNK, count)):
        total += cells.sums[begin + k]
    cells.sums[above + i] = total


def sum_before(i, outcome, cells, begin, above):
    """Sum the items before item `i` of a level; `above` is the start of the next level, or -1."""
    chunk = i // CHUNK
    total = cells.before[above + chunk] if above >= 0 else 0
    for k in range(chunk * CHUNK, i):
        total += cells.sums[begin + k]
    cells.before[begin + i] = total


def place_list(i, outcome, cells):
    chunk = i // CHUNK
    total = cells.before[chunk]
    for c in range(chunk * CHUNK, i):
        total += _weight(cells.count[c])
    first, count, box = total % OCCUPIED, cells.count[i], total // OCCUPIED
    cells.first[i] = first
    cells.box[i] = box if count > 0 else -1
    if count > 0:
        cells.cell[box] = i
    if i + 1 == cells.count.size:
        cells.first[i + 1] = first + count
        cells.box[i + 1] = box + (1 if count > 0 else 0)


def list_point(i, outcome, cells):
    c = cells.number[i]
    cells.order[cells.first[c] + counted(cells.count, c, -1) - 1] = i


def _point_and_corner(corners, count, listed):
    return (index(listed), 0) if corners == 1 else (index(listed % count), listed // count)


def sort_cell(corners: int) -> Callable:
    def key(ids, listed):
        p, corner = _point_and_corner(corners, ids.size, listed)
        return ids[p] * corners + corner

    def sort_cell(i, outcome, ids, cells):
        if i >= cells.box[cells.box.size - 1]:
            return
        c = cells.cell[i]
        first, last = cells.first[c], cells.first[c + 1]
        for q in range(first + 1, last):
            p = cells.order[q]
            this_key = key(ids, p)
            at = q
            while at > first and key(ids, cells.order[at - 1]) > this_key:
                cells.order[at] = cells.order[at - 1]
                at -= 1
            cells.order[at] = p

    return sort_cell


# Threads of a warp have adjacent cells, so the first points of these cells should be adjacent in
# memory, then the second points, and so on.


def order_cell(i, outcome, cells, come_from):
    boxes = cells.box[cells.box.size - 1]
    if i >= boxes:
        return
    cell = cells.cell[i]
    first, last = cells.first[cell], cells.first[cell + 1]
    begin = i // WARP * WARP
    start = cells.first[cells.cell[begin]]
    for q in range(last - first):
        at = start
        for k in range(begin, min(begin + WARP, boxes)):
            c = cells.cell[k]
            count = cells.first[c + 1] - cells.first[c]
            at += min(count, q)
            if k < i and count > q:
                at += 1
        come_from[at] = cells.order[first + q]
        cells.order[first + q] = at


def take_rows(i, outcome, rows, come_from, room):
    p = index(come_from[i])
    for k in range(rows.shape[0]):
        room[k, i] = rows[k, p]


def put_rows(i, outcome, rows, room):
    for k in range(rows.shape[0]):
        rows[k, i] = room[k, i]


def of_nodes(row: Any) -> Callable:
    task, at, length = row.task, row.at or (lambda s: s), row.length or kick
    made = row.make or (lambda s: task)

    def visit_node(i, outcome, s, use):
        if use[i] > 0:
            here = at(s)
            at_node(made(s), here.kin, here.nodes, index(i), length(s))

    return visit_node


def clear(i, outcome, array, first):
    array[first + i] = 0


def take_reports(take: Callable) -> Callable:

    def take_all_reports(i, outcome, s):
        motion = s.control.motion[0]
        motion.new_move, motion.new_rate = outcome[MOVED], outcome[RATE]
        take(s.control)
        outcome[MOVED] = 0.0
        outcome[RATE] = 0.0
        if outcome[WRONG] > 0:
            motion.wrong = 1
            outcome[STATUS] = 1.0 + STOPPED

    return take_all_reports


def finish_step(i, outcome, s):
    outcome[DRIFT] += s.control.motion[0].move
    finish(s.control)


def end_step(i, outcome, s):
    step = s.control.step[0]
    if step.watch_limit > 0 and step.over_limit >= MOST_ABOVE_LIMIT:
        outcome[STATUS] = 1.0 + ABOVE_LIMIT
    elif step.limit < SMALLEST * step.first_limit:
        outcome[STATUS] = 1.0 + SHRUNK
    elif s.control.values[TIME] >= step.end_time:
        outcome[STATUS] = 1.0 + DONE
