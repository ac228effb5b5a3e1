"""Contents served on this computer alone, to those who know their address.

The address has a secret, as every user and every program of a computer can reach its loopback. A browser
tells where a request comes from, in `Host` and `Origin` (RFC 9110, RFC 6454) and in `Sec-Fetch-*` (W3C Fetch
Metadata). Other pages can neither read nor embed the contents.
"""

from __future__ import annotations

import hmac
import io
import os
import secrets
import sys
import threading
import time
from collections.abc import Mapping
from email.message import Message
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

#: The only address that is listened on.
LOOPBACK = "127.0.0.1"
#: Names by which a request may call this computer; any other that leads here is foreign.
NAMES = (LOOPBACK, "localhost", "[::1]")
#: Methods that are answered.
METHODS = ("GET", "HEAD")
#: Random bytes of a secret.
SECRET_BYTES = 24

#: Requests at a time; a browser makes a few, and one more is closed unanswered.
MOST_REQUESTS = 16
#: Seconds that a request may take to arrive, in all.
REQUEST_S = 10.0
#: Seconds that an answer may take to leave, in all; a page has some megabytes.
ANSWER_S = 60.0
#: Bytes of a request. Browsers send the cookies of all servers of this computer, whatever their port.
MOST_BYTES = 65536

#: What a browser may want an answer for: to show it, or for a script to read. Not for a frame, nor to run it.
DESTINATIONS = ("document", "empty")
#: Headers of every answer, refusals too.
HEADERS = {
    "Cache-Control": "no-store",
    "Content-Security-Policy": "frame-ancestors 'none'",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
}


def admits(headers: Message, port: int) -> bool:
    """Whether a request names this computer and `port`, and comes from our page, its user or no browser.

    A link elsewhere may open the page, in a window of its own; nothing else of another page is let in.
    """
    hosts = headers.get_all("Host", [])
    # a browser leaves out port 80
    ours = {f"{name}:{port}" for name in NAMES} | (set(NAMES) if port == 80 else set())
    if len(hosts) != 1 or hosts[0] not in ours:
        return False
    if any(origin != f"http://{hosts[0]}" for origin in headers.get_all("Origin", [])):
        return False
    site, mode, destination = (headers.get(f"Sec-Fetch-{key}") for key in ("Site", "Mode", "Dest"))
    if destination is not None and destination not in DESTINATIONS:
        return False
    return site in (None, "same-origin", "none") or (mode, destination) == ("navigate", "document")


class Loopback(ThreadingHTTPServer):
    """Answers a bounded number of requests at a time, each in its own thread. Clients may leave.

    `contents` are media type and bytes by the name that follows `address`. Raises OSError where `port` cannot
    be listened on; 0 is a free one.
    """

    #: With it, another user of Windows could listen on the same port.
    allow_reuse_address = os.name != "nt"

    def __init__(self, port: int) -> None:
        self.token = secrets.token_urlsafe(SECRET_BYTES)
        self.contents: Mapping[str, tuple[str, bytes]] = {}
        self._free = threading.Semaphore(MOST_REQUESTS)
        super().__init__((LOOPBACK, port), _Handler)

    @property
    def address(self) -> str:
        return f"http://{LOOPBACK}:{self.server_port}/{self.token}/"

    def content(self, path: str) -> tuple[str, bytes] | None:
        """Media type and bytes at a path; None without the token, or where there is nothing."""
        match path.split("/", 2):
            case "", token, name if hmac.compare_digest(token.encode("latin-1"), self.token.encode()):
                return self.contents.get(name)
        return None

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


class _Handler(BaseHTTPRequestHandler):
    """Answers one request for the page or its version; any other is refused without content."""

    server: Loopback

    def handle(self) -> None:
        head = self._head()
        self.rfile.close()
        self.rfile = io.BytesIO(head)
        self.connection.settimeout(ANSWER_S)
        self.handle_one_request()

    def _head(self) -> bytes:
        """The request up to its empty line; nothing where that is late or far away."""
        end = time.monotonic() + REQUEST_S
        head = b""
        part: bytes
        while (left := end - time.monotonic()) > 0:
            self.connection.settimeout(left)
            part = self.connection.recv(MOST_BYTES - len(head))
            head += part
            # the end may have come in two parts
            if head.find(b"\r\n\r\n", max(0, len(head) - len(part) - 3)) >= 0:
                return head
            # the client has gone, or may send no more
            if not part:
                break
        return b""

    def parse_request(self) -> bool:
        """Whether the request is to be answered; a refusal has been sent otherwise."""
        if not super().parse_request():
            return False
        refusal = self._refusal()
        if refusal is not None:
            self.send_error(refusal)
        return refusal is None

    def _refusal(self) -> HTTPStatus | None:
        if self.command not in METHODS:
            return HTTPStatus.METHOD_NOT_ALLOWED
        # an answer to HTTP/0.9 would have no headers
        if self.request_version == "HTTP/0.9" or not admits(self.headers, self.server.server_port):
            return HTTPStatus.FORBIDDEN
        return HTTPStatus.NOT_FOUND if self.server.content(self.path) is None else None

    def do_GET(self) -> None:
        content = self.server.content(self.path)
        assert content is not None
        self._answer(HTTPStatus.OK, *content)

    do_HEAD = do_GET

    def send_error(self, code: int, message: str | None = None, explain: str | None = None) -> None:
        """A refusal says nothing but its status."""
        self._answer(code, "text/plain; charset=utf-8", b"")

    def _answer(self, status: int, kind: str, data: bytes) -> None:
        self.send_response_only(status)
        for name, value in HEADERS.items():
            self.send_header(name, value)
        if status == HTTPStatus.METHOD_NOT_ALLOWED:
            self.send_header("Allow", ", ".join(METHODS))
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(data)
