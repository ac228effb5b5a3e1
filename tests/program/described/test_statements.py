"""Statements of a described language by hand: positions, units, frames, tools, speeds, sections, comments."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.acceptance import machine
from cases.readings import said, text_of, word_of

from olp.core.errors import ConfigError, ProgramError
from olp.core.machine import Setup
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.files.described import load_described
from olp.program.described import reader
from olp.program.described.forms import form
from olp.program.described.language import UserDialect
from olp.program.described.lines import Text
from olp.program.dialect import Support
from olp.program.program import Program
from olp.program.registry import read

SMALL = """schema = "olp-dialect-1"
name = "small"
title = "A small language"
unit = "mm"
speed_unit = "mm/s"
comments = ["!", "//"]
quote = "'"
continuation = "&"
terminator = ";"
label = "N{number}"
carry = ["SAY ...", "AT{number} GO"]
[refuse]
"LOOP ..." = "write it out"
[[statements]]
form = "GO X{x} Y{y} Z{z} [A{a}] [B{b}] [C{c}] [V{speed}]"
does = "rapid"
[[statements]]
form = "TAG '...' GO X{x} Y{y} Z{z}"
does = "rapid"
[[statements]]
form = "CUT {x}, {y}, {z} [V{speed}]"
does = "line"
[[statements]]
form = "SLOW {x} {y} {z} F{speed}"
does = "line"
speed_unit = "mm/min"
[[statements]]
form = "STEP {x} {y} {z}"
does = "line"
incremental = true
[[statements]]
form = "PART [X{x}] [Y{y}] [Z{z}]"
does = "line"
[[statements]]
form = "MOVE {target} [V{speed}]"
does = "line"
[[statements]]
form = "JUMP {target}"
does = "rapid"
[[statements]]
form = "POS {target} {x} {y} {z} [A{a}]"
does = "point"
[[statements]]
form = "{target} {x} {y} {z}"
does = "point"
inside = "points"
[[statements]]
form = "HOME"
does = "away"
[[statements]]
form = "HALT"
does = "refuse"
[[statements]]
form = "TOOL {tool}"
does = "tool"
[[statements]]
form = "FRAME {frame}"
does = "frame"
[[statements]]
form = "BASE"
does = "frame"
frame = "G55"
[[statements]]
form = "WORLD"
does = "frame"
[[statements]]
form = "INCH"
does = "unit"
unit = "inch"
[[statements]]
form = "METRIC"
does = "unit"
unit = "mm"
[[statements]]
form = "SPEED {speed}"
does = "speed"
[[statements]]
form = "QUICK {speed}"
does = "speed"
speed_unit = "m/s"
[[statements]]
form = ".PROGRAM {word}"
does = "section"
enters = "main"
[[statements]]
form = ".POINTS"
does = "section"
enters = "points"
[[statements]]
form = ".END"
does = "section"
enters = ""
"""
TABLES = (
    '[work_offsets.G54]\nset_by = "true"\nX_mm = 100.0\n[work_offsets.G55]\nset_by = "true"\nC_deg = 90.0\n'
    "[tools.1]\nZ_mm = 30.0\n[tools.2]\nZ_mm = 40.0\n"
)
R, L = Kind.RAPID, Kind.LINE
W, I, C = Flag.WHOLE, Flag.INCREMENTAL, Flag.CONTROL  # noqa: E741
NAN = math.nan


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> UserDialect:
    path = tmp_path_factory.mktemp("small") / "small.toml"
    path.write_text(SMALL)
    dialect = load_described(path)
    assert isinstance(dialect, UserDialect)
    return dialect


@pytest.fixture(scope="module")
def setup(tmp_path_factory: pytest.TempPathFactory) -> Setup:
    path = machine(tmp_path_factory.mktemp("small"), tables=TABLES, job="start_mm = { X = 1.0, Y = 2.0 }")
    return load_setup(path, path.with_name("job.toml"))


@pytest.fixture(params=("similar lines at once", "each line alone"))
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    if request.param == "each line alone":
        monkeypatch.setattr(reader, "same_form_of", lambda *_: None)
    return str(request.param)


def moves_of(program: Program) -> list[tuple[int, int, int, list[float], bytes, float]]:
    """Of each move: its line, kind, flag, end, the bytes that state it, and its feed."""
    path, statements = program.toolpath, program.statements
    assert statements is not None
    bounds = zip(statements.begin.tolist(), statements.end.tolist(), strict=True)
    return [
        (line, kind, flag, end, text_of(program, a, b), feed)
        for line, kind, flag, end, (a, b), feed in zip(
            path.line.tolist(), path.kind.tolist(), path.flag.tolist(), path.end_mm.tolist(), bounds,
            statements.feed_mm_s.tolist(), strict=True,
        )
    ]  # fmt: skip


INF = math.inf
#: text, and of each move its line, kind, flag, end, text and feed
TEXTS: dict[str, tuple[str, list[tuple[int, int, int, list[float], str, float]]]] = {
    "moves": ("GO X1 Y2 Z3\nCUT 4.5, -5, .5\n", [(1, R, 0, [101, 2, 3], "GO X1 Y2 Z3", INF),
                                                 (2, L, 0, [104.5, -5, 0.5], "CUT 4.5, -5, .5", NAN)]),
    "similar ones": (
        "CUT 1, 2, 3 V5\nCUT 10, 20.5, 30 V60.5\n\n  cut 1,2,3\n  cut 4,5,6\nCUT 7, 8, 9 V.5\n",
        [(1, L, 0, [101, 2, 3], "CUT 1, 2, 3 V5", 5), (2, L, 0, [110, 20.5, 30], "CUT 10, 20.5, 30 V60.5",
        60.5),
         (4, L, 0, [101, 2, 3], "  cut 1,2,3", 60.5), (5, L, 0, [104, 5, 6], "  cut 4,5,6", 60.5),
         (6, L, 0, [107, 8, 9], "CUT 7, 8, 9 V.5", 0.5)],
    ),
    "labels, ends and comments": (
        "N10 CUT 1, 2, 3;\nN2000 CUT 11, 2, 3 ;\nN3 CUT 21, 2, 3; ! X\nN4 CUT 31, 2, 3 // Y 5\n! Z\n",
        [(1, L, 0, [101, 2, 3], " CUT 1, 2, 3;", NAN), (2, L, 0, [111, 2, 3], " CUT 11, 2, 3 ;", NAN),
         (3, L, 0, [121, 2, 3], " CUT 21, 2, 3;", NAN), (4, L, 0, [131, 2, 3], " CUT 31, 2, 3", NAN)],
    ),
    "lines that go on": (
        "CUT 1, &\n 2, 3\nN1 CUT 4, & \n 5, & ! X\n 6 ! Y\n",
        [(1, L, 0, [101, 2, 3], "CUT 1, &\n 2, 3", NAN), (3, L, 0, [104, 5, 6], " CUT 4, & \n 5, & ! X\n 6",
        NAN)],
    ),
    "distances": ("CUT 1, 2, 3\nSTEP 1 0 .5\nSTEP 1 -2 .5\n", [
        (1, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN), (2, L, I, [102, 2, 3.5], "STEP 1 0 .5", NAN),
        (3, L, I, [103, 0, 4], "STEP 1 -2 .5", NAN)]),
    "axes that are left out": ("CUT 1, 2, 3\nPART Z5\nPART X7 Z6\nPART X1 Y2 Z3\nPART Y9\n", [
        (1, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN), (2, L, W, [101, 2, 5], "PART Z5", NAN),
        (3, L, W, [107, 2, 6], "PART X7 Z6", NAN), (4, L, 0, [101, 2, 3], "PART X1 Y2 Z3", NAN),
        (5, L, W, [101, 9, 3], "PART Y9", NAN)]),
    "positions with names": (
        "POS a 1 2 3\nMOVE a V5\nJUMP B\nMOVE b\nMOVE a[1,2]\nPOS B 4 5 6\nPOS A[1,2] 7 8 9\n",
        [(2, L, W, [101, 2, 3], "", 5), (3, R, 0, [104, 5, 6], "", INF), (4, L, W, [104, 5, 6], "", 5),
         (5, L, W, [107, 8, 9], "", 5)],
    ),
    "units": ("CUT 1, 2, 3\nINCH\nPOS a 1 0 0\nCUT 1, 2, 3\nMETRIC\nMOVE a\nCUT 2, 2, 3\n", [
        (1, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN), (4, L, 0, [125.4, 50.8, 76.2], "CUT 1, 2, 3", NAN),
        (6, L, W, [125.4, 0, 0], "", NAN), (7, L, 0, [102, 2, 3], "CUT 2, 2, 3", NAN)]),
    "frames": ("BASE\nCUT 1, 2, 3\nPART X4\nSTEP 1 0 0\nWORLD\nCUT 1, 2, 3\nFRAME G55\nCUT 1, 2, 3\n", [
        (2, L, 0, [-2, 1, 3], "CUT 1, 2, 3", NAN), (3, L, W, [-2, 4, 3], "PART X4", NAN),
        (4, L, I, [-2, 5, 3], "STEP 1 0 0", NAN), (6, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN),
        (8, L, 0, [-2, 1, 3], "CUT 1, 2, 3", NAN)]),
    "turned frames in inches": ("BASE\nINCH\nCUT 1, 2, 3\nPART X4\nSTEP 1 0 0\n", [
        (3, L, 0, [-50.8, 25.4, 76.2], "CUT 1, 2, 3", NAN), (4, L, W, [-50.8, 101.6, 76.2], "PART X4", NAN),
        (5, L, I, [-50.8, 127, 76.2], "STEP 1 0 0", NAN)]),
    "speeds": (
        "SPEED 5\nCUT 1, 2, 3\nSLOW 1 2 4 F60\nCUT 1, 2, 5\nQUICK 2\nCUT 1, 2, 6\nGO X1 Y2 Z7 V9\nCUT "
        "1, 2, 8\n"
        "SLOW 1 2 9 F120\nSLOW 1 2 8 F30\n",
        [(2, L, 0, [101, 2, 3], "CUT 1, 2, 3", 5), (3, L, 0, [101, 2, 4], "SLOW 1 2 4 F60", 1),
         (4, L, 0, [101, 2, 5], "CUT 1, 2, 5", 1), (6, L, 0, [101, 2, 6], "CUT 1, 2, 6", 2000),
         (7, R, 0, [101, 2, 7], "GO X1 Y2 Z7 V9", INF), (8, L, 0, [101, 2, 8], "CUT 1, 2, 8", 9),
         (9, L, 0, [101, 2, 9], "SLOW 1 2 9 F120", 2), (10, L, 0, [101, 2, 8], "SLOW 1 2 8 F30", 0.5)],
    ),
    "away": ("CUT 1, 2, 3\nHOME\nCUT 1, 2, 3\n", [
        (1, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN), (2, R, C, [NAN] * 3, "", INF),
        (3, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN)]),
    "sections": (".PROGRAM x\nMOVE p\nCUT 1, 2, 3\n.END\n.POINTS\np 4 5 6\n.END\n", [
        (2, L, W, [104, 5, 6], "", NAN), (3, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN)]),
    "quotes": ("SAY '! // ' CUT\nSAY 'a' ! 'b\nCUT 1, 2, 3 ! 'c\nSAY '// !\n", [
        (3, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN)]),
    "comments behind quotes": (
        "TAG 'a ! // b' GO X1 Y2 Z3 ! c\nTAG '' GO X4 Y5 Z6 // 'c' ! d\nTAG 'e' GO X7 Y8 Z9\n",
        [(1, R, 0, [101, 2, 3], "TAG 'a ! // b' GO X1 Y2 Z3", INF), (2, R, 0, [104, 5, 6],
        "TAG '' GO X4 Y5 Z6", INF),
         (3, R, 0, [107, 8, 9], "TAG 'e' GO X7 Y8 Z9", INF)],
    ),
    "forms with digits": ("AT5 GO\nat7 go\nGO X1 Y2 Z3\nGO X2 Y2 Z3\n", [
        (3, R, 0, [101, 2, 3], "GO X1 Y2 Z3", INF), (4, R, 0, [102, 2, 3], "GO X2 Y2 Z3", INF)]),
    "line ends of Windows": ("\ufeffCUT 1, 2, 3\r\nCUT 4, 5, 6\r\n", [
        (1, L, 0, [101, 2, 3], "CUT 1, 2, 3", NAN), (2, L, 0, [104, 5, 6], "CUT 4, 5, 6", NAN)]),
    "many forms of numbers": ("CUT 1., +.5, -1e1\nCUT 2., +.5, -2e1\nCUT 00012, 1.50E+00, 3\n", [
        (1, L, 0, [101, 0.5, -10], "CUT 1., +.5, -1e1", NAN), (2, L, 0, [102, 0.5, -20], "CUT 2., +.5, -2e1",
         NAN),
        (3, L, 0, [112, 1.5, 3], "CUT 00012, 1.50E+00, 3", NAN)]),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_statements_move_as_their_forms_say(name: str, way: str, small: UserDialect, setup: Setup) -> None:
    text, want = TEXTS[name]
    got = moves_of(read(text.encode(), setup, small))
    assert [(line, kind, flag) for line, kind, flag, *_ in got] == [move[:3] for move in want]
    assert [text.strip() for *_, text, _ in got] == [text.strip().encode() for *_, text, _ in want]
    assert np.array([move[3] for move in got]) == pytest.approx(
        np.array([move[3] for move in want], float), nan_ok=True
    )
    assert [move[5] for move in got] == pytest.approx([move[5] for move in want], nan_ok=True)


@pytest.mark.parametrize("name", TEXTS)
def test_both_ways_say_the_same(
    name: str, small: UserDialect, setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    once = name in ("sections", "positions with names", "units", "line ends of Windows")
    data = (TEXTS[name][0] * (1 if once else 3)).encode()
    fast = said(read(data, setup, small))
    monkeypatch.setattr(reader, "same_form_of", lambda *_: None)
    assert said(read(data, setup, small)) == fast


def test_similar_lines_are_matched_once(
    small: UserDialect, setup: Setup, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A program of many moves is compared with the forms once per kind of line."""
    matched: list[int] = []
    match = reader._Reader._rule

    def counted(self: Any, line: Any) -> Any:
        matched.append(line.number)
        return match(self, line)

    monkeypatch.setattr(reader._Reader, "_rule", counted)
    lines = [
        "CUT 1, 2, 3",
        "N5 GO X1 Y2 Z3 A4 V5",
        "CUT 11, .2, 3.5",
        "N60 GO X1 Y22 Z3 A.4 V5",
        "GO X1 Y2 Z3 A4 V5",
    ]
    assert len(read("\n".join(lines * 20).encode(), setup, small).toolpath) == 100
    assert matched == [1, 2, 5]
    matched.clear()
    # where a number ends, where a line has more of them, and what is no move
    more = [
        "PART X1",
        "PART X2",
        "STEP 1 1 1",
        "STEP 1 1 2",
        "CUT 1, 2, 3 ! 4",
        "CUT 1, 2, 3 ! 5",
        "TOOL 1",
        "TOOL 2",
    ]
    read("\n".join(["CUT 1, 2, 3", *more]).encode(), setup, small)
    assert matched == [1, 2, 3, 4, 5, 6, 7, 8, 9]


