"""Heidenhain conversational programs: random jobs under an independent reader, and their rules."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.conversational import program as random_program
from cases.fast import some_fast
from judge import heidenhain, machines
from judge.linuxcnc import CanonMoves
from judge.machines import Recipe
from judge.model import JudgeModel
from judge.path import Deviation, deviation

import olp
from olp.core.errors import ProgramError
from olp.core.toolpath import Flag, Kind
from olp.files.config import load_setup
from olp.program.program import Program
from olp.program.registry import DIALECTS, Options, read

ORIGIN = np.array([250.0, 200.0, -300.0])
LENGTHS = {1: 120.0, 2: 85.5}
TRAVEL = ((-300.0, 900.0), (-300.0, 800.0), (-500.0, 100.0))
RECIPE = Recipe(controller="heidenhain", increment_mm=0.0001, travel=TRAVEL)
STILL = {"G54": np.zeros(3)}
#: tolerance, and what rounding to 0.1 um may add
ALLOWED_UM = 1.0 + 0.2
JUDGED = ("feed", "arc")
HEAD = "BEGIN PGM A MM\nTOOL CALL 1 Z S100\nL X+0 Y+0 Z+5 R0 FMAX\nF500\n"


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.random_machine(tmp_path_factory.mktemp("bent"), 7, RECIPE)


@pytest.fixture(scope="module")
def zero(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machines.zero_machine(tmp_path_factory.mktemp("zero"), RECIPE)


def canon(data: bytes) -> CanonMoves:
    return heidenhain.read(data, ORIGIN, LENGTHS).canon()


def judged(nominal: bytes, corrected: bytes, path: Path) -> Deviation:
    return deviation(canon(corrected), canon(nominal), JudgeModel(path), shift_by_frame=STILL, kinds=JUDGED)


def program(text: str, path: Path, **options: bool) -> Program:
    return read(text.encode(), load_setup(path), DIALECTS["heidenhain"], Options(**options))


def refused(text: str, path: Path, line: int, words: str) -> ProgramError:
    with pytest.raises(ProgramError, match=words) as caught:
        program(text, path)
    assert caught.value.line == line
    return caught.value


def ends(text: str, path: Path) -> np.ndarray:
    """Ends of the moves in numbers of the program, tool 1 active."""
    return program(text, path).toolpath.end_mm - ORIGIN - [0, 0, 120.0]


# -- whole jobs under the judge ------------------------------------------------------------------------


@pytest.mark.parametrize("seed", some_fast(range(24), 6, 3))
def test_random_jobs_follow_their_path(bent: Path, zero: Path, seed: int) -> None:
    data = random_program(seed)
    own = program(data.decode(), bent).toolpath
    assert own.end_mm == pytest.approx(np.array(canon(data).axis), abs=1e-6)
    assert olp.correct(data, zero).data == data
    result = olp.correct(data, bent)
    errors = judged(data, result.data, bent)
    assert errors.before.max_um > 10
    assert errors.max_um <= ALLOWED_UM
    assert result.report["deviation"]["path_max_um"] == pytest.approx(errors.max_um, abs=0.15)
    assert olp.verify(data, result.data, bent).report["deviation"]["holds"]


# -- what blocks say -----------------------------------------------------------------------------------


def test_words_are_held_and_blocks_of_bare_words_go_on(bent: Path) -> None:
    text = HEAD + "10 L X+10 Y-2.5\n11 Z-1\nL IX-4 R0\nY7.\nl x1 fmax\n  L\tX.5 ;X9\nEND PGM A MM\nL X+99\n"
    moves = program(text, bent)
    assert ends(text, bent).tolist() == pytest.approx(
        np.array(
            [[0, 0, 5], [10, -2.5, 5], [10, -2.5, -1], [6, -2.5, -1], [6, 7, -1], [1, 7, -1], [0.5, 7, -1]]
        )
    )
    kinds = [Kind.RAPID, Kind.LINE, Kind.LINE, Kind.LINE, Kind.LINE, Kind.RAPID, Kind.LINE]
    assert moves.toolpath.kind.tolist() == kinds
    assert moves.toolpath.line.tolist() == [3, 5, 6, 7, 8, 9, 10]
    assert moves.end_line == 11


def test_fmax_holds_in_its_block_alone(bent: Path) -> None:
    moves = program(HEAD + "L X1\nL X2 F MAX\nL X3\nL X4 F250\nL X5 FMAX\nX6\n", bent)
    assert moves.statements is not None
    feeds = np.array([np.inf, 500, np.inf, 500, 250, np.inf, 250]) / 60
    assert moves.statements.feed_mm_s.tolist() == pytest.approx(feeds.tolist())


def test_words_of_functions_are_no_moves_and_no_feeds(bent: Path) -> None:
    text = (
        HEAD
        + "L X1 M118 Z+7 Y1\nL X2 M103 F20\nL X3 M120 LA5\nL X4 M101 BT3 M8\nL Z1 M118\nL Y2 F90 M118 X1\n"
    )
    assert ends(text, bent)[1:].tolist() == pytest.approx(
        np.array([[1, 0, 5], [2, 0, 5], [3, 0, 5], [4, 0, 5], [4, 0, 1], [4, 2, 1]])
    )
    statements = program(text, bent).statements
    assert statements is not None
    assert statements.feed_mm_s[1:].tolist() == pytest.approx([500 / 60] * 5 + [1.5])
    # they stay where they are, also where the block is split
    corrected = olp.correct((HEAD + "L X+400 Y+300 M118 Z+7.5 F90\n").encode(), bent).data
    assert corrected.count(b"M118 Z+7.5 F90") == corrected.count(b"M118") == 1


def test_feeds_of_inch_programs_count_in_tenths(bent: Path) -> None:
    moves = program("BEGIN PGM A INCH\nL X1 Y1 Z1 F100\n", bent)
    assert moves.statements is not None
    assert moves.statements.feed_mm_s[0] == pytest.approx(10 * 25.4 / 60)
    assert moves.toolpath.end_mm[0] == pytest.approx(ORIGIN + 25.4)


def test_r0_fauto_and_joined_words(bent: Path) -> None:
    moves = program(HEAD + "L X1R0F100M3\nL X2 FAUTO\nL X3 F AUTO M8\nCR X5 Y2 R+2 DR+ R0 F9\n", bent)
    assert moves.statements is not None
    assert moves.toolpath.end_mm[:, 0] - ORIGIN[0] == pytest.approx(np.array([0, 1, 2, 3, 5]))
    assert np.isnan(moves.statements.feed_mm_s[2:4]).all()
    assert moves.statements.feed_mm_s[[1, 4]] * 60 == pytest.approx(np.array([100, 9]))


@pytest.mark.parametrize("circle", ["CP IPA{0}360 DR{0}", "C X{1} Y+50 DR{0}", "C DR{0}"])
def test_whole_circles_stay_whole_on_a_coarse_machine(tmp_path: Path, circle: str) -> None:
    """Whatever the digits of their ends, which are not those of where they begin."""
    recipe = Recipe(controller="heidenhain", increment_mm=0.001, travel=((-3000.0, 3000.0),) * 3)
    path = machines.random_machine(tmp_path, 1, recipe)
    text = "BEGIN PGM A MM\nTOOL CALL 1 Z\nL X+50 Y+50 Z+5 R0 FMAX\nCC X+50 Y+50\n"
    for k in range(1, 5):
        x, turned = 50 + 4.25 * k, "+-"[k % 2]
        text += f"L X{x} F800\n{circle.format(turned, x)}\nCP IPA+360 DR+\n"
    result = olp.correct((text + "END PGM A MM\n").encode(), path)
    assert result.report["deviation"]["holds"]
    assert judged(text.encode(), result.data, path).max_um < 1.0 + 1.5


def test_a_split_block_calls_its_cycle_once(bent: Path) -> None:
    text = DRILLED.replace(
        "L X-40 Y-30 R0 FMAX M99\nL X+50 FMAX M99", "L X-140 Y-30 R0 F900 M99\nL X+150 M99"
    )
    result = olp.correct(text.encode(), bent)
    assert result.data.count(b"M99") == 2
    assert result.data.count(b"\nL ") > text.count("\nL ")
    assert all(line.split()[-1] == b"M99" for line in result.data.splitlines() if b"M99" in line)


def test_angles_of_the_control_stay_in_rotary_words_alone(bent: Path) -> None:
    path = program(HEAD + "L A+Q120 C+Q122 R0 FMAX\nL X1\n", bent).toolpath
    assert len(path) == 2
    refused(HEAD + "L X+30,5\n", bent, 5, "decimal point instead of the comma")
    refused(HEAD + "L X+Q120\n", bent, 5, "parameters")
    assert unrolled("Q1 = 2\nFN 9: IF +Q1 IS UNDEFINED GOTO LBL 1\nL X+Q1\nLBL 1\n")[0] == "L X+2"
    assert unrolled("L A+Q120 C+Q122 FMAX\n")[0] == "L A+Q120 C+Q122 FMAX"


def test_words_go_behind_fmax_and_fauto_whole(bent: Path) -> None:
    text = HEAD + "L Z-1 R0 FMAX M91\nL A+0 C+0 FMAX\nL Z+5 FAUTO\nL X-150 Y-100 F MAX\n"
    written = olp.correct(text.encode(), bent).data
    assert all(word in written for word in (b"C+0 FMAX", b" FAUTO", b"F MAX"))


def test_feeds_may_be_parameters(bent: Path) -> None:
    moves = program(HEAD + "FN 0: Q2=+120\nL X1 FQ2\nQ2 = 60\nX2 FQ2\nX3\nL X4 FQ9\n", bent)
    assert moves.statements is not None
    assert moves.statements.feed_mm_s[1:4].tolist() == pytest.approx([2, 1, 1])
    assert np.isnan(moves.statements.feed_mm_s[4])


def test_the_pole_may_be_the_position_or_a_distance_from_it(bent: Path) -> None:
    arcs = program(
        HEAD + "CC X10 Y0\nC X20 DR+\nC DR-\nCC IX-5 IY0\nC X10 DR+\nCC\nL X13\nCP IPA+90 IZ-2 DR+\n"
        "CC Y5 Z5\nCP PA0 DR-\n", bent,
    ).toolpath.arcs  # fmt: skip
    assert arcs.sweep_rad == pytest.approx(np.pi * np.array([1, -2, 1, 0.5, -1.25]))
    assert arcs.plane.tolist() == [0, 0, 0, 0, 2]
    assert arcs.centre_mm[:3, :2] - ORIGIN[:2] == pytest.approx(np.array([[10, 0], [10, 0], [15, 0]]))


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("L X+Q5\n", 5, "takes numbers from parameters"), ("C X1 DR+\n", 5, "no pole"),
        ("CC X1\n", 5, "two axes of a plane"), ("CC X1 Y1\nC X2\n", 6, "no DR"),
        ("L X1 RL\n", 5, "offsets the contour"), ("L M128\n", 5, "rotary axes"),
        ("PLANE SPATIAL SPA+30 SPB+0 SPC+0 STAY\n", 5, "tilts"), ("L X1 IY2\n", 5, "distances"),
        ("FN 9: IF Q1 EQU 0 GOTO LBL 2\n", 5, "branches"), ("LP PR5 PA90\n", 5, "polar"),
        ("TOOL CALL 99 Z\nL X1\n", 6, "tool 99"), ('TOOL CALL "ABC" Z\n', 5, 'name = "ABC"'),
        ("CYCL DEF 10.0\nCYCL DEF 10.1 ROT+30\n", 6, "rotates"),
        ("CYCL DEF 7.1 #3\n", 5, "table of the control"),
        ("L X1 M99\n", 5, "none is defined"), ("CYCL DEF 252 ~\n Q203=0\nL X1 M99\n", 7, "CYCL DEF 252"),
        ("L X1 M89\n", 5, "at the end of each block"), ("CYCL CALL POS X1\n", 5, "where the holes are"),
        ("CC X0 Y5\nCP IPA+90 DR-\n", 6, "opposite"), ("/L X5\n", 5, "block delete"),
        ("CYCL DEF 220 Q216=+5\n", 5, "makes a pattern of holes"), ("CYCL DEF 221\n", 5, "makes a pattern"),
        ("CYCL DEF 200 Q201=-5\nFN 0: Q201 = -9\n", 6, "next call takes"),
        ("CYCL DEF 200 Q201=-5\nFN 1: Q201 = +Q1 + +9\n", 6, "next call takes"),
        ("CYCL DEF 200 Q201=-5\nFN 9: IF Q1 EQU 0 GOTO LBL 2\nQ201=-9\nLBL 2\n", 6, "next call takes"),
        ("PLANE SPATIAL SPA+0 SPB-1 SPC+0 TURN\n", 5, "tilts"), ("FLT\n", 5, "free contour"),
        ("CYCL DEF 371 X\n", 5, "builder"), ("CYCL DEF 410 X\n", 5, "may move the datum"),
        ("L X1 M112\n", 5, "M112"), ("HOPP X1\n", 5, "not a statement"),
        ("L X1 G1\n", 5, "not understood"), ("L D5\n", 5, "not understood"),
        ("L X1 K3\n", 5, "not understood"),
        ("L X1 R5\n", 5, "the word R"), ("L X1 DR+\n", 5, "the word DR"),
        ("CC X1 Y1\nC X2 DR- RR\n", 6, "RR:"),
        ("TCH PROBE 400\n", 5, "only the control knows"),
        ("TOOL CALL 2 Y S5\n", 5, "along Y"), ("L X1\rL X2\n", 5, "carriage return"),
    ],
)  # fmt: skip
def test_what_is_refused_and_where(bent: Path, text: str, line: int, words: str) -> None:
    refused(HEAD + text, bent, line, words)


@pytest.mark.parametrize(
    ("text", "x"),
    [
        ("CYCL DEF 7.1 X+10", 11), ("CYCL DEF 7.1 X10\nCYCL DEF 7.1 IX-4", 7), ("CYCL DEF 7.1 X - 2", -1),
        ("Q5=8\nCYCL DEF 7.1 X+Q5", 9), ("Q5=8\nCYCL DEF 7.1 X-Q5", -7),
        ("TRANS DATUM AXIS X+10 Y+1", 11), ("CYCL DEF 7.1 X9\nTRANS DATUM RESET", 1),
        # what changes nothing is read
        ("CYCL DEF 10.1 ROT+0\nCYCL DEF 11.1 SCL 1\nCYCL DEF 26.1 X1 CCX5\nCYCL DEF 19.1 A+0 B0\n"
         "TRANS ROTATION RESET\nTRANS MIRROR RESET", 1),
    ],
)  # fmt: skip
def test_datum_shifts(bent: Path, text: str, x: float) -> None:
    assert ends(f"{HEAD}{text}\nL X1\n", bent)[-1, 0] == pytest.approx(x)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        # each would leave the words where they are
        ("CYCL DEF 10.1 IROT+45", "rotates"), ("CYCL DEF 10.1 ROT+Q1", "rotates"),
        ("CYCL DEF 26.1 X1 Y2", "scales"), ("CYCL DEF 19.1 B+Q1", "tilts"), ("CYCL DEF 8.1 X", "mirrors"),
        ("CYCL DEF 7.1 X+Q1", "value is not known"), ("CYCL DEF 7.1 Xnan", "is not understood"),
        ("CYCL DEF 7.1 #5", "from a table"), ("TRANS DATUM TABLE TABLINE5", "from a table"),
        ("TRANS SCALE SCL0.5", "scales"), ("TRANS DATUM", "is not understood"),
    ],
)  # fmt: skip
def test_frames_that_are_not_read_are_no_silence(bent: Path, text: str, words: str) -> None:
    refused(f"{HEAD}{text}\nL X1\n", bent, 5, words)


def test_planes_that_turn_back_may_move_all_axes(bent: Path) -> None:
    for text, moves in (("PLANE RESET TURN FMAX", 2), ("PLANE SPATIAL SPA+0 SPB+0 SPC+0 TURN FMAX", 2),
                        ("PLANE RESET STAY", 2), ("PLANE RESET MOVE ABST50 FMAX", 3)):  # fmt: skip
        path = program(HEAD + text + "\nL X1 FMAX\n", bent).toolpath
        assert len(path) == moves
        assert bool(np.isfinite(path.end_mm[-1]).all()) == (moves == 2)
        assert path.end_mm[-1, 0] == ORIGIN[0] + 1


def test_sections_that_only_set_modes_may_be_called(bent: Path) -> None:
    text = (
        HEAD
        + "CYCL DEF 7.1 X+100\nL X1\nCALL LBL 1 ; RESET\nL X1\nM30\nLBL 1\nCYCL DEF 7.0\nCYCL DEF 7.1 X0\n"
    )
    assert ends(text + "M127\nLBL 0\nEND PGM A MM\n", bent)[1:, 0].tolist() == pytest.approx([101, 1])
    refused(text + "L X5\nLBL 0\n", bent, 7, "CALL LBL")


def test_a_jump_over_what_moves_nothing_is_read(bent: Path) -> None:
    text = HEAD + "FN 18: SYSREAD Q1 = ID240\nQ4 = 60\nL X1 FQ4\nFN9: IF +Q1 EQU -10 GOTO LBL1\n"
    moves = program(text + "Q4 = 5\nFN15: PRINT Q4\nLBL1\nL X2 FQ4\n", bent)
    assert moves.statements is not None
    assert moves.statements.feed_mm_s[1] == pytest.approx(1.0)
    assert np.isnan(moves.statements.feed_mm_s[2])
    for between in ("L X5\n", "CYCL DEF 7.0\nCYCL DEF 7.1 X+5\n", "M3\n", "TOOL CALL 2 Z\n", "LBL2\n"):
        refused(text + between + "LBL1\nL X2\n", bent, 8, "FN 9")
    refused(HEAD + "LBL 1\nFN 9: IF +Q1 EQU -10 GOTO LBL 1\n", bent, 6, "FN 9")


def test_a_preset_is_a_work_offset_or_that_of_the_job(bent: Path, tmp_path: Path) -> None:
    text = "CYCL DEF 247 DATUM~\n  Q339=+2 ;N\nL X1 Y1 Z1 F9\n"
    own = program(text, bent)
    assert own.toolpath.end_mm[0] == pytest.approx(ORIGIN + 1)
    assert [name for name, _, _ in own.remarks if name == "preset"] == ["preset"]
    refused(text + "CYCL DEF 247 Q339=3\n", bent, 4, "frame 3")
    frames = {**machines.WORK_OFFSETS, "2": {"X_mm": 5.0, "Y_mm": 6.0, "Z_mm": 7.0, "set_by": "true"}}
    path = machines.random_machine(tmp_path, 3, Recipe(controller="heidenhain", work_offsets=frames))
    assert program(text, path).toolpath.end_mm[0].tolist() == pytest.approx([6, 7, 8])


def test_tools_are_called_by_number_or_name_with_their_delta(tmp_path: Path) -> None:
    tools = {1: {"Z_mm": 120.0}, 7: {"Z_mm": 80.0, "name": "Mill_D10"}}
    path = machines.random_machine(tmp_path, 3, Recipe(controller="heidenhain", tools=tools))
    moves = program('L X0 Y0 Z0\nTOOL CALL "MILL_D10" Z S1 DL+0.5\nL X0 Y0 Z0\nTOOL CALL S2000\nL X1\n', path)
    z = moves.toolpath.end_mm[:, 2] - ORIGIN[2]
    assert z[[0, 2, 3]].tolist() == pytest.approx([0, 80.5, 80.5])
    # a tool change, but not another speed, leaves the axes unknown
    assert np.isnan(moves.toolpath.end_mm[1]).all()
    assert moves.toolpath.frames[-1].tool_mm == (0, 0, -80.5)


def test_m91_takes_axis_positions_and_m92_is_not_known(bent: Path) -> None:
    path = program(HEAD + "L Z-10 R0 FMAX M91\nL X1\nL Y5 Z0 FMAX M92\nL X2\n", bent).toolpath
    assert path.end_mm[1, 2] == -10.0
    assert path.flag[1] == Flag.PASS | Flag.MACHINE
    assert path.end_mm[2, 2] == -10.0
    assert np.isnan(path.end_mm[3:, 1:]).all()
    assert path.end_mm[4, 0] == ORIGIN[0] + 2


def test_a_split_block_repeats_r0_and_fmax_and_its_late_functions_come_last(bent: Path) -> None:
    text = b"BEGIN PGM A MM\n1 L X-150 Y-100 Z5 R0 FMAX\n12 L X+200 R0 F500 M8 M9\nEND PGM A MM\n"
    blocks = olp.correct(text, bent).data.splitlines()[3:-1]
    assert len(blocks) > 2
    assert all(block.startswith(b"12 L ") and b" R0" in block for block in blocks)
    assert [b"M8" in block for block in blocks] == [True] + [False] * (len(blocks) - 1)
    assert [b"M9" in block for block in blocks] == [False] * (len(blocks) - 1) + [True]
    split = olp.correct(text.replace(b"F500", b"F MAX"), bent, split_rapids=True).data.splitlines()[3:-1]
    assert len(split) > 2
    assert all(block.endswith(b" R0 F MAX") for block in split[1:-1])


@pytest.mark.slow
def test_corrected_text_is_read_band_by_band_alike(bent: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    data = b"".join(
        random_program(seed, 40).split(b"FMAX M30")[0].rsplit(b"\n", 1)[0] + b"\n" for seed in (1, 2)
    )
    whole = olp.correct(data, bent).data
    monkeypatch.setattr("olp.program.bands.SIZE", 7)
    assert olp.correct(data, bent).data == whole


DRILLED = """BEGIN PGM D MM
TOOL CALL 1 Z S100
L X-40 Y-30 Z+50 R0 FMAX
CYCL DEF 200 DRILLING ~
  Q200=+2 ;CLEAR ~
  Q201=-20 ~
  Q206=+150 ~
  Q203=+0 ;SURFACE ~
  Q204=+10
