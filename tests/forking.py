"""Starts of Python that cost no import: an interpreted process has the program at hand, and forks.

``python forking.py SOCKET`` is that process. ``python forking.py SOCKET word ...`` hands it what
Python would be given, ``-m karamelo_py.app.cli word ...`` or ``-c code word ...``, and ends as that
does, with the same environment: a script of this line is started as Python is. What it starts
itself is Python.
"""

import contextlib
import io
import os
import signal
import socket
import sys


def ask(path: str, words: list[str]) -> int:
    """Have something done here, in this folder and with the input and output of this process."""
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(path)
        variables = [f"{name}={value}" for name, value in os.environ.items()]
        said = [os.getcwd(), str(len(variables)), *variables, *words]
        socket.send_fds(link, ["\0".join(said).encode()], [0, 1, 2])
        answer = link.recv(1)
    return answer[0] if answer else 1


def do(said: list[str]) -> int:
    """Do in this process what a Python of its own would do."""
    import time
    import traceback
    import warnings

    from karamelo_py.app.start import main
    from karamelo_py.compiler.disk import cache
    from karamelo_py.language import registry

    cache._began = time.time()  # sources that are older are those that this process has read

    folder, count, *words = said
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(word.split("=", 1) for word in words[: int(count)])
    del words[: int(count)]
    sys.path[:0] = os.environ.get("PYTHONPATH", "").split(os.pathsep)
    registry.forget()  # other packages may offer styles here
    while words[0] == "-W":
        action, _, message = words[1].partition(":")
        warnings.filterwarnings(action, message)
        del words[:2]
    way, what, *sys.argv[1:] = words
    try:
        if way == "-m":
            return main()
        exec(what, {"__name__": "__main__"})
    except SystemExit as end:
        return end.code or 0
    except BaseException:
        traceback.print_exc()
        return 1
    return 0


def reap(*_) -> None:
    """Wait for forks that have ended, so that their time counts as that of this process."""
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass


def run_a_scene() -> None:
    """Have at hand what the first run imports: a tenth of a second."""
    from pathlib import Path
    from tempfile import TemporaryDirectory

    from scenes import block

    from karamelo_py.app.cli import main

    with TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        script = Path(folder) / "in.scene"
        lines = "compute(v, average_velocity, all)", "log_modify(custom, step, v_x)", "run(1)"
        script.write_text(block(1, *lines), encoding="utf-8")
        assert main([str(script), "-out", folder, "-record", "run.json"]) == 0


def serve(path: str) -> None:
    """Fork for each that asks."""
    import gc

    interpreted = os.environ.get("NUMBA_DISABLE_JIT")
    if interpreted:
        from uncompiled import quicken

        quicken()
    import karamelo_py.app.cli
    import karamelo_py.commands
    import karamelo_py.run.loop  # noqa: F401
    from karamelo_py.script.parser import parse

    parse("run(1)")  # which reads the grammar
    if interpreted:
        run_a_scene()
    gc.freeze()
    signal.signal(signal.SIGCHLD, reap)
    with socket.socket(socket.AF_UNIX) as door:
        door.bind(path)
        door.listen(16)
        print("ready", flush=True)
        while True:
            link, _ = door.accept()
            if os.fork():
                link.close()
                continue
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            said, files, _, _ = socket.recv_fds(link, 1 << 16, 3)
            for at, file in enumerate(files):
                os.dup2(file, at)
                os.close(file)
            status = do(said.decode().split("\0"))
            sys.stdout.flush()
            link.send(bytes([status]))
            os._exit(status)


if __name__ == "__main__":
    place, *rest = sys.argv[1:]
    sys.exit(ask(place, rest) if rest else serve(place))
