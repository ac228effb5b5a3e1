"""What a correction keeps in memory does not grow with its program."""

from __future__ import annotations

import runpy
import tracemalloc
from itertools import chain
from pathlib import Path

import pytest

import olp
from olp.core import spool
from olp.program.text import columns

PROGRAMS = Path(__file__).resolve().parents[2] / "programs"
MAKE = runpy.run_path(str(PROGRAMS / "generate.py"))
#: Bytes that memory may grow by with each line. Its text alone has 20, and as many when corrected.
_GROWN = 8


@pytest.mark.slow
def test_the_memory_of_a_correction_does_not_grow_with_its_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(spool, "LONG", 1 << 16)
    monkeypatch.setattr(columns, "_MOST", 1 << 13)

    def peak(lines: int) -> int:
        path = tmp_path / "raster.ngc"
        path.write_text("\n".join(chain(MAKE["START"], MAKE["raster"](lines), MAKE["END"])) + "\n")
        tracemalloc.start()
        olp.correct(path, PROGRAMS / "gantry-plate" / "machine.toml").write(tmp_path / "out.ngc", force=True)
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    peak(100)
    assert peak(160_000) - peak(80_000) < _GROWN * 80_000
