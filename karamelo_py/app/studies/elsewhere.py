"""Cases of a study on other machines: Dask, its job queues, or MPI.

A case is sent as data: its variables, and names and hashes of the script and its files. A machine
that does not have these files at the same paths asks once for their contents, and for kernels that
other machines have compiled. The log, the record and files named by `-keep` are returned, or moved
to the folder of the study if the machine has the same disk.
"""

import asyncio
import hashlib
import logging
import os
import re
import shutil
import signal
import socket
import sys
import time
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import ExitStack, suppress
from importlib.machinery import PathFinder
from importlib.util import find_spec
from os.path import abspath, commonpath
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event, Lock, Thread
from typing import Any, NamedTuple
from uuid import uuid4

from karamelo_py.app.studies.case import KEPT, CaseOutcome, Launch
from karamelo_py.app.studies.variables import QUEUES, WHERE, ScriptFiles
from karamelo_py.compiler import files as cache
from karamelo_py.language import registry
from karamelo_py.output.files import reported
from karamelo_py.output.record import NAME, surroundings
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.syntax import CommandCall

PATIENCE = 10  # seconds for a scheduler to answer
TO_CLOSE = 3  # seconds for connections to close
TRIES = 3
# Dask cluster on this machine: its three processes take 2 % of a core instead of 10 %.
FRUGAL = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}
CLASS = re.compile(r"(\w+)\.\w+")  # class of a module next to the script
IMPORTED = re.compile(r"^\s*(?:from|import)\s+([\w, ]+)", re.MULTILINE)
QUOTED = re.compile(r'"([^"\n]*)"')
RETURNED = (KEPT, NAME, "log.mpm", "out.txt", "err.txt")


class Parcel(NamedTuple):
    """Data of the study that are sent with each case."""

    study: str  # folder of the runs, if the machine has the same disk
    mark: str  # file in this folder that shows whether the disk is the same
    root: str  # folder that contains all files
    script: str  # path of the script below `root`
    files: tuple[tuple[str, str], ...]  # paths below `root`, and hashes of contents
    launch: tuple[int, int, float | None]  # threads, repetitions, limit (s)
    texts: tuple[str, ...]
    keep: tuple[str, ...]  # patterns of further files to return
    versions: tuple[tuple[str, str], ...]
    kernels: tuple[str, ...] = ()  # names of kernels that machines have compiled


class Returned(NamedTuple):
    outcome: CaseOutcome
    files: dict[str, bytes]  # contents by path; empty if the machine has put them into their folder
    kernels: dict[str, bytes]
    refused_by: str | None = None  # address of a worker with other versions; "" if it is unknown
    asks: bool = False  # True if the machine asks for contents of files


def versions(plugins: Iterable[str]) -> dict[str, str]:
    """Return versions of the program and of what it needs, and hashes of plug-ins' sources."""
    result = dict(surroundings()["versions"])
    result["python"] = ".".join(result["python"].split(".")[:2])
    for module in plugins:
        spec = PathFinder.find_spec(module)
        paths = [Path(spec.origin)] if spec and spec.origin else []
        for folder in (spec and spec.submodule_search_locations) or ():
            paths += sorted(Path(folder).rglob("*.py"))
        content = b"".join(path.read_bytes() for path in paths)
        result[module] = _hash(content)[:8] if paths else "none"
    return result


