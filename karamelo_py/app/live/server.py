"""Server of a live page, with a secret address."""

from __future__ import annotations

import importlib.util
import json
import secrets
import threading
import time
from collections.abc import Callable, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socket import socket
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from karamelo_py.script.errors import ScriptError

PATIENCE = 1.0  # seconds to send the last state at the end
BEAT = 2.0  # seconds between messages, to notice closed pages
STUCK = 30.0  # seconds without receipt after which a page counts as closed
AWAY = 180.0  # seconds after the end of a run; open pages send a sign every 20 seconds
UNKNOWN = 5.0  # seconds in which a client must send the secret word
MOST = 64  # connections, so that file descriptors remain for the run
LARGEST = 1 << 16  # bytes of a request's body, which is ignored
# Refuse other host names: a malicious site could resolve its name to this machine.
HERE = ("127.0.0.1", "localhost", "::1")
POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors"
)
NOTEBOOKS = "http://127.0.0.1:* http://localhost:* vscode-webview:"
HEADERS = {
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
}

Request = socket | tuple[bytes, socket]
Answer = Callable[[Mapping[str, str]], "bytes | dict | None"]


class Server:
    """Serves a page on this machine, at the URL `address`.

    ``news(seen)`` returns the changes since the state number `seen` (0 at first), and the new state
    number; threads of the server call it. `answers` and `actions` (for POST) are functions of the
    query, by name; an answer is bytes, JSON or None.
    """

    def __init__(
        self, page: Path, news: Callable[[Any], tuple[Any, dict]], answers: Mapping[str, Answer],
        actions: Mapping[str, Callable[[Mapping[str, str]], None]],
    ):  # fmt: skip
        require_plotly()
        self.page, self.news = page, news
        self.answers = {"plotly.js": _plotly, "points.js": _points, **answers}
        self.actions = {"here": lambda _: None, **actions}
        self.heard = 0.0  # time of the last request
        self.version = 0
        self._changed = threading.Condition()
        self._shown: dict[int, int] = {}
        self.opened = False
        self.framed = False  # True if the page is shown in a notebook
        self.token = secrets.token_urlsafe(16)
        self._http = _Quiet(("127.0.0.1", 0), _handler(self))
        self.address = f"http://127.0.0.1:{self._http.server_address[1]}/{self.token}/"
        # With a short poll interval, the server closes at once.
        threading.Thread(target=self._http.serve_forever, args=(0.05,), daemon=True).start()

    def changed(self) -> None:
        with self._changed:
            self.version += 1
            self._changed.notify_all()

    @property
    def watched(self) -> bool:
        return bool(self._shown)

    def flush(self) -> None:
        with self._changed:
            self._changed.wait_for(
                lambda: all(shown >= self.version for shown in self._shown.values()), PATIENCE
            )

    def stay(self) -> None:
        """Wait until pages are closed or do not respond."""
        self.heard = time.monotonic()
        with self._changed:
            while not self.opened or (self._shown and time.monotonic() < self.heard + AWAY):
                self._changed.wait(BEAT)

    def close(self) -> None:
        self.flush()
        self._http.shutdown()
        self._http.server_close()

    def events(self, write: Callable[[bytes], object]) -> None:
        key, seen, version = threading.get_ident(), 0, -1
        try:
            while True:
                with self._changed:
                    self._changed.wait_for(lambda: self.version != version, BEAT)  # noqa: B023
                    version = self.version
                seen, news_ = self.news(seen)
                write(b"data: " + json.dumps(news_).encode() + b"\n\n")
                with self._changed:
                    self._shown[key], self.opened = version, True
                    self._changed.notify_all()
                time.sleep(0.1)
        finally:
            with self._changed:
                self._shown.pop(key, None)
                self._changed.notify_all()


def require_plotly() -> None:
    if importlib.util.find_spec("plotly") is None:
        raise ScriptError(
            "a page needs the package plotly",
            hint="pip install '.[studies]' in the folder of karamelo-py",
        )


