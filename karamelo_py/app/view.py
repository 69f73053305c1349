"""karamelo-py view: draw pictures or a movie from dumps."""

import argparse
import glob
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import chain, islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from karamelo_py.app.catalogue import help_of
from karamelo_py.app.options import LIVE, above_zero, add_variables
from karamelo_py.app.plot import read_rows
from karamelo_py.language import signature
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.language.signature import Argument, Parameter
from karamelo_py.output.console import Console
from karamelo_py.output.fields import ColumnFormula, unknown_column
from karamelo_py.output.files import Frames, movie_format, picture_format, savefig, unwarned, whole
from karamelo_py.output.point_table import members, named_sets
from karamelo_py.output.quantity import KEYWORDS, Caption
from karamelo_py.output.snapshots import Snapshot, read
from karamelo_py.output.units import labelled
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.script.errors import ScriptError, plural, render_message
from karamelo_py.script.expressions import GLOBAL_SEEDS
from karamelo_py.script.parser import parse
from karamelo_py.script.syntax import Raw, Source
from karamelo_py.styles.dumps.pyplot import LEAST_PIXELS, MOST_PIXELS, look_of, title_of, tools_of

DESCRIPTION = """\
Draw pictures or a movie of dumps of points.
Files are from dump particle, particle/gz, hdf5 and vtk (its .pvd). Pictures and their options are
as in dump pyplot."""
DPI = 100
Look = dict[str, Any]


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path)
    parser.add_argument(
        *LIVE, action="store_true",
        help="show the dumps and the log of the folder FILE on a page in a browser, while "
        "a run writes them",
    )  # fmt: skip
    parser.add_argument(
        "-c", "--column",
        help="column for the colours, or a formula of columns (default: the solid)",
    )  # fmt: skip
    parser.add_argument(
        "--script", metavar="FILE",
        help="the script of the run, which defines walls and tools (--outlines), groups and "
        "solids (--only \"not tool\") and variables; dumps do not contain them",
    )  # fmt: skip
    add_variables(parser, "set a variable of the script, as in the run")
    parser.add_argument(
        "-o", "--output", metavar="FILE", type=Path,
        help="picture.*.png, where * becomes the step, or a movie: .gif, or .mp4 where ffmpeg is "
        "installed (default: view.*.png); .pdf and .svg, too", default=Path("view.*.png"),
    )  # fmt: skip
    parser.add_argument(
        "--size", nargs=2, type=_pixels, default=[600, 500], metavar=("WIDTH", "HEIGHT")
    )
    for word in _look_words():
        description = word.description.replace("%", "%%")
        metavar = "|".join(word.kind.words) or word.name.upper()
        parser.add_argument(f"--{word.name}", metavar=metavar, help=description)
    parser.add_argument("--fps", type=above_zero, default=25.0, help="frames per second of a movie")


def _pixels(text: str) -> int:
    if not text.isdecimal() or not LEAST_PIXELS <= int(text) <= MOST_PIXELS:
        message = f"'{text}' is not a number of pixels from {LEAST_PIXELS} to {MOST_PIXELS}"
        raise argparse.ArgumentTypeError(message)
    return int(text)


def _look_words() -> list[Parameter]:
    return [word for word in help_of("dump", "pyplot").parameters if word.keyword]


