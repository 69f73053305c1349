"""Commands and styles: styles.toml lists the built-in ones, packages provide others.

A package offers a style in its pyproject.toml::

    [project.entry-points."karamelo_py.fix"]
    gravity = "my_package:Gravity"

A script can also name a class as ``module.Class``, from a module next to the script or an installed
one. Styles are imported when they are first used.
"""

import re
import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.machinery import PathFinder
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any

from karamelo_py import __version__
from karamelo_py.script.errors import FAILURES, ScriptError, instead, meant, one_of, table

PREFIX = "karamelo_py."
BUILT_IN = Path(__file__).parents[1] / "styles.toml"

_CLASS = re.compile(r"([^\W\d]\w*)(?:\.[^\W\d]\w*)*\.([^\W\d]\w*)")

_loaded: dict[tuple[str, str], Any] = {}
_differences: dict[Any, bool | tuple[str, ...]] = {}


@cache
def _families() -> dict[str, dict[str, list[EntryPoint]]]:
    """Entry points by family and name; several entries if packages clash."""
    table = {
        family: {name: [EntryPoint(name, PREFIX + at, PREFIX + family)] for name, at in one.items()}
        for family, one in tomllib.loads(BUILT_IN.read_text(encoding="utf-8")).items()
    }
    everything = entry_points()
    for group in sorted(everything.groups):
        if not group.startswith(PREFIX):
            continue
        styles = table.setdefault(group.removeprefix(PREFIX), {})
        for entry in everything.select(group=group):
            entries = styles.setdefault(entry.name, [])
            if (entry.value, _origin(entry)) not in [(e.value, _origin(e)) for e in entries]:
                entries.append(entry)
    return table


def _origin(entry: EntryPoint) -> str:
    if entry.dist is not None:
        return f"{entry.dist.name} {entry.dist.version}"
    built_in = entry.value.startswith(PREFIX)
    return f"karamelo-py {__version__}" if built_in else f"the module {entry.module}"


def families() -> list[str]:
    return [family for family in _families() if family != "engine"]


def names(family: str) -> list[str]:
    return sorted(_families().get(family, {}), key=lambda name: (name.lower(), name))


def is_foreign(style: type | Callable) -> bool:
    return not style.__module__.startswith(PREFIX)


def knows(family: str, name: str) -> bool:
    return name in _families().get(family, {}) or _of_module(family, name) is not None


@contextmanager
def modules_of(*folders: Path) -> Iterator[None]:
    paths = [str(folder.absolute()) for folder in folders]
    sys.path[:0] = paths
    try:
        yield
    finally:
        for path in paths:
            sys.path.remove(path)


def _of_module(family: str, name: str) -> EntryPoint | None:
    dotted = _CLASS.fullmatch(name)
    if not dotted or not PathFinder.find_spec(dotted[1]):
        return None
    module, _, of_module = name.rpartition(".")
    return EntryPoint(name, f"{module}:{of_module}", PREFIX + family)


def forget_other(module: str) -> bool:
    """Forget a module imported from another folder; return True if this folder has it, too."""
    spec, loaded = PathFinder.find_spec(module), sys.modules.get(module)
    if spec and loaded and loaded.__spec__ and loaded.__spec__.origin != spec.origin:
        for name in [name for name in sys.modules if f"{name}.".startswith(f"{module}.")]:
            del sys.modules[name]
    return spec is not None


def name_of(family: str, style: type) -> str:
    target = f"{style.__module__}:{style.__qualname__}"
    for name, entries in _families().get(family, {}).items():
        if any(entry.value == target for entry in entries):
            return name
    return getattr(style, "style", style.__name__)


def origin(family: str, name: str) -> str:
    return " and ".join(_origin(entry) for entry in _entries(family, name))


def find(family: str, name: str) -> Any:
    """Return a style, imported on first use.

    Raises ScriptError for unknown styles, import errors and clashes of packages.
    """
    key = family, name
    of_module = _of_module(family, name)
    if of_module or key not in _loaded:
        if of_module:
            forget_other(name.partition(".")[0])
        entries = _entries(family, name)
        if len(entries) > 1:
            message = f"{family} '{name}' is offered by two packages: {origin(family, name)}"
            hint = "uninstall one of them (pip uninstall ...)"
            raise ScriptError(message, name=name, expected="one package for each style", hint=hint)
        (entry,) = entries
        try:
            _loaded[key] = entry.load()
        except ScriptError:
            raise
        except FAILURES as error:
            package, reason = _origin(entry), f"{type(error).__name__}: {error}"
            raise ScriptError(
                f"{family} '{name}' of {package} cannot be loaded: {reason}",
                name=name,
                hint=None
                if of_module
                else f"reinstall or repair {package.split()[0]}; it names {entry.value}",
            ) from error
    return _loaded[key]


def called(family: str, ID: str, name: str, third: str = "") -> Any:
    """Return a style as `find` does. If it was written first or third, the error says so."""
    if knows(family, name):
        return find(family, name)
    if knows(family, ID):
        message = f"'{ID}' is a style, and the ID comes first"
        raise ScriptError(message, argument="ID", expected=f"{family}(ID, {ID}, {name}, ...)")
    if knows(family, third):
        message = f"'{third}' is a style, and the style comes before the group"
        raise ScriptError(message, argument=2, expected=f"{family}({ID}, {third}, {name}, ...)")
    # find() raises an error that suggests a name
    return find(family, third if instead(family, third) else name)


def _entries(family: str, name: str) -> list[EntryPoint]:
    styles = _families().get(family, {})
    if name in styles:
        return styles[name]
    if of_module := _of_module(family, name):
        return [of_module]
    shown = [*names(family), *["auto"] * (family == "method")]
    hint = instead(family, name) or meant(name, shown)
    same = {name, name.replace("-", "_"), name.replace("_", "-")}
    others = {f: one for f in families() if f != "command" for one in same if knows(f, one)}
    if hint is None and others:
        hint = f"'{next(iter(others.values()))}' is a style of {' and of '.join(others)}"
        hint += table()["uses"].get(f"{family} {next(iter(others))}", "")
    if hint is None and (dotted := _CLASS.fullmatch(name)):
        hint = f"there is no {dotted[1]}.py next to the script, nor an installed module {dotted[1]}"
    raise ScriptError(
        f"unknown {family if family == 'command' else family + ' style'} '{name}'",
        code="unknown-style",
        name=name,
        kind=family,
        expected=one_of(name, shown, family) if styles else f"no {family} is installed",
        hint=hint,
    )


def may_differ(*commands: Callable, keywords: bool | tuple[str, ...] = True) -> None:
    """Allow a resumed script to change statements of `commands`, or only their `keywords`."""
    _differences.update(dict.fromkeys(commands, keywords))


def differences(command: Callable | None) -> bool | tuple[str, ...]:
    return _differences.get(command, ())


def foreign() -> list[tuple[str, str]]:
    return [key for key, style in _loaded.items() if not style.__module__.startswith(PREFIX)]


def plugins() -> set[str]:
    """Return the modules of other packages that offer styles."""
    entries = (e for family in _families().values() for one in family.values() for e in one)
    return {e.module.partition(".")[0] for e in entries if not e.value.startswith(PREFIX)}


def forget() -> None:
    _families.cache_clear()
    _loaded.clear()