def test_the_words_of_a_move_are_its_numbers(way: str, small: UserDialect, setup: Setup) -> None:
    text = b"POS p 1.5 2 3\nGO X7 Y8 Z9 A1 V5\nGO X17 Y.8 Z-9.0 A11 V15\nPART Z4\nMOVE p\nMOVE p\nHOME\n"
    program = read(text, setup, small)
    words = [[word_of(program, k) for k in row] for row in program.slot.tolist()]
    texts = [[None if word is None else word[0] for word in row] for row in words]
    point = [b"1.5", b"2", b"3"]
    assert texts == [
        [b"7", b"8", b"9"], [b"17", b".8", b"-9.0"], [None, None, b"4"], point, point, [None] * 3
    ]  # fmt: skip


def test_tools_and_frames_of_moves(way: str, small: UserDialect, setup: Setup) -> None:
    text = b"CUT 1, 2, 3\nTOOL 2\nCUT 1, 2, 3\nCUT 1, 2, 4\nTOOL 1\nBASE\nCUT 1, 2, 3\nTOOL 0\nHOME\n"
    path = read(text, setup, small).toolpath
    frames = [path.frames[k] for k in path.frame.tolist()]
    assert [(f.work_offset, f.tool) for f in frames] == [
        ("G54", None), ("G54", 2), ("G54", 2), ("G55", 1), ("G55", None)
    ]  # fmt: skip
    assert [f.tool_mm[2] for f in frames] == [0, -40, -40, -30, 0]
    assert path.start_mm[:2] == (1.0, 2.0)
    assert math.isnan(path.start_mm[2])