def run(options: argparse.Namespace) -> int:
    if options.live:
        return _live(options.files)
    movie = options.output.suffix.lower() in (".gif", ".mp4")
    (movie_format if movie else picture_format)(options.output)
    frames = Frames(options.fps)
    files = sorted(_matching(options.files), key=lambda path: (_number(path), path.name))
    drawn, scene = 0, _scene(options)
    if not movie and "*" not in options.output.name and len(list(islice(_all_in(files), 2))) > 1:
        raise ScriptError(
            f"{options.output} is one picture, and these dumps have several times",
            expected="a name with *, which becomes the step, or a movie (.gif, .mp4)",
            hint=f"-o {options.output.stem}.*{options.output.suffix}",
        )
    with unwarned():
        drawing: Drawing | None = None
        for snapshot in _all_in(files):
            if drawing is None:
                with _telling_of_names(options):
                    drawing = Drawing(options, files, scene, snapshot)
                look, picture = drawing.look, drawing.picture
            snapshot = drawing.chosen(snapshot)
            moment = title_of(snapshot.step, snapshot.time, snapshot.units.get("time", ""))
            snapshot.columns["id"] = np.arange(len(snapshot.columns["x"]))
            title = f"{look['title']}: " if look["title"] else ""
            tools = _tools(scene) if options.script and look["outlines"] else ()
            picture.show(snapshot, picture.side, f"{title}{moment}", tools)
            drawn += 1
            if movie:
                frames.add(lambda file, picture=picture: picture.save_png(file, 1))
                continue
            name = options.output.name.replace("*", str(snapshot.step), 1)
            path = options.output.with_name(name)
            if picture_format(path) != "png":
                savefig(picture.figure, path)
                continue
            with whole(path) as file:
                picture.save_png(file, 1)
    if not drawn:
        raise ScriptError("there is no snapshot in these files")
    if movie:
        frames.save(options.output)
    print(f"{options.output}: {drawn} {'frame' if movie else 'picture'}{'s' * (drawn > 1)}")
    if drawing.look["outlines"] and options.script is None:
        message = "dumps do not contain walls and tools: only solids are outlined"
        hint = "--script FILE, the script of the run, shows its walls and tools, too"
        print(render_message("note", message, hint=hint), file=sys.stderr)
    return 0


@contextmanager
def _telling_of_names(options: argparse.Namespace) -> Iterator[None]:
    """Add hints to errors about names: names missing in dumps come from logs or the script."""
    try:
        yield
    except ScriptError as error:
        if error.code in ("unknown-name", "unknown-column") and error.alike is None:
            error.hint = "a log in the folder of the dumps (log.mpm, log.csv) has its values"
            if options.script is None:
                error.hint += ", and --script FILE the groups, solids and variables of the run"
        raise


def _scene(options: argparse.Namespace) -> Hub:
    if options.script is None and options.var:
        raise ScriptError(
            f"-var {options.var[0][0]} sets a variable of a script, and there is none here",
            expected="--script FILE, the script of the run, with it",
        )
    hub = Hub(Console(quiet=True))
    hub.rehearsing = True
    Interpreter(hub, dict(options.var))
    if options.script is not None:
        hub.interpreter.run_file(options.script)
    return hub


def _log_beside(
    file: Path, first: Snapshot, options: argparse.Namespace, scene: Hub
) -> dict[int, dict[str, float]]:
    formulas = [options.column, options.only, *Caption.PIECE.findall(options.title or "")]
    text = " ".join(filter(None, formulas))
    words = re.findall(r"[^\W\d]\w*\b(?! *\()", text)  # names, except names of calls
    names = {*first.columns, *named_sets(scene), "time", "timestep", "step", "and", "or", "not"}
    if names.issuperset(words) and not (options.script and options.outlines):
        return {}
    rows = []
    for name in ("log.mpm", "log.csv"):
        with suppress(ScriptError):
            rows += [row for row in read_rows(file.parent / name) if "Step" in row]
    for name in filter(str.isidentifier, dict.fromkeys(name for row in rows for name in row)):
        scene.interpreter.variables.pop(name, None)
        if name not in scene.values and name not in KEYWORDS.values():
            scene.values.publish(name)
    return {int(row["Step"]): row for row in rows}


def _tools(scene: Hub) -> list[Any]:
    fixes = [candidate for candidate in dict.fromkeys(scene.in_runs) if isinstance(candidate, Fix)]
    tools = tools_of(fixes)
    for fix, tool in zip((fix for fix in fixes if fix.depth_of), tools, strict=True):
        if np.isnan(tool.depth(scene.domain.lo[None, : scene.domain.dimension])).any():
            raise ScriptError(
                f"the position of fix '{fix.id}' depends on results of the run, which are not in "
                "its script",
                mark=fix.mark,
                expected="walls and tools that move by formulas of time",
                hint="a log with them in the folder of the dumps, or dump pyplot during the run",
            )
    return tools


