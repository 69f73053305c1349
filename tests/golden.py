"""Bits of small scenes and the LLVM text of their kernels: compare two trees, by hand.

    PYTHONPATH=tree python tests/golden.py text before.json
    NUMBA_DISABLE_JIT=1 PYTHONPATH=tree python tests/golden.py bits before.json
    python tests/golden.py compare before.json after.json

`text` traces the loop over the steps of each scene and the functions of its threads on a card, and
compiles neither: equal texts are equal machine code. Of texts that differ, `compare` says so if
they do the same operations on the same operands in another order. `bits` runs each scene for some
steps. Hashes depend on the processor and the library of C, so that no file of them is kept.
"""

import functools
import gzip
import hashlib
import json
import os
import re
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from going_on import CURVE, SCENES, SERIAL
from pumps import __file__ as pumps
from scenes import block
from test_cpdi import block as domains

V = {d: "fix(v, initial_velocity_particles, all, " + ", ".join(
    ("0.9 + sin(40*x0)", "0.5*cos(70*y0)", "0.2")[:d]) + ")" for d in (1, 2, 3)}  # fmt: skip
SIZE = (0.2, 0.1, 0.1)
TEXTS = Path(tempfile.gettempdir()) / "karamelo-py-texts"


def _block(d, *lines, **options):
    return block(d, V[d], *lines, "run(4)", size=SIZE, **options)


def _method(script, method):
    return re.sub(r"method\(.*\)", f"method({method})", script)


GAS = """
method(ulmpm, {method})
dimension(2, 0, 1, 0, 1, 0.1)
region(left, block, 0.2, 0.4, 0.2, 0.4)
strength(thin, fluid, 0.1)
eos(air, ideal-gas, 1.2, 1.4, p=10)
material(air, eos-strength, air, thin)
solid(air, region, left, 2, air, 0.1)
fix(v, initial_velocity_particles, all, sin(9*x0), y0)
run(4)
"""
AXIS = _block(2).replace("region(box", "axisymmetric(true)\nregion(box")
OWN = {
    **{f"{d}D {t} {s}": _block(d, transfer=t, scheme=s) for d, t, s in (
        (1, "FLIP", "musl"), (1, "MLS", "usl"), (2, "PIC", "usl"), (2, "FLIP", "usavg"),
        (2, "APIC", "usf"), (2, "AFLIP", "musl"), (2, "ASFLIP", "usl"), (2, "MLS", "usl"),
        (2, "MLS", "musl"), (2, "TPIC", "musl"), (2, "XPIC", "usl"), (2, "TFLIP", "musl"),
        (2, "FLIP cubic", "musl"), (3, "FLIP", "musl"), (3, "MLS", "usl"), (3, "APIC", "musl"),
        (3, "FLIP quadratic", "usl"))},
    "axisymmetric": AXIS,
    "axisymmetric MLS": _method(AXIS, "ulmpm, MLS, quadratic-spline"),
    "axisymmetric total": _method(AXIS, "tlmpm, APIC, linear"),
    "sphere MLS": _block(1, transfer="MLS", scheme="usl").replace(
        "region(box", "spherical(true)\nregion(box"),
    "total APIC": _method(_block(2), "tlmpm, APIC, linear"),
    "total TPIC 3D": _method(_block(3), "tlmpm, TPIC, quadratic-spline"),
    "total bernstein": _method(_block(2), "tlmpm, FLIP, Bernstein-quadratic, 0.99"),
    "gimp": _method(_block(2), "ulmpm, APIC, cpgimp"),
    "gimp corners": _method(_block(2), "ulmpm, FLIP, cpgimp, 1, corners"),
    "R4": domains("ulcpdi, FLIP, linear, 1, R4", V[2], "run(4)"),
    "R4 APIC": domains("ulcpdi, APIC, linear, R4", V[2], "run(4)"),
    "Q4": domains("ulcpdi, FLIP, linear, 1, Q4", V[2], "run(4)"),
    "locking": _block(2, "anti_volumetric_locking(true)", scheme="usf"),
    "locking total": _method(_block(2, "anti_volumetric_locking(true)"), "tlmpm, FLIP, linear, 1"),
    "gas": GAS.format(method="FLIP, linear, 0.9"),
    "gas APIC": GAS.format(method="APIC, quadratic-spline"),
    "gas XPIC": GAS.format(method="XPIC, quadratic-spline, 3"),
    "single MLS": "precision(single)\n" + _block(2, transfer="MLS", scheme="usl"),
    "MLS at a wall": _block(2, transfer="MLS", scheme="usl").replace(
        "0.3, 0.5, 0.3, 0.4", "0, 0.2, 0, 0.1"),
    "per time": _method(_block(2), "ulmpm, FLIP/per-time, linear, 0.9"),
}  # fmt: skip
ALL = {**OWN, **SCENES, **SERIAL}


NAMED = re.compile(r'[%@]"[^"]*"|[%@][\w.]+')


def _hash(text):
    return hashlib.sha256(text.encode() if isinstance(text, str) else text).hexdigest()[:16]


