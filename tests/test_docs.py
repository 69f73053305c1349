"""README, documentation and docstrings: what they show is right."""

import inspect
import json
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from functools import cache
from graphlib import TopologicalSorter
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest

from karamelo_py.app import catalogue, cli
from karamelo_py.language import registry
from karamelo_py.language.interpreter import Interpreter
from karamelo_py.points.kinematics.twist import Twisted
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.plugins import check_fix
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.functions import FUNCTIONS
from karamelo_py.script.parser import parse

ROOT = Path(__file__).parent.parent
ROOMS = [ROOT / "docs" / "house.md", *sorted((ROOT / "docs" / "house").glob("*.md"))]
FOLDERS = "howto", "studies", "plugins"
SITE = [page for folder in FOLDERS for page in (ROOT / "docs" / folder).glob("*.md")]
SITE += [ROOT / "docs" / "messages" / "index.md", ROOT / "docs" / "tutorials" / "index.md"]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *ROOMS[1:], *sorted(SITE)]
STYLES = [(f, n) for f in catalogue.families() for n in registry.names(f)]
# Scenes on which the examples of docstrings are tried: domain, the region "disk", a wall.
STAGES = {
    1: ("1, 0, 100, 1", "block, 1, 9", "block, 0, 5"),
    2: ("2, -1, 1, -1, 1, 0.1", "cylinder, 0, 0, 0.3", "block, -1, 0, -1, 1"),
    3: ("3, -1, 1, -1, 1, -1, 1, 0.1", "sphere, 0, 0, 0, 0.3", "block, -1, 0, -1, 1, -1, 1"),
}


def blocks(path, language):
    return re.findall(rf"^```{language}\n(.*?)^```", path.read_text("utf-8"), re.S | re.M)


def test_the_program_of_the_checks_runs_what_readme_says():
    """Its first two commands, word for word, before anything else is installed."""
    script = (ROOT / ".ci" / "run").read_text("utf-8")
    told = subprocess.run(
        ["bash", str(ROOT / ".ci" / "run"), "commands"], capture_output=True, text=True, check=True
    )
    commands = blocks(ROOT / "README.md", "sh")
    assert told.stdout == "".join(commands[:2])
    assert "pip install . " in commands[0] and commands[1].endswith("&& pytest\n")
    stages = re.findall(r"^(?:if )?stage ([^;|\n]*[^;|\s])", script, re.M)
    assert stages[:2] == ['typed "$install"', 'typed "$tests"']
    assert not re.search(r"pip install", script[: script.index(stages[1])])


SNIPPETS = [(page, block) for page in PAGES for block in blocks(page, "karamelo")]


@pytest.mark.parametrize(
    ("page", "snippet"), SNIPPETS, ids=[f"{p.name}-{k}" for k, (p, _) in enumerate(SNIPPETS)]
)
def test_snippets_of_pages_parse_and_name_what_exists(page, snippet):
    for statement in parse(snippet, page.name):
        name = getattr(statement, "name", None)
        if name and hasattr(statement, "arguments"):
            assert registry.knows("command", name), name
            family = {"fix": "fix", "compute": "compute", "region": "region", "dump": "dump"}
            words = [argument.code.strip() for argument in statement.arguments]
            if name in family:
                style = words[2 if name == "dump" else 1]
                assert registry.knows(name, style), style


def test_the_house_has_all_rooms():
    page = ROOMS[0].read_text("utf-8")
    for room in (ROOT / "karamelo_py").iterdir():
        if room.is_dir() and len(list(room.glob("*.py"))) > 1:
            assert f"`{room.name}/`" in page
            assert (ROOT / "docs" / "house" / f"{room.name}.md") in ROOMS
        elif room.suffix == ".py" and room.stem != "__init__":
            assert f"`{room.name}`" in page


@cache
def words_of_code():
    files = [*ROOT.glob("karamelo_py/**/*.py"), *ROOT.glob("tests/*.py")]
    found = {word for file in files for word in re.findall(r"\w+", file.read_text("utf-8"))}
    return found | set(registry.families())


