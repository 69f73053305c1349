"""Pages of all errors, warnings and notes, read from the code that makes them.

A message is the text of a call that makes one (`CALLS`). Its text may be put together of strings,
f-strings, sums, choices and local names; what is known only in a run becomes an ellipsis. Pages are
written to docs/messages/generated before Sphinx reads its sources, and with them a list for the
box on the page of messages, which finds a message by its own words.
"""

from __future__ import annotations

import ast
import itertools
import json
import re
import shutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from reference_pages import escaped

from karamelo_py.language import registry

PACKAGE = Path(__file__).parents[2] / "karamelo_py"
HOLE = "…"
MOST = 8  # texts of one expression
UNKNOWN = ast.Name("?")
PLAIN = (ast.Constant, ast.JoinedStr, ast.IfExp, ast.BinOp)
# Calls that make a message: kind, then where message, expected and hint stand.
CALLS = {
    "ScriptError": ("error", 0, "expected", "hint"),
    "SimulationError": ("error", 0, "expected", "hint"),
    "unknown": ("error", 0, "expected", "hint"),
    "Mistake": ("error", 0, 3, 4),
    "mistake": ("error", 0, 1, 2),
    "Trouble": ("error", 0, None, 1),
    "no_number": ("error", 2, None, 3),
    "fault": ("error", 1, None, "hint"),
    "ArgumentTypeError": ("error", 0, None, None),
    "Failed": ("error", 0, None, None),
    "TooFar": ("error", 0, None, None),
    "Wrong": ("error", 0, None, None),
    "NoEquilibrium": ("error", 0, None, None),
    "Unreachable": ("error", 0, None, None),
    "Undefined": ("error", 0, None, None),
    "NoCard": ("error", 0, None, 1),
    "warn": ("warning", 0, "expected", "hint"),
    "known_failure": ("warning", "reason", None, "cure"),
    "render_message": ("", 1, "expected", "hint"),
}
# Functions that return a message and a hint.
PAIRS = re.compile(r"^run/(diagnosis/|recovery|timestep)")
# Those whose messages are no errors, or a part of another message.
CAUSES = {
    "words_of_growth": "warning",
    "words_of_loss": "warning",
    "cause_of_gain": "cause of a gain of energy",
    "_gain_of_implicit_steps": "cause of a gain of energy",
    "cause_of_loss": "cause of a loss of energy",
    "collides": "cause of a loss of energy",
}
# Page, its title, what it is about, and the modules whose messages it has: the first that fits.
PAGES = (
    ("known-failures", "Known failures", "Warnings before the first step: a combination that is "
     "known to fail in scenes of this kind.", r"^run/advice/"),
    ("gpu", "On a GPU", "Messages of runs with `--gpu`: what is missing, or not done there.",
     r"^run/lower/card|^compiler/gpu"),
    ("processes", "Several processes", "Messages of runs with `--ranks` and MPI.",
     r"^run/mpi/|^app/launch|^scene/comm"),
    ("run", "During a run", "Errors that stop a run, and warnings of steps, energy and memory.",
     r"^(run/(?!checkpoint)|kernels|schemes)"),
    ("output", "Output and restarts", "Log, dumps, plots and restart files.",
     r"^(output|run/checkpoint|styles/dumps|commands/output)"),
    ("fixes", "Fixes and computes", "Messages of fixes, computes and groups.",
     r"^(styles/(fixes|computes)|commands/fixes|scene/group)"),
    ("command-line", "Command line, Python and studies",
     "Messages of the command line, of `Simulation`, and of sweep, chart, advise, stability.",
     r"^(app|compiler)"),
    ("scene", "Building the scene", "Method, domain, regions, meshes, materials and solids.",
     r"^(commands/(?!language)|scene|styles|points)"),
    ("language", "Reading the script", "Syntax, names, arguments and formulas.", r""),
)  # fmt: skip


class Message(NamedTuple):
    """A message as a template: `…` stands for what a run puts in."""

    kind: str
    text: str
    expected: tuple[str, ...]
    hint: tuple[str, ...]
    module: str
    told_by: str  # a style (``fix drag``), a command, or nothing

    def matches(self, said: str) -> bool:
        """Tell whether a message of a run is one of this kind."""
        return _pattern(self.text).fullmatch(said) is not None


@cache
def _pattern(text: str) -> re.Pattern:
    return re.compile("(.*: )?" + ".*".join(map(re.escape, text.split(HOLE))), re.S)


