"""How much memory this machine has, and what is said where a scene needs more."""

from math import ceil, inf
from mmap import PAGESIZE
from pathlib import Path
from typing import NamedTuple

from karamelo_py.language.scene import Scene
from karamelo_py.script.errors import Place, ScriptError

# Of all memory: what the system keeps for itself and gives back when it has to.
SLACK = 0.03
GIB = 2**30


class MachineMemory(NamedTuple):
    """Bytes that a machine, or a job on it, has yet, and has in all; swap is among them.

    More than `free` may be had where the system does not tell of all that it can give back (caches
    of ZFS); more than `whole` may not.
    """

    free: float
    whole: float


def machine_memory(processes: int = 1, root: Path = Path("/")) -> MachineMemory | None:
    """What can be had at most: free, or held by caches and swap; None where no one tells.

    The machine's (Linux), or less where the processes of a container or of a batch job have a limit
    (cgroup, of either version), or each of its own (ulimit -v).

    Parameters
    ----------
    processes
        How many share the scene on this machine: so many limits of a process are there.
    root
        For tests.
    """
    machine = _numbers(root / "proc/meminfo", 1024)
    try:
        total = machine["MemTotal:"]
        swap = MachineMemory(machine["SwapFree:"], machine["SwapTotal:"])
        left = machine["MemAvailable:"] + swap.free + SLACK * total
    except KeyError:
        return None
    found = [MachineMemory(left, total + swap.whole), *_of_process(root / "proc/self", processes)]
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            top, limits = root / "sys/fs/cgroup", _of_second
        elif "memory" in controllers.split(","):
            top, limits = root / "sys/fs/cgroup/memory", _of_first
        else:
            continue
        # In a container the path may be that outside; its own limit stands at the top then.
        inner = top / path.strip("/")
        for folder in (inner, *inner.parents):
            found += limits(folder, swap)
            if folder == top:
                break
    return MachineMemory(*map(min, zip(*found, strict=True)))


def free_bytes() -> float | None:
    """What is free, see `machine_memory`."""
    found = machine_memory()
    return None if found is None else found.free


def _of_process(folder: Path, processes: int) -> list[MachineMemory]:
    """What so many processes with the limit of this one may have: of addresses, used or not."""
    for line in _lines(folder / "limits"):
        if line.startswith("Max address space") and line.split()[3] != "unlimited":
            limit = float(line.split()[3])
            pages = [float(word) for text in _lines(folder / "statm") for word in text.split()[:1]]
            left = limit - PAGESIZE * sum(pages) + SLACK * limit
            return [MachineMemory(processes * left, processes * limit)]
    return []


def _of_second(folder: Path, swap: MachineMemory) -> list[MachineMemory]:
    """What a group of version 2 may have."""
    limit, used = (_number(folder / f"memory.{name}") for name in ("max", "current"))
    if limit is None or used is None:
        return []
    stat = _numbers(folder / "memory.stat", 1)
    kept = ("active_file", "inactive_file", "slab_reclaimable")
    most, out = (_number(folder / f"memory.swap.{name}") for name in ("max", "current"))
    if most is not None and out is not None:
        swap = MachineMemory(min(swap.free, most - out), min(swap.whole, most))
    left = limit - used + sum(stat.get(name, 0) for name in kept) + swap.free + SLACK * limit
    return [MachineMemory(left, limit + swap.whole)]


def _of_first(folder: Path, swap: MachineMemory) -> list[MachineMemory]:
    """What a group of version 1 may have."""
    limit, used = (_number(folder / f"memory.{n}_in_bytes") for n in ("limit", "usage"))
    if limit is None or used is None:
        return []
    stat = _numbers(folder / "memory.stat", 1)
    cached = sum(stat.get(f"total_{name}_file", 0) for name in ("active", "inactive"))
    found = [MachineMemory(limit - used + cached + swap.free + SLACK * limit, limit + swap.whole)]
    limit, used = (_number(folder / f"memory.memsw.{n}_in_bytes") for n in ("limit", "usage"))
    if limit is not None and used is not None:
        found.append(MachineMemory(limit - used + cached + SLACK * limit, limit))
    return found


def _lines(path: Path) -> list[str]:
    """The lines of a file; none where there is no file."""
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except OSError:
        return []


def _number(path: Path) -> float | None:
    """The number in a file; None where there is no file, or no limit."""
    try:
        return float(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _numbers(path: Path, unit: int) -> dict[str, float]:
    """A number in each line of a file, by the word before it."""
    try:
        return {word: float(number) * unit for word, number, *_ in map(str.split, _lines(path))}
    except ValueError:
        return {}


def on_machine(hub: Scene) -> int:
    """How many processes share the scene on this machine."""
    return hub.settings.comm.on_machine


def share_of_machine(hub: Scene) -> float:
    """Which part of a scene is on this machine, where several share it."""
    comm = hub.settings.comm
    return comm.on_machine / comm.size


def room_for(hub: Scene, already: int, dimension: int) -> float:
    """How many points there may be beside those that are there `already`, whatever their fields.

    Two places, a velocity and a mass in single precision, and three numbers that are whole.
    """
    of_one = 4 * (3 * dimension + 1) + 16
    found = machine_memory(on_machine(hub))
    whole = inf if found is None else found.whole
    return max(whole / share_of_machine(hub) / of_one - already, 0.0)


def in_words(count: float) -> str:
    """So many bytes."""
    size = count / GIB
    return f"{size:.0f} GiB" if size >= 100 else f"{size:.3g} GiB"


class TooLarge(NamedTuple):
    """A scene that needs more than is there.

    Attributes
    ----------
    what
        What it has, such as ``400000000 points``.
    need
        Bytes, at least.
    dimension
        Of the scene: bytes go with that power of the number of cells along a side.
    place
        Of the solid.
    beside
        What else is to be said of the need, such as of how many processes it is.
    single
        What single precision would need; 0 where nobody asks.
    """

    what: str
    need: float
    dimension: int
    place: Place | None
    beside: str = ""
    single: float = 0.0

    @property
    def words(self) -> str:
        """What it needs."""
        need = in_words(self.need)
        return f"the scene has {self.what}, which take at least {need} of memory{self.beside}"

    def ways(self, there: float) -> str:
        """What would bring it down to what is `there`."""
        # Two digits, rounded up.
        larger = ceil(10 * (self.need / max(there, 1.0)) ** (1 / self.dimension)) / 10
        ways = [f"cells {max(larger, 1.1):g} times as large, or fewer points per cell"]
        if 0 < self.single < there:
            ways.append(f"precision(single), which needs at least {in_words(self.single)}")
        ways.append("processes on several machines (mpiexec), which share the points out")
        return "; ".join(ways)

    def error(self, there: MachineMemory) -> ScriptError:
        """The error for more than there ever is."""
        error = ScriptError(
            f"{self.words}; this machine has {in_words(there.whole)} in all",
            place=self.place,
            hint=self.ways(there.whole),
        )
        error.command = "solid"
        return error

    def warning(self, there: MachineMemory) -> str:
        """What is said of more than is free: who may have it the system knows alone."""
        return f"{self.words}; this machine has {in_words(there.free)} free: it may not fit"