@pytest.mark.parametrize("page", ROOMS, ids=lambda page: page.stem)
def test_pages_of_the_house_name_what_exists(page):
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.S | re.M)
    package = ROOT / "karamelo_py"
    for named in re.findall(r"`([\w/]+\.(?:py|toml|lark)|[\w/]+/)`", text):
        assert list(package.rglob(named.rstrip("/"))) or (ROOT / named).exists(), named
    words = words_of_code()
    for name in re.findall(r"`@?([A-Za-z_][\w.]*)(?:\(\))?`", text):
        assert name.endswith((".py", ".toml", ".lark", ".md")) or set(name.split(".")) <= words, (
            name
        )


def arrows(depth):
    """Folders of the package, `depth` levels deep, and which of them import from which others."""
    package = ROOT / "karamelo_py"
    found = set()
    for path in package.rglob("*/*.py"):
        here = path.relative_to(package).parts[:-1][:depth]
        for name in re.findall(r"^ *from karamelo_py\.([\w.]+)", path.read_text("utf-8"), re.M):
            there = name.split(".")
            while there and not package.joinpath(*there).is_dir():
                there.pop()
            if there and tuple(there[:depth]) != here:
                found.add((here, tuple(there[:depth])))
    return {end for arrow in found for end in arrow}, found


def test_the_house_counts_its_arrows_and_lines():
    page = ROOMS[0].read_text("utf-8")
    numbers = (ROOT / "docs" / "house-numbers.md").read_text("utf-8")
    now = dict(re.findall(r"^\| ([^|]*) \| \d+ \| (\d+) \|$", numbers, re.M))
    order = re.findall(r"^\| `(\w+)/` \|", page, re.M)
    folders, found = arrows(1)
    assert int(now["folders"]) == len(order) == len(folders)
    # One import more or less is no other picture.
    assert int(now["arrows between them"]) == pytest.approx(len(found), abs=3)
    assert [(a, b) for (a,), (b,) in found if order.index(a) > order.index(b)] == []
    folders, found = arrows(2)
    assert int(now["folders one level deeper"]) == len(folders)
    assert int(now["arrows between those"]) == pytest.approx(len(found), abs=6)
    count = sum(len(p.read_text("utf-8").splitlines()) for p in ROOT.glob("karamelo_py/**/*.py"))
    assert int(now["lines of Python"]) == pytest.approx(count, rel=0.03)
    # What a part costs.
    for name, lines in re.findall(r"^\| [^|]* \| 1 \| `([\w/]+\.py)` \| (\d+) \|$", page, re.M):
        path = ROOT / name if name.startswith("tests") else ROOT / "karamelo_py" / name
        assert int(lines) == pytest.approx(len(path.read_text("utf-8").splitlines()), abs=3), name


def test_no_imports_in_a_circle():
    """Those inside of functions, too."""
    modules = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for path in (ROOT / "karamelo_py").rglob("*.py")
    }
    taken = {}
    for module, path in modules.items():
        found = re.findall(
            r"^ *from (karamelo_py[\w.]*) import (\([^)]*\)|.*)", path.read_text("utf-8"), re.M
        )
        pairs = [(package, name) for package, names in found for name in re.findall(r"\w+", names)]
        # What is imported is a module, or stands in one.
        named = [f"{p}.{name}" if f"{p}.{name}" in modules else p for p, name in pairs]
        taken[module] = {name for name in named if name != module}
    TopologicalSorter(taken).prepare()  # raises CycleError, which names the circle


def test_getting_started_tells_the_whole_script():
    """Its tour, put together, is inputs/in.two_disks without its comments."""
    page = ROOT / "docs" / "getting-started.md"
    part = page.read_text("utf-8").partition("## The script, line by line")[2]
    tour = "".join(re.findall(r"^```karamelo\n(.*?)^```", part.partition("\n## ")[0], re.S | re.M))
    script = (ROOT / "inputs" / "in.two_disks").read_text("utf-8")

    def statements(text):
        lines = (re.sub(r"\s+", " ", line.partition("#")[0]).strip() for line in text.splitlines())
        return [line for line in lines if line]

    assert statements(tour) == statements(script)


