"""Subdivision of lines on errors whose chords are known by hand: a parabola, a kink, a wave.

A chord of length d leaves the parabola a x^2 by a d^2 / 4. A move whose whole chord leaves it by twice the
tolerance is sampled at 8 steps, and its chords may end at 32 positions. The longest chord that fits is
sqrt(1/2) of it: 22 positions.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from cases.toy import Toy, feed, linear, parabola, rapid, toolpath

from olp.compensation import lines
from olp.compensation.lines import Cuts, subdivide_lines
from olp.core.toolpath import Frame, Kind, Toolpath

TOLERANCE_MM = 0.01
LENGTH_MM = 80.0
#: the whole chord of 80 mm leaves it by twice the tolerance
TWICE = 2 * TOLERANCE_MM * 4 / LENGTH_MM**2
WHOLE, PART = (LENGTH_MM, 0.0, 0.0), (55.0, 0.0, 0.0)


def cut(path: Toolpath, model: Toy, free: list[bool] | None = None) -> Cuts:
    chosen = np.ones(len(path), bool) if free is None else np.array(free)
    return subdivide_lines(path, model, np.array(path.start_mm), path.end_mm, chosen, TOLERANCE_MM)


def test_each_chord_is_as_long_as_it_can_be() -> None:
    move, share, target = cut(toolpath(feed(*WHOLE)), parabola(TWICE))
    assert (move.tolist(), share.tolist(), target.tolist()) == ([0], [22 / 32], [list(PART)])


@pytest.mark.parametrize(("times", "count"), [(0.999, 0), (1.001, 1)])
def test_a_move_is_cut_where_its_chord_leaves_the_line_by_more_than_the_tolerance(
    times: float, count: int
) -> None:
    assert len(cut(toolpath(feed(*WHOLE)), parabola(TWICE / 2 * times))[0]) == count


def test_cuts_lie_on_the_line_from_where_the_move_begins() -> None:
    path = toolpath(feed(30.0, 5.0, -7.0), feed(110.0, 5.0, -7.0), start=(30.0, 5.0, -7.0))
    move, share, target = cut(path, parabola(TWICE))
    assert (move.tolist(), share.tolist(), target.tolist()) == ([1], [22 / 32], [[85.0, 5.0, -7.0]])
    first = toolpath(feed(110.0, 5.0, -7.0), start=(30.0, 5.0, -7.0))
    assert cut(first, parabola(TWICE))[2].tolist() == [[85.0, 5.0, -7.0]]


def test_targets_count_not_ends() -> None:
    """The targets of the same path lie at other positions."""
    path = toolpath(rapid(0.0, 0.0, 0.0), feed(*WHOLE))
    target = path.end_mm + np.array([100.0, -3.0, 4.0])
    begin, free = np.array(path.start_mm), np.array([False, True])
    got = subdivide_lines(path, parabola(TWICE), begin, target, free, TOLERANCE_MM)
    assert got[2].tolist() == [[155.0, -3.0, 4.0]]


def test_only_free_moves_of_known_position_are_cut() -> None:
    unknown = (math.nan, 0.0, 0.0)
    path = toolpath(feed(*WHOLE), feed(0.0, 0.0, 0.0), feed(*unknown), feed(*WHOLE), feed(0.0, 0.0, 0.0))
    assert cut(path, parabola(TWICE))[0].tolist() == [0, 1, 4]
    assert cut(path, parabola(TWICE), [False, True, True, True, False])[0].tolist() == [1]
    assert [len(column) for column in cut(path, parabola(TWICE), [False] * 5)] == [0, 0, 0]
    assert cut(toolpath(), parabola(TWICE))[2].shape == (0, 3)


def test_each_move_has_its_own_tool() -> None:
    """Four times the bend: half the length. The second chord begins between two samples."""
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 4.0)))
    path = toolpath(feed(*WHOLE), feed(0.0, 0.0, 0.0, frame=1), feed(*WHOLE), frames=frames)
    move, share, target = cut(path, parabola(TWICE))
    assert sorted(zip(move.tolist(), (share * 64).tolist(), strict=True)) == [
        (0, 44),
        (1, 22),
        (1, 44),
        (2, 44),
    ]
    place = {0: 55.0, 1: 80.0 - 80.0 * share[move == 1], 2: 55.0}
    for k, x_mm in place.items():
        assert target[move == k, 0] == pytest.approx(x_mm)
    # where all moves have one tool, it counts for all of them
    alone = toolpath(feed(*WHOLE), frames=(Frame(tool_mm=(0.0, 0.0, 4.0)),))
    assert (cut(alone, parabola(TWICE))[1] * 64).tolist() == [22, 44]


def test_along_the_line_the_tip_may_be_early_or_late() -> None:
    assert not len(cut(toolpath(feed(*WHOLE)), parabola(TWICE, of=0, into=0))[0])
    assert not len(cut(toolpath(feed(0.0, 0.0, LENGTH_MM)), parabola(TWICE, of=2, into=2))[0])


@pytest.mark.parametrize("sign", (1, -1))
def test_of_a_slanted_line_the_part_across_it_counts(sign: int) -> None:
    """Y is off along X: of a line of slope 4 to 3 six tenths of it are across. 64 positions, and the search
    ends within 1/32: sqrt(1/2) of them is 45."""
    path = toolpath(feed(LENGTH_MM, sign * LENGTH_MM * 4 / 3, 0.0))
    move, share, target = cut(path, parabola(TWICE / 0.6))
    assert move.tolist() == [0]
    assert share[0] * 64 in (44, 45)
    assert target[0] == pytest.approx(path.end_mm[0] * share[0])


def test_a_bend_in_two_directions_counts_as_their_hypotenuse() -> None:
    """3 and 4 of 5 parts of the bend in Y and in Z."""
    one, other = parabola(TWICE * 0.6), parabola(-TWICE * 0.8, into=2)
    model = Toy(lambda p, t: one.error_mm(p, t) + other.error_mm(p, t), parabola(TWICE).bound)
    assert cut(toolpath(feed(*WHOLE)), model)[1].tolist() == [22 / 32]


def test_the_side_of_the_backlash_is_that_of_the_motion() -> None:
    """Y is off by a y^2, and its backlash is 2 a y^2: in + they cancel, in - they add."""
    both = parabola(TWICE, of=1)
    bend = lambda p: np.column_stack([0 * p[:, 0], 2 * TWICE * p[:, 1] ** 2, 0 * p[:, 0]])  # noqa: E731
    model = Toy(both.error_mm, lambda delta, tool: 2 * both.bound(delta, tool), bend)
    # across a line of 45 degrees lies sqrt(1/2) of it
    path = toolpath(feed(LENGTH_MM, LENGTH_MM, 0.0), feed(0.0, 0.0, 0.0))
    move = cut(path, model)[0]
    assert set(move.tolist()) == {1}


def kink(point: np.ndarray, _: np.ndarray) -> np.ndarray:
    """Y rises by 0.04 mm to X 40 and falls as far again."""
    values = np.zeros((len(point), 3))
    values[:, 1] = 0.04 - 1e-3 * np.abs(point[:, 0] - 40.0)
    return values


def test_a_chord_goes_past_a_kink_as_far_as_it_may() -> None:
    """From 0 to 40 + d a chord leaves the kink by 0.08 d / (40 + d): 0.01 where d is 40 / 7."""
    model = Toy(kink, lambda delta, tool: 2e-3 * delta[:, 0] / 4)
    move, share, _ = cut(toolpath(feed(*WHOLE)), model)
    end = 40.0 + 40.0 / 7
    assert move.tolist() == [0]
    assert end * (1 - 1 / 31) <= share[0] * LENGTH_MM <= end


def test_a_chord_ends_at_each_corner_of_a_zigzag() -> None:
    """Y goes up and down by half a millimetre every 10 mm: at the corners lie the samples of 80 mm."""

    def zigzag(point: np.ndarray, _: np.ndarray) -> np.ndarray:
        return np.outer(0.5 * np.abs((point[:, 0] / 10 + 1) % 2 - 1), [0.0, 1.0, 0.0])

    model = Toy(zigzag, lambda delta, tool: np.where(delta[:, 0] > 10.0, 0.5, 0.0))
    move, share, _ = cut(toolpath(feed(*WHOLE)), model)
    assert move.tolist() == [0] * 7
    assert sorted((share * 8).tolist()) == [1, 2, 3, 4, 5, 6, 7]


def wave(point: np.ndarray, _: np.ndarray) -> np.ndarray:
    values = np.zeros((len(point), 3))
    values[:, 1] = 0.05 * np.sin(point[:, 0] / 7.0) + 1e-5 * point[:, 0] ** 2
    return values


def departure(model: Toy, a: np.ndarray, b: np.ndarray) -> float:
    """How far the error across X leaves the chord from a to b, by a look at 2000 points."""
    share = np.linspace(0.0, 1.0, 2001)[:, None]
    error = model.error(a + share * (b - a), np.zeros(3))[:, 1]
    return float(np.abs(error - (error[0] + share[:, 0] * (error[-1] - error[0]))).max())


@pytest.mark.parametrize("tolerance", (0.002, 0.02))
@pytest.mark.parametrize("way", (1, -1))
def test_chords_of_a_wave_fit_and_could_be_no_longer(tolerance: float, way: int) -> None:
    """Up to the 1/32 within which the search ends, and the fineness of the positions."""
    model = Toy(wave, lambda delta, tool: (0.05 / 49.0 + 2e-5) * delta[:, 0] ** 2 / 8)
    path = toolpath(feed(way * 300.0, 0.0, 0.0))
    begin, free = np.array(path.start_mm), np.ones(1, bool)
    move, share, target = subdivide_lines(path, model, begin, path.end_mm, free, tolerance)
    order = np.argsort(share)
    ends = [np.zeros(3), *target[order], path.end_mm[0]]
    assert len(ends) > 8
    assert set(move.tolist()) == {0}
    for a, b in pairwise(ends):
        assert departure(model, a, b) <= 1.05 * tolerance
    for a, b in pairwise(ends[:-1]):
        assert departure(model, a, b + 0.06 * (b - a)) > 0.95 * tolerance


def test_how_many_samples_are_held_at_once_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    model = Toy(wave, lambda delta, tool: (0.05 / 49.0 + 2e-5) * delta[:, 0] ** 2 / 8)
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 4.0)))
    path = toolpath(*(feed(200.0 * (k % 2), float(k), 0.0, frame=k % 2) for k in range(1, 4)), frames=frames)
    whole = [np.sort(column, axis=0) for column in cut(path, model)]
    for batch in (1, 300):
        monkeypatch.setattr(lines, "_BATCH", batch)
        for column, expected in zip(cut(path, model), whole, strict=True):
            assert np.sort(column, axis=0).tolist() == expected.tolist()


def test_a_long_program_is_cut_as_a_short_one() -> None:
    """Moves are looked at 65536 at a time: the first of the second lot begins where the last one ended."""
    count = (1 << 16) + 2
    end = np.zeros((count, 3))
    end[:, 1], end[-2, 0] = 3.0, LENGTH_MM
    frames = (Frame(), Frame(tool_mm=(0.0, 0.0, 4.0)))
    frame = np.zeros(count, np.int32)
    frame[-1] = 1
    path = Toolpath(
        np.full(count, Kind.LINE, np.uint8), np.zeros(count, np.uint8), np.arange(count, dtype=np.int32) + 1,
        frame, end, frames, start_mm=(0.0, 3.0, 0.0),
    )  # fmt: skip
    move, share, target = cut(path, parabola(TWICE))
    assert sorted(zip(move.tolist(), (share * 64).tolist(), strict=True)) == [
        (count - 2, 44), (count - 1, 22), (count - 1, 44),
    ]  # fmt: skip
    assert target[:, 1].tolist() == [3.0] * 3


def test_an_error_that_is_linear_needs_no_cut_whatever_its_bound_says() -> None:
    model = linear(np.eye(3) * 1e-3 + 1e-4, bound=lambda delta, tool: delta[:, 0] * 1e-2)
    assert not len(cut(toolpath(feed(300.0, 20.0, 10.0)), model)[0])
