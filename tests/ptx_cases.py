"""All that threads do for a point, a cell or a node compiles for a GPU, and stays in registers.

Without a GPU: what they compute is seen by an emulated one (tests/test_gpu.py).
"""

import re
from inspect import getmodule, isfunction, signature

import numpy as np
import pytest
from combinations import BASES, MESHED, fits, scene, write_mesh

from karamelo_py.compiler.fields import field
from karamelo_py.compiler.gpu import NoCard, library
from karamelo_py.kernels.equations import fbar, loss, node_updates, xpic
from karamelo_py.kernels.equations.loss import EnergyLoss, FrictionalHeat, KeepLoss
from karamelo_py.kernels.hooks import CompiledHook
from karamelo_py.language import registry
from karamelo_py.language.help import sections_of

REASON = "needs NVIDIA's linker: pip install '.[gpu]' nvidia-nvjitlink"
pathfinder = pytest.importorskip("cuda.pathfinder", reason=REASON)
try:
    pathfinder.load_nvidia_dynamic_lib("nvJitLink")
    library()
except (pathfinder.DynamicLibNotFoundError, NoCard):
    pytest.skip(REASON, allow_module_level=True)

from ptx import calling, compiled, scene_on_card, threads_of, visit_node  # noqa: E402

full = pytest.mark.full
both = pytest.mark.parametrize("kinematics", ["plane", "space"])

# Eight corners, with all that a point knows of each, are more than a thread's registers in doubles.
IN_SINGLES = ("R8", "H8")


# Threads that many points and nodes have in each step. Those of a cell sum for many nodes: what a
# few numbers cost that registers do not hold has been measured.
MANY = "gather_point", "load_point", "sum_node", "visit_node", "scatter_cell"
FEW = 256
# Bytes that a thread may keep beside its registers, in space.
BESIDE = {"ulmpm/contacts": 512, "eos ideal-gas 0": 1024}


def in_registers(made, beside: int = 0) -> bool:
    """Whether a thread keeps what it knows in registers, but for some bytes, where many do much.

    Fixes and contact have functions that they call, and a stack; they compile, at least.
    """
    kind = made.name.rsplit("_", 2)[0]
    beside = max(beside, FEW * (kind == "scatter_cell"))
    assert kind not in MANY or max(made.spilled, made.stack) <= beside, (kind, *made[2:])
    return True


def threads_stay_in_registers(script: str, beside: int = 0) -> None:
    """Those of the visits, the sums and the nodes of a scene."""
    threads = threads_of(script)
    assert {"gather_point", "sum_node"} <= {made.name.rsplit("_", 2)[0] for made in threads}
    for made in threads:
        assert in_registers(made, beside), made.name


def warm(script: str, *numbers: float) -> str:
    """The scene with these numbers of heat in its material: capacity, conductivity."""
    return re.sub(r"(material\(.*)\)", rf"\1, {', '.join(map(str, numbers))})", script)


def example_of(family: str, name: str) -> str:
    """The words of `method` in the manual of a style."""
    text = sections_of(registry.find(family, name).__doc__)[1]["Example"]
    return re.search(r"^method\((.*)\)$", text, re.MULTILINE)[1]


def test_step():
    """One of what follows, with all that is the same in every scene."""
    script = scene("plane", "ulmpm", "quadratic-spline", "", "MLS", "musl")
    for made in threads_of(script, all_of_them=True):
        assert in_registers(made), made.name


def test_all_are_tried():
    """Bases and methods as combinations; the other styles are those of the registry."""
    kinds, bases, options = map(set, zip(*BASES, strict=True))
    assert kinds == set(registry.names("method"))
    assert bases == set(registry.names("basis"))
    styles = [("method", kind) for kind in kinds] + [("basis", basis) for basis in bases]
    variants = [getattr(registry.find(*style), "variants", {}) for style in styles]
    assert options == {"", *(name for names in variants for name in names)}


@full
@both
@pytest.mark.parametrize("base", BASES, ids=" ".join)
def test_bases(kinematics, base, tmp_path):
    """Each with gather and scatter in one visit."""
    option = base[2]
    if not fits(kinematics, option):
        pytest.skip("no such domains with this kinematics")
    mesh = write_mesh(tmp_path / "m.vtk", MESHED[option]) if option in MESHED else None
    script = scene(kinematics, *base, "FLIP", "usl", mesh=mesh)
    beside = BESIDE.get(base[0], 0) * (kinematics == "space")
    threads_stay_in_registers("precision(single)\n" * (option in IN_SINGLES) + script, beside)


@full
@both
@pytest.mark.parametrize("transfer", registry.names("transfer"))
def test_transfers(kinematics, transfer):
    words = example_of("transfer", transfer).split(", ")
    words[0], words[2] = "tlmpm", "linear"
    script = scene(kinematics, "tlmpm", "linear", "", "FLIP", "usl")
    threads_stay_in_registers(
        re.sub(r"^method\(.*$", f"method({', '.join(words)})", script, flags=re.MULTILINE)
    )


