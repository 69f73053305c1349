"""Compiled kernels on disk, in two levels.

A file ``.kernel`` contains the name, result and callees of a kernel. Its key is a hash of the
function, the argument types and the sources of the code that writes kernels. If this file is
missing, the kernel is traced, and its machine code is sought in a file ``.code`` by the hash of the
LLVM text.

Since files become code, a file is read only if its checksum is correct and no other user can write
it. If a file is not read, the kernel is compiled, with a warning.
"""

import contextlib
import functools
import hashlib
import os
import pickle
import platform
import re
import sys
import sysconfig
import time
import types as python
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba import types

from karamelo_py.compiler import files
from karamelo_py.compiler.code import machine
from karamelo_py.compiler.disk import lock
from karamelo_py.compiler.trace import choices
from karamelo_py.compiler.trace.choices import name_of
from karamelo_py.compiler.trace.session import session

ROOM = 400e6  # bytes

_began = time.time()
_VERSIONS = platform.python_version(), numba.__version__, llvmlite.__version__, np.__version__
_INSTALLED = sysconfig.get_path("purelib"), sysconfig.get_path("platlib")
_NAMED = (python.FunctionType, python.ModuleType, type)  # identified by their sources
_PLAIN = (type(None), bool, int, float, complex, str, bytes, np.number, np.bool_)
_OURS = re.compile(r"[\w.]+\.[0-9a-f]{32}\.(kernel|code)")


class Unknown(Exception):
    pass


def short_hash(*words: str) -> str:
    return hashlib.sha256("|".join(words).encode()).hexdigest()[:32]


@functools.cache
def _source(path: Path) -> str:
    """Return the hash of an imported source; raise `Unknown` if the file is newer."""
    with contextlib.suppress(OSError):
        about = path.stat()
        if max(about.st_mtime, about.st_ctime) < _began:
            return hashlib.sha256(path.read_bytes()).hexdigest()
    raise Unknown(str(path))


@functools.cache
def _sources() -> str:
    package = Path(__file__).parents[2]
    paths = sorted(path for room in choices.ROOMS for path in (package / room).rglob("*.py"))
    return short_hash(*(f"{path.relative_to(package)} {_source(path)}" for path in paths))


def _stamp(name: str) -> str:
    """Hash a module that is not part of the program, and the uninstalled modules it uses."""
    words: dict[str, str] = {}
    ahead = {name}
    while ahead:
        one = ahead.pop()
        names = _names_in(one)
        file = names.get("__file__")
        if one == "__main__" or not file:
            raise Unknown(one)
        plain = [(k, v) for k, v in names.items() if k[:2] != "__"]
        values = []
        for key, value in plain:
            with contextlib.suppress(Unknown, RecursionError):
                values += [] if isinstance(value, _NAMED) else [f"{key} = {_words(value)}"]
        words[one] = short_hash(one, _source(Path(file)), *values)
        if not one.startswith(__package__.partition(".")[0]):  # a plug-in whose imports are unknown
            named = choices.modules_of(*(v for _, v in plain if isinstance(v, _NAMED)))
            ahead |= {n for n in named - words.keys() if _is_own(n, name.partition(".")[0])}
    return short_hash(*(words[one] for one in sorted(words)))


def _names_in(module: str) -> dict[str, Any]:
    return vars(sys.modules[module]) if module in sys.modules else {}


def _is_own(module: str, top: str) -> bool:
    file = _names_in(module).get("__file__") or _INSTALLED[0]
    return module.partition(".")[0] == top or not file.startswith(_INSTALLED)


def _words(thing: Any) -> str:
    """Describe everything that determines a function, in the same words in every process."""
    if isinstance(thing, _PLAIN):
        return f"{type(thing).__name__} {thing!r}"
    if isinstance(thing, dict):
        return f"dict{_words([*thing.items()])}"
    if isinstance(thing, tuple | list):
        return f"{name_of(type(thing))}({','.join(map(_words, thing))})"
    if isinstance(thing, np.ndarray):
        return f"array {thing.dtype} {thing.shape} {thing.tobytes().hex()}"
    if isinstance(thing, type):
        return _class(thing)
    if hasattr(thing, "__module__") and hasattr(thing, "__name__"):
        named = _names_in(thing.__module__).get(thing.__name__)
        if named is thing or (hasattr(named, "function") and named.function is thing):
            return f"{thing.__module__}:{thing.__name__}"  # described by its source
    function = thing.definition if hasattr(thing, "definition") else thing  # for an intrinsic
    if not isinstance(function, python.FunctionType):
        raise Unknown(repr(thing))
    parts = [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values()]
    for cell in function.__closure__ or ():
        with contextlib.suppress(ValueError):  # skips empty cells
            parts.append(cell.cell_contents)
    code = [
        (c.co_firstlineno, c.co_code, c.co_names, [k for k in c.co_consts if isinstance(k, _PLAIN)])
        for c in choices.codes_in(function.__code__)
    ]
    return f"{name_of(function)} {code}({','.join(map(_words, parts))})"


