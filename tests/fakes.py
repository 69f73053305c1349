"""A small hub for tests of output: a cloud of points and a grid with made-up, well-known values."""

import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from karamelo_py.output import node_columns, point_table
from karamelo_py.output.console import Console
from karamelo_py.points.kinematics import KINEMATICS
from karamelo_py.scene.comm import SerialComm
from karamelo_py.scene.lattice import Lattice


class FakeValues(dict):
    """Published names."""

    def names(self):
        return list(self)


class FakeFields:
    """`count` random points, the second half of them of solid 2, and the nodes of a grid."""

    def __init__(self, hub, count):
        self.hub = hub
        self.count = count
        rng = np.random.default_rng(3)
        dimension = hub.domain.dimension
        at = np.zeros((count, 3))
        at[:, :dimension] = rng.uniform(-0.45, 0.45, (count, dimension))
        self.points = {name: at[:, i] for i, name in enumerate("xyz")}
        self.points["id"] = np.arange(1, count + 1)
        self.points["type"] = np.where(np.arange(count) < count // 2, 1, 2)
        for name in ("vx", "vy", "vz", "s11", "seq", "mass"):
            self.points[name] = rng.normal(size=count) * 1e-3
        self.points["volume"] = np.full(count, 0.5 / count)
        cells = [5 if i < dimension else 1 for i in range(3)]
        axes = [np.linspace(-0.5, 0.5, n) if n > 1 else np.zeros(1) for n in cells]
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        self.nodes = {name: nodes[:, i] for i, name in enumerate("xyz")}
        self.nodes["mass"] = np.where(nodes[:, 0] > 0, 1.0, 0.0)
        self.nodes["id"] = np.arange(len(nodes))
        self.nodes["type"] = np.ones(len(nodes), np.int64)
        self.node_count = len(nodes)
        hub.lattices = [Lattice(dimension, hub.domain.lo, hub.domain.hi, hub.domain.h)]

    def absent_at_points(self):
        return point_table.absent(point_table.COLUMNS)

    def absent_at_nodes(self):
        return point_table.absent(node_columns.COLUMNS)

    @property
    def present(self):
        return np.ones(len(self.points["id"]), np.bool_)

    def pieces(self, *, to_first=False):
        yield self

    def each(self, part, name, *arguments):
        found = getattr(part, name)(self, *arguments)
        return [] if found is None else [found]

    def particle_names(self):
        return list(self.points)

    shown_names = particle_names

    def particle(self, name):
        return self.points[name].copy()

    def node_names(self):
        return [name for name in self.nodes if name not in ("id", "type")]

    def node(self, name):
        return self.nodes[name].copy()

    def node_pieces(self, names, *, to_first=False):
        yield self

    @property
    def occupied_nodes(self):
        there = np.flatnonzero(self.nodes["mass"] > 0)
        return len(there), int(there[-1])


class FakeHub:
    """What output sees of a hub."""

    def __init__(self, folder, dimension=2, count=40):
        from karamelo_py.output.schedule import Output

        used = np.arange(3) < dimension
        self.folder, self.asked = Path(folder), set()
        self.domain = SimpleNamespace(
            periodic=(),
            dimension=dimension,
            lo=np.where(used, -0.5, 0.0),
            hi=np.where(used, 0.5, 0.0),
            h=0.25,
            kin=KINEMATICS[dimension](),
        )
        self.update = SimpleNamespace(step=0, time=0.0, dt=0.1, fixed_dt=0.1)
        self.values = FakeValues(Ek=1.0, Ek_s=1.0, Es_s=0.0)
        self.interpreter = SimpleNamespace(files=[], variables={"E": 1000.0, "name": "text"})
        self.rehearsing = self.checking = False
        self.mark = None
        self.console = Console(io.StringIO(), io.StringIO())
        self.fields = FakeFields(self, count)
        self.dumps = {}
        self.fixes = {}
        self.computes = {}
        self.solids = {"left": None, "right": None}
        self.refreshed = []
        self.settings = SimpleNamespace(comm=SerialComm())
        self.output = Output(self)

    def refresh_values(self):
        self.refreshed.append(self.update.step)
        self.values["Ek"] = self.values["Ek_s"] = np.cos(self.update.time) ** 2
        self.values["Es_s"] = 1 - self.values["Ek_s"]

    def run(self, steps):
        """What a run does with output."""
        output, update = self.output, self.update
        output.begin()
        end = update.step + steps
        while update.step < end:
            step = min(output.next_step(update.step), end)
            update.time += update.dt * (step - update.step)
            update.step = step
            if step < end:
                output.write()
        output.end()
