"""The log: table, rhythm, columns; and what the terminal and a pipe show."""

import io
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fakes import FakeHub

from karamelo_py.output.console import Console, duration, show
from karamelo_py.output.quantity import Quantity
from karamelo_py.script.errors import ScriptError


@pytest.fixture
def hub(tmp_path):
    return FakeHub(tmp_path)


def logged(hub):
    return np.loadtxt(hub.folder / "log.mpm", skiprows=1, ndmin=2)


def test_first_and_last_state_and_multiples(hub):
    hub.output.log.every = 7
    hub.run(18)
    hub.run(4)
    assert list(logged(hub)[:, 0]) == [0, 7, 14, 18, 21, 22]


def test_header_is_karamelos(hub):
    hub.run(1)
    assert (hub.folder / "log.mpm").read_text().splitlines()[0].split() == ["Step", "dt", "Time"]


def test_pandas_reads_it(hub):
    pandas = pytest.importorskip("pandas")
    hub.run(3)
    table = pandas.read_csv(hub.folder / "log.mpm", sep=r"\s+")
    assert list(table.columns) == ["Step", "dt", "Time"]
    assert list(table.Step) == [0, 1, 2, 3]
    assert table.Time.iloc[-1] == pytest.approx(0.3)


def test_rows_begin_at_the_margin_and_have_ten_digits(hub):
    hub.update.dt = 1 / 3
    hub.output.log.columns = [Quantity(hub, name) for name in ("time", "step", "Es_s")]
    hub.run(2)
    lines = (hub.folder / "log.mpm").read_text().splitlines()
    assert not any(line.startswith(" ") for line in lines)
    assert lines[2].split()[0] == "0.3333333333"


def test_custom_columns_are_refreshed_before_they_are_read(hub):
    hub.output.log.columns = [Quantity(hub, name) for name in ("step", "time", "Ek_s", "E")]
    hub.run(5)
    table = logged(hub)
    np.testing.assert_allclose(table[:, 2], np.cos(table[:, 1]) ** 2, rtol=1e-9)
    assert set(table[:, 3]) == {1000.0}


def test_new_columns_of_a_second_run_are_a_comment(hub):
    hub.run(1)
    hub.output.log.columns = [Quantity(hub, "step"), Quantity(hub, "Ek")]
    hub.run(1)
    lines = (hub.folder / "log.mpm").read_text().splitlines()
    assert [line.split()[0] for line in lines] == ["Step", "0", "1", "#", "1", "2"]


def test_lines_are_in_the_file_at_once(hub):
    hub.output.begin()
    assert len((hub.folder / "log.mpm").read_text().splitlines()) == 2


def test_unknown_quantity_names_the_nearest(hub):
    with pytest.raises(ScriptError) as caught:
        Quantity(hub, "Ek_ss")
    assert "Ek_s" in caught.value.hint
    with pytest.raises(ScriptError, match="text"):
        Quantity(hub, "name")


def test_a_rehearsal_writes_nothing(hub):
    hub.rehearsing = True
    hub.run(3)
    hub.output.abort()
    assert list(hub.folder.iterdir()) == []
    assert hub.console.out.getvalue() == ""


def test_nothing_is_refreshed_for_dumps_alone(hub):
    from karamelo_py.styles.dumps.lammps import Particle

    hub.output.log.every = 10
    hub.dumps["d"] = Particle(hub, 2, "d.dump")
    hub.run(10)
    assert hub.refreshed == [0, 10]


def test_an_unwritable_folder_is_a_script_error(hub):
    (hub.folder / "log.mpm").mkdir()
    with pytest.raises(ScriptError, match=r"log\.mpm"):
        hub.run(1)


def test_a_pipe_sees_the_log_as_it_is(hub):
    hub.run(3)
    assert hub.console.out.getvalue() == (hub.folder / "log.mpm").read_text()


def test_plain_console(monkeypatch):
    monkeypatch.setattr("karamelo_py.output.console.REPORT", 0.0)
    console = Console(io.StringIO(), io.StringIO())
    console.banner("karamelo-py", {"method": "ulmpm", "points": 102936, "dt": 0.001})
    console.begin_run()
    console.progress(10, 0.5, 0.25)
    console.end_run()
    console.progress(20, 1.0, 0.5)
    console.summary({"steps": 3500}, [("particles to grid", 3.0), ("output", 1.0)])
    console.warn("careful")
    text = console.out.getvalue()
    assert "  points  102 936\n" in text
    assert "#  25 %, step 10, time 0.5" in text and " left" in text
    assert "step 20" not in text
    assert "75 %" in text
    assert "\x1b" not in text
    assert console.err.getvalue() == "careful\n"


def test_terminal_console(monkeypatch):
    monkeypatch.setattr("karamelo_py.output.console.REDRAW", 0.0)
    console = Console(io.StringIO(), io.StringIO(), terminal=True)
    console.banner("karamelo-py", {"points": 416})
    console.log_line("Step dt", header=True)
    console.begin_run()
    console.progress(10, 0.5, 0.25)
    console.log_line("10 [0.1]")
    console.progress(20, 1.0, None)
    console.end_run()
    console.end_run()
    console.summary({"steps": 20}, [("output", 1.0)])
    text = console.out.getvalue()
    assert "416" in text and "25 %" in text and "10 [0.1]" in text


def test_no_line_of_a_burst_is_lost_on_a_terminal():
    console = Console(io.StringIO(), terminal=True)
    console.begin_run()
    for i in range(100):
        console.log_line(f"<{i}>")
    console.say("said")
    console.log_line("<100>")
    console.end_run()
    text = console.out.getvalue()
    found = [text.index(word) for word in (*(f"<{i}>" for i in range(100)), "said", "<100>")]
    assert found == sorted(found)


def test_piped_output_does_not_import_rich():
    import subprocess
    import sys

    code = (
        "import sys; from karamelo_py.output.console import Console; c = Console();"
        "c.banner('a', {});"
        "c.begin_run(); c.log_line('1'); c.end_run(); assert 'rich' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_old_encodings_and_closed_pipes():
    ascii_only = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    Console(ascii_only).say("größe")
    ascii_only.seek(0)
    assert ascii_only.read() == "gr\\xf6\\xdfe\n"

    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    console = Console(Gone())
    console.say("a")
    console.say("b")


def test_words_for_values():
    assert show(1234567) == "1 234 567"
    assert show(0.001) == "0.001"
    assert show("x") == "x"
    assert [duration(s) for s in (4.2, 200, 7500)] == ["4 s", "3 min 20 s", "2 h 5 min"]


def test_two_runs_in_one_folder_are_noticed(hub, starts_are_cheap):
    """The second one stops, and leaves the log of the first one as it is."""
    pytest.importorskip("fcntl")
    hub.run(1)
    # Opening it here and closing it again would end the claim.
    size = (hub.folder / "log.mpm").stat().st_size
    program = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from fakes import FakeHub\n"
        "FakeHub(sys.argv[2]).run(1)"
    )
    arguments = [sys.executable, "-c", program, str(Path(__file__).parent), str(hub.folder)]
    second = subprocess.run(arguments, capture_output=True, text=True)
    assert second.returncode == 1 and "another run is writing to" in second.stderr
    assert (hub.folder / "log.mpm").stat().st_size == size
    hub.output.log.close()
    assert subprocess.run(arguments).returncode == 0
