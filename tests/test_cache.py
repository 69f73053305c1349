"""Kernels on disk: recompiled only when their content changes; faults of the folder stop no run."""

import errno
import hashlib
import io
import os
import pickle
import shutil
import stat
import subprocess
import sys
import warnings
from textwrap import dedent
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from listening import listening
from numba import config

from karamelo_py.compiler import files, kernel, point_function
from karamelo_py.compiler.code import machine
from karamelo_py.compiler.disk import cache
from karamelo_py.compiler.threads import Serial, Threaded, shared_out
from karamelo_py.compiler.trace import choices
from karamelo_py.compiler.trace.lowering import FunctionType
from karamelo_py.compiler.trace.session import session
from karamelo_py.kernels.table import each_node
from karamelo_py.output.console import Console
from karamelo_py.run.timings import Timings
from karamelo_py.scene.hub import Hub

pytestmark = pytest.mark.skipif(config.DISABLE_JIT, reason="nothing is compiled")


# A small package: shapes in separate files, functions they share, and a loop over points.
FILES = {
    "numbers_used.py": "HALF = 0.5\nUNUSED = 7\n",
    "helpers.py": """
        from karamelo_py.compiler import implements, shared
        import numbers_used

        @shared
        def halved(x):
            '''Half of x.'''
            return numbers_used.HALF * x

        def spelling(n):
            return f"{n} * x"

        def plus_one(x):
            return x + 1.0

        @implements(plus_one, by_type=True)
        def _(x):
            return by_amount(1.0)

        def by_amount(amount):
            return lambda x: x + amount
        """,
    "loops.py": """
        from typing import NamedTuple
        from karamelo_py.compiler import implements, point_function
        from karamelo_py.compiler import kernel

        class Pair(NamedTuple):
            first: float
            second: float

        @point_function(otherwise=True)
        def area(shape):
            return -1.0

        @point_function()
        def price(shape):
            pass

        def paid(shape):
            return 0.0

        @implements(paid, by_type=True)
        def _(shape):
            if price.defined(shape.instance_class):
                return lambda shape: price(shape)
            return lambda shape: 0.0

        @kernel
        def one(shape, pair):
            return area(shape) + paid(shape) + 0.0 * pair.first

        @kernel
        def total(shape, pair, n):
            total = 0.0
            for _ in range(n):
                total += one(shape, pair)
            return total + 100.0 * pair.second
        """,
    "disks.py": """
        from typing import NamedTuple
        from helpers import halved, plus_one
        from loops import area

        class Disk(NamedTuple):
            r: float

        @area.on(Disk)
        def _(shape):
            return plus_one(halved(6.0) * shape.r)
        """,
    "squares.py": """
        from typing import NamedTuple
        from helpers import halved
        from loops import area

        class Square(NamedTuple):
            a: float

        @area.on(Square)
        def _(shape):
            # a comment
            return halved(2.0 * shape.a)
        """,
    "strips.py": """
        from typing import NamedTuple

        class Strip(NamedTuple):
            b: float
        """,
    "program.py": """
        import warnings
        from karamelo_py.compiler import compilation
        from loops import Pair, total
        from disks import Disk
        from squares import Square
        from strips import Strip

        class Compiled:
            names = []
            def on_start(self, name):
                if name == "total":
                    self.names.append(type(shape).__name__)
            def on_end(self): ...

        values = []
        listening = compilation.told_to(Compiled())
        with listening, warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("default")
            for shape in (Disk(1.0), Square(2.0), Strip(3.0)):
                values.append(total(shape, Pair(1.0, 2.0), 3))
        print(values)
        print(Compiled.names)
        for one in told:
            print(one.message)
        """,
}
START = "import sys; sys.dont_write_bytecode = True; exec(open('program.py').read())"
VALUES = [212.0, 206.0, 197.0]
ALL = ["Disk", "Square", "Strip"]