def test_the_length_of_a_tool_counts_where_the_machine_says_so(tmp_path: Path, small: UserDialect) -> None:
    tables = TABLES + "[job_defaults]\nlength_active = true\ntool = 2\n"
    setup = load_setup(machine(tmp_path, tables=tables))
    text = b"CUT 1, 2, 3\nPART X4\nTOOL 1\nBASE\nCUT 1, 2, 3\nPART X4\nSTEP 0 0 1\n"
    path = read(text, setup, small).toolpath
    want = [[101, 2, 43], [104, 2, 43], [-2, 1, 33], [-2, 4, 33], [-2, 4, 34]]
    assert path.end_mm == pytest.approx(np.array(want, float))
    assert [path.frames[k].tool for k in path.frame.tolist()] == [2, 2, 1, 1, 1]


def test_where_a_program_begins_is_that_of_the_job(small: UserDialect, setup: Setup) -> None:
    unknown = read(b"STEP 1 1 1\nPART Z5\n", setup, small).toolpath.end_mm
    np.testing.assert_equal(unknown, [[2.0, 3.0, NAN], [2.0, 3.0, 5.0]])
    known = replace(setup, job=replace(setup.job, start_mm=(1.0, 2.0, 3.0)))
    assert read(b"STEP 1 1 1\nPART X5\n", known, small).toolpath.end_mm.tolist() == [[2, 3, 4], [105, 3, 4]]


