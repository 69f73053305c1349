"""The arrays of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from karamelo_py.compiler import fields
from karamelo_py.compiler.fields import field
from karamelo_py.compiler.threads import Serial, Threaded, new_team
from karamelo_py.kernels.arrays import DT, TIME, TIMESTEP, NoHooks, some_of
from karamelo_py.kernels.clock import all_well, step_size
from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.equations.node_updates import SumsToVelocity
from karamelo_py.kernels.heat import SHOW, Conducting
from karamelo_py.kernels.step import take_rows
from karamelo_py.kernels.sweep import Extent, Visit, sweep, sweep_nodes
from karamelo_py.kernels.table import SEAM, SUMS, shown_sums
from karamelo_py.output.fields import Fields
from karamelo_py.points.laws import law_kind
from karamelo_py.points.laws.further import without_rate
from karamelo_py.run.access import NodesByNumber
from karamelo_py.run.checkpoint import arrays as checkpoint
from karamelo_py.run.checkpoint.parts import RollbackPoint
from karamelo_py.run.lower.build import (
    State,
    check_scene,
    fixes_of_bodies,
    fixes_of_walls,
    lower,
    thread_count,
    warms_by_friction,
)
from karamelo_py.run.lower.check_plugins import try_parts
from karamelo_py.run.lower.memory import check_room, no_room
from karamelo_py.run.mpi.subdomain import Subdomain
from karamelo_py.run.periodic import mark_nodes, return_points
from karamelo_py.run.step_size import carried_on
from karamelo_py.run.tiles import WholeDomain
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import foreign_parts


def scene_key(hub: Hub) -> tuple:
    update = hub.update
    walls = fixes_of_walls(hub) if update.method else []
    return (
        hub.domain,
        hub.domain.h if hub.domain else None,
        tuple(hub.solids.values()),
        tuple(solid.material for solid in hub.solids.values()),
        update.method,
        type(update.scheme),
        update.scheme,
        update.half_start,
        update.transfer,
        type(update.transfer),
        update.thermal,
        update.anti_locking,
        update.boundary,
        fields.declared([*hub.fixes.values(), *hub.computes.values()], "point_fields"),
        fields.declared(hub.fixes.values(), "node_fields"),
        hub.fields.rate_is_asked_for(),
        update.method is not None and warms_by_friction(hub),
        [(fix.group, fix.group.parts, fix.held_directions) for fix in walls],
        fixes_of_bodies(hub),
        hub.settings.precision,
        hub.settings.threads,
    )


class SceneArrays:
    def __init__(self, hub: Hub, previous: SceneArrays | None = None):
        self.hub = hub
        self.comm: SerialComm = hub.settings.comm
        comm = self.comm
        self.points = Fields(hub, self)
        self.key = scene_key(hub)
        self.count = sum(s.count for s in hub.solids.values())
        check_scene(hub)
        check_room(hub, copied=previous is None and bool(hub.in_run))
        # The first sort distributes points by tiles.
        ends = (self.count * comm.rank // comm.size, self.count * (comm.rank + 1) // comm.size)
        try:
            state = previous.state() if previous else None
            self.setup, self.tiles = lower(hub, state, ids=None if comm.size == 1 else ends)
        except MemoryError as error:
            raise no_room(hub, error) from None
        if foreign_parts(hub):
            try_parts(hub, self.setup)
        self.present = np.ones(self.count, np.bool_)  # by id, False for deleted points
        if state is not None:
            self.present[: state.count] = state.present
        self.present[hub.waiting[hub.waiting >= (state.count if state else 0)]] = False
        if len(hub.waiting):
            self.keep_present()
        self.threads = self.tiles.threads = thread_count(hub, self.count)
        self._team = new_team(self.threads)
        self.mode = Threaded(self._team.ctypes.data) if self.threads > 1 else Serial()
        self.tiles.mode = self.mode
        self.domain = Subdomain(self) if comm.size > 1 else WholeDomain(self)
        self.control = self.setup.control
        self.version = 0  # increases when fields change between steps
        self.rollback: RollbackPoint | None = None  # last good state of the last run
        self.mapped = False  # whether nodes show the present state

    def keep_present(self) -> None:
        blocks = (
            some_of(block, np.flatnonzero(self.present[block.points.id]))
            for block in self.setup.blocks
        )
        self.setup = self.setup._replace(blocks=tuple(blocks))

    def fits(self, hub: Hub) -> bool:
        return self.key == scene_key(hub)

    @property
    def nodes(self) -> NodesByNumber:
        return NodesByNumber(self.points)

    @property
    def kin(self) -> NamedTuple:
        return self.setup.kin

    @property
    def now(self) -> int:
        return int(self.control.motion[0].now)

    @property
    def dt(self) -> float:
        return float(self.control.values[DT])

    @property
    def time(self) -> float:
        return float(self.control.values[TIME])

    @property
    def step(self) -> int:
        return int(self.control.values[TIMESTEP])

    def state(self) -> State:
        self.domain.share_memory()
        laws, all_points = {}, self.points.rows()
        for block in self.setup.blocks:
            state = block.points.state
            rows = np.zeros((len(state), self.count), state.dtype)
            for ids, values in all_points.of_all([(block.points.id, state)]):
                rows[:, ids] = values
            laws[without_rate(law_kind(block.laws))] = rows
        kinds = (type(one) for block in self.setup.blocks for one in block.points.fields)
        kept = [kind for kind in dict.fromkeys(kinds) if kind.kept]
        return State(
            self.count,
            self.present,
            all_points.take(lambda points: points.x[self.now]).T,
            all_points.take(lambda points: points.v).T,
            laws,
            {kind.family or kind: all_points.declared(kind).T for kind in kept},
            self.setup.grids,
            {type(one): one.array for one in self.setup.nodes.fields if one.kept},
            self.setup.contact,
            carried_on(self.control),
        )

    def fastest(self, common: Sequence[float] = (0.0, 0.0, 0.0)) -> float:
        velocities = (block.points.v for block in self.setup.blocks)
        # Velocities are passed by component, without a copy, as there may be millions of points.
        components = ((a, c) for v in velocities if v.size for a, c in zip(v, common, strict=False))
        largest = max((max(a.max() - c, c - a.min()) for a, c in components), default=0.0)
        return float(self.comm.allreduce_max(np.array([largest], float))[0])

    def in_tiles(self) -> bool:
        unsorted = 0
        for points, tiling in ((block.points, block.tiling) for block in self.setup.blocks):
            unsorted += tiling.range[: tiling.count[0], 1].max(initial=0) != points.mass.size
        return not self.comm.allreduce(np.array([unsorted]))[0]

    def leaving(self) -> np.ndarray:
        s, then = self.setup, 1 - self.now
        edges = ((s.grids.x0, s.grids.lx), (s.grids.y0, s.grids.ly), (s.grids.z0, s.grids.lz))
        outside = []
        for block in s.blocks:
            points = block.points
            beyond, finite = np.zeros((2, points.id.size), np.bool_)
            finite[:] = True
            slack, inv_h = s.grids.slack[points.grid], s.grids.inv_h[points.grid]
            for y, edge in zip(points.x[then], edges[: s.kin.dimension], strict=False):
                lower, size = (of[points.grid] for of in edge)
                a = (y - lower) * inv_h
                beyond |= (a < -slack) | (a > size + slack)
                finite &= np.isfinite(y)
            outside.append(points.id[beyond & finite])
        return np.sort(np.concatenate(self.comm.allgather(np.concatenate(outside))))

    def changed(self) -> None:
        self.version += 1

    @property
    def bounces(self) -> int:
        return int(self.points.total("bounces"))

    def clear_forces(self) -> None:
        for block in self.setup.blocks:
            force = field(block.points.fields, Force)
            if force is not None:
                force[:] = 0

    def sort(self) -> None:
        """Sort points by tile; points in tiles of other processes are sent there first."""
        self.setup = self.domain.migrate(self.setup)
        domain = self.hub.domain
        if domain.periodic:
            return_points(self.setup, domain)
        self.tiles.sort(self.setup)
        if domain.periodic:
            mark_nodes(self.setup, domain)

    def sort_if_due(self) -> None:
        motion = self.control.motion[0]
        if motion.drift > motion.drift_limit:
            self.sort()

    def bring(self) -> None:
        """Update the whole state on the CPU, with points in the order of tiles."""
        sorted_before = any(block.tiling.count[0] for block in self.setup.blocks)
        if self.comm.allreduce_max(np.array([sorted_before], int))[0] and np.isinf(
            self.control.motion[0].drift
        ):
            self.sort()

    def show_on_nodes(self) -> None:
        """Map the present state to the nodes, unless the last step has done so."""
        if self.mapped:
            return
        self.sort_if_due()
        s = self.setup
        dt = step_size(s)
        visit = Visit((), shown_sums(self.hub.update.scheme.rows), SUMS.weights)
        sweep(s, self.mode, visit, Extent(dt, False, True, False))
        all_well(s)
        take_rows((SEAM,), s, self.mode, NoHooks())
        sweep_nodes(self.mode, SumsToVelocity(), s, dt)
        if isinstance(s.heat, Conducting):
            take_rows(SHOW, s, self.mode, NoHooks())
        self.mapped = True

    def snapshot(self, before: dict[str, np.ndarray] | None = None) -> dict[str, np.ndarray]:
        """Copy the published values and all arrays that a step changes; see `copied`."""
        self.domain.share_kept()
        return checkpoint.copied(self, before or {})

    def restore(self, snapshot: dict[str, np.ndarray]) -> None:
        checkpoint.restore(self, snapshot)