def _operations(text):
    """Hash the set of stores, calls and branches of a module, each with all that leads to it."""
    known, phis, found = {}, {}, set()

    def told(name):
        return known.get(name[0], "?")

    for line in text.splitlines():
        if line.startswith("define"):
            known.clear(), phis.clear()
            continue
        name, equals, what = line.strip().partition(" = ")
        named = equals and NAMED.fullmatch(name)
        own = NAMED.sub(told, what if named else line.strip())
        if named and what.startswith("phi "):  # where ways meet does not matter
            values = {m[1].strip() for m in re.finditer(r"\[([^,\]]*),", what)}
            phis[name] = set().union(
                *(phis.get(v, {known.get(v, "?" if v[0] == "%" else v)}) for v in values)
            )
            own = "phi " + " ".join(sorted(phis[name]))
        if named:
            known[name] = _hash(own)
        if not line.endswith(":") and (not named or "call" in own):
            found.add(own)
    return _hash("".join(sorted(found)))


def _texts(script):
    from test_gpu import begun

    from karamelo_py.compiler import gpu
    from karamelo_py.compiler.code import machine
    from karamelo_py.compiler.trace import functions, kernels
    from karamelo_py.kernels.step import advance
    from karamelo_py.run.gpu import StepsOnCard

    script = re.sub(r"^run\(.*\)$", "", script, flags=re.M)
    hub, simulation = begun(script)
    arguments = simulation.step_kind, simulation.setup
    hooks = simulation._acting
    files = kernels.cache
    found = []
    usual = machine.compile_text, files.machine_code, files.KernelFiles.kernel, gpu.text_of

    def keep(name, text):
        text = re.sub(r"[._][0-9a-f]{32}\b", "", text)
        TEXTS.mkdir(exist_ok=True)
        file = TEXTS / f"{_hash(text)}.ll.gz"
        if not file.exists():
            file.write_bytes(gzip.compress(text.encode(), 1))
        found.append((name, _hash(text)))

    def text_of(*given):
        name, text = usual[-1](*given)
        keep(name.rpartition("_")[0], text)
        return name, ""

    def noted(text):
        keep("kernel", text)
        return b""

    machine.compile_text = noted
    files.KernelFiles.kernel = lambda self, kinds, result, compiled: compiled()
    files.machine_code = lambda name, make: make()
    functions.outdate_kernels()
    try:
        if not simulation.implicit and hasattr(hooks, "_fields"):
            kinds = kernels.plan_for((*arguments, hooks, 1)).types
            kernels.Kernel(advance.function).unit(kinds)
            gpu.text_of = text_of
            card = gpu.Emulator()
            card.loaded = lambda code: None
            card.made = lambda text: b"-"
            own = (simulation.hooks, simulation.fixes.lasting.functions)
            try:
                steps = StepsOnCard(card, simulation.setup,
                                    (hub.update.scheme, type(simulation.visits)), own)  # fmt: skip
                assert steps.step
            except (TypeError, AttributeError) as why:
                found.append(("no card", str(why)[:200]))
    finally:
        machine.compile_text, files.machine_code, files.KernelFiles.kernel, gpu.text_of = usual
        functions.outdate_kernels()
    return sorted(found)


def _bits(script):
    from states import final_state

    with tempfile.TemporaryDirectory() as folder:
        inner = Path(folder) / "in"
        inner.mkdir()
        (Path(folder) / "curve.csv").write_text(CURVE)
        (inner / "pumps.py").write_text(Path(pumps).read_text())
        path = inner / "in.script"
        path.write_text(script)
        os.chdir(inner)
        state = final_state(path)
        os.chdir("/")
    return {name: _hash(array.tobytes()) for name, array in sorted(state.items())}


@functools.cache
def _operations_of(name):
    file = TEXTS / f"{name}.ll.gz"
    return _operations(gzip.decompress(file.read_bytes()).decode()) if file.exists() else name


def _difference(a, b):
    if isinstance(a, dict) and isinstance(b, dict):
        return [key for key in a.keys() | b.keys() if a.get(key) != b.get(key)]
    if not (isinstance(a, list) and isinstance(b, list)):
        return [str(one)[:60] for one in (a, b)]
    a, b = ({*map(tuple, one)} for one in (a, b))
    rest = [sorted((n, _operations_of(h)) for n, h in one) for one in (a - b, b - a)]
    if rest[0] == rest[1]:
        return f"the same operations: {len(a - b)} functions"
    return sorted({name for name, _ in {*rest[0]} ^ {*rest[1]}})


def compare(one, other):
    for name in sorted(one.keys() & other.keys()):
        if one[name] != other[name]:
            print(f"{name}: {_difference(one[name], other[name])}")
    both = one.keys() & other.keys()
    print(f"{sum(one[n] == other[n] for n in both)} of {len(both)} equal")


def main():
    what, file, *more = sys.argv[1:]
    if what == "compare":
        compare(*(json.loads(Path(name).read_text()) for name in (file, *more)))
        return
    found = {}
    for name, script in ALL.items():
        if more and not any(part in name for part in more):
            continue
        try:
            found[name] = {"text": _texts, "bits": _bits}[what](script)
        except Exception as why:
            found[name] = f"{type(why).__name__}: {str(why)[:300]}"
        Path(file).write_text(json.dumps(found, indent=1))
    print({n: f for n, f in found.items() if isinstance(f, str)})


if __name__ == "__main__":
    main()
