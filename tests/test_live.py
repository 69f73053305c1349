"""Live pages: a study, a run, a folder; served to who knows the address, and changing no bit."""

import json
import os
import re
import shutil
import socket
import subprocess
import threading
import time
import urllib.error
import urllib.request
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from karamelo_py import Simulation
from karamelo_py.app.cli import main
from karamelo_py.app.live import folder as folder_pages
from karamelo_py.app.live import frames
from karamelo_py.app.live import run as run_pages
from karamelo_py.app.live import server as servers
from karamelo_py.app.live.folder import FolderPage
from karamelo_py.app.live.frames import Frame, KeptFrames
from karamelo_py.app.live.server import Server
from karamelo_py.app.live.study import StudyPage
from karamelo_py.app.studies import sweep as studies
from karamelo_py.output.console import Console
from karamelo_py.script.errors import ScriptError

pytest.importorskip("plotly")

BAR = """
method(ulmpm, FLIP, linear, 1)
dimension(2, 0, 4, 0, 1, 0.5)
region(bar, block, 0, 3, 0, 1)
material(soft, linear, 1, 1, 0.3)
solid(bar, region, bar, 2, soft, 0.5, 0)
group(all_points, particles, region, bar, solid, bar)
fix(v, initial_velocity_particles, all_points, 0.01, NULL)
compute(Ek, kinetic_energy, all_points)
log_modify(custom, step, dt, time, Ek)
set_output(2)
dump(points, all, particle, 4, points.*.txt, x, y, z, vx, seq)
"""


def get(address, name="", **words):
    more = "&".join(f"{k}={v}" for k, v in words.items())
    with urllib.request.urlopen(f"{address}{name}?{more}", timeout=20) as answer:
        return answer.read()


def post(address, name):
    request = urllib.request.Request(address + name, data=b"", method="POST")
    urllib.request.urlopen(request, timeout=20).read()


class Events:
    """What a page is told, event after event."""

    def __init__(self, address):
        self.stream = urllib.request.urlopen(address + "events", timeout=60)

    def next(self):
        while not (line := self.stream.readline()).startswith(b"data: "):
            assert line, "the page was told that all is over"
        return json.loads(line[6:])

    def until(self, holds):
        while not holds(told := self.next()):
            pass
        return told


@contextmanager
def in_background(act):
    thread = threading.Thread(target=act, daemon=True)
    thread.start()
    yield thread
    thread.join(60)
    assert not thread.is_alive()


