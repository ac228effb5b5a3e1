"""The diff pairs the lines of two texts, whatever they are, and says what changed in um."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from olp.cli.diff import BareMm, _Reader, align, render
from olp.files.starter import starter_machine
from olp.program.rs274.profiles.fanuc import DIALECT as FANUC

LINES = st.lists(
    st.sampled_from(
        ["G1 X1 Y2", "X1.001", "X5", "(note)", "", "M5", "N10 G1 X10 F100", "%", "X[#1+2]", "G91"]
    ),
    max_size=20,
)


@given(before=LINES, after=LINES)
def test_every_line_of_both_texts_shows_once_and_in_order(before: list[str], after: list[str]) -> None:
    nominal, corrected = (_Reader().read("\n".join(lines).encode()) for lines in (before, after))
    pairs = list(align(nominal, corrected, 1000.0))
    assert [i for i, _ in pairs if i is not None] == list(range(len(nominal)))
    assert [j for _, j in pairs if j is not None] == list(range(len(corrected)))
    assert all(i is not None or j is not None for i, j in pairs)


@given(lines=LINES)
def test_the_same_text_has_no_changes(lines: list[str]) -> None:
    text = "\n".join(lines).encode()
    assert render(text, text) == "lines: 0 changed, 0 inserted, 0 left out\n"


@given(before=st.binary(max_size=200), after=st.binary(max_size=200))
def test_any_bytes_can_be_compared(before: bytes, after: bytes) -> None:
    text = render(before, after)
    assert all(c.isprintable() or c == "\n" for c in text)


@given(
    points=st.lists(st.integers(-500, 500), min_size=1, max_size=60, unique=True),
    splits=st.sets(st.integers(0, 59)),
)
def test_parts_of_split_blocks_are_marked_as_inserted(points: list[int], splits: set[int]) -> None:
    """Points 2 mm apart and more, some reached in two blocks; the end of a block keeps its line."""
    nominal = ["G21 G90"] + [f"N{k} G1 X{2 * p} Y3" for k, p in enumerate(points)] + ["M30"]
    corrected = ["G21 G90", "(stamp)"]
    for k, p in enumerate(points):
        if k in splits:
            corrected += [f"N{k} G1 X{2 * p - 1.5} Y3.0010", f"X{2 * p + 0.0123:.4f}"]
        else:
            corrected.append(f"N{k} G1 X{2 * p + 0.0123:.4f} Y3.0010")
    corrected.append("M30")
    rows = render("\n".join(nominal).encode(), "\n".join(corrected).encode()).split("\n")
    split = len(splits & set(range(len(points))))
    assert rows[-2] == f"lines: {len(points)} changed, {1 + split} inserted, 0 left out"
    changed = [row for row in rows if re.match(r" +\d+ ", row)]
    assert len(changed) == len(points)
    assert all("X+12.3" in row for row in changed)


def test_the_parts_of_a_full_circle_belong_to_its_line() -> None:
    nominal = b"G0 X5. Y4.\nG2 I-2.\nG3 I-2.\nG0 X9."
    half = b" X1. Y4.001 I-2.001\nX5.002 Y4.001 I2.\n"
    corrected = b"G0 X5.002 Y4.001\nG2" + half + b"G3" + half + b"G0 X9."
    rows = render(nominal, corrected, near_um=10.0).split("\n")
    assert [row.split()[0] for row in rows[1:-2]] == ["1", "+", "2", "+", "3"]


def changes(nominal: str, corrected: str, bare_mm: BareMm | None = None) -> list[str]:
    """The changes in um that the diff states, one entry a line."""
    rows = render(nominal.encode(), corrected.encode(), bare_mm=bare_mm).split("\n")
    header = rows[0]
    return [row[header.index("change in um") :] for row in rows[1:] if re.match(r" +\d+ ", row)]


@pytest.mark.parametrize(
    ("nominal", "corrected", "expected"),
    [
        ("X1.", "X1.0123", "X+12.3"),
        ("G20 X1.", "G20 X1.001", "X+25.4"),
        ("G0 Y2.\nG1 X5.", "G0 Y2.\nG1 X5. Y2.0031", "Y+3.1"),
        ("G1 X5.", "G1 X5. Y0.0031", "Y new"),
        ("G81 X1. Z-5. R2.\nG80 X2.", "G81 X1. Z-5. R2.\nG80 X2.001 Z2.001", "X+1.0  Z new"),
        ("G92 X3.\nX4.", "G92 X3.\nX4. Z1.", "Z new"),
        ("G0 X1. Y1.\nG91 X1.\nX1.", "G0 X1. Y1.\nG91 X1.\nX1.001 Y0.002", "X+1.0  Y+2.0"),
        ("G0 Y2.\nG28 Y2.\nG1 X5.", "G0 Y2.\nG28 Y2.\nG1 X5. Y2.0031", "Y new"),
        ("G2 X5. I3. J0", "G2 X5. I3.002 J-0.001", "I+2.0  J-1.0"),
        ("X[#1]", "X5.001", "X new"),
        ("G2 X5. I3.", "G2 X5. I-2.", ""),
        ("x1.5 (X9)", "x1.502 (X9)", "X+2.0"),
    ],
)
def test_changes_are_stated_in_um(nominal: str, corrected: str, expected: str) -> None:
    assert changes(nominal, corrected) == [expected]


def fanuc(decimal_point: Literal["increment", "calculator"]) -> BareMm:
    """What a Fanuc with increments of 0.001 mm and 0.0001 inch takes numbers without a point for."""
    machine = starter_machine("mill", "FXYZ", dict.fromkeys("XYZ", (0.0, 100.0)), "fanuc")
    return partial(FANUC.bare_mm, replace(machine, decimal_point=decimal_point))


@pytest.mark.parametrize(
    ("decimal_point", "nominal", "corrected", "expected"),
    [
        ("increment", "X1000", "X1012", "X+12.0"),
        ("increment", "X1000.", "X1000.012", "X+12.0"),
        ("increment", "G2 X1. I1000", "G2 X1. I1.067", "I+67.0"),
        ("increment", "G20 X10000", "G20 X1.0007", "X+17.8"),
        ("calculator", "X10", "X10.067", "X+67.0"),
        ("calculator", "G20 X1", "G20 X1.0007", "X+17.8"),
    ],
)
def test_numbers_without_point_are_read_as_the_control_reads_them(
    decimal_point: Literal["increment", "calculator"], nominal: str, corrected: str, expected: str
) -> None:
    assert changes(nominal, corrected, fanuc(decimal_point)) == [expected]


def test_colours_are_only_around_the_text() -> None:
    nominal, corrected = b"X1.\nX2.\nX3.\n(a)", b"X1.001\n(new)\nX2.002\n(a)"
    plain, coloured = render(nominal, corrected), render(nominal, corrected, colour=True)
    assert "\x1b" in coloured
    stripped = re.sub(r"\x1b\[\d+m", "", coloured)
    assert [row.rstrip() for row in stripped.split("\n")] == plain.split("\n")


def test_texts_with_nothing_in_common_are_set_side_by_side() -> None:
    before = "\n".join(f"X{k}" for k in range(3000))
    after = "\n".join(f"Y{k}" for k in range(3000))
    rows = render(before.encode(), after.encode()).split("\n")
    assert rows[-2] == "lines: 3000 changed, 0 inserted, 0 left out"
    numbers = [int(row.split()[0]) for row in rows[1:-2]]
    assert all(a < b for a, b in pairwise(numbers))
