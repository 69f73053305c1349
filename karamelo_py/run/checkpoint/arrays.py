"""The state of a simulation as named arrays, to be restored, written and read."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from types import EllipsisType
from typing import TYPE_CHECKING, Any

import numpy as np

from karamelo_py.compiler.fields import as_rows_of_points, name_of, rows_of_points
from karamelo_py.compiler.tuples import flat
from karamelo_py.kernels.arrays import Hooks, Nodes, Points, Setup, Tiling, arrays_of
from karamelo_py.kernels.heat import Conducting
from karamelo_py.kernels.totals import SINCE_START, carry
from karamelo_py.output.fields import PIECE
from karamelo_py.run.boxes import numbers, used
from karamelo_py.run.mpi.partition import by_tile, join_tilings, share_of_tiling, stripped, work_of
from karamelo_py.run.state import SceneState
from karamelo_py.run.tiles import SHARES, Tiles, in_use
from karamelo_py.script.errors import ScriptError

if TYPE_CHECKING:
    import h5py

ALL_HAVE, EACH_HAS = ("clock", "work", "values"), ("touched/", "kept/")

# Name and shape of an array, index of a piece, and the piece.
Index = EllipsisType | slice | tuple
Stored = tuple[str, tuple[int, ...], Index, np.ndarray]


def changing(simulation: SceneState) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the used part of every array that steps change and the next step needs."""
    s = simulation.setup
    for k, block in enumerate(s.blocks):
        for name, rows in in_use(block.tiling):
            yield f"tiling/{k}/{name}", getattr(block.tiling, name)[:rows]
    yield from simulation.domain.state().items()
    yield "clock", s.control.clock
    yield "work", s.control.totals[SINCE_START]
    for name, array in kept_at_nodes(s):
        yield f"kept/{name}", array
    for k, block in enumerate(s.blocks):
        now = s.control.motion[0].now  # correct only after the clock has been restored
        for name, array in arrays_of(block.points):
            # The other half of the positions belongs to the last step.
            yield f"points/{k}/{name}", array[now] if name == "x" else array


