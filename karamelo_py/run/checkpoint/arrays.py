"""The state of a simulation as named arrays: to return to, to write, to read."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.compiler.fields import as_rows_of_points, is_kept, name_of, rows_of_points
from karamelo_py.compiler.tuples import flat
from karamelo_py.kernels.arrays import Nodes, Points, Tiling, arrays_of
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.totals import WORK, carry
from karamelo_py.output.fields import PIECE
from karamelo_py.run.boxes import numbers, used
from karamelo_py.run.mpi.partition import by_tile, join_tilings, share_of_tiling, stripped, work_of
from karamelo_py.run.tiles import SHARES, Tiles, in_use
from karamelo_py.script.errors import ScriptError

ALL_HAVE, EACH_HAS = ("clock", "work", "values"), ("touched/", "kept/")

# Name and shape of an array, where in it something belongs, and that.
Stored = tuple[str, tuple[int, ...], Any, np.ndarray]


def changing(simulation: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield every array, as far as it is in use, that a step changes and the next one needs."""
    s = simulation.setup
    for k, block in enumerate(s.blocks):
        for name, rows in in_use(block.tiling):
            yield f"tiling/{k}/{name}", getattr(block.tiling, name)[:rows]
    yield from simulation.domain.state().items()
    yield "clock", s.control.clock
    yield "work", s.control.totals[WORK]
    for name, array in kept_at_nodes(s):
        yield f"kept/{name}", array
    for k, block in enumerate(s.blocks):
        now = s.control.clock[0].now  # known once the clock is put back
        for name, array in arrays_of(block.points):
            # The other places belong to the step before, and to no failed step.
            yield f"points/{k}/{name}", array[now] if name == "x" else array


