"""What is no correction of a program is refused with its line; what cuts is never left out of the verdict."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine
from cases.gate import known
from cases.paths import CONTROL, CYCLE, NAN, OF_MACHINE, PASS, Move, hole, line, program, rapid, toolpath

import olp
from olp.core.errors import ProgramError
from olp.core.toolpath import Kind
from olp.program.holes import Hole
from olp.proof import deviation
from olp.proof.judgement import Judgements
from olp.proof.kinds import check_kinds
from olp.proof.proof import Counts

#: X is 10 um long in 100 mm
CURVE = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
SCALE = {"x.csv": "X_mm,EXX_um\n-1000,-100\n2000,200\n"}
HEAD = b"G21 G90 G54 G64 P0.0001 Q0\n"
PART = HEAD + b"G0 X0 Y0 Z10\nG1 Z-1 F100\nG1 X50\nG1 Y50\nG1 X0\nG1 Y0\nG0 Z50\nM2\n"
HOLES = HEAD + b"G0 X0 Y0 Z5\nF600\nG81 X10 Y10 Z-6 R0\nX20\nX30\nX40\nG80\nG0 Z50\nM2\n"


@pytest.fixture
def scaled(tmp_path: Path) -> Path:
    return machine(tmp_path / "m", CURVE, SCALE, tables=TRUE_ZERO)


@pytest.mark.parametrize(("text", "old", "new", "line", "words"), [
    (PART, b"M2", b"G1 X300 Y300 Z-50\nM2", 8, "line 10 of the corrected program cuts or touches"),
    (PART, b"G0 Z50", b"G1 X100 Z-20\nG0 X0.0 Z50", 8, "line 9 of the corrected program cuts"),
    (PART, b"G0 Z50", b"G1 Z50", 8, "line 9 of the corrected program cuts"),
    (PART, b"G1 Y50", b"G0 Y50", 5, "line 6 of the corrected program moves rapidly"),
    (PART, b"G0 X0 Y0 Z10", b"G0 Y0 Z10", 2, "another axis is known"),
    (HOLES, b"G80\n", b"X300 Y300\nG80\n", 9, "cuts or touches"),
    (HOLES, b"G80\n", b"G80\nG1 X300 Y300\n", 9, "cuts or touches"),
])  # fmt: skip
def test_a_move_of_another_kind_is_refused_with_its_line(
    scaled: Path, text: bytes, old: bytes, new: bytes, line: int, words: str
) -> None:
    corrected = olp.correct(text, scaled).data
    assert olp.verify(text, corrected, scaled).report["verdict"]["ok"]
    assert corrected.count(old) == 1
    with pytest.raises(ProgramError, match=words) as refused:
        olp.verify(text, corrected.replace(old, new), scaled)
    assert refused.value.line == line


@pytest.mark.parametrize("left", (b"G53 G1 X300", b"(olp off)\nG1 X300\n(olp on)", b"G53 G0 X300"))
def test_what_is_left_uncorrected_is_commanded_as_it_was(scaled: Path, left: bytes) -> None:
    text = HEAD + b"G0 X0 Y0 Z0\nG1 X10 F100\n" + left + b"\nG0 Z50\nM2\n"
    corrected = olp.correct(text, scaled).data
    olp.verify(text, corrected, scaled)
    with pytest.raises(ProgramError, match="left uncorrected"):
        olp.verify(text, corrected.replace(b"X300", b"X300.5"), scaled)


@pytest.mark.parametrize("left", (b"G53 G1 X300", b"(olp off)\nG1 X300\n(olp on)"))
def test_what_cuts_uncorrected_counts(scaled: Path, left: bytes) -> None:
    done = olp.correct(HEAD + b"G0 X0 Y0 Z0\nG1 X10 F100\n" + left + b"\nG0 Z50\nM2\n", scaled)
    assert Counts.LEFT in done.table.counts
    verdict = done.report["verdict"]
    assert verdict["ok"] is False
    assert verdict["numerical"]["largest_um"] == pytest.approx(30.0, abs=0.1)
    assert "is left uncorrected" in verdict["sentences"][0]
    rapid = olp.correct(HEAD + b"G0 X0 Y0 Z0\nG1 X10 F100\nG0 Z50\nG53 G0 X300\nM2\n", scaled)
    assert rapid.report["verdict"]["ok"]


# -- axes that are never known ---------------------------------------------------------------------------

LASER = HEAD + b"G0 X0 Y0\nG1 X50 F100\nG1 Y50\nG1 X0\nM2\n"


def test_a_program_of_two_axes_is_judged_along_them(scaled: Path) -> None:
    done = olp.correct(LASER, scaled)
    assert (done.table.counts[1:] == Counts.FEED).all()
    assert done.report["deviation"]["before"]["between"]["max_um"] == pytest.approx(5.0, abs=0.01)
    assert 0.0 < done.report["verdict"]["numerical"]["largest_um"] < 1.2
    wrong = olp.verify(LASER, done.data.replace(b"Y50", b"Y51"), scaled)
    assert wrong.report["verdict"]["numerical"]["largest_um"] == pytest.approx(1000.0, abs=2.0)
    with pytest.raises(ProgramError, match="another axis is known"):
        olp.verify(LASER, done.data.replace(b"Y50", b"Y50 Z-1"), scaled)


def test_a_wrong_first_feed_from_a_partly_unknown_place_is_seen(scaled: Path) -> None:
    text = HEAD + b"G1 X10 F100\nG1 X300\nG0 Y0 Z0\nG1 X50\nM2\n"
    corrected = olp.correct(text, scaled).data
    wrong = re.sub(rb"G1 X299\.9\d+", b"G1 X250", corrected)
    assert wrong != corrected
    assert olp.verify(text, wrong, scaled).report["verdict"]["ok"] is False


# -- nothing that could be judged ------------------------------------------------------------------------


@pytest.mark.parametrize("text", (b"G21 G90\nM2\n", HEAD + b"G53 G0 X0 Y0 Z0\nM2\n"))
def test_nothing_judged_is_no_pass(scaled: Path, text: bytes) -> None:
    done = olp.correct(text, scaled)
    assert done.report["verdict"]["ok"] is None
    assert done.report["verdict"]["sentences"][0].startswith("Not judged")


def test_moves_where_the_nominal_program_has_none_are_refused(scaled: Path) -> None:
    with pytest.raises(ProgramError, match="not the 0 of the nominal one"):
        olp.verify(b"G21 G90\nM2\n", PART, scaled)


def test_a_part_that_is_good_with_a_low_probability_is_no_pass(tmp_path: Path) -> None:
    case = known(50.0)
    path = machine(tmp_path, case["calibration"], case["curves"], tables=TRUE_ZERO)
    doubtful = olp.correct(PART, path, part_tolerance_um=3.0).report["verdict"]
    assert (doubtful["ok"], doubtful["part"]["holds"], doubtful["part"]["probable"]) == (None, True, False)
    assert olp.correct(PART, path, part_tolerance_um=300.0).report["verdict"]["ok"] is True


# -- blocks and groups -----------------------------------------------------------------------------------


@pytest.mark.parametrize("block", range(2, 14))
def test_blocks_of_the_proof_do_not_matter(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    """A corrected hole with a peck less: some strokes of the nominal one have no move of their own."""
    deep = {"z.csv": "Z_mm,EZZ_um\n-1000,-1000\n2000,2000\n"}
    path = machine(tmp_path, CURVE.replace("x.csv", "z.csv"), deep, tables=TRUE_ZERO)
    text = HEAD + b"G0 X0 Y0 Z5\nF600\nG83 X10 Y10 Z-20.005 R0 Q5\nG80\nM2\n"
    done = olp.correct(text, path)
    assert (np.diff(done.groups) == 0).any()
    monkeypatch.setattr(deviation, "_BLOCK", block)
    again = olp.verify(text, done.data, path)
    np.testing.assert_array_equal(again.table.corrected, done.table.corrected)


@pytest.mark.parametrize("block", (1, 2, 3))
def test_blocks_of_a_program_without_z_do_not_matter(
    scaled: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    done = olp.verify(LASER, LASER, scaled)
    monkeypatch.setattr(deviation, "_BLOCK", block)
    again = olp.verify(LASER, LASER, scaled)
    np.testing.assert_array_equal(again.table.corrected, done.table.corrected)


def test_groups_are_those_of_a_loop() -> None:
    rng = np.random.default_rng(5)
    n = 400
    counts = rng.choice([Counts.FEED, Counts.HOLE, Counts.RAPID, Counts.LEFT], n).astype(np.uint8)
    sizes = rng.choice(np.linspace(0, 3e-3, 9), (2, n)).astype(np.float32)
    sizes[0][rng.random(n) < 0.1] = np.nan
    table = Judgements(
        np.sort(rng.integers(1, 90, n)), rng.integers(-1, 3, n), np.sort(rng.integers(0, 12, n)), counts,
        sizes[0], sizes[1], sizes[1], 1e-3, 1.87e-3,
    )  # fmt: skip
    for of in (table.operation, table.tool):
        rows = table.groups(of)
        judged = np.flatnonzero(table.judged)
        values = list(dict.fromkeys(of[judged].tolist()))
        assert len(rows) == len(values)
        for row, value in zip(rows, values, strict=True):
            mine = judged[of[judged] == value]
            worst = mine[np.argmax(table.corrected[mine])]
            assert row["worst_line"] == table.line[worst]
            assert row["corrected_um"] == pytest.approx(table.corrected[worst] * 1e3)
            assert row["uncorrected_um"] == pytest.approx(np.nanmax(table.uncorrected[mine]) * 1e3)
            assert (row["first_line"], row["last_line"]) == (table.line[mine].min(), table.line[mine].max())
            assert row["holds"] is bool((table.corrected[mine] <= table.allowed_mm).all())


def test_the_side_of_an_axis_is_taken_up_once(tmp_path: Path) -> None:
    path = machine(tmp_path, "[backlash]\nX_um = 10.0\nY_um = 8.0\nZ_um = 6.0\n", tables=TRUE_ZERO)
    body = b"".join(b"G0 X%d\nG1 Z-1 F100\nG1 X%d\nG0 Z5\n" % (10 * k, 10 * k + 5) for k in range(6))
    done = olp.correct(HEAD + b"G0 X0 Y0 Z5\n" + body + b"M2\n", path)
    assert done.report["verdict"]["ok"]
    # Y moves in the first approach alone, there and back, after its first position
    assert len(re.findall(rb"Y-?\d", done.data)) == 3


def test_a_contour_that_changes_its_side_is_refused(tmp_path: Path) -> None:
    tables = TRUE_ZERO + "[tools.1]\nZ_mm = 0.0\nradius_mm = 5.0\n[job_defaults]\ntool = 1\n"
    path = machine(
        tmp_path, CURVE, SCALE, tables=tables, controller="fanuc", keys='decimal_point = "calculator"\n'
    )
    text = b"G21 G90 G54\nG0 X0 Y0 Z0\nG41 D1 G1 X20 Y20 F500\nX100\nY80\nG42 D1 X60\nY40\nG40 G0 X0 Y0\nM2\n"
    with pytest.raises(ProgramError, match="is on already") as refused:
        olp.correct(text, path)
    assert refused.value.line == 6
    olp.correct(text.replace(b"G42 D1 X60", b"G40 X90\nG42 D1 X60"), path)


# -- paths without a text --------------------------------------------------------------------------------

DRILL = (rapid(0, 0, 5, flag=CYCLE), line(0, 0, -5, flag=CYCLE), rapid(0, 0, 5, flag=CYCLE))
DRILLED = (hole(1, 4, r=5.0, z=-5.0),)
START, CUT, GONE = rapid(0, 0, 20), line(9, 0, 5, line=20), rapid(9, 9, 9, line=30)
TOUCH = Move(Kind.PROBE, (9.0, 0.0, 5.0), line=20)
FEEDS = "cuts or touches where the nominal program moves rapidly"
RAPIDS = "moves rapidly where the nominal program cuts or touches"
KNOWN = "ends where another axis is known than in the nominal program"
MOVED = "changes a move that is left uncorrected"
NO_DRILL, NO_TOUCH = "drills where the nominal program does not", "touches where the nominal program does not"


def checked(
    nominal: tuple[Move, ...], written: tuple[Move, ...], groups: list[int], *,
    holes: tuple[tuple[Hole, ...], tuple[Hole, ...]] = ((), ()), digit_mm: float = 0.001,
) -> tuple[int, str] | None:  # fmt: skip
    """The nominal line and the words of what is refused, or None."""
    mine, other = program(toolpath(*nominal), *holes[0]), program(toolpath(*written), *holes[1])
    try:
        check_kinds(mine, other, np.array(groups), digit_mm)
    except ProgramError as error:
        assert error.code == "OLP562"
        assert error.line is not None
        head = "of the corrected program "
        tail = "; it is not a correction of this program; correct the nominal program again"
        assert error.message.endswith(tail)
        return error.line, error.message.removesuffix(tail).replace(head, "")
    return None


@pytest.mark.parametrize(
    ("nominal", "written", "groups", "refused"),
    [
        ((START, CUT, GONE), (START, line(4, 0, 9), CUT, GONE), [0, 2, 3], None),
        ((START, CUT, GONE), (START, CUT, rapid(9, 5, 9), GONE), [0, 1, 3], None),
        ((START, CUT, GONE), (START, CUT, line(9, 5, 9), GONE), [0, 1, 3], (30, f"line 3 {FEEDS}")),
        ((START, CUT, GONE), (START, CUT, line(9, 9, 9)), [0, 1, 2], (30, f"line 3 {FEEDS}")),
        ((START, CUT, GONE), (START, rapid(4, 0, 9), CUT, GONE), [0, 2, 3], (20, f"line 2 {RAPIDS}")),
        ((START, CUT, GONE), (START, CUT, TOUCH, GONE), [0, 2, 3], (20, f"line 20 {NO_TOUCH}")),
        ((START, TOUCH, GONE), (START, TOUCH, GONE), [0, 1, 2], None),
        ((START, TOUCH, GONE), (START, line(9, 0, 5), GONE), [0, 1, 2], None),
        ((START, TOUCH, GONE), (START, rapid(9, 0, 5), GONE), [0, 1, 2], (20, f"line 2 {RAPIDS}")),
        ((START, CUT, GONE), (START, line(9, NAN, 5), GONE), [0, 1, 2], (20, f"line 2 {KNOWN}")),
        ((START, line(9, NAN, 5), GONE), (START, CUT, GONE), [0, 1, 2], (2, f"line 20 {KNOWN}")),
        # parts may be anywhere
        ((START, CUT, GONE), (START, line(4, NAN, 5), CUT, GONE), [0, 2, 3], None),
        # behind a move of the control it depends on the words
        (
            (START, rapid(9, NAN, 5, flag=CONTROL), GONE),
            (START, rapid(9, 0, 5, flag=CONTROL), GONE), [0, 1, 2], None,
        ),
        ((START, rapid(9, NAN, 5, flag=PASS), GONE), (START, rapid(9, 0, 5), GONE), [0, 1, 2],
         (2, f"line 2 {KNOWN}")),
    ],
)  # fmt: skip
def test_each_kind_of_change_is_refused_with_both_lines(
    nominal: tuple[Move, ...], written: tuple[Move, ...], groups: list[int], refused: tuple[int, str] | None
) -> None:
    assert checked(nominal, written, groups) == refused


@pytest.mark.parametrize(
    ("nominal", "written", "groups", "holes", "refused"),
    [
        ((START, *DRILL, GONE), (START, *DRILL, GONE), [0, 1, 2, 3, 4], (DRILLED, DRILLED), None),
        # other moves of a hole are compared as one
        ((START, *DRILL, GONE), (START, *DRILL, *DRILL[1:], GONE), [0, 1, 2, 5, 6],
         (DRILLED, (hole(1, 6, r=5.0, z=-5.0),)), None),
        ((START, *DRILL, GONE), (START, *DRILL, GONE), [0, 1, 2, 3, 4],
         ((hole(2, 4, r=5.0, z=-5.0),), DRILLED), (2, f"line 2 {NO_DRILL}")),
        ((START, *DRILL, GONE), (START, *DRILL, GONE), [0, 1, 2, 3, 4],
         (DRILLED, (hole(1, 3, r=5.0, z=-5.0),)), None),
        ((START, *DRILL, GONE), (START, CUT, *DRILL, GONE), [0, 2, 3, 4, 5],
         (DRILLED, (hole(2, 5, r=5.0, z=-5.0),)), (2, f"line 20 {FEEDS}")),
        # without holes in one of them every move counts
        ((START, *DRILL, GONE), (START, *DRILL, GONE), [0, 1, 2, 3, 4], ((), DRILLED), None),
        ((START, *DRILL, GONE), (START, *DRILL, DRILL[1], GONE), [0, 1, 2, 4, 5], ((), DRILLED),
         (4, f"line 5 {FEEDS}")),
    ],
)  # fmt: skip
def test_holes_are_drilled_where_they_were(
    nominal: tuple[Move, ...], written: tuple[Move, ...], groups: list[int], holes: Any,
    refused: tuple[int, str] | None,
) -> None:  # fmt: skip
    assert checked(nominal, written, groups, holes=holes) == refused


@pytest.mark.parametrize("flag", (PASS, CONTROL, OF_MACHINE))
@pytest.mark.parametrize(("off_mm", "refused"), [(0.0059, False), (0.0061, True), (-0.0061, True)])
def test_a_move_left_uncorrected_has_its_end_or_its_distance(flag: int, off_mm: float, refused: bool) -> None:
    """Up to 0.6 digits; where it starts elsewhere, the same words as distances end elsewhere."""
    left = line(9, 9, 9, flag=flag)
    nominal = (START, CUT, left, GONE)
    expected = (3, f"line 3 {MOVED}") if refused else None
    moved = line(9, 9 + off_mm, 9, flag=flag)
    assert checked(nominal, (START, CUT, moved, GONE), [0, 1, 2, 3], digit_mm=0.01) == expected
    # the same distance from a start that is 1 mm off along Y, in two parts
    begin, split = line(9, 1, 5, line=20), line(9, 7, 7)
    far = line(9, 10 + off_mm, 9, flag=flag)
    expected = (3, f"line 4 {MOVED}") if refused else None
    assert checked(nominal, (START, begin, split, far, GONE), [0, 1, 3, 4], digit_mm=0.01) == expected
    # a corrected move may end elsewhere
    assert checked((START, CUT, GONE), (START, line(9, off_mm, 5), GONE), [0, 1, 2], digit_mm=0.01) is None


def test_each_axis_of_a_move_left_uncorrected_has_its_end_or_its_distance() -> None:
    """X as its end, Y as its distance; neither would do for both."""
    nominal = (START, CUT, line(20, 20, 5, flag=PASS), GONE)
    written = (START, line(9.5, 0.5, 5), line(20, 20.5, 5, flag=PASS), GONE)
    assert checked(nominal, written, [0, 1, 2, 3]) is None
    written = (START, line(9.5, 0.5, 5), line(20.25, 20.5, 5, flag=PASS), GONE)
    assert checked(nominal, written, [0, 1, 2, 3]) == (3, f"line 3 {MOVED}")


def test_exactly_so_many_digits_are_none() -> None:
    digit_mm = 0.5 / 0.6
    assert 0.6 * digit_mm == 0.5
    nominal = (START, CUT, line(9, 9, 9, flag=PASS), GONE)
    for off_mm, refused in ((0.5, None), (0.5000001, (3, f"line 3 {MOVED}"))):
        written = (START, CUT, line(9, 9 + off_mm, 9, flag=PASS), GONE)
        assert checked(nominal, written, [0, 1, 2, 3], digit_mm=digit_mm) == refused
