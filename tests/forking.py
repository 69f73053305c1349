"""Starts of the program that cost no import: an interpreted process has it at hand, and forks.

``python forking.py SOCKET`` is that process. ``python forking.py SOCKET SELF -m MODULE word ...``
hands it the words, and ends as the run does: SELF, a script of this line, is started as Python is.
"""

import os
import signal
import socket
import sys


def ask(path: str, python: str, words: list[str]) -> int:
    """Have a run carried out here, in this folder and with the output of this process."""
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(path)
        socket.send_fds(link, ["\0".join([os.getcwd(), python, *words]).encode()], [1, 2])
        answer = link.recv(1)
    return answer[0] if answer else 1


def serve(path: str) -> None:
    """Fork for each that asks."""
    import gc

    from karamelo_py.app.start import main
    from karamelo_py.run import runner  # noqa: F401

    gc.freeze()
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # nobody waits for them
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
            said, (out, err), _, _ = socket.recv_fds(link, 1 << 16, 2)
            folder, sys.executable, *sys.argv[1:] = said.decode().split("\0")
            os.chdir(folder)
            os.dup2(out, 1)
            os.dup2(err, 2)
            status = main()
            sys.stdout.flush()
            link.send(bytes([status]))
            os._exit(status)


if __name__ == "__main__":
    place, *rest = sys.argv[1:]
    sys.exit(ask(place, rest[0], rest[3:]) if rest else serve(place))