def copied(simulation: SceneState, before: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    copies = {}
    # Copied one at a time, so that two copies of only one array exist at once.
    for name, array in (*changing(simulation), ("values", simulation.setup.control.values)):
        copy = before.pop(name, None)
        if copy is None or copy.shape != array.shape or copy.dtype != array.dtype:
            del copy
            copy = np.empty_like(array)
        copy[...] = array
        copies[name] = copy
    return copies | touched(simulation)


def touched(simulation: SceneState) -> dict[str, np.ndarray]:
    """Return nodes with recent contact, and their contact memory.

    A single process searches all nodes, since liquids may return to nodes that are not in use now.
    Several processes search only the nodes in use.
    """
    spans = used(simulation.setup.spans)[1:]
    if not remembered_at(simulation, spans[:1]):
        return {}
    steps = simulation.setup.contact.memory.max()
    if steps > 1 and not simulation.domain.parted:
        begin = np.arange(0, simulation.hub.fields.node_count, PIECE)
        spans = np.stack([begin, begin + PIECE], axis=1)
    changed = []
    for first, rows in zip(spans[:, 0], remembered_at(simulation, spans), strict=True):
        recent = (rows != 0) & (np.abs(rows) > simulation.step - steps)
        indices = np.flatnonzero(recent.any(axis=1))
        changed.append((first + indices, np.where(recent[indices], rows[indices], 0)))
    nodes, rows = (np.concatenate(parts) for parts in zip(*changed, strict=True))
    if simulation.domain.parted:
        counted = np.isin(nodes, simulation.domain.counted())
        nodes, rows = nodes[counted], rows[counted]
    return {"touched/nodes": nodes, "touched/rows": rows}


def stored(simulation: SceneState, kept: dict[str, np.ndarray] | None = None) -> Iterator[Stored]:
    """Yield the content of a restart file for the present state, or for the `kept` one.

    All ranks call this; rank 0 gets the arrays, bit for bit as in a serial run.
    """
    if not kept:
        simulation.bring()
        simulation.domain.share_kept()
    state = kept or dict(changing(simulation)) | touched(simulation)
    yield from in_file(state) if simulation.comm.size == 1 else _joined(simulation, state)
    if kept:
        return
    yield from wholes(identical(simulation))
    yield from _shown_by_nodes(simulation)


def _shown_by_nodes(simulation: SceneState) -> Iterator[Stored]:
    comm, counted = simulation.comm, simulation.domain.counted()
    nonzero = np.zeros(len(counted), np.bool_)
    for _, array in of_nodes(simulation.setup):
        for first in range(0, len(counted), PIECE):
            piece = slice(first, first + PIECE)
            nonzero[piece] |= array[counted[piece]].any(axis=1)
    parts = comm.gather(counted[nonzero])
    of_all = np.sort(np.concatenate(parts or [counted[:0]]))
    if parts is not None:
        yield from wholes({"node numbers": of_all})
    total = comm.bcast(len(of_all))
    for first in range(0, total, PIECE):
        where = slice(first, min(first + PIECE, total))
        nodes = comm.bcast(of_all[where])
        for name, array in (rows_at(simulation, nodes, comm.gather) or {}).items():
            yield name, (total, *array.shape[1:]), where, array + 0


def in_file(state: dict[str, np.ndarray]) -> Iterator[Stored]:
    """Yield a state in the form in which files store it: digits of exact sums are normalised."""
    work = state["work"].copy()
    for total in work:
        carry(total)
    yield from wholes(state | {"clock": state["clock"].view(np.ndarray), "work": work})


def wholes(arrays: Mapping[str, np.ndarray]) -> Iterator[Stored]:
    for name, array in arrays.items():
        yield name, array.shape, ..., array


def identical(simulation: SceneState) -> dict[str, np.ndarray]:
    return {"present": simulation.present, "shown": np.array(simulation.flags)}


class InFile:
    def __init__(self, data: "h5py.Dataset"):
        self._data = data
        self.shape, self.dtype, self.size = data.shape, data.dtype, data.size

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, where: Index) -> Any:
        with reading():
            return self._data[where]

    def __array__(self, dtype: np.dtype | None = None, copy: bool | None = None) -> np.ndarray:
        # Read all at once: NumPy would read one number at a time.
        return np.asarray(self[()], dtype)


ArraysByName = Mapping[str, np.ndarray | InFile]


@contextmanager
def opened(path: Path, group: str = "state") -> Iterator[dict[str, InFile]]:
    import h5py

    arrays: dict[str, InFile] = {}

    def note(name: str, item: object) -> None:
        if hasattr(item, "shape"):
            arrays[name] = InFile(item)

    with reading():
        root = h5py.File(path, "r", locking=False)
    with root:
        with reading():
            try:
                root[group].visititems(note)
            except (RuntimeError, KeyError, ValueError) as error:
                raise OSError(str(error)) from error
        yield arrays


@contextmanager
def reading() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise ScriptError(
            f"the file is damaged: {error}",
            hint="an earlier file, or the script from its beginning, without a file",
        ) from error


def restore(simulation: SceneState, state: ArraysByName) -> None:
    s = simulation.setup
    simulation.tiles.empty_nodes(s)
    blocks = []
    for k, block in enumerate(s.blocks):
        stem = f"points/{k}/"
        points, tiling = block.points, take_tiling(block.tiling, state, f"tiling/{k}/")
        if points.mass.size != state[stem + "mass"].size:
            columns = {name: np.array(state[name]) for name in state if name.startswith(stem)}
            points = take_points(points, columns, stem)
        blocks.append(block._replace(points=points, tiling=tiling))
    s = simulation.setup = s._replace(blocks=tuple(blocks))
    simulation.tiles.lay_out(s)
    for name, array in changing(simulation):
        # The tiles have already been divided among the present processes.
        if not name.startswith("tiling/"):
            array[...] = _checked(state, name, array)
    for block in s.blocks:
        block.points.x[:] = block.points.x[s.control.motion[0].now]
    if "values" in state:
        s.control.values[:] = state["values"]
    for memory in remembered_at(simulation, np.array([[0, simulation.hub.fields.node_count]])):
        memory[memory != 0] = 0
        if "touched/nodes" in state:  # processes without points have no nodes
            memory[state["touched/nodes"][()]] = state["touched/rows"]
    if isinstance(simulation.hooks, Hooks):
        simulation.hooks.loads[:] = 0  # an incomplete step may have summed loads
    simulation.changed()


