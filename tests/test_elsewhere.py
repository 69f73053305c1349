"""Studies on other machines: Dask, MPI; workers that are lost; what travels with a case."""

import json
import multiprocessing
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from argparse import Namespace
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import ExitStack, closing, suppress
from importlib.util import find_spec
from pathlib import Path

import pandas
import pytest
from selection import few
from test_sampling import SCRIPT

from karamelo_py.app.cli import main
from karamelo_py.app.studies import elsewhere, variables
from karamelo_py.app.studies.case import CaseOutcome, Launch
from karamelo_py.compiler import files as cache
from karamelo_py.script.errors import ScriptError

TIMES = ["seconds", "cpu_seconds", "seconds_spread", "particle_steps_per_s", "peak_memory_mib"]
OF_MACHINES = [*TIMES, "wall_s", "folder", "machine"]
REAL = sys.executable  # before tests replace it
WORDS = ["-var", "a=1:2:3", "-record", "v_x", "-jobs", "2"]

pytestmark = [
    pytest.mark.xdist_group("machines"),
    pytest.mark.skipif(find_spec("distributed") is None, reason="no Dask"),
]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    (tmp_path / "in.lin").write_text(SCRIPT, encoding="utf-8")
    return tmp_path


@pytest.fixture(scope="module")
def _dask():
    """Address of a scheduler, and a way to start processes that have Dask at hand."""
    from distributed import LocalCluster
    from machines import work

    servers = multiprocessing.get_context("forkserver")
    servers.set_forkserver_preload(["distributed", "karamelo_py.app.studies.elsewhere"])
    with LocalCluster(n_workers=0, dashboard_address=None, silence_logs=60) as cluster:
        yield cluster.scheduler_address, lambda *args: servers.Process(target=work, args=args)


@pytest.fixture
def scheduler(_dask, tmp_path, _forking):
    """Address of a scheduler with two workers."""
    address, worker = _dask
    folder, workers = tmp_path / "machines", []
    for place in (folder / "one", folder / "two"):
        place.mkdir(parents=True)
        workers.append(worker(address, str(place), _forking))
        workers[-1].start()
    yield Namespace(address=address, workers=workers, folder=folder)
    for process in workers:
        process.kill()
        process.join()


def numbers(path):
    """The bytes of a table without times and machines."""
    table = pandas.read_csv(path, dtype=str)
    return table.drop(columns=OF_MACHINES).to_csv()


@pytest.mark.usefixtures("starts_are_cheap")
@pytest.mark.parametrize("shared", [False, True])
def test_a_killed_worker_changes_nothing(folder, scheduler, monkeypatch, capsys, shared):
    """SIGKILL midway; the table is that of one machine, and what -keep names comes back."""
    text = SCRIPT.replace("run(1)", "dump(d, all, particle, 1, d.*.txt, x)\nrun(1)")
    (folder / "in.lin").write_text(text, encoding="utf-8")
    if not shared:  # as if the machines had no folder in common
        monkeypatch.setattr(Path, "touch", lambda path: None)

    def kill():
        while not list(folder.glob("far/*/run.json")):
            time.sleep(0.02)
        scheduler.workers[0].kill()

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    words = [*WORDS, "-on", scheduler.address, "-keep", "d.1*", "-o", "far.csv"]
    assert main(["sweep", "in.lin", *words]) == 0
    killer.join(10)
    assert not killer.is_alive()
    assert main(["sweep", "in.lin", *WORDS, "-o", "here.csv"]) == 0
    assert numbers("far.csv") == numbers("here.csv")
    assert (pandas.read_csv("far.csv").machine == os.uname().nodename).all()
    made = json.loads((folder / "far.json").read_text("utf-8"))
    assert made["machines"][os.uname().nodename]["versions"]["numba"]
    kept = folder / "far" / "a=2"
    assert {path.name for path in kept.iterdir()} == {*elsewhere.RETURNED, "d.1.txt"}
    assert sorted(path.name for path in (folder / "far").iterdir()) == ["a=1", "a=1.5", "a=2"]
    sent = [*scheduler.folder.rglob("in.lin")]
    assert not sent if shared else 1 <= len(sent) <= 2
    capsys.readouterr()
    assert main(["sweep", "in.lin", *words]) == 0
    assert "; 3 were known" in capsys.readouterr().out


