"""Backlash: the play along a program, against one step at a time; and curves with a direction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import UsageError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.reversal import play_after, play_interval, play_states, plays, taken_up

BOX = np.array([[0.0, 100.0]] * 3)
TOOL = np.zeros(3)


def one_by_one(command: np.ndarray, width: np.ndarray, start: float) -> tuple[np.ndarray, np.ndarray]:
    """Least and greatest play of one axis, by the definition e <- clip(e - dc, -b/2, +b/2) on both ends."""
    low = np.full(len(command), start if np.isfinite(start) else -1.0)
    high = np.full(len(command), start if np.isfinite(start) else 1.0)
    if np.isnan(command[0]):
        low[0], high[0] = -1.0, 1.0
    for k in range(1, len(command)):
        move, b, before = command[k] - command[k - 1], width[k], width[k - 1]
        for play, unknown in ((low, -1.0), (high, 1.0)):
            if np.isnan(move):
                play[k] = unknown
            elif b > 0.0:
                e = -0.5 * play[k - 1] * (before if before > 0.0 else b)
                play[k] = -2.0 * np.clip(e - move, -0.5 * b, 0.5 * b) / b
            else:
                play[k] = np.sign(move) if move else play[k - 1]
    return low, high


@pytest.mark.slow
@settings(max_examples=150, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(1, 200),
    kind=st.sampled_from(["constant", "varying", "signed"]),
    step=st.sampled_from([0.1, 1.0, 20.0]),
    start=st.sampled_from([np.nan, 0.0, 0.4, -1.0]),
    holes=st.booleans(),
)
def test_the_scan_is_the_step_by_step_play(
    seed: int, n: int, kind: str, step: float, start: float, holes: bool
) -> None:
    rng = np.random.default_rng(seed)
    motion = rng.normal(size=(n, 3)) * step * rng.integers(0, 2, (n, 3))
    command = np.cumsum(motion, axis=0)
    width = {
        "constant": np.tile(np.array([4.0, 0.0, -3.0]), (n, 1)),
        "varying": rng.uniform(1.0, 6.0, (n, 3)),
        "signed": rng.normal(size=(n, 3)) * 3.0,
    }[kind]
    if holes:
        command[rng.random((n, 3)) < 0.05] = np.nan
    low, high = play_interval(command, width, np.full(3, start))
    for j in range(3):
        expected = one_by_one(command[:, j], width[:, j], start)
        np.testing.assert_allclose((low[:, j], high[:, j]), expected, atol=1e-9)


def test_unknown_until_taken_up() -> None:
    command = np.array([[0.0] * 3, [2.0] * 3, [4.0] * 3, [3.0] * 3])
    low, high = play_interval(command, np.array([6.0, 3.0, 0.0]))
    third = 1.0 / 3.0
    expected_low = [[-1, -1, -1], [-third, third, 1], [third, 1, 1], [0, third, -1]]
    expected_high = [[1, 1, 1], [1, 1, 1], [1, 1, 1], [2 * third, third, -1]]
    np.testing.assert_allclose((low, high), (expected_low, expected_high), atol=1e-12)
    np.testing.assert_allclose(play_states(command, np.array([6.0, 3.0, 0.0])), 0.5 * (low + high))


def test_over_compensated_backlash_follows_the_sign_of_motion() -> None:
    command = np.array([[0.0] * 3, [0.001] * 3, [0.0005] * 3, [0.0005] * 3])
    width = np.full(3, -4e-3)
    model = build(Calibration("m", BOX, backlash_mm=tuple(width)), "FXYZ")
    error = model.error(command, TOOL, play_states(command, width))
    np.testing.assert_allclose(error[:, 0], [0.0, 2e-3, -2e-3, -2e-3])


@pytest.mark.parametrize("command", [np.zeros((0, 3)), np.full((3, 3), np.nan)])
def test_nothing_known_nothing_said(command: np.ndarray) -> None:
    assert not play_states(command, np.full(3, 4.0)).any()


def test_wrong_shapes_are_refused() -> None:
    command = np.zeros((4, 3))
    for bad in (
        lambda: play_states(command, np.zeros(4)),
        lambda: play_states(command, np.zeros(3), np.zeros(2)),
    ):
        with pytest.raises(UsageError):
            bad()


def bidirectional() -> Calibration:
    x = np.array([0.0, 50.0, 100.0])
    forward = {
        "EXX": np.array([0.0, 2e-3, 3e-3]),
        "EYX": np.array([1e-3, 0.0, 1e-3]),
        "EBX": np.array([0.0, 1e-5, 2e-5]),
    }
    backward = {
        "EXX": np.array([4e-3, 5e-3, 9e-3]),
        "EYX": np.array([2e-3, 0.0, 1e-3]),
        "EBX": np.array([0.0, 3e-5, 2e-5]),
    }
    return Calibration(
        "m", BOX, curves=(Curve("X", x, forward=forward, backward=backward, interpolation="linear"),)
    )


@pytest.mark.parametrize("chain", ["FXYZ", "XFYZ"])
def test_direction_columns_give_both_directions_and_the_mean(chain: str) -> None:
    calibration = bidirectional()
    curve = calibration.curves[0]
    points = np.array([[0.0, 0.0, 0.0], [50.0, 0.0, 0.0], [100.0, 0.0, 0.0]])
    model = build(calibration, chain)
    for direction, columns in ((1.0, curve.forward), (-1.0, curve.backward)):
        error = model.error(points, TOOL, np.full((3, 3), direction))
        np.testing.assert_allclose(
            error[:, :2], np.stack([columns["EXX"], columns["EYX"]], axis=1), atol=1e-15
        )
        np.testing.assert_allclose(
            model.rotation(points, np.full((3, 3), direction))[:, 1], columns["EBX"], atol=1e-18
        )
    mean = 0.5 * (curve.forward["EXX"] + curve.backward["EXX"])
    np.testing.assert_allclose(model.error(points, TOOL)[:, 0], mean, atol=1e-15)
    np.testing.assert_allclose(
        model.backlash_at(points), [[4e-3, 0, 0], [3e-3, 0, 0], [6e-3, 0, 0]], atol=1e-15
    )
    parts = dict(model.contributions(points, np.array([0.0, 0.0, -100.0]), np.ones((3, 3))))
    # The lever arm of the difference in pitch belongs to the backlash too.
    expected = [-2e-3, -1.5e-3 + 1e-5 * 100.0, -3e-3]
    np.testing.assert_allclose(parts["backlash X"][:, 0], expected, atol=1e-15)


def test_backlash_is_unknown_where_the_position_is() -> None:
    model = build(bidirectional(), "FXYZ")
    lost = model.backlash_at(np.array([[np.nan, 1.0, 1.0], [1.0, np.nan, np.nan]]))
    np.testing.assert_array_equal(np.isnan(lost), [[True, False, False], [False] * 3])


def test_play_after_motions_in_one_direction() -> None:
    """Backlash of 4 mm: a motion of 1 mm takes up a half of what play goes from -1 to 1."""
    play = np.array([[-1.0, 0.0, 0.5], [1.0, 0.25, -0.5], [0.3, 0.3, 0.3], [0.3, -0.3, 0.3]])
    moved = np.array([[1.0, 1.0, 2.0], [-9.0, -0.5, 0.0], [2.0, -1e-9, 0.0], [1.0, -1.0, 0.0]])
    width = np.array([[4.0] * 3, [4.0] * 3, [0.0] * 3, [-4.0, np.nan, np.nan]])
    expected = [[-0.5, 0.5, 1.0], [-1.0, 0.0, -0.5], [1.0, -1.0, 0.3], [1.0, -1.0, 0.3]]
    np.testing.assert_allclose(play_after(play, moved, width), expected)
    # the same in um
    np.testing.assert_allclose(play_after(play, 1e-3 * moved, 1e-3 * width), expected)
    # without backlash it is the sign of the last motion
    signs = [[1.0, 1.0, 1.0], [-1.0, -1.0, -0.5], [1.0, -1.0, 0.3], [1.0, -1.0, 0.3]]
    np.testing.assert_allclose(play_after(play, moved, None), signs)


def test_plays_of_a_model_take_its_backlash_by_position() -> None:
    """A backlash of 4 um at X 0, 3 um at 50, 6 um at 100: moves of 1.5 um take up a part of it."""
    model = build(bidirectional(), "FXYZ")
    commands = np.zeros((4, 3))
    commands[:, 0] = 0.0, 50.0, 50.0015, 50.0
    states = plays(model, commands)
    assert states is not None
    np.testing.assert_allclose(states[:, 0], [0.0, 1.0, 1.0, 0.0], atol=1e-3)
    np.testing.assert_array_equal(states, play_states(commands, model.backlash_at(commands)))
    assert plays(build(Calibration("m", BOX), "FXYZ"), commands) is None


def test_shapes_that_are_refused_are_named() -> None:
    command = np.zeros((4, 3))
    for call, sentence in (
        (
            lambda: play_interval(command, np.zeros(4)),
            r"backlash_mm has shape \(4,\); expected \(3,\) or \(4, 3\)",
        ),
        (lambda: play_interval(command, np.zeros((3, 3))), r"backlash_mm has shape \(3, 3\)"),
        (
            lambda: play_interval(command, np.zeros(3), np.zeros(2)),
            r"start has shape \(2,\); expected \(3,\)",
        ),
        (lambda: play_interval(command, np.zeros(3), np.zeros((4, 3))), r"start has shape \(4, 3\)"),
        (lambda: play_interval(np.zeros(3), np.zeros(3)), "axis_mm has shape"),
    ):
        with pytest.raises(UsageError, match=sentence):
            call()


def test_what_is_given_is_not_changed() -> None:
    """Backlash per command with unknown rows counts as none there."""
    command = np.cumsum(np.ones((5, 3)), axis=0)
    width = np.full((5, 3), 4.0)
    width[2, 1] = np.nan
    before = width.copy()
    low, high = play_interval(command, width, np.array([-1.0, -1.0, np.nan]))
    np.testing.assert_array_equal(width, before)
    np.testing.assert_allclose(low[:, 0], [-1.0, -0.5, 0.0, 0.5, 1.0])
    np.testing.assert_allclose(low[:, 1], [-1.0, -0.5, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(low[:, 2], [-1.0, -0.5, 0.0, 0.5, 1.0])
    np.testing.assert_array_equal(high[:, :2], low[:, :2])
    np.testing.assert_array_equal(high[:, 2], 1.0)


@pytest.mark.parametrize("steps", [1, 2, 3, 4, 5, 8, 9, 31, 32, 33])
def test_a_long_run_of_short_moves_takes_up_the_backlash_bit_by_bit(steps: int) -> None:
    """So many moves of 2 / steps mm, of a backlash of 4 mm, then half as far back: all within reach."""
    forward = np.full(steps, 2.0 / steps)
    command = np.cumsum(np.concatenate([[7.0], forward, -0.5 * forward]))
    positions = np.stack([command] * 3, axis=1)
    low, high = play_interval(positions, np.array([4.0, 4.0, 4.0]), np.array([-1.0, 0.0, np.nan]))
    moved = command - 7.0
    np.testing.assert_allclose(low[:, 0], -1.0 + 0.5 * moved, atol=1e-12)
    np.testing.assert_allclose(high[:, 1], np.clip(0.5 * moved, -1.0, 1.0), atol=1e-12)
    # unknown: between what it would be from either end
    up = np.arange(2 * steps + 1) <= steps
    np.testing.assert_allclose(low[:, 2], -1.0 + 0.5 * moved, atol=1e-12)
    np.testing.assert_allclose(high[:, 2], np.where(up, 1.0, 1.0 - 0.5 * (2.0 - moved)), atol=1e-12)


def test_the_start_holds_until_the_position_is_lost() -> None:
    nan = np.nan
    command = np.array([[0.0] * 3, [1.0] * 3, [nan, nan, 2.0], [3.0] * 3, [4.0, 13.0, 4.0]])
    low, high = play_interval(command, np.full(3, 4.0), np.array([0.0, 0.0, 0.25]))
    np.testing.assert_allclose(low[:, 0], [0.0, 0.5, -1.0, -1.0, -0.5])
    np.testing.assert_allclose(high[:, 0], [0.0, 0.5, 1.0, 1.0, 1.0])
    np.testing.assert_allclose((low[4, 1], high[4, 1]), (1.0, 1.0))
    np.testing.assert_allclose(low[:, 2], [0.25, 0.75, 1.0, 1.0, 1.0])
    # the last command alone is not known
    low, high = play_interval(command[:3], np.full(3, 4.0), np.zeros(3))
    np.testing.assert_array_equal((low[:, 0], high[:, 0]), ([0.0, 0.5, -1.0], [0.0, 0.5, 1.0]))
    # a first command that is not known has no start
    lost = np.array([[nan] * 3, [1.0] * 3, [2.0] * 3])
    low, high = play_interval(lost, np.full(3, 4.0), np.zeros(3))
    np.testing.assert_array_equal(low[:, 0], [-1.0, -1.0, -0.5])
    np.testing.assert_array_equal(high[:, 0], [1.0, 1.0, 1.0])


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(2, 60), cut=st.integers(1, 59), holes=st.booleans())
def test_the_interval_goes_on_from_any_command(seed: int, n: int, cut: int, holes: bool) -> None:
    rng = np.random.default_rng(seed)
    command = np.cumsum(rng.normal(size=(n, 3)) * rng.integers(0, 2, (n, 3)), axis=0)
    width = rng.uniform(-1.0, 6.0, (n, 3))
    if holes:
        command[rng.random((n, 3)) < 0.1] = np.nan
    low, high = play_interval(command, width)
    k = min(cut, n) - 1
    there = play_interval(command[k:], width[k:], np.stack((low[k], high[k])))
    np.testing.assert_allclose(there, (low[k:], high[k:]), rtol=0, atol=1e-12)


def test_backlash_is_taken_up_at_the_share_where_it_is() -> None:
    rng = np.random.default_rng(4)
    old, moved, width = (
        rng.uniform(-1, 1, (200, 3)),
        rng.normal(0, 0.02, (200, 3)),
        rng.uniform(0, 0.02, (200, 3)),
    )
    new = play_after(old, moved, width)
    motion, axis, share = taken_up(old, new, moved, width)
    # a motion inside of the backlash may be among them by rounding: its share is 1
    assert (np.abs(new[motion, axis]) == 1.0)[share < 1.0 - 1e-9].all()
    some = share < 1.0 - 1e-9
    motion, axis, share = motion[some], axis[some], share[some]
    assert 100 < len(motion) < 600
    for factor, there in ((1.0 + 1e-9, True), (1.0 - 1e-6, False)):
        so_far = play_after(old[motion], factor * share[:, None] * moved[motion], width[motion])
        of_axis = so_far[np.arange(len(motion)), axis]
        assert (of_axis == new[motion, axis]).all() == there
    # the others end inside of their backlash
    inside = np.abs(new) < 1.0
    inside[motion, axis] = True
    assert (inside | (new == old)).all()
