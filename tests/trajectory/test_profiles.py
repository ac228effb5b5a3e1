"""What holds of the profiles of all controls, on programs of their own languages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from program.feeds.test_timing import reading

from olp.trajectory.controls.base import AxisSpeeds, Control, move_seconds
from olp.trajectory.controls.bells import timeline
from olp.trajectory.controls.learning import learned
from olp.trajectory.controls.moves import Moves, moves
from olp.trajectory.controls.registry import CONTROLS
from olp.trajectory.critical import Timeline

LIMITS = AxisSpeeds(np.full(3, 200.0), np.full(3, 2000.0), np.full(3, 40000.0))
BELLS = [key for key, control in CONTROLS.items() if control.bells]
Points = np.ndarray


def iso(points: Points) -> list[str]:
    return ["G1 F6000.", *(f"X{x:.3f} Y{y:.3f} Z{z:.3f}" for x, y, z in points)]


def plain(points: Points) -> list[str]:
    return [f"L X{x:+.3f} Y{y:+.3f} Z{z:+.3f} R0 F6000" for x, y, z in points]


#: head of a program in the language of the control, its moves, and its end; {} is the tolerance in mm
LANGUAGES: dict[str, tuple[str, Callable[[Points], list[str]], str]] = {
    "linuxcnc": ("G21 G90 G17\nG64 P{} Q0", iso, "M2"),
    "grbl": ("G21 G90 G17", iso, "M2"),
    "sinumerik": ("G71 G90 G17\nG642\nCTOL={}", iso, "M30"),
    "heidenhain": (
        "BEGIN PGM P MM\nTOOL CALL 1 Z S1000\nCYCL DEF 32.0 TOLERANCE\nCYCL DEF 32.1 T{}\n"
        "L X+0 Y+0 Z+0 R0 FMAX",
        plain, "END PGM P MM",
    ),
    "fanuc": ("G21 G90 G17\nG05.1 Q1", iso, "M30"),
}  # fmt: skip


def parts_of(key: str, rows: list[str], **options: float) -> tuple[Moves, ...]:
    control = CONTROLS[key]
    program = reading("\n".join([*rows, ""]), key)
    said = None if control.said is None else control.said(program)
    chord = control.values({})[control.chord_mm] if control.chord_mm else None
    return moves(program, blend_mm=0.01, chord_mm=chord, said=said, **options)


def part_of(key: str, points: Points, tolerance: float = 0.02, more: str = "") -> Moves:
    head, rows, end = LANGUAGES[key]
    part = parts_of(key, [*head.format(tolerance).split("\n"), *more.split("\n"), *rows(points), end])[-1]
    assert len(part) >= len(points) - 1
    return part


def total(part: Moves, control: Control, limits: AxisSpeeds = LIMITS, **stated: float) -> float:
    return float(move_seconds(control, part, limits, control.values(stated)).sum())


def walk(seed: int) -> Points:
    """Long moves and short ones, corners, and a dense arc with the noise of three decimals."""
    rng = np.random.default_rng(seed)
    turn = np.linspace(0.0, 4.0, 60)[:, None]
    arc = np.hstack((20.0 * np.sin(turn), 20.0 - 20.0 * np.cos(turn), 0.0 * turn))
    corners = np.cumsum(rng.uniform(-1.0, 1.0, (25, 3)) * 10.0 ** rng.uniform(-0.5, 1.4, (25, 1)), axis=0)
    return np.vstack((corners, corners[-1] + arc[1:], corners[-1] + arc[-1] + corners))


@pytest.mark.slow
@pytest.mark.parametrize("key", CONTROLS)
def test_less_is_never_faster(key: str) -> None:
    """Lower limits, tighter tolerances and corners, and more stops."""
    control, part = CONTROLS[key], part_of(key, walk(1))
    base = total(part, control)
    for share in (0.97, 0.7, 0.3):
        lower = [replace(LIMITS, velocity=share * LIMITS.velocity)]
        lower += [] if control.bells else [replace(LIMITS, acceleration=share * LIMITS.acceleration)]
        lower += [replace(LIMITS, jerk=share * LIMITS.jerk)] if control.bells else []
        assert all(total(part, control, limits) >= base * (1.0 - 1e-9) for limits in lower)
        # where a joint binds depends on the acceleration, so bells are not quite monotone in it
        less = total(part, control, replace(LIMITS, acceleration=share * LIMITS.acceleration))
        assert less >= base * (1.0 - 2e-3)
        if control.corners:
            own = share * control.values({})[control.corners]
            assert total(part, control, **{control.corners: own}) >= base * (1.0 - 1e-9)
        if "{}" in LANGUAGES[key][0]:
            assert total(part_of(key, walk(1), 0.02 * share), control) >= base * (1.0 - 1e-9)
    for joint in range(0, len(part.rest), 20):
        rest = part.rest.copy()
        rest[joint] = True
        assert total(replace(part, rest=rest), control) >= base * (1.0 - 1e-9)
    assert total(replace(part, rest=np.ones(len(part.rest), bool)), control) > 1.1 * base


def run_of(part: Moves, control: Control, limits: AxisSpeeds, **stated: float) -> tuple[Points, Points]:
    """A log of a path of lines every 2 ms, as the profile drives it."""
    pieces = control.pieces(part, limits, control.values(stated))
    clock: Timeline = timeline(pieces, control.ahead)[2]
    time_s = np.arange(0.0, clock.start_s[-1], 2e-3)
    knot = np.concatenate(([0.0], np.cumsum(part.length_mm)))
    point = np.vstack((np.zeros(3), np.cumsum(part.length_mm[:, None] * part.begin, axis=0)))
    along = clock.arc_at(time_s)
    return time_s, np.column_stack([np.interp(along, knot, point[:, i]) for i in range(3)])


@pytest.mark.slow
@pytest.mark.parametrize("key", BELLS)
def test_the_limits_of_a_run_come_back(key: str) -> None:
    """From moves of single axes, and a staircase whose corners take their part of the time."""
    stairs = [(300 + 5 * ((k + 1) // 2), 300 + 5 * (k // 2), 100) for k in range(1, 80)]
    points = np.array([(300, 0, 0), (0, 0, 0), (300, 0, 0), (300, 300, 0), (300, 300, 100), *stairs], float)
    control, part = CONTROLS[key], part_of(key, points, 0.2)
    part = replace(part, feed_mm_s=np.full(len(part), 500.0))
    other = AxisSpeeds(np.full(3, 120.0), np.full(3, 900.0), np.full(3, 9000.0))
    law = 0.5 * control.values({})[control.corners]
    time_s, point_mm = run_of(part, control, other, **{control.corners: law})
    log = learned(control, (part,), LIMITS, control.values({}), time_s, point_mm)
    assert log.shown.all()
    assert log.limits.velocity == pytest.approx(other.velocity, rel=0.01)
    assert log.limits.acceleration == pytest.approx(other.acceleration, rel=0.01)
    assert log.limits.jerk == pytest.approx(other.jerk, rel=0.01)
    assert log.values[control.corners] == pytest.approx(law, rel=0.02)


def corner(turn_deg: float = 90.0) -> Points:
    turn = np.deg2rad(turn_deg)
    return np.array([(0, 0, 0), (50, 0, 0), (50 + 50 * np.cos(turn), 50 * np.sin(turn), 0)])


def test_modes_of_sinumerik() -> None:
    """Exact stop, G64, a distance and tolerances, at one corner."""
    control = CONTROLS["sinumerik"]
    stop, on, near, wide = (
        total(part_of("sinumerik", corner(), 0.001, more), control)
        for more in ("G60", "G64", "CTOL=0.05", "G641 ADIS=2")
    )
    assert stop > on > near > wide
    assert total(part_of("sinumerik", corner(), 0.001, "CYCLE832(0.05,_FINISH,1)"), control) <= near
    soft, brisk = (total(part_of("sinumerik", corner(), 0.05, more), control) for more in ("SOFT", "BRISK"))
    assert soft > brisk
    inch = part_of("sinumerik", corner(), 0.001, "G70\nCTOL=0.002\nG71")
    assert inch.said["tolerance_mm"] == pytest.approx(0.0508)
    turn = np.linspace(0.0, 3.0, 40)
    dense = np.column_stack((30.0 * np.sin(turn), 30.0 - 30.0 * np.cos(turn), 0.0 * turn))[1:]
    fitted, plain_way = (
        total(part_of("sinumerik", dense, 0.03, way), control, overload_factor=0.1)
        for way in ("COMPCAD", "COMPOF")
    )
    assert fitted < 0.95 * plain_way


def test_ai_contour_control_of_fanuc() -> None:
    """A right angle is driven so that no axis changes its speed by more than No. 1783."""
    control = CONTROLS["fanuc"]
    part = part_of("fanuc", corner())
    joint = control.pieces(part, LIMITS, control.values({})).joint_mm_s
    assert joint[-1] == pytest.approx(500.0 / 60.0)
    off = part_of("fanuc", corner(), more="G64 G5.1 Q0 (G05.1 Q1)")
    assert not off.said["on"].any() and total(off, control) < total(part, control)
    on = part_of("fanuc", corner(), more="G05.1 Q0\nG90 G64 G08 P1")
    assert on.said["on"].all()


def test_cycle_32_ends_without_a_tolerance() -> None:
    """And the unit is that of the program; comments say nothing."""
    rows = ["BEGIN PGM P INCH", "TOOL CALL 1 Z S1000", "L X+0 Y+0 Z+0 R0 FMAX", "L X+1 F80",
            "CYCL DEF 32.0 TOLERANCE", "CYCL DEF 32.1 T+0.002 ; CYCL DEF 32.1 T9",
            "CYCL DEF 32.2 HSC-MODE:1 TA0.5",
            "L Y+1", "CYCL DEF 32.0 TOLERANCE", "CYCL DEF 32.1", "L X+2", "END PGM P INCH"]  # fmt: skip
    program = reading("\n".join([*rows, ""]), "heidenhain")
    said = CONTROLS["heidenhain"].said
    assert said is not None
    found = said(program)
    assert found.columns(np.array([4, 8, 11]))["tolerance_mm"] == pytest.approx(
        [np.nan, 0.0508, np.nan], nan_ok=True
    )
    assert found.beside == ((7, "HSC-MODE:1"),)


def test_words_beside_the_time_are_told() -> None:
    rows = ["G71 G90 G17", "DYNFINISH", 'MSG("G60 DRIVE")', "ACCLIM[X]=50 ; BRISK", "CYCLE832(R1,1)", "G644"]
    program = reading("\n".join([*rows, "G1 X1 F100", "M30", ""]), "sinumerik")
    said = CONTROLS["sinumerik"].said
    assert said is not None
    assert [word for _, word in said(program).beside] == ["DYNFINISH", "ACCLIM", "CYCLE832(R1)", "G644"]
