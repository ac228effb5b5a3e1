"""Debian's Chromium as the judge of the review page, driven by playwright; nothing is downloaded."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

SOFTWARE_GL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
WITHOUT_GL = ("--disable-3d-apis",)
LOCAL = ("file:", "data:", "blob:")


def _missing() -> str | None:
    if not executable():
        return "Chromium is not installed: apt-get install --no-install-recommends chromium fonts-dejavu-core"
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "playwright is not installed: pip install playwright"
    return None


def executable() -> str | None:
    """Path of the browser; OLP_CHROMIUM names another one."""
    return os.environ.get("OLP_CHROMIUM") or shutil.which("chromium") or shutil.which("google-chrome")


def require() -> None:
    """Skip the running test without a browser; fail it where OLP_REQUIRE_BROWSER=1 promises one."""
    missing = _missing()
    if missing is None:
        return
    if os.environ.get("OLP_REQUIRE_BROWSER") == "1":
        pytest.fail(f"OLP_REQUIRE_BROWSER=1, but {missing}")
    pytest.skip(missing)


@contextmanager
def driver() -> Iterator[Any]:
    """playwright, of which a thread can have one at a time."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        yield play


@contextmanager
def launched(play: Any, *arguments: str) -> Iterator[Any]:
    """A browser without a window; `arguments` are added to its command line."""
    browser = play.chromium.launch(
        executable_path=executable(), args=["--no-sandbox", "--disable-dev-shm-usage", *arguments]
    )
    try:
        yield browser
    finally:
        browser.close()


@contextmanager
def opened(
    chromium: Any,
    source: Path | str,
    *,
    size: tuple[int, int] = (1280, 720),
    theme: str = "light",
    view: str = "",
    ready: str = "html[data-ready],html[data-error]",
    before: str = "",
) -> Iterator[Any]:
    """The page of a file, ready, with the network off, or that of a server; `view` follows its address. It is
    ready when an element matches `ready`. `before` is a script that runs before those of the page.

    Fails at the end where the console showed an error, a script failed, or anything but the file or the
    server itself was asked for.
    """
    width, height = size
    context = chromium.new_context(
        viewport={"width": width, "height": height},
        color_scheme=theme,
        offline=isinstance(source, Path),
        accept_downloads=True,
    )
    page = context.new_page()
    if before:
        page.add_init_script(before)
    trouble: list[str] = []
    asked: list[str] = []
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("console", lambda message: trouble.append(message.text) if message.type == "error" else None)
    page.on("dialog", lambda dialog: (trouble.append(f"dialog: {dialog.message}"), dialog.dismiss()))
    page.on("request", lambda request: asked.append(request.url))
    page.goto((source.as_uri() if isinstance(source, Path) else source) + view)
    page.wait_for_selector(ready, state="attached", timeout=120_000)
    assert page.evaluate("document.documentElement.dataset.error ?? null") is None, trouble
    try:
        yield page
        assert not trouble, trouble
        assert all(
            url.startswith(LOCAL if isinstance(source, Path) else (source, "data:", "blob:")) for url in asked
        ), asked
    finally:
        context.close()


def until(page: Any, expression: str, seconds: float = 30.0) -> None:
    """Waits until an expression of the page is true.

    Asked from outside, as the policy of the page forbids to evaluate text; it may load itself anew meanwhile.
    """
    from playwright.sync_api import Error

    end = time.monotonic() + seconds
    while time.monotonic() < end:
        try:
            if page.evaluate(expression):
                return
        except Error as error:
            if "context was destroyed" not in str(error):
                raise
        page.wait_for_timeout(30)
    pytest.fail(f"never true: {expression}")


def picture(page: Any, selector: str = "#pane") -> Any:
    """(h, w, 3) bytes of what an element shows."""
    import io

    import numpy as np
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(page.locator(selector).screenshot())).convert("RGB"), int)
