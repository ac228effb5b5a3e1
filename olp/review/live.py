"""The page served on this machine alone, made anew when its inputs change."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from olp.core.errors import OlpError
from olp.review.job import Review

#: never another address: a page holds the job
LOOPBACK = "127.0.0.1"
#: where the page asks whether it is out of date
VERSION = "version"
#: seconds between looks at the inputs
WATCH_S = 0.5

Make = Callable[[], Review]
Tell = Callable[[str], None]
_Stamp = tuple[tuple[str, int, int], ...]


class Server:
    """Serves the page of what `make` gives, at `address`, and makes it anew when one of `inputs` changes.

    An input that is wrong for the moment leaves the page as it was; `tell` says why.
    """

    def __init__(self, make: Make, inputs: Iterable[str], tell: Tell, port: int = 0) -> None:
        self._make, self._inputs, self._tell = make, tuple(inputs), tell
        try:
            self._http = ThreadingHTTPServer((LOOPBACK, port), self._handler())
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
        """Serve until `stop`, or until the person interrupts; KeyboardInterrupt passes."""
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
            self._tell(f"the page stays as it was: {error}")
        else:
            self._tell("the page is up to date again")

    def _look(self) -> _Stamp:
        """When each input was last written, and its size."""
        return tuple(self._stamps())

    def _stamps(self) -> Iterator[tuple[str, int, int]]:
        for name in self._inputs:
            try:
                found = Path(name).stat()
            except OSError:
                yield name, 0, 0
            else:
                yield name, found.st_mtime_ns, found.st_size

    def _set(self, review: Review) -> None:
        self._page = b"".join(review.parts(live=VERSION))
        self._version = review.scene.digest.encode()

    def _handler(self) -> type[BaseHTTPRequestHandler]:
        server = self

        class Handler(BaseHTTPRequestHandler):
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
                """The address asked for is this machine's: a foreign name that leads here is not served."""
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
                """Requests of the page are no news."""

        return Handler