@pytest.fixture
def simulation(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with Simulation(BAR, out=tmp_path) as made:
        yield made


def test_a_page_answers_only_behind_its_secret_word(simulation):
    page = simulation.live()
    assert page.address.startswith("http://127.0.0.1:")
    assert b"<title>karamelo-py" in get(page.address)
    assert len(get(page.address, "plotly.js")) > 1e6
    root, secret = page.address.rstrip("/").rsplit("/", 1)
    assert len(secret) > 20
    for wrong in (f"{root}/", f"{root}/{secret[:-1]}/", page.address + "nothing"):
        with pytest.raises(urllib.error.HTTPError, match="404"):
            get(wrong)
    with pytest.raises(urllib.error.HTTPError, match="404"):
        get(page.address, "frame", k="abc")
    with pytest.raises(urllib.error.HTTPError, match="404"):
        post(page.address, "rm")
    post(page.address, "stop")  # no run goes on
    assert page.address in page._repr_html_()
    page.close()
    with pytest.raises(urllib.error.URLError):
        get(page.address)


def ask(page, text):
    """What the server answers to some bytes, after which nothing more is sent."""
    port, path = re.match(r"http://127\.0\.0\.1:(\d+)(/\S+/)", page.address).groups()
    with socket.create_connection(("127.0.0.1", int(port)), timeout=1) as link:
        link.sendall(text.replace("PAGE", path).replace("PORT", port).encode())
        link.shutdown(socket.SHUT_WR)  # or the server would wait for a further request
        found = b""
        with suppress(TimeoutError):
            while part := link.recv(1 << 16):
                found += part
    return found.decode("latin-1")


def test_what_other_sites_ask_is_refused(simulation):
    """A site that has its name stand for this machine, or sends a form here, knows no more."""
    page = simulation.live()
    get_page, post_go = "GET PAGE HTTP/1.1\r\nHost: {}\r\n{}\r\n", "POST PAGEgo HTTP/1.1\r\n"
    for host in ("127.0.0.1:PORT", "localhost:8888", "[::1]:1"):
        assert ask(page, get_page.format(host, "")).startswith("HTTP/1.1 200")
    for host in ("evil.example", "127.0.0.1.evil.example", "[::1"):
        assert ask(page, get_page.format(host, "")).startswith("HTTP/1.1 403")
    for origin, status in (
        ("http://localhost:1", 200),
        ("http://evil.example", 403),
        ("null", 403),
    ):
        said = ask(page, f"{post_go}Host: localhost:1\r\nOrigin: {origin}\r\n\r\n")
        assert said.startswith(f"HTTP/1.1 {status}")
    body = "GET /x HTTP/1.1\r\nHost: localhost\r\n\r\n"
    for length in (len(body), 10**12):  # what follows is no further request
        said = ask(page, f"{post_go}Host: localhost\r\nContent-Length: {length}\r\n\r\n{body}")
        assert said.count("HTTP/1.1 ") == 1
    long = f"GET PAGEframe?k={'9' * 4400} HTTP/1.1\r\nHost: localhost\r\n\r\n"
    assert ask(page, long).startswith("HTTP/1.1 404")


def test_what_a_page_may_load(simulation):
    """Nothing from elsewhere; a notebook alone may show it within a page of its own."""
    page = simulation.live()
    for framed in (True, False):
        page._page.server.framed = framed
        head = ask(page, "GET PAGE HTTP/1.1\r\nHost: localhost\r\n\r\n").partition("\r\n\r\n")[0]
        assert "default-src 'none'" in head and "connect-src 'self'" in head
        assert ("frame-ancestors 'none'" in head) == ("X-Frame-Options: DENY" in head) != framed
        assert "X-Content-Type-Options: nosniff" in head and "Referrer-Policy" in head
        assert "Python" not in head


def test_connections_are_few_and_end(simulation, monkeypatch):
    """What the run opens is not taken by connections that say nothing; nor are pages, for ever."""
    monkeypatch.setattr(servers, "MOST", 4)
    page = simulation.live()
    port = page._page.server._http.server_address[1]
    held = [socket.create_connection(("127.0.0.1", port), timeout=30) for _ in range(12)]
    for link in held[4:]:
        with suppress(ConnectionResetError):
            assert link.recv(1) == b""
    assert len(page._page.server._http._open) == 4
    for link in held:
        link.close()


def test_a_page_that_takes_nothing_is_closed(simulation, monkeypatch):
    """A laptop that sleeps behind ssh -L must not hold a job that is over."""
    monkeypatch.setattr(servers, "STUCK", 0.5)
    page = simulation.live()
    server = page._page.server
    port, path = re.match(r"http://127\.0\.0\.1:(\d+)(/\S+/)", page.address).groups()
    server.news = lambda seen: (1, {"much": "x" * 10_000_000})
    with socket.socket() as link:
        link.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        link.connect(("127.0.0.1", int(port)))
        link.sendall(f"GET {path}events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        end = time.monotonic() + 20
        while not server._http._open and time.monotonic() < end:
            time.sleep(0.01)
        while server._http._open:
            assert time.monotonic() < end
            time.sleep(0.05)
    assert not server.watched


def test_a_page_without_a_sign_does_not_hold_a_job(simulation, monkeypatch):
    """Few news fit into the buffers of a page that reads nothing; open pages send a sign."""
    monkeypatch.setattr(servers, "AWAY", 0.6)
    monkeypatch.setattr(servers, "BEAT", 0.1)
    page = simulation.live()
    server = page._page.server
    port, path = re.match(r"http://127\.0\.0\.1:(\d+)(/\S+/)", page.address).groups()
    with socket.socket() as link:
        link.connect(("127.0.0.1", int(port)))
        link.sendall(f"GET {path}events HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
        waiting = threading.Thread(target=server.stay, daemon=True)
        waiting.start()
        for _ in range(6):
            time.sleep(0.2)
            urllib.request.urlopen(f"{page.address}here", data=b"")
        assert waiting.is_alive() and server.watched
        waiting.join(10)
        assert not waiting.is_alive() and server.watched
    page.close()
    while server.watched:
        time.sleep(0.05)


def test_pages_end_with_their_simulation(tmp_path):
    before = threading.active_count()
    for _ in range(3):
        with Simulation(BAR, out=tmp_path) as made:
            page = made.live()
        page.close()  # once more
    assert threading.active_count() == before


def test_a_long_run_is_shown_by_some_of_its_rows(simulation, monkeypatch):
    """A page that opens late gets so many rows, the first and the last among them."""
    monkeypatch.setattr(run_pages, "WINDOW", 5)
    page = simulation.live()
    simulation.run(40)
    told = Events(page.address).next()
    assert [row["step"] for row in told["rows"]] == [0, 10, 20, 30, 40]


def test_all_that_pages_load_is_there_and_can_be_read(simulation, tmp_path):
    """The files of both pages, whole; their code is that of JavaScript (where Node.js is there)."""
    run, study = simulation.live(), StudyPage(simulation.hub.folder / "in.bar", ["N"], ["Ek"])
    source = Path(run_pages.__file__).parent
    for address, name, more in (
        (run.address, "run.html", ["plotly.js", "points.js"]),
        (study.server.address, "study.html", ["plotly.js"]),
    ):
        page = get(address)
        assert page == (source / name).read_bytes()
        text = page.decode()
        assert re.findall(r'<script src="(.*?)">', text) == more
        assert get(address, "points.js") == (source / "points.js").read_bytes()
        codes = {"points.js": get(address, "points.js").decode()}
        codes["inline.js"] = "".join(re.findall(r"<script>(.*?)</script>", text, re.S))
        for file, code in codes.items():
            assert len(code) > 1000, file
            (tmp_path / file).write_text(code, encoding="utf-8")
            if shutil.which("node"):
                subprocess.run(["node", "--check", file], cwd=tmp_path, check=True)
    run.close()
    study.server.close()


def test_a_run_is_followed_and_keeps_its_bits(simulation, tmp_path):
    page = simulation.live()
    events = Events(page.address)
    simulation.run(9)
    told = events.until(lambda told: told["frames"] and told["frames"][-1][1] == 9)
    assert [frame[1] for frame in told["frames"]] == [0, 2, 4, 6, 8, 9]
    number, step, _, column, count = told["frames"][-1]
    assert (step, column, count) == (9, "seq", 48)
    numbers = np.frombuffer(get(page.address, "frame", k=number), np.float32).reshape(3, 48)
    points = simulation.points
    assert np.array_equal(numbers, np.float32([points["x"], points["y"], points["seq"]]))
    first = Events(page.address).next()  # of a page that opens later
    assert first["about"]["dimension"] == 2 and "vx" in first["about"]["columns"]
    assert [row["step"] for row in first["rows"]] == [0, 2, 4, 6, 8, 9]
    assert first["rows"][-1]["log"]["Ek"] == simulation.log["Ek"][-1]
    assert {row["limit"] for row in first["rows"]} <= {"waves", "speed", "end"}
    page.close()
    simulation.run(5)  # without the page
    alone = tmp_path / "alone"
    alone.mkdir()
    with Simulation(BAR, out=alone) as other:
        other.run(9)
        other.run(5)
        for name in ("x", "vx", "seq"):
            assert np.array_equal(other.points[name], simulation.points[name])
    assert (alone / "log.mpm").read_bytes() == (tmp_path / "log.mpm").read_bytes()


def test_the_balance_is_told_once_it_is_a_mean(simulation):
    page = simulation.live()
    simulation.run(40)
    rows = Events(page.address).next()["rows"]
    assert all(row["gain"] is None for row in rows if row["step"] < 20)
    known = [row["gain"] for row in rows if row["step"] > 21]
    assert len(known) > 5 and np.allclose(known, 0, atol=0.1)  # percent; the bar flies as a whole
    page.close()


def test_a_run_is_held_taken_on_and_coloured_anew(simulation):
    page = simulation.live()
    post(page.address, "pause")
    events = Events(page.address)
    with in_background(lambda: simulation.run(6)):
        told = events.until(lambda told: told["frames"])
        assert told["paused"] and [frame[1] for frame in told["frames"]] == [0]
        get_column = page.address + "column?name=vx"
        urllib.request.urlopen(urllib.request.Request(get_column, data=b""), timeout=20)
        told = events.until(lambda told: told["frames"] and told["frames"][-1][3] == "vx")
        assert [frame[1] for frame in told["frames"]] == [0]
        post(page.address, "step")
        told = events.until(lambda told: len(told["frames"]) == 2)
        assert told["frames"][-1][1] == 2
        post(page.address, "go")
    assert simulation.step == 6
    get_column = page.address + "column?name=vy"  # between two runs, or when all is over
    urllib.request.urlopen(urllib.request.Request(get_column, data=b""), timeout=20)
    assert events.until(lambda told: told["frames"][-1][3] == "vy")["frames"][-1][1] == 6
    page.close()


def test_a_page_that_is_closed_holds_no_run(simulation, monkeypatch):
    monkeypatch.setattr(run_pages, "GRACE", 0.1)
    page = simulation.live()
    post(page.address, "pause")
    simulation.run(4)
    assert simulation.step == 4
    page.close()


def test_dumps_without_points_are_passed_over(tmp_path):
    (tmp_path / "d.0.txt").write_text(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n0\nITEM: BOX BOUNDS sm sm sm\n0 1\n0 1\n0 1\n"
        "ITEM: ATOMS id x y z\n",
        encoding="utf-8",
    )
    (tmp_path / "log.mpm").write_text("Step Time Ek\n0 0 1\n", encoding="utf-8")
    page = FolderPage(tmp_path)
    told = Events(page.server.address).next()
    assert told["frames"] == [] and len(told["rows"]) == 1
    empty = (tmp_path / "d.0.txt").read_text(encoding="utf-8")
    full = empty.replace("\n0\nITEM: NUMBER", "\n1\nITEM: NUMBER").replace("ATOMS\n0", "ATOMS\n1")
    for states in (1, 2):  # in one file, which grows
        text = empty + (full + "1 0.5 0.5 0\n") * states
        (tmp_path / "d.0.txt").write_text(text, encoding="utf-8")
        os.utime(tmp_path / "d.0.txt", (states, states))
        assert page.look()
        assert len(Events(page.server.address).next()["frames"]) == states
    page.server.close()


def test_a_warning_is_a_flag(simulation):
    page = simulation.live()
    simulation.hub.warn("water runs uphill")
    flags = Events(page.address).next()["flags"]
    assert "water runs uphill" in flags[0]["text"] and flags[0]["time"] == 0
    page.close()


@pytest.mark.parametrize("kind", [ScriptError, OSError, SystemExit])
def test_an_error_that_ends_a_run_is_a_flag(simulation, kind):
    page = simulation.live()
    with pytest.raises(kind):
        try:
            raise kind("water runs out")
        finally:
            page._page.end()
    told = page._page._news(0)[1]
    assert told["over"] and "water runs out" in told["flags"][0]["text"]
    assert told["ended"] == "failed" and "water runs out" in told["failed"]


@pytest.mark.parametrize(
    ("terminal", "end", "waits"), [(True, "", 1), (False, "", 0), (True, "run(none)\n", 0)]
)
def test_a_page_waits_to_be_opened_at_a_terminal(tmp_path, monkeypatch, terminal, end, waits):
    """Not in a batch job, nor before an error is told."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.bar").write_text(BAR + "run(2)\n" + end, encoding="utf-8")
    monkeypatch.setattr(Console, "terminal", terminal)
    stayed = []
    monkeypatch.setattr(Server, "stay", lambda server: stayed.append(server.address))
    assert main(["in.bar", "--live", "--quiet", "--threads", "1"]) == bool(end)
    assert len(stayed) == waits


def test_a_script_is_run_with_a_page_that_stops_it(tmp_path, monkeypatch, capsys):
    """As Ctrl-C does: all is written, and the exit status says so."""
    from karamelo_py.app.live.run import RunPage

    monkeypatch.chdir(tmp_path)
    (tmp_path / "in.bar").write_text(BAR + "run(100000)\n", encoding="utf-8")
    stopped = SimpleNamespace(at=None)
    write = RunPage.write

    def stopping(page):
        write(page)
        if page.hub.update.step >= 4 and stopped.at is None:
            stopped.at = page.hub.update.step
            post(page.server.address, "stop")

    ended = []
    monkeypatch.setattr(RunPage, "write", stopping)
    end = RunPage.end
    monkeypatch.setattr(
        RunPage, "end", lambda page, **how: (end(page, **how), ended.append(page._ended))
    )
    assert main(["in.bar", "--live", "--threads", "1"]) == 130
    said = capsys.readouterr()
    assert "live: http://127.0.0.1" in said.out
    assert "interrupted: the log and the dumps are complete" in said.err
    (tmp_path / "in.end").write_text(BAR + "run(2)\n", encoding="utf-8")
    assert main(["in.end", "--live"]) == 0
    assert ended == ["stopped", "finished"]
    assert main(["in.bar", "--live", "--ranks", "2"]) == 1
    assert "a live page shows a run of one process" in capsys.readouterr().err


def test_frames_are_bounded(monkeypatch):
    monkeypatch.setattr(frames, "COUNT", 8)
    monkeypatch.setattr(frames, "SEEN", 0)
    columns = {name: np.arange(25.0) for name in ("x", "y", "seq")}
    kept = KeptFrames()
    for step in range(30):
        kept.add(Frame.of_columns(step, 0.1 * step, "xy", "seq", read=columns.__getitem__))
    listed = kept.listed()
    states = [0, 4, 8, 12, 16, 20, 24, 28, 29]
    assert [frame[1] for frame in listed] == states  # evenly, and the newest
    assert listed[-1][4] == 25
    monkeypatch.setattr(frames, "SEEN", 1e9)
    for step in (30, 31):  # a page may be about to ask for them
        kept.add(Frame.of_columns(step, 0.1 * step, "xy", "seq", read=columns.__getitem__))
    assert [frame[1] for frame in kept.listed()] == [*states, 30, 31]
    assert kept.answer({"k": "-1"}) is None
    for column in ("x", "y"):  # chosen one after the other, where no state came in between
        kept.replace_last(lambda column=column: Frame(31, 3.1, column, np.zeros((3, 25)), 25))
    assert [frame[1] for frame in kept.listed()] == [*states, 30, 31]
    assert kept.listed()[-1][0] == 31 and kept.listed()[-1][3] == "y"


def test_points_are_thinned_alike_in_each_state(monkeypatch):
    """All of a small solid, the same share of large ones; the same points wherever they lie."""
    monkeypatch.setattr(frames, "POINTS", 10_000)
    solid = np.repeat([1, 2, 3], [60_000, 300, 40_000])
    columns = {"id": 1 + np.arange(len(solid)), "type": solid, "x": np.linspace(0, 1, len(solid))}
    columns["y"] = columns["z"] = 0 * columns["x"]
    first = Frame.of_columns(0, 0.0, "xyz", "id", read=columns.__getitem__)
    assert first.of == 100_300 and first.numbers.dtype == np.float32
    taken = np.bincount(solid[first.numbers[3].astype(int) - 1])
    assert taken[2] == 300
    assert np.allclose(taken[[1, 3]], [5820, 3880], atol=240)  # four standard deviations
    places = first.numbers[0][first.numbers[3] <= 60_000]  # even, not the first ones
    assert np.allclose(np.histogram(places, 6)[0], len(places) / 6, atol=125)
    order = np.random.default_rng(3).permutation(len(solid))
    ordered = {n: c[order] for n, c in columns.items()}
    again = Frame.of_columns(1, 0.1, "xyz", "id", read=ordered.get)
    assert np.array_equal(np.sort(again.numbers[3]), first.numbers[3])


def test_a_folder_is_followed(simulation, tmp_path, monkeypatch, capsys):
    simulation.run(4)
    page = FolderPage(tmp_path)
    first = Events(page.server.address).next()
    assert [frame[1] for frame in first["frames"]] == [0, 4]
    assert [row["step"] for row in first["rows"]] == [0, 2, 4]
    assert first["about"]["dimension"] == 2 and not first["about"]["steers"]
    simulation.run(4)
    assert page.look()
    assert not page.look()
    urllib.request.urlopen(
        urllib.request.Request(page.server.address + "column?name=vx", data=b""), timeout=20
    )
    numbers = np.frombuffer(get(page.server.address, "frame", k=2), np.float32).reshape(3, -1)
    assert np.allclose(numbers[2], simulation.points["vx"], rtol=1e-5)
    page.server.close()
    many = FolderPage(tmp_path)
    states = [frame[:2] for frame in Events(many.server.address).next()["frames"]]
    assert states == [[0, 0], [1, 4], [2, 8]]
    many.server.close()
    monkeypatch.setattr(folder_pages, "FILES", 2)
    few = FolderPage(tmp_path)  # the third file is read later
    assert len(Events(few.server.address).next()["frames"]) == 2
    counts = iter(range(100, 109))  # rows of a log that grows all the time

    def pause(_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(folder_pages, "read_log", lambda _: {"Step": np.arange(next(counts))})
        patch.setattr(folder_pages, "time", SimpleNamespace(sleep=pause))
        with pytest.raises(KeyboardInterrupt):
            few.follow()
    assert next(counts) == 101 and len(Events(few.server.address).next()["frames"]) == 3
    few.server.close()
    (tmp_path / "empty").mkdir()
    for name, said in (("empty", "neither a log nor a dump"), ("nowhere", "is not a folder")):
        assert main(["view", "--live", str(tmp_path / name)]) == 1
        assert said in capsys.readouterr().err


def test_a_study_is_followed_and_stopped(tmp_path):
    folder = tmp_path / "N=20"
    folder.mkdir()
    (folder / "err.txt").write_text("warning: much\n", encoding="utf-8")
    (folder / "log.mpm").write_text("Step Time Ek\n0 0 1\n1 0.5 0.25\n", encoding="utf-8")
    page = StudyPage(tmp_path / "in.bar", ["N"], ["Ek"], base=tmp_path)
    address = page.server.address
    row = {"N": "10", "Ek": 0.5, "seconds": float("nan"), "status": "done", "reason": ""}
    row["folder"] = folder.name
    page.follow([], [({"N": "20"}, folder)], [({"N": "10"}, tmp_path, 1.0, "")], of=2, left=None)
    page.follow([row], [], [({"N": "20"}, folder, 0.5, "far")], of=2, left=3.0)
    events = Events(address)
    told = events.next()
    assert told["about"]["names"] == ["N"] and told["left"] == 3.0
    assert told["running"] == [["N = 20", 0.5, "far"]]
    assert told["rows"][0]["seconds"] is None  # which JSON has not
    assert told["cases"] == {"N = 20": {"N": "20"}, "N = 10": {"N": "10"}}
    page.follow([row], [({"N": "30"}, folder)], [({"N": "20"}, folder, 0.7, "")], of=3, left=3.0)
    told = events.until(lambda told: told["cases"])  # only what has come since
    assert told["cases"] == {"N = 30": {"N": "30"}} and not told["rows"]
    known = json.loads(get(address, "run", title="N%20=%2010"))  # of an earlier study
    assert known["said"] == ["warning: much"]
    assert known["command"].endswith("in.bar -var N 10")
    run = json.loads(get(address, "run", title="N%20=%2020"))
    assert run["said"] == ["warning: much"] and run["columns"]["Ek"] == [1, 0.25]
    with pytest.raises(urllib.error.HTTPError):
        get(address, "run", title="../../etc")
    assert not page.stopped.is_set()
    post(address, "stop")
    assert page.stopped.is_set()
    page.server.close()


def test_who_stops_a_study_on_its_page_interrupts_it(
    tmp_path, monkeypatch, capsys, starts_are_cheap
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    (tmp_path / "in.bar").write_text(BAR + "n = 2\nrun(n)\n", encoding="utf-8")
    follow = StudyPage.follow

    def stopping(page, rows, *more, **words):
        follow(page, rows, *more, **words)
        if rows:
            post(page.server.address, "stop")

    monkeypatch.setattr(StudyPage, "follow", stopping)
    words = ["sweep", "in.bar", "-var", "n=2,3,4", "-record", "Ek", "-jobs", "1", "--live"]
    options = parsed(words)
    with pytest.raises(KeyboardInterrupt), ExitStack() as options.ends:
        studies.run(options)
    said = capsys.readouterr()
    assert "live: http://127.0.0.1" in said.out
    assert "1 of 3 runs are in sweep.csv; the same command continues" in said.err


def parsed(words):
    from karamelo_py.app import cli

    parser, _ = cli._parser(words[0])
    return parser.parse_args(words)


def test_pages_in_a_browser(simulation, browser):
    """Points are drawn and moved, news arrive, a click holds the run, another stops the study."""
    page = simulation.live()
    study = StudyPage(simulation.hub.folder / "in.bar", ["N"], ["Ek"])
    row = {"N": "10", "Ek": 0.5, "seconds": 1.0, "status": "failed", "reason": "it broke"}
    row["folder"] = "N=10"
    study.judge(lambda row: {**row, "class": "growing", "why": "Ek grows"}, {"growing": "#f0a53c"})
    study.follow([row], [({"N": "20"}, simulation.hub.folder)], [], of=2)
    simulation.run(4)
    drawn = """() => {
      const gl = picture.gl, [x, y, w, h] = gl.getParameter(gl.VIEWPORT);
      const pixels = new Uint8Array(4 * w * h);
      picture.draw(0); gl.readPixels(x, y, w, h, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      const shown = pixels.filter((value, k) => k % 4 === 2 && value < 200);
      return [picture.n, shown.length, picture.centre[0]]; }"""
    shown = browser.new_page()
    wrong = []
    shown.on("pageerror", lambda error: wrong.append(error))
    shown.goto(page.address)
    shown.get_by_role("status").filter(has_text="step 4").wait_for()
    shown.get_by_text("48 points").wait_for()
    simulation.run(2)
    shown.get_by_role("status").filter(has_text="step 6").wait_for()
    count, blue, centre = shown.evaluate(drawn)
    assert count == 48 and blue > 1000  # pixels that are not yellow or white
    box = shown.locator("#points").bounding_box()
    shown.mouse.move(box["x"] + 300, box["y"] + 200)
    shown.mouse.down()
    shown.mouse.move(box["x"] + 340, box["y"] + 200)
    shown.mouse.up()
    assert shown.evaluate(drawn)[2] < centre  # points went to the right with the hand
    shown.get_by_label("colours").select_option("vx")
    shown.wait_for_function("picture.name === 'vx'")
    shown.get_by_role("button", name="Pause").click()
    shown.get_by_role("button", name="Go on").wait_for()
    shown.goto(study.server.address)
    shown.get_by_label("N = 10: failed").click()
    shown.get_by_text("failed: it broke").wait_for()
    assert shown.evaluate("document.getElementById('chart').data[0].name") == "growing"
    shown.get_by_label("N = 20: waiting").click()
    shown.get_by_text("last line of the log: Step 6,").wait_for()
    going = [({"N": "30"}, simulation.hub.folder, 1.0, "far")]
    study.follow([row, {**row, "N": "20", "status": "done"}], [], going, of=3)
    shown.get_by_label("N = 20: done").wait_for()
    shown.get_by_role("button", name="Stop the study").click()
    assert study.stopped.wait(20)
    study._end()
    shown.get_by_label("N = 30: not run").wait_for()
    assert not wrong
    page.close()
