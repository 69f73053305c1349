"""Restart files: the state of a scene in HDF5.

A file contains arrays, states of parts (:mod:`karamelo_py.run.checkpoint.parts`) and the executed
statements. The script itself is executed again to set up the scene.
"""

import json
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from karamelo_py import __version__
from karamelo_py.language.replay import Record, Replay
from karamelo_py.output.files import whole
from karamelo_py.output.rhythm import ByTime, Rhythmic
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.run.checkpoint.arrays import (
    Stored,
    reading,
    stored,
    take_snapshot,
    take_stored,
    wholes,
)
from karamelo_py.run.checkpoint.parts import PartStates, RollbackPoint, parts_of
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import Mark, ScriptError

if TYPE_CHECKING:
    import h5py

FORMAT, VERSION = "karamelo-py restart", 12
OURS = "a file that restart or write_restart of karamelo-py has written"
CONTENT = (
    "within", "statements", "values of statements", "presets", "variables", "runs", "chosen",
    "scene", "values", "begun", "parts", "run",
)  # fmt: skip
# HDF5 stores checksums of everything except arrays. The checksum of an array is an attribute.
CHECKED, CHECKSUM = "v110", "crc32"
LARGE = ("/state/", "/good/")
READ_AT_ONCE = 1 << 22  # bytes read at a time


class Restarts(Rhythmic):
    """Writes restart files during a run; the step number replaces the first ``*`` of the name."""

    mark: Mark | None = None
    style = ""

    def __init__(self, hub: Hub, every: int | ByTime, file: Path):
        self.hub = hub
        self.every = every
        self.file = file
        self.last_step = hub.update.step

    def write(self) -> None:
        self.last_step = self.hub.update.step  # stored in the file
        write(self.hub, self.file, within=True)


def path_of(hub: Hub, file: Path) -> Path:
    return hub.folder / str(file).replace("*", str(hub.update.step), 1)


def write(hub: Hub, file: Path, *, within: bool) -> Path:
    path, comm, simulation = path_of(hub, file), hub.settings.comm, hub.simulation
    groups, point = {"state": stored(simulation)}, simulation.rollback if hub.in_run else None
    if point and point.halve and point.arrays:
        groups["good"] = stored(simulation, point.arrays)
    if comm.leads:
        _write(hub, path, within, point, groups)
    else:
        for pieces in groups.values():
            for _ in pieces:
                pass
    comm.barrier()
    return path


def _write(hub: Hub, path: Path, within: bool, point: RollbackPoint | None, groups: dict) -> None:
    import h5py

    for _, item in parts_of(hub):
        if hasattr(item, "filed"):
            item.filed()
    interpreter, states = hub.interpreter, {"parts": PartStates.of(hub)}
    if "good" in groups:
        states["good parts"] = point.parts
    content = {
        "within": within,
        "statements": interpreter.record.statements,
        "values of statements": list(interpreter.record.values.items()),
        "presets": interpreter.presets,
        "variables": {name: str(value) for name, value in interpreter.variables.items()},
        "runs": hub.runs,
        "chosen": hub.update.chosen and hub.update.chosen.lines,
        "scene": described(hub),
        "values": {name: hub.values.get(name) for name in hub.values.names()},
        "begun": [ID for ID, fix in hub.fixes.items() if fix in hub.simulation.begun],
        "run": point and [point.halvings, point.returns, point.step if "good" in groups else None],
        **{name: [[*key, of] for key, of in one.parts.items()] for name, one in states.items()},
    }
    with whole(path) as out, h5py.File(out, "w", libver=CHECKED) as root:
        root.attrs["format"], root.attrs["version"] = FORMAT, VERSION
        root.attrs["program"] = __version__
        root.attrs["step"], root.attrs["time"] = hub.update.step, hub.update.time
        text = json.dumps(content, default=lambda late: late.plain()).encode()
        arrays = _put(root, wholes({"content": np.frombuffer(text, np.uint8)}))
        for name, one in states.items():
            if one.arrays:
                members = wholes({str(k): a for k, a in enumerate(one.arrays)})
                arrays += _put(root.create_group(name), members)
        for name, members in groups.items():
            arrays += _put(root.create_group(name), members)
        root.flush()
        for data in arrays:
            data.attrs[CHECKSUM] = _checksum(data, out)


