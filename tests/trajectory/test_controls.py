"""Times of controls by their published planners: worked by hand, and laws that hold for any program."""

from __future__ import annotations

import numpy as np
import pytest
from program.feeds.test_timing import reading

from olp.core.errors import UsageError
from olp.trajectory.controls.base import AxisSpeeds, Control, move_seconds
from olp.trajectory.controls.learning import learned
from olp.trajectory.controls.moves import Moves, moves
from olp.trajectory.controls.planner import Pieces, seconds, speeds
from olp.trajectory.controls.registry import CONTROLS, control_named

LIMITS = AxisSpeeds(np.full(3, 100.0), np.full(3, 500.0), np.full(3, 20000.0))
CORNER = ["G64 P0.01", "G1 X40 F3000", "G1 Y40"]


def stretch(rows: list[str], control: Control) -> Moves:
    program = reading("\n".join(["G21 G90 G17", *rows, "M2", ""]), "linuxcnc")
    chord = control.values({})[control.chord_mm] if control.chord_mm else None
    said = None if control.said is None else control.said(program)
    (part,) = moves(program, blend_mm=np.inf, chord_mm=chord, said=said)
    return part


def total(part: Moves, control: Control, limits: AxisSpeeds = LIMITS, **stated: float) -> float:
    return float(move_seconds(control, part, limits, control.values(stated)).sum())


def test_a_corner_on_grbl_by_hand() -> None:
    """Two moves of 40 mm at 50 mm/s, 500 mm/s2 along each axis; across the corner it is sqrt(2) of that. Half
    of the right angle between them has a sine of sqrt(1/2)."""
    sine = np.sqrt(0.5)
    corner = np.sqrt(500.0 * np.sqrt(2.0) * 0.01 * sine / (1.0 - sine))
    by_hand = 0.0
    for begin, end in ((0.0, corner), (corner, 0.0)):
        ramps = (2 * 50.0**2 - begin**2 - end**2) / (2 * 500.0)
        by_hand += (2 * 50.0 - begin - end) / 500.0 + (40.0 - ramps) / 50.0
    assert corner == pytest.approx(4.1317, abs=1e-4)
    assert total(stretch(CORNER, CONTROLS["grbl"]), CONTROLS["grbl"]) == pytest.approx(by_hand, rel=1e-12)


def test_a_corner_on_linuxcnc_by_hand() -> None:
    """The blend arc passes the corner at 10 um: 10 um / (1 - sine) to its centre, and the radius is the sine
    of that. sqrt(3/4) of the acceleration is left for the circle. The last move has half of it."""
    sine = np.sqrt(0.5)
    radius = 0.01 / (1.0 - sine) * sine
    corner = np.sqrt(500.0 * np.sqrt(0.75) * radius)
    by_hand = radius * np.pi / 2 / corner + 1e-3
    for begin, end, change in ((0.0, corner, 500.0), (corner, 0.0, 250.0)):
        up, down = ((50.0**2 - v * v) / (2 * change) for v in (begin, end))
        by_hand += (2 * 50.0 - begin - end) / change + (40.0 - radius - up - down) / 50.0
    control = CONTROLS["linuxcnc"]
    assert total(stretch(CORNER, control), control) == pytest.approx(by_hand, rel=1e-6)


def test_linuxcnc_drives_nearly_straight_moves_as_one() -> None:
    """Within Q of G64, or P without it, at one feed. A step of 1 um takes no time then."""
    control = CONTROLS["linuxcnc"]
    ends = ["G1 X10 F3000", "G1 X10 Y0.001", "G1 X30 Y0.001", "G1 X40 Y0"]
    line = total(stretch(["G64 P0.01", "G1 X40 F3000"], control), control)
    part = stretch(["G64 P0.01", *ends], control)
    each = move_seconds(control, part, LIMITS, control.values({}))
    assert each.sum() == pytest.approx(line, rel=1e-9) and not each[:-1].any()
    for mode in ("G64 P0.01 Q0", "G64 P0.01 Q0.0005", "G64"):
        assert total(stretch([mode, *ends], control), control) > 1.02 * line
    slower = stretch(["G64 P0.01", *ends[:2], "F2900", *ends[2:]], control)
    assert (move_seconds(control, slower, LIMITS, control.values({})) > 0.0).tolist() == [
        False,
        True,
        False,
        True,
    ]


def test_grbl_can_stop_within_its_buffer() -> None:
    """2000 collinear moves of 0.1 mm at 100 mm/s: 15 of them are 1.5 mm, within which it has to be able to
    stop."""
    rows = [f"G1 X{0.1 * k:.1f} F6000" for k in range(1, 2001)]
    top = np.sqrt(2.0 * 500.0 * 1.5)
    part = stretch(rows, CONTROLS["grbl"])
    assert total(part, CONTROLS["grbl"]) == pytest.approx(200.0 / top + top / 500.0, rel=0.01)