# -- remarks and refusals ------------------------------------------------------------------------------


def remarked(text: str, small: UserDialect, setup: Setup) -> list[tuple[str, int, str]]:
    return list(read(text.encode(), setup, small).remarks)


def test_what_is_remarked(way: str, small: UserDialect, setup: Setup) -> None:
    told = "positions are stated in G54"
    turning = "the orientation changes from move to move"
    assert remarked("SAY a\nCUT 1, 2, 3\nCUT 1, 2, 4\n", small, setup) == [("told", 2, told)]
    assert remarked("CUT 1, 2, 3\nWORLD\nCUT 1, 2, 4\n", small, setup) == [("told", 1, told)]
    assert remarked("WORLD\nCUT 1, 2, 3\n", small, setup) == []
    go = "WORLD\n" + "".join(f"GO X{k} Y2 Z3 A{a}\n" for k, a in enumerate((0, 0, 90, 0)))
    assert remarked(go, small, setup) == [("turning", 4, turning)]
    same = "WORLD\n" + "".join(f"GO X{k} Y2 Z3 A5 B{k // 3} C7\n" for k in range(5))
    assert remarked(same, small, setup) == [("turning", 5, turning)]
    assert remarked("WORLD\nGO X1 Y2 Z3 A5\nGO X1 Y2 Z3\nGO X2 Y2 Z3 A5\n", small, setup) == []
    points = "WORLD\nPOS a 1 2 3 A1\nPOS b 1 2 3 A2\nMOVE a\nMOVE b\n"
    assert remarked(points, small, setup) == [("turning", 5, turning)]
    assert remarked("HOME\nBASE\nCUT 1, 2, 3\n", small, setup) == [("told", 1, told)]


