"""The state of a simulation as arrays by name: to return to, to write, to read."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from karamelo_py.compiler.fields import as_rows_of_points, name_of
from karamelo_py.kernels.arrays import Nodes, Points, Tiling, arrays_of
from karamelo_py.kernels.totals import WORK, carry
from karamelo_py.run.boxes import numbers, used
from karamelo_py.run.tiles import in_use
from karamelo_py.script.errors import ScriptError

# What else a simulation knows of its state; `measured` comes before what depends on its version.
SHOWN = ("measured", "mapped", "followed", "told_of_growth")

# Name and shape of an array, where in it something belongs, and that.
Stored = tuple[str, tuple[int, ...], Any, np.ndarray]


def changing(simulation: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield every array that a step changes and the next one needs, as far as it is in use."""
    s = simulation.setup
    for name, array, rows in simulation.tiles.in_use(s):
        yield name, array[:rows]
    yield "clock", s.control.clock
    yield "work", s.control.totals[WORK]
    for k, block in enumerate(s.blocks):
        now = s.control.clock[0].now  # known once the clock is put back
        for name, array in arrays_of(block.points):
            # The other places are those of the step before, and of none that went wrong.
            yield f"points/{k}/{name}", array[now] if name == "x" else array


def copied(simulation: Any, before: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Copy the state of a simulation, and the published values.

    Copies of the state `before`, which is lost, are used again. One array after another: where
    points have come or gone none is there twice.
    """
    found = {}
    for name, array in (*changing(simulation), ("values", simulation.setup.control.values)):
        copy = before.pop(name, None)
        if copy is None or copy.shape != array.shape or copy.dtype != array.dtype:
            del copy
            copy = np.empty_like(array)
        copy[...] = array
        found[name] = copy
    return found | touched(simulation)


def touched(simulation: Any) -> dict[str, np.ndarray]:
    """List the nodes in use where contact acted in the last step, and what it remembers of them."""
    spans = simulation.setup.spans
    memory = remembered_at(simulation, used(spans)[1:])
    if not memory:
        return {}
    rows = np.concatenate(memory)
    # What touched before the last step is of no use.
    rows = np.where(np.abs(rows) == simulation.step, rows, 0)
    there = np.flatnonzero(rows.any(axis=1))
    return {"touched/nodes": numbers(spans)[there], "touched/rows": rows[there]}


def stored(simulation: Any) -> Iterator[Stored]:
    """Yield what a file to go on from holds: the state, what is known of it, nodes as they are."""
    yield from in_file(dict(changing(simulation)) | touched(simulation))
    s = simulation.setup
    nodes = numbers(s.spans)
    # Of zeros without a sign: which nodes beside a body are visited depends on who has its tiles.
    yield from wholes(known(simulation) | {name: array[nodes] + 0 for name, array in of_nodes(s)})


def in_file(state: dict[str, np.ndarray]) -> Iterator[Stored]:
    """Yield a state as files hold it, the digits of a sum always the same."""
    work = state["work"].copy()
    carry(work)
    yield from wholes(state | {"clock": state["clock"].view(np.ndarray), "work": work})


def wholes(arrays: Mapping[str, np.ndarray]) -> Iterator[Stored]:
    """Yield arrays that are written at once."""
    for name, array in arrays.items():
        yield name, array.shape, ..., array


def known(simulation: Any) -> dict[str, np.ndarray]:
    """Return what all processes know."""
    shown = np.array([getattr(simulation, name) for name in SHOWN])
    return {"present": simulation.present, "shown": shown}


class InFile:
    """An array in a file: read when it is looked at, which a file that is damaged may not allow."""

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
    """The arrays in a file to go on from, by name; they are read when they are looked at."""
    import h5py

    with ExitStack() as until_end:
        found: dict[str, InFile] = {}
        with reading():
            root = until_end.enter_context(h5py.File(path, "r", locking=False))
            try:
                root[group].visititems(
                    lambda name, item: (
                        found.update({name: InFile(item)}) if hasattr(item, "shape") else None
                    )
                )
            except (RuntimeError, KeyError, ValueError) as error:
                raise OSError(str(error)) from error
        yield found


@contextmanager
def reading() -> Iterator[None]:
    """Within this, what HDF5 cannot read is told of as a file that is damaged.

    Only what reads belongs there: what else fails for the system is not the fault of the file.
    """
    try:
        yield
    except OSError as error:
        raise ScriptError(
            f"the file is damaged: {error}",
            hint="an earlier file, or the script from its beginning, without a file",
        ) from error


def restore(simulation: Any, state: Mapping[str, Any]) -> None:
    """Put the arrays of a simulation into a state, as `copied` or a file has it."""
    s = simulation.setup
    for k, block in enumerate(s.blocks):
        check_points(block.points, state, f"points/{k}/")
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


def take_known(simulation: Any, state: Mapping[str, Any]) -> None:
    """Take what all processes know."""
    simulation.present[:] = _checked(state, "present", simulation.present)
    for name, known in zip(SHOWN, _checked(state, "shown", np.ones(len(SHOWN), bool)), strict=True):
        setattr(simulation, name, bool(known))


def take_nodes(simulation: Any, state: Mapping[str, Any]) -> None:
    """Let the nodes in use show what they did."""
    nodes = numbers(simulation.setup.spans)
    for name, array in of_nodes(simulation.setup):
        array[nodes] = _checked(state, name, array[nodes])


def of_nodes(s: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Every array of nodes, with its name."""
    for kind, nodes in (("nodes", s.nodes), ("heat", getattr(s.heat, "nodes", None))):
        if nodes is None:
            continue
        for name in Nodes._fields[:-1]:
            yield f"{kind}/{name}", getattr(nodes, name)
        for one in nodes.fields:
            yield f"{kind}/{name_of(type(one))}", one.array


def take_tiling(tiling: Tiling, found: Mapping[str, np.ndarray], stem: str) -> Tiling:
    """Put what `in_use` has given into a tiling."""
    for name, _ in in_use(tiling):
        _fill(getattr(tiling, name), found, stem + name)
    return tiling


def _fill(array: np.ndarray, found: Mapping[str, np.ndarray], name: str) -> None:
    """The first rows of `array` become those of the file."""
    if name not in found or len(found[name]) > len(array):
        raise _misfit(name)
    array[: len(found[name])] = found[name]


def take_points(points: Points, found: Mapping[str, Any], stem: str) -> Points:
    """Return points in the order and number of the arrays, which they keep where these fit."""
    check_points(points, found, stem)
    own = {
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
    """Refuse arrays that are none of such points; places may be those of now alone."""
    likes = dict(arrays_of(points))
    there = {n.removeprefix(stem): array for n, array in found.items() if n.startswith(stem)}
    for name in likes.keys() ^ there.keys():
        raise _misfit(f"{name} of points")
    for name, like in likes.items():
        array = there[name]
        like = like[0] if name == "x" and len(array.shape) == 2 else like
        if array.dtype != like.dtype or array.shape != (*like.shape[:-1], there["id"].size):
            raise _misfit(f"{name} of points")


def remembered_at(simulation: Any, spans: np.ndarray) -> list[np.ndarray]:
    """Return what contact remembers at the nodes of these spans (k, 2)."""
    method = simulation.hub.update.method
    return method.remembered(simulation.setup.contact, spans)


def _checked(found: Mapping[str, Any], name: str, like: np.ndarray) -> np.ndarray:
    there = found.get(name)
    if there is None or there.shape != like.shape or there.dtype != like.dtype:
        raise _misfit(name)
    return there[()]


def _misfit(what: str) -> ScriptError:
    return ScriptError(
        f"its state is not one of this scene: {what}",
        expected="a file that the same scene has written: the same solids, materials and method",
    )
