"""Files to go on from that something has ruined, and those of processes with few points."""

import json
import shutil
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from going_on import same_files
from scenes import block
from test_mpi import by_ranks, needs_mpi
from test_ranks import HALVED, TOUCHING

from karamelo_py.run.checkpoint.arrays import InFile, opened
from karamelo_py.run.checkpoint.restart_file import Restart, is_restart
from karamelo_py.script.errors import ScriptError

SCENE = block(1, "set_dt(0.001)", "restart(2, r.*.h5)", "run(4)")


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:3000])


def overwritten(path: Path) -> None:
    with h5py.File(path, "a") as root:
        root["content"][5:50] = 0


def spoilt(path: Path) -> None:
    """Bytes in the description of an array: HDF5 itself finds that."""
    with h5py.File(path) as root:
        where = h5py.h5o.get_info(root["state/points/0/v"].id).addr
    content = bytearray(path.read_bytes())
    content[where : where + 40] = b"\xa5" * 40
    path.write_bytes(content)


def spoilt_numbers(path: Path) -> None:
    """In a file that was packed: that comes to light in reading them, and not before."""
    with h5py.File(path, "a") as root:
        v = root["state/points/0/v"][()]
        del root["state/points/0/v"]
        packed = root.create_dataset("state/points/0/v", data=v, compression="gzip")
        root.flush()
        where = packed.id.get_chunk_info(0).byte_offset
    content = bytearray(path.read_bytes())
    content[where : where + 8] = b"\xa5" * 8
    path.write_bytes(content)


def put_content(path: Path, content: object) -> None:
    with h5py.File(path, "a") as root:
        del root["content"]
        text = json.dumps(content).encode()
        root["content"] = np.frombuffer(text, np.uint8)
        root["content"].attrs["crc32"] = zlib.crc32(text)


def of_another_kind(path: Path) -> None:
    put_content(path, [1, 2])


def incomplete(path: Path) -> None:
    with h5py.File(path, "a") as root:
        del root["state/points/0/v"]


def of_another(path: Path) -> None:
    with h5py.File(path, "w") as root:
        root["positions"] = [1.0]


def older(path: Path) -> None:
    with h5py.File(path, "a") as root:
        root.attrs["version"] = 4


@pytest.mark.parametrize(
    ("ruin", "said"),
    [
        (cut, "r.2.h5 is not a restart file of this program: "),
        (overwritten, "r.2.h5 is not a restart file of this program: "),
        (of_another, "r.2.h5 is not a restart file of this program\nexpected: a file that"),
        (of_another_kind, "r.2.h5 is not a restart file of this program: list indices"),
        (spoilt, "r.2.h5 is not a restart file of this program: "),
        (spoilt_numbers, "r.2.h5: the file is damaged: "),
        (incomplete, "r.2.h5: its state does not fit this scene: v of points"),
        (older, "r.2.h5 has format 4, of an older karamelo-py"),
    ],
)
def test_a_file_that_is_ruined_is_told_and_nothing_is_lost(run_interpreted, ruin, said):
    first = run_interpreted(SCENE)
    ruin(first.folder / "r.2.h5")
    log = (first.folder / "log.mpm").read_text(encoding="utf-8")
    again = run_interpreted(SCENE, "-restart", "r.2.h5", status=1)
    assert said in again.err and again.err.count("error: ") == 1
    assert "internal" not in again.err
    assert (again.folder / "log.mpm").read_text(encoding="utf-8") == log


def test_all_that_the_content_of_a_file_has_must_be_there(run_interpreted):
    path = run_interpreted(SCENE).folder / "r.2.h5"
    whole = Restart(path).content
    for missing in whole:
        put_content(path, {name: part for name, part in whole.items() if name != missing})
        with pytest.raises(ScriptError, match=f"of this program: '{missing}'"):
            Restart(path)
    put_content(path, whole)
    assert Restart(path).content == whole


@pytest.mark.parametrize("part", ["its type", "its place"])
def test_a_file_that_does_not_say_what_it_is_is_not_taken_for_ours(run_interpreted, part):
    """Nobody writes over it then."""
    path = run_interpreted(SCENE).folder / "r.2.h5"
    assert is_restart(path)
    content = bytearray(path.read_bytes())
    # The coding of its letters; what kind of message tells where the attributes of the root are.
    at = content.index(b"format\0") + 10 if part == "its type" else 112
    content[at] = 0xFF
    path.write_bytes(content)
    assert not is_restart(path)


def test_an_array_is_read_at_once(run_interpreted, monkeypatch):
    """Wherever NumPy takes it from: each number has a read of its own else."""
    path = run_interpreted(SCENE).folder / "r.2.h5"
    reads = []
    read = InFile.__getitem__
    monkeypatch.setattr(InFile, "__getitem__", lambda *of: reads.append(of) or read(*of))
    with opened(path) as found:
        into = np.zeros(found["present"].shape, bool)
        into[: len(found["present"])] = found["present"]
    assert into.all() and into.size == 6 and len(reads) == 1


def test_what_else_fails_while_a_file_is_open_is_not_its_damage(run_interpreted):
    """Such as another file, which who reads this one writes."""
    path = run_interpreted(SCENE).folder / "r.2.h5"
    full = OSError("No space left on device")
    with pytest.raises(OSError, match="No space left") as told, opened(path) as found:
        assert found["points/0/v"][()].shape == found["points/0/v"].shape
        raise full
    assert told.value is full


@pytest.mark.full
@needs_mpi
@pytest.mark.parametrize("halved", [False, True])
def test_few_points_that_one_of_two_processes_has(tmp_path, halved):
    """Files of two are those of one, and two go on from them; lines and warnings come once."""
    lines = HALVED if halved else ("set_dt(0.004)", "run(8)")
    text = block(2, "restart(6, r.*.h5)", "region(no, block, 0.9, 1, 0.9, 1)",
                 "group(no, particles, region, no, all)", *lines, 'print("behind")', "run(2)",
                 scheme="usavg")  # fmt: skip
    if halved:
        for old, new in TOUCHING.items():
            assert old in text
            text = text.replace(old, new)
        text = text.replace("run(60", "run(24")
    path = tmp_path / "in.script"
    path.write_text(text, encoding="utf-8")
    one, two, again = (tmp_path / name for name in ("one", "two", "again"))
    for folder, ranks in ((one, 1), (two, 2)):
        status, _, err = by_ranks(folder, path, ranks)
        assert status == 0, err
    same_files(one, two)
    shutil.copytree(two, again)
    status, out, err = by_ranks(again, path, 2, "-restart", "r.6.h5")
    assert status == 0, err
    same_files(one, again)
    assert out.count("behind") == 1 and "one has all points" in out
    assert err.count("group 'no'") == 1