class _Reader:
    """Reads the messages of one module."""

    def __init__(self, path: Path):
        self.module = path.relative_to(PACKAGE).with_suffix("").as_posix()
        self.tree = ast.parse(path.read_text(encoding="utf-8"))
        self.parents = {
            child: node for node in ast.walk(self.tree) for child in ast.iter_child_nodes(node)
        }
        self.names: dict[ast.AST, dict] = {}
        self.tuples = {
            one.targets[0].id: one.value
            for one in self.tree.body
            if isinstance(one, ast.Assign) and isinstance(one.value, ast.Tuple)
            if isinstance(one.targets[0], ast.Name)
        }
        self.depth = 0

    def messages(self) -> Iterator[Message]:
        """All messages of the module, in its order."""
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Call) and self._name(node.func) in CALLS:
                yield from self._of_call(node)
            elif isinstance(node, ast.Return) and PAIRS.search(self.module):
                pair = node.value
                if isinstance(pair, ast.Tuple) and len(pair.elts) == 2:
                    kind = CAUSES.get(self._inside(node).name, "error")
                    yield from self._made(node, kind, pair.elts[0], None, pair.elts[1])

    def _of_call(self, node: ast.Call) -> Iterator[Message]:
        kind, *where = CALLS[self._name(node.func)]
        text, expected, hint = (self._argument(node, one) for one in where)
        if self._name(node.func) == "Trouble":
            kind = CAUSES.get(self._inside(node).name, kind)
        if self._name(node.func) == "render_message":
            kind = self._texts(node.args[0], node)[0]
        if text is None or HOLE in kind:
            return
        if self._name(node.func) == "known_failure":
            text = ast.BinOp(
                ast.BinOp(node.args[1], ast.Add(), ast.Constant(": ")), ast.Add(), text
            )
        if self._name(node.func) == "unknown":
            expected = expected or ast.Constant("one of the names that exist")
            hint = hint or ast.Constant("the name most like it")
        yield from self._made(node, kind, text, expected, hint)

    def _made(self, node: ast.AST, kind: str, text, expected, hint) -> Iterator[Message]:
        for said, block in self._branches(text, node):
            said = re.sub(rf"{HOLE}(\s*{HOLE})+", HOLE, re.sub(r"\{[^{}]+\}", HOLE, said))
            if not re.search(r"[a-z]{5}|[a-z]{2}.*[^a-z][a-z]{2}", said):
                continue  # made elsewhere
            advice = []
            for one in (expected, hint):
                texts = self._texts(one, node, block) if one is not None else []
                texts = [re.sub(r"\{[^{}]+\}", HOLE, text) for text in texts]
                advice.append(tuple(t for t in texts if re.search(r"\w\w", t)))
            rule = getattr(node, "func", None) and self._name(node.func) == "known_failure"
            module = "run/advice/" + self.module if rule else self.module
            yield Message(kind, said, *advice, module, self._told_by(node))

    @staticmethod
    def _argument(node: ast.Call, where: int | str | None) -> ast.AST | None:
        if isinstance(where, str):
            return next((k.value for k in node.keywords if k.arg == where), None)
        if where is None or where >= len(node.args):
            return None
        given = node.args[: where + 1]
        return None if any(isinstance(one, ast.Starred) for one in given) else node.args[where]

    @staticmethod
    def _name(node: ast.AST) -> str:
        return getattr(node, "attr", getattr(node, "id", ""))

    def _above(self, node: ast.AST) -> Iterator[ast.AST]:
        while node in self.parents:
            node = self.parents[node]
            yield node

    def _inside(self, node: ast.AST) -> ast.FunctionDef:
        """The function that a statement is in."""
        return next(one for one in self._above(node) if isinstance(one, ast.FunctionDef))

    def _told_by(self, node: ast.AST) -> str:
        module = f"karamelo_py.{self.module.replace('/', '.')}"
        above = (n for n in self._above(node) if isinstance(n, (ast.ClassDef, ast.FunctionDef)))
        return next((s for one in above if (s := styles().get(f"{module}:{one.name}"))), "")

    def _assigned(self, name: str, node: ast.AST) -> list[tuple[ast.AST, ast.AST]]:
        """Values that a name may have where `node` stands, and the statement of each."""
        scopes = [n for n in self._above(node) if isinstance(n, ast.FunctionDef)] + [self.tree]
        return next((found for one in scopes if (found := self._names(one).get(name))), [])

    def _names(self, scope: ast.AST) -> dict[str, list[tuple[ast.AST, ast.AST]]]:
        """Names that a function (or the module) sets, with their values where these are known."""
        if scope in self.names:
            return self.names[scope]
        found: dict[str, list] = self.names.setdefault(scope, {})

        def add(target: ast.AST | None, value: ast.AST, where: ast.AST) -> None:
            if isinstance(target, ast.Name):
                found.setdefault(target.id, []).append((value, where))
            elif isinstance(target, ast.Starred):
                add(target.value, UNKNOWN, where)
            elif isinstance(target, ast.Tuple):
                value = self.tuples.get(getattr(value, "id", ""), value)
                same = isinstance(value, ast.Tuple) and len(value.elts) == len(target.elts)
                values = value.elts if same else [UNKNOWN] * len(target.elts)
                if isinstance(value, ast.Tuple) and isinstance(target.elts[-1], ast.Starred):
                    values = [*value.elts[: len(target.elts) - 1], UNKNOWN]
                for one, part in zip(target.elts, values, strict=True):
                    add(one, part, where)

        for one in ast.walk(scope):
            if isinstance(one, ast.Assign):
                for target in one.targets:
                    add(target, one.value, one)
            elif isinstance(one, (ast.AnnAssign, ast.NamedExpr)) and one.value is not None:
                add(one.target, one.value, one)
            elif isinstance(one, (ast.For, ast.comprehension)):
                add(one.target, UNKNOWN, one)
            elif isinstance(one, ast.arg):
                add(ast.Name(one.arg), UNKNOWN, one)
        return found

    def _block(self, statement: ast.AST) -> tuple:
        """The branch that a statement stands in."""
        parent = self.parents.get(statement)
        for name in ("body", "orelse", "finalbody"):
            if statement in (getattr(parent, name, None) or ()):
                return parent, name
        return parent, ""

    def _branches(self, text: ast.AST, node: ast.AST) -> Iterator[tuple[str, tuple | None]]:
        """Texts of a message, each with the branch of the code that it comes from."""
        if isinstance(text, ast.Name) and (values := self._assigned(text.id, node)):
            for value, statement in values:
                for said in self._texts(value, statement):
                    more = self._added(text.id, node, statement)
                    yield said + more, self._block(statement)
            return
        for said in self._texts(text, node):
            yield said, None

    def _added(self, name: str, node: ast.AST, after: ast.AST) -> str:
        """An ellipsis where more is added to a text."""
        scope = next((n for n in self._above(node) if isinstance(n, ast.FunctionDef)), self.tree)
        adds = (n for n in ast.walk(scope) if isinstance(n, ast.AugAssign))
        found = [n for n in adds if self._name(n.target) == name and n.lineno > after.lineno]
        if len(found) == 1 and self._block(found[0]) == self._block(after):
            return self._texts(found[0].value, found[0])[0]
        return HOLE if found else ""

    def _texts(self, node: ast.AST | None, at: ast.AST, block: tuple | None = None) -> list[str]:
        """All texts that an expression may have."""
        self.depth += 1
        try:
            texts = self._alternatives(node, at, block) if self.depth < 9 else [HOLE]
        finally:
            self.depth -= 1
        return list(dict.fromkeys(texts))[:MOST]

    def _alternatives(self, node: ast.AST | None, at: ast.AST, block: tuple | None) -> list[str]:
        if isinstance(node, ast.Constant):
            return [] if node.value is None else [str(node.value)]
        if isinstance(node, ast.JoinedStr):
            parts = [self._texts(value, at, block) for value in node.values]
            return ["".join(one) for one in itertools.islice(itertools.product(*parts), MOST)]
        if isinstance(node, ast.FormattedValue):
            texts = self._texts(node.value, at, block)
            choice = isinstance(node.value, ast.IfExp)
            known = all(re.search("[a-z]", text) and HOLE not in text for text in texts)
            return texts if texts and (known or choice) else [HOLE]
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
            left, right = self._texts(node.left, at, block), self._texts(node.right, at, block)
            both = itertools.product(left or [""], right or [""])
            return [a + b for a, b in itertools.islice(both, MOST)]
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            return ["", *self._texts(node.left, at, block)]
        if isinstance(node, ast.IfExp):
            return self._texts(node.body, at, block) + self._texts(node.orelse, at, block)
        if isinstance(node, ast.BoolOp):
            return [text for value in node.values for text in self._texts(value, at, block)]
        if isinstance(node, ast.Name):
            return self._of_name(node.id, at, block)
        if isinstance(node, ast.Attribute):
            return _elsewhere(constants().get(node.attr))
        if isinstance(node, ast.Call):
            return _elsewhere(returned().get(self._name(node.func)))
        return [HOLE]

    def _of_name(self, name: str, at: ast.AST, block: tuple | None) -> list[str]:
        values = self._assigned(name, at)
        same = [v for v in values if block is not None and self._block(v[1]) == block]
        texts = [t for value, one in same or values for t in self._texts(value, one, block)]
        return texts or ([] if values else _elsewhere(constants().get(name)))


