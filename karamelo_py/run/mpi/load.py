"""The cost of points and nodes at a process, measured while it takes steps."""

import time

import numpy as np

from karamelo_py.scene.comm import SerialComm


class Load:
    """Time in sweeps over the points of each block, and in all else that is no waiting.

    Attributes
    ----------
    costs
        (blocks + 1,) of a point of each block in a step, and of a node that the points of a tile
        may reach; at first all points cost the same, and nodes nothing.
    """

    def __init__(self, blocks: int):
        self.costs = np.append(np.ones(blocks), 0.0)
        self._spent = np.zeros((2, blocks + 1), np.int64)  # nanoseconds, and points times steps
        self._rest = self._at = blocks
        self._since: int | None = None

    def pause(self) -> None:
        """Do not count the time until the next sweep."""
        self._since = None

    def note(self) -> None:
        """Count the time since the last `resume`."""
        if self._since is not None:
            self._spent[0, self._at] += time.perf_counter_ns() - self._since

    def resume(self, block: int | None = None) -> None:
        """Begin to count the time of a sweep over the points of a block, or of something else."""
        self._at = self._rest if block is None else block
        self._since = time.perf_counter_ns()

    def next_block(self) -> None:
        """Go on with the next block, from the last with the first."""
        self.resume((self._at + 1) % self._rest)

    def done(self, counts: list[int], steps: int) -> None:
        """Take note of so many steps with these numbers of points, and of nodes."""
        self._spent[1] += np.array(counts) * steps

    def learn(self, comm: SerialComm) -> None:
        """Find the costs from what all have spent; later times count more."""
        seconds, done = comm.allreduce(self._spent)
        self._spent //= 2
        if (seconds[:-1] > 0).all() and (done > 0).all():
            self.costs = seconds / done