def command_lines(page):
    """The command lines of karamelo-py that a page shows, alone and in its text."""
    text = page.read_text("utf-8")
    fences = re.findall(r"^```(?:sh|bash|console)\n(.*?)^```", text, re.S | re.M)
    alone = re.findall(r"^(?:[^#\n]* )?karamelo-py +(.+)$", "".join(fences), re.M)
    found = alone + re.findall(r"`karamelo-py ([^`]+)`", text)
    return [line.replace("$SLURM_NTASKS", "4") for line in found]


NAMES = {"check", "bench", "styles", "help", "-i SCRIPT", "help drag", "in.script", "script.mpm"}
LATER = ("in.file", "SCRIPT", "in.script", "in.loss", "in.bars", "in.ball")  # scripts of the reader
ENTRIES = [
    entry["name"] for entry in tomllib.loads((ROOT / "docs/atlas.toml").read_text("utf-8"))["entry"]
]


def test_pages_show_command_lines():
    """The next test finds them: 65, on most pages."""
    found = [len(command_lines(page)) for page in PAGES]
    assert sum(found) > 50 and sum(map(bool, found)) > 12


@pytest.mark.parametrize("page", [p for p in PAGES if p.name != "atlas.md"], ids=lambda p: p.name)
def test_command_lines_of_pages_are_understood(page):
    """Options and values; scripts and their variables are there, and tables are made above."""
    made = ["runs.csv"]  # the text says how
    for line in command_lines(page):
        words = shlex.split(line, comments=True)
        if line in NAMES or words[-1] in ("-h", "--version"):
            continue  # no lines, or read and done
        words = words if words[0] in cli.COMMANDS else ["run", *words]
        options, surplus = cli._parser(words[0])[0].parse_known_args(words)
        assert not surplus, line
        script = getattr(options, "script", None)
        if script is not None and str(script) not in LATER:
            text = (ROOT / script).read_text("utf-8")
            for given in options.var:
                name = given.partition("=")[0] if isinstance(given, str) else given[0]
                assert re.search(rf"^{name} *=", text, re.M), line
        if words[0] == "chart":
            assert set(map(str, options.tables)) <= set(made), line
        if words[0] == "atlas":
            assert (ROOT / options.atlas).exists(), line
            for name in (options.only or "").split(","):
                assert any(entry.startswith(name) for entry in ENTRIES), line
        made.append(str(getattr(options, "o", "")))


def test_scenes_are_refined_by_variables_that_they_have():
    """The last column of the table of scenes."""
    page = (ROOT / "docs" / "verification.md").read_text("utf-8")
    rows = re.findall(r"^\|[^|]*\| `in\.(\w+)`.*\| `(-var [^|]*)` \|$", page, re.M)
    assert len(rows) > 5
    for name, words in rows:
        text = (ROOT / "inputs" / f"in.{name}").read_text("utf-8")
        for variable in re.findall(r"-var (\w+)", words):
            assert re.search(rf"^{variable} *=", text, re.M), (name, variable)


def test_every_function_is_in_the_language_page():
    page = (ROOT / "docs" / "script.md").read_text("utf-8")
    table = page[page.index("## Functions") : page.index("## Commands")]
    named = set(re.findall(r"\b[a-z]\w+\b", table))
    assert set(FUNCTIONS) <= named


def test_links_of_pages_lead_somewhere():
    """In the source tree, too, where the pages of styles and scenes are not built."""
    columns = ROOT / "docs" / "reference" / "columns.md"
    for page in [*PAGES, columns]:
        links = re.findall(r"\]\(([^)#:]+?)(?:#([^)]*))?\)", page.read_text("utf-8"))
        for target, part in links:
            assert (page.parent / target).exists(), (page, target)
            if (page.parent / target).resolve() == columns.with_name("index.md") and part:
                family, _, name = part.partition("-")
                names = {name.replace("/", "-") for name in registry.names(family)}
                assert name in names, (page, part)


sys.path.insert(0, str(ROOT / "docs" / "_ext"))
import choose  # noqa: E402  (only now is it found)

sys.path.pop(0)
CHOICES = choose.choices(ROOT / "docs" / "choose.md")


def chosen(rows, given):
    """The number of the first row that has the answers."""
    fits = (
        all(
            word in cell or cell == ["any"]
            for word, cell in zip(given, row["answers"], strict=True)
        )
        for row in rows
    )
    return list(fits).index(True)


