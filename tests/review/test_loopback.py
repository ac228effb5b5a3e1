"""What is served on this computer is for who knows the address; other pages, names and users get nothing."""

from __future__ import annotations

import random
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from email import message_from_string
from typing import Any

import pytest

from olp.review import loopback
from olp.review.loopback import HEADERS, LOOPBACK, MOST_BYTES, MOST_REQUESTS, Loopback

SECRET = b"the job of this computer"
EVIL = "http://evil.example"


class Served:
    """A server with two contents, and answers to raw requests."""

    def __init__(self) -> None:
        self.http = Loopback(0)
        self.http.contents = {"": ("text/html", SECRET), "version": ("text/plain", b"1 " + SECRET)}
        self.port, self.token = self.http.server_port, self.http.token
        self.host = f"{LOOPBACK}:{self.port}"
        self.thread = threading.Thread(target=self.http.serve_forever, kwargs={"poll_interval": 0.02})
        self.thread.start()

    def connect(self) -> socket.socket:
        return socket.create_connection((LOOPBACK, self.port), timeout=20)

    def raw(self, request: bytes) -> bytes:
        """All that is answered to these bytes; nothing where the connection is reset."""
        with self.connect() as client:
            answer = b""
            try:
                client.sendall(request)
                while part := client.recv(65536):
                    answer += part
            except ConnectionError:
                pass
            return answer

    def ask(
        self, path: str | None = None, *headers: tuple[str, str], method: str = "GET", host: str | None = ""
    ) -> tuple[int, dict[str, str], bytes]:
        """Status, headers and content of an answer; `host` None sends no Host, "" the right one."""
        lines = [f"{method} {f'/{self.token}/' if path is None else path} HTTP/1.1"]
        lines += [] if host is None else [f"Host: {host or self.host}"]
        lines += [f"{name}: {value}" for name, value in headers]
        answer = self.raw("\r\n".join([*lines, "", ""]).encode("latin-1"))
        head, _, content = answer.partition(b"\r\n\r\n")
        status, *rest = head.decode().split("\r\n")
        return int(status.split()[1]), dict(line.split(": ", 1) for line in rest), content

    def refused(self, status: int, *words: Any, **more: Any) -> None:
        """The status, the headers of all answers, and no content."""
        code, headers, content = self.ask(*words, **more)
        assert (code, content) == (status, b"")
        assert headers.items() >= HEADERS.items()
        assert headers["Content-Length"] == "0"

    def free(self) -> int:
        return self.http._free._value


@pytest.fixture
def served() -> Iterator[Served]:
    server = Served()
    yield server
    server.http.shutdown()
    server.http.server_close()
    server.thread.join(10)


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


# -- what is answered -----------------------------------------------------------------------------------


def test_the_address_is_answered_under_a_strict_policy(served: Served) -> None:
    assert served.http.address == f"http://127.0.0.1:{served.port}/{served.token}/"
    status, headers, content = served.ask()
    assert (status, content) == (200, SECRET)
    assert headers == {
        "Cache-Control": "no-store",
        "Content-Security-Policy": "frame-ancestors 'none'",
        "Cross-Origin-Opener-Policy": "same-origin",
        "Cross-Origin-Resource-Policy": "same-origin",
        "Referrer-Policy": "no-referrer",
        "X-Content-Type-Options": "nosniff",
        "X-Frame-Options": "DENY",
        "Content-Type": "text/html",
        "Content-Length": str(len(SECRET)),
    }
    assert served.ask(f"/{served.token}/version")[2] == b"1 " + SECRET


@pytest.mark.parametrize("name", ["", "version"])
def test_head_is_answered_as_get_without_content(served: Served, name: str) -> None:
    got, head = (served.ask(f"/{served.token}/{name}", method=method) for method in ("GET", "HEAD"))
    assert head[:2] == got[:2] and got[2] and not head[2]


def test_each_server_has_a_secret_of_128_bits_or_more() -> None:
    tokens = set()
    for _ in range(3):
        http = Loopback(0)
        tokens.add(http.token)
        http.server_close()
    assert len(tokens) == 3
    # 6 bits a character
    assert all(6 * len(token) >= 128 for token in tokens)


