"""karamelo-py view and plot, and where the files of a run go: what a person does after a run."""

import io
from itertools import product
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from charts import faults
from fakes import FakeHub
from hubs import SmallHub
from PIL import Image
from scenes import block
from selection import parameters

from karamelo_py import Simulation
from karamelo_py.app import view
from karamelo_py.app.cli import main
from karamelo_py.app.plot import read_rows
from karamelo_py.output import pictures
from karamelo_py.output.files import savefig
from karamelo_py.output.outlines import Tool, outlines
from karamelo_py.output.rhythm import ByTime
from karamelo_py.output.snapshots import Snapshot, read
from karamelo_py.output.units import LENGTHS, suited
from karamelo_py.script.errors import ScriptError
from karamelo_py.styles.dumps.hdf5 import Hdf5
from karamelo_py.styles.dumps.lammps import Particle, ParticleGz
from karamelo_py.styles.dumps.pyplot import PyPlot
from karamelo_py.styles.dumps.vtk import Vtk

FORMS = {"p.dump": Particle, "p.dump.gz": ParticleGz, "p.h5": Hdf5, "p.*.vtu": Vtk}


@pytest.fixture(params=[1, 2, 3])
def hub(request, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return FakeHub(tmp_path, dimension=request.param)


@pytest.fixture
def unlaid(monkeypatch):
    """Pictures whose labels may lie outside or on each other, in half of the time."""
    of = pictures.Figure
    monkeypatch.setattr(pictures, "Figure", lambda layout, **more: of(**more))


def call(capsys, *arguments):
    status = main(list(arguments))
    output = capsys.readouterr()
    assert "Traceback" not in output.err
    return status, output.out, output.err


@pytest.mark.parametrize("name", FORMS)
def test_dumps_are_read_back(hub, name):
    hub.dumps["d"] = FORMS[name](hub, 5, name, "vx", "seq")
    hub.run(10)
    snapshots = list(read(hub.folder / name.replace(".*.vtu", ".pvd")))
    assert [s.step for s in snapshots] == [0, 5, 10]
    assert [s.time for s in snapshots] == pytest.approx([0, 0.5, 1])
    for snapshot in snapshots:
        for column in ("id", "type", "x", "y", "z", "vx", "seq"):
            expected = hub.fields.points[column]
            np.testing.assert_allclose(snapshot.columns[column], expected, rtol=1e-8)
        if name.endswith(("dump", "gz", "h5")):
            d = hub.domain.dimension
            np.testing.assert_allclose([snapshot.lo[:d], snapshot.hi[:d]], [[-0.5] * d, [0.5] * d])


SHOWN = [(1, "p.dump"), (2, "p.h5"), (3, "p.pvd")]
OTHERS = [of for of in product((1, 2, 3), ("p.h5", "p.pvd", "p.dump")) if of not in SHOWN]


@pytest.mark.usefixtures("unlaid")
@pytest.mark.parametrize(("hub", "file"), parameters(SHOWN, OTHERS), indirect=["hub"])
def test_view_draws_pictures_and_movies(hub, capsys, file):
    for name, style in FORMS.items():
        hub.dumps[name] = style(hub, 5, name, "vx")
    hub.run(10)
    assert call(capsys, "view", file)[0] == 0
    assert sorted(p.name for p in hub.folder.glob("view*")) == [
        "view.0.png",
        "view.10.png",
        "view.5.png",
    ]
    arguments = ["-c", "vx", "-o", "m.gif", "--size", "300", "200", "--vmax", "1e-3"]
    status, out, _ = call(capsys, "view", file, *arguments)
    assert status == 0 and out == "m.gif: 3 frames\n"
    movie = Image.open(hub.folder / "m.gif")
    assert (movie.n_frames, movie.size) == (3, (300, 200))


@pytest.mark.usefixtures("unlaid")
def test_view_takes_files_in_the_order_of_their_steps(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    hub = FakeHub(tmp_path)
    hub.dumps["d"] = Particle(hub, 8, "p.*.dump")
    hub.run(16)
    files = [p.name for p in tmp_path.glob("p.*.dump")]
    status, out, _ = call(capsys, "view", *sorted(files), "-o", "f.*.png")
    assert (status, out) == (0, "f.*.png: 3 pictures\n")
    assert (tmp_path / "f.16.png").exists()


@pytest.mark.usefixtures("unlaid")
def test_frames_have_one_range_of_colours(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    hub = FakeHub(tmp_path)
    hub.dumps["d"] = Particle(hub, 8, "p.dump", "vx")
    for n in (8, 16):
        hub.fields.points["vx"][:] *= n
        hub.run(n)
    limits, save = [], pictures.Picture.save_png
    monkeypatch.setattr(
        pictures.Picture, "save_png",
        lambda self, *rest: limits.append(self.limits) or save(self, *rest),
    )  # fmt: skip
    assert call(capsys, "view", "p.dump", "-c", "vx", "-o", "m.gif")[0] == 0
    assert len(limits) > 1 and len({*limits}) == 1


@pytest.mark.usefixtures("unlaid")
def test_a_pattern_in_quotes_is_that_of_a_shell(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    hub = FakeHub(tmp_path, dimension=2)
    hub.dumps["d"] = Particle(hub, 5, "p.*.dump", "vx")
    hub.run(10)
    assert call(capsys, "view", "p.*.dump", "-o", "v.*.png")[0] == 0
    assert sorted(path.name for path in tmp_path.glob("v.*")) == ["v.0.png", "v.10.png", "v.5.png"]


@pytest.mark.usefixtures("unlaid")
def test_colours_mean_the_same_in_all_pictures(tmp_path, monkeypatch, capsys):
    """The first picture knows of the larger values of the second, which is as if drawn alone."""
    monkeypatch.chdir(tmp_path)
    low, high = tmp_path / "p.0.dump", tmp_path / "p.8.dump"
    for path, step, speed in ((low, 0, 1), (high, 8, 9)):
        path.write_text(
            f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS sm sm sm\n"
            "0 1\n0 1\n0 0\nITEM: ATOMS id type tag x y z vx\n"
            f"1 1 1 0.1 0.1 0 0\n2 1 2 0.2 0.2 0 {speed}\n"
        )
    for files, name in (([low], "a"), ([high], "b"), ([low, high], "c")):
        words = [str(file) for file in files]
        assert call(capsys, "view", *words, "-c", "vx", "-o", f"{name}.*.png")[0] == 0
    assert (tmp_path / "c.8.png").read_bytes() == (tmp_path / "b.8.png").read_bytes()
    assert (tmp_path / "c.0.png").read_bytes() != (tmp_path / "a.0.png").read_bytes()


def as_it_is(snapshot):
    return snapshot


def test_points_that_move_stay_in_view(tmp_path, monkeypatch):
    """A .pvd has no domain: the picture shows where the points are at any time."""
    monkeypatch.chdir(tmp_path)
    hub = FakeHub(tmp_path)
    hub.dumps["d"] = Vtk(hub, 5, "p.*.vtu", "vx")
    x = hub.fields.points["x"].copy()
    hub.dumps["d"].write()
    hub.update.step, hub.update.time = 5, 0.5
    hub.fields.points["x"] = x + 3
    hub.dumps["d"].write()
    words = {"field": None, "only": None}
    lo, hi, _ = view._all([tmp_path / "p.pvd"], "vx", words, PLAIN, as_it_is)
    assert lo[0] < x.min() and hi[0] > x.max() + 3
    seen = PLAIN | {"window": ((None, x.max() + 1),)}
    span = view._all([tmp_path / "p.pvd"], "x", words, seen, as_it_is)[2]
    assert span[1] < x.max() + 1.5


@pytest.mark.parametrize(
    ("arguments", "remedy"),
    [
        (["p.dump", "-c", "vxx"], "did you mean 'vx'?"),
        (["gone.dump"], "No such file"),
        (["text"], "is not a dump"),
        (["text.h5"], "is not a dump"),
        (["text.vtu"], "is not a dump"),
        (["text.pvd"], "is not a dump"),
        (["p.dump", "-o", "p.avi"], ".png"),
        (["p.dump", "-o", "p.jpg"], ".pdf"),
        (["p.dump", "--cmap", "rainbows"], "rainbows"),
        (["p.dump", "--only", "vxx > 0"], "vxx"),
        (["p.dump", "--only", "type = 2"],
         "| type = 2\n      |      ^\nexpected: name = expression"),
        (["p.dump", "--only", "type = 2"], "hint: compare with =="),
        (["p.dump", "--outlines", "yes"], "| yes\n"),
        (["p.dump", "--outlines"], "expected: --outlines true|false"),
        (["p.dump", "--xmin", "2", "--xmax", "1"], "above xmin"),
        (["p.dump", "--scale", "log", "--vmin", "0"], "above 0"),
        (["p.dump", "--quantile", "0.6"], "from 0 to 0.4"),
        (["p.dump", "-c", ""], "--column takes one value, not ''"),
        (["p.dump", "-c", "vx, x"], "--column takes one value, not 'vx, x'"),
        (["p.dump", "--xmin", ""], "--xmin takes one value"),
        (["p.dump", "--xmin", "0, 5"], "--xmin takes one value"),
        (["p.dump", "--size", "0", "0"], "pixels from 20"),
        (["p.dump", "-o", "p.gif", "--fps", "0"], "number above 0"),
        (["p.dump", "-var", "N", "4"], "--script FILE"),
        (["p.dump", "--only", "type == 9"], "--only: no point of these dumps is left"),
        (["p.dump", "--xmin", "1e9"], "--xmin: no point of these dumps is left"),
        (["q.dump", "-o", "q.png"], "-o q.*.png"),
        (["p.dump", "q.dump"], "p.dump and q.dump both have step 0"),
        (["p.dump", "--only", "not tool"], "--script FILE the groups, solids and variables"),
        (["p.dump", "-c", "tool"], "--script FILE the groups"),
        (["p.dump", "--title", "load {load} N"], "a log in the folder of the dumps"),
        (["p.dump", "--title", "v_{max}"], "($v_{max}$), or {{max}} for braces"),
        (["p.dump", "--title", "{1/0}"], "error: {1/0} in --title: division by zero"),
        ([], "FILE"),
    ],
)  # fmt: skip
def test_view_says_what_is_wrong(tmp_path, monkeypatch, capsys, arguments, remedy):
    monkeypatch.chdir(tmp_path)
    Particle(FakeHub(tmp_path), 1, "p.dump", "vx").write()
    (tmp_path / "q.dump").write_text(2 * (tmp_path / "p.dump").read_text())
    for ending in ("", ".h5", ".vtu", ".pvd"):
        (tmp_path / f"text{ending}").write_text("no dump at all\n")
    status, _, err = call(capsys, "view", *arguments)
    assert status == 1 and remedy in err


@pytest.mark.parametrize("name", ["log.mpm", "log.csv"])
def test_plot_draws_columns_of_a_log(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    hub = FakeHub(tmp_path)
    hub.output.log.file = tmp_path / name
    hub.run(4)
    rows = read_rows(tmp_path / name)
    assert [row["Step"] for row in rows] == [0, 1, 2, 3, 4]
    assert [row["Time"] for row in rows] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert call(capsys, "plot", name)[:2] == (0, "Step dt Time\n")
    status, out, _ = call(capsys, "plot", name, "Step", "--right", "dt", "-o", "p.svg")
    assert (status, out) == (0, "p.svg\n")
    svg = (tmp_path / "p.svg").read_text()
    assert "<!-- Step -->" in svg and "<!-- dt (right) -->" in svg and "<!-- Time -->" in svg
    assert call(capsys, "plot", name, "dt", "--label", "step (s)", "-o", "p.svg")[0] == 0
    assert "<!-- step (s) -->" in (tmp_path / "p.svg").read_text()
    for arguments, remedy in [
        ([name, "Stepp"], "did you mean 'Step'?"),
        (["gone.mpm", "Step"], "there is no log gone.mpm"),
        ([name, "Step", "-o", "p.txt"], ".pdf"),
    ]:
        status, _, err = call(capsys, "plot", *arguments)
        assert status == 1 and remedy in err


def test_plot_of_a_log_without_time(tmp_path, monkeypatch, capsys):
    """Load steps have columns over the step."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.mpm").write_text("Step load\n0 0\n1 0.5\n")
    assert call(capsys, "plot", "log.mpm", "load", "-o", "p.svg")[:2] == (0, "p.svg\n")
    assert "<!-- Step -->" in (tmp_path / "p.svg").read_text()


def test_plot_reads_a_log_whose_columns_change(tmp_path):
    (tmp_path / "log.mpm").write_text("Step Time\n0 0\n1 0.5\n# Step Time Ek\n1 0.5 7\n")
    rows = read_rows(tmp_path / "log.mpm")
    assert rows[0] == {"Step": 0, "Time": 0} and rows[-1] == {"Step": 1, "Time": 0.5, "Ek": 7}


SCRIPT = """
    method(ulmpm, FLIP, linear, 1)
    dimension(1, 0, 1, 0.1)
    region(a, block, 0.2, 0.5)
    material(m, linear, 1, 100, 0)
    solid(a, region, a, 2, m, 0.1)
    set_dt(0.001)
    set_output(time(0.01))
    dump(d, all, particle, time(0.004), p.*.dump, seq)
    compute(mean, probe, all, s11)
    log_modify(custom, step, time, mean)
    run(25)
"""


def test_log_and_out(run_interpreted, tmp_path):
    run = run_interpreted(SCRIPT, "-out", "results/here", "-log", "table.csv")
    made = tmp_path / "run/results/here"
    assert sorted(p.name for p in run.folder.iterdir()) == ["in.script", "results"]
    rows = read_rows(made / "table.csv")
    assert [row["Step"] for row in rows] == [0, 10, 20, 25]
    steps = sorted(int(p.name.split(".")[1]) for p in made.glob("p.*.dump"))
    assert steps == [0, 4, 8, 12, 16, 20, 24, 25]


def test_log_without_a_folder(run_interpreted):
    run = run_interpreted(SCRIPT, "-log", "gone/log.csv", status=1)
    assert "a folder that exists" in run.err
    run = run_interpreted(SCRIPT, "-out", "in.script", status=1)
    assert "cannot write to in.script" in run.err


def test_by_time_goes_on_in_a_further_run():
    every = ByTime(0.1)
    times = (0, 0.05, 0.1 - 1e-17, 0.1, 0.30000000000000004)
    assert [every.now(time) for time in times] == [0, 0, 1, 1, 3]


def test_words_of_a_log_are_no_numbers(tmp_path):
    """What limits the step is a word: the other columns of its rows can be read all the same."""
    (tmp_path / "log.mpm").write_text("Step limit dt\n0 waves 0.5\n1 waves 0.25\n2 wav")
    rows = read_rows(tmp_path / "log.mpm")
    assert [(row["Step"], row["dt"]) for row in rows] == [(0, 0.5), (1, 0.25)]
    assert np.isnan(rows[0]["limit"])


PLAIN = {"window": (), "log": False, "quantile": 0.0}
LOOKS = {
    "zoom": ("xmin=0, xmax=0.5, ymin=0.2", {"xmin": "0", "xmax": "0.5", "ymin": "0.2"}),
    "only": ("only=x > 0.4", {"only": "x > 0.4"}),
    "log": ("scale=log, vmin=1e-3, vmax=10", {"scale": "log", "vmin": "1e-3", "vmax": "10"}),
    "quantile": ("quantile=0.35", {"quantile": "0.35"}),
    "letters": ('label="stress (Pa)", fontsize=14, dpi=200', {"label": "stress (Pa)",
                "fontsize": "14", "dpi": "200"}),
    "points": ("pointsize=1.4", {"pointsize": "1.4"}),
    "formula": ("sqrt(x^2 + y^2)*y", {"column": "sqrt(x^2 + y^2)*y"}),
    "outlines": ("outlines=true", {"outlines": "true"}),
}  # fmt: skip


@pytest.mark.usefixtures("unlaid")
def test_words_of_pictures_are_the_same_everywhere(tmp_path, capsys, monkeypatch):
    """dump pyplot and view draw the same picture with a word, and another one without it."""
    text = block(
        2, "dump(d, all, particle, 10, p.dump, x, y, type)",
        "dump(plain, all, pyplot, 10, plain.png, 300, 300, x)",
        *(f"dump({name}, all, pyplot, 10, {name}.png, 300, 300, {'x, ' * ('=' in words)}{words})"
          for name, (words, _) in LOOKS.items()),
    )  # fmt: skip
    monkeypatch.chdir(tmp_path)
    for dump in Simulation(text, out=tmp_path).hub.dumps.values():
        dump.write()
    view = "view", "p.dump", "-c", "x", "--size", "300", "300"
    assert call(capsys, *view, "-o", "v_plain.png")[0] == 0
    for name, (_, options) in LOOKS.items():
        assert Path(f"{name}.png").read_bytes() != Path("plain.png").read_bytes(), name
        given = [word for key, value in options.items() for word in (f"--{key}", value)]
        status, _, err = call(capsys, *view, *given, "-o", f"v_{name}.png")
        assert status == 0, err
        assert Image.open(f"v_{name}.png").size == Image.open(f"{name}.png").size, name
        assert Path(f"v_{name}.png").read_bytes() != Path("v_plain.png").read_bytes(), name


@pytest.fixture
def shown(monkeypatch):
    """What pictures show, one after another: numbers of points and titles."""
    found = []

    def show(self, snapshot, side, title, tools=(), of=pictures.Picture.show):
        of(self, snapshot, side, title, tools)
        found.append((self.marks.rows.shape[1], title))

    monkeypatch.setattr(pictures.Picture, "show", show)
    return found


SETS = """
    compute(v, probe, all, vx)
    twice = 2*v
    region(low, block, 0.3, 0.6, 0, 0.35)
    region(top, block, 0.3, 0.6, 0.45, 0.5)
    group(part, particles, region, low, all)
    group(part, particles, region, top, all)
    region(other, block, 0.8, 0.9, 0.3, 0.4)
    solid(second, region, other, 2, rubber, 0.1)
    log_modify(custom, step, time, twice)
    set_output(2)
    set_dt(1e-3)
"""


# Of a group of two parts, 12 of 24 points, and a solid of 4 more.
CHOSEN = {
    "only=not part": 16, "only=not second": 24, "only=part && x < 0.35": 2,
    "part": 28, "second + 2*part": 28, "only=vx > twice/3": 24,
    'title="v {twice/2} of {{{1+1}}} $a_{2}$"': 28,
}  # fmt: skip
FAST = "fix(f, initial_velocity_particles, all, 0.1*(x < 0.7), 0)"


@pytest.mark.usefixtures("unlaid")
def test_groups_and_solids_are_left_out_by_name(shown):
    """In sim.show, which draws as dump pyplot does, before the first step."""
    sim = Simulation(block(2, SETS, "run(2)"))
    for word, count in CHOSEN.items():
        name, _, value = word.partition("=")
        keyword = {name: value.strip('"')} if name in ("only", "title") else {"field": word}
        if "twice" not in word or name == "title":
            sim.show(**keyword)
            assert shown[-1][0] == count, word
    assert shown[-1][1] == "v 0 of {2} $a_{2}$: step 0, time 0"
    with pytest.raises(ScriptError, match="unknown name 'partt'") as caught:
        sim.show(only="not partt")
    assert caught.value.hint == "did you mean 'part'?"
    for name in ("second", "x"):
        sim = Simulation(block(2, SETS.replace("(second", f"({name}"), "second = 2"))
        with pytest.raises(ScriptError, match=f"'{name}' names both a group or solid"):
            sim.show(only=f"not {name}")


@pytest.mark.usefixtures("unlaid")
def test_view_knows_groups_solids_and_values_by_name(run_interpreted, monkeypatch, capsys, shown):
    """With the script of the run, and the log beside the dumps."""
    own = 'dump(d, all, movie, 9, d.gif, 1, 1, 2*part, only=not second, title="{v} m/s")'
    text = block(2, SETS, FAST, own, "dump(p, all, particle, 9, p.*.dump, vx)", "run(2)")
    monkeypatch.chdir(run_interpreted(text).folder)
    words = ["view", "p.2.dump", "-o", "v.png", "--size", "100", "100"]
    for word, count in [*CHOSEN.items()][::3]:
        name, _, value = word.partition("=")
        option = [f"--{name}", value.strip('"')] if name in ("only", "title") else ["-c", word]
        status, _, err = call(capsys, *words, *option, "--script", "in.script")
        assert (status, err) == (0, "") and shown[-1][0] == count, word
    v = 0.1 * 24 / 28
    assert shown[-1][1].startswith(f"v {v:.6g} of {{2}} $a_{{2}}$: step 2")
    # The log is read where it is needed.
    with monkeypatch.context() as without:
        without.setattr(view, "read_rows", None)
        known = ["--only", "not part && sqrt(vx^2) >= 0 and time < 9", "--title", "twice {time}"]
        assert call(capsys, *words, *known, "--script", "in.script")[::2] == (0, "")
    # Without a script the log knows its columns.
    only = ["--only", "vx > twice/3"]
    assert call(capsys, *words, *only)[0] == 0 and shown[-1][0] == 24
    Path("log.mpm").write_text("Step Time twice\n0 0 0\n")
    assert "twice at step 2 is not in dumps" in call(capsys, *words, *only)[2]
    Path("log.mpm").unlink()
    err = call(capsys, *words, *only, "--script", "in.script")[2]
    assert "log_modify(custom, step, time, v) in the script" in err
    Path("in.small").write_text(block(2))
    err = call(capsys, *words, "--script", "in.small")[2]
    assert "the script has 24 points, the dump 28" in err


@pytest.mark.usefixtures("unlaid")
@pytest.mark.parametrize("dimension", [2, 3])
def test_view_outlines_the_tools_of_a_script(run_interpreted, monkeypatch, capsys, dimension):
    """With the units, the names and the tool at its time, and no line where there is none."""
    tool = "fix(ball, indent, all, sphere, 1, 0.1, 0.5, 0.2 + 100*time, {})".format
    height = "0" if dimension == 2 else "0.5"
    text = block(
        dimension, "units(mm, g, ms)", "compute(vmean, probe, all, vx)", tool(height),
        "dump(d, all, particle, 10, p.dump, vx)", "dump(h, all, hdf5, 10, p.h5, vx)",
        "dump(own, all, pyplot, 10, own.*.png, 300, 300, vx/2, outlines=true)",
        "set_dt(1e-3)", "run(2)",
    )  # fmt: skip
    folder = run_interpreted(text).folder
    monkeypatch.chdir(folder)
    made = []
    monkeypatch.setattr(
        pictures, "make", lambda *a, of=pictures.make: made.append(of(*a)) or made[-1]
    )
    words = ["view", "-c", "vx/2", "--size", "300", "300", "--outlines", "true"]
    file = "p.dump" if dimension == 2 else "p.h5"
    assert call(capsys, *words, file, "--script", "in.script")[::2] == (0, "")
    status, _, err = call(capsys, *words, file)
    assert status == 0 and "--script FILE" in err
    with_tool, without = (sum(map(len, m.marks.lines.get_segments())) for m in made)
    assert with_tool > without
    shown = made[0]
    assert shown.title.get_text() == "t = 2 µs"
    if dimension == 2:
        assert shown.axes.get_xlabel() == "x (mm)"
        lines = shown.marks.lines.get_segments()
        (circle,) = (line for line in lines if np.ptp(line, axis=0).max() < 0.21)
        assert circle.mean(axis=0) == pytest.approx([0.5, 0.4], abs=0.01)
    Path("in.results").write_text(text.replace("100*time", "vmean"))
    status, _, err = call(capsys, *words, file, "--script", "in.script", "--only", "type == 9")
    assert status == 1 and "no point" in err  # not that the scene is on a line
    Path("in.flat").write_text(block(dimension - 1))
    status, _, err = call(capsys, *words, file, "--script", "in.flat")
    assert status == 1 and f"{dimension - 1} dimension" in err and f"the dump {dimension}" in err
    status, _, err = call(capsys, *words, "p.dump", "--script", "in.results")
    assert status == 1 and "the position of fix 'ball' depends on results of the run" in err


@pytest.mark.usefixtures("unlaid")
def test_one_point_does_not_take_all_colours():
    """Of a hundred values one is a thousand times as large: quantile leaves it beyond the end."""
    options = pictures.Options("seq", "seq", quantile=0.02)
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.ones(2))
    picture = pictures.make(domain, (3, 3), 100, options)
    x = np.linspace(0, 1, 100)
    columns = {"id": np.arange(100), "x": x, "y": x, "z": 0 * x, "seq": np.append(x[:-1], 1e3)}
    picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), 0.01, "")
    assert picture.limits[1] < 1.5 and picture.beyond == (False, True)


@pytest.mark.parametrize(("stretch", "size"), [(1.0, 0.05), (1.5, 0.05), (1.0, 0.02)])
def test_outlines_are_where_bodies_end(stretch, size):
    """A block of points, as it is and stretched to 1.5 and 1/1.5: within half a point.

    Corners are cut: the line goes through nodes that are two points apart.
    """
    own = np.arange(size / 2, 1, size)
    x = np.stack(np.meshgrid(own * stretch, own / stretch), -1).reshape(-1, 2)
    (line,) = outlines(x)
    ends = np.array([stretch, 1 / stretch])
    outside = np.maximum(-line, line - ends).max(axis=1)
    far = (np.minimum(line, ends - line) > 4 * size).any(axis=1)  # from the corners
    assert abs(outside[far]).max() < size / 2
    (x, y), (right, up) = line[:-1].T, line[1:].T
    assert abs(np.sum(x * up - right * y)) / 2 == pytest.approx(1.0, abs=size)


@pytest.mark.usefixtures("unlaid")
def test_outlines_show_solids_and_tools():
    """Two disks have two circles; a moved region, a ball, a wedge and a wall have lines."""
    hub = SmallHub(2, 0, 1, 0.02)
    hub.interpreter.run_text(
        """
        region(left, cylinder, 0.2, 0.2, 0.1)
        region(right, cylinder, 0.8, 0.2, 0.15)
        region(tool, block, 0.1, 0.3, 0.7, 0.9)
        solid(a, region, left, 2, steel, 0.02)
        solid(b, region, right, 2, steel, 0.02)
        fix(press, contact/surface, all, tool, 0, 0.1 + time, 0)
        fix(ball, indent, all, sphere, 1e4, 0.1, 0.7, 0.8, 0)
        fix(wedge, cuttingtool, all, 1, 0.5, 0.5, 0, 0, 0, 0, 0.4, 0.6, 0.6, 0.6)
        fix(wall, impenetrablesurface, all, 1, 0, 0.05, 0, 0, 1, 0)
        """
    )
    dump = PyPlot(hub, 1, "p.png", 300, 300, outlines=True)
    dump.draw(io.BytesIO())
    lines = dump._picture.marks.lines.get_segments()
    boxes = sorted([*line.min(axis=0), *line.max(axis=0)] for line in lines)
    assert boxes == [
        pytest.approx(box, abs=0.01)  # half a cell
        for box in (
            [0, 0.05, 1, 0.05], [0, 0.5, 1, 1], [0.1, 0.1, 0.3, 0.3],
            [0.2, 0.7, 0.4, 0.9], [0.6, 0.7, 0.8, 0.9], [0.65, 0.05, 0.95, 0.35],
        )
    ]  # fmt: skip


@pytest.mark.usefixtures("unlaid")
def test_many_points_are_pixels_among_lines(tmp_path, monkeypatch):
    """An .svg of more points than are drawn together has one picture of them, and no circles."""
    x = np.linspace(0.1, 0.9, 100)
    columns = {"id": np.arange(100), "x": x, "y": x, "z": 0 * x, "seq": x}
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.ones(2))
    found = []
    for marks in (100, 99):
        monkeypatch.setattr(pictures, "MARKS", marks)
        picture = pictures.make(domain, (3, 3), 100, pictures.Options("seq", "seq"))
        picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), 0.01, "")
        savefig(picture.figure, tmp_path / "s.svg")
        text = (tmp_path / "s.svg").read_text()
        assert "<!-- seq -->" in text
        found.append((text.count("<image"), text.count("<use")))
    (images, circles), (more_images, fewer) = found
    assert more_images == images + 1 and fewer <= circles - 100


@pytest.mark.usefixtures("unlaid")
def test_outlines_go_on_beyond_a_window():
    """A disk of which the right half is shown has the whole circle: its cut is no edge."""
    own = np.arange(0.01, 1, 0.02)
    x = np.stack(np.meshgrid(own, own), -1).reshape(-1, 2)
    x = x[np.linalg.norm(x - 0.5, axis=1) < 0.4]
    columns = dict(zip("xyz", (*x.T, 0 * x[:, 0]), strict=True))
    columns |= {"id": np.arange(len(x)), "type": np.ones(len(x)), "seq": x[:, 0]}
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.ones(2))
    options = pictures.Options("seq", "seq", window=((0.5, None),), outlines=True)
    picture = pictures.make(domain, (3, 3), 100, options)
    picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), 0.02, "")
    (line,) = picture.marks.lines.get_segments()
    assert np.linalg.norm(line - 0.5, axis=1) == pytest.approx(0.4, abs=0.02)
    assert picture.marks.rows.shape[1] == np.count_nonzero(x[:, 0] >= 0.5)


def test_no_outlines_on_a_line(run_interpreted):
    text = block(1, "dump(d, all, pyplot, 10, p.png, 300, 300, outlines=true)", "run(1)")
    err = run_interpreted(text, status=1).err
    assert "outlines are drawn in 2D and 3D, and this scene is 1D" in err


def lines_of_tool(words):
    """Lines on the surface of the one tool of a scene in a cube of side 1."""
    hub = SmallHub(3, 0, 1, 0.1)
    hub.interpreter.run_text(words)
    (fix,) = hub.fixes.values()
    depth = lambda x: fix.depth_of(SimpleNamespace(position=x))  # noqa: E731
    faces = fix.faces_of and fix.faces_of()
    return list(Tool(depth, faces).lines(np.zeros(3), np.ones(3)))


def test_lines_of_a_box_are_its_edges():
    """Two rectangles across each axis, whose corners are within a hundredth of its length."""
    found = lines_of_tool(
        """
        region(plate, block, 0.2, 0.8, 0.3, 0.5, 0.41, 0.44)
        fix(press, contact/surface, all, plate, 0, 0, 0, 0.1)
        """
    )
    box = np.array([[0.2, 0.3, 0.51], [0.8, 0.5, 0.54]])
    faces = []
    for line in found:
        (axis,) = np.flatnonzero(np.ptp(line, axis=0) < 1e-12)
        end = int(np.argmin(abs(box[:, axis] - line[0, axis])))
        faces.append((int(axis), end))
        expected = box.copy()
        expected[:, axis] = box[end, axis]
        ends = [line.min(axis=0), line.max(axis=0)]
        np.testing.assert_allclose(ends, expected, atol=0.01 * np.ptp(box, axis=0).max())
    assert sorted(faces) == [(axis, end) for axis in range(3) for end in (0, 1)]


def test_lines_of_a_mesh_are_its_sharp_edges(tmp_path):
    """A brick of triangles has twelve, where it has moved to."""
    x = np.array(list(product((0.1, 0.5), (0.2, 0.4), (0.3, 0.4))))
    quads = (0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)
    triangles = [half for a, b, c, d in quads for half in ((a, b, c), (a, c, d))]
    meshio.write(tmp_path / "brick.stl", meshio.Mesh(x, [("triangle", np.array(triangles))]))
    found = lines_of_tool(
        f"""
        region(brick, stl, "{tmp_path}/brick.stl")
        fix(press, contact/surface, all, brick, 0, 0.2, 0, 0.1)
        """
    )
    lengths = sorted(np.linalg.norm(line[-1] - line[0]) for line in found)
    assert lengths == pytest.approx([0.1] * 4 + [0.2] * 4 + [0.4] * 4)
    at = np.concatenate(found)
    ends = [at.min(axis=0), at.max(axis=0)]
    np.testing.assert_allclose(ends, [[0.3, 0.2, 0.4], [0.7, 0.4, 0.5]], atol=1e-6)


def test_lines_of_a_ball_are_on_it():
    """Circles of the radius of a section: sqrt(R^2 - a^2), at -R/2, 0 and R/2 along each axis."""
    centre, R = np.array([0.4, 0.5, 0.6]), 0.2
    found = lines_of_tool("fix(ball, indent, all, sphere, 1, 0.2, 0.4, 0.5, 0.6)")
    heights = []
    for line in found:
        np.testing.assert_allclose(np.linalg.norm(line - centre, axis=1), R, rtol=2e-3)
        (axis,) = np.flatnonzero(np.ptp(line, axis=0) < 1e-12)
        heights.append((int(axis), (line[0, axis] - centre[axis]) / R))
    expected = [(axis, height) for axis in range(3) for height in (-0.5, 0, 0.5)]
    np.testing.assert_allclose(sorted(heights), expected, atol=0.01)


def test_lines_of_a_tube_with_a_channel():
    """The tool of meldtool: on its cylinder, its square channel or its ends."""
    found = lines_of_tool("fix(a, meldtool, all, 1, y, 0.1, 0.5, 0.4, 0, 0.3, 0.7, 0.3)")
    x, y, z = np.concatenate(found).T - np.array([[0.5], [0], [0.4]])
    away = np.abs([np.hypot(x, z) - 0.3, np.maximum(abs(x), abs(z)) - 0.1, y - 0.3, y - 0.7])
    assert away.min(axis=0).max() < 5e-3
    assert (away.min(axis=1) < 1e-3).all()


def test_lines_of_a_wall_are_where_it_leaves_the_domain():
    """x + z = 1.2 in a cube of side 1: four edges, at its ends along x, y and z."""
    found = np.concatenate(
        lines_of_tool("fix(wall, impenetrablesurface, all, 1, 0.6, 0, 0.6, -1, 0, -1)")
    )
    np.testing.assert_allclose(found[:, 0] + found[:, 2], 1.2, atol=1e-3)
    on_edge = (abs(found[:, 1] * (1 - found[:, 1])) < 1e-3) | (abs(found[:, 0] - 0.6) > 0.397)
    assert on_edge.all()


@pytest.mark.usefixtures("unlaid")
def test_outlines_in_space_tell_what_is_behind():
    """Seen from above: a ball above a plate is before it, one below it is behind, and light."""
    hub = SmallHub(3, 0, 1, 0.1)
    hub.interpreter.run_text(
        """
        region(plate, block, 0.1, 0.9, 0.1, 0.9, 0.5, 0.6)
        solid(a, region, plate, 1, steel, 0.1)
        fix(below, indent, all, sphere, 1, 0.1, 0.3, 0.3, 0.2)
        fix(above, indent, all, sphere, 1, 0.1, 0.7, 0.7, 0.8)
        """
    )
    dump = PyPlot(hub, 1, "p.png", 300, 300, outlines=True, azimuth=-90.0, elevation=90.0)
    dump.draw(io.BytesIO())
    lines = dump._picture.marks.lines
    of_ball = {"below": [], "above": []}
    for line, colour in zip(lines.get_segments(), lines.get_color(), strict=True):
        at = line.mean(axis=0) + 0.5
        for name, place in (("below", 0.3), ("above", 0.7)):
            if np.abs(at - place).max() < 0.12:
                of_ball[name].append((len(line), colour[3]))
    assert {opacity for _, opacity in of_ball["below"]} == {pictures.HIDDEN[3]}
    shown = sum(n for n, opacity in of_ball["above"] if opacity == 1)
    assert shown == pytest.approx(sum(n for n, _ in of_ball["above"]) / 2, rel=0.15)
    plate = max(lines.get_segments(), key=lambda line: np.ptp(line, axis=0).max())
    np.testing.assert_allclose(
        [plate.min(axis=0), plate.max(axis=0)], [[-0.4] * 2, [0.4] * 2], atol=0.04
    )


@pytest.mark.usefixtures("unlaid")
def test_points_behind_others_are_not_drawn(monkeypatch):
    """Of 20^3 points that are stretched and moved at random, without a change of one pixel."""
    own = (np.arange(20) + 0.5) / 20
    x = np.stack(np.meshgrid(own, own, own), -1).reshape(-1, 3) * (0.5, 0.7, 0.5) + 0.2
    x += np.random.default_rng(1).normal(0, 5e-3, x.shape)
    columns = dict(zip("xyz", x.T, strict=True)) | {"id": np.arange(8000), "seq": x[:, 0]}
    domain = SimpleNamespace(dimension=3, lo=np.zeros(3), hi=np.ones(3))
    drawn = []
    for _ in range(2):
        picture = pictures.make(domain, (3, 3), 100, pictures.Options("seq", "seq"))
        picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), 0.028, "")
        picture.save_png(file := io.BytesIO(), 1)
        drawn.append((picture.marks.rows.shape[1], file.getvalue()))
        monkeypatch.setattr(
            pictures.SpacePicture, "_shows", lambda _, x, side: np.ones(len(x), bool)
        )
    assert drawn[0][1] == drawn[1][1]
    assert drawn[0][0] < 0.7 * drawn[1][0] == 0.7 * 8000


def test_a_logarithm_is_shown_by_its_number():
    options = pictures.Options("seq", "seq", log=True)
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.ones(2))
    picture = pictures.make(domain, (3, 3), 100, options)
    x = np.array([0.1, 0.5, 0.9])
    columns = {"id": np.arange(3), "x": x, "y": x, "z": 0 * x, "seq": np.array([0.0, 1.0, 1e4])}
    picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), 0.01, "")
    assert picture.limits == (0.0, 4.0)
    ticks = [picture.scale.get_major_formatter()(v) for v in (0, 2, 4)]
    assert ticks == ["1", "100", "10000"]
    assert [pictures._number(v) for v in (-7.5e-6, 2.5e6, 0.02, 6e5)] == [
        "-7.5e-6", "2.5e6", "0.02", "600000",
    ]  # fmt: skip
    # What has no logarithm has the lowest colour.
    assert list(picture.marks.rows[2]) == [0.0, 0.0, 1.0]


@pytest.mark.usefixtures("unlaid")
def test_show_writes_the_format_that_a_name_asks_for(tmp_path):
    sim = Simulation(block(2))
    for ending, magic in (("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG")):
        sim.show(file=tmp_path / f"s.{ending}")
        assert (tmp_path / f"s.{ending}").read_bytes().startswith(magic)
    assert sim.show(outlines=True).png != sim.show().png
    plain = sim.show("seq").png
    for words in ({"label": "stress, in (Pa)"}, {"title": "disk (a), b"}):
        assert sim.show("seq", **words).png != plain


@pytest.mark.parametrize("ends", [(298.0, 600.0), (-600.0, -298.0)])
def test_the_bar_of_colours_has_the_ends_that_are_given(ends):
    options = pictures.Options("seq", "seq", limits=ends)
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.ones(2))
    picture = pictures.make(domain, (3, 3), 100, options)
    x = np.array([0.1, 0.9])
    columns = {"id": np.arange(2), "x": x, "y": x, "z": 0 * x, "seq": np.array(ends)}
    picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), 0.01, "")
    assert picture.scale.axes.get_ylim() == ends


def test_small_lengths_have_a_unit_that_suits_them():
    """20 micrometres are no 0.00002 beside a tick."""
    options = pictures.Options("seq", "seq", lengths="m")
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.full(2, 2e-5))
    picture = pictures.make(domain, (3, 3), 100, options)
    assert picture.axes.get_xlabel() == "x (µm)"
    assert picture.axes.yaxis.get_major_formatter()(1e-5, 0) == "10"


@pytest.mark.parametrize("high", [7e-6, 0.026, 1.0, 3e6])
def test_pictures_with_units_are_fit_for_print(high):
    """Units, numbers and contrast; no label lies on another, however small the scene."""
    options = pictures.Options("seq", "von Mises stress (Pa)", lengths="m")
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.array([high / 2, high]))
    picture = pictures.make(domain, (4.8, 6), 100, options)
    x = np.linspace(0, high / 2, 50)
    columns = {"id": np.arange(50), "x": x, "y": x, "z": 0 * x, "seq": 1e5 * x / high}
    picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), high / 50, "step 0, time 0")
    assert faults(picture.figure) == []


@pytest.mark.parametrize(
    ("unit", "size", "shown"),
    [("m", 0.02, "20 mm"), ("m", 0.3, "0.3 m"), ("mm", 2e-5, "20 nm"), ("in", 1e-5, "1e-05 in")],
)
def test_lengths_are_shown_in_the_largest_unit_that_suits(unit, size, shown):
    factor, name = suited(unit, size, LENGTHS)
    assert f"{size * factor:g} {name}" == shown


def test_an_axisymmetric_picture_shows_both_sides():
    options = pictures.Options("seq", "seq", lengths="m", mirror=True)
    domain = SimpleNamespace(dimension=2, lo=np.zeros(2), hi=np.ones(2))
    picture = pictures.make(domain, (3, 3), 100, options)
    x = np.array([0.25, 0.5])
    columns = {"id": np.arange(2), "x": x, "y": x, "z": 0 * x, "seq": np.array([1.0, 2.0])}
    picture.show(Snapshot(0, 0.0, columns, domain.lo, domain.hi), 0.1, "t = 0 s")
    assert picture.axes.get_xlim() == (-1, 1)
    assert sorted(picture.marks.rows[0]) == [-0.5, -0.25, 0.25, 0.5]