def test_every_answer_to_the_questions_leads_to_a_method():
    """One row has each set of answers first, and no row is out of reach."""
    answers = [[word for word, _ in one["answers"]] for one in CHOICES["questions"]]
    assert [len(one) for one in answers] == [4, 2, 4]
    taken = {chosen(CHOICES["rows"], given) for given in product(*answers)}
    assert taken == set(range(len(CHOICES["rows"])))
    page = (ROOT / "docs" / "choose.md").read_text("utf-8").partition("## Why")[0]
    assert page.count("| `method(") == len(CHOICES["rows"])


@pytest.mark.parametrize(
    ("lines", "d"),
    [(row["lines"], d) for row in CHOICES["rows"] for d in (2, 3)[: 1 + ("R8" in str(row))]],
    ids=str,
)
def test_lines_of_the_form_run(run_interpreted, lines, d):
    """Two solids with the method, with fixes behind them, and a step."""
    lines = [line.replace("R4", "R8") if d == 3 else line for line in lines]
    fixes = [line for line in lines if line.startswith("fix")]
    script = [line for line in lines if line not in fixes]
    ends = ", ".join((d - 1) * ["0.2, 0.6"])
    script += [f"dimension({d}, {', '.join(d * ['0, 1'])}, 0.2)"]
    script += ["material(rubber, neo-hookean, 1000, 1e5, 0.3)"]
    for name, lo, hi in (("left", 0.2, 0.4), ("right", 0.6, 0.8)):
        script.append(f"region({name}, block, {lo}, {hi}, {ends})")
        script.append(f"solid({name}, region, {name}, {2 if d == 2 else 1}, rubber, 0.2)")
    run_interpreted("\n".join([*script, *fixes, "run(1)"]))


def test_the_form_has_the_table_of_the_page(tmp_path):
    choose.write_choices(ROOT / "docs" / "choose.md", tmp_path / "generated" / "choose.js")
    text = (tmp_path / "generated" / "choose.js").read_text("utf-8")
    found = json.loads(text.removeprefix("const CHOICES = ").removesuffix(";\n"))
    assert found == json.loads(json.dumps(CHOICES))


def test_the_form_writes_the_lines_of_the_table_in_a_browser(tmp_path, browser):
    """All answers in Chromium, clicked one after another."""
    docs = ROOT / "docs"
    choose.write_choices(docs / "choose.md", tmp_path / "choose.js")
    form = re.search(
        r"^```{raw} html\n(.*?)^<script", (docs / "choose.md").read_text("utf-8"), re.S | re.M
    )
    answers = [[word for word, _ in one["answers"]] for one in CHOICES["questions"]]
    given = [*product(*answers)]
    script = """(given) => {
      lines.id = "codecell0";  // as the button that copies calls it
      return given.map((words) => {
        words.forEach((word, k) => form.elements[`question-${k}`].forEach((one) => {
          if (one.value === word) one.click();
        }));
        return lines.textContent.trim();
      });
    }"""
    scripts = (tmp_path / "choose.js", docs / "_static" / "choose.js")
    parts = [f"<script>{path.read_text('utf-8')}</script>" for path in scripts]
    page = browser.new_page()
    page.set_content("\n".join([form[1], *parts]))
    found = page.evaluate(script, given)
    rows = CHOICES["rows"]
    assert found == ["\n".join(rows[chosen(rows, one)]["lines"]) for one in given]


@pytest.mark.parametrize(("family", "name"), STYLES, ids=[f"{f}-{n}" for f, n in STYLES])
def test_every_style_is_documented(family, name):
    help_ = catalogue.help_of(family, name)
    assert help_.summary.endswith("."), help_.summary
    assert help_.example, "an example"
    assert "(" in help_.syntax
    for parameter in help_.parameters:
        known = parameter.description or "a group of " in parameter.kind.text
        assert known, f"{parameter.name} is not described"
    assert parse(help_.example, f"the example of {name}")
    for title in help_.sections:
        assert title in ("Example", "Notes", "See Also", "Raises"), title


