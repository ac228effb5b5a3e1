"""Arcs by hand: centre and signed sweep of what the words state, and what no control accepts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.core.errors import ProgramError
from olp.program.rs274 import motion
from olp.program.rs274.block_text import BlockText
from olp.program.rs274.lexer import lex
from olp.program.rs274.state import KNOWN_BY

NAN = math.nan
QUARTER = math.pi / 2
LINE = 17


def arc(
    end: tuple[float, float, float],
    *,
    start: tuple[float, float, float] = (10.0, 0.0, 5.0),
    i: float = NAN,
    j: float = NAN,
    k: float = NAN,
    r: float = NAN,
    p: float = NAN,
    clockwise: bool = False,
    plane: int = 0,
    absolute: bool = False,
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> tuple[list[float], float]:
    centre, sweep = motion.arc_geometry(
        np.array([start]),
        np.array([end]),
        np.array([[i, j, k, r, p]]),
        clockwise=np.array([clockwise]),
        plane=np.array([plane]),
        absolute=np.array([absolute]),
        offset=np.array([offset]),
        line=np.array([LINE]),
    )
    return centre[0].tolist(), float(sweep[0])


def refusal(end: tuple[float, float, float], **words: float) -> str:
    with pytest.raises(ProgramError) as caught:
        arc(end, **words)  # type: ignore[arg-type]
    assert caught.value.line == LINE
    return str(caught.value)


@pytest.mark.parametrize(("clockwise", "sweep"), [(False, QUARTER), (True, -3 * QUARTER)])
def test_the_centre_counts_from_the_start(clockwise: bool, sweep: float) -> None:
    centre, turned = arc((0.0, 10.0, 7.0), i=-10.0, clockwise=clockwise)
    assert centre == [0.0, 0.0, 5.0]
    assert turned == pytest.approx(sweep)


@pytest.mark.parametrize("plane", (0, 1, 2))
def test_each_plane_has_its_axes_and_its_direction(plane: int) -> None:
    """G17 is XY, G18 is ZX, G19 is YZ: a quarter turn from the first axis to the second is G3."""
    first, second = ((0, 1), (2, 0), (1, 2))[plane]
    start, end, words = np.zeros(3), np.zeros(3), {"ijk"[first]: -10.0}
    start[first], end[second] = 10.0, 10.0
    a = (float(start[0]), float(start[1]), float(start[2]))
    b = (float(end[0]), float(end[1]), float(end[2]))
    centre, turned = arc(b, start=a, plane=plane, **words)  # type: ignore[arg-type]
    assert centre == [0.0, 0.0, 0.0]
    assert turned == pytest.approx(QUARTER)


def test_g90_1_names_the_centre_in_the_program() -> None:
    centre, turned = arc((0.0, 10.0, 5.0), i=-3.0, j=2.0, absolute=True, offset=(3.0, -2.0, 100.0))
    assert centre == [0.0, 0.0, 5.0]
    assert turned == pytest.approx(QUARTER)
    assert "both centre words" in refusal((0.0, 10.0, 5.0), i=0.0, absolute=True)


@pytest.mark.parametrize(
    ("r", "clockwise", "centre", "sweep"),
    [
        (10.0, False, (0.0, 0.0), QUARTER),
        (10.0, True, (10.0, 10.0), -QUARTER),
        (-10.0, False, (10.0, 10.0), 3 * QUARTER),
        (-10.0, True, (0.0, 0.0), -3 * QUARTER),
    ],
)
def test_a_radius_above_zero_is_the_shorter_arc(
    r: float, clockwise: bool, centre: tuple[float, float], sweep: float
) -> None:
    got, turned = arc((0.0, 10.0, 5.0), r=r, clockwise=clockwise)
    assert got[:2] == pytest.approx(centre)
    assert turned == pytest.approx(sweep)


def test_an_arc_that_ends_where_it_starts_is_a_whole_turn() -> None:
    assert arc((10.0, 0.0, 5.0), i=-10.0)[1] == pytest.approx(4 * QUARTER)
    assert arc((10.0, 0.0, 5.0), i=-10.0, clockwise=True)[1] == pytest.approx(-4 * QUARTER)
    assert "ends where it starts" in refusal((10.0, 0.0, 9.0), r=10.0)


@pytest.mark.parametrize(("p", "turns"), [(1.0, 0), (2.0, 1), (5.0, 4)])
def test_p_counts_turns_and_the_first_may_be_a_part(p: float, turns: int) -> None:
    assert arc((0.0, 10.0, 5.0), i=-10.0, p=p)[1] == pytest.approx((1 + 4 * turns) * QUARTER)
    back = arc((0.0, 10.0, 5.0), i=-10.0, p=p, clockwise=True)[1]
    assert back == pytest.approx(-(3 + 4 * turns) * QUARTER)


def test_the_two_radii_may_differ_by_a_thousandth_or_by_what_linuxcnc_accepts() -> None:
    """0.0283 mm up to a radius of 28.3 mm, a thousandth of the radius above."""
    assert arc((0.0, 10.028, 5.0), i=-10.0)[1] == pytest.approx(QUARTER)
    assert "does not accept" in refusal((0.0, 10.029, 5.0), i=-10.0)
    far = (1000.0, 0.0, 5.0)
    assert arc((0.0, 1000.99, 5.0), start=far, i=-1000.0)[1] == pytest.approx(QUARTER)
    assert "at its start and 1001.0100 mm at its end" in refusal(
        (0.0, 1001.01, 5.0),
        start=far,
        i=-1000.0,  # type: ignore[arg-type]
    )


def test_a_radius_may_be_too_small_by_as_much() -> None:
    """The chord of 20 mm needs a radius of 10 mm, less half of 0.0283 mm."""
    centre, turned = arc((-10.0, 0.0, 5.0), r=9.986)
    assert centre == [0.0, 0.0, 5.0]
    assert turned == pytest.approx(2 * QUARTER)
    assert "reach its end, 20.0000 mm away" in refusal((-10.0, 0.0, 5.0), r=9.985)


def test_omitted_words_keep_their_axis_in_absolute_and_in_incremental_blocks() -> None:
    """Rows: X1 (G90), Y2 (G91), X3 (G91), X4 (G90), nothing; in inches, with offset 100, 200, 300."""
    value = np.array([1.0, 2.0, 3.0, 4.0])
    slot = np.array([[0, -1, -1], [-1, 1, -1], [2, -1, -1], [3, -1, -1], [-1, -1, -1]])
    offset, start = np.array([100.0, 200.0, 300.0]), [7.0, 8.0, 9.0]
    incremental = np.array([False, True, True, False, True])
    end = motion.fill(slot, value, incremental, offset, 25.4, start)
    x = [100 + 25.4, 100 + 25.4, 100 + 4 * 25.4, 100 + 4 * 25.4, 100 + 4 * 25.4]
    y = [8.0, 8.0 + 50.8, 8.0 + 50.8, 8.0 + 50.8, 8.0 + 50.8]
    assert end[:, 0] == pytest.approx(x)
    assert end[:, 1] == pytest.approx(y)
    assert end[:, 2].tolist() == [9.0] * 5
    absolute = motion.fill(slot, value, None, np.tile(offset, (5, 1)), 2.0, start)
    assert absolute[:, 0].tolist() == [102.0, 102.0, 106.0, 108.0, 108.0]
    assert absolute[:, 1].tolist() == [8.0, 204.0, 204.0, 204.0, 204.0]
    assert absolute[:, 2].tolist() == [9.0] * 5


def test_a_modal_code_is_in_force_from_its_line_on() -> None:
    lines, codes = np.array([1, 3]), np.array([910, 900])
    assert motion.modal(5, lines, codes, 900).tolist() == [900, 910, 910, 900, 900]
    assert motion.modal(3, lines[:0], codes[:0], 910).tolist() == [910] * 3


def said(end: tuple[float, float, float], **words: object) -> tuple[str, str]:
    with pytest.raises(ProgramError) as caught:
        arc(end, **words)  # type: ignore[arg-type]
    assert caught.value.line == LINE
    return caught.value.message, caught.value.code


@pytest.mark.parametrize(
    ("end", "words", "why", "code"),
    [
        (
            (0.0, 10.0, NAN), {"i": -10.0},
            f"an arc starts or ends where an axis has not been commanded yet; {KNOWN_BY}",
            "OLP524",
        ),
        (
            (0.0, 10.0, 5.0), {"i": -10.0, "start": (10.0, 0.0, NAN)},
            f"an arc starts or ends where an axis has not been commanded yet; {KNOWN_BY}",
            "OLP524",
        ),
        (
            (0.0, 10.0, 5.0), {"k": 1.0},
            "an arc has neither centre words of its plane nor a radius; expected I, J, K or R", "OLP516",
        ),
        (
            (0.0, 10.0, 5.0), {"j": 0.0, "absolute": True},
            "in G90.1 an arc needs both centre words of its plane", "OLP516",
        ),
        (
            (0.0, 10.0, 5.0), {"i": -10.0, "p": 0.0},
            "P of an arc is its number of turns; expected an integer from 1", "OLP516",
        ),
        (
            (0.0, 10.0, 5.0), {"i": -10.0, "p": 2.5},
            "P of an arc is its number of turns; expected an integer from 1", "OLP516",
        ),
        (
            (0.0, 10.0, 5.0), {"i": -10.0, "p": 10_001.0},
            "P of an arc is its number of turns; expected at most 10000", "OLP530",
        ),
        (
            (10.0, 0.0, 7.0), {"r": 5.0},
            "an arc with R ends where it starts, so its centre is not known; use I, J, K", "OLP530",
        ),
        (
            (-10.0, 0.0, 5.0), {"r": -9.0},
            "the radius of an arc is too small to reach its end, 20.0000 mm away", "OLP530",
        ),
        ((0.0, 10.0, 5.0), {"i": 0.0}, "an arc has zero radius", "OLP530"),
        ((0.0, 0.0, 5.0), {"i": -10.0}, "an arc has zero radius", "OLP530"),
        (
            (10.0, 2.0, 5.0), {"i": -1.5e7},
            "the radius of an arc is 1.5e+07 mm; expected at most 1e+07 mm, as its centre has too few "
            "digits; write a straight move",
            "OLP530",
        ),
        (
            (0.0, 11.0, 5.0), {"i": -10.0},
            "the radius of an arc is 10.0000 mm at its start and 11.0000 mm at its end; "
            "a control does not accept this difference",
            "OLP530",
        ),
    ],
)  # fmt: skip
def test_an_arc_is_refused_in_these_words(
    end: tuple[float, float, float], words: dict[str, object], why: str, code: str
) -> None:
    assert said(end, **words) == (why, code)


def test_arcs_at_their_bounds_are_read() -> None:
    assert arc((0.0, 10.0, 5.0), i=-10.0, p=10_000.0)[1] == pytest.approx(QUARTER + 9999 * 4 * QUARTER)
    # 1e7 mm is the largest radius
    assert arc((10.0 - 1e7, 1e7, 5.0), i=-1e7)[1] == pytest.approx(QUARTER)
    assert "expected at most 1e+07 mm" in refusal((10.0 - 1.0001e7, 1.0001e7, 5.0), i=-1.0001e7)
    # the smaller radius counts for none, the larger one for too large
    assert arc((2e-9, 0.0, 0.0), start=(0.0, 2e-9, 0.0), i=0.0, j=-2e-9)[1] == pytest.approx(3 * QUARTER)
    assert "zero radius" in refusal((1e-10, 0.0, 0.0), start=(0.0, 1e-10, 0.0), j=-1e-10)  # type: ignore[arg-type]


@pytest.mark.parametrize("clockwise", [False, True])
def test_an_arc_that_ends_beside_its_start_is_a_whole_turn_or_a_short_arc(clockwise: bool) -> None:
    """Also where it ends within 1e-8 mm before or behind its start."""
    sign = -1 if clockwise else 1
    for end in ((10.0, 0.0, 5.0), (10.0, sign * 1e-9, 5.0)):
        assert arc(end, i=-10.0, clockwise=clockwise)[1] == pytest.approx(sign * 4 * QUARTER)
    # farther on it is a short arc, and before its start nearly a whole turn
    assert arc((10.0, sign * 1e-6, 5.0), i=-10.0, clockwise=clockwise)[1] == pytest.approx(
        sign * 1e-7, rel=1e-6
    )
    assert arc((10.0, -sign * 1e-6, 5.0), i=-10.0, clockwise=clockwise)[1] == pytest.approx(
        sign * (4 * QUARTER - 1e-7), abs=1e-9
    )


@pytest.mark.parametrize("plane", (0, 1, 2))
@pytest.mark.parametrize("clockwise", [False, True])
@pytest.mark.parametrize("r", [13.0, -13.0])
def test_both_ends_of_an_arc_by_radius_are_as_far_from_its_centre(
    plane: int, clockwise: bool, r: float
) -> None:
    """A chord of 24 is 5 from the centre of a circle of 13; the arc above zero is the shorter one."""
    first, second, third = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
    a, b = [0.0] * 3, [0.0] * 3
    a[first], a[second], a[third] = 1.0, 2.0, 7.0
    b[first], b[second], b[third] = 25.0, 2.0, 9.0
    centre, turned = arc(tuple(b), start=tuple(a), r=r, clockwise=clockwise, plane=plane)  # type: ignore[arg-type]
    above = clockwise == (r < 0)
    assert (centre[first], centre[second], centre[third]) == pytest.approx(
        (13.0, 7.0 if above else -3.0, 7.0)
    )
    half = math.asin(12 / 13)
    size = 2 * half if r > 0 else 2 * math.pi - 2 * half
    assert turned == pytest.approx(-size if clockwise else size)


def test_refused_arcs_are_named_together() -> None:
    nan = np.full((3, 5), NAN)
    words = nan.copy()
    words[:, 0] = (-10.0, -9.0, -8.0)
    start = np.tile((10.0, 0.0, 5.0), (3, 1))
    with pytest.raises(ProgramError, match="radius of an arc is 9") as caught:
        motion.arc_geometry(
            start, np.tile((0.0, 10.0, 5.0), (3, 1)), words, clockwise=np.zeros(3, bool),
            plane=np.zeros(3, int), absolute=np.zeros(3, bool), offset=start, line=np.array([4, 6, 9]),
        )  # fmt: skip
    assert (caught.value.line, [other.line for other in caught.value.others]) == (6, [9])


def test_arcs_of_one_call_each_have_their_own_words() -> None:
    """By centre, by radius, in G90.1, clockwise and in other planes, side by side."""
    cases: list[dict[str, object]] = [
        {"end": (0.0, 10.0, 5.0), "i": -10.0},
        {"end": (0.0, 10.0, 7.0), "r": 10.0, "clockwise": True},
        {"end": (0.0, 10.0, 5.0), "i": 1.0, "j": 2.0, "absolute": True, "offset": (-1.0, -2.0, 9.0)},
        {"end": (5.0, 0.0, 0.0), "start": (0.0, 0.0, 5.0), "k": -5.0, "plane": 1, "p": 3.0},
        {"end": (0.0, 0.0, 4.0), "start": (0.0, 4.0, 0.0), "r": -4.0, "plane": 2},
    ]
    alone = [arc(**case) for case in cases]  # type: ignore[arg-type]
    centre, sweep = motion.arc_geometry(
        np.array([case.get("start", (10.0, 0.0, 5.0)) for case in cases]),
        np.array([case["end"] for case in cases]),
        np.array([[case.get(name, NAN) for name in "ijkrp"] for case in cases]),
        clockwise=np.array([case.get("clockwise", False) for case in cases]),
        plane=np.array([case.get("plane", 0) for case in cases]),
        absolute=np.array([case.get("absolute", False) for case in cases]),
        offset=np.array([case.get("offset", (0.0, 0.0, 0.0)) for case in cases]),
        line=np.arange(5),
    )
    assert [(c, s) for c, s in zip(centre.tolist(), sweep.tolist(), strict=True)] == alone
    assert [s / QUARTER for _, s in alone] == pytest.approx([1, -1, 1, 9, 3])


def test_decimals_of_a_number_are_its_digits_behind_the_point() -> None:
    chunk = lex(np.frombuffer(b"X-2.500Y0.0000000001Z7", np.uint8), BlockText())
    assert motion.values(chunk).tolist() == [-2.5, 1e-10, 7.0]


GATHERED = """\
G0 X1 Y2
Z3 A4
F5
G2 X6 I7 J8
I9 K1
R5
P2
Y1 R2 P3
W1
"""


def test_motion_lines_are_those_with_axis_words_and_centres_of_arcs() -> None:
    text = GATHERED.encode()
    chunk = lex(np.frombuffer(text, np.uint8), BlockText())
    force = np.array([0, 0, 0, 20, 20, 20, 30, 30, 30], np.int16)
    consumed = np.zeros(9, bool)
    blocks = motion.gather(chunk, force, consumed)

    def texts(table: np.ndarray) -> list[str]:
        spoken = [
            [text[chunk.start[i] : chunk.end[i]].decode() if i >= 0 else "-" for i in row]
            for row in table.tolist()
        ]
        return [" ".join(row) for row in spoken]

    assert len(blocks) == 6
    assert blocks.line.tolist() == [0, 1, 3, 4, 7, 8]
    assert texts(blocks.slot) == ["X1 Y2 -", "- - Z3", "X6 - -", "- - -", "- Y1 -", "- - -"]
    assert blocks.other.tolist() == [False, True, False, False, False, True]
    assert blocks.arc_row.tolist() == [2, 3, 4, 5]
    assert texts(blocks.arc_slot) == ["I7 J8 - - -", "I9 - K1 - -", "- - - R2 P3", "- - - - -"]
    # words that other codes take are no motion
    consumed[[0, 4, 8]] = True
    fewer = motion.gather(chunk, force, consumed)
    assert fewer.line.tolist() == [1, 3, 7]
    assert texts(fewer.slot) == ["- - Z3", "X6 - -", "- Y1 -"]
    assert texts(fewer.arc_slot) == ["I7 J8 - - -", "- - - R2 P3"]
    # without arcs their words mean nothing
    straight = motion.gather(chunk, np.zeros(9, np.int16), np.zeros(9, bool))
    assert straight.line.tolist() == [0, 1, 3, 7, 8]
    assert len(straight.arc_row) == len(straight.arc_slot) == 0


@pytest.mark.parametrize("letter", "ABCUVWE")
def test_other_axes_move_the_block(letter: str) -> None:
    chunk = lex(np.frombuffer(f"{letter}1\nX1\nS1".encode(), np.uint8), BlockText())
    blocks = motion.gather(chunk, np.zeros(3, np.int16), np.zeros(3, bool))
    assert blocks.line.tolist() == [0, 1]
    assert blocks.other.tolist() == [True, False]


@pytest.mark.parametrize(
    ("text", "lines", "letters"),
    [
        ("X1 X2", [31], "X"),
        ("Y1\nX1 Z2 Z3 Z4\nY1 Y2", [32, 33], "ZY"),
        ("I1 X1 I2", [31], "I"),
        ("P1 X1 P2", [31], "P"),
    ],
)
def test_a_letter_that_is_twice_is_named(text: str, lines: list[int], letters: str) -> None:
    chunk = lex(np.frombuffer(text.encode(), np.uint8), BlockText(), first_line=30)
    count = len(chunk.line_start)
    with pytest.raises(ProgramError) as caught:
        motion.gather(chunk, np.full(count, 20, np.int16), np.zeros(count, bool))
    errors = [caught.value, *caught.value.others]
    assert [error.line for error in errors] == lines
    assert [error.message for error in errors] == [
        f"the word {letter} is twice in this block; expected it once" for letter in letters
    ]
    assert {error.code for error in errors} == {"OLP515"}