def take_snapshot(simulation: SceneState, path: Path) -> dict[str, np.ndarray]:
    with opened(path, "good") as arrays:
        check_numbers(simulation, arrays)
        if simulation.domain.parted:
            return dict(simulation.domain.own_part(arrays))
        names = [*(name for name, _ in changing(simulation)), "values", *arrays]
        return {name: arrays[name][()] for name in dict.fromkeys(names)}


def take_stored(simulation: SceneState, path: Path) -> None:
    with opened(path) as state, simulation.comm.joint():
        # Check all arrays first, so that a file of another scene changes nothing.
        for k, block in enumerate(simulation.setup.blocks):
            check_points(block.points, state, f"points/{k}/")
        check_numbers(simulation, state)
        restore(simulation, simulation.domain.own_part(state))
        simulation.present[:] = _checked(state, "present", simulation.present)
        flags = _checked(state, "shown", np.array(simulation.flags))
        simulation.flags = tuple(map(bool, flags))
        _take_nodes(simulation, state)


def _take_nodes(simulation: SceneState, state: ArraysByName) -> None:
    counted = numbers(simulation.setup.spans)
    used = np.zeros(simulation.hub.fields.node_count, np.bool_)
    used[counted] = True
    nodes = state["node numbers"][()] if "node numbers" in state else counted[:0]
    kept = {id(array) for _, array in kept_at_nodes(simulation.setup)}  # restores -0, too
    for name, array in of_nodes(simulation.setup):
        if id(array) in kept:
            continue
        array[counted] = 0
        row = np.broadcast_to(array[:1], (len(nodes), *array.shape[1:]))
        if len(nodes):
            _checked(state, name, row, read=False)
        for first in range(0, len(nodes), PIECE):
            piece = nodes[first : first + PIECE]
            here = used[piece]
            array[piece[here]] = state[name][first : first + PIECE][here]


def of_nodes(s: Setup) -> Iterator[tuple[str, np.ndarray]]:
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


def kept_at_nodes(s: Setup) -> list[tuple[str, np.ndarray]]:
    return [(name_of(type(one)), one.array) for one in s.nodes.fields if one.kept]


def rows_at(
    simulation: SceneState, nodes: np.ndarray, gather: Callable
) -> dict[str, np.ndarray] | None:
    """Gather nodal arrays at ascending `nodes`, 0 where a node is not in use."""
    counted, kinds = simulation.domain.counted(), dict(of_nodes(simulation.setup))
    limits = (nodes[0], nodes[-1] + 1) if len(nodes) else (0, 0)
    here = counted[slice(*np.searchsorted(counted, limits))]
    here = here[np.isin(here, nodes, assume_unique=True)]
    parts = gather((here, [array[here] for array in kinds.values()]))
    if parts is None:
        return None
    rows = {name: np.zeros((len(nodes), *a.shape[1:]), a.dtype) for name, a in kinds.items()}
    for nodes_there, rows_there in parts:
        for array, of in zip(rows.values(), rows_there, strict=True):
            array[np.searchsorted(nodes, nodes_there)] = of
    return rows


def take_tiling(tiling: Tiling, arrays: Mapping[str, np.ndarray], stem: str) -> Tiling:
    for name, _ in in_use(tiling):
        array, stored_array = getattr(tiling, name), arrays.get(stem + name)
        if stored_array is None or len(stored_array) > len(array):
            raise _misfit(stem + name)
        array[: len(stored_array)] = stored_array
    return tiling


def take_points(points: Points, arrays: ArraysByName, stem: str) -> Points:
    check_points(points, arrays, stem)
    columns: dict[str, Any] = {
        name: None if array is None else as_rows_of_points(arrays[stem + name])
        for name, array in points._asdict().items()
        if name != "fields"
    }
    if columns["x"].ndim < points.x.ndim:
        columns["x"] = as_rows_of_points(np.stack([columns["x"]] * len(points.x)))
    declared = (
        type(one)(as_rows_of_points(arrays[stem + name_of(type(one))])) for one in points.fields
    )
    return Points(**columns, fields=tuple(declared))