# -- who does not know the address ----------------------------------------------------------------------


def test_nothing_is_answered_without_the_secret(served: Served) -> None:
    token = served.token
    other = ("a" if token[-1] != "a" else "b").join((token[:-1], ""))
    paths = ("/", "/version", f"/{token}", f"/{token}/other", f"/{token}/?", f"/{token}/version/")
    paths += (f"/{other}/", f"/{token[:-1]}/", f"/{token}a/", f"/{token.swapcase()}/", f"/x/{token}/", "/x/")
    paths += (f"/%{ord(token[0]):x}{token[1:]}/", f"/x/../{token}/", f"{token}/", "*", "/\xff\xe9/", "/./")
    paths += (
        f"x/{token}/",
        f"http://{served.host}/{token}/",
        f"/?{token}",
        f"/#/{token}/",
        "/review.css",
        "/../etc/passwd",
    )
    for path in paths:
        served.refused(404, path)
        served.refused(404, path, method="HEAD")


def test_the_secret_is_compared_in_constant_time(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    compared = []

    def compare(one: bytes, other: bytes) -> bool:
        compared.append((one, other))
        return False

    monkeypatch.setattr(loopback.hmac, "compare_digest", compare)
    served.refused(404)
    served.refused(404, "/guess/")
    token = served.token.encode()
    assert compared == [(token, token), (b"guess", token)]


# -- other names, other pages -------------------------------------------------------------------------


def test_only_names_of_this_computer_with_the_port_are_served(served: Served) -> None:
    port = served.port
    for host in (f"127.0.0.1:{port}", f"localhost:{port}", f"[::1]:{port}"):
        assert served.ask(host=host)[2] == SECRET
    foreign = ("evil.example", f"evil.example:{port}", f"127.0.0.1.evil.example:{port}", f"0.0.0.0:{port}")
    foreign += ("127.0.0.1", "localhost", f"127.0.0.1:{port + 1}", f"localhost:{port}0", "127.0.0.1:", ":")
    foreign += (f"user@127.0.0.1:{port}", f"127.0.0.1:{port}, evil.example", f"localhost.:{port}", f":{port}")
    foreign += (f"127.0.0.2:{port}", f"2130706433:{port}", f"127.0.0.1:0{port}", " ")
    for host in foreign:
        served.refused(403, host=host)
        served.refused(403, "/", host=host)
    served.refused(403, host=None)
    served.refused(403, None, ("Host", "evil.example"))
    served.refused(403, None, ("Host", served.host))


def test_port_80_may_be_left_out_as_browsers_do() -> None:
    def admitted(host: str, port: int) -> bool:
        return loopback.admits(message_from_string(f"Host: {host}\n\n"), port)

    assert admitted("127.0.0.1", 80) and admitted("localhost", 80) and admitted("127.0.0.1:80", 80)
    assert not admitted("127.0.0.1", 8080) and not admitted("evil.example", 80) and not admitted("", 80)


def test_an_origin_other_than_the_page_itself_is_refused(served: Served) -> None:
    ours = f"http://{served.host}"
    assert served.ask(None, ("Origin", ours))[2] == SECRET
    foreign = (EVIL, "null", "", f"https://{served.host}", f"http://localhost:{served.port}", f"{ours}0")
    foreign += ("http://127.0.0.1", f"{ours}, {EVIL}", f"{ours}/", "file://")
    for origin in foreign:
        served.refused(403, None, ("Origin", origin))
    served.refused(403, None, ("Origin", ours), ("Origin", EVIL))


def fetched(site: str, mode: str, destination: str) -> tuple[tuple[str, str], ...]:
    return ("Sec-Fetch-Site", site), ("Sec-Fetch-Mode", mode), ("Sec-Fetch-Dest", destination)


def test_its_page_its_user_and_a_link_may_ask(served: Served) -> None:
    for site, mode, destination in (
        ("none", "navigate", "document"), ("same-origin", "navigate", "document"),
        ("same-origin", "cors", "empty"), ("none", "no-cors", "empty"),
        ("cross-site", "navigate", "document"), ("same-site", "navigate", "document"),
    ):  # fmt: skip
        assert served.ask(None, *fetched(site, mode, destination))[2] == SECRET


def test_another_page_gets_nothing_into_a_frame_a_script_or_a_picture(served: Served) -> None:
    for site in ("cross-site", "same-site", "other", ""):
        for mode, destination in (
            ("navigate", "iframe"), ("navigate", "frame"), ("navigate", "object"), ("navigate", "embed"),
            ("no-cors", "script"), ("no-cors", "image"), ("no-cors", "style"), ("cors", "empty"),
            ("no-cors", "empty"), ("cors", "worker"), ("same-origin", "empty"), ("no-cors", "document"),
            ("navigate", "empty"), ("navigate", ""), ("websocket", "empty"),
        ):  # fmt: skip
            served.refused(403, None, *fetched(site, mode, destination))
    for destination in ("iframe", "object", "embed", "script", "serviceworker", "fencedframe"):
        served.refused(403, None, *fetched("same-origin", "navigate", destination))
    served.refused(403, None, ("Sec-Fetch-Site", "cross-site"))
    served.refused(403, None, ("Sec-Fetch-Dest", "iframe"))


def test_no_method_but_get_and_head(served: Served) -> None:
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "BREW", "get", "handle"):
        served.refused(405, method=method)
        served.refused(405, "/", method=method, host="evil.example")
        assert served.ask(method=method)[1]["Allow"] == "GET, HEAD"


