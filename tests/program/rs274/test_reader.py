"""Whole programs by hand: every column of what is read, in one chunk and line by line."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest
from cases.blocks import moves, program, refusal, setup_of

from olp.core.machine import Setup
from olp.core.toolpath import Flag
from olp.program.rs274 import reader
from olp.program.rs274.lexer import chunks

ALL = ("linuxcnc", "fanuc", "haas", "grbl")
PASS, DELETED, CYCLE, WHOLE = Flag.PASS, Flag.DELETED, Flag.CYCLE, Flag.WHOLE
INCREMENTAL, MACHINE, INVERSE, CONTROL = Flag.INCREMENTAL, Flag.MACHINE, Flag.INVERSE_TIME, Flag.CONTROL
NONE = Flag(0)
INCH = 25.4
UNROLL = "unroll the program with --flatten"


@pytest.fixture(scope="module")
def setups(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Setup]:
    return {control: setup_of(tmp_path_factory.mktemp(control), control) for control in ALL}


@pytest.fixture(params=["at once", "line by line"])
def size(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """How many lines are in a chunk: what is read does not depend on it."""
    if request.param == "line by line":
        monkeypatch.setattr(reader, "chunks", functools.partial(chunks, size=1))
    return str(request.param)


MILLED = """\
%
G21 G90 G17 G54 G94 F60
G0 X1 Y2 Z3
G1 X2
G2 X4 I1 J0
G3 Y4 J1 P2
G1 A5 X5
G91 X-1 Z2
G93 G90 X1 F2
G94 F60 (olp off)
Y1 (c)
(olp on)
G90.1 G2 X3 I2 J1
G91.1
/X5 I1
G1 B4
G20 X4 Z2
G18 G3 X3 Z3 R1
G55 G1 Y1
G53 G0 Z9
G21 G38.2 Z1
M2
G1 X9
"""
#: The columns of its arcs: the move, centre, plane, sweep, words, and whether the centre is absolute.
ARCS = [
    (2, (103.0, 202.0, 303.0), 0, -math.pi, "I1 J0", False),
    (3, (104.0, 203.0, 303.0), 0, 3 * math.pi, "J1 P2", False),
    (8, (102.0, 201.0, 305.0), 0, -math.pi, "I2 J1", True),
    (9, (104.0, 201.0, 305.0), 0, -math.pi, "I1", False),
    (12, (100.0 + 4 * INCH, 201.0, 300.0 + 3 * INCH), 1, math.pi / 2, "R1", False),
]


def test_a_milling_program_is_read_column_by_column(setups: dict[str, Setup], size: str) -> None:
    read = program(MILLED, setups["linuxcnc"])
    x, y, z = 100.0 + 3 * INCH, 20.0 + INCH, 300.0 + 3 * INCH
    assert moves(read) == [
        (3, "RAPID", NONE, (101.0, 202.0, 303.0), "X1 Y2 Z3"),
        (4, "LINE", NONE, (102.0, 202.0, 303.0), "X2"),
        (5, "ARC_CW", NONE, (104.0, 202.0, 303.0), "X4"),
        (6, "ARC_CCW", NONE, (104.0, 204.0, 303.0), "Y4"),
        (7, "LINE", WHOLE, (105.0, 204.0, 303.0), "X5"),
        (8, "LINE", INCREMENTAL, (104.0, 204.0, 305.0), "X-1 Z2"),
        (9, "LINE", INVERSE, (101.0, 204.0, 305.0), "X1"),
        (11, "LINE", PASS, (101.0, 201.0, 305.0), "Y1"),
        (13, "ARC_CW", NONE, (103.0, 201.0, 305.0), "X3"),
        (15, "ARC_CW", DELETED, (105.0, 201.0, 305.0), "X5"),
        (16, "LINE", WHOLE, (105.0, 201.0, 305.0), ""),
        (17, "LINE", NONE, (100.0 + 4 * INCH, 201.0, 300.0 + 2 * INCH), "X4 Z2"),
        (18, "ARC_CCW", NONE, (x, 201.0, z), "X3 Z3"),
        (19, "LINE", NONE, (x, y, z), "Y1"),
        (20, "RAPID", PASS | MACHINE, (x, y, 9 * INCH), "Z9"),
        (21, "PROBE", NONE, (x, y, 31.0), "Z1"),
        (21, "RAPID", PASS | CONTROL, (x, y, None), ""),
    ]
    arcs, words = read.toolpath.arcs, read.words
    assert words is not None
    texts = [
        " ".join(MILLED[words.start[i] : words.end[i]] for i in row if i >= 0)
        for row in read.arc_slots.word.tolist()
    ]
    for row, (move, centre, plane, sweep, text, absolute) in enumerate(ARCS):
        assert arcs.move[row] == move
        assert arcs.centre_mm[row].tolist() == pytest.approx(centre, abs=1e-12)
        assert (arcs.plane[row], texts[row]) == (plane, text)
        assert arcs.sweep_rad[row] == pytest.approx(sweep, abs=1e-12)
        assert read.arc_slots.absolute[row] == absolute
    assert len(arcs) == len(ARCS)
    # I, J, K, R, P in this order
    assert (read.arc_slots.word >= 0).tolist() == [
        [True, True, False, False, False],
        [False, True, False, False, True],
        [True, True, False, False, False],
        [True, False, False, False, False],
        [False, False, False, True, False],
    ]
    frames = read.toolpath.frames
    assert read.toolpath.frame.tolist() == [0] * 11 + [1, 1, 2, 2, 3, 3]
    assert [(f.unit_mm, f.work_offset) for f in frames] == [
        (1.0, "G54"), (INCH, "G54"), (INCH, "G55"), (1.0, "G55"),
    ]  # fmt: skip
    assert math.isnan(sum(read.toolpath.start_mm))
    assert read.end_line == 22
    assert read.remarks == ()
    assert read.calculator
    assert read.data == MILLED.encode()
    assert [read.text(i) for i in (1, 10, 23)] == ["%", "G94 F60 (olp off)", "G1 X9"]
    assert [MILLED[words.start[i] : words.end[i]] for i in words.of_line(18)] == [
        "G18",
        "G3",
        "X3",
        "Z3",
        "R1",
    ]
    number = words.of_line(8)[1]
    assert (chr(words.letter[number]), words.mantissa[number], words.decimals[number]) == ("X", -1, 0)
    pointed = [MILLED[words.start[i] : words.end[i]] for i in np.flatnonzero(words.pointed)]
    assert pointed == ["G90.1", "G91.1", "G38.2"]


DRILLED = """\
G21 G90 G17 G54 G99 F60
G0 X1 Y2 Z9
G81 X3 Y4 Z-2 R1 (olp off)
(olp on)
G91 X1 Y1 L2
G90 G98
G82 X5 P1.5 Z-3 R2
G80
G18 G0 Y9
/G83 X6 Z7 Y1 R5 Q3
G0 X0
M2
"""


def test_a_drilling_program_is_read_hole_by_hole(setups: dict[str, Setup], size: str) -> None:
    data = DRILLED.replace("/G83", "G83")
    read = program(data, setups["linuxcnc"])
    off = CYCLE | PASS
    got = [(line, kind, flag, end) for line, kind, flag, end, _ in moves(read)]
    assert got == [
        (2, "RAPID", NONE, (101, 202, 309)),
        (3, "RAPID", off, (103, 204, 309)),
        (3, "RAPID", off, (103, 204, 301)),
        (3, "LINE", off, (103, 204, 298)),
        (3, "RAPID", off, (103, 204, 301)),
        # R and Z are numbers of the series: R is the level before it and 1 more
        (5, "RAPID", CYCLE, (103, 204, 310)),
        (5, "RAPID", CYCLE, (104, 205, 310)),
        (5, "LINE", CYCLE, (104, 205, 308)),
        (5, "RAPID", CYCLE, (104, 205, 310)),
        (5, "RAPID", CYCLE, (105, 206, 310)),
        (5, "LINE", CYCLE, (105, 206, 308)),
        (5, "RAPID", CYCLE, (105, 206, 310)),
        (7, "RAPID", CYCLE, (105, 206, 302)),
        (7, "LINE", CYCLE, (105, 206, 297)),
        (7, "RAPID", CYCLE, (105, 206, 309)),
        (9, "RAPID", NONE, (105, 209, 309)),
        (10, "RAPID", CYCLE, (106, 209, 307)),
        (10, "RAPID", CYCLE, (106, 205, 307)),
        (10, "LINE", CYCLE, (106, 202, 307)),
        (10, "RAPID", CYCLE, (106, 205, 307)),
        (10, "RAPID", CYCLE, (106, 202.254, 307)),
        (10, "LINE", CYCLE, (106, 201, 307)),
        (10, "RAPID", CYCLE, (106, 209, 307)),
        (11, "RAPID", NONE, (100, 209, 307)),
    ]
    words = read.words
    assert words is not None
    holes = [
        (h.line, h.first, h.last, h.plane, h.place_mm, h.r_mm, h.z_mm, h.initial_mm, h.incremental)
        for h in read.holes
    ]
    assert holes == [
        (3, 1, 5, 0, (103, 204), 301, 298, 309, False),
        (5, 5, 9, 0, (104, 205), 310, 308, 309, True),
        (5, 9, 12, 0, (105, 206), 310, 308, 309, True),
        (7, 12, 15, 0, (105, 206), 302, 297, 309, False),
        (10, 16, 23, 1, (307, 106), 205, 201, 209, False),
    ]
    assert [(h.repeat, h.repeats, h.series, h.code, h.rests) for h in read.holes] == [
        (0, 1, 1, 810, ()),
        (0, 2, 1, 810, ()),
        (1, 2, 1, 810, ()),
        (0, 1, 1, 820, ((2, 1.5),)),
        (0, 1, 2, 830, ()),
    ]
    texts = [{c: data[words.start[i] : words.end[i]] for c, i in h.words.items()} for h in read.holes]
    assert texts[1] == texts[2] == {"X": "X1", "Y": "Y1"}
    assert texts[3] == {"X": "X5", "Z": "Z-3", "R": "R2"}
    counters = [data[words.start[h.counter] : words.end[h.counter]] for h in read.holes if h.counter >= 0]
    assert counters == ["L2", "L2"]
    ends = [data[words.start[h.last_word] : words.end[h.last_word]] for h in read.holes]
    assert ends == ["R1", "L2", "L2", "R2", "Q3"]
    assert read.end_line == 12


@pytest.mark.parametrize("text", [MILLED, DRILLED.replace("/G83", "G83")])
def test_without_words_the_path_is_the_same(text: str, setups: dict[str, Setup]) -> None:
    whole = program(text, setups["linuxcnc"])
    alone = reader.read(text.encode(), setups["linuxcnc"], whole.rs274, words=False)
    assert alone.words is None
    assert len(alone.slot) == 0
    for name in ("kind", "flag", "line", "frame", "end_mm"):
        a, b = getattr(whole.toolpath, name), getattr(alone.toolpath, name)
        np.testing.assert_array_equal(a, b)
    assert list(alone.holes) == list(whole.holes)
    assert alone.toolpath.frames == whole.toolpath.frames


HEAD = "G21 G90 G17 G54\nG0 X1 Y2 Z3\n"
AFTER_HEAD = 3


def unread(text: str) -> str:
    return f"`{text}` is not understood and may move the machine; expected words of a letter and a number"


def parametric(text: str) -> str:
    return f"`{text}` uses parameters, expressions or flow control; {UNROLL}"


MODAL = (
    "a block under block delete changes a modal code that later blocks depend on; "
    "restate the code in the next block, or remove the `/`, or unroll the program with --flatten and "
    "state block_delete in the job file"
)
STATE = (
    "a block under block delete changes offsets, units, path mode, the tool or its compensation, "
    "so later blocks depend on the switch; remove the `/`, or unroll the program with --flatten and "
    "state block_delete in the job file"
)
PERCENT = (
    "`%` is in the middle of the program, or not alone in its line; expected it as the first "
    "line and the last one, or not at all"
)
#: what to do where a code has no remedy of its own
ALONE = "; post the program without it"
_LISTED = (
    "list it in still_g_codes of the machine file where it moves no axis and changes no mode of the path"
)
OR_LISTED = f"{ALONE}, or {_LISTED}"
NO_MOTION = "a block has axis words, but no motion code is in force; expected G0, G1, G2 or G3"
UNCOMMANDED = "an arc starts or ends where an axis has not been commanded yet"
BY_M100 = (
    "M100 in line 3 may have moved it: list 100 in still_m_codes of the machine file if it moves no axis, or "
    "command X, Y and Z behind it"
)
#: Control and text behind `HEAD`: the line, the sentence, the code, and what else the refusal names.
REFUSED: dict[tuple[str, str], dict[str, object]] = {
    ("fanuc", "#1=2"): {"why": parametric("#1=2"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "X[1+1]"): {"why": parametric("X[1+1]"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "  o100 sub "): {"why": parametric("o100 sub"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "/ o100 sub"): {"why": parametric("/ o100 sub"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "N5 GOTO 7"): {"why": parametric("N5 GOTO 7"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "if X1"): {"why": parametric("if X1"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "while a"): {"why": parametric("while a"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "END1"): {"why": parametric("END1"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "N10 DO1"): {"why": parametric("N10 DO1"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "a<1"): {"why": parametric("a<1"), "code": "OLP511", "hint": UNROLL},
    ("fanuc", "X 1 Y"): {"why": unread("X 1 Y"), "code": "OLP510"},
    ("fanuc", "hello go to"): {"why": unread("hello go to"), "code": "OLP510"},
    ("fanuc", "X1,5 Y2 "): {
        "why": unread("X1,5 Y2") + "; write a decimal point instead of the comma", "code": "OLP510",
    },
    ("fanuc", "G1 X1. ,R5."): {
        "why": "`G1 X1. ,R5.` asks for a corner that the control makes; unroll the program with --flatten",
        "code": "OLP511", "hint": "unroll the program with --flatten",
    },
    ("fanuc", "X1, Y2"): {"why": unread("X1, Y2"), "code": "OLP510"},
    ("fanuc", "?" * 70): {"why": unread("?" * 60), "code": "OLP510"},
    ("fanuc", "?\nX1\n!\n#"): {"why": unread("?"), "code": "OLP510", "others": (5, 6)},
    ("fanuc", "X1\x00 Y2 ("): {
        "why": "the comment `(` is not closed; expected `)` in the same line", "code": "OLP514",
    },
    ("linuxcnc", "/M2"): {
        "why": "the end of the program is under block delete; expected the same end for both positions of "
        "the switch",
        "code": "OLP525",
    },
    ("linuxcnc", "/G1 X5\nY7"): {"why": MODAL, "code": "OLP525"},
    ("linuxcnc", "X5\n/G91\nG0"): {"why": MODAL, "code": "OLP525", "line": 4},
    ("linuxcnc", "/G18"): {"why": MODAL, "code": "OLP525"},
    ("linuxcnc", "/G98"): {"why": MODAL, "code": "OLP525"},
    ("linuxcnc", "/G93"): {"why": MODAL, "code": "OLP525"},
    ("linuxcnc", "/G90.1"): {"why": MODAL, "code": "OLP525"},
    ("linuxcnc", "/G55"): {"why": STATE, "code": "OLP525"},
    ("linuxcnc", "/G20"): {"why": STATE, "code": "OLP525"},
    ("linuxcnc", "/T1 M6"): {"why": STATE, "code": "OLP525"},
    ("linuxcnc", "/M61 Q1"): {"why": STATE, "code": "OLP525"},
    ("linuxcnc", "/G61"): {"why": STATE, "code": "OLP525"},
    ("linuxcnc", "%"): {"why": PERCENT, "code": "OLP505"},
    ("linuxcnc", "G68 X1 R2"): {"why": f"G68 (rotation) is not read{ALONE}", "code": "OLP512", "word": "G68"},
    ("linuxcnc", "G2.5"): {
        "why": f"G2.5 is not known to the linuxcnc profile and may move the machine{OR_LISTED}",
        "code": "OLP512",
        "word": "G2.5",
    },
    ("haas", "X1.\nG777"): {
        "why": f"G777 is not known to the haas profile and may move the machine{ALONE}",
        "code": "OLP512", "word": "G777", "line": 4,
    },
    **{
        ("grbl", f"X1 {code}"): {
            "why": f"{code} is not known to the grbl profile and may move the machine{ALONE}",
            "code": "OLP512", "word": code,
        }
        for code in ("G-1", "G5.04", "G0.96", "G0.04", "G199.9", "G200", "G2.12")
    },
    ("fanuc", "G65 P2 A1."): {
        "why": f"G65 calls a macro; {UNROLL}", "code": "OLP511", "hint": UNROLL,
    },
    ("fanuc", "G41.1"): {
        "why": f"G41.1 (normal direction control) turns a rotary axis{ALONE}",
        "code": "OLP512", "word": "G41.1",
    },
    ("fanuc", "M98 P1\nM3\nG68.2\nM99"): {
        "why": f"M98 calls a subprogram; {UNROLL}", "code": "OLP511", "hint": UNROLL, "word": "M98",
        "others": (5, 6),
    },
    ("linuxcnc", "M1 M0"): {
        "why": "M1 and M0 of one modal group are in this block; expected one of them", "code": "OLP515",
    },
    ("linuxcnc", "M70"): {
        "why": f"M70 saves modal codes; {UNROLL}", "code": "OLP511", "hint": UNROLL, "word": "M70",
    },
    ("linuxcnc", "G80\nX1\n\nY1"): {"why": NO_MOTION, "code": "OLP517", "line": 4, "others": (6,)},
    ("linuxcnc", "M100\nG2 X1 Y1 R4"): {
        "why": f"{UNCOMMANDED}; {BY_M100}", "code": "OLP524", "line": 4,
    },
    ("linuxcnc", "G1 X5\nX5 X6\nY1 Y1"): {
        "why": "the word X is twice in this block; expected it once", "code": "OLP515", "line": 4,
        "others": (5,),
    },
    ("fanuc", "G1 X5. F60.\nX5. X6.\nY1. Y1."): {
        "why": "the word X is twice in this block; expected it once", "code": "OLP515", "line": 4,
        "others": (5,),
    },
    ("fanuc", "G2 X5. I1. I2."): {
        "why": "the word I is twice in this block; expected it once", "code": "OLP515",
    },
    ("linuxcnc", "G53 G2 X7 I3"): {
        "why": "G53 takes G0 or G1 only; give one of them in the block", "code": "OLP518",
    },
    ("linuxcnc", "G91 G53 G0 X7"): {
        "why": "G53 takes axis positions, and the block is in G91; give G90", "code": "OLP518",
    },
    ("linuxcnc", "G93 G81 X1 R2 Z1"): {
        "why": "the cycle G81 is in inverse time (G93); give G94 before it", "code": "OLP518",
    },
    ("linuxcnc", "G81 X1 R2 Z1 U1 A3"): {
        "why": "the cycle G81 moves A too, which the control refuses; move it in a block of its own",
        "code": "OLP518",
    },
    ("linuxcnc", "G84 X1 R2 Z1"): {
        "why": "the cycle G84 needs a turning spindle; give M3 before it", "code": "OLP518",
    },
    ("linuxcnc", "G86 X1 R2 Z1 P1"): {
        "why": "the cycle G86 needs a turning spindle; give M3 or M4 before it", "code": "OLP518",
    },
    ("linuxcnc", "G81 X1 Z1"): {"why": "the cycle G81 has no R word; give it", "code": "OLP531"},
    ("linuxcnc", "G81 X1 R1"): {"why": "the cycle G81 has no Z word; give it", "code": "OLP531"},
    ("linuxcnc", "G18 G81 X1 Z1"): {"why": "the cycle G81 has no R and no Y word; give it", "code": "OLP531"},
    ("linuxcnc", "G81 X1 Z1 R2 L0"): {
        "why": "a canned cycle has zero repeats; give one or more",
        "code": "OLP531",
    },
    ("linuxcnc", "G83 X1 Z1 R2"): {
        "why": "G83 needs a peck Q greater than zero, found None", "code": "OLP531",
    },
    ("linuxcnc", "G81 X1 Z1 R2 L20001"): {
        "why": "the block makes 20001 holes; expected at most 20000", "code": "OLP543",
    },
    ("linuxcnc", "M100\nG81 X1 R2 Z1"): {
        "why": f"a canned cycle starts where an axis has not been commanded yet; {BY_M100}",
        "code": "OLP524", "line": 4,
    },
    ("fanuc", "G81 X1. R2. Z1.\nG55\nX2."): {
        "why": "an offset, the tool length, the unit or another move comes within a series of canned cycles; "
        "what this control keeps then is not known; end the series with G80",
        "code": "OLP518", "line": 5,
    },
}  # fmt: skip


@pytest.mark.parametrize(("control", "text"), REFUSED)
def test_a_program_is_refused_in_these_words(control: str, text: str, setups: dict[str, Setup]) -> None:
    wanted = {"line": AFTER_HEAD} | REFUSED[control, text]
    assert refusal(f"{HEAD}{text}\nM2\n", setups[control], control) == wanted
    # behind the end nothing is read
    program(f"{HEAD}M30\n{text}\n", setups[control], control)


@pytest.mark.parametrize(("control", "text"), [key for key, said in REFUSED.items() if "others" not in said])
def test_a_refusal_names_its_line_in_any_chunk(
    control: str, text: str, setups: dict[str, Setup], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader, "chunks", functools.partial(chunks, size=1))
    said = refusal(f"{HEAD}{text}\nM2\n", setups[control], control)
    assert said["line"] == REFUSED[control, text].get("line", AFTER_HEAD)
    assert said["why"] == REFUSED[control, text]["why"]
