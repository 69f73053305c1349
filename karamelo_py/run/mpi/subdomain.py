"""The part of a scene on one process."""

import time
from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from karamelo_py.compiler import address_of_python
from karamelo_py.kernels import ranks
from karamelo_py.kernels.arrays import DT, TIMESTEP, Hooks, NoHooks, Setup
from karamelo_py.kernels.contact import SeparateFields
from karamelo_py.kernels.ranks import Linked
from karamelo_py.kernels.totals import CONTACT_LOSS, rounded
from karamelo_py.run.checkpoint.arrays import kept_at_nodes, own_share, remembered_at, take_points
from karamelo_py.run.mpi import partition
from karamelo_py.run.mpi.whole import Whole
from karamelo_py.run.state import SceneState
from karamelo_py.run.tiles import WholeDomain
from karamelo_py.scene.comm import SerialComm
from karamelo_py.script.formula import GLOBAL, UNIFORM

LEARN_EVERY = 100  # steps between checks of the load balance


class Load:
    """Measured time of sweeps over the points of each block, and of all other work."""

    def __init__(self, blocks: int):
        # Cost per step of a point of each block, and of a node in reach.
        self.costs = np.append(np.ones(blocks), 0.0)
        self._spent = np.zeros((2, blocks + 1), np.int64)  # nanoseconds; points times steps
        self._rest = self._at = blocks
        self._since: int | None = None

    def pause(self) -> None:
        self._since = None

    def note(self) -> None:
        if self._since is not None:
            self._spent[0, self._at] += time.perf_counter_ns() - self._since

    def resume(self, block: int | None = None) -> None:
        self._at = self._rest if block is None else block
        self._since = time.perf_counter_ns()

    def next_block(self) -> None:
        self.resume((self._at + 1) % self._rest)

    def done(self, counts: list[int], steps: int) -> None:
        self._spent[1] += np.array(counts) * steps

    def learn(self, comm: SerialComm) -> None:
        seconds, done = comm.allreduce(self._spent)
        self._spent //= 2
        if (seconds[:-1] > 0).all() and (done > 0).all():
            self.costs = seconds / done


