"""Fixtures of the tests that drive the page in a browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from cases.pages import GANTRY, PROGRAM
from judge import browser

from olp.review.job import Review, view


@pytest.fixture(scope="module")
def play() -> Iterator[Any]:
    browser.require()
    with browser.driver() as driver:
        yield driver


@pytest.fixture(scope="module")
def chromium(play: Any) -> Iterator[Any]:
    with browser.launched(play, *browser.SOFTWARE_GL) as launched:
        yield launched


@pytest.fixture(scope="session")
def review() -> Review:
    return view(PROGRAM, GANTRY)


@pytest.fixture(scope="session")
def file(review: Review, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "review.html"
    review.write(path)
    return path


@pytest.fixture
def page(chromium: Any, file: Path) -> Iterator[Any]:
    with browser.opened(chromium, file) as opened:
        yield opened
