"""How much memory this machine has free, and what is said where a scene needs more."""

from math import ceil, inf
from pathlib import Path

from karamelo_py.language.scene import Scene
from karamelo_py.script.errors import Place, ScriptError

# Of all memory: what the system keeps for itself and gives back when it has to.
SLACK = 0.03
GIB = 2**30


def free_bytes(root: Path = Path("/")) -> float | None:
    """Memory that can be had at most: free, or held by caches and swap; None where no one tells.

    The machine's (Linux), or less where the processes of a container or of a batch job have a limit
    (cgroup, of either version). `root` is for tests.
    """
    machine = _numbers(root / "proc/meminfo", 1024)
    try:
        swap = machine["SwapFree:"]
        found = [machine["MemAvailable:"] + swap + SLACK * machine["MemTotal:"]]
        groups = (root / "proc/self/cgroup").read_text(encoding="utf-8").splitlines()
    except KeyError:
        return None
    except OSError:
        groups = []
    for line in groups:
        _, controllers, path = line.split(":", 2)
        if controllers == "":
            top, left = root / "sys/fs/cgroup", _left_of_second
        elif "memory" in controllers.split(","):
            top, left = root / "sys/fs/cgroup/memory", _left_of_first
        else:
            continue
        # In a container the path may be that outside; its own limit stands at the top then.
        inner = top / path.strip("/")
        for folder in (inner, *inner.parents):
            found += left(folder, swap)
            if folder == top:
                break
    return min(found)


def _left_of_second(folder: Path, swap: float) -> list[float]:
    """What a group of version 2 may have yet."""
    limit, used = (_number(folder / f"memory.{name}") for name in ("max", "current"))
    if limit is None or used is None:
        return []
    stat = _numbers(folder / "memory.stat", 1)
    kept = ("active_file", "inactive_file", "slab_reclaimable")
    most, out = (_number(folder / f"memory.swap.{name}") for name in ("max", "current"))
    swap = swap if most is None or out is None else min(swap, most - out)
    return [limit - used + sum(stat.get(name, 0) for name in kept) + swap + SLACK * limit]


def _left_of_first(folder: Path, swap: float) -> list[float]:
    """What a group of version 1 may have yet."""
    limit, used = (_number(folder / f"memory.{n}_in_bytes") for n in ("limit", "usage"))
    if limit is None or used is None:
        return []
    stat = _numbers(folder / "memory.stat", 1)
    cached = sum(stat.get(f"total_{name}_file", 0) for name in ("active", "inactive"))
    found = [limit - used + cached + swap + SLACK * limit]
    limit, used = (_number(folder / f"memory.memsw.{n}_in_bytes") for n in ("limit", "usage"))
    if limit is not None and used is not None:
        found.append(limit - used + cached + SLACK * limit)
    return found


def _number(path: Path) -> float | None:
    """The number in a file; None where there is no file, or no limit."""
    try:
        return float(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def _numbers(path: Path, unit: int) -> dict[str, float]:
    """A number in each line of a file, by the word before it."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        return {word: float(number) * unit for word, number, *_ in map(str.split, lines)}
    except (OSError, ValueError):
        return {}


def share_of_machine(hub: Scene) -> float:
    """Which part of a scene is on this machine, where several share it."""
    crew = hub.settings.crew
    return 1.0 if crew is None else crew.on_machine / crew.size


def room_for(hub: Scene, already: int, dimension: int) -> float:
    """How many points there may be beside those that are there `already`, whatever their fields.

    Two places, a velocity and a mass in single precision, and three numbers that are whole.
    """
    of_one = 4 * (3 * dimension + 1) + 16
    return max((free_bytes() or inf) / share_of_machine(hub) / of_one - already, 0.0)


def in_words(count: float) -> str:
    """So many bytes."""
    size = count / GIB
    return f"{size:.0f} GiB" if size >= 100 else f"{size:.3g} GiB"


def too_large(
    what: str, need: float, free: float, dimension: int, *, place: Place | None,
    beside: str = "", single: float = 0.0,
) -> ScriptError:  # fmt: skip
    """The error for a scene with `what`, which needs more bytes than there are.

    Parameters
    ----------
    what
        What it has, such as ``400000000 points``.
    need, free
        Bytes.
    dimension
        Of the scene: bytes go with that power of the number of cells along a side.
    place
        Of the solid.
    beside
        What else is to be said of the need, such as of how many processes it is.
    single
        What single precision would need; 0 where nobody asks.
    """
    # Two digits, rounded up.
    larger = ceil(10 * (need / free) ** (1 / dimension)) / 10
    ways = [f"cells {max(larger, 1.1):g} times as large, or fewer points per cell"]
    if 0 < single < free:
        ways.append(f"precision(single), which needs at least {in_words(single)}")
    ways.append("processes on several machines (mpiexec), which share the points out")
    error = ScriptError(
        f"the scene has {what}, which take at least {in_words(need)} of memory{beside}; "
        f"this machine has {in_words(free)} free",
        place=place,
        hint="; ".join(ways),
    )
    error.command = "solid"
    return error
