"""Serves the page of a run on the loopback address. Whoever knows the token in the address may read it.

Messages are computed by two threads with a database of their own each, so that a slow one, such as the path of a crack,
does not hold up the fields. A page of another site can neither guess the token nor, as the name in the request is
compared, reach this server through a name of its own.
"""

from __future__ import annotations

import secrets
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Thread
from typing import Any

from pdpost.browser import messages, page
from pdsolve.measures.frame_steps import last_frame
from pdsolve.results import Results

HOST = "127.0.0.1"
QUICK = ("run", "nodes", "field", "displacement")  # messages that the picture waits for
REST = 0.3  # s without a message, after which the database of a run in progress is closed
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'unsafe-inline'; img-src data:;"
    " connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


Replies = SimpleQueue[bytes | Exception | None]  # to one request: its answer, or what was raised


class MessageReader:
    """Computes messages in one thread, which has the database open; a run that begins anew is opened anew.

    A run in progress is closed when nothing was read for a moment, as its end waits for readers.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._requests: SimpleQueue[tuple[str, Replies] | None] = SimpleQueue()
        self._open: tuple[tuple[int, int], Results] | None = None
        self._thread = Thread(target=self._work, daemon=True)
        self._thread.start()

    def read(self, address: str) -> bytes | None:
        """The message at an address; None for an unknown one. Raises ResultsError, OSError."""
        replies: Replies = SimpleQueue()
        self._requests.put((address, replies))
        reply = replies.get()
        if isinstance(reply, Exception):
            raise reply
        return reply

    def close(self) -> None:
        """Close the database once what is asked for has been computed."""
        self._requests.put(None)
        self._thread.join()

    def _work(self) -> None:
        is_running = False
        while True:
            try:
                request = self._requests.get(timeout=REST if is_running else None)
            except Empty:
                self._close()
                is_running = False
                continue
            if request is None:
                return self._close()
            address, replies = request
            try:
                stat = self._path.stat()
                file = stat.st_dev, stat.st_ino
                if self._open is None or self._open[0] != file:
                    self._close()
                    self._open = file, Results.open(self._path)
                results = self._open[1]
                replies.put(messages.answer(results, address))
                is_running = results.meta().get("status") == "running"
            except Exception as error:
                replies.put(error)  # after an answer, nobody waits for it

    def _close(self) -> None:
        if self._open is not None:
            self._open[1].close()
            self._open = None


class PageServer(ThreadingHTTPServer):
    """The server of one run's page."""

    daemon_threads = True

    def __init__(self, path: Path, port: int = 0, token: str | None = None) -> None:
        """Listen on `port` of the loopback address; 0: one that is free. Raises OSError for a port that is taken."""
        self.token = token or secrets.token_urlsafe(16)
        self.path, self.files = path, page.files(path.stem)
        self.quick, self.slow = MessageReader(path), MessageReader(path)
        super().__init__((HOST, port), _Request)  # closes all where the port is taken

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{HOST}:{self.server_port}/{self.token}/"

    def prepare(self) -> None:
        """Read the nodes of the last frame, which of large runs takes seconds. Raises ResultsError without a frame."""
        with Results.open(self.path) as results:
            last = last_frame(results)
        self.quick.read(f"nodes/{last}")

    def server_close(self) -> None:
        """Stop listening and close the databases."""
        super().server_close()
        self.quick.close()
        self.slow.close()

    def handle_error(self, *_: object) -> None:
        """A browser that leaves in the middle of a reply is no error."""


class _Request(BaseHTTPRequestHandler):
    server: PageServer
    server_version, sys_version = "pdpost", ""
    timeout = 60  # s, of a connection that sends nothing

    def do_GET(self) -> None:
        name = self.headers.get("Host", "")
        _, _, rest = self.path.partition("/")
        token, slash, address = rest.partition("/")
        port = self.server.server_port
        if name not in (f"{HOST}:{port}", f"localhost:{port}"):
            self._reply(HTTPStatus.FORBIDDEN)
        elif not secrets.compare_digest(token.encode(), self.server.token.encode()) or not slash:
            self._reply(HTTPStatus.NOT_FOUND)
        elif address in self.server.files:
            self._reply(HTTPStatus.OK, *self.server.files[address])
        else:
            address = address.removeprefix("data/") if address.startswith("data/") else ""
            reader = self.server.quick if address.split("/")[0] in QUICK else self.server.slow
            try:
                data = reader.read(address)
            except Exception as error:  # of any kind: the page says it
                data = messages.message({"error": " ".join(str(error).split())})
            if data is None:
                self._reply(HTTPStatus.NOT_FOUND)
            else:
                self._reply(HTTPStatus.OK, "application/octet-stream", data)

    def _reply(self, status: HTTPStatus, kind: str = "text/plain; charset=utf-8", data: bytes = b"") -> None:
        data = data if status is HTTPStatus.OK else f"{status.value} {status.phrase}\n".encode()
        self.send_response(status)
        for name, value in {"Content-Type": kind, "Content-Length": str(len(data)), **HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: Any) -> None:
        """Print nothing: the address has the token."""
