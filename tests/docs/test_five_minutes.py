"""The walk of the shortest page: ten lines typed, from nothing to a corrected program."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from docs.blocks import DOCS, ROOT, Block, blocks, problems

PAGE = blocks(DOCS / "tutorials" / "five-minutes.md", "tutorials/five-minutes")
MOST_LINES = 10


def typed(block: Block) -> list[str]:
    """The lines that a person writes; the comment that names a file is none of them."""
    if block.kind not in ("sh", "toml"):
        return []
    return [line for line in block.body.splitlines() if line.strip() and not line.startswith("#")]


def test_at_most_ten_lines_are_typed() -> None:
    lines = [line for block in PAGE for line in typed(block)]
    assert 3 < len(lines) <= MOST_LINES
    assert any(line.startswith("olp correct") for line in lines)


@pytest.mark.slow
def test_the_walk_alone_leads_to_a_corrected_program(tmp_path: Path) -> None:
    """Nothing is there but the files of the instruments, and no other page was read."""
    for name in ("gantry-lines/laser.toml", "gantry-checks/ballbar-xy.csv"):
        (tmp_path / "programs" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "programs" / name, tmp_path / "programs" / name)
    for axis in "xyz":
        shutil.copy(
            ROOT / "programs" / "gantry-lines" / f"laser-{axis}.txt", tmp_path / "programs" / "gantry-lines"
        )
    assert list(problems(PAGE, tmp_path)) == []
    nominal, corrected = ((tmp_path / name).read_text() for name in ("five/first.nc", "five.nc"))
    assert nominal.startswith("%\nO0001")
    assert "G1 X" in corrected
    assert nominal != corrected
