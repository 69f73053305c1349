"""Machine code is made once, of what Python calls: all else is left to those who call it.

Numba optimises every function that it compiles and makes machine code of it, also of one that is
written into each of its callers (`forceinline`) or that only compiled code calls. With point
functions ten calls deep that is half of the work of a first compilation, for code that nobody
runs. Here functions that are always inlined, and those that were `left` to their callers, are
neither optimised nor emitted on their own. Those that are `kept` on disk for other callers are
emitted once, and their callers refer to them by a name that nothing else has. This leans on the
inside of Numba: pyproject.toml names the versions that it was written for, and a test knows their
text. The text of this file is in the key of every kernel on disk.
"""

import contextlib
import functools
import uuid
from weakref import WeakValueDictionary

from llvmlite import binding as llvm
from numba.core import codegen


def _own_functions(library: codegen.JITCodeLibrary) -> list:
    """What a library itself defines, without what it links in."""
    functions = library._final_module.functions
    return [f for f in functions if not f.is_declaration and f.linkage == llvm.Linkage.external]


left: set[str] = set()  # qualified names of functions that nobody but compiled code calls
kept: set[str] = set()  # the same, of those that are kept on disk


def claim(name: str, of: str) -> None:
    """Put a function into "left" or "kept": its name is all that tells it from others later."""
    sets = vars(claim)["sets"]
    if any(name in names for way, names in sets.items() if way != of):
        raise NameError(f"there is another '{name}', which is compiled in another way: rename it")
    sets[of].add(name)


# Beside the function, not among its globals: they grow in a run, and what kernels are made of does
# not change by that.
claim.sets = {"left": left, "kept": kept}


def _is_inner(library: codegen.JITCodeLibrary, names: set[str]) -> bool:
    """Whether a library is of one of these functions, with nothing for others to call it by."""
    return library.name in names and len(_own_functions(library)) == 1


def is_inlined(library: codegen.JITCodeLibrary) -> bool:
    """Whether all that a library itself defines is always inlined: nobody calls its address."""
    own = _own_functions(library)
    return bool(own) and all(
        any(b"alwaysinline" in attribute for attribute in function.attributes) for function in own
    )


class Library(codegen.JITCodeLibrary):
    """The code of one compiled function and of all that it calls.

    Attributes
    ----------
    inlined
        Whether it is left to its callers.
    name_in_callers, own_name
        What callers call a kept function when they are compiled, and what it is called in machine
        code: no other function, of whatever process, has that name.
    needs
        The kept libraries that it calls, in machine code of their own.
    """

    inlined = False
    name_in_callers: str | None = None
    own_name: str | None = None

    def __init__(self, *arguments):
        super().__init__(*arguments)
        self.needs: list[Library] = []

    def _optimize_functions(self, ll_module) -> None:
        # Left to the optimisation of the whole module, of other packages' functions, too.
        ll_module.data_layout = self._codegen._data_layout

    def add_linking_library(self, library) -> None:
        # What is left to its callers has not linked in what it calls itself: whoever becomes
        # machine code does.
        inner = library._linking_libraries if library.inlined else ()
        for one in (library, *inner):
            if one.own_name is None and one not in self._linking_libraries:
                super().add_linking_library(one)
        for one in (library, *library.needs):
            if one.own_name is not None and one not in self.needs:
                self.needs.append(one)

    def finalize(self) -> None:
        self.inlined = is_inlined(self) or _is_inner(self, left)
        if self.inlined:
            for function in _own_functions(self):
                function.linkage = "linkonce_odr"  # as of all that is linked into others
            self._finalized = True
            return
        if _is_inner(self, kept):
            (function,) = _own_functions(self)
            self.name_in_callers = function.name
            self.own_name = f"{self.name}.{uuid.uuid4().hex}"
            # A caller that another process has kept may bring it along: it is here already.
            _living[self.own_name] = self
        super().finalize()

    def _optimize_final_module(self) -> None:
        # All is linked: what is elsewhere is called by its own name.
        for one in (self, *self.needs):
            if one.own_name is not None:
                with contextlib.suppress(NameError):  # not called after all
                    self._final_module.get_function(one.name_in_callers).name = one.own_name
        super()._optimize_final_module()

    def _get_module_for_linking(self):
        return self._final_module if self.inlined else super()._get_module_for_linking()

    @functools.cached_property
    def _state(self) -> tuple:
        needs = [one._state for one in self.needs]
        names = (self.name_in_callers, self.own_name)
        return self.name, "with needs", (names, needs, super().serialize_using_object_code())

    def serialize_using_object_code(self) -> tuple:
        return self._state

    @classmethod
    def _unserialize(cls, engine, state):
        if state[1] != "with needs":
            return super()._unserialize(engine, state)
        names, needs, own = state[2]
        library = _living.get(names[1]) if names[1] else None
        if library is None:
            before = [cls._unserialize(engine, one) for one in needs]
            library = super()._unserialize(engine, own)
            library.needs = before
            library.name_in_callers, library.own_name = names
            library._state = state
            if library.own_name is not None:
                _living[library.own_name] = library
        return library


# Kept functions in machine code, by their own names.
_living: WeakValueDictionary[str, Library] = WeakValueDictionary()


def _use() -> None:
    """Put the class of libraries above in the place of Numba's."""
    set_environment = codegen.JITCPUCodegen.set_env

    @functools.wraps(set_environment)
    def set_env(self, env_name: str, env) -> None:
        """Tell a function where its Python environment is, if there is machine code of it."""
        if self._engine.is_symbol_defined(env_name):
            set_environment(self, env_name, env)

    codegen.JITCPUCodegen.set_env = set_env
    codegen.JITCPUCodegen._library_class = Library


_use()

# The loop over the nodes of a stencil must be unrolled, 27 of them too: weights are then in
# registers and not in tuples on the stack. Quadratic splines in space are 1.7 times as fast for it.
llvm.set_option("", "--unroll-threshold=4000")
# In loops of hundreds of instructions a counter for each array takes registers from the numbers.
llvm.set_option("", "--disable-lsr")
