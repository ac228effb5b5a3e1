"""What tests of the command line share."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from cli.test_newcomers import MILL, PLAIN


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder as a user has it: machine, job, calibration and a program, all of them right."""
    for path in MILL.iterdir():
        shutil.copy(path, tmp_path)
    (tmp_path / "part.nc").write_bytes(PLAIN)
    monkeypatch.chdir(tmp_path)
    return tmp_path