# -- broken, long and slow requests -----------------------------------------------------------------------


def test_malformed_requests_get_no_content_and_leave_no_traceback(
    served: Served, capfd: pytest.CaptureFixture[str]
) -> None:
    start, host = f"GET /{served.token}/".encode(), f"Host: {served.host}\r\n\r\n".encode()
    good = start + b" HTTP/1.1\r\n" + host
    assert served.raw(good).endswith(SECRET)
    broken = [start + version + b"\r\n" + host for version in (b"", b" HTTP/0.9", b" HTTP/2.0", b" HTTP/x")]
    broken += [start + version + b"\r\n" + host for version in (b" HTTP/1.\xb2", b" HTTP/1.1 more", b" 1.1")]
    broken += [start + b"\r\n\r\n", b"\r\n\r\n", b" \r\n" + good, b"\x00" * 99 + b"\r\n\r\n"]
    for old, new in (
        (b"Host", b"Ho\x00st"),
        (b"Host: ", b"Host"),
        (b"Host:", b"Host :"),
        (b"Host", b" Host"),
    ):
        broken.append(good.replace(old, new))
    broken += [good.replace(b"GET", b"\x16\x03\x01GET"), good.replace(b"GET", b"GET GET")]
    for request in broken:
        assert SECRET not in served.raw(request), request
    assert capfd.readouterr().err == ""


def test_a_changed_request_gets_content_with_the_secret_and_the_name_alone(
    served: Served, capfd: pytest.CaptureFixture[str]
) -> None:
    draw = random.Random(7)
    path = f"/{served.token}/".encode()
    good = b"GET " + path + b" HTTP/1.1\r\nHost: " + served.host.encode() + b"\r\nAccept: *\r\n\r\n"
    answered = 0
    for _ in range(400):
        changed = bytearray(good)
        for _ in range(draw.randint(1, 3)):
            where = draw.randrange(len(changed) - 4)
            match draw.randrange(3):
                case 0:
                    changed[where] = draw.randrange(256)
                case 1:
                    del changed[where]
                case _:
                    changed[where:where] = bytes([draw.randrange(256)])
        if SECRET in served.raw(bytes(changed)):
            answered += 1
            assert path in changed and served.host.encode() in changed and changed.startswith(b"GET")
    # some changes do not matter, as those of Accept
    assert 0 < answered < 200
    assert capfd.readouterr().err == ""


def test_a_long_request_is_dropped(served: Served) -> None:
    line = b"GET /" + served.token.encode() + b"/ HTTP/1.1\r\nHost: " + served.host.encode() + b"\r\n"
    fits = line + b"Cookie: " + b"x" * (MOST_BYTES - len(line) - 12) + b"\r\n\r\n"
    assert len(fits) == MOST_BYTES and served.raw(fits).endswith(SECRET)
    assert served.raw(fits.replace(b"\r\n\r\n", b"x\r\n\r\n")) == b""
    assert served.raw(b"x" * (4 * MOST_BYTES)) == b""
    served.refused(431, None, *[("X", "y")] * 101)
    assert served.raw(fits).endswith(SECRET)


