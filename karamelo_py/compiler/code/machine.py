"""LLVM: target processor, optimisation, loading of code.

Fast math is off. Contraction depends on inlining, so results would depend on threads and restarts.
"""

import contextlib
import ctypes
import functools
import os
import sys
from collections.abc import Callable

from llvmlite import binding as llvm

# Loops over up to 27 stencil nodes must be unrolled to have weights in registers: quadratic splines
# in 3D run 1.7 times as fast. In long loops, a separate counter for each array costs registers.
OPTIONS = "--unroll-threshold=4000", "--disable-lsr"
# With level 0, compilation takes half the time, and steps take up to four times as long; results
# are identical bit for bit.
LEVEL = 0 if os.environ.get("KARAMELO_PY_OPTIMISATION") == "0" else 3


@functools.cache
def features() -> str:
    with contextlib.suppress(RuntimeError):
        return llvm.get_host_cpu_features().flatten()
    return ""


@functools.cache
def describe() -> str:
    """Describe everything that determines the code, except its text."""
    words = llvm.llvm_version_info, llvm.get_process_triple(), llvm.get_host_cpu_name()
    return repr((*words, features(), OPTIONS, LEVEL))


@functools.cache
def _set_options() -> None:
    for option in OPTIONS:
        llvm.set_option("", option)


@functools.cache
def _target() -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    _set_options()
    triple = llvm.get_process_triple()
    # Code is not moved after loading, so x86 needs no relocation tables.
    where = "static" if triple.startswith(("x86", "i386", "i686")) else "default"
    return llvm.Target.from_triple(triple).create_target_machine(
        opt=LEVEL, cpu=llvm.get_host_cpu_name(), features=features(), reloc=where,
        codemodel="jitdefault", jit=True,
    )  # fmt: skip


@functools.cache
def _engine() -> llvm.ExecutionEngine:
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), _target())


def _optimised(
    text: str, target: llvm.TargetMachine, library: bytes | None = None, level: int = 3
) -> llvm.ModuleRef:
    module = llvm.parse_assembly(text)
    if library is not None:
        defined = {function.name for function in module.functions if not function.is_declaration}
        module.link_in(llvm.parse_bitcode(library))
        for function in module.functions:
            if not (function.is_declaration or function.name in defined):
                function.linkage = llvm.Linkage.internal
    module.triple, module.data_layout = target.triple, str(target.target_data)
    module.verify()
    if level == 0:
        return module
    tuning = llvm.create_pipeline_tuning_options(speed_level=level)
    tuning.loop_vectorization = tuning.slp_vectorization = True
    builder = llvm.create_pass_builder(target, tuning)
    builder.getModulePassManager().run(module, builder)
    return module


def compile_text(text: str) -> bytes:
    return _target().emit_object(_optimised(text, _target(), level=LEVEL))


def assembly(text: str, triple: str, processor: str, library: bytes | None = None) -> str:
    """Compile module text to GPU assembly; `library` is LLVM bitcode."""
    _set_options()
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    target = llvm.Target.from_triple(triple).create_target_machine(cpu=processor, opt=3)
    return target.emit_assembly(_optimised(text, target, library))


def load(code: bytes, *names: str) -> list[int]:
    engine = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    addresses = [engine.get_function_address(name) for name in names]
    if not all(addresses):
        raise RuntimeError(f"{names[0]} is not in the machine code that was made for it")
    return addresses


def publish(name: str, address: int) -> None:
    llvm.add_symbol(name, address)


def is_known(name: str) -> bool:
    return sys.platform == "win32" or hasattr(ctypes.CDLL(None), name)


def publish_python(name: str, kind: type, function: Callable) -> None:
    """Make a Python function, which must not raise, callable by code."""
    callback = kind(function)
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(callback))  # never freed, as code may call it later
    publish(name, ctypes.cast(callback, ctypes.c_void_p).value)