def _hash(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def packed(
    script: ScriptFiles, launch: Launch, values: Mapping[str, Sequence[str]], keep: Sequence[str],
    study: Path,
) -> Parcel:  # fmt: skip
    """List the script, its includes, and the files that its arguments or variables name."""
    paths = {Path(abspath(path)) for path in script.statements}
    words = {(script.path, word) for words in values.values() for word in words}
    plugins = set(registry.plugins())
    for path, statements in script.statements.items():
        for one in statements:
            words |= {(path, quoted) for quoted in QUOTED.findall(one.raw.code)}
            if isinstance(one, CommandCall):
                words |= {(path, raw.code.strip()) for raw in one.arguments}
    for path, word in words:
        plain = word and "\n" not in word and len(word) < 1000 and not Path(word).is_absolute()
        if plain and (path.parent / word).is_file():
            paths.add(Path(abspath(path.parent / word)))
        if module := CLASS.fullmatch(word):
            beside = _modules(path.parent, module[1])
            paths |= beside
            spec = None if beside else PathFinder.find_spec(module[1])
            if spec and spec.has_location and module[1] not in sys.stdlib_module_names:
                plugins.add(module[1])
    root = Path(commonpath([path.parent for path in paths]))
    files = tuple((p.relative_to(root).as_posix(), _hash(p.read_bytes())) for p in sorted(paths))
    name = Path(abspath(script.path)).relative_to(root).as_posix()
    settings = launch.threads, launch.repeat, launch.limit
    return Parcel(
        abspath(study), f".{uuid4().hex}", str(root), name, files, settings, launch.texts,
        tuple(keep), tuple(versions(sorted(plugins)).items()),
    )  # fmt: skip


def _modules(folder: Path, name: str, seen: frozenset[Path] = frozenset()) -> set[Path]:
    """Return the source files, next to a script, of a module and of all modules that it imports."""
    path = Path(abspath(folder / f"{name}.py"))
    if path in seen or not path.is_file():
        return set()
    paths = {path, *seen}
    for words in IMPORTED.findall(path.read_text(encoding="utf-8", errors="replace")):
        for other in words.split(","):
            paths |= _modules(folder, [*other.split(), ""][0], frozenset(paths))
    return paths


class Site:
    """A study on one machine: its files, its kernels, and its end."""

    def __init__(self, parcel: Parcel):
        study, root = Path(parcel.study), Path(parcel.root)
        here = versions(n for n, _ in parcel.versions if n not in surroundings()["versions"])
        self.differ = ", ".join(
            f"{name} {here.get(name, 'none')} for {there}"
            for name, there in parcel.versions if here.get(name) != there
        )  # fmt: skip
        self.shared = study if (study / parcel.mark).is_file() else None
        self.parcel, self.stop, self.lock, self.listed = parcel, Event(), Lock(), -1
        self.has_kernels: tuple[str, ...] = ()
        self.launch: Launch | None = None
        with suppress(OSError):
            same = all(_hash((root / name).read_bytes()) == of for name, of in parcel.files)
            if self.shared and same:
                self.launch = self._launch(root)

    def _launch(self, root: Path) -> Launch:
        parcel = self.parcel
        return Launch(root / parcel.script, *parcel.launch, parcel.texts, self.stop)

    def has(self, kernels: tuple[str, ...]) -> bool:
        if kernels != self.has_kernels and all((cache.folder() / one).is_file() for one in kernels):
            self.has_kernels = kernels
        return self.launch is not None and self.has_kernels == kernels

    def receive(self, contents: Mapping[str, bytes], kernels: tuple[str, ...]) -> None:
        """Write files of the study into a temporary folder, and kernels into the cache."""
        with self.lock:
            if self.launch is None:
                self.folder = TemporaryDirectory(prefix="karamelo-py-", dir=_scratch())
                for name, _ in self.parcel.files:
                    path = Path(self.folder.name) / name
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(contents[name])
                self.launch = self._launch(Path(self.folder.name))
            with suppress(OSError):  # the cache may be read-only
                for name in kernels:
                    if not (cache.folder() / name).is_file():
                        cache.write(cache.folder() / name, contents[name])
            self.has_kernels = kernels

    def compiled(self, since: float) -> dict[str, bytes]:
        """Return kernels that runs have compiled or read since a time."""
        with suppress(OSError):
            listed = cache.folder().stat().st_mtime_ns
            if listed != self.listed:
                self.listed = listed
                names = [
                    one.name for one in os.scandir(cache.folder())
                    if one.name.endswith((".kernel", ".code")) and one.stat().st_mtime >= since
                ]  # fmt: skip
                return {
                    name: cache.read(cache.folder() / name)
                    for name in names if name not in self.has_kernels
                }  # fmt: skip
        return {}


SITES: dict[str, Site] = {}  # sites of this process, by `Parcel.mark`


def _site(parcel: Parcel) -> Site:
    if parcel.mark not in SITES:
        SITES[parcel.mark] = Site(parcel)
        for old in [*SITES][:-2]:
            del SITES[old]
    return SITES[parcel.mark]


def end_study(mark: str) -> None:
    if mark in SITES:
        SITES[mark].stop.set()


def ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _worker() -> Any:
    if "distributed" in sys.modules:
        from distributed import get_worker

        with suppress(ValueError):  # raised outside a Dask worker
            return get_worker()
    return None


def _scratch() -> str | None:
    """Return a folder that Dask removes when its worker ends, or None."""
    return worker.local_directory if (worker := _worker()) else None


def run_sent(
    parcel: Parcel, case: Mapping[str, str], name: str, contents: Mapping[str, bytes] | None = None
) -> Returned:
    """Run a case on this machine, in a folder called `name`."""
    machine, worker, site = socket.gethostname(), _worker(), _site(parcel)
    if site.differ:
        outcome = CaseOutcome("failed", f"{machine} has {site.differ}", code="busy")
        return Returned(outcome, {}, {}, worker.address if worker else "")
    if contents is not None:
        site.receive(contents, parcel.kernels)
    elif not site.has(parcel.kernels):
        return Returned(CaseOutcome("asks"), {}, {}, asks=True)
    if worker:
        worker.log_event(parcel.mark, (name, machine))
    begun = time.time()
    where = site.shared or _scratch()
    with TemporaryDirectory(prefix=".case-", dir=where, ignore_cleanup_errors=True) as temporary:
        folder = Path(temporary)
        outcome = site.launch.run(case, folder)
        wanted = {folder / one for one in RETURNED}
        wanted |= {path for pattern in parcel.keep for path in folder.glob(pattern)}
        paths = {p.relative_to(folder).as_posix(): p for p in sorted(wanted) if p.is_file()}
        if site.shared:
            _put(site.shared / name, paths, os.replace)
            return Returned(outcome, {}, site.compiled(begun))
        returned = {path: at.read_bytes() for path, at in paths.items()}
    return Returned(outcome, returned, site.compiled(begun))


def _put(folder: Path, paths: Mapping[str, Any], put: Callable[[Any, Path], Any]) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, content in paths.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        put(content, folder / name)


class Elsewhere:
    def __init__(
        self, parcel: Parcel, send: Callable[[Mapping[str, bytes]], Any], executor: Executor,
        size: int, ends: ExitStack, workers: Callable[[], Mapping[str, int]] = dict,
    ):  # fmt: skip
        """Store how to reach the machines.

        `send` makes contents known to the machines; its result goes to machines that ask.

        `workers` returns the number of threads of each worker by address, or nothing if workers
        cannot be chosen.
        """
        self.parcel, self.send, self.executor, self.size = parcel, send, executor, size
        self.ends, self.workers = ends, workers
        self.refusing: set[str] = set()  # addresses of refusing workers
        self.kernels: dict[str, bytes] = {}
        self.sent: Any = None
        self.places: dict[str, str] = {}  # machines by the name of a case's folder
        self.gone = False  # True if Dask accepts cases, but never finishes them
        self.loop = asyncio.new_event_loop()
        self.loop.set_exception_handler(lambda *_: None)  # ignores cases that are left at the end
        Thread(target=self.loop.run_forever, daemon=True).start()
        self.mark = Path(parcel.study) / parcel.mark
        with reported(self.mark):
            self.mark.touch()

    def machine(self, folder: Path) -> str:
        return self.places.get(folder.name, "")

    def submit(self, case: Mapping[str, str], folder: Path) -> Future:
        return asyncio.run_coroutine_threadsafe(self._outcome(dict(case), folder), self.loop)

    async def _outcome(self, case: Mapping[str, str], folder: Path) -> CaseOutcome:
        def killed(reason: str) -> CaseOutcome:
            return CaseOutcome("killed", reason, {}, folder)

        tries, contents = 1, ()
        while not self.gone:
            chosen: dict[str, Any] = {}
            if self.refusing:  # a preference only, since such a worker may have ended
                chosen = {"workers": [*self._willing()] or None, "allow_other_workers": True}
            try:
                sent = self.executor.submit(
                    run_sent, self.parcel, case, folder.name, *contents, **chosen
                )
            except Exception as error:  # the executor no longer exists
                return killed(f"not started: {error}")
            result, reason, contents = None, "", ()
            try:
                result = await asyncio.wrap_future(sent)
            except (Exception, asyncio.CancelledError) as error:  # the machine or its disk failed
                reason = f"{type(error).__name__}: {error}".splitlines()[0]
            if result and not result.asks and result.refused_by is None:
                return self._received(result, folder)
            try:
                if result and result.asks:
                    contents = (self._contents(),)
                    continue
                if result and result.refused_by:
                    self.refusing.add(result.refused_by)
                    if willing := self._willing():
                        self.size = min(self.size, sum(willing.values()))
                        await asyncio.sleep(0.2)  # Dask may move it to a worker that refuses
                        continue
                    tries = TRIES
                tries += 1
                if tries > TRIES and result:
                    return self._received(result, folder)
                if tries > TRIES:
                    return killed(f"lost {TRIES} times: {reason}")
                self.sent = None  # the contents that were sent may be lost, too
                self.workers()  # raises an error if the scheduler has ended
            except Exception as error:  # the scheduler does not answer, or the disk here is full
                self.gone = True
                error_words = f"{type(error).__name__}: {error}".splitlines()[0]
                return killed(f"{reason}; not sent again: {error_words}")
        return killed("not started: the connection is lost")

    def _willing(self) -> dict[str, int]:
        return {name: n for name, n in self.workers().items() if name not in self.refusing}

    def _contents(self) -> Any:
        if self.sent is None:
            root = Path(self.parcel.root)
            contents = {name: (root / name).read_bytes() for name, _ in self.parcel.files}
            self.sent = self.send({**contents, **self.kernels})
        return self.sent

    def _received(self, result: Returned, folder: Path) -> CaseOutcome:
        if result.files:
            with reported(folder):
                _put(folder, result.files, lambda content, path: path.write_bytes(content))
        if result.kernels:
            self.kernels |= result.kernels
            self.parcel, self.sent = self.parcel._replace(kernels=tuple(self.kernels)), None
        self.places.pop(folder.name, None)
        result.outcome.folder = folder
        return result.outcome

    def close(self) -> None:
        """Stop without waiting for cases that are still running."""
        self.ends.close()
        self.mark.unlink(missing_ok=True)
        for left in self.mark.parent.glob(".case-*"):
            shutil.rmtree(left, ignore_errors=True)


def _closed(ends: ExitStack, close: Callable[..., Any], **how: Any) -> None:
    """Close, also if an error leaves `ends`, whatever state the machines are in."""

    def closing() -> None:
        with suppress(Exception):
            close(**how)

    ends.callback(closing)


def _in_time(connect: Callable[[], Any], patience: float = 0.0) -> Any:
    """Return the result of `connect`; raise TimeoutError if it never returns."""
    result: Future = Future()

    def connecting() -> None:
        try:
            result.set_result(connect())
        except BaseException as error:
            result.set_exception(error)

    Thread(target=connecting, daemon=True).start()
    return result.result(patience or PATIENCE + 1)


def opened(options: Namespace, parcel: Parcel, jobs: int, *, timed: bool = False) -> Elsewhere:
    ends = ExitStack()
    if options.on == "mpi":
        return _mpi(parcel, ends, timed=timed)
    kinds = ("local", *QUEUES)
    if options.on not in kinds and "://" not in options.on:
        raise ScriptError(f"-on {options.on}", expected=WHERE)
    needed = "dask_jobqueue" if options.on in QUEUES else "distributed"
    if find_spec(needed) is None:
        hint = "pip install '.[dask]' in the folder of karamelo-py"
        raise ScriptError(f"-on {options.on} needs {needed.replace('_', '-')}", hint=hint)
    import dask
    from distributed import Client, LocalCluster
    from distributed.comm.registry import get_backend

    try:
        if options.on == "local":
            with dask.config.set(FRUGAL):
                cluster: Any = LocalCluster(
                    n_workers=jobs, threads_per_worker=1, dashboard_address=":0",
                    silence_logs=logging.CRITICAL,
                )  # fmt: skip
            _closed(ends, cluster.close, timeout=PATIENCE)
        elif options.on in QUEUES:
            before = {one: signal.getsignal(one) for one in (signal.SIGINT, signal.SIGTERM)}
            import dask_jobqueue

            for one, handler in before.items():  # the import has replaced these handlers
                signal.signal(one, handler)
            kind = getattr(dask_jobqueue, QUEUES[options.on])
            command = kind.job_cls.submit_command.split()[0]
            if shutil.which(command) is None:
                raise ValueError(f"there is no command {command}")
            cluster = kind()
            _closed(ends, cluster.close, timeout=PATIENCE)
            cluster.scale(jobs=jobs)
        else:
            get_backend(options.on.partition("://")[0])
            cluster = options.on
        client = _in_time(lambda: Client(cluster, timeout=PATIENCE))
    except ValueError as error:
        ends.close()
        raise ScriptError(f"-on {options.on}: {error}", expected=WHERE) from None
    except Exception as error:  # if something other than a scheduler answers, any error may occur
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

    def send(contents: Mapping[str, bytes]) -> Any:
        return client.scatter(contents, hash=False)

    place = Elsewhere(parcel, send, executor, jobs, ends, client.nthreads)
    client.subscribe_topic(parcel.mark, lambda event: place.places.update([event[1]]))
    if options.on == "local":  # local processes get signals of the terminal
        client.run(ignore_interrupts)
    _closed(ends, _in_time, connect=lambda: client.run(end_study, parcel.mark), patience=TO_CLOSE)
    return place


def _mpi(parcel: Parcel, ends: ExitStack, *, timed: bool) -> Elsewhere:
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
    return Elsewhere(parcel, lambda contents: contents, executor, 1 if timed else size, ends)
