"""Programs of blocks for tests of the reader: a machine with offsets and tools, what is read, what is
refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from cases.acceptance import machine

from olp.core.errors import ProgramError
from olp.core.machine import Setup, Tool, WorkOffset
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.program.dialect import Options
from olp.program.program import Program
from olp.program.registry import DIALECTS, read

OFFSETS = {
    name: WorkOffset(name, offset_mm=xyz, set_by="true")
    for name, xyz in (
        ("G54", (100.0, 200.0, 300.0)),
        ("G55", (10.0, 20.0, 30.0)),
        ("G59.3", (1.0, 2.0, 3.0)),
        ("G54.1 P7", (7.0, 8.0, 9.0)),
        ("G154 P2", (4.0, 5.0, 6.0)),
        ("G112", (2.0, 4.0, 8.0)),
    )
} | {
    "G56": WorkOffset("G56", rotation_deg=(0.0, 0.0, 90.0), set_by="true"),
    "G57": WorkOffset("G57", offset_mm=(70.0, 80.0, 90.0), touch_tool=2),
}
TOOLS = {
    1: Tool(1, length_mm=(0.0, 0.0, 50.0), radius_mm=4.0),
    2: Tool(2, length_mm=(1.0, 2.0, 60.0)),
    3: Tool(3, length_mm=(0.0, 0.0, 80.0), radius_mm=-3.0, set_by="touch", touched_at_mm=(5.0, 6.0, 7.0)),
}


def setup_of(folder: Path, control: str = "linuxcnc", **job: object) -> Setup:
    """A machine with `OFFSETS` and `TOOLS`; `job` are fields of the job."""
    setup = load_setup(machine(folder, controller=control))
    there = replace(setup.machine, work_offsets=OFFSETS, tools=TOOLS)
    return replace(setup, machine=there, job=replace(setup.job, **job))  # type: ignore[arg-type]


def program(text: str, setup: Setup, control: str = "linuxcnc", **options: bool) -> Program:
    return read(text.encode("latin-1"), setup, DIALECTS[control], Options(**options))


def moves(read_: Program) -> list[tuple[object, ...]]:
    """Line, kind, flags, end (None where not known) and the texts of its words, of each move."""
    path, words = read_.toolpath, read_.words
    assert words is not None
    rows = []
    for row in range(len(path)):
        end = tuple(None if math.isnan(v) else v for v in path.end_mm[row].tolist())
        slots = [i for i in read_.slot[row].tolist() if i >= 0]
        texts = " ".join(read_.data[words.start[i] : words.end[i]].decode() for i in slots)
        kind, flag = Kind(int(path.kind[row])).name, Flag(int(path.flag[row]))
        rows.append((int(path.line[row]), kind, flag, end, texts))
    return rows


def refusal(text: str, setup: Setup, control: str = "linuxcnc", **options: bool) -> dict[str, object]:
    """What is said of a program that is refused: its first line, sentence, code, and what else it names."""
    with pytest.raises(ProgramError) as caught:
        program(text, setup, control, **options)
    error = caught.value
    said: Mapping[str, object] = {
        "line": error.line,
        "why": error.message,
        "code": error.code,
        "word": error.word,
        "hint": error.hint,
        "missing": error.missing,
        "others": tuple(other.line for other in error.others),
    }
    return {name: value for name, value in said.items() if value or name in ("line", "why", "code")}