def _live(folders: list[Path]) -> int:
    from karamelo_py.app.live.folder import FolderPage

    if len(folders) > 1:
        message = f"--live shows one folder, not {len(folders)}"
        raise ScriptError(message, expected="view --live FOLDER")
    page = FolderPage(folders[0])
    print(f"live: {page.server.address} (Ctrl-C ends it)", flush=True)
    with suppress(KeyboardInterrupt):
        page.follow()
    page.server.close()
    return 0


def _matching(names: Iterable[Path]) -> set[Path]:
    files: set[Path] = set()
    for name in names:
        is_pattern = glob.has_magic(str(name)) and not name.exists()
        matches = [Path(file) for file in glob.glob(str(name))] if is_pattern else [name]
        if not matches or name.is_dir():
            hint = f"view '{name}/*.dump', or view --live {name}" if matches else None
            message, expected = f"no file matches {name}", "dumps of an earlier run"
            raise ScriptError(message, expected=expected, hint=hint)
        files.update(matches)
    return files


def _all_in(files: Iterable[Path]) -> Iterator[Snapshot]:
    return chain.from_iterable(map(read, files))


def _number(path: Path) -> int:
    digits = "".join(c if c.isdigit() else " " for c in path.name).split()
    return int(digits[-1]) if digits else -1


def _look(first: Snapshot, options: argparse.Namespace, scene: Hub) -> Look:
    columns = list(first.columns)
    names = SimpleNamespace(
        particle_names=lambda: columns, shown_names=lambda: [*columns, *named_sets(scene)]
    )
    none = SimpleNamespace(variables={})  # columns hide variables
    hub = SimpleNamespace(fields=names, values=scene.values, interpreter=none)
    (field,) = (word for word in help_of("dump", "pyplot").parameters if word.name == "field")
    look = {}
    for word in [field, *_look_words()]:
        look[word.name] = word.default
        option = "column" if word is field else word.name
        if (text := getattr(options, option)) is not None:
            if word.kind.text.startswith("a word"):
                look[word.name] = text
                continue
            (call,) = parse(f"view({text})", f"--{option}")
            if len(call.arguments) != 1:
                message = f"--{option} takes one value, not '{text}'"
                raise ScriptError(message, expected=word.kind.text)
            argument = Argument(Raw(Source(text, f"--{option}"), 0, len(text)), scene.interpreter)
            look[word.name] = signature.convert(hub, word, argument)
    if look["title"] is not None:
        look["title"] = Caption(scene, look["title"], "--title")
    return look