def _scene(dimension, folder, method="ulmpm"):
    """A scene in `dimension` dimensions that is only tried: it runs and writes nothing."""
    hub = Hub()
    hub.console.quiet = True
    hub.folder = folder
    hub.rehearsing = True
    interpreter = Interpreter(hub)
    domain, disk, wall = STAGES[dimension]
    interpreter.run_text(
        f"method({method}, FLIP, linear, 1, thermo-mechanical)\n"
        f"dimension({domain})\nregion(disk, {disk})\n"
        f"region(wall, {wall})\nmaterial(steel, linear, 1000, 1000, 0.3, 1, 1)\n"
        f"solid(s1, region, disk, 2, steel, {domain.split()[-1]}, 0)"
    )
    return interpreter


def _write_meshes(folder):
    """The files that examples speak of: meshes (part.msh with the group "inside"), curves."""
    (folder / "measured.csv").write_text("time, velocity\n0, 0\n1, 2\n", encoding="utf-8")
    rows = "0.1, 0.1, 0.1, 1e-3\n0.2, 0.2, 0.2, 1e-3\n"
    (folder / "grains.csv").write_text("x, y, z, volume\n" + rows, encoding="utf-8")
    (folder / "packing.xyz").write_text("1\n\nX 0.5 0.5 0.5\n", encoding="utf-8")
    head = "ncols 2\nnrows 1\nxllcorner -99\nyllcorner -99\ncellsize 200\n0.2 0.3\n"
    (folder / "dem.asc").write_text(head, encoding="utf-8")
    (folder / "exact.csv").write_text("x, s11\n0, 0\n1, 2\n", encoding="utf-8")
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) / 2
    part = meshio.Mesh(
        square,
        {"quad": [[0, 1, 2, 3]]},
        cell_data={"gmsh:physical": [np.array([1])], "gmsh:geometrical": [np.array([1])]},
        field_data={"inside": np.array([1, 2])},
    )
    meshio.write(folder / "part.msh", part, file_format="gmsh22", binary=False)
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]) / 2
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    meshio.write(folder / "body.stl", meshio.Mesh(corners, {"triangle": faces}))


def _tried(lines, dimension, folder):
    """The last of these lines, on a scene that has the groups and regions they speak of."""
    _write_meshes(folder)
    interpreter = _scene(dimension, folder)
    for line in lines:
        words = re.findall(r"\w+", line)
        if words[2] == "joint" or words[2:4] == ["contact", "bodies"]:
            interpreter.run_text("material(lead, rigid, 1)")
            h = STAGES[dimension][0].split()[-1]
            for solid in {"floor", "box", "ball", "arm", "forearm"} & {*words[3:]}:
                interpreter.run_text(f"solid({solid}, region, disk, 2, lead, {h}, 0)")
            interpreter.run_text(line)
            continue
        if words[2] == "contact" and words[4] != "plane":
            method = "tlmpm" if words[3] == "solids" else "ulmpm/contacts"
            interpreter = _scene(dimension, folder, method)
            h = STAGES[dimension][0].split()[-1]
            for solid in words[4:6]:
                interpreter.run_text(f"solid({solid}, region, disk, 2, steel, {h}, 0)")
            interpreter.run_text(line)
            continue
        if words[2] == "rigid_body":
            h = STAGES[dimension][0].split()[-1]
            interpreter.run_text("material(lead, rigid, 1)")
            interpreter.run_text(f"solid({words[3]}, region, disk, 2, lead, {h}, 0)")
        if words[3:4] == ["surface"]:
            interpreter.run_text(
                "region(hull, stl, body.stl)\nfix(hull, contact/surface, all, hull)"
            )
        if words[2] == "angular_velocity_nodes":
            interpreter.hub.domain.kin = Twisted()
        if "pore_pressure" in words[2] or words[2] in ("seepage_face", "flux"):
            wet = "pore_water(wet, n=0.4, permeability=1)\nsolid(wet, region, disk, 2, wet, h, 0)"
            wet = wet.replace("h,", f"{STAGES[dimension][0].split()[-1]},")
            interpreter.run_text(f"material(wet, linear, 1000, 1000, 0.3)\n{wet}")
        kind = (
            "nodes"
            if words[2]
            in (
                "absorbing",
                "body_force",
                "flux",
                "ground_motion",
                "pore_pressure",
                "seepage_face",
            )
            or "_nodes" in line
            else "particles"
        )
        named = words[0] in ("fix", "compute") and words[2] != "inflow"
        if named and words[3] not in ("all", "v_x"):
            place = "wall"
            if words[2] in ("absorbing", "ground_motion"):
                place, x = "edge", {1: 9}.get(dimension, 0.3)
                more = ", INF, INF" * (dimension - 1)
                interpreter.run_text(f"region(edge, block, {x}, {x}{more})")
            interpreter.run_text(f"group({words[3]}, {kind}, region, {place}, all)")
        if words[2] in ("union", "intersection", "difference"):
            for region in set(words[3:]) - {"disk", "wall"}:
                interpreter.run_text(f"region({region}, {STAGES[dimension][2]})")
        for ID in ("region(disk", "solid(s1"):
            line = line.replace(f"{ID},", f"{ID}x,")
        interpreter.run_text(line)
    for fix in interpreter.hub.fixes.values():
        check_fix(interpreter.hub, fix)