@cache
def styles() -> dict[str, str]:
    """The class or function of each command and style -> its name."""
    found = {}
    for family in registry.families():
        for name in registry.names(family):
            target = registry.find(family, name)
            where = f"{target.__module__}:{target.__qualname__}"
            found[where] = name if family == "command" else f"{family} {name}"
    return found


@cache
def _readers() -> list[_Reader]:
    return [_Reader(path) for path in sorted(PACKAGE.rglob("*.py"))]


@cache
def constants() -> dict[str, list[tuple[_Reader, ast.AST]]]:
    """Names of modules in capitals -> where their texts are."""
    found = {}
    for reader in _readers():
        for one in reader.tree.body:
            if isinstance(one, ast.Assign) and isinstance(one.targets[0], ast.Name):
                value, name = one.value, one.targets[0].id
                text = isinstance(getattr(value, "value", ""), str)
                if name.isupper() and isinstance(value, PLAIN) and text:
                    found[name] = [(reader, value)]
    return found


@cache
def returned() -> dict[str, list[tuple[_Reader, ast.AST]]]:
    """Functions that return a text -> where the texts are."""
    found: dict[str, list[tuple[_Reader, ast.AST]]] = {}
    for reader in _readers():
        for one in ast.walk(reader.tree):
            if isinstance(one, ast.FunctionDef) and getattr(one.returns, "id", "") == "str":
                values = [r.value for r in ast.walk(one) if isinstance(r, ast.Return)]
                if len(values) < 4 and all(isinstance(value, PLAIN) for value in values):
                    found.setdefault(one.name, []).extend((reader, value) for value in values)
    return found


