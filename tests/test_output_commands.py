"""dump, log, plot and their kin as a script says them: what they accept and how they refuse."""

import io
import re

import pytest

from karamelo_py.language.interpreter import Interpreter
from karamelo_py.output.console import Console
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError


@pytest.fixture
def hub(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hub = Hub(Console(io.StringIO(), io.StringIO()))
    hub.values.publish_vector("Ek")
    hub.values.publish_vector("Es")
    Interpreter(hub).run_text('Etot = Ek_s + Es_s\nE = 1000\nname = "text"')
    return hub


def say(hub, text):
    hub.interpreter.run_text(text, "in.test")


def refused(hub, text):
    with pytest.raises(ScriptError) as caught:
        say(hub, text)
    rendered = caught.value.render()
    assert rendered.startswith("in.test:1:")
    return rendered, caught.value.mark.text[caught.value.mark.column - 1 :]


def test_dumps_are_made_as_said(hub):
    say(
        hub,
        """
        N = 10
        dump(d1, all, particle, N, dump_p.*.LAMMPS, x, y, vx, s11)
        dump(d2, all, particle/gz, 2*N, dump_p.*.LAMMPS.gz)
        dump(d3, all, grid, N, dump_g.*.LAMMPS, x, y, mass, occupied=true)
        dump(d4, all, grid/gz, N, "a name.gz")
        dump(d5, all, pyplot, 1, dump.*.png, 500, 400)
        dump(d6, all, pyplot, 1, dump.*.pdf, 5, 4, seq)
        """,
    )
    assert [dump.every for dump in hub.dumps.values()] == [10, 20, 10, 10, 1, 1]
    assert hub.dumps["d1"].columns == ("x", "y", "z", "vx", "s11")
    assert hub.dumps["d3"].occupied
    assert hub.dumps["d5"].size == (5.0, 4.0) == hub.dumps["d6"].size
    assert hub.dumps["d6"].field == "seq"


@pytest.mark.parametrize(
    ("line", "word", "remedy"),
    [
        ("dump(d, all, partcle, 1, f)", "partcle", "particle"),
        ("dump(d, some, particle, 1, f)", "some", "all"),
        ("dump(d, all, particle, 0, f)", "0", "above 0"),
        ("dump(d, all, particle, 1.5, f)", "1.5", "whole number"),
        ("dump(d, all, particle, -1, f)", "-1", "above 0"),
        ("dump(d, all, particle, 1, gone/f)", "gone/f", "mkdir gone"),
        ("dump(d, all, particle, 1, f, x, vxx)", "vxx", "'vx'"),
        ("dump(d, all, grid, 1, f, masss)", "masss", "'mass'"),
        ("dump(d, all, pyplot, 1, f.jpg, 3, 3)", "f.jpg", ".png"),
        ("dump(d, all, pyplot, 1, f.png, 0, 3)", "0", "above 0"),
        ("dump(d, all, pyplot, 1, f.png, 3, 3, sqe)", "sqe", "'seq'"),
        ("dump(d, all, pyplot, 1, f.png, 20001, 3)", "20001", "20000 pixels"),
        ("dump(d, all, pyplot, 1, f.png, 3, 0.1)", "0.1", "20 to"),
        ("dump(d, all, particle, 1)", "", "file"),
        ("dump(d, all, particle, 1, log.mpm)", "log.mpm", "log.mpm is the log"),
        ("dump(d, all, particle, 1, ./log.mpm)", "./log.mpm", "is the log"),
        ("save_plot(in.plot.png)", "in.plot.png", "the script itself"),
        ("dump(d, all, pyplot, 1, in.*.png, 3, 3)", "in.*.png", "the script itself"),
        ("dump(d, all, particle, 1, vx, vy)", "vx", "is a column, not a file"),
        ("dump(d, all, particle, d.*.dump, 10)", "d.*.dump", "the file comes second"),
        ("dump(d, all, particle, f, 10)", "f", "argument 1 'every' must be a whole number"),
        ("delete_dump(d)", "d", "no dump"),
        ("set_output(0)", "0", "above 0"),
        ("set_output(time(0))", "0", "above 0"),
        ("set_output(time(E*x))", "E*x", "a formula of x"),
        ("dump(d, all, particle, time(-1), f)", "-1", "above 0"),
        ("set_output(1, cvs)", "cvs", "csv"),
        ("log(0)", "0", "above 0"),
        ("log_modify(custom, step, Ek_ss)", "Ek_ss", "'Ek_s'"),
        ("log_modify(custom, step, Ek_s + foo)", "foo", "unknown name"),
        ("log_modify(custom, step, x0)", "x0", "point"),
        ("log_modify(custom, name)", "name", "text"),
        ("log_modify(custom)", "", "at least one"),
        ("log_modify(default, step)", "step", "takes no columns"),
        ("log_modify(other)", "other", "custom"),
        ("plot(p, 1, time)", "", "plot("),
        ("plot(p, 1, time, Ek_s, axis=top)", "top", "left, right"),
        ("plot(p, 1, time, Ek_s, scale=logarithmic)", "logarithmic", "linear, log"),
        ("units(mm, g, sec)", "sec", "ms"),
        ("dump(d, all, movie, 1, f.png, 3, 3)", "f.png", ".gif"),
        ("dump(d, all, vtk, 1, f, seq)", "f", "f.*.vtu"),
        ("dump(d, all, pyplot, 1, f.png, 3, 3, seq, cmap=rainbows)", "rainbows", "viridis"),
        ("dump(d, all, pyplot, 1, f.png, 3, 3, vmin=2, vmax=1)", "1", "above vmin"),
        ("plot(p, 1, tme, Ek_s)", "tme", "'time'"),
        ("save_plot(plot.txt)", "plot.txt", ".pdf"),
        ("save_plot(gone/plot.pdf)", "gone/plot.pdf", "mkdir gone"),
    ],
)
def test_mistakes_are_marked(hub, line, word, remedy):
    hub.interpreter.files += [hub.folder / "in.plot.png", hub.folder / "in.12.png"]
    rendered, marked = refused(hub, line)
    assert marked.startswith(word)
    assert remedy in rendered


def test_names_are_used_once(hub):
    say(hub, "dump(d, all, particle, 1, f)\nplot(p, 1, time, Ek_s)")
    assert "already used" in refused(hub, "dump(d, all, particle, 1, g)")[0]
    assert "already used" in refused(hub, "plot(p, 1, time, Ek_s)")[0]
    rendered, marked = refused(hub, "dump(e, all, particle/gz, 1, f)")
    assert "dump 'd' already writes to f" in rendered
    assert marked.startswith("f)")
    say(hub, "save_plot(p.png)\ndump(q, all, pyplot, 1, q.png, 3, 3)")
    assert "save_plot already writes" in refused(hub, "dump(r, all, pyplot, 1, p.png, 3, 3)")[0]
    assert "dump 'q' already writes to q.png" in refused(hub, "save_plot(q.png)")[0]
    say(hub, "restart(5, r.h5)\nrestart(9, r.h5)")
    assert "restart already writes to r.h5" in refused(hub, "dump(r, all, hdf5, 1, r.h5)")[0]
    assert "dump 'd' already writes to f" in refused(hub, "restart(5, f)")[0]
    # What a deleted dump has written is not overwritten either.
    say(hub, "delete_dump(d)")
    assert "already writes" in refused(hub, "dump(d, all, particle, 1, f)")[0]
    say(hub, "dump(d, all, particle, 1, g.*)\ndelete_dump(d)\ndump(d, all, particle, 1, g.*)")


def test_scripts_that_were_read_are_not_overwritten(hub, tmp_path):
    (tmp_path / "in.part").write_text("a = 1")
    (tmp_path / "in.main").write_text("include(in.part)\ndump(d, all, particle, 1, in.part)")
    with pytest.raises(ScriptError, match=r"in\.part is the script itself"):
        hub.interpreter.run_file("in.main")


def test_columns_that_nothing_keeps_are_told(hub):
    say(hub, "dump(d, all, particle, 1, f, x, ep, damage)\ndump(g, all, grid, 1, g, T)")
    warnings = hub.console.err.getvalue()
    assert "in.test:1:1: warning: dump: ep, damage will be 0" in warnings
    assert "in.test:2:1: warning: dump: T will be 0" in warnings


def test_a_list_of_columns_names_each_once(hub):
    columns = re.search("one of (.*)", refused(hub, "dump(d, all, grid, 1, f, masss)")[0])[1]
    assert len(columns.split()) == len(set(columns.split()))


def test_a_home_folder_is_found(hub, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    say(hub, "dump(d, all, particle, 1, ~/f)")
    assert hub.dumps["d"].path() == tmp_path / "f"


def test_quantities(hub):
    say(
        hub,
        """
        log_modify(custom, step, dt, time, Ek_s, Ek, Etot, E, timestep, Ek_s + 2*Es_s)
        plot(total, 5, time, Etot)
        plot(share, 5, Ek_s/E, Es_s)
        """,
    )
    hub.values.set("Ek_s", 2.0)
    hub.values.set("Es_s", 3.0)
    columns = hub.output.log.columns
    headings = ["Step", "dt", "Time", "Ek_s", "Ek", "Etot", "E", "timestep", "Ek_s+2*Es_s"]
    assert [column.heading for column in columns] == headings
    assert columns[5].read() == 5.0
    assert columns[6].read() == 1000.0
    assert columns[8].read() == 8.0
    (total, share) = hub.output.plots.values()
    assert (total.x.read(), total.y.read()) == (0.0, 5.0)
    assert share.x.read() == pytest.approx(0.002)
    say(hub, "log_modify(default)")
    assert hub.output.log.columns == []


def test_output_by_time(hub):
    say(hub, "T = 2\nset_output(time(1/T))\ndump(d, all, particle, time( 0.25 ), f)")
    say(hub, "plot(p, time(T), time, Ek_s)")
    assert hub.output.log.every.span == 0.5
    assert hub.dumps["d"].every.span == 0.25
    assert next(iter(hub.output.plots.values())).every.span == 2


def test_the_log_as_csv(hub, tmp_path):
    say(hub, "set_output(10, csv)\nlog_modify(custom, step, time, Ek_s)")
    hub.output.log.begin()
    hub.output.log.write()
    assert (tmp_path / "log.csv").read_text() == "Step,Time,Ek_s\n0,0,0\n"


def test_log_is_an_older_name_of_set_output(hub):
    say(hub, "log(30)")
    assert hub.output.log.every == 30
    say(hub, "set_output(20)\na = log(10)")
    assert hub.output.log.every == 20
