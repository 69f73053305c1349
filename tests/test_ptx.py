"""All that is done at a point or a node compiles for a GPU, and stays in its registers.

Without a GPU: that scenes run on one, and how fast, nobody has seen.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from combinations import BASES, MESHED, SCHEMES, TRANSFERS, fits, scene, write_mesh

from karamelo_py.kernels import nodes
from karamelo_py.kernels.loss import Lost
from karamelo_py.language import registry
from karamelo_py.language.docstrings import sections

REASON = "needs numba-cuda and NVIDIA's compiler libraries: pip install 'karamelo-py[gpu]'"
pathfinder = pytest.importorskip("cuda.pathfinder", reason=REASON)
pytest.importorskip("numba_cuda", reason=REASON)
try:
    pathfinder.load_nvidia_dynamic_lib("nvvm")
    pathfinder.load_nvidia_dynamic_lib("nvJitLink")
except pathfinder.DynamicLibNotFoundError:
    pytest.skip(REASON, allow_module_level=True)

from ptx import compiled, compiled_visit, setup_of, visit_node, visits_of  # noqa: E402

full = pytest.mark.full
both = pytest.mark.parametrize("kinematics", ["plane", "space"])

FORMULA = "Numba for CUDA does not know numpy.floor, ceil, rint and trunc of a number"
UNROLLED = "NVVM unrolls its loop over the nodes; what a back end would have to forbid"
# What does not compile, or does not stay in registers, and why.
EXCEPTIONS = {
    "test_bases[ulcpdi linear H8-space]": "more than the 255 registers of a thread, all in one",
    **{
        f"test_bases[{base}-space]": UNROLLED
        for base in (
            "tlmpm quadratic-spline ",
            "tlmpm Bernstein-quadratic ",
            "tlmpm cubic-spline ",
            "tlmpm ugimp ",
            "tlmpm cpgimp ",
            "ulcpdi linear Tet4",
            "tlcpdi linear Tet4",
            "tlcpdi linear H8",
            "tlcpdi linear R8",
        )
    },
    **{f"test_laws[strength formula {k}-{d}]": FORMULA for k in (0, 1) for d in ("plane", "space")},
}


@pytest.fixture(autouse=True)
def exception(request):
    """Known exceptions fail; one that no longer does is told."""
    if reason := EXCEPTIONS.get(request.node.name):
        request.applymarker(pytest.mark.xfail(reason=reason, strict=True))


def in_registers(made) -> bool:
    """Whether a thread keeps all it knows in registers, and calls nothing."""
    assert not re.search(r"\bcall\b", made.ptx)
    assert not re.search(r"\.local\b", made.ptx)
    assert made.stack == made.spilled == 0, (made.stack, made.spilled, made.registers)
    return True


def visits_stay_in_registers(script: str, in_stages: bool = False) -> None:
    setup, scheme = setup_of(script)
    visits = visits_of(setup, scheme, in_stages)
    assert visits
    for visit in visits:
        assert in_registers(compiled_visit(visit, setup)), visit


def test_step():
    """One of what follows."""
    visits_stay_in_registers(scene("plane", "ulmpm", "quadratic-spline", "", "MLS", "musl"))


@full
@both
@pytest.mark.parametrize("base", BASES, ids=" ".join)
def test_bases(kinematics, base, tmp_path):
    """Each with gather and scatter in one visit."""
    option = base[2]
    if not fits(kinematics, option):
        pytest.skip("no such domains with this kinematics")
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    visits_stay_in_registers(scene(kinematics, *base, "FLIP", "usl", mesh=mesh))


@full
@both
@pytest.mark.parametrize("transfer", TRANSFERS)
def test_transfers(kinematics, transfer):
    visits_stay_in_registers(scene(kinematics, "tlmpm", "linear", "", transfer, "usl"))


@full
@both
@pytest.mark.parametrize("name", [*SCHEMES, "usl/unlimited"])
def test_schemes(kinematics, name):
    """Fused and staged."""
    script = scene(kinematics, "ulmpm", "linear", "", "FLIP", name)
    visits_stay_in_registers(script, in_stages=True)


@full
@both
def test_averaged_volumes(kinematics):
    script = scene(kinematics, "ulmpm", "linear", "", "FLIP", "musl")
    visits_stay_in_registers(script.replace("region(", "anti_volumetric_locking(true)\nregion("))


# --- laws: those of the examples in their manuals ---------------------------------------------

EOS = "eos(e, linear, 7850, 160e9)"
STRENGTH = "strength(s, plastic, 80e9, 400e6, 100e6)"
SHOCK = "eos(e, shock, 8940, 110e9, 3933, 1.5, 1.99, 385, 294, 1.5, 0.06)"
FLOW = "strength(s, johnson_cook, 46e9, 90e6, 292e6, 0.31, 1, 0.025, 1.09, 298, 1356)"


def examples(family: str, ID: str) -> dict[str, str]:
    """Commands that make every style of a family, under one name."""
    found = {}
    for name in registry.names(family):
        text = sections(registry.find(family, name).__doc__)[1]["Example"]
        lines = re.findall(rf"^{family}\(\w+(,.*)$", text, re.MULTILINE)
        assert lines, name
        for k, rest in enumerate(lines):
            found[f"{family} {name} {k}"] = f"{family}({ID}{rest}"
    return found


def laws() -> dict[str, list[str]]:
    """Commands that make the material `rubber`, with each law and each part of one."""
    composed = "material(rubber, eos-strength, e, s)"
    found = {
        name: [line]
        for name, line in examples("material", "rubber").items()
        if "eos-strength" not in name
    }
    found |= {name: [line, STRENGTH, composed] for name, line in examples("eos", "e").items()}
    found |= {name: [EOS, line, composed] for name, line in examples("strength", "s").items()}
    for family in ("damage", "temperature"):
        for name, line in examples(family, "o").items():
            found[name] = [SHOCK, FLOW, line, composed.replace("s)", "s, o)")]
    return found


LAWS = laws()


@full
@both
@pytest.mark.parametrize("law", LAWS)
def test_laws(kinematics, law):
    script = scene(kinematics, "ulmpm", "linear", "", "FLIP", "usl")
    visits_stay_in_registers(
        re.sub(r"^material\(.*$", "\n".join(LAWS[law]), script, flags=re.MULTILINE)
    )


@full
@both
def test_heat(kinematics):
    """Conduction between points."""
    script = scene(kinematics, "ulmpm", "linear", "", "FLIP", "usl")
    script = script.replace("0.98)", "0.98, thermo-mechanical)")
    script = re.sub(r"(material\(.*)\)", r"\1, 460, 45)", script)
    visits_stay_in_registers(script)


@full
@both
def test_nodes(kinematics):
    """Every task at a node, with all fields that they know."""
    script = scene(kinematics, "ulmpm", "linear", "", "XPIC", "usl")
    script = script.replace("region(", "anti_volumetric_locking(true)\nregion(")
    setup, _ = setup_of(script)
    lost = Lost(np.zeros((len(setup.nodes.sums), 2)))  # of gases
    setup = setup._replace(nodes=setup.nodes._replace(fields=(*setup.nodes.fields, lost)))
    tasks = [kind for kind in vars(nodes).values() if hasattr(kind, "goes_through")]
    assert len(tasks) > 10
    for task in tasks:
        made = task(*(1.0,) * len(task._fields))
        assert in_registers(compiled(visit_node, made, setup.kin, setup.nodes, 0, 1.0)), task