class Drawing:
    def __init__(
        self, options: argparse.Namespace, files: Sequence[Path], scene: Hub, first: Snapshot
    ):
        self.options, self.files, self.scene = options, files, scene
        self.log = _log_beside(files[0], first, options, scene)
        self.look = _look(first, options, scene)
        self.picture = self._picture(first)

    def chosen(self, snapshot: Snapshot) -> Snapshot:
        """Return the points to draw, with the column of the colouring formula."""
        columns, field, only = snapshot.columns, self.look["field"], self.look["only"]
        values, row = self.scene.values, self.log.get(snapshot.step, {})
        for name in values.names():
            values.set(name, row.get(name, np.nan))  # only a run knows this value
        values.set("time", snapshot.time)
        values.set("timestep", snapshot.step)
        formulas = [one.formula for one in (field, only) if isinstance(one, ColumnFormula)]
        used = [one.names for one in (*formulas, *filter(None, [self.look["title"]]))]
        for name in set().union(*used):
            if name not in GLOBAL_SEEDS and name in values and np.isnan(values.get(name)):
                raise ScriptError(
                    f"{name} at step {snapshot.step} is not in dumps",
                    expected="a log in the folder of the dumps, with this column and all steps",
                    hint=f"log_modify(custom, step, time, {name}) in the script of the run",
                )
        numbers = columns["id"].astype(np.int64) - 1

        def column(name: str) -> np.ndarray:
            return columns[name] if name in columns else members(self.scene, name, numbers)

        rows = SimpleNamespace(particle=column)
        if isinstance(field, ColumnFormula):
            columns = columns | {field.text: field.of(rows)}
        elif field in named_sets(self.scene):
            columns = {field: column(field)} | columns
        if only is not None:
            selected = only.holds(rows)
            columns = {name: of[selected] for name, of in columns.items()}
        return snapshot._replace(columns=columns)

    def _picture(self, first: Snapshot) -> Any:
        from karamelo_py.output import outlines, pictures

        look, scene, with_script = self.look, self.scene, self.options.script is not None
        dimension = 3 if first.columns["z"].any() else 2 if first.columns["y"].any() else 1
        if with_script:
            has = [("dimension", scene.domain.dimension, dimension)]
            count = sum(solid.count for solid in scene.solids.values())
            has += [("point", count, max(first.columns["id"], default=0))] if count else []
            for noun, of_script, of_dump in has:
                if of_dump > of_script:
                    raise ScriptError(
                        f"the script has {plural(of_script, noun)}, the dump {of_dump:.0f}",
                        expected="the script of the run that wrote the dump, and its -var",
                    )
            dimension = scene.domain.dimension  # the points of a 3D scene may all have z = 0
        first, field = self.chosen(first), look["field"]
        column = field.text if isinstance(field, ColumnFormula) else field
        if column is not None and column not in first.columns:
            raise unknown_column(f"the dump has no column '{column}'", column, first.columns)
        column = column or ("type" if dimension > 1 else "x")
        types = map(int, np.unique(first.columns["type"]) if column == "type" else ())
        apart = ("field", "only", "title", "dpi")
        words = {name: value for name, value in look.items() if name not in apart}
        words["window"] = tuple((words.pop(f"{x}min"), words.pop(f"{x}max")) for x in "xyz")
        label, length = labelled(column, first.units.get(column, "")), first.units.get("x", "")
        made_look = {"label": label} | look_of(column, dimension, **words)
        made_look["lengths"] = length
        solids = tuple(f"solid {k}" for k in range(1, max(types, default=0) + 1))
        lo, hi, span = _all(self.files, column, look, made_look, self.chosen)
        domain = SimpleNamespace(dimension=dimension, lo=lo, hi=hi)
        if with_script:
            domain = scene.domain
            solids = tuple(scene.solids) if solids else ()
        size = tuple(pixels / DPI for pixels in self.options.size)
        made = pictures.make(
            domain, size, look["dpi"], pictures.Options(column, solids=solids, **made_look)
        )
        made.begin_with(span)
        made.side = outlines.spacing(np.column_stack([first.columns[name] for name in "xyz"]))
        return made


def _all(
    files: Iterable[Path],
    column: str,
    look: Look,
    made_look: Look,
    chosen: Callable[[Snapshot], Snapshot],
) -> tuple[np.ndarray, np.ndarray, Any]:
    from karamelo_py.output.pictures import grown, in_window, within

    corners, ends, count, left = [], [], 0, 0
    file_of: dict[int, Path] = {}
    for path, snapshot in ((file, one) for file in files for one in read(file)):
        if file_of.setdefault(snapshot.step, path) != path:
            raise ScriptError(
                f"{file_of[snapshot.step]} and {path} both have step {snapshot.step}: one picture "
                "would overwrite the other",
                hint="view one dump after the other, with different names: -o FILE.*.png",
            )
        corners.append((snapshot.lo, snapshot.hi))
        columns = in_window(chosen(snapshot).columns, made_look["window"])
        count, left = count + len(snapshot.columns["x"]), left + len(columns["x"])
        values = columns.get(column, np.empty(0))
        if made_look["log"]:
            values = np.log10(values[values > 0])
        values = within(values, made_look["quantile"])
        ends += [values.min(), values.max()] if len(values) else []
    if count and not left:
        ways = ("only", *(x + end for x in "xyz" for end in ("min", "max")))
        used = [f"--{way}" for way in ways if look[way] is not None]
        raise ScriptError(
            f"{', '.join(used)}: no point of these dumps is left",
            hint="leave it out, or choose more points",
        )
    lo, hi = zip(*corners, strict=True)
    return np.min(lo, axis=0), np.max(hi, axis=0), grown(None, np.array(ends)) if ends else None