def _arrays_in(root: "h5py.Group") -> "list[h5py.Dataset]":
    arrays: list[h5py.Dataset] = []
    root.visititems(lambda _, item: arrays.append(item) if hasattr(item, "shape") else None)
    return arrays


def refuse_altered(path: Path, *, large: bool, rank: int = 0, size: int = 1) -> None:
    """Raise ScriptError if arrays of a file do not match their checksums.

    If `large`, arrays of points and nodes are checked, otherwise all other arrays. Each array is
    checked by one process.
    """
    import h5py

    with h5py.File(path, "r", locking=False) as root, path.open("rb") as file:
        try:
            arrays = [d for d in _arrays_in(root) if large == d.name.startswith(LARGE)]
            for data in arrays[rank::size]:
                if _checksum(data, file) != data.attrs.get(CHECKSUM):
                    raise OSError(f"{data.name} has been altered")
        except (RuntimeError, KeyError, ValueError) as error:
            raise OSError(str(error)) from error


def _checksum(data: "h5py.Dataset", file: BinaryIO) -> int:
    begin, crc, left = data.id.get_offset(), 0, data.id.get_storage_size()
    if begin is None:
        return zlib.crc32(np.ascontiguousarray(data[()]))
    file.seek(begin)
    while left > 0:
        piece = file.read(min(left, READ_AT_ONCE))
        if not piece:
            raise OSError(f"it ends within {data.name}")
        crc, left = zlib.crc32(piece, crc), left - len(piece)
    return crc


def _put(group: "h5py.Group", pieces: Iterator[Stored]) -> "list[h5py.Dataset]":
    made: dict[str, h5py.Dataset] = {}
    for name, shape, where, array in pieces:
        if array.shape == shape and array.size and name not in made:  # twice as fast
            made[name] = group.create_dataset(name, data=array, track_times=False)
            continue
        if name not in made:
            made[name] = group.create_dataset(name, shape, array.dtype, track_times=False)
        if array.size:
            made[name][where] = array
    return [*made.values()]


def is_restart(path: Path) -> bool:
    import h5py

    try:
        with h5py.File(path, "r", locking=False) as root:
            return root.attrs.get("format") == FORMAT
    except (OSError, KeyError, TypeError):
        return False


class Restart:
    def __init__(self, path: Path, out: Path | None = None):
        import h5py

        self.path = path = _latest(path, out)
        if not path.is_file():
            raise _no_file(path, out)
        message = f"{path} is not a restart file of this program"
        try:
            with h5py.File(path, "r", locking=False) as root:
                if root.attrs.get("format") != FORMAT:
                    raise ScriptError(message, argument="file", expected=OURS)
                version = int(root.attrs["version"])
                if version != VERSION:
                    age = "an older" if version < VERSION else "a newer"
                    raise ScriptError(
                        f"{path} has format {version}, of {age} karamelo-py "
                        f"({root.attrs['program']}), and this one ({__version__}) reads only "
                        f"format {VERSION}",
                        argument="file",
                        hint="run the script from its beginning, without this file, or with "
                        f"the {age.split()[1]} karamelo-py that wrote it",
                    )
                refuse_altered(path, large=False)
                self.content = json.loads(root["content"][()].tobytes())
                _ = root["state"], *(self.content[name] for name in CONTENT)
        except (OSError, KeyError, ValueError, TypeError) as error:
            why = "" if "signature" in str(error) else f": {error}"
            raise ScriptError(f"{message}{why}", argument="file", expected=OURS) from None

    def presets(self, requested: dict[str, str]) -> dict[str, str]:
        before = self.content["presets"]
        for name, text in requested.items():
            if before.get(name) != text:
                was = f"-var {name} {before[name]}" if name in before else f"no -var {name}"
                raise ScriptError(
                    f"{self.path} was written with {was}; now it is -var {name} {text}",
                    expected="the same variables, which are read from the file by default",
                    hint="leave it out; to change the length of the last run, write a number in "
                    "its line",
                )
        return before

    def replay(self) -> Replay:
        values = {int(k): value for k, value in self.content["values of statements"]}
        record = Record(self.content["statements"], values)
        return Replay(record, self.content["within"], str(self.path))

    def is_over(self, hub: Hub) -> bool:
        return not self.content["within"] and len(hub.runs) == len(self.content["runs"])

    def take(self, hub: Hub, point: RollbackPoint | None = None, *, outputs: bool) -> None:
        """Restore the state stored in the file; with `outputs`, outputs continue in their files.

        If the file is from an unfinished run, `point` gets the last good state in it.
        """
        check(hub, self)
        simulation, content = hub.simulation, self.content
        comm = hub.settings.comm
        try:
            with comm.joint(), reading():
                refuse_altered(self.path, large=True, rank=comm.rank, size=comm.size)
            take_stored(simulation, self.path)
            states = self._parts("parts", content["values"])
        except ScriptError as error:
            error.message = f"{self.path}: {error.message}"
            raise
        simulation.begun = {fix for ID, fix in hub.fixes.items() if ID in content["begun"]}
        states.give(hub, cut=outputs, anew=not outputs)
        if point is None or content["run"] is None:
            return
        point.halvings, point.returns, good = content["run"]
        if point.halve and good is not None:
            point.take(take_snapshot(simulation, self.path), good, self._parts("good parts", {}))

    def _parts(self, name: str, values: dict[str, float]) -> PartStates:
        import h5py

        with reading(), h5py.File(self.path, "r", locking=False) as root:
            group = root.get(name, ())
            arrays = [group[str(k)][()] for k in range(len(group))]
        return PartStates({tuple(key): state for *key, state in self.content[name]}, arrays, values)