def check_points(points: Points, arrays: ArraysByName, stem: str) -> None:
    expected_arrays = dict(arrays_of(points))
    stored_arrays = {
        n.removeprefix(stem): array for n, array in arrays.items() if n.startswith(stem)
    }
    for name in expected_arrays.keys() ^ stored_arrays.keys():
        raise _misfit(f"{name} of points")
    for name, expected in expected_arrays.items():
        array = stored_arrays[name]
        expected = expected[0] if name == "x" and len(array.shape) == 2 else expected
        shape = *expected.shape[:-1], stored_arrays["id"].size
        if array.dtype != expected.dtype or array.shape != shape:
            raise _misfit(f"{name} of points")


def check_numbers(simulation: SceneState, arrays: ArraysByName) -> None:
    s, count = simulation.setup, simulation.hub.fields.node_count
    ends = {"node numbers": count, "touched/nodes": count}
    for k, block in enumerate(s.blocks):
        points, tiling = f"points/{k}/", f"tiling/{k}/"
        ends[points + "material"] = len(flat(block.laws)[0])
        ends[points + "id"] = simulation.count
        ends[points + "grid"] = ends[tiling + "grid"] = len(s.grids.x0)
        # Until the next sort, ranges may include deleted points.
        sorted_since = np.isfinite(np.asarray(arrays["clock"][()])["motion"]["drift"]).all()
        number = arrays[points + "id"].size if sorted_since else simulation.count
        ends[tiling + "range"] = number + 1
    for name in ends.keys() & arrays.keys():
        array, end = arrays[name], ends[name]
        for first in range(0, len(array), PIECE):
            some = array[first : first + PIECE]
            if some.min() < 0 or some.max() >= end:
                raise _misfit(f"{name} has {some.min()} to {some.max()}, expected 0 to {end - 1}")


def remembered_at(simulation: SceneState, spans: np.ndarray) -> list[np.ndarray]:
    return simulation.hub.update.method.remembered(simulation.setup.contact, spans)


def _checked(arrays: ArraysByName, name: str, expected: np.ndarray, *, read: bool = True) -> Any:
    array = arrays.get(name)
    if array is None or array.shape != expected.shape or array.dtype != expected.dtype:
        raise _misfit(name)
    return array[()] if read else None


def _misfit(reason: str) -> ScriptError:
    return ScriptError(
        f"its state does not fit this scene: {reason}",
        expected="a file that the same scene has written: the same solids, materials and method",
    )


def _joined(simulation: SceneState, local: dict[str, np.ndarray]) -> Iterator[Stored]:
    s, comm = simulation.setup, simulation.comm
    state: dict[str, Any] = {
        "tiling": [stripped(local, f"tiling/{k}/") for k in range(len(s.blocks))],
        "work": local["work"].copy(),
        "touched": stripped(local, "touched/"),
    }
    parts = comm.gather(state)
    tilings = [Tiles.empty_tiling(simulation.tiles) for _ in s.blocks]
    rows: dict[str, np.ndarray] = {}
    for k, tiling in enumerate(tilings if parts is not None else ()):
        tiling.count[1] = 1 if simulation.tiles.direct else SHARES
        join_tilings(tiling, [piece["tiling"][k] for piece in parts])
        rows |= {f"tiling/{k}/{name}": getattr(tiling, name)[:n] for name, n in in_use(tiling)}
    if parts is not None:
        work = sum(piece["work"] for piece in parts)
        at_nodes = {name: array for name, array in local.items() if name.startswith("kept/")}
        yield from in_file(rows | {"clock": local["clock"], "work": work} | at_nodes)
    for k, tiling in enumerate(tilings):
        yield from _points(simulation, k, tiling, local)
    if "values" in local:
        yield from wholes({"values": local["values"]})
    if touched_parts := [piece["touched"] for piece in parts or () if piece["touched"]]:
        nodes, first = np.unique(np.concatenate([of["nodes"] for of in touched_parts]), True)
        of_nodes = np.concatenate([of["rows"] for of in touched_parts])[first]
        yield from wholes({"touched/nodes": nodes, "touched/rows": of_nodes})