class _Quiet(ThreadingHTTPServer):
    """Server that limits the number of connections, and ignores pages that close while loading."""

    daemon_threads = True

    def __init__(self, *arguments: Any):
        self._open: set[Request] = set()
        super().__init__(*arguments)

    def verify_request(self, request: Request, client: object) -> bool:
        if len(self._open) >= MOST:
            return False
        self._open.add(request)
        return True

    def shutdown_request(self, request: Request) -> None:
        self._open.discard(request)
        super().shutdown_request(request)

    def handle_error(self, *_: object) -> None:
        """Print nothing: the run uses the terminal."""


def _plotly(_: Mapping[str, str]) -> bytes:
    from plotly.offline import get_plotlyjs

    return get_plotlyjs().encode()


def _points(_: Mapping[str, str]) -> bytes:
    return Path(__file__).with_name("points.js").read_bytes()


def _handler(server: Server) -> type[BaseHTTPRequestHandler]:
    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = UNKNOWN
        server_version, sys_version = "karamelo-py", ""

        def log_message(self, *_: object) -> None:
            """Print nothing: the study uses the terminal."""

        def do_GET(self) -> None:
            name, words = self._asked()
            if not self._is_from_here():
                self._give(b"not from here", "text/plain", 403)
            elif name == "":
                self._give(server.page.read_bytes(), "text/html; charset=utf-8")
            elif name == "events":
                self._open("text/event-stream")
                self.send_header("Connection", "close")
                self.end_headers()
                try:
                    server.events(self._write)
                except OSError:
                    self.close_connection = True
            elif name in server.answers and (answer := server.answers[name](words)) is not None:
                if isinstance(answer, bytes):
                    kind = "text/javascript" if name.endswith(".js") else "application/octet-stream"
                    self._give(answer, kind)
                else:
                    self._give(json.dumps(answer).encode(), "application/json")
            else:
                self._nothing()

        def do_POST(self) -> None:
            name, words = self._asked()
            length = self.headers.get("Content-Length", "0")
            if length.isdecimal() and len(length) < 9 and int(length) <= LARGEST:
                self.rfile.read(int(length))  # otherwise the body would be read as the next request
            else:
                self.close_connection = True
            if not self._is_from_here():
                self._give(b"not from here", "text/plain", 403)
            elif name not in server.actions:
                self._nothing()
            else:
                server.actions[name](words)
                self._give(b"{}", "application/json")

        def _is_from_here(self) -> bool:
            host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
            try:
                here = urlsplit(f"//{host}").hostname in HERE
                return here and (origin is None or urlsplit(origin).netloc == host)
            except ValueError:
                return False

        def _asked(self) -> tuple[str | None, dict[str, str]]:
            asked = urlsplit(self.path)
            before, _, name = asked.path.lstrip("/").partition("/")
            right = secrets.compare_digest(before.encode(), server.token.encode())
            if right:
                server.heard = time.monotonic()
                self.connection.settimeout(STUCK)
            return (name if right else None), dict(parse_qsl(asked.query))

        def _open(self, kind: str, status: int = 200) -> None:
            self.send_response(status)
            self.send_header("Content-Type", kind)
            within = NOTEBOOKS if server.framed else "'none'"
            self.send_header("Content-Security-Policy", f"{POLICY} {within}")
            for header, value in HEADERS.items():
                self.send_header(header, value)
            if not server.framed:
                self.send_header("X-Frame-Options", "DENY")

        def _give(self, content: bytes, kind: str, status: int = 200) -> None:
            self._open(kind, status)
            self.send_header("Content-Length", str(len(content)))
            self.end_headers()
            self.wfile.write(content)

        def _nothing(self) -> None:
            self._give(b"there is nothing here", "text/plain", 404)

        def _write(self, text: bytes) -> None:
            self.wfile.write(text)
            self.wfile.flush()

    return Handler