@pytest.mark.parametrize(
    ("text", "line", "code", "words"),
    [
        ("\xff\xfeC", 1, "OLP502", "the text is UTF-16"),
        ("\xfe\xffC", 1, "OLP502", "the text is UTF-16"),
        ("SAY a\nSAY " + "b" * 3997, 2, "OLP505", "has 4001 characters; expected at most 4000"),
        ("SAY a\n  RUN b; ! c\n", 2, "OLP510", r"`RUN b;` is not a statement of the dialect small"),
        ("CUT 1, 2\n", 1, "OLP510", r"`CUT 1, 2` is not a statement"),
        ("p 1 2 3\n", 1, "OLP510", r"`p 1 2 3` is not a statement"),
        ("R" + "u" * 80, 1, "OLP510", f"`R{'u' * 59}` is not a statement"),
        ("SAY a\n loop 5\n", 2, "OLP512", r"`loop 5` is not read: write it out"),
        ("HALT\n", 1, "OLP512", r"`HALT` is not read: it may move the machine"),
        ("SAY a\nTOOL 1.5\n", 2, "OLP516", r"tool 1\.5 is not a tool number"),
        ("SAY a\nTOOL 9\nCUT 1, 2, 3\n", 3, "OLP521", "tool 9 is in the spindle"),
        ("FRAME G57\nCUT 1, 2, 3\n", 2, "OLP520", "this position needs the frame G57"),
        ("SAY a\nMOVE q\n", 2, "OLP533", "the position q is not defined in this text"),
        ("POS q 1 2 3\nPOS Q 1 2 4\nPOS q 1 2 5\nMOVE q\n", 4, "OLP533",
         "the position q is defined twice, in lines 1 and 3"),
        ("CUT 1, 2&\n3, 4\nCUT 1, 2, 3&\n4\n", 1, "OLP510", "is not a statement"),
        (".PROGRAM a\nCUT 1, 2, 3\nCUT 1, 2, 4\n.PROGRAM b\nCUT 1, 2, 3\nCUT 1, 2, 3\n", 5, "OLP532",
         "moves in two parts, here and from line 2 on"),
    ],
)  # fmt: skip
def test_a_refusal_has_its_line_its_code_and_its_sentence(
    text: str, line: int, code: str, words: str, way: str, small: UserDialect, setup: Setup
) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        read(text.encode("latin-1"), setup, small)
    assert (caught.value.line, caught.value.code) == (line, code)