def test_a_request_may_arrive_in_parts(served: Served) -> None:
    request = f"GET /{served.token}/ HTTP/1.1\r\nHost: {served.host}\r\n\r\n".encode()
    for cut in (1, 2, 3, 4, 30):
        with served.connect() as client:
            client.sendall(request[:-cut])
            until(lambda: served.free() < MOST_REQUESTS)
            time.sleep(0.05)
            client.sendall(request[-cut:])
            answer = b""
            while part := client.recv(4096):
                answer += part
        assert answer.endswith(SECRET)


def test_a_request_that_never_arrives_is_dropped(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loopback, "REQUEST_S", 0.05)
    for start in (b"", b"GET /", b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n"):
        with served.connect() as client:
            client.sendall(start)
            assert client.recv(9) == b""


def test_a_client_that_will_send_no_more_is_dropped_at_once(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loopback, "REQUEST_S", 1000.0)
    with served.connect() as client:
        client.sendall(b"GET /")
        client.shutdown(socket.SHUT_WR)
        assert client.recv(9) == b""


def test_a_request_that_drips_is_dropped(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """The time is that of the whole request, whatever its bytes take one by one."""
    monkeypatch.setattr(loopback, "REQUEST_S", 0.2)
    with served.connect() as client:

        def dropped() -> bool:
            try:
                client.sendall(b"x")
            except ConnectionError:
                return True
            return False

        until(dropped)
    until(lambda: served.free() == MOST_REQUESTS)


def test_a_client_that_does_not_read_is_dropped(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loopback, "REQUEST_S", 1000.0)
    monkeypatch.setattr(loopback, "ANSWER_S", 0.05)
    served.http.contents = {"": ("text/html", b"x" * 50_000_000)}
    with served.connect() as client:
        client.sendall(f"GET /{served.token}/ HTTP/1.1\r\nHost: {served.host}\r\n\r\n".encode())
        assert client.recv(9) == b"HTTP/1.0 "
        until(lambda: served.free() == MOST_REQUESTS)


def test_clients_that_go_are_no_error(served: Served, capfd: pytest.CaptureFixture[str]) -> None:
    """A client that asks, resets its connection, and is gone before the content is written."""
    served.http.contents = {"": ("text/html", b"x" * 10_000_000)}
    whole = f"GET /{served.token}/ HTTP/1.1\r\nHost: {served.host}\r\n\r\n".encode()
    for words in (whole, b"GET / HT", b"\x00\xff" * 99, b""):
        client = served.connect()
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.sendall(words)
        client.close()
    assert served.ask()[0] == 200
    until(lambda: served.free() == MOST_REQUESTS)
    assert capfd.readouterr().err == ""


def test_a_defect_in_an_answer_is_reported(served: Served, capfd: pytest.CaptureFixture[str]) -> None:
    served.http.contents = {"": ("text/html", None)}  # type: ignore[dict-item]
    assert served.raw(f"GET /{served.token}/ HTTP/1.1\r\nHost: {served.host}\r\n\r\n".encode()) == b""
    until(lambda: served.free() == MOST_REQUESTS)
    assert "TypeError" in capfd.readouterr().err


@pytest.mark.slow
def test_requests_at_a_time_are_bounded(served: Served) -> None:
    before = threading.active_count()
    clients = [served.connect() for _ in range(2 * MOST_REQUESTS)]
    until(lambda: served.free() == 0)
    assert threading.active_count() <= before + MOST_REQUESTS
    # one that comes too much is closed, and does not wait
    assert clients[-1].recv(9) == b""
    for client in clients:
        client.close()
    until(lambda: served.free() == MOST_REQUESTS)
    assert served.ask()[0] == 200


def test_it_listens_on_loopback_alone(served: Served) -> None:
    assert served.http.server_address[0] == "127.0.0.1"
    with pytest.raises(OSError):
        socket.create_connection(("127.0.0.2", served.port), timeout=1)
