"""Fixtures shared by all tests: judges and data that may be absent skip, unless the run promises them."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings
from judge import linuxcnc

# The same examples in each run, so that a change is judged by what it changes; `--hypothesis-profile=new`
# looks at others.
settings.register_profile("olp", deadline=None, print_blob=True, derandomize=True)
settings.register_profile("new", deadline=None, print_blob=True)
settings.load_profile("olp")

SHARED = Path(__file__).resolve().parents[2] / "shared"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_setupnodes() -> None:
    """Several processes run tests: each takes one core, also where numpy solves."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def _folder(variable: str, name: str, promise: str | None = None) -> Path:
    folder = Path(os.environ.get(variable) or SHARED / name)
    if not folder.is_dir():
        if promise and os.environ.get(promise) == "1":
            pytest.fail(f"{promise}=1, but {folder} is no folder; set {variable}")
        pytest.skip(f"needs the folder {name}; set {variable}")
    return folder


def pytest_runtest_setup(item: pytest.Item) -> None:
    """Tests marked `oracle` or `corpus` skip without their judge or data, or fail where it was promised."""
    if item.get_closest_marker("oracle"):
        linuxcnc.require()
    if item.get_closest_marker("corpus"):
        _folder("OLP_CORPUS", "corpus", "OLP_REQUIRE_CORPUS")


@pytest.fixture(scope="session")
def requires_linuxcnc() -> None:
    """For a test without the marker `oracle`."""
    linuxcnc.require()


@pytest.fixture(scope="session")
def corpus() -> Path:
    """Folder of real programs: OLP_CORPUS, or beside the checkout; OLP_REQUIRE_CORPUS=1 makes it a must."""
    return _folder("OLP_CORPUS", "corpus", "OLP_REQUIRE_CORPUS")


@pytest.fixture(scope="session")
def golden() -> Path:
    """Folder of machines with known errors: OLP_GOLDEN, or beside the checkout."""
    return _folder("OLP_GOLDEN", "golden")
