"""The live page is served to who knows its address, and follows its inputs."""

from __future__ import annotations

import http.client
import os
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from urllib.parse import urlsplit

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
        folder.mkdir(exist_ok=True)
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

    def get(self, name: str = "") -> tuple[int, bytes]:
        """Status and content at a name below the address of the page."""
        address = urlsplit(self.server.address)
        connection = http.client.HTTPConnection(address.netloc, timeout=10)
        connection.request("GET", address.path + name)
        answer = connection.getresponse()
        return answer.status, answer.read()

    def port(self) -> int:
        return urlsplit(self.server.address).port or 0

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
    live = manifest["live"]
    assert served.get(live["address"]) == (200, f"{live['proof']} {manifest['digest']}".encode())
    assert served.get("../etc/passwd")[0] == served.get("review.css")[0] == 404


def test_the_proof_is_a_secret_of_its_own(served: Served, tmp_path: Path) -> None:
    """Who takes the port of a server that has ended learns the address from the page, but not the proof."""
    proof = Page(served.get()[1]).manifest["live"]["proof"]
    assert 6 * len(proof) >= 128 and proof not in served.server.address
    other = Served(tmp_path / "other")
    try:
        assert Page(other.get()[1]).manifest["live"]["proof"] != proof
        assert other.server.address != served.server.address
    finally:
        other.server.stop()
        other.thread.join(10)


def test_a_change_of_the_inputs_changes_the_page(served: Served) -> None:
    before = served.get("version")[1]
    served.change(TEXT.replace("100", "90"))
    until(lambda: served.get("version")[1] != before)
    assert Page(served.get()[1]).array("text_nominal")[3] == "G1 X90 F600"
    assert served.messages == ["the page is up to date again"]


def test_an_input_that_is_wrong_leaves_the_page_as_it_was(served: Served) -> None:
    before = served.get("version")[1]
    served.change("G1 X#\n")
    until(lambda: bool(served.messages))
    assert "the page is unchanged" in served.messages[0] and "part.ngc:1:" in served.messages[0]
    assert served.get("version")[1] == before
    served.program.unlink()
    until(lambda: len(served.messages) == 2)
    assert "no such file" in served.messages[1]
    served.program.write_text(TEXT + "(more)\n")
    until(lambda: served.get("version")[1] != before)


def test_a_port_that_is_taken_is_refused(served: Served) -> None:
    port = served.port()
    with pytest.raises(OlpError, match=f"port {port} of 127.0.0.1 cannot be served"):
        Server(lambda: olp.view(served.program, served.machine, time=False), [], print, port)


def test_a_port_is_bound_before_the_work_and_left_where_that_fails(served: Served) -> None:
    def work() -> None:
        raise AssertionError("worked before the port was bound")

    port = served.port()
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
        address = line.removeprefix("serving ").removesuffix(" until Ctrl-C\n")
        with urllib.request.urlopen(address, timeout=20) as answer:
            assert Page(answer.read()).manifest["program"] == "part.ngc"
        token = urlsplit(address).path.strip("/")
        for name in ("cmdline", "environ"):
            # what other users see of a process
            seen = Path(f"/proc/{done.pid}/{name}")
            assert len(token) > 20 and (not seen.exists() or token.encode() not in seen.read_bytes())
        done.send_signal(signal.SIGINT)
        assert done.stderr.read().strip() == "ended"
    assert done.returncode == 0