def test_bounds_of_a_statement(small: UserDialect, setup: Setup) -> None:
    long = "SAY " + "b" * 3996
    assert len(read(f"{long}\nCUT 1, 2, 3\n".encode(), setup, small).toolpath) == 1


def test_a_language_without_a_unit_states_it(small: UserDialect, setup: Setup) -> None:
    bare = replace(small, unit=None, speed_unit=None)
    for text, line in (("SAY a\nCUT 1, 2, 3\n", 2), ("POS a 1 2 3\n", 1), ("SAY a\nHOME\n", 2)):
        with pytest.raises(ProgramError, match="no unit is stated before this position") as caught:
            read(text.encode(), setup, bare)
        assert (caught.value.line, caught.value.code) == (line, "OLP516")
    program = read(
        b"INCH\nSPEED 5\nCUT 1, 2, 3\nCUT 1, 2, 3 V5\nCUT 1, 2, 4 V5\nSLOW 1 2 3 F60\n", setup, bare
    )
    assert program.toolpath.end_mm[0].tolist() == pytest.approx([125.4, 50.8, 76.2])
    assert program.statements is not None
    assert program.statements.feed_mm_s.tolist() == pytest.approx([NAN, NAN, NAN, 1.0], nan_ok=True)


def test_case_counts_where_the_language_says_so(tmp_path: Path, setup: Setup) -> None:
    path = tmp_path / "strict.toml"
    path.write_text(SMALL.replace('unit = "mm"\n', 'unit = "mm"\nignore_case = false\n', 1))
    strict = load_described(path)
    text = b"POS a 1 2 3\nPOS A 4 5 6\nMOVE A\nMOVE a\n"
    assert read(text, setup, strict).toolpath.end_mm[:, 0].tolist() == [104.0, 101.0]
    with pytest.raises(ProgramError, match="`move a` is not a statement"):
        read(text + b"move a\n", setup, strict)


# -- the lines of a text -------------------------------------------------------------------------------


def numbers_of(text: Text) -> list[tuple[bytes, float]]:
    """The numbers of a text, as written and as values."""
    spans = zip(text.first.tolist(), text.last.tolist(), text.value.tolist(), strict=True)
    return [(text.data[a:b], value) for a, b, value in spans]


def test_the_numbers_of_a_text() -> None:
    text = Text(b"\xef\xbb\xbfA 1.5 B-2\r\n\r\nC x+10e3, 4.25/5 --6 7.8.9\r\n")
    assert numbers_of(text) == [
        (b"1.5", 1.5), (b"-2", -2.0), (b"+10", 10.0), (b"3", 3.0), (b"4.25", 4.25), (b"5", 5.0), (b"--6",
         0.0),
        (b"7.8.9", 0.0),
    ]  # fmt: skip
    assert [text.data[a:b] for a, b in zip(text.start.tolist(), text.end.tolist(), strict=True)] == [
        b"A 1.5 B-2", b"", b"C x+10e3, 4.25/5 --6 7.8.9"
    ]  # fmt: skip
    assert (text.token.tolist(), text.count, text.plain) == ([0, 2, 2, 8], [2, 0, 6], [True, True, False])
    assert text.keys == [b"A  B-", b"", b"C x+e, / -- "]
    # where each number is in its line without digits
    assert text.offset.tolist() == [2, 4, 3, 5, 7, 8, 9, 12]


@pytest.mark.parametrize("end", (b"\n", b"\r\n", b"\r"))
@pytest.mark.parametrize("last", (b"", b"\n"))
def test_the_lines_of_a_text(end: bytes, last: bytes) -> None:
    for head in (b"", b"\xef\xbb\xbf"):
        data = head + b"A1\n\n B 2.5\nC".replace(b"\n", end) + (end if last else b"")
        text = Text(data)
        lines = [data[a:b] for a, b in zip(text.start.tolist(), text.end.tolist(), strict=True)]
        assert lines == [b"A1", b"", b" B 2.5", b"C"]
        assert text.keys == [b"A", b"", b" B ", b"C"]
        assert text.token.tolist() == [0, 1, 1, 2, 2]
    assert Text(b"").keys == []
    assert Text(b"\xef\xbb\xbf").keys == []
    assert Text(b"\n").keys == [b""]


