"""The house holds to its rules: counts that only fall, in the table of docs/house-numbers.md."""

import ast
import re
from collections import Counter, defaultdict
from pathlib import Path

import pytest
from journeys import STATEMENTS, modules
from walked import MODULES, PACKAGE, walked

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "house-numbers.md").read_text("utf-8")
LIMITS = {name: int(n) for name, n in re.findall(r"^\| ([^|]+) \| (\d+) \|$", PAGE, re.M)}
# They read the package once, in one process.
pytestmark = pytest.mark.xdist_group("house")
RIDDLE = re.compile(r"(What|Who|Whether|How|That|Where|Which)\b")


def trees() -> dict[Path, ast.Module]:
    return {path: walked(path)[0] for path in MODULES}


def nodes(*kinds: type):
    """All nodes of these kinds in the package, with their files."""
    return ((path, node) for path in MODULES for node in walked(path) if isinstance(node, kinds))


def room_of(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0]


def unnamed_functions() -> int:
    return sum(node.name == "_" for _, node in nodes(ast.FunctionDef))


def shared_class_names() -> list[str]:
    """Names of several classes, but where one refines another of that name."""
    found = defaultdict(list)
    for _, node in nodes(ast.ClassDef):
        bases = [ast.unparse(base).rpartition(".")[2] for base in node.bases]
        if node.name not in bases:
            found[node.name].append(node)
    return [name for name, classes in found.items() if len(classes) > 1]


def riddles() -> int:
    """Docstrings whose first word is a question, or points at what is not yet named."""
    kinds = ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef
    return sum(bool(RIDDLE.match(ast.get_docstring(node) or "")) for _, node in nodes(*kinds))


def private_imports() -> int:
    """Names imported from modules of Numba that are not its public door, or have an underscore."""
    count = 0
    for _, node in nodes(ast.ImportFrom):
        module = node.module or ""
        if module.split(".")[0] != "numba":
            continue
        private = any(part.startswith("_") for part in module.split("."))
        private |= module.split(".")[1:2] not in ([], ["extending"], ["types"])
        count += sum(private or alias.name.startswith("_") for alias in node.names)
    return count


def lenient() -> int:
    """Kinds of errors that mypy does not look for, by room."""
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    return sum(line.count('"') // 2 for line in re.findall(r"^disable_error_code = .*", text, re.M))


def lambdas() -> int:
    """Implementations of point functions without a name, in ``f.on(Tag)(lambda ...)``."""
    calls = (node for _, node in nodes(ast.Call) if isinstance(node.func, ast.Call))
    return sum(
        getattr(call.func.func, "attr", "") == "on" and isinstance(call.args[0], ast.Lambda)
        for call in calls
        if call.args
    )


def long_signatures() -> int:
    """Functions of kernels and points that take more than five arguments by their places."""
    found = nodes(ast.FunctionDef, ast.Lambda)
    own = (node.args for path, node in found if room_of(path) in ("kernels", "points"))
    return sum(len(one.posonlyargs) + len(one.args) > 5 for one in own)


def guesses() -> int:
    """Attributes that are read with a default: `getattr(x, "name", default)`."""
    calls = (node for _, node in nodes(ast.Call))
    return sum(ast.unparse(call.func) == "getattr" and len(call.args) == 3 for call in calls)


def untyped_in_run() -> int:
    """Uses of `Any` in run/."""
    names = ((path, node.id) for path, node in nodes(ast.Name))
    return sum(name == "Any" and room_of(path) == "run" for path, name in names)


CHANGES = {"append", "add", "update", "setdefault", "clear", "pop", "insert", "extend", "discard"}


def changing_containers() -> set[tuple[str, str]]:
    """Globals of modules in compiler/ that functions of the room change while the program works."""
    room = {path.stem: tree for path, tree in trees().items() if room_of(path) == "compiler"}
    own = {
        (module, name.id)
        for module, tree in room.items()
        for node in tree.body
        if isinstance(node, ast.Assign | ast.AnnAssign)
        for name in ast.walk(node)
        if isinstance(name, ast.Name) and isinstance(name.ctx, ast.Store)
    }
    found = set()
    for module, tree in room.items():
        functions = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef))
        for node in (node for function in functions for node in ast.walk(function)):
            changed = []
            if isinstance(node, ast.Global):
                found |= {(module, name) for name in node.names}
            elif isinstance(node, ast.Subscript) and not isinstance(node.ctx, ast.Load):
                changed = [node.value]
            elif isinstance(node, ast.Call) and getattr(node.func, "attr", "") in CHANGES:
                changed = [node.func.value]
            for one in changed:
                if isinstance(one, ast.Name):
                    found.add((module, one.id))
                elif isinstance(one, ast.Attribute) and isinstance(one.value, ast.Name):
                    found.add((one.value.id, one.attr))
    return found & own


COUNTS = {
    **{f"modules of {name}": lambda name=name: len(modules(name)) for name in STATEMENTS},
    "mutable module-level containers in compiler/": lambda: len(changing_containers()),
    "functions of kernels and points with more than five parameters": long_signatures,
    "getattr with a default": guesses,
    "Any in run/": untyped_in_run,
    "point functions that are lambdas": lambdas,
    "functions named `_`": unnamed_functions,
    "names that several classes have": lambda: len(shared_class_names()),
    "docstrings that begin with a question": riddles,
    "names imported from private modules of Numba": private_imports,
    "mypy error codes disabled per package": lenient,
}


@pytest.mark.parametrize("count", COUNTS)
def test_counts_do_not_grow(count):
    found = COUNTS[count]()
    assert found <= LIMITS[count], f"{count}: {found}, {shared_class_names()}"


def test_lines_of_the_rooms():
    """Shown with ``pytest -s -n 0``."""
    lines = Counter()
    for path in trees():
        lines[room_of(path)] += len(path.read_text("utf-8").splitlines())
    print("", *(f"{n:6} {room}" for room, n in lines.most_common()), sep="\n")
    assert sum(lines.values()) <= LIMITS["lines of Python"]


def test_functions_of_kernels_are_named_as_no_method():
    """The tracer tells methods of laws and schemes, which it refuses, by their names."""
    functions, methods = set(), set()
    for path, tree in trees().items():
        if room_of(path) == "kernels":
            functions |= {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        elif room_of(path) == "schemes" or "laws" in path.relative_to(PACKAGE).parts:
            classes = (node for node in tree.body if isinstance(node, ast.ClassDef))
            own = (node for one in classes for node in one.body)
            methods |= {node.name for node in own if isinstance(node, ast.FunctionDef)}
    assert len(functions) > 100 and "given" in methods
    assert not functions & methods
