"""The page served on this computer alone, and updated when its inputs change."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from olp.core.errors import OlpError
from olp.review.job import Review

#: The only address that is served, as the page holds the job.
LOOPBACK = "127.0.0.1"
#: Path at which the page asks whether it is out of date.
VERSION = "version"
#: Seconds between checks of the inputs.
WATCH_S = 0.5

#: Requests at a time; a browser makes a few, and one more is closed unanswered.
MOST_REQUESTS = 16
#: Seconds that a request may take to arrive.
REQUEST_S = 10.0

Make = Callable[[], Review]
Tell = Callable[[str], None]
_Stamp = tuple[tuple[str, int, int], ...]


class _Http(ThreadingHTTPServer):
    """Answers a bounded number of requests at a time, each in its own thread. Clients may leave."""

    def __init__(self, address: tuple[str, int], handler: type[BaseHTTPRequestHandler]) -> None:
        self._free = threading.Semaphore(MOST_REQUESTS)
        super().__init__(address, handler)

    def process_request(self, request: Any, client_address: Any) -> None:
        if self._free.acquire(blocking=False):
            super().process_request(request, client_address)
        else:
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class Server:
    """Serves the page of the result of `make` at `address`, and updates it when one of `inputs` changes.

    Where an input is wrong for the moment, the page is kept unchanged, and `tell` gets the reason.
    """

    def __init__(self, make: Make, inputs: Iterable[str], tell: Tell, port: int = 0) -> None:
        self._make, self._inputs, self._tell = make, tuple(inputs), tell
        try:
            self._http = _Http((LOOPBACK, port), self._handler())
        except OSError as error:
            raise OlpError(f"port {port} of {LOOPBACK} cannot be served ({error.strerror})") from None
        self._stamp = self._look()
        try:
            self._set(make())
        except BaseException:
            self._http.server_close()
            raise
        self._ended = threading.Event()

    @property
    def address(self) -> str:
        return f"http://{LOOPBACK}:{self._http.server_address[1]}/"

    def run(self) -> None:
        """Serve until `stop`, or until KeyboardInterrupt, which is raised."""
        thread = threading.Thread(target=self._http.serve_forever, kwargs={"poll_interval": 0.1}, daemon=True)
        thread.start()
        try:
            while not self._ended.wait(WATCH_S):
                self._refresh()
        finally:
            self._http.shutdown()
            self._http.server_close()
            thread.join()

    def stop(self) -> None:
        self._ended.set()

    def _refresh(self) -> None:
        stamp = self._look()
        if stamp == self._stamp:
            return
        self._stamp = stamp
        try:
            self._set(self._make())
        except OlpError as error:
            self._tell(f"the page is unchanged: {error}")
        else:
            self._tell("the page is up to date again")

    def _look(self) -> _Stamp:
        """Time of the last change and size of each input."""
        return tuple(self._stamps())

    def _stamps(self) -> Iterator[tuple[str, int, int]]:
        for name in self._inputs:
            try:
                status = Path(name).stat()
            except OSError:
                yield name, 0, 0
            else:
                yield name, status.st_mtime_ns, status.st_size

    def _set(self, review: Review) -> None:
        self._page = b"".join(review.parts(live=VERSION))
        self._version = review.scene.digest.encode()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
            timeout = REQUEST_S

            def do_GET(self) -> None:
                if not self._from_here():
                    self.send_error(HTTPStatus.FORBIDDEN)
                elif self.path == "/":
                    self._send(server._page, "text/html; charset=utf-8")
                elif self.path == f"/{VERSION}":
                    self._send(server._version, "text/plain; charset=utf-8")
                else:
                    self.send_error(HTTPStatus.NOT_FOUND)

            def _from_here(self) -> bool:
                """Whether the request names this computer; a foreign name that leads here is not served."""
                host = self.headers.get("Host", "").rpartition(":")[0]
                return host in (LOOPBACK, "localhost")

            def _send(self, data: bytes, kind: str) -> None:
                self.send_response(HTTPStatus.OK)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(data)))
                self.send_header("Cache-Control", "no-store")
                self.send_header("X-Content-Type-Options", "nosniff")
                self.end_headers()
                self.wfile.write(data)

            def log_message(self, format: str, *args: object) -> None:
                """Requests of the page are not reported."""

        return Handler