@full
@both
@pytest.mark.parametrize("name", registry.names("scheme"))
def test_schemes(kinematics, name):
    """Fused and staged."""
    script = scene(kinematics, "ulmpm", "linear", "", "FLIP", name)
    if registry.find("scheme", name).traits.implicit:
        pytest.skip("solves equations")
    threads_stay_in_registers(script)
    threads_stay_in_registers(script + "\npull = internal_force(all, x)")


@full
@both
def test_averaged_volumes(kinematics):
    script = scene(kinematics, "ulmpm", "linear", "", "FLIP", "musl")
    threads_stay_in_registers(script.replace("region(", "anti_volumetric_locking(true)\nregion("))


# --- laws: those of the examples in their manuals ---------------------------------------------

EOS = "eos(e, linear, 7850, 160e9)"
STRENGTH = "strength(s, plastic, 80e9, 400e6, 100e6)"
SHOCK = "eos(e, shock, 8940, 110e9, 3933, 1.5, 1.99, 385, 294, 1.5, 0.06)"
FLOW = "strength(s, johnson_cook, 46e9, 90e6, 292e6, 0.31, 1, 0.025, 1.09, 298, 1356)"


def examples(family: str, ID: str) -> dict[str, str]:
    """Commands that make every style of a family, under one name, and what they need before."""
    found = {}
    for name in registry.names(family):
        text = sections_of(registry.find(family, name).__doc__)[1]["Example"]
        lines = re.sub(rf"\b{ID}\b", "other", text).strip().splitlines()
        made = [k for k, line in enumerate(lines) if line.startswith(f"{family}(")]
        assert made, name
        for number, k in enumerate(made):
            line = re.sub(r"\(\w+", f"({ID}", lines[k], count=1)
            found[f"{family} {name} {number}"] = "\n".join([*lines[:k], line])
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
    threads_stay_in_registers(
        re.sub(r"^material\(.*$", "\n".join(LAWS[law]), script, flags=re.MULTILINE),
        BESIDE.get(law, 0) * (kinematics == "space"),
    )


@full
@both
def test_heat(kinematics):
    """Conduction between points."""
    script = scene(kinematics, "ulmpm", "linear", "", "FLIP", "usl")
    threads_stay_in_registers(warm(script.replace("0.98)", "0.98, thermo-mechanical)"), 460, 45))


@full
@both
def test_loss(kinematics):
    """Kinetic energy that a transfer takes heats a gas."""
    script = scene(kinematics, "ulmpm", "linear", "", "TPIC", "usl")
    gas = "\n".join(LAWS["eos ideal-gas 0"]).replace(STRENGTH, "strength(s, fluid, 0)")
    script = re.sub(r"^material\(.*$", gas, script, flags=re.MULTILINE)
    assert field(scene_on_card(script).setup.nodes.fields, EnergyLoss) is not None
    threads_stay_in_registers(script)


@full
@both
def test_contact(kinematics):
    """With friction, which heats."""
    script = warm(scene(kinematics, "ulmpm/contacts", "linear", "", "FLIP", "musl"), 460, 0)
    other = re.search(r"^region\((?:.|\n)*?^solid\(.*$", script, re.MULTILINE)[0]
    other = other.replace("box", "rest").replace("body", "other")
    rubs = "fix(rub, contact/friction, body, other, 0.3)\nset_dt"
    script = script.replace("set_dt", f"{other}\n{rubs}")
    s = scene_on_card(script).setup
    assert field(s.nodes.fields, FrictionalHeat) is not None
    threads_stay_in_registers(script)


@full
@both
def test_nodes(kinematics):
    """Every task at a node, with all fields that they know."""
    script = scene(kinematics, "ulmpm", "linear", "", "XPIC", "usl")
    script = script.replace("region(", "anti_volumetric_locking(true)\nregion(")
    setup = scene_on_card(script).setup
    lost = EnergyLoss(np.zeros((len(setup.nodes.sums), 2)))  # of gases
    setup = setup._replace(nodes=setup.nodes._replace(fields=(*setup.nodes.fields, lost)))
    kinds = [vars(one).values() for one in (node_updates, fbar, loss, xpic)]
    tasks = {kind for some in kinds for kind in some if hasattr(kind, "goes_through")}
    assert KeepLoss in tasks
    for task in tasks:
        made = task(*(1.0,) * len(task._fields))
        assert in_registers(compiled(visit_node, made, setup.kin, setup.nodes, 1.0)), task


@full
@pytest.mark.parametrize("name", registry.names("fix"))
def test_hooks(name):
    """What the fixes do at a point or a node, and what they have beside it with the same words."""
    fix = registry.find("fix", name)
    hooks = [h.function for h in vars(fix).values() if isinstance(h, CompiledHook)]
    if not hooks:
        pytest.skip("does nothing in a step, or does it in Python")
    words = {tuple(signature(hook).parameters) for hook in hooks}
    beside = [f for f in vars(getmodule(fix)).values() if isfunction(f)]
    for function in {*hooks, *(f for f in beside if tuple(signature(f).parameters) in words)}:
        numbers = (1.0,) * len(signature(function).parameters)
        assert in_registers(compiled(calling(function), np.zeros(4), *numbers))