def test_lines_with_numbers_at_other_positions_differ() -> None:
    text = Text(b"A1 B\nA B2\nA3 B\nA B 22\n")
    same, other, again, more = text.places
    assert same == again != other
    assert text.keys[0] == text.keys[1] == text.keys[2] != text.keys[3]
    assert more not in (same, other)


@pytest.mark.parametrize(
    ("number", "plain"),
    [("1", True), ("-1.", True), ("+.5", True), ("1.2.3", False), ("1-2", False), ("+-1", False),
     ("999999999999999", False), ("999999999999", True), ("1" + "0" * 40, False), ("0." + "0" * 37 + "1",
      True)],
)  # fmt: skip
def test_which_numbers_are_read_in_columns(number: str, plain: bool) -> None:
    assert Text(f"A {number} B 1\n".encode()).plain == [plain]


# -- forms ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "fits", "fails"),
    [
        ("GO X{x}", ["GO X1", "go x1", "  GO  X1  ", "GO\tX1"], ["GOX1", "GO X", "GO X1 2", "G O X1"]),
        ("A{x}B{y}", ["A1B2", " A1B2", "A1.5B-2"], ["A1 C2", "A1.5.2B1", "A 1B2", "A1 B2"]),
        ("P={x}", ["P=1", "P = 1"], ["P 1", "P1"]),
        ("SET {target}={x}", ["SET a=1", "SET a.b[1, 2] = 1", "SET _a$=1"], ["SETa=1", "SET 1a=1", "SET =1"]),
        ("<A|B C> {x}", ["A 1", "B C 1"], ["B 1", "C 1", "A1", "AB C 1"]),
        ("A ... B", ["A B", "A x B", "A1 2 B", "AxB"], ["A x", "x B"]),
        ("A[,{x}]B", ["AB", "A,1B", "A , 1 B"], ["A1B", "A,B"]),
        ("A [{x}] {y}", ["A 1", "A 1 2", "A1 2"], ["A", "A 1 2 3"]),
        ("A{x}[E{number}]", ["A1", "A1E5", "A1e5E5"], ["A1E", "AE5"]),
        ("A (B)", ["A (B)", "A(B)", "a ( b )"], ["A B", "A(B"]),
        ("#{tool}", ["#5", " #5"], ["5", "#x", "# 5"]),
        ("A%B.C", ["A%B.C", "a%b.c"], ["A%BxC", "A%B.CD"]),
        ("A {word}", ["A b", "A b.c"], ["A 5", "A", "Ab"]),
        ("{a}{b}", ["1-2", "1+.5"], ["12", "1", "1 2"]),
    ],
)  # fmt: skip
def test_what_a_form_means(text: str, fits: list[str], fails: list[str]) -> None:
    made = form(text, ignore_case=True)
    assert [t for t in fits if not made.pattern.fullmatch(t)] == []
    assert [t for t in fails if made.pattern.fullmatch(t)] == []


@pytest.mark.parametrize(
    ("text", "first", "fields"),
    [("Go X{x}", "GO", {"x"}), ("{target} {x} {y}", "", {"target", "x", "y"}), ("<A|B> {tool}", "", {"tool"}),
     (".end", ".END", set()), ("[A] B", "", set()), ("G{number} {word}", "", set()), ("A[B] C", "", set()),
      ("A<B|C>", "", set()), ("A...", "", set()),
     ("A [B]", "A", set()), ("A={x}", "A", {"x"}), ("... A", "", set()),
     ("A.b$#% {frame}{speed}", "A.B$#%", {"frame", "speed"})],
)  # fmt: skip
def test_how_a_form_begins_and_what_it_states(text: str, first: str, fields: set[str]) -> None:
    loose, strict = form(text, ignore_case=True), form(text, ignore_case=False)
    assert (loose.first, strict.first.upper(), strict.first in text) == (first, first, True)
    assert loose.fields == strict.fields == fields
    assert (loose.text, strict.text) == (text, text)
    assert loose.pattern.flags & re.IGNORECASE
    assert not strict.pattern.flags & re.IGNORECASE


