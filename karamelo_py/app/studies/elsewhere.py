"""Cases of a study on other machines: Dask, its job queues, or MPI.

A case travels as data: the script, its files and the variables. Its log, its record and the files
named by `-keep` come back: no disk is shared.
"""

import re
import shutil
import socket
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, suppress
from functools import lru_cache
from importlib.util import find_spec
from os.path import abspath, commonpath
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any, NamedTuple

from karamelo_py.app.studies.case import KEPT, CaseOutcome, Launch
from karamelo_py.app.studies.variables import QUEUES, WHERE, ScriptFiles
from karamelo_py.output.files import reported
from karamelo_py.output.record import NAME, surroundings
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.syntax import CommandCall

PATIENCE = 10  # seconds for a scheduler to answer
TO_CLOSE = 3  # seconds for connections to close
TRIES = 3
CLASS = re.compile(r"(\w+)\.\w+")  # of a module next to the script
QUOTED = re.compile(r'"([^"\n]*)"')
RETURNED = (KEPT, NAME, "log.mpm", "out.txt", "err.txt")


class Package(NamedTuple):
    script: str  # path below a common folder
    files: tuple[tuple[str, bytes], ...]  # paths below it, and contents
    launch: tuple[int, int, float | None]  # threads, repetitions, limit (s)
    texts: tuple[str, ...]
    keep: tuple[str, ...]  # patterns of further files to return
    versions: tuple[tuple[str, str], ...]


class Returned(NamedTuple):
    outcome: CaseOutcome
    files: dict[str, bytes]
    machine: str
    refused_by: str | None = None  # worker with other versions; "" without an address


def versions() -> tuple[tuple[str, str], ...]:
    packages = surroundings()["versions"]
    packages["python"] = ".".join(packages["python"].split(".")[:2])
    return tuple(packages.items())


def packed(
    script: ScriptFiles, launch: Launch, values: Mapping[str, Sequence[str]], keep: Sequence[str]
) -> Package:
    """Collect the script, its includes, and the files that arguments or variables name."""
    paths = {Path(abspath(path)) for path in script.statements}
    words = {(script.path, word) for words in values.values() for word in words}
    for path, statements in script.statements.items():
        for one in statements:
            words |= {(path, quoted) for quoted in QUOTED.findall(one.raw.code)}
            if isinstance(one, CommandCall):
                words |= {(path, raw.code.strip()) for raw in one.arguments}
    for path, word in words:
        plain = word and "\n" not in word and len(word) < 1000 and not Path(word).is_absolute()
        if plain and (path.parent / word).is_file():
            paths.add(Path(abspath(path.parent / word)))
        module = CLASS.fullmatch(word)
        if module and (source := path.parent / f"{module[1]}.py").is_file():
            paths.add(Path(abspath(source)))
    root = Path(commonpath([path.parent for path in paths]))
    files = tuple((path.relative_to(root).as_posix(), path.read_bytes()) for path in sorted(paths))
    name = Path(abspath(script.path)).relative_to(root).as_posix()
    settings = launch.threads, launch.repeat, launch.limit
    return Package(name, files, settings, launch.texts, tuple(keep), versions())


@lru_cache(maxsize=2)
def _unpacked(package: Package) -> tuple[Launch, TemporaryDirectory]:
    folder = TemporaryDirectory(prefix="karamelo-py-")
    for name, content in package.files:
        path = Path(folder.name) / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return Launch(Path(folder.name) / package.script, *package.launch, package.texts), folder


def _address() -> str:
    if "distributed" not in sys.modules:
        return ""
    from distributed import get_worker

    with suppress(ValueError):  # no worker of Dask
        return get_worker().address
    return ""


def run_sent(package: Package, case: Mapping[str, str]) -> Returned:
    machine = socket.gethostname()
    differ = [
        f"{name} {local} for {remote}"
        for (name, remote), (_, local) in zip(package.versions, versions(), strict=True)
        if local != remote
    ]
    if differ:
        outcome = CaseOutcome("failed", f"{machine} has {', '.join(differ)}", {}, code="busy")
        return Returned(outcome, {}, machine, _address())
    launch, _ = _unpacked(package)
    with TemporaryDirectory(prefix="karamelo-py-case-") as name:
        folder = Path(name)
        outcome = launch.run(case, folder)
        paths = {folder / one for one in RETURNED}
        paths |= {path for pattern in package.keep for path in folder.glob(pattern)}
        files = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(paths) if path.is_file()
        }  # fmt: skip
    return Returned(outcome, files, machine)