def copied(simulation: Any, before: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Copy the state and the published values, reusing the arrays of `before`."""
    found = {}
    # One array after another: where points have come or gone none is there twice.
    for name, array in (*changing(simulation), ("values", simulation.setup.control.values)):
        copy = before.pop(name, None)
        if copy is None or copy.shape != array.shape or copy.dtype != array.dtype:
            del copy
            copy = np.empty_like(array)
        copy[...] = array
        found[name] = copy
    return found | touched(simulation)


def touched(simulation: Any) -> dict[str, np.ndarray]:
    """List the nodes where contact acted lately, and what it remembers of them.

    Liquids may return to nodes that are not in use now. Processes list the nodes in use.
    """
    spans = used(simulation.setup.spans)[1:]
    if not remembered_at(simulation, spans[:1]):
        return {}
    steps = simulation.setup.contact.memory.max()
    if steps > 1 and not simulation.domain.parted:
        begin = np.arange(0, simulation.hub.fields.node_count, PIECE)
        spans = np.stack([begin, begin + PIECE], axis=1)
    found = []
    for first, rows in zip(spans[:, 0], remembered_at(simulation, spans), strict=True):
        recent = (rows != 0) & (np.abs(rows) > simulation.step - steps)
        there = np.flatnonzero(recent.any(axis=1))
        found.append((first + there, np.where(recent[there], rows[there], 0)))
    nodes, rows = (np.concatenate(parts) for parts in zip(*found, strict=True))
    if simulation.domain.parted:
        counted = np.isin(nodes, simulation.nodes.counted())
        nodes, rows = nodes[counted], rows[counted]
    return {"touched/nodes": nodes, "touched/rows": rows}


def stored(simulation: Any, kept: dict[str, np.ndarray] | None = None) -> Iterator[Stored]:
    """Yield the content of a restart file for the present state, or for the `kept` one.

    Collective; the first process gets the arrays, with the bits and in the order of a serial run.
    """
    if not kept:
        simulation.bring()
        simulation.domain.share_kept()
    state = kept or dict(changing(simulation)) | touched(simulation)
    yield from in_file(state) if simulation.comm.size == 1 else _joined(simulation, state)
    if kept:
        return
    yield from wholes(known(simulation))
    yield from _shown_by_nodes(simulation)


def _shown_by_nodes(simulation: Any) -> Iterator[Stored]:
    """Yield the nodes with nonzero values, by number, and their rows, in pieces."""
    comm, own = simulation.comm, simulation.nodes.counted()
    found = np.zeros(len(own), np.bool_)
    for _, array in of_nodes(simulation.setup):
        for first in range(0, len(own), PIECE):  # no copy of all of them
            some = slice(first, first + PIECE)
            found[some] |= array[own[some]].any(axis=1)
    numbers = comm.gather(own[found])
    if numbers is not None:
        numbers = np.sort(np.concatenate(numbers))
        yield from wholes({"node numbers": numbers})
    total = comm.bcast(numbers is not None and len(numbers))
    for first in range(0, total, PIECE):
        where = slice(first, min(first + PIECE, total))
        nodes = comm.bcast(numbers is not None and numbers[where])
        for name, array in (rows_at(simulation, nodes, comm.gather) or {}).items():
            yield name, (total, *array.shape[1:]), where, array + 0


def in_file(state: dict[str, np.ndarray]) -> Iterator[Stored]:
    """Yield a state as files hold it; the digits of exact sums are normalised."""
    work = state["work"].copy()
    carry(work)
    yield from wholes(state | {"clock": state["clock"].view(np.ndarray), "work": work})


def wholes(arrays: Mapping[str, np.ndarray]) -> Iterator[Stored]:
    for name, array in arrays.items():
        yield name, array.shape, ..., array


def known(simulation: Any) -> dict[str, np.ndarray]:
    return {"present": simulation.present, "shown": np.array(simulation.flags)}


class InFile:
    def __init__(self, data: Any):
        self._data = data
        self.shape, self.dtype, self.size = data.shape, data.dtype, data.size

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, where: Any) -> Any:
        with reading():
            return self._data[where]

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        # At once, where NumPy would ask for one number after the other.
        return np.asarray(self[()], dtype)


@contextmanager
def opened(path: Path, group: str = "state") -> Iterator[dict[str, InFile]]:
    import h5py

    found: dict[str, InFile] = {}

    def note(name: str, item: Any) -> None:
        if hasattr(item, "shape"):
            found[name] = InFile(item)

    with reading():
        root = h5py.File(path, "r", locking=False)
    with root:
        with reading():
            try:
                root[group].visititems(note)
            except (RuntimeError, KeyError, ValueError) as error:
                raise OSError(str(error)) from error
        yield found


@contextmanager
def reading() -> Iterator[None]:
    """Convert errors of HDF5 within the block to an error about a damaged file."""
    try:
        yield
    except OSError as error:
        raise ScriptError(
            f"the file is damaged: {error}",
            hint="an earlier file, or the script from its beginning, without a file",
        ) from error


def restore(simulation: Any, state: Mapping[str, Any]) -> None:
    s = simulation.setup
    # Nodes that were not in use then have to be empty, as they were.
    simulation.tiles.empty_nodes(s)
    blocks = []
    for k, block in enumerate(s.blocks):
        stem = f"points/{k}/"
        points, tiling = block.points, take_tiling(block.tiling, state, f"tiling/{k}/")
        if points.mass.size != state[stem + "mass"].size:
            own = {name: np.array(state[name]) for name in state if name.startswith(stem)}
            points = take_points(points, own, stem)
        blocks.append(block._replace(points=points, tiling=tiling))
    s = simulation.setup = s._replace(blocks=tuple(blocks))
    simulation.tiles.lay_out(s)
    for name, array in changing(simulation):
        # The lay-out has put the tiles first that other processes wait for.
        if not name.startswith("tiling/"):
            array[...] = _checked(state, name, array)
    for block in s.blocks:
        block.points.x[:] = block.points.x[s.control.clock[0].now]
    if "values" in state:
        s.control.values[:] = state["values"]
    for memory in remembered_at(simulation, np.array([[0, simulation.hub.fields.node_count]])):
        memory[memory != 0] = 0
        if "touched/nodes" in state:  # a process that has no points has no nodes in use, either
            memory[state["touched/nodes"][()]] = state["touched/rows"]
    simulation.changed()


def take_snapshot(simulation: Any, path: Path) -> dict[str, np.ndarray]:
    with opened(path, "good") as found:
        check_numbers(simulation, found)
        if simulation.domain.parted:
            return dict(simulation.domain.own_part(found))
        # In the order in which copies are made, and written.
        names = [*(name for name, _ in changing(simulation)), "values", *found]
        return {name: found[name][()] for name in dict.fromkeys(names)}


def take_stored(simulation: Any, path: Path) -> None:
    with opened(path) as state, simulation.comm.joint():
        # Nothing of the arrays changes where the file is of another scene.
        for k, block in enumerate(simulation.setup.blocks):
            check_points(block.points, state, f"points/{k}/")
        check_numbers(simulation, state)
        restore(simulation, simulation.domain.own_part(state))
        simulation.present[:] = _checked(state, "present", simulation.present)
        flags = _checked(state, "shown", np.array(simulation.flags))
        simulation.flags = tuple(map(bool, flags))
        _take_nodes(simulation, state)


def _take_nodes(simulation: Any, state: Mapping[str, Any]) -> None:
    own = numbers(simulation.setup.spans)
    used = np.zeros(simulation.hub.fields.node_count, np.bool_)
    used[own] = True
    nodes = state["node numbers"][()] if "node numbers" in state else own[:0]
    for name, array in of_nodes(simulation.setup):
        array[own] = 0
        like = np.broadcast_to(array[:1], (len(nodes), *array.shape[1:]))
        if len(nodes):
            _checked(state, name, like, read=False)
        for first in range(0, len(nodes), PIECE):
            some = nodes[first : first + PIECE]
            here = used[some]
            array[some[here]] = state[name][first : first + PIECE][here]


def of_nodes(s: Any) -> Iterator[tuple[str, np.ndarray]]:
    for kind, nodes in (
        ("nodes", s.nodes),
        ("heat", s.heat.nodes if isinstance(s.heat, Conducting) else None),
    ):
        if nodes is None:
            continue
        for name in Nodes._fields[:-1]:
            yield f"{kind}/{name}", getattr(nodes, name)
        for one in nodes.fields:
            yield f"{kind}/{name_of(type(one))}", one.array


def kept_at_nodes(s: Any) -> list[tuple[str, np.ndarray]]:
    return [(name_of(type(one)), one.array) for one in s.nodes.fields if is_kept(type(one))]


def rows_at(simulation: Any, nodes: np.ndarray, gather: Callable) -> dict[str, np.ndarray] | None:
    """Gather rows of all arrays of nodes (ascending numbers), zero if not in use; or None."""
    counted, kinds = simulation.nodes.counted(), dict(of_nodes(simulation.setup))
    limits = (nodes[0], nodes[-1] + 1) if len(nodes) else (0, 0)
    here = counted[slice(*np.searchsorted(counted, limits))]
    here = here[np.isin(here, nodes, assume_unique=True)]
    found = gather((here, [array[here] for array in kinds.values()]))
    if found is None:
        return None
    rows = {name: np.zeros((len(nodes), *a.shape[1:]), a.dtype) for name, a in kinds.items()}
    for there, some in found:
        for array, of in zip(rows.values(), some, strict=True):
            array[np.searchsorted(nodes, there)] = of
    return rows


def take_tiling(tiling: Tiling, found: Mapping[str, np.ndarray], stem: str) -> Tiling:
    for name, _ in in_use(tiling):
        array, there = getattr(tiling, name), found.get(stem + name)
        if there is None or len(there) > len(array):
            raise _misfit(stem + name)
        array[: len(there)] = there
    return tiling


def take_points(points: Points, found: Mapping[str, Any], stem: str) -> Points:
    """Return points in the order and number of the arrays, reusing arrays that fit."""
    check_points(points, found, stem)
    own: dict[str, Any] = {
        name: None if array is None else as_rows_of_points(found[stem + name])
        for name, array in points._asdict().items()
        if name != "fields"
    }
    if own["x"].ndim < points.x.ndim:
        own["x"] = as_rows_of_points(np.stack([own["x"]] * len(points.x)))
    declared = (
        type(one)(as_rows_of_points(found[stem + name_of(type(one))])) for one in points.fields
    )
    return Points(**own, fields=tuple(declared))


def check_points(points: Points, found: Mapping[str, Any], stem: str) -> None:
    """Refuse arrays that do not fit such points; positions may be only the present ones."""
    likes = dict(arrays_of(points))
    there = {n.removeprefix(stem): array for n, array in found.items() if n.startswith(stem)}
    for name in likes.keys() ^ there.keys():
        raise _misfit(f"{name} of points")
    for name, like in likes.items():
        array = there[name]
        like = like[0] if name == "x" and len(array.shape) == 2 else like
        if array.dtype != like.dtype or array.shape != (*like.shape[:-1], there["id"].size):
            raise _misfit(f"{name} of points")


def check_numbers(simulation: Any, found: Mapping[str, Any]) -> None:
    """Refuse numbers of points, materials, grids and nodes that the scene does not have."""
    s, count = simulation.setup, simulation.hub.fields.node_count
    ends = {"node numbers": count, "touched/nodes": count}
    for k, block in enumerate(s.blocks):
        points, tiling = f"points/{k}/", f"tiling/{k}/"
        ends[points + "material"] = len(flat(block.laws)[0])
        ends[points + "id"] = simulation.count
        ends[points + "grid"] = ends[tiling + "grid"] = len(s.grids.x0)
        # Points that went since the last sort are in the ranges still; the next step sorts first.
        sorted_since = np.isfinite(np.asarray(found["clock"][()])["drift"]).all()
        number = found[points + "id"].size if sorted_since else simulation.count
        ends[tiling + "range"] = number + 1
    for name in ends.keys() & found.keys():
        array, end = found[name], ends[name]
        for first in range(0, len(array), PIECE):
            some = array[first : first + PIECE]
            if some.min() < 0 or some.max() >= end:
                raise _misfit(
                    f"{name} has {some.min()} to {some.max()}, and is from 0 to {end - 1}"
                )


def remembered_at(simulation: Any, spans: np.ndarray) -> list[np.ndarray]:
    return simulation.hub.update.method.remembered(simulation.setup.contact, spans)


def _checked(found: Mapping[str, Any], name: str, like: np.ndarray, *, read: bool = True) -> Any:
    there = found.get(name)
    if there is None or there.shape != like.shape or there.dtype != like.dtype:
        raise _misfit(name)
    return there[()] if read else None


def _misfit(what: str) -> ScriptError:
    return ScriptError(
        f"its state is not one of this scene: {what}",
        expected="a file that the same scene has written: the same solids, materials and method",
    )


# --- of several processes -------------------------------------------------------------------------


def _joined(simulation: Any, own: dict[str, np.ndarray]) -> Iterator[Stored]:
    s, comm = simulation.setup, simulation.comm
    parts = comm.gather(
        {
            "tiling": [stripped(own, f"tiling/{k}/") for k in range(len(s.blocks))],
            "work": own["work"].copy(),
            "touched": stripped(own, "touched/"),
        }
    )
    # Tiles as of one process.
    tilings = [Tiles.empty_tiling(simulation.tiles) for _ in s.blocks]
    rows: dict[str, np.ndarray] = {}
    for k, tiling in enumerate(tilings if parts is not None else ()):
        tiling.count[1] = 1 if simulation.tiles.direct else SHARES
        join_tilings(tiling, [part["tiling"][k] for part in parts])
        rows |= {f"tiling/{k}/{name}": getattr(tiling, name)[:n] for name, n in in_use(tiling)}
    if parts is not None:
        work = sum(part["work"] for part in parts)
        at_nodes = {name: array for name, array in own.items() if name.startswith("kept/")}
        yield from in_file(rows | {"clock": own["clock"], "work": work} | at_nodes)
    for k, tiling in enumerate(tilings):
        yield from _points(simulation, k, tiling, own)
    if "values" in own:
        yield from wholes({"values": own["values"]})
    if found := [part["touched"] for part in parts or () if part["touched"]]:
        nodes, first = np.unique(np.concatenate([of["nodes"] for of in found]), True)
        of_nodes = np.concatenate([of["rows"] for of in found])[first]
        yield from wholes({"touched/nodes": nodes, "touched/rows": of_nodes})


def points_of_tiles(
    tiling: dict[str, np.ndarray], arrays: list[np.ndarray], first: int, end: int
) -> dict[str, Any]:
    """Return own points in tiles with numbers in [first, end), and their ranges."""
    own = slice(*np.searchsorted(tiling["number"], (first, end)))
    ranges = tiling["range"][own]
    points = slice(ranges[0, 0], ranges[-1, 1]) if len(ranges) else slice(0, 0)
    return {
        "number": tiling["number"][own], "range": ranges, "count": [len(ranges)],
        "points": [array[..., points] for array in arrays],
    }  # fmt: skip


def _points(
    simulation: Any, k: int, tiling: Tiling, own: dict[str, np.ndarray]
) -> Iterator[Stored]:
    comm = simulation.comm
    number, ends = (array[: tiling.count[0]] for array in (tiling.number, tiling.range[:, 1]))
    total = int(ends[-1]) if len(ends) else 0
    limits = [
        (int(number[first]), int(number[end - 1]) + 1) if total else None
        for first, end in _cuts(ends)
    ]
    names = [name for name, _ in arrays_of(simulation.setup.blocks[k].points)]
    arrays = [own[f"points/{k}/{name}"] for name in names]
    begin = 0
    for of_piece in comm.bcast(limits):
        if of_piece is not None:
            found = comm.gather(points_of_tiles(stripped(own, f"tiling/{k}/"), arrays, *of_piece))
        else:  # not sorted yet: each process has an equal range of the ids
            found = comm.gather({"points": arrays})
        if found is None:
            continue
        total = total or sum(part["points"][0].shape[-1] for part in found)
        order = np.arange(total) if of_piece is None else by_tile(found)
        for name, *same in zip(names, *(part["points"] for part in found), strict=True):
            array = np.take(np.concatenate(same, axis=-1), order, axis=-1)
            where = ..., slice(begin, begin + len(order))
            yield f"points/{k}/{name}", (*array.shape[:-1], total), where, array
        begin += len(order)


def _cuts(ends: np.ndarray) -> Iterator[tuple[int, int]]:
    """Cut ranges with these ends into groups of about `PIECE` rows."""
    total = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(PIECE, total, PIECE), side="right")
    return pairwise([*np.unique([0, *cuts]).tolist(), len(ends)])


def own_share(simulation: Any, state: Mapping, costs: np.ndarray) -> dict[str, np.ndarray]:
    """Read the own part of the state in a file, after cutting its tiles for the processes."""
    blocks, comm, tiles = simulation.setup.blocks, simulation.comm, simulation.tiles
    tilings = [take_tiling(tiles.empty_tiling(), state, f"tiling/{k}/") for k in range(len(blocks))]
    whole = [b._replace(tiling=of) for b, of in zip(blocks, tilings, strict=True)]
    before = tiles.owner
    tiles.share_out(work_of(tiles.loads(whole), costs))
    owner, tiles.owner = tiles.owner, before
    found = {n: state[n][()] for n in state if n in ALL_HAVE or n.startswith(EACH_HAS)}
    if not comm.leads:
        found["work"] = np.zeros_like(found["work"])
    for k, tiling in enumerate(tilings):
        points, of_tiles = share_of_tiling(k, tiling, owner == comm.rank)
        if not tiling.count[0]:  # not sorted yet: an equal range
            count = state[f"points/{k}/id"].size
            points = np.arange(count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size)
        names = [f"points/{k}/{name}" for name, _ in arrays_of(blocks[k].points)]
        found |= of_tiles | {name: _chosen(state[name], points) for name in names}
    return found | {"owner": owner}


def _chosen(array: Any, points: np.ndarray) -> np.ndarray:
    found = rows_of_points((*array.shape[:-1], len(points)), array.dtype)
    for begin in range(0, array.shape[-1], PIECE):
        own = slice(*np.searchsorted(points, (begin, begin + PIECE)))
        if own.start < own.stop:
            found[..., own] = array[..., begin : begin + PIECE][..., points[own] - begin]
    return found
