"""What is always inlined in its callers is not compiled on its own; what of Numba that leans on."""

import hashlib
import inspect

import numba
import pytest
from numba import config, njit, types
from numba.core import base, caching, callconv, ccallback, codegen, compiler, dispatcher
from numba.core.typing import context, templates

from karamelo_py.compiler import inlining
from karamelo_py.compiler.compile import shared
from karamelo_py.compiler.loops import entered, kernel
from karamelo_py.kernels import contact, heat  # noqa: F401  (with all that they stand on)


@shared
def doubled(x):
    """Twice x; a loop with `else` is compiled, and not run for the kernel."""
    while x < 0:
        x = -x
    else:
        return x + x


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_what_is_inlined(tmp_path, monkeypatch):
    """A helper of point functions is inlined; a kernel, and a function of anybody else, are not."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))  # nothing is loaded
    seen = {}
    is_inlined = inlining.is_inlined

    def watched(library):
        seen[library.name] = is_inlined(library)
        return seen[library.name]

    monkeypatch.setattr(inlining, "is_inlined", watched)

    @njit
    def plain(x):
        return x + 1

    def called(x):
        return doubled(x) + 1

    assert plain(1) == 2
    assert kernel(called)(3) == 7
    names = {name.rpartition(".")[2]: result for name, result in seen.items()}
    assert names["doubled"]
    assert not names["called"]
    assert not names["plain"]


def test_names_are_of_one_kind():
    """Numba tells a library by the qualified name of its function, without the module."""
    assert {"_touch_nodes", "_visit_all"} <= inlining.kept
    assert not inlining.left & inlining.kept


@pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")
def test_what_is_kept_is_in_machine_code_once(tmp_path, monkeypatch):
    """A caller from another process brings along what was compiled here: it is not added again."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    compiled = []
    finalize = inlining.Library.finalize

    def watched(library):
        finalize(library)
        compiled.append(library)

    monkeypatch.setattr(inlining.Library, "finalize", watched)

    @entered
    def tripled(x):
        return 3 * x

    assert tripled(5) == 15
    (library,) = (one for one in compiled if one.own_name is not None)
    (caller,) = (one for one in compiled if library in one.needs and not one.inlined)
    assert inlining.Library._unserialize(library._codegen, library._state) is library
    assert library._state in caller._state[2][1]


# What compiler/ uses of the inside of Numba, and the text of it that this was written for.
INSIDE = {
    codegen.CodeLibrary.__init__: "1de447705f23",
    codegen.CPUCodeLibrary.finalize: "4b4c34b83488",
    codegen.CPUCodeLibrary.add_linking_library: "b7c82a3a3a8d",
    codegen.CPUCodeLibrary._optimize_functions: "9439219fa946",
    codegen.CPUCodeLibrary._optimize_final_module: "e405bd473752",
    codegen.CPUCodeLibrary._finalize_final_module: "95bbf4fcbb90",
    codegen.CPUCodeLibrary._get_module_for_linking: "56dde0e0555b",
    codegen.CPUCodeLibrary.serialize_using_object_code: "a895c26d01ba",
    codegen.CPUCodeLibrary.serialize_using_bitcode: "37c06b79c860",
    codegen.CPUCodeLibrary._unserialize: "c83d278d9934",
    codegen.JITCodeLibrary._finalize_specific: "81c2abfc04e9",
    codegen.JITCPUCodegen.set_env: "207cf44be0e0",
    codegen.JitEngine.is_symbol_defined: "8acc1ebba0b0",
    caching._Cache: "ee22baec643a",
    dispatcher.Dispatcher.enable_caching: "8c75d787fa68",
    dispatcher.Dispatcher.compile: "0ab4aee15e79",
    ccallback.CFunc.__init__: "9d54f928215e",
    ccallback.CFunc.compile: "08edc561907b",
    compiler.CompileResult._reduce: "5f86eacfa520",
    compiler.CompileResult._rebuild: "44fa9dc22558",
    context.BaseContext._lookup_global: "08d354cbcacf",
    templates.make_overload_template: "7f6974584cb1",
    dispatcher._DispatcherBase.get_call_template: "f15b62d0e9c0",
    callconv.BaseCallConv.decode_arguments: "bdf5ca520bd8",
    callconv.CPUCallConv: "2840bb216163",
    templates.fold_arguments: "a3806ed4b7d1",
    templates.AbstractTemplate.apply: "8c5f7129b8f3",
    types.Function.get_call_type: "6559c167bfc0",
    types.Function.augment: "f0996c594fa7",
    context.BaseContext.resolve_value_type: "671d7dab7911",
    context.BaseContext.resolve_getattr: "7efe38e96973",
    context.BaseContext.resolve_function_type: "81a6c18964e1",
    context.BaseContext.resolve_setattr: "dece00b20c8f",
    context.BaseContext.unify_types: "d65cae170c4a",
    base.BaseContext.get_function: "a3602598ea18",
    base.BaseContext.get_getattr: "81b76d8b2031",
    base.BaseContext.get_setattr: "dedb556f0853",
    base.BaseContext.get_return_value: "a0b837d43377",
    base.BaseContext.cast: "b52f6d1e0b0c",
    base.BaseContext.get_constant_generic: "9863beae38ad",
    base._wrap_impl: "b9f8452e01aa",
}


@pytest.mark.parametrize("part", INSIDE, ids=lambda part: part.__qualname__)
def test_the_inside_of_numba_is_as_it_was(part):
    """Another text may mean something else: read it, look at compiler/, then change this table."""
    found = hashlib.sha256(inspect.getsource(part).encode()).hexdigest()[:12]
    assert found == INSIDE[part], f"{part.__qualname__} of Numba {numba.__version__} is another"
