"""Functions that only ever melt into others are compiled there, not on their own as well.

Numba optimises every function that it compiles and makes machine code of it, also of one that is
written into each of its callers (`forceinline`) and that Python cannot call (no wrapper). With
point functions ten calls deep that is half of the work of a first compilation, for code that nobody
runs. Here such a function is kept as it is and left to its callers. This leans on the inside of
Numba; where that does not look as expected, everything is compiled as Numba would.
"""

from __future__ import annotations

from llvmlite import binding as llvm
from numba.core import codegen


class _Melting(codegen.JITCodeLibrary):
    """The code of one compiled function and of all that it calls."""

    def _melts(self) -> bool:
        """Whether all that this library itself defines (not what it links in) is always inlined."""
        own = [
            function
            for function in self._final_module.functions
            if not function.is_declaration and function.linkage == llvm.Linkage.external
        ]
        return bool(own) and all(
            any(b"alwaysinline" in attribute for attribute in function.attributes)
            for function in own
        )

    def _optimize_functions(self, ll_module) -> None:
        # What callers contain is optimised as a whole there.
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        if not self._melts():
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        if self._melts():
            self._finalized = True
        else:
            super()._finalize_final_module()


def _set_environment(self, env_name: str, env) -> None:
    """Tell a function where its Python environment is, if there is machine code of it."""
    if self._engine.is_symbol_defined(env_name):
        _plain_set_environment(self, env_name, env)


_EXPECTED = ("_optimize_functions", "_optimize_final_module", "_finalize_final_module")
if all(hasattr(codegen.JITCodeLibrary, name) for name in _EXPECTED):
    _plain_set_environment = codegen.JITCPUCodegen.set_env
    codegen.JITCPUCodegen.set_env = _set_environment
    codegen.JITCPUCodegen._library_class = _Melting
