"""A small hub for tests of domain, regions, solids and groups, and arguments without a parser."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

from karamelo_py.points.basis.linear import Linear
from karamelo_py.points.laws import specific_volume
from karamelo_py.scene.domain import Domain
from karamelo_py.scene.hub import Catalogue, Hub
from karamelo_py.scene.material import Material
from karamelo_py.script.errors import Place
from karamelo_py.script.values import Values
from karamelo_py.styles.methods.base import Method
from karamelo_py.styles.solids.region import RegionSolid

DENSITY = 1000.0


class FakeLaw(NamedTuple):
    """A law that has a density and nothing else."""

    rho: float = DENSITY


@specific_volume.on(FakeLaw)
def _(law):
    return 1 / law.rho


class FakeArgument:
    """An argument as a script has it: a number, a word, or a formula (anything else)."""

    def __init__(self, text, index=0):
        self.text = str(text)
        self.place = Place("in.test", 1, index + 1, len(self.text), "")

    def word(self):
        return self.text if self.text.isidentifier() else None

    def value(self, hub):
        try:
            return float(self.text)
        except ValueError:
            return object()


def arguments(*texts):
    """Arguments from texts or numbers; the column of each is its number, from 1."""
    return [FakeArgument(text, index) for index, text in enumerate(texts)]


class FakeHub:
    """What the parts of a scene see of a hub."""

    def __init__(self, dimension=2, lo=-0.5, hi=0.5, h=0.05):
        self.place = None
        self.folder = Path.cwd()
        self.values = Values()
        self.parts = {}
        self.materials = Catalogue("material", self)
        self.materials.add("steel", Material("material", "fake", FakeLaw()))
        self.rehearsing = self.checking = False
        self.warnings = []
        self.update = SimpleNamespace(thermal=False)
        self.use(Method, Linear())
        self.regions = Catalogue("region", self)
        self.solids = Catalogue("solid", self)
        self.groups = Catalogue("group", self)
        self.domain = (
            Domain(dimension, [lo] * dimension, [hi] * dimension, h) if dimension else None
        )

    _lattices = None
    lattices = Hub.lattices
    catalogues = Hub.catalogues

    def use(self, method, basis):
        """Choose method and basis, as the command does."""
        self.update.method = method(self)
        self.update.method.basis = basis

    def warn(self, message, place=None, hint=None):
        self.warnings.append(message)

    def region(self, ID, style, *texts):
        """Make and file a region of class `style`."""
        return self.regions.add(ID, style(self, *arguments(*texts)))

    def combine(self, ID, style, *parts):
        """Make and file a region from other regions."""
        return self.regions.add(ID, style(self, *parts))

    def solid(self, ID, region, ppc=2, h=None, **options):
        """Make and file a solid."""
        return self.solids.add(
            ID,
            RegionSolid(self, region, ppc, self.materials["steel"], h or self.domain.h, **options),
        )
