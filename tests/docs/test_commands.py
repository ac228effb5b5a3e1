"""The commands of the papers run in the order of reading, in one folder, and show what comes out."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from docs.blocks import ROOT, called, papers, problems

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


def test_two_blocks_of_the_readme_need_an_environment() -> None:
    """`.ci/run` carries them out from nothing: the first installs and corrects, the second tests."""
    first, second = (block.body.rstrip() for block in PAPERS["README"] if block.set_up and block.kind == "sh")
    assert first.startswith("python3 -m venv .venv && .venv/bin/pip install")
    assert first.endswith("-o first-plate.ngc")
    assert second.endswith(".venv/bin/pytest -q -n 2")


@pytest.mark.parametrize("name", PAPERS)
def test_commands_of_one_shell_stand_beside_those_of_the_other(name: str) -> None:
    for block in PAPERS[name]:
        if block.kind == "sh" and _OF_BASH.search(block.body):
            assert block.next_kind == "powershell", block.body
