"""The commands of the papers run in the order of reading, in one folder, and show what comes out."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from docs.blocks import README, ROOT, blocks, called, papers, problems, run

NEVER_COPIED = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info", "build", "dist")
PAPERS = papers()
#: What no shell of Windows understands.
_OF_BASH = re.compile(r"\||<|>(?! \d)|\$|\bprintf\b|\bcat\b|^export\b|&&|/bin/|\\$", re.MULTILINE)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with nothing but the programs that ship."""
    shutil.copytree(ROOT / "programs", tmp_path / "programs")
    # what a reader of the how-to has left beside its measurements
    for made in (tmp_path / "programs" / "gantry-lines").glob("calibration*"):
        made.unlink()
    return tmp_path


def test_there_is_something_to_try() -> None:
    kinds = [block.kind for page in PAPERS.values() for block in page]
    assert kinds.count("sh") > 40
    assert kinds.count("python") > 1


def test_pages_do_not_take_the_files_of_another_page() -> None:
    """All pages share one folder, so each names its machines and files itself."""
    own: dict[str, str] = {}
    for name, page in PAPERS.items():
        bodies = "".join(block.body for block in page if block.kind == "sh" and name != "README")
        written = [*re.findall(r"^olp init (\S+)", bodies, re.MULTILINE), *(b.file for b in page if b.file)]
        assert {file: own.setdefault(file, name) for file in written} == dict.fromkeys(written, name)


@pytest.mark.slow
def test_the_readme_runs_from_top_to_bottom(folder: Path) -> None:
    assert list(problems(PAPERS["README"], folder)) == []


@pytest.mark.slow
def test_the_pages_run_in_the_order_of_reading(folder: Path) -> None:
    pages = [page for name, page in PAPERS.items() if name != "README"]
    assert [problem for page in pages for problem in problems(page, folder, called)] == []


@pytest.mark.slow
def test_set_up_from_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands of the README, in a copy of the checkout and an environment of their own."""
    copy = tmp_path / "checkout"
    shutil.copytree(ROOT, copy, ignore=NEVER_COPIED)
    for name in (".gitignore", ".ci"):
        source = ROOT / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, copy / name)
    # most of what is installed is never imported here
    monkeypatch.setenv("PIP_NO_COMPILE", "1")
    first, second = (block for block in blocks(README, "README") if block.set_up and block.kind == "sh")
    code, text = run(first.body, copy, timeout_s=900.0)
    assert code == 0, text
    assert "What this proves" in text
    assert (copy / "first-plate.ngc").stat().st_size > 0
    # the whole suite has a run of its own
    assert second.body.rstrip().endswith("pytest -q -n 2")
    code, text = run(f"{second.body.rstrip()} tests/core/test_patterns.py", copy, timeout_s=900.0)
    assert code == 0, text
    assert re.search(r"\d+ passed", text)


@pytest.mark.parametrize("name", PAPERS)
def test_commands_of_one_shell_stand_beside_those_of_the_other(name: str) -> None:
    for block in PAPERS[name]:
        if block.kind == "sh" and _OF_BASH.search(block.body):
            assert block.next_kind == "powershell", block.body
