"""Cases worked out by hand, as programs: zero setting, backlash, lever arms, start state."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cases.acceptance import TRUE_ZERO, machine, points, unstamped, words
from judge.model import JudgeModel

import olp
from olp.core.errors import AlreadyCorrected, ConfigError, OlpError, OutsideBox, ProgramError

STEP = "X_mm,EXX_um\n-1000,10\n150,10\n160,25\n2000,25\n"
CURVE_X = '[[curves]]\nfile = "x.csv"\ninterpolation = "linear"\n'
SQUARE = "[squareness]\nC0Y_urad = 100.0\n"
HEAD = b"G21 G90 G54\n"
FINE_MM = 0.0001


def corrected(path: Path, body: bytes, **options: object) -> bytes:
    job = path.with_name("job.toml")
    result = olp.correct(HEAD + body, path, job if job.exists() else None, **options)  # type: ignore[arg-type]
    return unstamped(result.data)[len(HEAD) :]


def refused_line(path: Path, body: bytes) -> int | None:
    with pytest.raises(ProgramError) as caught:
        corrected(path, body)
    assert caught.value.line is not None
    return caught.value.line


# -- zero setting -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("set_by", "expected"), [("touch", (0.0, 99.985)), ("true", (-0.01, 99.975))])
def test_a_touched_off_point_keeps_its_place(
    tmp_path: Path, set_by: str, expected: tuple[float, float]
) -> None:
    frame = f'[work_offsets.G54]\nX_mm = 100.0\nset_by = "{set_by}"\n'
    path = machine(tmp_path, CURVE_X, {"x.csv": STEP}, tables=frame)
    text = corrected(path, b"G0 X0. Y0. Z0.\nG0 X100.\n")
    assert words(text, "X") == pytest.approx(expected, abs=1e-9)


def test_a_touch_elsewhere_counts_where_it_was_made(tmp_path: Path) -> None:
    """Touched at axis 200 (25 um): program zero at axis 100 (10 um) has to shift by 15 um."""
    frame = "[work_offsets.G54]\nX_mm = 100.0\ntouched_at_mm = { X = 200.0 }\n"
    path = machine(tmp_path, CURVE_X, {"x.csv": STEP}, tables=frame)
    assert words(corrected(path, b"G0 X0. Y0. Z0.\nX100.\n"), "X") == pytest.approx((0.015, 100.0), abs=1e-9)


def test_the_length_of_the_touch_tool_counts(tmp_path: Path) -> None:
    """EZZ grows by 10 um over 100 mm: touched with a tool of 50 mm, the axis stood 50 mm higher."""
    frame = "[work_offsets.G54]\nZ_mm = 100.0\ntouch_tool = 1\n[tools.1]\nZ_mm = 50.0\n"
    curve = {"z.csv": "Z_mm,EZZ_um\n-1000,-100\n2000,200\n"}
    path = machine(tmp_path, CURVE_X.replace("x.csv", "z.csv"), curve, tables=frame, increment_mm=FINE_MM)
    # axis 100 has 10 um, the touch at axis 150 has 15 um: command = -(10 - 15) um, less 1e-4 of itself
    assert words(corrected(path, b"G0 X0 Y0 Z0.\n"), "Z") == [pytest.approx(0.005, abs=1e-4)]


# -- lever arms, squareness, temperature ----------------------------------------------------------------


@pytest.mark.parametrize(
    ("reference", "expected"), [('reference = "table"', (0.0043, -0.004)), ("", (0.0013, -0.004))]
)
def test_yaw_of_a_moving_table(tmp_path: Path, reference: str, expected: tuple[float, float]) -> None:
    tool = "[tools.1]\ngauge_to_tip_mm = [0.0, 130.0, -243.5]\n[job_defaults]\ntool = 1\n"
    curve = {"y.csv": "Y_mm,ECY_urad\n-1000,10\n2000,10\n"}
    path = machine(
        tmp_path,
        CURVE_X.replace("x.csv", "y.csv") + reference,
        curve,
        chain="YFXZ",
        tables=TRUE_ZERO + tool,
        increment_mm=FINE_MM,
    )
    (end,) = points(corrected(path, b"G0 X400. Y300. Z200.\n"))
    assert end - (400, 300, 200) == pytest.approx((*expected, 0.0), abs=0.51e-4)


@pytest.mark.parametrize("tool_mm", [0.0, 300.0])
def test_squareness_counts_from_the_datum(tmp_path: Path, tool_mm: float) -> None:
    tool = f"[tools.1]\nZ_mm = {tool_mm}\n[job_defaults]\ntool = 1\n"
    calibration = "datum_mm = [0.0, 1000.0, 0.0]\n[squareness]\nC0Y_urad = 20.0\n"
    path = machine(tmp_path, calibration, tables=TRUE_ZERO + tool)
    text = corrected(path, b"G0 X0. Y1000. Z0.\nG0 X0. Y0.\n")
    assert words(text, "X") == [0.0, -0.02]
    assert words(text, "Y") == [1000.0, 0.0]


def test_temperatures_of_scale_and_workpiece(tmp_path: Path) -> None:
    """30 ppm at 22 degC; scale and workpiece at 25 degC: 30 + 11.5 x 3 - 12 x 5 = 4.5 um at 1000 mm."""
    calibration = CURVE_X + "[thermal]\nX_scale_um_m_K = 11.5\nworkpiece_um_m_K = 12.0\n"
    job = "[temperatures_degC]\nX_scale = 25.0\nworkpiece = 25.0\n"
    curve = {"x.csv": "X_mm,EXX_um\n-1000,-30\n2000,60\n"}
    path = machine(tmp_path, calibration, curve, tables=TRUE_ZERO, job=job, increment_mm=FINE_MM)
    file = path.with_name("calibration.toml")
    file.write_text(file.read_text().replace("temperature_degC = 20.0", "temperature_degC = 22.0"))
    assert words(corrected(path, b"G0 X1000. Y0. Z0.\n"), "X") == [pytest.approx(999.9955, abs=1e-9)]


def test_tools_of_two_lengths_cut_one_plane_of_a_warm_part(tmp_path: Path) -> None:
    """A part of 23 um/(m K), 10 K warm; its plane at machine Z 200 lies 46 um higher than in the cold."""
    frame = '[work_offsets.G54]\nZ_mm = 200.0\nset_by = "true"\n[tools]\n1.Z_mm = 120.0\n2.Z_mm = 20.0\n'
    job = "[temperatures_degC]\nworkpiece = 30.0\n"
    path = machine(tmp_path, "[thermal]\nworkpiece_um_m_K = 23.0\n", tables=frame, job=job)
    body = b"T1 M6\nG43 H1\nG0 X0. Y0. Z0.\nG1 X1. F60\nT2 M6\nG43 H2\nG0 X0. Y0. Z0.\nG1 X1.\n"
    assert words(corrected(path, body), "Z") == [0.046, 0.046]


# -- backlash -----------------------------------------------------------------------------------------

PLAY = "[backlash]\nX_um = 6.0\n"


def test_each_side_of_the_play_gets_half(tmp_path: Path) -> None:
    text = corrected(machine(tmp_path, PLAY, tables=TRUE_ZERO), b"G0 X-5. Y0. Z0.\nX0.\nX10.\nX0.\n")
    assert points(text)[[0, 1, 2, -1], 0].tolist() == [-5.0, 0.003, 10.003, -0.003]


def test_within_the_play_the_tip_arrives_all_the_same(tmp_path: Path) -> None:
    """The waypoints of the hand case, behind a run-up: the tip ends on each of them within the dead band."""
    path = machine(tmp_path, PLAY, tables=TRUE_ZERO, increment_mm=FINE_MM)
    nominal = np.array([0.0, 10.0, 10.002, 9.999, 9.9, 9.9005, 12.0])
    body = "G0 X-5. Y0. Z0.\nG1 F100 " + "\n".join(f"X{x}" for x in nominal) + "\n"
    command = np.vstack([np.zeros(3), points(corrected(path, body.encode()))])
    state, known = JudgeModel(path).play(command)
    tip = command[:, 0] - 0.003 * state[:, 0]
    reached = [float(np.abs(tip[known[:, 0]] - x).min()) for x in nominal]
    assert max(reached) <= 0.25e-3 + 0.5e-4 + 1e-9
    assert abs(tip[-1] - 12.0) <= 0.25e-3 + 0.5e-4 + 1e-9


def test_other_axes_feel_no_play(tmp_path: Path) -> None:
    text = corrected(machine(tmp_path, PLAY, tables=TRUE_ZERO), b"G0 X0 Y0 Z0\nY10.\nY0.\nZ5.\nZ0.\n")
    assert text == b"G0 X0 Y0 Z0\nY10.\nY0.\nZ5.\nZ0.\n"


# -- what is known at the start --------------------------------------------------------------------------


@pytest.fixture
def square(tmp_path: Path) -> Path:
    """100 urad between X and Y: X is wrong by -Y / 10000."""
    return machine(tmp_path, SQUARE, tables=TRUE_ZERO + "[tools.1]\nZ_mm = 10.0\n")


def test_a_rapid_that_needs_an_unknown_axis_passes_and_is_listed(square: Path) -> None:
    text = HEAD + b"G0 X50.\nG0 Y100.\nG1 X60. F100\n"
    result = olp.correct(text, square)
    assert unstamped(result.data) == HEAD + b"G0 X50.\nG0 Y100. X50.010\nG1 X60.010 F100\n"
    assert [f.lines for f in result.findings if f.code == "OLP102"] == [(2,)]


def test_a_feed_move_that_needs_an_unknown_axis_is_refused(square: Path) -> None:
    assert refused_line(square, b"G1 X50. F100\n") == 2


def test_an_axis_that_does_not_matter_may_stay_unknown(square: Path) -> None:
    assert corrected(square, b"G0 X0. Y100.\nG1 X5. F100\n") == b"G0 X0.010 Y100.\nG1 X5.010 F100\n"


def test_no_word_is_inserted_for_an_unknown_axis(square: Path) -> None:
    text = corrected(square, b"G0 Y100.\nG0 Z5.\nG0 X0.\n")
    assert text == b"G0 Y100.\nG0 Z5.\nG0 X0.010\n"


def test_the_job_may_say_where_the_axes_are(tmp_path: Path) -> None:
    path = machine(tmp_path, SQUARE, tables=TRUE_ZERO, job="start_mm = { X = 0.0, Y = 100.0, Z = 0.0 }")
    assert corrected(path, b"G1 X50. F100\n") == b"G1 X50.010 F100\n"


@pytest.mark.parametrize("away", [b"T1 M6\n", b"G28\n", b"G28 X0\n", b"G30\n"])
def test_axes_are_unknown_after_the_control_moved_them(square: Path, away: bytes) -> None:
    body = b"G0 X0. Y100. Z5.\n" + away
    assert refused_line(square, body + b"G91 G1 Y1. F100\n") == 4
    assert corrected(square, body + b"G0 X0. Y50. Z5.\nG1 X5. F9\n").endswith(
        b"G0 X0.005 Y50. Z5.\nG1 X5.005 F9\n"
    )


def test_g28_forgets_only_the_axes_it_moves(square: Path) -> None:
    text = corrected(square, b"G0 X0. Y100. Z5.\nG28 Z5.\nG1 X5. F100\n")
    assert text == b"G0 X0.010 Y100. Z5.\nG28 Z5.\nG1 X5.010 F100\n"


def test_g53_moves_pass_and_leave_the_axis_where_the_machine_has_it(square: Path) -> None:
    text = corrected(square, b"G0 X0. Y100. Z5.\nG53 G0 Z0.\nG53 G0 X20. Y200.\nG1 X30. F100\n")
    assert text == b"G0 X0.010 Y100. Z5.\nG53 G0 Z0.\nG53 G0 X20. Y200.\nG1 X30.020 F100\n"


def test_g53_is_outside_the_box_check(tmp_path: Path) -> None:
    path = machine(tmp_path, SQUARE, tables=TRUE_ZERO)
    assert b"G53 G0 Z2500." in corrected(path, b"G0 X0. Y0. Z0.\nG53 G0 Z2500.\n")
    with pytest.raises(OutsideBox) as caught:
        corrected(path, b"G0 X0. Y0. Z0.\nG0 Z2500.\n")
    assert caught.value.line == 3


# -- stored positions ----------------------------------------------------------------------------------


def test_g92_stores_the_corrected_place(square: Path) -> None:
    """At Y = 100 the axis stands 10 um off, so the word that names the place does too."""
    body = b"G0 X10. Y100. Z0.\nG92 X0. Y0.\nG1 X5. F100\nG92.1\nG0 X10. Y0.\n"
    assert corrected(square, body) == (
        b"G0 X10.010 Y100. Z0.\nG92 X0.010 Y0.\nG1 X5.010 F100\nG92.1\nG0 X10. Y0.\n"
    )


def test_g10_l20_stores_the_corrected_place(square: Path) -> None:
    body = b"G0 X10. Y100. Z0.\nG10 L20 P1 X0. Y0.\nG1 X5. F100\n"
    assert corrected(square, body) == b"G0 X10.010 Y100. Z0.\nG10 L20 P1 X0.010 Y0.\nG1 X5.010 F100\n"


def test_g10_l2_is_no_position(square: Path) -> None:
    body = b"G10 L2 P1 X5. Y0. Z0.\nG0 X0. Y100. Z0.\n"
    assert corrected(square, body) == b"G10 L2 P1 X5. Y0. Z0.\nG0 X0.010 Y100. Z0.\n"


@pytest.mark.parametrize("store", [b"G28.1\n", b"G30.1\n"])
def test_a_store_without_a_word_is_refused(square: Path, store: bytes) -> None:
    assert refused_line(square, b"G0 X0. Y0. Z0.\n" + store) == 3


# -- block delete ---------------------------------------------------------------------------------------


def test_a_deletable_block_that_others_build_on_is_refused(square: Path) -> None:
    assert refused_line(square, b"G0 X0. Y0. Z0.\n/G1 Y100. F100\nG1 X50. F100\n") == 3


def test_a_deletable_block_may_stand_where_the_next_names_all(square: Path) -> None:
    body = b"G0 X0. Y0. Z0.\n/G1 X9. Y100. F100\nG0 X50. Y50.\n"
    text = corrected(square, body)
    for switch in (text, b"".join(line for line in text.splitlines(True) if not line.startswith(b"/"))):
        assert points(switch)[-1].tolist() == [50.005, 50.0, 0.0]
    assert points(text)[-2].tolist() == [9.01, 100.0, 0.0]


# -- once and only once -----------------------------------------------------------------------------------


def test_a_second_correction_is_refused_with_the_line_of_the_stamp(square: Path) -> None:
    first = olp.correct(b"%\n" + HEAD + b"G0 X0. Y100. Z0.\n%\n", square).data
    with pytest.raises(AlreadyCorrected) as caught:
        olp.correct(first, square)
    assert caught.value.line == 2


def test_an_unchanged_program_carries_no_stamp(square: Path) -> None:
    text = HEAD + b"G0 X5. Y0. Z0.\n"
    assert olp.correct(text, square).data == text


def test_the_stamp_changes_with_the_calibration_alone(tmp_path: Path) -> None:
    text = HEAD + b"G0 X0. Y100. Z0.\n"
    path = machine(tmp_path, SQUARE, tables=TRUE_ZERO)
    first, again = olp.correct(text, path).data, olp.correct(text, path).data
    assert first == again
    machine(tmp_path, SQUARE.replace("100", "101"), tables=TRUE_ZERO)
    assert olp.correct(text, path).data.splitlines()[0] != first.splitlines()[0]


# -- what the control does itself ------------------------------------------------------------------------

TWO = CURVE_X + SQUARE
SHIFT = {"x.csv": "X_mm,EXX_um\n-1000,25\n2000,25\n"}


@pytest.mark.parametrize(
    ("compensated", "active", "expected"),
    [("[]", "[]", -0.015), ('["EXX"]', "[]", 0.01), ("[]", '["EXX"]', -0.015), ('["C0Y"]', "[]", -0.025)],
)
def test_the_control_is_left_what_it_corrects(
    tmp_path: Path, compensated: str, active: str, expected: float
) -> None:
    keys = f"compensated_by_controller = {compensated}"
    path = machine(
        tmp_path, f"active_during_measurement = {active}\n" + TWO, SHIFT, keys=keys, tables=TRUE_ZERO
    )
    assert words(corrected(path, b"G0 X0. Y100. Z0.\n"), "X") == [pytest.approx(expected, abs=1e-9)]


def test_an_error_is_measured_with_the_control_or_left_to_it_not_both(tmp_path: Path) -> None:
    keys = 'compensated_by_controller = ["EXX"]'
    path = machine(
        tmp_path, 'active_during_measurement = ["EXX"]\n' + TWO, SHIFT, keys=keys, tables=TRUE_ZERO
    )
    with pytest.raises(ConfigError, match="EXX"):
        corrected(path, b"G0 X0. Y100. Z0.\n")


def test_a_control_that_corrects_all_is_refused(tmp_path: Path) -> None:
    path = machine(tmp_path, TWO, SHIFT, keys='compensated_by_controller = "all"', tables=TRUE_ZERO)
    with pytest.raises(ConfigError, match="all"):
        corrected(path, b"G0 X0. Y100. Z0.\n")


@pytest.mark.parametrize(
    "body", [b"T7 M6\nG0 X0. Y0. Z0.\n", b"G55\nG0 X0. Y0. Z0.\n", b"G43 H7\nG0 X0. Y0. Z0.\n"]
)
def test_what_the_files_do_not_define_is_refused_with_its_line(square: Path, body: bytes) -> None:
    assert refused_line(square, body) in (2, 3)


def test_a_touch_off_value_is_no_length(tmp_path: Path) -> None:
    path = machine(tmp_path, SQUARE, tables=TRUE_ZERO + "[tools.1]\nZ_mm = -80.0\n")
    with pytest.raises(OlpError, match="gauge_to_tip_mm"):
        corrected(path, b"T1 M6\nG0 X0. Y0. Z0.\n")


def test_simulate_shows_the_errors_that_correct_removes(tmp_path: Path) -> None:
    path = machine(tmp_path, SQUARE, tables=TRUE_ZERO)
    body = HEAD + b"G0 X0. Y0. Z0.\nG1 Y100. F100\n"
    raw = olp.simulate(body, path, step_mm=10.0)
    assert raw.frame == "G54"
    assert raw.points_mm[-1] == pytest.approx((-0.01, 100.0, 0.0), abs=1e-9)
    clean = olp.simulate(olp.correct(body, path).data, path, step_mm=10.0)
    assert np.abs(clean.points_mm[:, 0]).max() <= 0.5e-3
    assert clean.points_mm[-1] == pytest.approx((0.0, 100.0, 0.0), abs=1e-6)


# -- order of words -----------------------------------------------------------------------------------


@pytest.mark.parametrize("first", ("I30. X60. Y0. G2 F100", "X60. I30. G2 F100 Y0.", "Y0. G2 X60. F100 I30."))
def test_a_word_that_is_the_first_of_the_program_is_corrected_too(tmp_path: Path, first: str) -> None:
    """X and Y are 1 mm too long in 1000 mm, so X60 becomes X59.94, and the centre of 30 mm 29.97 mm."""
    rows = "-1000,-1000\n2000,2000\n"
    curve = {"x.csv": f"X_mm,EXX_um\n{rows}", "y.csv": f"Y_mm,EYY_um\n{rows}"}
    start = "start_mm = { X = 0.0, Y = 0.0, Z = 0.0 }\n"
    path = machine(tmp_path, CURVE_X + CURVE_X.replace("x.csv", "y.csv"), curve, tables=TRUE_ZERO, job=start)
    text = unstamped(olp.correct((first + "\nM2\n").encode(), path, path.with_name("job.toml")).data)
    assert words(text, "X")[-1] == pytest.approx(59.94, abs=0.002)
    assert words(text, "I")[0] == pytest.approx(29.97, abs=0.002)


def test_the_level_of_a_hole_that_is_reached_from_below_leads_upward(tmp_path: Path) -> None:
    """6 um of backlash: up to R with half of it above, down to the bottom with half of it below."""
    path = machine(tmp_path, "[backlash]\nZ_um = 6.0\n", tables=TRUE_ZERO)
    text = corrected(path, b"G0 X0. Y0. Z-1.\nZ0.5\nG99 G81 X10. Z-2. R1. F100\nG80\n")
    (block,) = (line for line in text.splitlines() if b"G81" in line)
    assert words(block, "R") == [1.003]
    assert words(block, "Z") == [-2.003]
