"""The live page is served to this machine alone, and follows its inputs."""

from __future__ import annotations

import http.client
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest
from judge.machines import zero_machine
from judge.unpacker import Page

import olp
from olp.core.errors import OlpError
from olp.review import live
from olp.review.live import Server

TEXT = "G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nM2\n"


class Served:
    """A job in a folder, its server, and its messages."""

    def __init__(self, folder: Path) -> None:
        self.machine = zero_machine(folder / "m")
        self.program = folder / "part.ngc"
        self.program.write_text(TEXT)
        self.messages: list[str] = []
        inputs = [str(self.program)]
        self.server = Server(
            lambda: olp.view(self.program, self.machine, time=False), inputs, self.messages.append
        )
        self.thread = threading.Thread(target=self.server.run)
        self.thread.start()

    def get(self, path: str = "/", host: str | None = None) -> tuple[int, bytes]:
        address = self.server.address.removeprefix("http://").rstrip("/")
        connection = http.client.HTTPConnection(address, timeout=10)
        connection.request("GET", path, headers={"Host": host} if host else {})
        answer = connection.getresponse()
        return answer.status, answer.read()

    def change(self, text: str) -> None:
        before = self.program.stat().st_mtime_ns
        self.program.write_text(text)
        os.utime(self.program, ns=(before + 10**9, before + 10**9))


@pytest.fixture
def served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Served]:
    monkeypatch.setattr(live, "WATCH_S", 0.02)
    server = Served(tmp_path)
    yield server
    server.server.stop()
    server.thread.join(10)
    assert not server.thread.is_alive()


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_the_page_is_served_and_tells_its_version(served: Served) -> None:
    status, page = served.get()
    assert status == 200
    manifest = Page(page).manifest
    assert served.get(f"/{manifest['live']}") == (200, manifest["digest"].encode())
    assert served.get("/../etc/passwd")[0] == served.get("/review.css")[0] == 404


def test_it_listens_on_loopback_alone(served: Served) -> None:
    assert served.server._http.server_address[0] == "127.0.0.1"
    port = served.server._http.server_address[1]
    with pytest.raises(OSError):
        socket.create_connection((socket.gethostbyname("127.0.0.2"), port), timeout=1)


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example:1", ""])
def test_a_foreign_name_that_leads_here_is_refused(served: Served, host: str) -> None:
    assert served.get("/", host=host or " ")[0] == 403


def test_a_change_of_the_inputs_changes_the_page(served: Served) -> None:
    before = served.get("/version")[1]
    served.change(TEXT.replace("100", "90"))
    until(lambda: served.get("/version")[1] != before)
    assert Page(served.get()[1]).array("text_nominal")[3] == "G1 X90 F600"
    assert served.messages == ["the page is up to date again"]


def test_an_input_that_is_wrong_leaves_the_page_as_it_was(served: Served) -> None:
    before = served.get("/version")[1]
    served.change("G1 X#\n")
    until(lambda: bool(served.messages))
    assert "the page is unchanged" in served.messages[0] and "part.ngc:1:" in served.messages[0]
    assert served.get("/version")[1] == before
    served.program.unlink()
    until(lambda: len(served.messages) == 2)
    assert "no such file" in served.messages[1]
    served.program.write_text(TEXT + "(more)\n")
    until(lambda: served.get("/version")[1] != before)


def test_a_port_that_is_taken_is_refused(served: Served) -> None:
    port = served.server._http.server_address[1]
    with pytest.raises(OlpError, match=f"port {port} of 127.0.0.1 cannot be served"):
        Server(lambda: olp.view(served.program, served.machine, time=False), [], print, port)


def test_a_port_is_bound_before_the_work_and_left_where_that_fails(served: Served) -> None:
    def work() -> None:
        raise AssertionError("worked before the port was bound")

    port = served.server._http.server_address[1]
    with pytest.raises(OlpError, match="cannot be served"):
        Server(work, [], print, port)  # type: ignore[arg-type]
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        other = free.getsockname()[1]

    def fails() -> None:
        raise OlpError("no page")

    for _ in range(2):
        with pytest.raises(OlpError, match="no page"):
            Server(fails, [], print, other)  # type: ignore[arg-type]


def test_clients_that_go_are_no_error(served: Served, capfd: pytest.CaptureFixture[str]) -> None:
    """A client that asks, resets its connection, and is gone before the page is written."""
    served.server._page = b"x" * 10_000_000
    port = served.server._http.server_address[1]
    for words in (b"GET / HTTP/1.1\r\nHost: 127.0.0.1:1\r\n\r\n", b"GET / HT", b"\x00\xff" * 99, b""):
        client = socket.create_connection((live.LOOPBACK, port), timeout=5)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        client.sendall(words)
        client.close()
    assert served.get("/version")[0] == 200
    until(lambda: served.server._http._free._value == live.MOST_REQUESTS)
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_requests_at_a_time_are_bounded(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    port = served.server._http.server_address[1]
    before = threading.active_count()
    clients = [
        socket.create_connection((live.LOOPBACK, port), timeout=5) for _ in range(2 * live.MOST_REQUESTS)
    ]
    until(lambda: served.server._http._free._value == 0)
    assert threading.active_count() <= before + live.MOST_REQUESTS
    # one that comes too much is closed, and does not wait
    assert clients[-1].recv(9) == b""
    for client in clients:
        client.close()
    until(lambda: served.server._http._free._value == live.MOST_REQUESTS)
    assert served.get("/version")[0] == 200


def test_a_request_that_never_arrives_is_dropped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(live, "REQUEST_S", 0.05)
    served = Served(tmp_path)
    try:
        port = served.server._http.server_address[1]
        with socket.create_connection((live.LOOPBACK, port), timeout=10) as client:
            client.sendall(b"GET /")
            assert client.recv(9) == b""
    finally:
        served.server.stop()
        served.thread.join(10)


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C reaches a whole console there")
@pytest.mark.slow
def test_ctrl_c_ends_it(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    (tmp_path / "part.ngc").write_text(TEXT)
    words = ["view", str(tmp_path / "part.ngc"), "-m", str(machine), "--live", "--no-time"]
    command = [sys.executable, "-m", "olp", *words]
    heard = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)  # a shell's background job ignores it
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heard) as done:
        assert done.stderr is not None
        line = done.stderr.readline()
        assert line.startswith("serving http://127.0.0.1:")
        done.send_signal(signal.SIGINT)
        assert done.stderr.read().strip() == "ended"
    assert done.returncode == 0