def test_speeds_are_the_largest_that_can_be_driven() -> None:
    """Beside one pass back and one pass ahead, written as loops."""
    rng = np.random.default_rng(5)
    count, ahead = 200, 20
    pieces = Pieces(
        rng.uniform(0.01, 2.0, count), rng.uniform(1.0, 60.0, count), rng.uniform(100.0, 900.0, count),
        np.arange(count), np.zeros(count, bool), rng.choice([0.0, 5.0, 20.0, np.inf], count - 1),
        np.zeros(count - 1),
    )  # fmt: skip
    gain = 2 * pieces.acceleration_mm_s2 * pieces.length_mm
    velocity = np.minimum(pieces.velocity_mm_s[:-1], pieces.velocity_mm_s[1:])
    limit = [0.0, *np.minimum(velocity, pieces.joint_mm_s), 0.0]
    limit = [min(v, np.sqrt(gain[k : k + ahead].sum())) for k, v in enumerate(limit)]
    for k in range(count - 1, -1, -1):
        limit[k] = min(limit[k], np.sqrt(limit[k + 1] ** 2 + gain[k]))
    for k in range(count):
        limit[k + 1] = min(limit[k + 1], np.sqrt(limit[k] ** 2 + gain[k]))
    assert speeds(pieces, ahead) == pytest.approx(np.array(limit), abs=1e-6)
    driven = seconds(pieces, speeds(pieces, ahead), 0.0, 0.0)
    assert (driven * pieces.velocity_mm_s >= pieces.length_mm * (1 - 1e-9)).all()


def log_of(part: Moves, control: Control, **stated: float) -> tuple[np.ndarray, np.ndarray]:
    """Positions along a path of lines from its speeds at the ends of pieces, every 1 ms."""
    pieces = control.pieces(part, LIMITS, control.values(stated))
    ends = speeds(pieces, control.ahead)
    time, away, rows = 0.0, np.zeros(3), [np.zeros((1, 4))]
    for k in range(len(pieces)):
        a, v0, v1 = pieces.acceleration_mm_s2[k], ends[k], ends[k + 1]
        top = min(pieces.velocity_mm_s[k], np.sqrt(a * pieces.length_mm[k] + 0.5 * (v0**2 + v1**2)))
        first, last = (top - v0) / a, (top - v1) / a
        hold = (pieces.length_mm[k] - (2 * top**2 - v0**2 - v1**2) / (2 * a)) / top
        t = np.linspace(0.0, first + hold + last, 4000)[1:]
        speed = np.minimum(np.minimum(v0 + a * t, top), v1 + a * (t[-1] - t))
        along = np.cumsum(speed) * (t[1] - t[0])
        along *= pieces.length_mm[k] / along[-1]
        rows.append(np.column_stack((time + t, away + along[:, None] * part.begin[k])))
        time, away = time + t[-1], away + pieces.length_mm[k] * part.begin[k]
    dense = np.concatenate(rows)
    even = np.arange(0.0, time + 1e-3, 1e-3)
    return even, np.column_stack([np.interp(even, dense[:, 0], dense[:, 1 + i]) for i in range(3)])


def test_limits_and_junction_deviation_are_learned() -> None:
    """From a run with 0.05 mm and other limits than the machine file states."""
    control = CONTROLS["grbl"]
    zigzag = [f"G1 X{60 * (k % 2)} Y{3 * k} F9000" for k in range(1, 25)]
    part = stretch(["G0 X90", "G0 X0", "G0 Y90", "G0 Y0", *zigzag], control)
    time_s, point_mm = log_of(part, control, junction_deviation_mm=0.05)
    stated = AxisSpeeds(np.full(3, 250.0), np.full(3, 200.0), np.full(3, 1e4))
    log = learned(control, (part,), stated, control.values({}), time_s, point_mm)
    assert log.limits.velocity == pytest.approx([100.0, 100.0, 250.0], rel=0.01)
    assert log.limits.acceleration == pytest.approx([500.0, 500.0, 200.0], rel=0.02)
    assert log.values["junction_deviation_mm"] == pytest.approx(0.05, rel=0.15)


def test_what_is_not_known_is_refused() -> None:
    with pytest.raises(UsageError, match="expected one of linuxcnc, grbl, sinumerik"):
        control_named("fanuk")
    with pytest.raises(UsageError, match="no setting 'jerk'"):
        CONTROLS["grbl"].values({"jerk": 1.0})
    with pytest.raises(UsageError, match="above 0"):
        CONTROLS["grbl"].values({"arc_tolerance_mm": 0.0})
    part = stretch(CORNER, CONTROLS["grbl"])
    for time_s, point_mm in ((np.arange(50.0), np.zeros((50, 3))), (np.arange(50.0) ** 2, np.ones((50, 3)))):
        with pytest.raises(UsageError, match="log"):
            learned(CONTROLS["grbl"], (part,), LIMITS, CONTROLS["grbl"].values({}), time_s, point_mm)
