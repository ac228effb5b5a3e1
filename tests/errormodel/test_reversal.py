"""Backlash: the play along a program, against one step at a time; and curves with a direction."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.core.errors import UsageError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.reversal import play_interval, play_states

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