def _latest(path: Path, out: Path | None) -> Path:
    if "*" not in path.name or path.exists():
        return path
    pattern = re.compile(re.escape(path.name).replace(r"\*", r"(\d+)", 1))
    files = path.parent.iterdir() if path.parent.is_dir() else ()
    matches = [(int(match[1]), one) for one in files if (match := pattern.fullmatch(one.name))]
    if not matches:
        raise _no_file(path, out)
    return max(matches)[1]


def _no_file(path: Path, out: Path | None) -> ScriptError:
    below = sorted(path.parent.glob(f"*/{path.name}")) if path.parent.is_dir() else []
    below += sorted(out.glob(path.name)) if out and path.name else []
    return ScriptError(
        f"there is no file {path}",
        argument="file",
        expected=None if below else OURS,
        hint=f"there is {below[-1]}" if below else None,
    )


def described(hub: Hub) -> dict[str, str]:
    update, domain = hub.update, hub.domain
    box = zip(domain.lo.tolist(), domain.hi.tolist(), strict=True)
    words = {
        "method": update.words_of_state + " thermo-mechanical" * update.thermal,
        "domain": f"{domain.dimension}, {', '.join(f'{a!r}, {b!r}' for a, b in box)}, {domain.h!r}",
        "axisymmetric": str(domain.kin.hoops > 0) + " with twist" * isinstance(domain.kin, Twisted),
        "thickness": str(domain.thickness),
        "precision": hub.settings.precision,
        "anti_volumetric_locking": str(update.anti_locking),
        "boundary": update.boundary,
    }
    for solid in hub.solids.values():
        where = 0
        for _, x in solid.pieces():
            where = zlib.crc32(np.ascontiguousarray(x).tobytes(), where)
        law = solid.material.law
        parts = [item for item in law if isinstance(item, tuple) and hasattr(item, "_fields")]
        kind = "-".join(type(item).__name__ for item in (law, *parts))
        words[f"solid '{solid.id}'"] = f"{solid.count} points of {kind}, {where:08x}"
    return words


def check(hub: Hub, restart: Restart) -> None:
    here, stored = described(hub), restart.content["scene"]
    for name in dict.fromkeys([*stored, *here]):
        mine, theirs = here.get(name), stored.get(name)
        # A resumed run may begin to use boundary(delete).
        if mine == theirs or (name == "boundary" and "reflect" not in (mine, theirs)):
            continue
        if mine is None or theirs is None:
            difference = f"{name}, which only {'that scene' if mine is None else 'this one'} has"
        elif name.startswith("solid") and mine.rsplit(",")[0] == theirs.rsplit(",")[0]:
            difference = f"other points in {name}"
        else:
            difference = f"{name} {theirs}; here it is {mine}"
        raise ScriptError(
            f"{restart.path} was written by another scene: {difference}",
            argument="file",
            expected="the same domain, method and solids as in the script that wrote it",
        )
