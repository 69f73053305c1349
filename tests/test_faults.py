"""Styles that are wrong: the user is told which, where in the script, and where in the style."""

import sys
from importlib.metadata import EntryPoint
from types import SimpleNamespace

import numpy as np
import pytest
from numba import config

from karamelo_py.language import registry
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.run.hooks import lower_hooks
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.views import PointsView
from karamelo_py.script.errors import ScriptError

STYLES = """
from karamelo_py.kernels.hooks import point_hook
from karamelo_py.scene.group import ParticleGroup
from karamelo_py.scene.modify import Compute, Fix

class Spring(Fix):
    def __init__(self, hub, group: ParticleGroup, k: float = 1.0):
        super().__init__(hub, group)
        1 / k

    def initial_integrate(self, points):
        return missing

def light(mass, v, x_old, x, value, before, dt):
    return v + "1", x, 0.0

class Light(Fix):
    def __init__(self, hub, group: ParticleGroup):
        super().__init__(hub, group)

    def hooks(self):
        return {"post_grid_to_point": point_hook(light)}

class Idle(Fix):
    def initial_integrat(self, points): ...

class Gauge(Compute):
    published = ("x",)

    def refresh(self):
        self.publish("s", 1)
"""


@pytest.fixture
def hub(tmp_path, monkeypatch):
    """A hub that knows the styles above and has a script with a fix and a compute of them."""
    (tmp_path / "styles_under_test.py").write_text(STYLES)
    monkeypatch.syspath_prepend(tmp_path)
    names = (("fix", "Spring"), ("fix", "Light"), ("fix", "Idle"), ("compute", "Gauge"))
    for family, name in names:
        entry = EntryPoint(name.lower(), f"styles_under_test:{name}", f"karamelo_py.{family}")
        monkeypatch.setitem(registry._families()[family], name.lower(), [entry])
    yield Hub()
    for key in [key for key in registry._loaded if key[1] in ("spring", "light", "idle", "gauge")]:
        del registry._loaded[key]
    sys.modules.pop("styles_under_test", None)


def run(hub, text):
    Interpreter(hub).run_text(text, "in.wrong")


def test_hook(hub):
    run(hub, "fix(s, spring, all)")
    with pytest.raises(ScriptError) as caught:
        hub.fixes["s"].hooks()["initial_integrate"](None)
    text = caught.value.render()
    assert text.startswith("in.wrong:1:1: error: fix spring (of ")
    assert "initial_integrate: NameError: name 'missing' is not defined" in text
    assert "(styles_under_test.py:12)" in text


def test_init(hub):
    with pytest.raises(ScriptError, match=r"fix spring .*__init__: ZeroDivisionError.*_test.py:9"):
        run(hub, "fix(s, spring, all, 0)")


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_a_hook_that_cannot_be_compiled(hub):
    run(hub, "dimension(2)\nfix(s, light, all)")
    hub.domain = SimpleNamespace(dimension=2)
    with pytest.raises(ScriptError) as caught:
        lower_hooks(hub, list(hub.fixes.values()))
    text = caught.value.render()
    assert text.startswith("in.wrong:2:1: error: fix light (of ")
    assert "post_grid_to_point: Numba cannot compile it: No implementation of function" in text
    assert "(styles_under_test.py:15)" in text


def test_refresh(hub):
    run(hub, "compute(g, gauge, all)")
    with pytest.raises(ScriptError, match=r"compute gauge .*refresh: .*Gauge.published"):
        hub.refresh_values()


def test_a_fix_without_hooks(hub, capsys):
    run(hub, "fix(i, idle)")
    assert "wrote initial_integrat; the hook is initial_integrate" in capsys.readouterr().err


class View(PointsView):
    """Three points in 2D."""

    def __init__(self):
        self._handed_out, self._declared = {}, {}
        self.ids = np.arange(3)
        self._v = np.zeros((3, 2))

    def _gather(self, field):
        return self._v

    def _scatter(self, field, value):
        self._v[...] = value


def test_views_refuse_what_does_not_fit():
    view = View()
    view.velocity = 1.0
    view.velocity += np.ones((3, 2))
    view.write_back()
    assert (view._v == 2).all()
    with pytest.raises(AttributeError, match="did you mean velocity"):
        view.velocty = 1.0
    with pytest.raises(AttributeError, match="did you mean velocity"):
        view.velocty  # noqa: B018
    with pytest.raises(ValueError, match=r"velocity has the shape \(3, 2\), not \(2,\)"):
        view.velocity = np.ones(2)
