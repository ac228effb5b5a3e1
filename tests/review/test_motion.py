"""Times of samples are those of the motion, and the table of it keeps every peak."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cases.fast import left_to_a_campaign
from judge.machines import zero_machine

import olp
from olp.core.toolpath import Flag
from olp.review import motion as motions
from olp.review.job import Review
from olp.review.motion import table

ROOT = Path(__file__).resolve().parents[2]
NASTY = ROOT / "programs" / "nasty"
#: Motions that take long to plan.
LONG = ("cycles", "g91-steps", "helix-turns", "work-offsets")
PROGRAMS = ["modal", "full-circle", "g64", "g91-steps", "work-offsets", "cycles", "helix-turns", "g53-g28"]
#: what a motion may leave the programmed path by where the program names no path tolerance
BLEND_MM = 0.01


@cache
def viewed(name: str) -> tuple[Review, olp.Retiming]:
    result = olp.correct(NASTY / f"{name}.ngc", NASTY / "machine.toml")
    timing = olp.retime(result.data, NASTY / "machine.toml")
    return olp.view(NASTY / f"{name}.ngc", NASTY / "machine.toml", correction=result), timing


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(PROGRAMS, LONG))
def test_at_its_time_the_motion_is_at_the_sample(name: str) -> None:
    """The re-timed motion, asked for its position at the time of a sample, is where the corrected program has
    the sample: but for rounded corners, and for what a stretch takes between two looks at it."""
    review, timing = viewed(name)
    scene = review.scene
    assert scene.duration_s == timing.duration_s
    assert (np.diff(scene.time_s) >= 0.0).all()
    assert scene.time_s[0] >= 0.0 and scene.time_s[-1] <= timing.duration_s + 1e-9
    # a hole may take another number of pecks than before
    path = scene.nominal.toolpath
    reached = (path.flag[scene.samples.move] & np.uint8(Flag.CYCLE)) != 0
    begin = 0.0
    for trajectory in timing.trajectories:
        mine = (scene.time_s >= begin) & (scene.time_s <= begin + trajectory.duration_s) & ~reached
        position, velocity = trajectory.at(scene.time_s[mine] - begin)[:2]
        away = np.linalg.norm(position - scene.samples.command_mm[mine], axis=1)
        # a look every quarter of a piece: late or early by less than a millisecond
        assert np.quantile(away, 0.9) <= 3 * BLEND_MM + 1e-3 * np.linalg.norm(velocity, axis=1).max()
        reached |= mine
        begin += trajectory.duration_s
    assert reached.all()


def test_a_straight_move_takes_its_own_time(tmp_path: Path) -> None:
    """100 mm at 10 mm/s and exact stops: the middle is passed in the middle of the time, and a dwell is spent
    at its end."""
    machine = zero_machine(tmp_path / "m")
    text = b"G21 G90 G54 G61.1\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nG4 P2\nG1 X0\nM2\n"
    scene = olp.view(text, machine, step_mm=1.0).scene
    x, time = scene.position_mm[:, 0], scene.time_s
    line = scene.nominal.toolpath.line[scene.samples.move]
    there, back = np.flatnonzero(line == 4), np.flatnonzero(line == 6)
    assert (x[there[-2:]] == 100.0).all()
    begin, arrival, leaving, end = (float(time[k]) for k in (there[0] - 1, there[-2], there[-1], back[-1]))
    assert leaving - arrival == pytest.approx(2.0, abs=1e-6)
    assert end - leaving == pytest.approx(arrival - begin, abs=1e-6)
    assert float(np.interp(50.0, x[there[:-1]], time[there[:-1]])) == pytest.approx(
        (begin + arrival) / 2, abs=1e-3
    )
    assert float(np.interp(-50.0, -x[back], time[back])) == pytest.approx((leaving + end) / 2, abs=1e-3)
    assert scene.samples.joined[there].all()


def test_without_a_motion_the_feed_tells_the_time(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    text = b"G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100 F600\nX0 F1200\nM2\n"
    scene = olp.view(text, machine, time=False).scene
    assert scene.motion is None
    ends = np.flatnonzero(scene.samples.share == 1.0)
    assert np.diff(scene.time_s[ends]).tolist() == pytest.approx([10.0, 5.0])
    assert scene.duration_s == pytest.approx(15.0)


def test_a_program_without_feed_has_times_all_the_same(tmp_path: Path) -> None:
    machine = zero_machine(tmp_path / "m")
    scene = olp.view(b"G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100\nM2\n", machine, time=False).scene
    assert scene.duration_s == pytest.approx(0.2)
    with pytest.raises(olp.ProgramError, match="feed"):
        olp.view(b"G21 G90 G54\nG43 H1\nG0 X0 Y0 Z20\nG1 X100\nM2\n", machine)


@pytest.mark.slow
@pytest.mark.parametrize("name", left_to_a_campaign(PROGRAMS, LONG))
def test_a_thinned_table_keeps_the_peaks(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    _, timing = viewed(name)
    monkeypatch.setattr(motions, "MOST_ROWS", 10**9)
    whole = table(timing.trajectories, timing.routes)
    monkeypatch.setattr(motions, "MOST_ROWS", 400)
    few = table(timing.trajectories, timing.routes)
    assert len(few.time_s) <= 1000 * max(len(timing.trajectories), 1)
    assert len(few.time_s) < len(whole.time_s) or len(whole.time_s) <= 1000
    for column in ("velocity", "acceleration", "jerk", "speed_mm_s"):
        some, all_of = getattr(few, column), getattr(whole, column)
        np.testing.assert_array_equal(some.max(axis=0), all_of.max(axis=0))
        np.testing.assert_array_equal(some.min(axis=0), all_of.min(axis=0))
    assert (np.diff(few.time_s) >= 0.0).all()
    assert few.time_s[-1] == pytest.approx(timing.duration_s)


@pytest.mark.slow
def test_the_table_shows_no_more_than_the_audit_found() -> None:
    review, timing = viewed("modal")
    shown = review.scene.motion
    assert shown is not None
    audit, limits = timing.trajectory.audit, timing.trajectory.limits
    for name, values, limit in (
        ("velocity", shown.velocity, limits.velocity),
        ("acceleration", shown.acceleration, limits.acceleration),
        ("jerk", shown.jerk, limits.jerk),
    ):
        share = np.abs(values).max(axis=0) / limit
        assert (share <= np.array(getattr(audit, name)) * (1 + 1e-6) + 1e-9).all()
        assert share.max() > 0.5


def test_nothing_moves() -> None:
    shown = table((), ())
    assert len(shown.time_s) == 0
