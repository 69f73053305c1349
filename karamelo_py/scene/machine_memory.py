"""Memory that is available on this machine or to this job."""

import warnings
from collections.abc import Callable
from contextlib import suppress
from math import inf
from pathlib import Path
from typing import NamedTuple

try:
    import resource
except ImportError:  # Windows
    resource = None  # type: ignore[assignment]

from karamelo_py.language.scene import Scene
from karamelo_py.script.errors import ScriptError, render_message

# Fraction of memory that the system reserves but releases when needed.
SLACK = 0.03

# Control group files, versions 2 and 1: limit, usage, and droppable cache in memory.stat.
_OF_GROUPS = (
    ("memory.max", "memory.current", ("active_file", "inactive_file", "slab_reclaimable")),
    (
        "memory.limit_in_bytes", "memory.usage_in_bytes",
        ("total_active_file", "total_inactive_file"),
    ),
)  # fmt: skip


class MachineMemory(NamedTuple):
    """Memory in bytes, including swap; caches that are not reported (ZFS) are not `free`."""

    free: float
    whole: float


def machine_memory(processes: int = 1, root: Path = Path("/")) -> MachineMemory | None:
    """Return the memory available to `processes`, or None if the system does not report it.

    Includes limits of the machine, of containers and jobs (cgroups) and of processes (ulimit -v).
    """
    import psutil

    try:
        with warnings.catch_warnings(action="ignore"):  # of numbers that are not used
            machine, swap = psutil.virtual_memory(), psutil.swap_memory()
    except (OSError, RuntimeError):
        return None
    left = machine.available + swap.free + SLACK * machine.total
    of_groups = _of_groups(root, MachineMemory(swap.free, swap.total))
    limits = [MachineMemory(left, machine.total + swap.total), *of_groups]
    limit = resource.getrlimit(resource.RLIMIT_AS)[0] if resource else -1
    if limit >= 0:
        left = (1 + SLACK) * limit - psutil.Process().memory_info().vms
        limits.append(MachineMemory(processes * left, processes * limit))
    return MachineMemory(*map(min, zip(*limits, strict=True)))


def _of_groups(root: Path, swap: MachineMemory) -> list[MachineMemory]:
    limits = []
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        if controllers and "memory" not in controllers.split(","):
            continue
        top = root / "sys/fs/cgroup" / ("memory" if controllers else "")
        limit_file, used_file, dropped = _OF_GROUPS[bool(controllers)]
        # A container may see its path on the host; the limit is then in the top folder.
        inner = top / path.strip("/")
        for folder in (inner, *inner.parents[: len(inner.parts) - len(top.parts)]):
            limit, used = (_number(folder / name) for name in (limit_file, used_file))
            if limit is None or used is None:
                continue
            most, out = (_number(folder / f"memory.swap.{name}") for name in ("max", "current"))
            free, whole = swap.free, swap.whole
            if most is not None and out is not None:
                free, whole = min(free, most - out), min(whole, most)
            stat = dict(line.split(maxsplit=1) for line in _lines(folder / "memory.stat"))
            cached = sum(float(stat.get(name, 0)) for name in dropped)
            limits.append(MachineMemory((1 + SLACK) * limit - used + cached + free, limit + whole))
    return limits


def _lines(path: Path) -> list[str]:
    with suppress(OSError):
        return path.read_text(encoding="utf-8").splitlines()
    return []


def _number(path: Path) -> float | None:
    with suppress(OSError, ValueError):
        return float(path.read_text(encoding="utf-8"))
    return None


def taken() -> int:
    import psutil

    return psutil.Process().memory_info().rss


GIB = 2**30
MANY = 20_000_000  # points above which placing them takes seconds


def in_words(count: float) -> str:
    size = count / GIB
    return f"{size:.0f} GiB" if size >= 100 else f"{size:.3g} GiB"


class Room(NamedTuple):
    whole: float  # bytes of the machine or job
    of_one: int  # smallest number of bytes of a point
    already: int
    single: bool  # single precision
    say: Callable[[str], None] = lambda text: None

    @property
    def most(self) -> float:
        return max(self.whole / self.of_one - self.already, 0.0)

    def tell(self, count: float) -> None:
        if count > MANY:
            words = f"placing about {count:.2g} points, which take more than "
            self.say(render_message("note", f"{words}{in_words(count * self.of_one)} of memory"))

    def refused(self, count: float) -> ScriptError:
        need = in_words((count + self.already) * self.of_one)
        return ScriptError(
            f"with these, the scene has some {count + self.already:.2g} points, which take more "
            f"than {need} of memory; this machine has {in_words(self.whole)} in total",
            hint="larger cells, or fewer points per cell"
            + ("" if self.single else "; precision(single) before this line halves the memory"),
            code="memory",
        )


def room_for_points(hub: Scene, already: int, dimension: int, state: int) -> Room:
    """Return the memory for points and the bytes of a point with `state` state variables.

    A point has two positions, a velocity, a mass, the state and three integers. The last good state
    that a run stores holds a position, a velocity and the state again.
    """
    settings = hub.settings
    memory, comm = machine_memory(settings.comm.on_machine), settings.comm
    single = settings.precision == "single"
    numbers = 3 * dimension + 1 + state + (0 if hub.checking else 2 * dimension + state)
    of_one = (4 if single else 8) * numbers + 16
    whole = inf if memory is None else memory.whole
    return Room(whole / comm.share_here, of_one, already, single, hub.console.say)