SCENE_FAMILIES = (
    "fix", "compute", "region", "solid", "eos", "strength", "damage", "temperature", "material",
    "dump",
)  # fmt: skip
TRIED = [(f, n) for f, n in STYLES if f in SCENE_FAMILIES]


@pytest.mark.parametrize(("family", "name"), TRIED, ids=[f"{f}-{n}" for f, n in TRIED])
def test_examples_of_styles_fit_their_signatures(family, name, tmp_path, monkeypatch):
    """Each line of an example is right in at least one number of dimensions."""
    # Modules that lie beside the script, as the examples say.
    monkeypatch.setitem(sys.modules, "springs", SimpleNamespace(pull=lambda points: None))
    monkeypatch.setitem(sys.modules, "walls", SimpleNamespace(hold=lambda nodes: None))
    lines = catalogue.help_of(family, name).example.splitlines()
    for k, line in enumerate(lines):
        complaints = []
        for dimension in STAGES:
            try:
                # Some lines speak of what is defined above them.
                starts = line.startswith(("log", "material", "eos"))
                speaks = starts or any(word in line for word in ("c_y", "v_x", "force_on"))
                above = lines[:k] if speaks else []
                _tried([*above, line], dimension, tmp_path)
                break
            except ScriptError as error:
                complaints.append(f"{dimension}D: {error.render()}")
        else:
            pytest.fail("\n\n".join(complaints))


def test_modules_say_what_they_are_for():
    for path in sorted((ROOT / "karamelo_py").rglob("*.py")):
        text = path.read_text("utf-8")
        if text.strip():
            assert text.lstrip().startswith(('"""', 'r"""')), path


def test_the_reference_is_written_for_every_style(tmp_path):
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        import reference_pages
    finally:
        sys.path.pop(0)
    reference_pages.write_pages(tmp_path / "generated")
    for family, name in STYLES:
        if registry.origin(family, name).startswith("karamelo-py "):
            page = tmp_path / "generated" / family / (name.replace("/", "-") + ".md")
            assert "## Example" in page.read_text("utf-8")
    assert inspect.getdoc(reference_pages)


def test_code_that_pages_include_exists():
    """Functions, and the lines from which on a file is shown."""
    for page in PAGES:
        for file, options in INCLUDED.findall(page.read_text("utf-8")):
            text = (page.parent / file).read_text("utf-8")
            for kind, wanted in re.findall(r"^:(pyobject|start-at): \"?(.+?)\"?$", options, re.M):
                name = wanted.rpartition(".")[2]
                at = rf"^ *(?:def|class) {name}\b" if kind == "pyobject" else re.escape(wanted)
                assert re.search(at, text, re.M), (page, wanted)