def test_a_form_takes_each_field_from_its_place() -> None:
    match = form("P{x},{y},{z}[,{a}] V{speed}", ignore_case=True).pattern.fullmatch("p-1.5, +2 ,3e-1 V.25")
    assert match is not None
    assert match.groupdict() == {"x": "-1.5", "y": "+2", "z": "3e-1", "a": None, "speed": ".25"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("A [B", "has an opening or closing bracket without the other"), ("A B]",
         "has an opening or closing"),
        ("A ]B[", "has an opening or closing bracket"), ("A {x} {x}", "has a field twice"),
        ("A {q}", r'the form "A {q}" has a field {q}; expected one of x, y, z, a, b, c, speed, blend, '
        r'time, tool, '
         "number, target, frame, word"),
        ("A" + " [B]" * 9, "has 9 optional parts; expected at most 8"),
        ("... A ... B ...", "has 3 places for any text; expected at most 2"),
        ("A" * 501, f'the form "{"A" * 60}..." has 501 characters; expected at most 500'),
    ],
)  # fmt: skip
def test_what_is_no_form(text: str, words: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(words)):
        form(text, ignore_case=True)


def test_bounds_of_forms() -> None:
    for text in ("A" + " [B]" * 8, "... A ...", "A" * 500, "{number} {number} {word} {word}", "[A [B]] C"):
        assert form(text, ignore_case=True).text == text


# -- the dialect ---------------------------------------------------------------------------------------


def test_the_table_of_support_has_a_row_for_each_form(small: UserDialect) -> None:
    rows = {row.statement: (row.support, row.why) for row in small.rows()}
    assert len(rows) == len(small.statements) + 1
    moves = "a move whose path is not stated; corrected at its end"
    assert rows["JUMP {target}"] == (Support.CORRECTED, moves)
    assert rows["CUT {x}, {y}, {z} [V{speed}]"] == (Support.CORRECTED, "a straight move")
    assert rows["{target} {x} {y} {z} (in points)"] == (
        Support.CORRECTED, "a named position; corrected where moves use it"
    )  # fmt: skip
    assert rows["HOME"] == (Support.READ, "moves the machine to a position that the text does not state")
    assert rows["TOOL {tool}"] == (Support.READ, "the tool from here on")
    assert rows["BASE"] == (Support.READ, "the frame from here on")
    assert rows["INCH"] == (Support.READ, "the unit from here on")
    assert rows["SPEED {speed}"] == (
        Support.READ, "the speed from here on, where it is stated in a unit of speed"
    )  # fmt: skip
    assert rows[".END"] == (Support.READ, "begins or ends a part of the text")
    assert rows["SAY ..."] == (Support.UNCHANGED, "")
    assert rows["LOOP ..."] == (Support.REFUSED, "write it out")
    assert rows["any other statement"] == (Support.REFUSED, "it may move the machine")


def test_an_earlier_form_with_digits_comes_first(small: UserDialect, setup: Setup, tmp_path: Path) -> None:
    """Lines that are similar to a move may be of another form."""
    for first in ("CUT 5 {x} ...", "<M3|CUT 5> ..."):
        path = tmp_path / "first.toml"
        row = f'[[statements]]\nform = "{first}"\ndoes = "refuse"\nwhy = "five"\n'
        row += '[[statements]]\nform = "CUT {a} {x} {y} {z}"\ndoes = "line"\n'
        path.write_text(SMALL.replace("[[statements]]\n", row + "[[statements]]\n", 1))
        own = load_described(path)
        assert len(read(b"CUT 4 1 2 3\nCUT 6 1 2 3\n", setup, own).toolpath) == 2
        with pytest.raises(ProgramError, match="is not read: five") as caught:
            read(b"CUT 4 1 2 3\nCUT 6 1 2 3\nCUT 5 1 2 3\n", setup, own)
        assert caught.value.line == 3


def test_lines_that_go_on_end_with_the_mark(small: UserDialect) -> None:
    assert [small.continues(line) for line in (b"A &", b"A & \r\n", b"A & B", b"A", b"&")] == [
        True, True, False, False, True
    ]  # fmt: skip
    assert not replace(small, continuation="").continues(b"A &")


def test_forms_with_digits_are_named_by_their_first_words(small: UserDialect) -> None:
    assert small.numbered == frozenset()
    rule = small.statements[0]

    def numbered(*texts: str) -> frozenset[str] | None:
        rules = tuple(replace(rule, form=form(text, ignore_case=True)) for text in texts)
        return replace(small, statements=rules).numbered

    assert numbered("G1 X{x}", "<M3|go 2> {x}", "P{x}") == {"G", "M", "GO"}
    assert numbered("A{x} B5", "c.d7 {x}", "{x} E5") is None
    assert numbered("A{x} B5", "c.d7 {x}") == {"A", "CD"}
    assert numbered("#5 {x}") == {"#"}
    assert numbered("(5) {x}") is None