def _class(one: type, by_name: bool = False) -> str:
    """Describe a class by name, fields and plain attributes.

    Raises `Unknown` for a class that its module does not contain, if `by_name` or in a plug-in.
    """
    first, *rest = one.__qualname__.split(".")
    named = _names_in(one.__module__).get(first)
    for name in rest:
        named = vars(named).get(name) if isinstance(named, type) else None
    if named is not one and (by_name or choices.is_elsewhere(one.__module__)):
        raise Unknown(name_of(one))
    plain = [(k, v) for k, v in vars(one).items() if isinstance(v, _PLAIN) and k[:2] != "__"]
    return f"{name_of(one)} {vars(one).get('_fields')} {sorted(plain)}"


def describe(numba_type: Any) -> str:
    """Describe a type, with the same words in every process."""
    how = type(numba_type).__name__  # the class tells whether the type is held or a value
    if isinstance(numba_type, types.BaseTuple):
        inner = ",".join(map(describe, numba_type))
        one = choices.tag_class(numba_type)
        return f"{how} {one and _class(one, by_name=True)}({inner})"
    if isinstance(numba_type, (types.Callable, types.Opaque)) and numba_type != types.none:
        raise Unknown(str(numba_type))
    return f"{how}:{numba_type}"


@functools.cache
def _registered(count: int, changes: int) -> tuple[str, set[str]]:
    """Describe the implementations that are in all keys; return a hash, and their modules."""
    return short_hash(*map(_words, session.registered)), choices.modules_of(*session.registered)


class KernelFiles:
    """Cached kernels of one function for a `processor`, loaded by `load`.

    `called` are the functions that are inlined in the kernels.
    """

    def __init__(
        self, function: Callable, load: Callable[[Any], Any], processor: str = "", *called: Callable
    ):
        self._function, self._load, self._processor = function, load, processor
        self._called = called

    def kernel(self, kinds: tuple, result: Any, compiled: Callable[[], Any]) -> Any:
        """Read a kernel, or compile it while other processes wait."""
        try:
            key = self._key(kinds, result)
        except (Unknown, RecursionError):
            return compiled()
        unit = self._found(key)
        if unit is None:
            with lock.lock(files.folder() / f"{key}.lock"):
                # another process may have compiled the unit meanwhile
                unit = self._found(key)
                if unit is None:
                    unit = compiled()
                    self._save(key, unit)
        return unit

    def _key(self, kinds: tuple, result: Any) -> str:
        function = self._function
        classes = (one for kind in kinds for one in choices.classes_in(kind))
        made = [function, *self._called]
        registered, modules = _registered(len(session.registered), session.changes)
        elsewhere = sorted(choices.modules_of(*made, *classes) | modules)
        words = [*map(_words, made), registered, *map(describe, kinds)]
        words += [describe(result) if result is not None else "", self._processor, _sources()]
        words += [machine.describe(), repr(_VERSIONS)]
        words += [f"{one} {_stamp(one)}" for one in elsewhere]
        name = re.sub(r"[^\w.]", "", f"{function.__module__}.{function.__qualname__}")
        return f"{name}.{short_hash(*words)}"

    def _found(self, key: str) -> Any:
        path = files.folder() / f"{key}.kernel"
        content = _content(path)
        if content is None:
            return None
        try:
            stamps, unit = pickle.loads(content)
            if any(_stamp(name) != stamp for name, stamp in stamps.items()):
                return None
            self._load(unit)
        except (Unknown, FileNotFoundError):  # machine code or a module is missing
            return None
        except Exception:
            _damaged(path)
            return None
        return unit

    def _save(self, key: str, unit: Any) -> None:
        with contextlib.suppress(Unknown):
            stamps = {name: _stamp(name) for name in sorted(unit.modules)}
            _keep(files.folder() / f"{key}.kernel", pickle.dumps((stamps, _without_code(unit))))


def _without_code(unit: Any) -> Any:
    return unit._replace(code=b"", needs=tuple(map(_without_code, unit.needs)))


def machine_code(name: str, make: Callable[[], bytes]) -> bytes:
    path = files.folder() / f"{name}.code"
    code = _content(path)
    if code is None:
        code = make()
        _keep(path, code)
    return code


def code_of(name: str) -> bytes:
    code = _content(files.folder() / f"{name}.code")
    if code is None:
        raise FileNotFoundError(name)
    return code


def _content(path: Path) -> bytes | None:
    """Return a file's content, or None; delete a damaged file."""
    try:
        content = files.read(path)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        files.report_error(error)
        return None
    except ValueError:
        _damaged(path)
        return None
    with contextlib.suppress(OSError):
        os.utime(path)
    return content


def _damaged(path: Path) -> None:
    files.report(f"a file in {files.folder()} is damaged; its loop is compiled again")
    with contextlib.suppress(OSError):
        path.unlink()


def _keep(path: Path, content: bytes) -> None:
    try:
        files.write(path, content)
        make_room(path.parent)
    except OSError as error:
        files.report_error(error)


@functools.cache
def make_room(folder: Path) -> None:
    """Delete the least recently used files above `ROOM` bytes."""
    ages, room = [], ROOM
    for one in folder.iterdir():
        if _OURS.fullmatch(one.name):
            with contextlib.suppress(FileNotFoundError):
                about = one.stat()
                ages.append((about.st_mtime, about.st_size, one))
    for _, size, one in sorted(ages, key=lambda item: item[0], reverse=True):
        room -= size
        if room < 0:
            one.unlink(missing_ok=True)