def points_of_tiles(
    tiling: dict[str, np.ndarray], arrays: list[np.ndarray], first: int, end: int
) -> dict[str, Any]:
    chosen = slice(*np.searchsorted(tiling["number"], (first, end)))
    ranges = tiling["range"][chosen]
    points = slice(ranges[0, 0], ranges[-1, 1]) if len(ranges) else slice(0, 0)
    return {
        "number": tiling["number"][chosen], "range": ranges, "count": [len(ranges)],
        "points": [array[..., points] for array in arrays],
    }  # fmt: skip


def _points(
    simulation: SceneState, k: int, tiling: Tiling, local: dict[str, np.ndarray]
) -> Iterator[Stored]:
    comm = simulation.comm
    number, ends = (array[: tiling.count[0]] for array in (tiling.number, tiling.range[:, 1]))
    total = int(ends[-1]) if len(ends) else 0
    limits = [
        (int(number[first]), int(number[end - 1]) + 1) if total else None
        for first, end in _cuts(ends)
    ]
    names = [name for name, _ in arrays_of(simulation.setup.blocks[k].points)]
    arrays = [local[f"points/{k}/{name}"] for name in names]
    begin = 0
    for of_piece in comm.bcast(limits):
        if of_piece is not None:
            tiles = stripped(local, f"tiling/{k}/")
            gathered = comm.gather(points_of_tiles(tiles, arrays, *of_piece))
        else:  # not sorted yet
            gathered = comm.gather({"points": arrays})
        if gathered is None:
            continue
        total = total or sum(piece["points"][0].shape[-1] for piece in gathered)
        order = np.arange(total) if of_piece is None else by_tile(gathered)
        for name, *same in zip(names, *(piece["points"] for piece in gathered), strict=True):
            array = np.take(np.concatenate(same, axis=-1), order, axis=-1)
            where = ..., slice(begin, begin + len(order))
            yield f"points/{k}/{name}", (*array.shape[:-1], total), where, array
        begin += len(order)


def _cuts(ends: np.ndarray) -> Iterator[tuple[int, int]]:
    total = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(PIECE, total, PIECE), side="right")
    return pairwise([*np.unique([0, *cuts]).tolist(), len(ends)])


def own_share(
    simulation: SceneState, state: ArraysByName, costs: np.ndarray
) -> dict[str, np.ndarray]:
    blocks, comm, tiles = simulation.setup.blocks, simulation.comm, simulation.tiles
    tilings = [take_tiling(tiles.empty_tiling(), state, f"tiling/{k}/") for k in range(len(blocks))]
    whole = [b._replace(tiling=of) for b, of in zip(blocks, tilings, strict=True)]
    before = tiles.owner
    tiles.share_out(work_of(tiles.loads(whole), costs))
    owner, tiles.owner = tiles.owner, before
    result = {n: state[n][()] for n in state if n in ALL_HAVE or n.startswith(EACH_HAS)}
    if not comm.leads:
        result["work"] = np.zeros_like(result["work"])
    for k, tiling in enumerate(tilings):
        points, of_tiles = share_of_tiling(k, tiling, owner == comm.rank)
        if not tiling.count[0]:  # not sorted yet
            count = state[f"points/{k}/id"].size
            points = np.arange(count * comm.rank // comm.size, count * (comm.rank + 1) // comm.size)
        names = [f"points/{k}/{name}" for name, _ in arrays_of(blocks[k].points)]
        result |= of_tiles | {name: _chosen(state[name], points) for name in names}
    return result | {"owner": owner}


def _chosen(array: np.ndarray | InFile, points: np.ndarray) -> np.ndarray:
    rows = rows_of_points((*array.shape[:-1], len(points)), array.dtype)
    for begin in range(0, array.shape[-1], PIECE):
        piece = slice(*np.searchsorted(points, (begin, begin + PIECE)))
        if piece.start < piece.stop:
            rows[..., piece] = array[..., begin : begin + PIECE][..., points[piece] - begin]
    return rows
