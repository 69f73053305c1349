"""Elastic laws with a temperature: free and hindered expansion, in every kinematics."""

import re

import numpy as np
import pytest
from laws import stretched
from tensors import every_kinematics, flat

from karamelo_py.app.cli import main
from karamelo_py.kernels.laws import law_on
from karamelo_py.points.kinematics import PlaneStrain, Space, inner, sym
from karamelo_py.points.laws import (
    advance,
    cauchy_stress,
    conductivity,
    elastic_strain,
    energy_density,
    heat_capacity,
    initial_state,
    kirchhoff_stress,
    temperature,
    with_stress,
    with_temperature,
)
from karamelo_py.points.laws.linear import LinearConstants
from karamelo_py.points.laws.neo_hookean import NeoHookeanConstants

E, NU, ALPHA, T0 = 200.0, 0.25, 1e-4, 300.0
K = E / (3 * (1 - 2 * NU))
styles = pytest.mark.parametrize("style", [LinearConstants, NeoHookeanConstants])


def warm(style, kin, T):
    law = law_on(style(2.0, E, NU, 0.5, 0.1, ALPHA).checked(), 1.0, T0)
    return law, with_temperature(law, kin, initial_state(law, kin, 1.0), T)


@every_kinematics
@styles
def test_hindered_expansion_makes_pressure(style, kin):
    """sigma = -3 K alpha (T - T0) = -E alpha (T - T0)/(1 - 2 nu)."""
    law, state = warm(style, kin, 310.0)
    p = E * ALPHA * 10 / (1 - 2 * NU)
    expected = np.zeros(len(kin.symmetric_names))
    expected[:3] = -p
    assert cauchy_stress(law, kin, state) == pytest.approx(expected)
    assert kirchhoff_stress(law, kin, state) == pytest.approx(expected)
    assert elastic_strain(law, kin, state)[:3] == pytest.approx([-ALPHA * 10] * 3)
    assert temperature(law, kin, state) == 310 and len(state) == len(warm(style, kin, T0)[1])
    assert heat_capacity(law, 1.0) == 0.5 and conductivity(law, 1.0) == 0.1


@styles
def test_free_expansion_has_no_stress(style):
    law, state = warm(style, Space(), 310.0)
    e = ALPHA * 10
    free = stretched(law, Space(), state, e * np.eye(3), 1)
    assert cauchy_stress(law, Space(), free) == pytest.approx([0] * 6, abs=3 * K * e * e * 4)
    assert elastic_strain(law, Space(), free)[:3] == pytest.approx([0] * 3, abs=e * e)


@every_kinematics
@styles
def test_stress_is_the_derivative_of_the_energy(style, kin):
    """dW = tau : d at a temperature, for small strains of the rate law."""
    law, state = warm(style, kin, 310.0)
    size = 1e-5
    dl = flat(kin, size * np.array([[1.0, 0.3, 0], [-0.2, 0.5, 0], [0, 0, 0.4]]))
    ahead, back = (advance(law, kin, state, s * dl, 1.0) for s in (1, -1))
    change = energy_density(law, kin, ahead) - energy_density(law, kin, back)
    tau = kirchhoff_stress(law, kin, state)
    assert change == pytest.approx(2 * inner(tau, sym(dl)), rel=1e-4)


def test_imposed_stress():
    law, state = warm(LinearConstants, PlaneStrain(), 310.0)
    stress = (1.0, -2.0, 0.5, 0.25)
    new = with_stress(law, PlaneStrain(), state, stress)
    assert cauchy_stress(law, PlaneStrain(), new) == pytest.approx(stress)
    assert temperature(law, PlaneStrain(), new) == 310


SCENE = """
method(METHOD, FLIP, linear, 1)
dimension(2, -0.5, 1.5, 0, 1, 0.25)
region(box, block, 0, 1, 0, 1)
material(m, KIND, 2, 200, 0.25, 0.5, 0.1, 1e-4)
material(n, KIND, 2, 200, 0.25)
solid(s, region, box, 1, m, 0.25, 300)
dump(end, all, particle, 100, end.*.LAMMPS, x, s11, T)
run(5)
"""


@pytest.mark.parametrize("method", ["ulmpm", "tlmpm"])
@pytest.mark.parametrize("kind", ["linear", "neo-hookean"])
def test_scripts(run_interpreted, method, kind):
    """At the temperature of the solid all is at rest."""
    result = run_interpreted(SCENE.replace("METHOD", method).replace("KIND", kind))
    last = result.dump("end.5.LAMMPS")
    assert last["T"].tolist() == [300] * 16 and last.s11.tolist() == [0] * 16


def test_without_heat_nothing_is_carried(tmp_path, capsys):
    path = tmp_path / "in.check"
    script = SCENE.replace("METHOD", "ulmpm").replace("KIND", "neo-hookean")
    for text, count in ((script, 5), (script.replace("1, m,", "1, n,"), 4)):
        path.write_text(text)
        assert main(["check", str(path)]) == 0
        assert re.search(rf"  state +{count} ", capsys.readouterr().out)


@pytest.mark.parametrize("kind", ["linear", "neo-hookean"])
@pytest.mark.parametrize(
    "rest, says",
    [
        ("0.25, 0.5", "the conductivity kappa is needed"),
        ("0.25, 0, 1", "'cp' must be a number above 0"),
        ("0.25, 1, -1", "'kappa' must be a number"),
    ],
)
def test_mistakes(run_interpreted, kind, rest, says):
    assert says in run_interpreted(f"material(m, {kind}, 2, 200, {rest})\n", status=1).err