@pytest.mark.usefixtures("starts_are_cheap")
@pytest.mark.parametrize("size", few((2, 3), 2))
def test_a_pool_of_mpi(folder, size):
    pytest.importorskip("mpi4py")
    start = shutil.which("mpiexec", path=str(Path(REAL).parent)) or "mpiexec"
    if not shutil.which(start):
        pytest.skip("no mpiexec")
    program = "from karamelo_py.app.start import main\nif __name__ == '__main__':\n    main()\n"
    (folder / "program.py").write_text(program, encoding="utf-8")
    root = ["--allow-run-as-root"] if os.geteuid() == 0 else []
    command = [start, *root, "--oversubscribe", "-n", str(size), REAL, "-m"]
    command += ["mpi4py.futures", "program.py", "sweep", "in.lin", *WORDS, "-on", "mpi"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert main(["sweep", "in.lin", *WORDS, "-o", "here.csv"]) == 0
    assert numbers("sweep.csv") == numbers("here.csv")


SUBMIT = """#!/bin/sh
cat "$@" > job.$$.sh
setsid sh job.$$.sh > job.$$.txt 2>&1 &
echo "Submitted batch job <$!.host>"
"""
QUEUES = [
    ("slurm", "sbatch", "scancel"),
    pytest.param("pbs", "qsub", "qdel", marks=pytest.mark.full),
    pytest.param("lsf", "bsub", "bkill", marks=pytest.mark.full),
]


@pytest.mark.usefixtures("starts_are_cheap")
@pytest.mark.parametrize(("queue", "submit", "cancel"), QUEUES)
def test_a_queue_of_jobs(folder, monkeypatch, queue, submit, cancel):
    """The queue starts jobs on this machine at once; bsub reads their scripts from its input."""
    if find_spec("dask_jobqueue") is None:  # importing it here would take over Ctrl-C
        pytest.skip("no dask-jobqueue")
    import dask

    (folder / "bin").mkdir()
    for name, text in (submit, SUBMIT), (cancel, '#!/bin/sh\nkill -- "-$1"\n'):
        (folder / "bin" / name).write_text(text, encoding="utf-8")
        (folder / "bin" / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder / 'bin'}:{os.environ['PATH']}")
    dask.config.refresh()  # defaults of dask-jobqueue that the end of an earlier set has removed
    job = {"cores": 1, "memory": "1GB", "interface": "lo", "python": REAL, "death-timeout": 30}
    with dask.config.set({f"jobqueue.{queue}.{name}": value for name, value in job.items()}):
        assert main(["sweep", "in.lin", *WORDS, "-jobs", "1", "-on", queue, "-o", "far.csv"]) == 0
    (script,) = folder.glob("job.*.sh")
    assert "distributed.cli.dask_worker" in script.read_text("utf-8")
    assert main(["sweep", "in.lin", *WORDS, "-o", "here.csv"]) == 0
    assert numbers("far.csv") == numbers("here.csv")


@pytest.mark.skipif(sys.platform != "linux", reason="finds processes in /proc")
@pytest.mark.parametrize("end", ["KILL", "INT"])
def test_a_study_that_is_killed_leaves_no_process(folder, end):
    """SIGKILL of the study alone; Ctrl-C of its group ends within seconds.

    Without Dask: test_who_writes.py.
    """
    text = SCRIPT.replace("run(1)", "run(1000000000)").replace("a + 2*b", "1e-12*a")
    (folder / "in.long").write_text(text, encoding="utf-8")
    words = ["sweep", "in.long", "-var", "a=1,2", "-record", "v_x", "-jobs", "1", "-on", "local"]
    code = "from karamelo_py.app.start import main; raise SystemExit(main())"
    study = subprocess.Popen(
        [REAL, "-c", code, *words], start_new_session=True, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )  # fmt: skip

    known = study.pid, os.getpid()

    def descendants():
        found = [int(one) for one in os.listdir("/proc") if one.isdigit() and int(one) not in known]
        return [one for one in found if works_in(one, folder)]

    while not [*folder.glob("sweep/*/run.json")] and study.poll() is None:
        time.sleep(0.05)
    assert descendants()
    (os.killpg if end == "INT" else os.kill)(study.pid, getattr(signal, f"SIG{end}"))
    assert study.wait(20) == (130 if end == "INT" else -signal.SIGKILL)
    said = study.stderr.read().decode()
    assert "Traceback" not in said and ("interrupted" in said) == (end == "INT")
    for _ in range(100):
        if not descendants():
            break
        time.sleep(0.1)
    assert not descendants()


def works_in(pid, folder):
    with suppress(OSError):
        return Path(f"/proc/{pid}/cwd").readlink().is_relative_to(folder)
    return False


def parcel_of(path, **values):
    script = variables.ScriptFiles(path)
    launch = Launch(path, texts=script.texts())
    return elsewhere.packed(script, launch, values, (), path.parent)


def place_of(folder, pool, size=1, workers=dict):
    parcel = parcel_of(folder / "in.lin")
    return elsewhere.Elsewhere(parcel, dict, pool, size, ExitStack(), workers)


def test_the_files_of_a_script_travel_with_it(folder):
    """Includes, tables of formulas and files named by variables, where they lie to each other."""
    (folder / "parts").mkdir()
    (folder / "parts" / "more.txt").write_text('k = 1\nload_file = "loads.csv"\n', "utf-8")
    (folder / "parts" / "loads.csv").write_text("x,y\n0,1\n", "utf-8")
    (folder / "store.msh").write_text("mesh", "utf-8")
    (folder / "body.msh").symlink_to(folder / "store.msh")
    (folder / "mydrag.py").write_text("import numpy, helper\nclass Drag: pass", "utf-8")
    (folder / "helper.py").write_text("from mydrag import Drag", "utf-8")
    (folder / "secret.txt").write_text("not named", "utf-8")
    text = 'mesh = "none"\ninclude(parts/more.txt)\nfix(air, mydrag.Drag, all)\n' + SCRIPT
    (folder / "in.lin").write_text(
        text + "dump(d, all, particle, 1, parts/loads.csv, x)\n", "utf-8"
    )
    parcel = parcel_of(folder / "in.lin", mesh=["body.msh"])
    names = {name for name, _ in parcel.files}
    assert names == {
        "in.lin",
        "mydrag.py",
        "helper.py",
        "parts/more.txt",
        "parts/loads.csv",
        "body.msh",
    }


@pytest.mark.usefixtures("starts_are_cheap")
def test_a_machine_with_other_versions_refuses_the_case(folder):
    parcel = parcel_of(folder / "in.lin")
    others = dict(parcel.versions) | {"numba": "0.1", "my_plugin": "12345678"}
    other = parcel._replace(versions=tuple(others.items()), mark="other")
    result = elsewhere.run_sent(other, {"a": "1"}, "1")
    assert result.outcome.status == "failed" and not result.files
    assert "for 0.1, my_plugin none for 12345678" in result.outcome.reason
    assert "numba" in result.outcome.reason
    assert elsewhere.run_sent(parcel, {"a": "1"}, "1").asks
    result = elsewhere.run_sent(parcel, {"a": "1"}, "1", {"in.lin": SCRIPT.encode()})
    assert result.outcome.status == "done" and set(result.files) == set(elsewhere.RETURNED)


def test_a_plugin_of_other_content_is_another_version(folder, monkeypatch):
    """Of installed modules that a script names, and of packages that offer styles."""
    monkeypatch.syspath_prepend(folder / "site")
    (folder / "site").mkdir()
    text = SCRIPT.replace("set_dt", "fix(air, elsewhere_drag.Drag, all)\nset_dt")
    (folder / "in.lin").write_text(text, encoding="utf-8")
    found = []
    for content in ("class Drag: pass", "class Drag: area = 2"):
        (folder / "site" / "elsewhere_drag.py").write_text(content, encoding="utf-8")
        found.append(dict(parcel_of(folder / "in.lin").versions)["elsewhere_drag"])
    assert found[0] != found[1] and len(found[0]) == 8


class Losing(ThreadPoolExecutor):
    """Loses the first cases that it gets."""

    def __init__(self, lost):
        super().__init__(1)
        self.lost = lost

    def submit(self, function, *arguments):
        self.lost -= 1
        if self.lost >= 0:
            return super().submit(lambda: (_ for _ in ()).throw(MemoryError("worker is gone")))
        return super().submit(function, *arguments)


@pytest.mark.usefixtures("starts_are_cheap")
@pytest.mark.parametrize(("lost", "status"), [(2, "done"), (3, "killed")])
def test_a_lost_case_is_tried_twice_more(folder, lost, status):
    with Losing(lost) as pool:
        place = place_of(folder, pool)
        outcome = place.submit({"a": "1"}, folder / "case").result(60)
    assert outcome.status == status
    assert status == "done" or outcome.reason == "lost 3 times: MemoryError: worker is gone"


@pytest.mark.usefixtures("starts_are_cheap")
def test_a_scheduler_that_has_gone_ends_the_case(folder):
    with Losing(1) as pool:
        place = place_of(folder, pool, workers=lambda: next(iter(())))
        outcome = place.submit({"a": "1"}, folder / "case").result(60)
        assert place.submit({"a": "2"}, folder / "2").result(1).status == "killed"
    assert outcome.status == "killed"
    assert outcome.reason.startswith("MemoryError: worker is gone; not sent again: StopIteration")


class Answering(ThreadPoolExecutor):
    """Calls a function for each case, with the preferred workers."""

    def __init__(self, answer):
        super().__init__(1)
        self.answer = answer

    def submit(self, function, parcel, case, name, workers=(), **_):
        return super().submit(self.answer, workers)


def test_only_a_full_disk_here_ends_the_study(folder, monkeypatch):
    def full(_):
        raise ScriptError("cannot write case.json: No space left on device")

    with Answering(full) as pool:
        place = place_of(folder, pool)
        outcome = place.submit({}, folder / "case").result(10)
    assert outcome.status == "killed" and "lost 3 times: ScriptError: cannot" in outcome.reason
    done = elsewhere.Returned(CaseOutcome("done"), {"log.mpm": b""}, {})
    monkeypatch.setattr(Path, "write_bytes", lambda *_: (_ for _ in ()).throw(OSError("full")))
    with Answering(lambda _: done) as pool, pytest.raises(ScriptError, match="full"):
        place = place_of(folder, pool)
        place.submit({}, folder / "case").result(10)


@pytest.mark.parametrize(("willing", "status"), [(["b"], "done"), ([], "failed")])
def test_a_worker_with_other_versions_is_avoided(folder, willing, status):
    def answer(workers):
        if not workers:
            return elsewhere.Returned(CaseOutcome("failed", "far has 2"), {}, {}, "a")
        return elsewhere.Returned(CaseOutcome("done"), {}, {})

    workers = dict.fromkeys(["a", *willing], 1)
    with Answering(answer) as pool:
        place = place_of(folder, pool, 2, lambda: workers)
        assert place.submit({}, folder / "case").result(10).status == status
    assert place.refusing == {"a"} and place.size == (1 if willing else 2)


def test_leaving_does_not_wait_for_a_case(folder):
    free = threading.Event()
    with Answering(lambda _: free.wait(20) and 1 / 0) as pool:
        place = place_of(folder, pool)
        outcome = place.submit({}, folder / "case")
        place.close()
        assert not outcome.done()
        free.set()
        ended = outcome.result(10)
    assert ended.status == "killed", ended


@pytest.mark.usefixtures("starts_are_cheap")
def test_kernels_of_one_machine_reach_another_once(folder, monkeypatch):
    """A machine that lacks kernels asks for them, and finds them in its cache afterwards."""
    caches = iter(["one", "two", "two"])
    sent = []

    class Machines(ThreadPoolExecutor):
        def submit(self, function, parcel, case, name, *contents):
            if not contents:
                monkeypatch.setenv("KARAMELO_PY_CACHE", str(folder / next(caches)))
                elsewhere.SITES.clear()
            sent.append((case["a"], sorted({**contents[0]} if contents else ())))
            result = function(parcel, case, name, *contents)
            kernel = cache.folder() / "f.0123.kernel"
            if not kernel.exists():
                cache.write(kernel, b"machine code")
            future = Future()
            future.set_result(result._replace(kernels={"f.0123.kernel": cache.read(kernel)}))
            return future

    monkeypatch.setattr(Path, "touch", lambda path: None)
    with Machines(1) as pool, closing(place_of(folder, pool)) as place:
        for a in "123":
            assert place.submit({"a": a}, folder / a).result(60).status == "done"
    both = ["f.0123.kernel", "in.lin"]
    assert sent == [("1", []), ("1", ["in.lin"]), ("2", []), ("2", both), ("3", []), ("3", both)]


@pytest.mark.parametrize("answer", [b"HTTP/1.1 400 Bad Request\r\nServer: x\r\n\r\n", b""])
def test_something_else_than_a_scheduler_answers(folder, monkeypatch, capsys, answer):
    monkeypatch.setattr(elsewhere, "PATIENCE", 0.1)
    with socket.create_server(("127.0.0.1", 0)) as server:
        held = []

        def serve():
            while True:
                held.append(server.accept()[0])
                if answer:
                    held.pop().sendall(answer)

        threading.Thread(target=serve, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        assert main(["sweep", "in.lin", *WORDS, "-on", address]) == 1
    assert f"no scheduler answers at {address}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("where", "says"),
    [
        ("mars", "expected: local, tcp://HOST:PORT of a Dask scheduler"),
        ("tcp://127.0.0.1:9", "no scheduler answers at tcp://127.0.0.1:9"),
        ("tpc://127.0.0.1:9", "-on tpc://127.0.0.1:9"),
        ("mpi", "there is one process"),
        ("slurm", "error: -on slurm"),
    ],
)
def test_places_that_are_refused(folder, capsys, monkeypatch, where, says):
    """Ctrl-C remains the program's: dask-jobqueue takes it over when it is imported."""
    monkeypatch.setattr(elsewhere, "PATIENCE", 0.3)
    interrupt = signal.getsignal(signal.SIGINT)
    assert main(["sweep", "in.lin", *WORDS, "-on", where]) == 1
    assert signal.getsignal(signal.SIGINT) is interrupt
    err = capsys.readouterr().err
    assert says in err and "Traceback" not in err
