"""Nothing is compiled anew for what it does not use, nor for no points at all."""

from math import inf

import numpy as np
import pytest
from numba import config, typeof

from karamelo_py.compiler.fields import rows_of_points
from karamelo_py.compiler.trace.held import held_type
from karamelo_py.kernels.arrays import known_to_laws
from karamelo_py.kernels.export import export, export_state
from karamelo_py.kernels.sorting import sort_points
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.scene.hub import Hub

SCENE = """
method({method})
dimension(2, 0, 2, 0, 2, 0.1)
axisymmetric({round})
region(disk, cylinder, 1, 1, 0.72)
material(rubber, {law}, 2, 100, 0.3{heat})
solid(disk, region, disk, 2, rubber, 0.1, 20)
"""
SCENES = {
    "plain": {},
    "spline": {"method": "ulmpm, APIC, quadratic-spline", "law": "neo-hookean"},
    "domains": {"method": "ulcpdi, FLIP, linear, 1, Q4"},
    "total": {"method": "tlmpm, FLIP, linear, 1"},
    "warm": {"method": "ulmpm, MLS, linear, thermo-mechanical", "heat": ", 2, 3"},
    "round": {"round": "true"},
}


def sorted_scene(method="ulmpm, FLIP, linear, 1", law="linear", heat="", round="false"):
    hub = Hub(Console(quiet=True))
    hub.interpreter = Interpreter(hub)
    hub.interpreter.run_text(SCENE.format(method=method, law=law, heat=heat, round=round))
    hub.simulation.begin(inf)
    hub.simulation.sort()
    return hub.simulation


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_one_kernel_sorts_points_of_all_kinds():
    """In a dimension and a precision, whatever laws, bases and fields there are."""
    sorted_scene()
    known = set(sort_points.units)
    for words in SCENES.values():
        assert sorted_scene(**words).count > 400
    assert set(sort_points.units) == known


def test_laws_see_the_same_of_points_in_all_methods():
    """Where they are linear: fields, places and domains belong to others."""
    kinds = set()
    for name in ("plain", "domains", "total"):
        points = sorted_scene(**SCENES[name]).setup.blocks[0].points
        kinds.add(held_type(typeof(known_to_laws(points))))
    assert len(kinds) == 1


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_no_points_compile_nothing():
    """As they are asked for to learn what a column would be of."""
    simulation = sorted_scene()
    known = set(export_state.units), set(export.units)
    fields = next(reversed([*simulation.points.some(None)]))
    for name in ("volume", "s11", "strain_energy"):
        assert fields.particle(name).shape == (0,)
    assert (set(export_state.units), set(export.units)) == known


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64])
@pytest.mark.parametrize("count", [1, 7, 8, 15, 16, 17, 40, 48, 88, 648])
def test_rows_of_points_are_of_one_type(count, kind):
    """Whatever their number: without gaps between rows they would be of another."""
    assert typeof(rows_of_points((3, count), kind)).layout == "A"