class Elsewhere:
    def __init__(
        self, send: Callable[[], Any], executor: Executor, size: int, ends: ExitStack,
        workers: Callable[[], Mapping[str, int]] = dict,
    ):  # fmt: skip
        """`send` makes the package known to the machines; its result goes with each case.

        `workers` returns the threads of each worker by address; it is empty if a case cannot be
        sent to chosen workers.
        """
        self.send, self.executor, self.size, self.ends = send, executor, size, ends
        self.workers = workers
        self.refusing: set[str] = set()  # addresses
        self.package = send()
        # Callbacks run in the thread that talks to the machines, which must not wait.
        self.retries = ThreadPoolExecutor(1)
        self.closing = False
        self.gone = False  # Dask accepts cases then, and never ends them
        self.machines: dict[Path, str] = {}  # machine by folder

    def submit(self, case: Mapping[str, str], folder: Path) -> Future:
        """Return a future of the outcome; the files of the case come into `folder`."""
        outer: Future = Future()
        self._try(case, folder, outer, 1)
        return outer

    def _try(self, case: Mapping[str, str], folder: Path, outer: Future, tries: int) -> None:
        def finished(inner: Future) -> None:
            try:
                result = inner.result()
            except Exception as error:  # the machine, its disk, or its copy of the package
                words = f"{type(error).__name__}: {error}".splitlines()[0]
                self._retry(case, folder, outer, tries, words)
                return
            if result.refused_by is not None:
                self._retry(case, folder, outer, tries, result.outcome.reason, result)
                return
            try:
                outer.set_result(self._received(result, folder))
            except Exception as error:  # a full disk here
                outer.set_exception(error)

        if self.gone:
            reason = "not started: the connection is lost"
            outer.set_result(CaseOutcome("killed", reason, {}, folder))
            return
        try:
            chosen: dict[str, Any] = {}
            if self.refusing:  # a preference: Dask would wait for ever for a worker that has gone
                chosen = {"workers": [*self._willing()] or None, "allow_other_workers": True}
            future = self.executor.submit(run_sent, self.package, dict(case), **chosen)
            future.add_done_callback(finished)
        except Exception as error:  # the executor has gone
            outer.set_result(CaseOutcome("killed", f"not started: {error}", {}, folder))

    def _willing(self) -> dict[str, int]:
        return {name: n for name, n in self.workers().items() if name not in self.refusing}

    def _retry(
        self, case: Mapping[str, str], folder: Path, outer: Future, tries: int, reason: str,
        refusal: Returned | None = None,
    ) -> None:  # fmt: skip
        def again() -> None:
            try:
                count = tries + 1
                if refusal and refusal.refused_by:
                    self.refusing.add(refusal.refused_by)
                    if willing := self._willing():
                        self.size = min(self.size, sum(willing.values()))
                        count = tries
                        time.sleep(0.2)  # Dask may move the case to an idle worker that refuses it
                    else:
                        count = TRIES + 1
                if count <= TRIES:
                    self.package = self.send()
                    self._try(case, folder, outer, count)
                elif refusal:
                    outer.set_result(self._received(refusal, folder))
                else:
                    lost = f"lost {TRIES} times: {reason}"
                    outer.set_result(CaseOutcome("killed", lost, {}, folder))
            except Exception as error:  # the scheduler does not answer, or a full disk here
                words = f"{reason}; not sent again: {type(error).__name__}: {error}".splitlines()[0]
                self.gone = True
                outer.set_result(CaseOutcome("killed", words, {}, folder))

        if self.closing:
            outer.cancel()
            return
        try:
            self.retries.submit(again)
        except RuntimeError:  # closed in this moment
            outer.cancel()

    def _received(self, result: Returned, folder: Path) -> CaseOutcome:
        with reported(folder):
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir(parents=True)
            for name, content in result.files.items():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(content)
        self.machines[folder] = result.machine
        result.outcome.folder = folder
        return result.outcome

    def close(self) -> None:
        """Leave without waiting for cases that run."""
        self.closing = True
        self.retries.shutdown(wait=False, cancel_futures=True)
        self.ends.close()