L X-40 Y-30 R0 FMAX M99
L X+50 FMAX M99
L Y+45 R0 FMAX
CYCL CALL
L Z+60 FMAX
END PGM D MM
"""


def test_holes_are_right_across_and_along_the_tool(bent: Path, zero: Path) -> None:
    assert olp.correct(DRILLED.encode(), zero).data == DRILLED.encode()
    own = program(DRILLED, bent).toolpath
    assert own.end_mm == pytest.approx(np.array(canon(DRILLED.encode()).axis), abs=1e-9)
    result = olp.correct(DRILLED.encode(), bent)
    # each hole has a surface of its own, and no other number of the cycle changes
    assert result.data.count(b"CYCL DEF 200") == 4
    assert result.data.count(b"Q201=-20 ~") == 4
    nominal, written = canon(DRILLED.encode()), canon(result.data)
    bottoms = [m.axis[np.abs(m.axis[:, 2] + 200) < 0.5] for m in (nominal, written)]
    tip = JudgeModel(bent).error_mm(bottoms[1], np.array([0.0, 0.0, -120.0])) + bottoms[1]
    assert np.abs((tip - bottoms[0])[:, 2]).max() < 0.1e-3
    assert np.hypot(*(tip - bottoms[0])[:, :2].T).max() < 5e-3


def test_cycles_that_count_from_the_present_height_begin_where_their_bottom_is_right(bent: Path) -> None:
    text = (
        "CYCL DEF 1.0 PECKING\nCYCL DEF 1.1 DIST2\nCYCL DEF 1.2 DEPTH-12\nCYCL DEF 1.5 F120\n"
        "L X-40 Y-30 Z+2 FMAX M99\nL X+50 FMAX M99\n"
    )
    result = olp.correct((HEAD + text).encode(), bent)
    bottom = program(result.data.decode(), bent).toolpath.end_mm
    at = bottom[np.abs(bottom[:, 2] - (ORIGIN[2] + 120 - 12)) < 0.5]
    tip = JudgeModel(bent).error_mm(at, np.array([0.0, 0.0, -120.0])) + at
    assert np.abs(tip[:, 2] - (ORIGIN[2] + 120 - 12)).max() < 0.1e-3


# -- loops, calls and parameters -----------------------------------------------------------------------


def unrolled(text: str, **options: object) -> list[str]:
    return (
        DIALECTS["heidenhain"].unroller(text.encode(), DIALECTS["heidenhain"], **options).decode().split("\n")
    )  # type: ignore[misc]


LOOP = """0 BEGIN PGM Q MM
1 FN 0: Q1 = +3 ; COUNT
2 Q2 = 10 * COS 60 + SQRT ( 16 )
3 LBL 1
4 L X+Q2 Y-Q1 FQ1 ; Q1
5 FN 2: Q1 = +Q1 - +1
6 FN 11: IF +Q1 GT +1 GOTO LBL 1
7 CALL LBL "SUB"
8 LBL 7
9 L IX+1
10 CALL LBL 7 REP 2/2
11 M30
12 LBL "SUB"
13 L Z-1
14 LBL 0
15 END PGM Q MM
"""


def test_loops_calls_and_parameters_are_written_out() -> None:
    assert unrolled(LOOP)[:-1] == [
        "0 BEGIN PGM Q MM", "4 L X+9 Y-3 F3 ; Q1", "4 L X+9 Y-2 F2 ; Q1", "13 L Z-1", "9 L IX+1", "9 L IX+1",
        "9 L IX+1", "11 M30", "15 END PGM Q MM",
    ]  # fmt: skip


def test_an_unrolled_program_is_corrected_and_named_by_its_lines(bent: Path) -> None:
    text = LOOP.replace("3 LBL 1", "L X+0 Y+0 Z+0 R0 FMAX\n3 LBL 1").encode()
    result = olp.correct(text, bent, flatten=True)
    assert result.report["deviation"]["holds"]
    with pytest.raises(ProgramError, match="--flatten") as caught:
        olp.correct(text, bent)
    assert caught.value.line == 6


@pytest.mark.parametrize(
    ("formula", "value"),
    [
        ("Q1 = 2 + 3 * 4", 14), ("Q1 = ( 2 + 3 ) * 4", 20), ("Q1 = -2 ^ 2", 4), ("Q1 = 7 / 2 - 1", 2.5),
        ("Q1 = 2 ^ 3 ^ 2", 512), ("Q1 = SQ 2 ^ 3", 64), ("Q1 = 8 / 4 / 2", 1),
        ("Q1 = 2 - 3 - 4 * 2 ^ 2", -17),
        ("Q1 = SIN 30 + SQ 3", 9.5), ("Q1 = INT -2.7", -2), ("Q1 = FRAC 2.5", 0.5), ("Q1 = SGN -4", -1),
        ("Q1 = ATAN 1", 45), ("Q1 = ABS NEG 3", 3), ("Q1 = PI", np.pi), ("FN 1: Q1 = -2 + -5", -7),
        ("FN 2: Q1 = +5 - -2", 7), ("FN 3: Q1 = +3 * +3", 9), ("FN 4: Q1 = +4 DIV +8", 0.5),
        ("FN 5: Q1 = SQRT 4", 2), ("FN 6: Q1 = SIN-90", -1), ("FN 7: Q1 = COS+0", 1),
        ("FN 8: Q1 = +3 LEN +4", 5), ("FN 13: Q1 = +10 ANG -10", 135), ("FN0: Q1=.5", 0.5),
        ("QL1 = 3\nQ1 = QL1 * 2", 6), ("Q1 = 2 + 400.5 % 360", 42.5),
    ],
)  # fmt: skip
def test_formulas(formula: str, value: float) -> None:
    (block,) = [line for line in unrolled(formula + "\nL X+Q1\n") if line]
    assert float(block.removeprefix("L X")) == pytest.approx(value, abs=1e-6)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("L X+Q5\n", "Q5 is used before"), ("Q1 = 1 / 0\n", "has no value"),
        ("Q1 = -5 % 3\n", "has no value"), ("Q1 = ( 2\n", "not closed"),
        ("Q1 = FOO 2\n", "not read in formulas"), ("FN 9: IF +1 EQU +1 GOTO LBL 9\n", "no LBL 9"),
        ("CALL PGM TNC:\\\\OTHER.H\n", "no such file"), ("LBL 1\nCALL LBL 1\n", "nested deeper"),
        ("FN 0: Q1=1\nFN 18: SYSREAD Q1 = ID1 NR2\nL X+Q1\n", "Q1 is used before"),
        ("LBL 1\nL X1\nFN 9: IF +1 EQU +1 GOTO LBL 1\n", "more than 3280 bytes"),
    ],
)  # fmt: skip
def test_what_cannot_be_unrolled(text: str, words: str) -> None:
    with pytest.raises(ProgramError, match=words) as caught:
        unrolled(text, limit=400)
    assert caught.value.line is not None


def test_programs_beside_are_called(bent: Path, tmp_path: Path) -> None:
    (tmp_path / "MAIN.H").write_text(
        "BEGIN PGM MAIN MM\nQ1=5\nCALL PGM TNC:\\A\\SUB.H\nL Y+Q2\nEND PGM MAIN MM\n"
    )
    (tmp_path / "sub.h").write_text("BEGIN PGM SUB MM\nL X+Q1 Y0 Z0 F50\nQ2=7\nEND PGM SUB MM\n")
    text = olp.flatten(tmp_path / "MAIN.H", bent)
    assert text.split(b"\n")[1:3] == [b"L X+5 Y0 Z0 F50", b"L Y+7"]


def test_a_program_of_another_unit_is_not_called(bent: Path, tmp_path: Path) -> None:
    (tmp_path / "SUB.H").write_text("BEGIN PGM SUB INCH\nL X+1\nEND PGM SUB INCH\n")
    (tmp_path / "MAIN.H").write_text("BEGIN PGM MAIN MM\nCALL PGM SUB\nEND PGM MAIN MM\n")
    with pytest.raises(ProgramError, match="unit") as caught:
        olp.flatten(tmp_path / "MAIN.H", bent)
    assert caught.value.line == 1


def test_a_sign_may_stand_apart_from_its_parameter() -> None:
    assert unrolled("Q1=2.5\nQ2=-4\nL X+ Q1 Y -Q2 Z- Q2\n")[0].split() == ["L", "X+2.5", "Y", "+4", "Z+4"]


def test_a_parameter_of_the_cycle_in_force_takes_its_new_value() -> None:
    cycle = "CYCL DEF 200 ~\n Q203=+0 ~\n Q201=Q1 ; DEPTH ~\n Q2010=7"
    text = unrolled("Q1=-3\n" + cycle + "\nL X1 M99\nFN 0: Q201 = -9\nQ203=0\nQ9=8\nL X2 M99\n")
    first = cycle.replace("Q1 ;", "-3 ;").split("\n")
    again = cycle.replace("Q1 ;", "-9 ;").split("\n")
    assert text == [*first, "L X1 M99", *again, "L X2 M99", ""]
    asked = "FN 18: SYSREAD Q201 = ID1 NR2\n"
    with pytest.raises(ProgramError, match="Q201 belongs to the cycle") as caught:
        unrolled("Q1=-3\n" + cycle + "\n" + asked)
    assert caught.value.line == 6
    text = unrolled("Q1=-3\n" + cycle + "\n" + asked, parameters={"Q201": -4.5})
    assert " Q201=-4.5 ; DEPTH ~" in text


def test_a_call_of_a_tool_sets_q108_to_its_radius(bent: Path) -> None:
    setup = load_setup(bent)
    text = "BEGIN PGM A {unit}\nTOOL CALL {tool} Z DR+0.25\nL X+Q108\n"
    for unit, value in (("MM", "5.25"), ("INCH", "0.44685")):
        lines = unrolled(text.format(unit=unit, tool=1), setup=setup)
        assert lines[2] == f"L X+{value}"
    assert unrolled(text.format(unit="MM", tool=1), parameters={"Q108": 2})[2] == "L X+2"
    with pytest.raises(ProgramError, match="Q108 is used before"):
        unrolled(text.format(unit="MM", tool=77), setup=setup)


def test_values_of_the_control_may_be_stated_in_the_job() -> None:
    text = "FN 18: SYSREAD Q13 = ID270 NR1 IDX1\nL X+Q13\n"
    assert unrolled(text, parameters={"Q13": 2.25})[0] == "L X+2.25"