INCLUDED = re.compile(r"^```{literalinclude} (\S+)\n(.*?)^```", re.S | re.M)
# Questions of users, and the page that the search of the site shows first.
QUESTIONS = {
    "moving wall": "howto/moving-wall",
    "stress at a probe": "howto/probe",
    "periodic boundaries": "howto/boundary",
    "restart": "howto/restart",
    "import mesh": "howto/mesh",
    "write a fix": "howto/plugin",
    "units": "units",
    "why did my run stop": "messages/index",
    "friction between two bodies": "howto/contact",
    "what time step": "howto/time-step",
    "Karamelo script fails": "howto/from-karamelo",
    "cite": "versions",
    "pore pressure": "reference/generated/fix/pore_pressure",
    "retaining wall force": "howto/retaining-wall",
    "free rigid body": "howto/free-body",
    "JWL": "reference/generated/eos/jwl",
    "Mooney-Rivlin": "reference/generated/material/mooney-rivlin",
    "terrain raster": "howto/landslide",
    "strength reduction": "howto/safety-factor",
    "LS-DYNA": "howto/mesh",
    "it blew up": "howto/blew-up",
    "how many cells": "choose",
    "compare with an experiment": "howto/experiment",
    "pandas": "howto/paraview",
    "symmetry plane": "howto/boundary",
    "prescribed displacement": "howto/boundary",
    "mass scaling": "howto/time-step",
    "hourglass": "failures",
    "python interface": "tutorials/python",
    "spall": "materials",
    "anisotropic": "materials",
    "my run is slow": "run-faster",
}