def _closed(ends: ExitStack, close: Callable[..., Any], **how: Any) -> None:
    """Close with `ends`, whatever state the machines are in."""

    def closing() -> None:
        with suppress(Exception):
            close(**how)

    ends.callback(closing)


def _in_time(connect: Callable[[], Any]) -> Any:
    """Return the result of `connect`; TimeoutError if it never ends."""
    result: Future = Future()

    def connecting() -> None:
        try:
            result.set_result(connect())
        except BaseException as error:
            result.set_exception(error)

    Thread(target=connecting, daemon=True).start()
    return result.result(PATIENCE + 1)


def opened(options: Namespace, package: Package, jobs: int, *, timed: bool = False) -> Elsewhere:
    ends = ExitStack()
    if options.on == "mpi":
        return _mpi(package, ends, timed=timed)
    kinds = ("local", *QUEUES)
    if options.on not in kinds and "://" not in options.on:
        raise ScriptError(f"-on {options.on}", expected=WHERE)
    needed = "dask_jobqueue" if options.on in QUEUES else "distributed"
    if find_spec(needed) is None:
        extra = "pip install '.[dask]' in the folder of karamelo-py"
        hint = "pip install dask-jobqueue" if options.on in QUEUES else extra
        raise ScriptError(f"-on {options.on} needs {needed.replace('_', '-')}", hint=hint)
    from distributed import Client, LocalCluster

    try:
        if options.on == "local":
            cluster: Any = LocalCluster(
                n_workers=jobs, threads_per_worker=1, dashboard_address=":0"
            )
            _closed(ends, cluster.close, timeout=TO_CLOSE)
        elif options.on in QUEUES:
            import dask_jobqueue

            cluster = getattr(dask_jobqueue, QUEUES[options.on])()
            _closed(ends, cluster.close, timeout=TO_CLOSE)
            cluster.scale(jobs=jobs)
        else:
            cluster = options.on
        client = _in_time(lambda: Client(cluster, timeout=PATIENCE))
    except ValueError as error:
        ends.close()
        raise ScriptError(f"-on {options.on}: {error}", expected=WHERE) from None
    except Exception as error:  # anything, if something else than a scheduler answers
        ends.close()
        words = (str(error) or type(error).__name__).splitlines()[0]
        raise ScriptError(
            f"no scheduler answers at {options.on}: {words}",
            expected="the address that 'dask scheduler' has printed",
        ) from None
    _closed(ends, client.close, timeout=TO_CLOSE)
    if options.on not in QUEUES and not timed:
        jobs = options.jobs or sum(client.nthreads().values()) or jobs
    executor = client.get_executor(retries=0)
    _closed(ends, executor.shutdown, wait=False)

    def send() -> Any:
        return client.scatter(package, broadcast=True, hash=False)

    return Elsewhere(send, executor, jobs, ends, client.nthreads)


def _mpi(package: Package, ends: ExitStack, *, timed: bool) -> Elsewhere:
    if find_spec("mpi4py") is None:
        hint = "pip install '.[mpi]' in the folder of karamelo-py"
        raise ScriptError("-on mpi needs mpi4py", hint=hint)
    from mpi4py import MPI
    from mpi4py.futures import MPIPoolExecutor

    size = MPI.COMM_WORLD.Get_size() - 1
    if size < 1:
        raise ScriptError(
            "-on mpi: there is one process",
            expected='mpiexec -n 5 python -m mpi4py.futures "$(which karamelo-py)" sweep ...',
        )
    executor = MPIPoolExecutor()
    _closed(ends, executor.shutdown, wait=False, cancel_futures=True)
    return Elsewhere(lambda: package, executor, 1 if timed else size, ends)