def _elsewhere(found: list[tuple[_Reader, ast.AST]] | None) -> list[str]:
    texts = [t for reader, value in found or () for t in reader._texts(value, value)]
    return texts if any(re.search(r"[a-z]{3}", text) for text in texts) else [HOLE]


@cache
def messages() -> list[Message]:
    """All messages of the program, each once."""
    found: dict[tuple, Message] = {}
    for reader in _readers():
        for message in reader.messages():
            found.setdefault((message.text, message.told_by), message)
    return list(found.values())


def page_of(message: Message) -> str:
    """The page that has a message."""
    return next(page for page, _, _, modules in PAGES if re.search(modules, message.module))


def write_pages(folder: Path, list_file: Path) -> None:
    """Write a page for each part of the program, and the list for the box."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    listed = []
    for page, title, about, _ in PAGES:
        own = sorted((m for m in messages() if page_of(m) == page), key=lambda m: m.text.lower())
        parts = [f"# {title}", about]
        for number, message in enumerate(own):
            parts += [f"({page}-{number})=", *_entry(message)]
            listed.append([f"generated/{page}.html#{page}-{number}", message.text, _kind(message)])
        head = "---\ntocdepth: 1\n---\n\n"
        style = "<style>article h2 { font-size: 1rem; margin: 1.6em 0 0.2em; }</style>"
        parts.insert(1, f"```{{raw}} html\n{style}\n```")
        (folder / f"{page}.md").write_text(head + "\n\n".join(parts) + "\n", encoding="utf-8")
    text = f"const MESSAGES = {json.dumps(listed, ensure_ascii=False, indent=0)};\n"
    list_file.parent.mkdir(parents=True, exist_ok=True)
    list_file.write_text(text, encoding="utf-8")


def _kind(message: Message) -> str:
    return f"{message.kind} of {message.told_by}" if message.told_by else message.kind


def _entry(message: Message) -> list[str]:
    """The heading of a message, who tells it, what is expected and what to write."""
    words = message.text.split()
    title = " ".join(words) if len(words) <= 16 else " ".join(words[:14]) + " …"
    parts = [f"## {escaped(title)}"]
    if len(words) > 16:
        parts.append(escaped(" ".join(words)))
    lines = [f"*{message.kind.capitalize()}*" + _link(message.told_by)]
    for name, texts in (("Expected", message.expected), ("What to write", message.hint)):
        said = "; or: ".join(escaped(" ".join(text.split())) for text in texts)
        lines += [f"{name}: {said}"] if said else []
    return [*parts, "\n\n".join(lines)]


def _link(told_by: str) -> str:
    if not told_by:
        return ""
    family, _, name = told_by.rpartition(" ")
    page = f"../../reference/generated/{family or 'command'}/{name.replace('/', '-')}.md"
    return f" of [{escaped(told_by)}]({page})"


def setup(app):
    """Write the pages before the sources are read."""

    def write(app) -> None:
        docs = Path(app.srcdir)
        write_pages(docs / "messages" / "generated", docs / "_static" / "generated" / "messages.js")

    app.connect("builder-inited", write)
    return {"parallel_read_safe": True}