@pytest.mark.full  # .ci/run builds it, too
def test_the_site_builds_without_warnings(tmp_path):
    for module in ("sphinx", "myst_nb", "ipykernel"):
        pytest.importorskip(module)
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    # The theme of the site takes three times as long, and warns of nothing else.
    command += ["-D", "html_theme=basic", "-D", "html_use_index=0", "-D", "html_copy_source=0"]
    command += ["-D", "nb_execution_mode=off"]  # test_tutorials_run does
    command += ["-d", str(tmp_path / "doctrees"), str(ROOT / "docs"), str(tmp_path / "html")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    if node := shutil.which("node"):
        search = [node, str(ROOT / "tests" / "data" / "search.js"), str(tmp_path / "html")]
        found = subprocess.run([*search, *QUESTIONS], capture_output=True, text=True, check=True)
        first = dict(zip(QUESTIONS, found.stdout.splitlines(), strict=True))
        assert {q: page for q, page in first.items() if page != QUESTIONS[q]} == {}


TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.ipynb"))


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
@pytest.mark.full  # each build of the site runs them, too
def test_tutorials_run(path, tmp_path, monkeypatch):
    """Cell after cell; the figures that a reader is promised are written."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    notebook = json.loads(path.read_text("utf-8"))
    cells = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    assert len(TUTORIALS) == 5 and len(cells) > 5
    namespace: dict = {}
    for cell in cells:
        exec(cell, namespace)
    assert (path.stem != "python") == bool(list(tmp_path.glob("*.pdf")))


def test_the_gallery_shows_every_scene(tmp_path):
    """A page for each script of inputs/, with what its head says; cards have a picture."""
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        from gallery import chart_of, head_of, write_gallery
    finally:
        sys.path.pop(0)
    docs = ROOT / "docs"
    scenes = {path.name.removeprefix("in."): path for path in (ROOT / "inputs").glob("in.*")}
    for path in scenes.values():
        title, _ = head_of(path.read_text("utf-8"))
        assert title, f"{path.name} says nothing of itself in its first lines"
    assert chart_of("two_disks_2020", docs / "_static") == chart_of("two_disks", docs / "_static")
    assert chart_of("nothing_like_it", docs / "_static") is None
    write_gallery(docs, tmp_path / "generated")
    pages = {path.stem for path in (tmp_path / "generated").glob("*.md")}
    assert pages == {*scenes, "index"}
    shown = tomllib.loads((docs / "films.toml").read_text("utf-8"))
    told = json.loads((docs / "films.json").read_text("utf-8"))
    assert set(shown) == set(told) <= set(scenes) and len(shown) > 12
    for name, how in shown.items():
        assert (docs / "_static" / "gallery" / f"{name}.png").exists(), name
        assert how["tags"] and told[name]["points"] > 0
        text = scenes[name].read_text("utf-8")
        for variable in how.get("var", {}):
            assert re.search(rf"^{variable} *=", text, re.M), (name, variable)


def test_warnings_of_the_page_have_the_names_that_are_printed():
    page = (ROOT / "docs" / "methods.md").read_text("utf-8")
    table = page.partition("## Combinations that trigger")[2].partition("\n\nThe program")[0]
    names = re.findall(r"^\| \[?`([^`]+)`", table, re.M)
    assert len(names) > 20
    code = "".join(path.read_text("utf-8") for path in (ROOT / "karamelo_py").rglob("*.py"))
    assert [name for name in names if f'"{name}"' not in code] == []


def test_equations_link_to_functions_that_exist():
    """Each by its file and its name; every scheme and the stable step have theirs."""
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        from source_links import named_in
    finally:
        sys.path.pop(0)
    named = named_in((ROOT / "docs" / "formulas.md").read_text("utf-8"))
    assert len(named) > 25
    for file, name in named:
        text = (ROOT / "karamelo_py" / file).read_text("utf-8")
        assert re.search(rf"^(def|class) {name}\b", text, re.M), (file, name)


@pytest.mark.parametrize(
    ("asked", "page"),
    [
        ("resume", "reference/generated/command/restart"),
        ("Jupyter", "tutorials/python"),
        ("VTK export", "reference/generated/dump/vtk"),
        ("ParaView", "reference/generated/dump/vtk"),
        ("boundary condition", "reference/generated/fix/velocity_nodes"),
        ("time step too large", "reference/generated/command/dt_factor"),
        ("gravity", "reference/generated/fix/body_force"),
        ("units", "reference/generated/command/units"),
        ("landslide", "choose"),
    ],
)
def test_words_of_other_programs_lead_to_a_page(asked, page):
    sys.path.insert(0, str(ROOT / "docs" / "_ext"))
    try:
        from synonyms import WORDS
    finally:
        sys.path.pop(0)
    assert set(asked.lower().split()) <= set(WORDS[page].lower().split())


def _scene_of_the_front_page():
    return re.search(
        r"```karamelo\n(.*?)```", (ROOT / "docs" / "index.md").read_text("utf-8"), re.S
    )[1]


def test_the_scene_of_the_front_page_is_sound(run_interpreted):
    """The check of it warns of nothing."""
    assert "warning" not in run_interpreted(_scene_of_the_front_page(), command="check").err


@pytest.mark.full
def test_the_scene_of_the_front_page(run_script):
    """The ball bounces in its box and is whole: no warning, and no energy from nowhere."""
    result = run_script(_scene_of_the_front_page())
    assert "warning" not in result.err and (result.folder / "ball.gif").exists()
    assert -1 < float(re.search(r"^ +energy +(\S+) %", result.out, re.M)[1]) < 0


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_claims_of_the_front_page(page):
    """Its numbers are those of the pages that it links to."""
    front = (ROOT / page).read_text("utf-8")
    speed = (ROOT / "docs" / "accuracy.md").read_text("utf-8")
    (own,) = re.findall(r"^\| `disks-320` \(.*?\| 102936 \| [\d.]+ \| ([\d.]+) \|", speed, re.M)
    assert re.search(r"(\d+) million point-steps", front)[1] == f"{float(own):.0f}"
    table = (ROOT / "docs" / "validation.md").read_text("utf-8")
    claims = re.findall(
        r"^\| [^|]*\(([A-Z]\w+)[^|]*\d{4}[^|]*\| ([^|]+) \| ([+-][\d.]+ %) \|$", front, re.M
    )
    assert len(claims) == 5
    for author, _, difference in claims:
        assert re.search(rf"\| {re.escape(difference)} \| [^|]*{author}", table), author


def test_validation_has_the_numbers_of_the_comparison():
    comparison = (ROOT / "docs" / "comparison.md").read_text("utf-8")
    rows = re.findall(r"^\| \[[^]]*\]\(comparison.md#in-([\w-]+)\) (\|.*)$",
                      (ROOT / "docs" / "validation.md").read_text("utf-8"), re.M)  # fmt: skip
    assert len(rows) > 20
    for scene, row in rows:
        part = comparison.partition(f"## `in.{scene.replace('-', '_')}`")[2].partition("\n## ")[0]
        assert f"\n{row}\n" in part, (scene, row)
    front = (ROOT / "README.md").read_text("utf-8")
    assert int(re.search(r"of the (\d+) scenes", front)[1]) == comparison.count("\n## `in.")
