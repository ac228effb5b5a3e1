"""An error source is one file and one line of registration: a copy of the package gets one more."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import olp

HERE = Path(__file__).parent
PACKAGE = Path(olp.__file__).parent
ONE = "    ThermalStructure(),\n"


def run(folder: Path, laws: str) -> subprocess.CompletedProcess[str]:
    """The laws of that source, in a copy of the package."""
    words = ["-q", "--noconftest", "-p", "no:cacheprovider", "-p", "no:hypothesispytest", "-k", laws]
    return subprocess.run(
        [sys.executable, "-m", "pytest", *words, str(folder / "test_sources.py")],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(folder)}, capture_output=True, text=True,
    )  # fmt: skip


@pytest.mark.slow
def test_a_new_source_is_one_file_and_one_line(tmp_path: Path) -> None:
    shutil.copytree(PACKAGE, tmp_path / "olp", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(HERE / "test_sources.py", tmp_path)
    sources = tmp_path / "olp" / "errormodel" / "sources"
    shutil.copy(HERE / "a_new_source.py", sources / "sag.py")
    registry = sources / "registry.py"
    text = registry.read_text()
    assert text.count(ONE) == 1
    where = "\nfrom olp.errormodel.sources.sag import Sags\n\nSOURCES"
    registry.write_text(text.replace(ONE, f"{ONE}    Sags(),\n").replace("\nSOURCES", where, 1))
    done = run(tmp_path, "sag")
    assert done.stdout.count(".") > 20 and done.returncode == 0, done.stdout
    # the laws bite: a number that acts with the wrong sign
    wrong = (sources / "sag.py").read_text()
    (sources / "sag.py").write_text(wrong.replace("yield 2, -1.0", "yield 2, 1.0"))
    done = run(tmp_path, "sag and uncertainty")
    assert "3 failed" in done.stdout, done.stdout