class Subdomain(WholeDomain):
    """The part of a scene on one process.

    Kernels call `answer` when they need data of other processes (:mod:`karamelo_py.kernels.ranks`).
    """

    parted = True

    def __init__(self, simulation: SceneState):
        super().__init__(simulation)
        self.comm = simulation.comm
        assert isinstance(simulation.tiles, partition.SharedTiles)
        self.tiles = simulation.tiles
        s = simulation.setup
        self.load = Load(len(s.blocks))
        self.control = s.control
        self.at_once = False  # published values are summed in each step
        self.due: set[int] = set()  # slots that are summed only after the last step
        linked = Linked(address_of_python(self.answer, ranks.CALL), self.tiles.foreign)
        simulation.setup = s._replace(control=s.control._replace(ranks=linked))
        self._counted_at = self._learned_at = int(s.control.values[TIMESTEP])

    def migrate(self, s: Setup) -> Setup:
        self.share_memory()
        self.account()
        return self.tiles.migrate(s, self.learn())

    def put(self, shares: list[dict[str, np.ndarray]]) -> None:
        simulation, tiles = self.simulation, self.tiles
        s, blocks = simulation.setup, []
        tiles.empty_nodes(s)
        for k, block in enumerate(s.blocks):
            tilings = [partition.stripped(subdomain, f"tiling/{k}/") for subdomain in shares]
            points = [partition.stripped(subdomain, f"points/{k}/") for subdomain in shares]
            order = partition.by_tile(tilings)
            arrays = {
                name: np.take(
                    np.concatenate([one[name] for one in points], axis=-1), order, axis=-1
                )
                for name in points[0]
            }
            partition.join_tilings(block.tiling, tilings)
            blocks.append(block._replace(points=take_points(block.points, arrays, "")))
        simulation.setup = s._replace(blocks=tuple(blocks))
        tiles.lay_out(simulation.setup)

    def contact_memory(self) -> list[np.ndarray]:
        return remembered_at(self.simulation, np.array([[0, len(self.tiles.foreign)]]))

    def memory(self) -> list[np.ndarray]:
        kept = kept_at_nodes(self.simulation.setup)
        return [*self.contact_memory(), *(array for _, array in kept)]

    def share_memory(self) -> None:
        nodes, step, contact = self.counted(), self.simulation.step, self.contact_memory()
        self.share_kept()
        if contact:
            last = max(step - self.simulation.setup.contact.memory.max(), 0)
            touched = [(np.abs(one[nodes]) > last).any(axis=1) for one in contact]
            self._share(nodes[np.any(touched, axis=0)], contact)

    def share_kept(self) -> None:
        if kept := kept_at_nodes(self.simulation.setup):
            self._share(self.counted(), [array for _, array in kept])

    def _share(self, numbers_here: np.ndarray, arrays: list[np.ndarray]) -> None:
        for nodes, *rows in self.comm.allgather(
            (numbers_here, *(one[numbers_here] for one in arrays))
        ):
            for one, values in zip(arrays, rows, strict=True):
                one[nodes] = values

    def counted(self) -> np.ndarray:
        nodes = super().counted()
        return nodes[self.tiles.foreign[nodes] == 0]

    @cached_property
    def _whole(self) -> Whole:
        return Whole(self.simulation, self)

    def act(self, function: Callable[[Setup], None], s: Setup) -> None:
        self._whole.act(function)

    def state(self) -> dict[str, np.ndarray]:
        return {"owner": self.tiles.owner}

    def own_part(self, state: Mapping[str, Any]) -> Mapping[str, Any]:
        return own_share(self.simulation, state, self.load.costs)

    def begin(self, hooks: Hooks | NoHooks, *, from_python: bool) -> None:
        self.at_once = from_python or reads_totals(hooks)
        self.rebalance()
        self._counted_at = self.simulation.step
        self.load.pause()

    def end(self) -> None:
        self.account()
        self._publish()

    def account(self) -> None:
        blocks, step = self.simulation.setup.blocks, self.simulation.step
        counts = [block.points.mass.size for block in blocks]
        counts.append(sum(int(partition.nodes_of(block.tiling).sum()) for block in blocks))
        self.load.done(counts, step - self._counted_at)
        self._counted_at = step
        self.load.pause()

    def learn(self) -> np.ndarray:
        self._learned_at = self.simulation.step
        self.load.learn(self.comm)
        return self.load.costs

    def rebalance(self) -> None:
        simulation, tiles = self.simulation, self.tiles
        s = simulation.setup
        motion = s.control.motion[0]
        sorted_next = motion.drift > motion.drift_limit  # a sort may move the boundaries
        due = abs(simulation.step - self._learned_at) >= LEARN_EVERY
        due = due and not (tiles.direct or sorted_next)
        if not due or not tiles.balance(partition.work_of(tiles.loads(s.blocks), self.learn())):
            return
        self.share_memory()
        owners = [tiles.owner[partition.occupied(block.tiling)[0]] for block in s.blocks]
        others = tiles.partners(np.bincount(np.concatenate(owners), minlength=self.comm.size))
        sent = {rank: partition.share_of(s, tiles.owner == rank) for rank in others}
        mine = partition.share_of(s, tiles.owner == self.comm.rank)
        self.put([mine, *self.comm.exchange(sent).values()])

    def answer(self, request: int, a: int, b: int) -> int:
        try:
            self.load.note()
            result = self._answer(request, a, b)
            if request == ranks.NEXT:
                self.load.next_block()
            else:
                self.load.resume(0 if request in {ranks.SWEEP, ranks.GIVE} else None)
            return result
        except BaseException as error:
            # Exceptions cannot pass through a kernel, and other processes are waiting.
            self.comm.fail(error)
            raise

    def _answer(self, request: int, a: int, b: int) -> int:
        if request == ranks.GIVE:
            self.tiles.give(self.simulation.setup, a, b)
        elif request == ranks.TAKE:
            self.tiles.take()
        elif request == ranks.TOTALS:
            self._totals(a, b)
        elif request == ranks.LARGEST:
            self.comm.allreduce_max(self.control.answer[:a])
        elif request == ranks.NUMBER:
            return int(self.comm.allreduce(np.array([a]))[0])
        return 0  # other requests only record the time

    def _totals(self, first: int, count: int) -> None:
        rows = slice(first, first + count)
        if CONTACT_LOSS < first < len(self.control.values) and not self.at_once:
            self.due.update(range(first, first + count))
            self.control.answer[:count] = self.control.values[rows]
            return
        of_all = self.comm.allreduce(self.control.totals[rows])
        for k in range(count):
            self.control.answer[k] = rounded(of_all[k])

    def _publish(self) -> None:
        rows, values = sorted(self.due), self.control.values
        self.due.clear()
        if rows:
            for row, total in zip(
                rows, self.comm.allreduce(self.control.totals[rows]), strict=True
            ):
                values[row] = rounded(total)
            contact = self.simulation.setup.contact
            for of, to in contact.copies if isinstance(contact, SeparateFields) else ():
                values[to : to + 3] = values[of : of + 3]


def reads_totals(hooks: Hooks | NoHooks) -> bool:
    code = hooks.code if isinstance(hooks, Hooks) else np.empty((0, 2), np.int64)
    return bool(((code[:, 0] % UNIFORM == GLOBAL) & (code[:, 1] > DT)).any())