class Shapes:
    """The package on disk, with a method that runs its program."""

    def __init__(self, python, folder):
        self.python, self.folder = python, folder
        self.kernels = folder / "cache" / "kernels"
        for name, text in FILES.items():
            (folder / name).write_text(dedent(text))

    def edit(self, name, old, new):
        """Change a file of the package."""
        text = (self.folder / name).read_text()
        assert old in text
        (self.folder / name).write_text(text.replace(old, new))

    def run(self):
        """Return the three totals, the shapes compiled for, and the warnings."""
        path = os.pathsep.join([str(self.folder), os.environ["PYTHONPATH"]])
        own = {"KARAMELO_PY_CACHE": str(self.folder / "cache"), "PYTHONPATH": path}
        done = subprocess.run(
            [self.python, "-c", START], cwd=self.folder, env=os.environ | own,
            capture_output=True, text=True,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        values, compiled, *told = done.stdout.splitlines()
        return eval(values), eval(compiled), told


@pytest.fixture(scope="module")
def compiled(compiling, tmp_path_factory):
    """The kernel files of the package before any edit."""
    shapes = Shapes(compiling, tmp_path_factory.mktemp("shapes"))
    assert shapes.run() == (VALUES, ALL, [])
    assert shapes.run() == (VALUES, [], [])
    return {path.name: path.read_bytes() for path in shapes.kernels.iterdir()}


@pytest.fixture
def shapes(compiling, tmp_path, compiled):
    """A copy of the package with its kernels."""
    shapes = Shapes(compiling, tmp_path)
    shapes.kernels.mkdir(parents=True)
    for name, content in compiled.items():
        (shapes.kernels / name).write_bytes(content)
    return shapes


EDITS = {
    "comment, docstring, what nobody uses": (
        [
            ("squares.py", "# a comment", "# another\n    # comment"),
            ("helpers.py", "Half of x.", "x / 2."),
            ("numbers_used.py", "7", "8"),
        ],
        VALUES,
        [],
    ),
    "one implementation, and a chooser's helper": (
        [
            ("squares.py", "2.0 * shape.a", "3.0 * shape.a"),
            ("helpers.py", "x + amount", "x + 2.0 * amount"),
        ],
        [215.0, 209.0, 197.0],
        ["Disk", "Square"],
    ),
    "a constant of another file": (
        [("numbers_used.py", "0.5", "0.25")],
        [207.5, 203.0, 197.0],
        ["Disk", "Square"],
    ),
    "what a chooser was given, and what otherwise holds": (
        [("helpers.py", "by_amount(1.0)", "by_amount(3.0)"), ("loops.py", "-1.0", "-2.0")],
        [218.0, 206.0, 194.0],
        ["Disk", "Strip"],
    ),
    "a kernel in the kernel": (
        [("loops.py", "0.0 * pair.first", "1.0 * pair.first")],
        [215.0, 209.0, 200.0],
        ALL,
    ),
    "an implementation where there was none, and what a chooser asked for": (
        [("program.py", "class Compiled", "import more\nimport dear\n\nclass Compiled")],
        [212.0, 215.0, 209.0],
        ["Square", "Strip"],
    ),
    "the order of fields of one type": (
        [("loops.py", "first: float\n    second: float", "second: float\n    first: float")],
        [112.0, 106.0, 97.0],
        ALL,
    ),
}


@pytest.mark.parametrize("name", EDITS)
def test_what_is_compiled_again(shapes, name):
    """An edit has every kernel traced again; only those whose code changed are compiled."""
    edits, values, again = EDITS[name]
    more = (
        "from loops import area\nfrom strips import Strip\narea.on(Strip)(lambda shape: shape.b)\n"
    )
    (shapes.folder / "more.py").write_text(more)
    more = (
        "from loops import price\nfrom squares import Square\nprice.on(Square)(lambda shape: 3.0)\n"
    )
    (shapes.folder / "dear.py").write_text(more)
    for edit in edits:
        shapes.edit(*edit)
    assert shapes.run() == (values, ALL, [])
    assert len([*shapes.kernels.glob("*.code")]) == 2 * (len(ALL) + len(again))
    assert shapes.run() == (values, [], [])


def test_an_edit_taken_back(shapes):
    """Kernels of several versions of the sources are kept, so undoing an edit costs nothing."""
    shapes.edit("squares.py", "2.0", "3.0")
    assert shapes.run()[1] == ALL
    shapes.edit("squares.py", "3.0", "2.0")
    assert shapes.run() == (VALUES, [], [])


# --- faults of the folder -----------------------------------------------------------------------


def test_a_file_in_place_of_the_folder(shapes):
    for path in shapes.kernels.iterdir():
        path.unlink()
    shapes.kernels.rmdir()
    shapes.kernels.write_text("")
    values, compiled, told = shapes.run()
    assert (values, compiled) == (VALUES, ALL)
    assert len(told) == 1
    assert str(shapes.kernels) in told[0]
    assert shapes.kernels.read_text() == ""


@pytest.mark.parametrize("length", [0, 1000])
def test_truncated_files(shapes, length):
    for path in shapes.kernels.iterdir():
        path.write_bytes(path.read_bytes()[:length])
    values, compiled, told = shapes.run()
    assert (values, compiled) == (VALUES, ALL)
    assert len(told) == 1
    assert f"a file in {shapes.kernels} is damaged" in told[0]
    assert shapes.run() == (VALUES, [], [])


def test_folders_in_place_of_files(shapes):
    for path in shapes.kernels.iterdir():
        path.unlink()
        path.mkdir()
    values, compiled, told = shapes.run()
    assert (values, compiled, len(told)) == (VALUES, ALL, 1)
    assert str(shapes.kernels) in told[0]


class Tag(NamedTuple):
    """A shape defined in this file."""


@point_function()
def answer(tag):
    """A number."""


@answer.on(Tag)
def forty_two(tag):
    return 42


def fresh():
    """A kernel that has not been compiled yet."""

    def asked(tag):
        return answer(tag)

    return kernel(asked)


def refuse(*arguments, **keywords):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize(
    "call", ["os.replace", "tempfile.mkstemp", "os.listdir", "pathlib.Path.mkdir"]
)
def test_a_full_disk_or_a_forbidden_folder(tmp_path, monkeypatch, call):
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    told = []
    with monkeypatch.context() as patched, files.telling(told.append):
        patched.setattr(call, refuse)
        assert fresh()(Tag()) == 42
        assert fresh()(Tag()) == 42
    assert len(told) == 1
    assert f"cannot be stored in {tmp_path / 'kernels'}: {os.strerror(errno.ENOSPC)}" in told[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fresh()(Tag()) == 42
    names = [path.name for path in (tmp_path / "kernels").iterdir()]
    assert all(name.endswith((".kernel", ".code")) for name in names)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no owners and modes")
@pytest.mark.parametrize("whose", ["folder of another", "file of another", "file for all", "link"])
def test_what_another_user_may_have_written_is_not_read(tmp_path, monkeypatch, whose):
    """Unpickling can run any code, so files that other users could have written are not opened."""

    class Harm:
        def __reduce__(self):
            return open, (str(tmp_path / "harm"), "w")

    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    assert fresh()(Tag()) == 42
    (path,) = (tmp_path / "kernels").glob("*.kernel")
    content = pickle.dumps(Harm())
    planted = path.with_name("planted") if whose == "link" else path
    planted.write_bytes(hashlib.sha256(content).digest() + content)
    if whose == "link":
        path.unlink()
        path.symlink_to(planted)
    elif whose == "file for all":
        path.chmod(0o666)
    elif os.geteuid() == 0:
        os.chown(path if whose == "file of another" else path.parent, 12345, -1)
    else:
        monkeypatch.setattr(os, "geteuid", lambda: 12345)
    told = []
    with files.telling(told.append):
        assert fresh()(Tag()) == 42
    assert not (tmp_path / "harm").exists()
    assert len(told) == 1 and f"cannot be stored in {tmp_path / 'kernels'}" in told[0]
    word = {"link": "symbolic links", "file for all": "other users can write to it"}
    assert word.get(whose, "it belongs to another user") in told[0]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no owners and modes")
def test_the_folder_is_closed_to_others(tmp_path, monkeypatch):
    """With the common umask of 002 the group could write to it."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    (tmp_path / "kernels").mkdir()
    (tmp_path / "kernels").chmod(0o777)
    told = []
    with files.telling(told.append):
        assert fresh()(Tag()) == 42
        assert fresh()(Tag()) == 42
    assert told == []
    assert stat.S_IMODE((tmp_path / "kernels").stat().st_mode) == 0o755


def test_a_folder_that_is_gone_when_a_loop_is_compiled(tmp_path, monkeypatch):
    """If a file takes its place during compilation, there is a warning and the loop runs."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path / "cache"))
    compiled = machine.compile_text

    def meanwhile(text):
        shutil.rmtree(tmp_path / "cache")
        (tmp_path / "cache").write_text("")
        return compiled(text)

    monkeypatch.setattr(machine, "compile_text", meanwhile)
    told = []
    with files.telling(told.append):
        assert fresh()(Tag()) == 42
    assert len(told) == 1 and "cannot be stored in" in told[0]


def test_room_and_other_files(tmp_path, monkeypatch):
    """The least recently used kernels are deleted to make room, but no other files."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    folder = tmp_path / "kernels"
    folder.mkdir()
    (folder / "mine.kernel").write_bytes(b"0" * 100)
    old = [folder / f"loops.total.{k:032x}.kernel" for k in range(3)]
    for age, path in enumerate(old):
        path.write_bytes(b"0" * 100)
        os.utime(path, (1e9 - age, 1e9 - age))
    assert fresh()(Tag()) == 42
    new = set(folder.iterdir()) - {folder / "mine.kernel", *old}
    assert all(path.exists() for path in old)
    code = sum(path.stat().st_size for path in new if path.suffix == ".code")
    monkeypatch.setattr(cache, "ROOM", code + 150)
    for path in new:
        path.unlink()
    cache.make_room.cache_clear()  # as in a new process
    assert fresh()(Tag()) == 42
    assert [path.exists() for path in old] == [True, False, False]
    assert all(path.exists() for path in new)
    assert (folder / "mine.kernel").exists()


def test_a_class_that_cannot_be_named_is_found_by_its_text(tmp_path, monkeypatch):
    """In another run two classes of the same name could be confused."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))

    class Local(NamedTuple):
        pass

    answer.on(Local)(lambda tag: 43)
    assert fresh()(Local()) == 43
    assert [path.suffix for path in (tmp_path / "kernels").iterdir()] == [".code"]


def test_a_function_that_a_kernel_is_given_is_not_described():
    """Its id differs from run to run, so kernels would be saved but never found again."""
    with pytest.raises(cache.Unknown):
        cache.describe(FunctionType(answer))


def test_all_that_the_program_registers_has_words():
    """If one of them had no description, no kernel would be found by its sources."""
    for made in session.registered:
        if not choices.modules_of(made):
            assert cache._words(made) == cache._words(made)
    assert len(session.registered) > 50


def test_what_threads_do_is_followed():
    """Loops over threads are compiled separately from the function that contains them."""

    def put(tag, out, i):
        out[i] = answer(tag)

    put_all = shared_out(put)
    out = np.zeros(3)
    made = kernel(lambda mode, tag, out: put_all(mode, out.size, tag, out))
    made(Threaded(), Tag(), out)
    assert out.tolist() == [42, 42, 42]
    (unit,) = made.units.values()
    assert __name__ in unit.modules


class Cells(NamedTuple):
    spans: np.ndarray
    a: np.ndarray


def _add_1(s, n):
    s.a[n] += 1.0


def _add_2(s, n):
    s.a[n] += 2.0


def _add_3(s, n):
    s.a[n] += 3.0


def _add_4(s, n):
    s.a[n] += 4.0


def _add_5(s, n):
    s.a[n] += 5.0


def test_loops_that_one_function_makes_are_kept_side_by_side(tmp_path, monkeypatch):
    """Loops over nodes share one name; with five of them each used to be recompiled."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    cells = Cells(np.array([[1, 0], [0, 4]], np.int64), np.zeros(4))
    functions = (_add_1, _add_2, _add_3, _add_4, _add_5)
    for expected in (5, 0):
        with listening() as names:
            for function in functions:
                each_node(function).loop(cells, Serial())
        assert len(names) == expected
    assert cells.a.tolist() == [30.0] * 4


class Changing(NamedTuple):
    """A tag whose implementation is redefined, as in a notebook."""


@kernel
def _answered(tag, a):
    a[0] = answer(tag)


def test_a_new_implementation_reaches_compiled_kernels():
    a = np.zeros(1)
    for number in (1.0, 2.0):

        @answer.on(Changing)
        def _(tag, number=number):
            return number

        _answered(Changing(), a)
        assert a[0] == number == answer(Changing())


# --- the wait -----------------------------------------------------------------------------------


def test_the_wait_is_told_once_before_the_banner(tmp_path, monkeypatch):
    """The message says what it is and that it happens once; it is absent if nothing is compiled."""
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path))
    out = io.StringIO()
    hub = Hub(Console(out))
    hub.domain, hub.update = SimpleNamespace(dimension=2), SimpleNamespace(words="ulmpm", time=0.0)
    wait = Timings(hub).telling_of_compilation
    with wait():
        assert out.getvalue() == ""
        one, other = fresh(), fresh()
        one(Tag())
        other(Tag())
    line = "Compiling the loops of this kind of scene, once (the next run starts at once) ...\n"
    assert out.getvalue() == line
    with wait():
        one(Tag())
        assert out.getvalue() == line
        kernel(lambda tag: answer(tag))(Tag())
    assert out.getvalue() == 2 * line


def test_a_folder_that_cannot_be_used_is_warned_of_in_a_run(tmp_path, monkeypatch):
    monkeypatch.setenv("KARAMELO_PY_CACHE", str(tmp_path / "file"))
    (tmp_path / "file").write_text("")
    err = io.StringIO()
    hub = Hub(Console(io.StringIO(), err))
    hub.domain, hub.update = SimpleNamespace(dimension=2), SimpleNamespace(words="ulmpm", time=0.0)
    with Timings(hub).telling_of_compilation():
        assert fresh()(Tag()) == 42
        assert fresh()(Tag()) == 42
    assert err.getvalue().count("warning") == 1
    assert str(tmp_path / "file" / "kernels") in err.getvalue()
    assert "KARAMELO_PY_CACHE names another folder" in err.getvalue()
