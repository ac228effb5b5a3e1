"""What a motion uses of its limits, by line and at slow stretches: closed forms and laws."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from cases.trajectory import LIMITS, random_route, route
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.trajectory.plan import plan
from olp.trajectory.route import Route
from olp.trajectory.summary import compare, partners, summary
from olp.trajectory.usage import LIMITS as NAMES
from olp.trajectory.usage import LineUse, SlowStretches, feeds_of_pieces, usage

FEED = 60.0
#: a ramp to FEED along X never reaches the acceleration limit: it takes 2 sqrt(F / J)
HALF_RAMP_S = float(np.sqrt(FEED / LIMITS.jerk[0]))


def straight(length: float = 100.0, feed: float = FEED) -> Route:
    return route(np.array([[0.0, 0, 0], [length, 0, 0]]), feed, 0.0)


def length_of(route: Route) -> float:
    return float(np.sqrt((np.diff(route.point_mm, axis=0) ** 2).sum(axis=1)).sum())


def test_one_straight_move_in_closed_form() -> None:
    route = straight()
    lines, slow = usage(plan(route, LIMITS), route)
    duration = 100.0 / FEED + 2.0 * HALF_RAMP_S
    assert lines.seconds == pytest.approx([duration], rel=1e-7)
    assert lines.lost_s() == pytest.approx([2.0 * HALF_RAMP_S], rel=1e-6)
    assert lines.achieved_mm_s() == pytest.approx([100.0 / duration], rel=1e-7)
    assert lines.fastest_mm_s == pytest.approx([FEED], rel=1e-7)
    assert NAMES[lines.limit()[0]] == "feed"
    # jerk is at its limit in all four half ramps
    assert lines.at_limit_s[0, NAMES.index("X jerk")] == pytest.approx(4.0 * HALF_RAMP_S, rel=1e-6)
    assert not lines.at_limit_s[0, [NAMES.index(f"{a} jerk") for a in "YZ"]].any()
    # half the feed is reached after half the ramp
    assert len(slow) == 2
    assert slow.seconds == pytest.approx([HALF_RAMP_S] * 2, rel=1e-6)
    assert slow.start_s == pytest.approx([0.0, duration - HALF_RAMP_S], rel=1e-6)
    assert slow.slowest_mm_s == pytest.approx([0.0, 0.0], abs=1e-6)
    assert slow.position_mm[:, 0] == pytest.approx([0.0, 100.0], abs=1e-6)
    assert {NAMES[i] for i in slow.limit} == {"X jerk"}


def test_a_dwell_is_no_slow_motion() -> None:
    route = straight()
    route.dwell_s[1] = 3.0
    lines, slow = usage(plan(route, LIMITS), route)
    bare, places = usage(plan(straight(), LIMITS), straight())
    assert lines.dwell_s == pytest.approx([3.0])
    assert lines.seconds == pytest.approx(bare.seconds)
    assert slow.seconds == pytest.approx(places.seconds)


def test_moves_of_one_line_have_their_own_feeds() -> None:
    """As in a canned cycle: over, down at feed, and up again."""
    point = np.array([[0.0, 0, 0], [50, 0, 0], [50, 0, -10], [50, 0, 0]])
    route = Route(point, np.array([np.inf, 5.0, np.inf]), np.full(3, 7), np.zeros(4), np.zeros(4))
    trajectory = plan(route, LIMITS)
    feed = feeds_of_pieces(trajectory.motion, route)
    middle = trajectory.motion.of(np.arange(len(trajectory.motion)), 0.5 * np.diff(trajectory.motion.start_s))
    down = middle[1][:, 2] < 0.0
    assert (feed == np.where(down, 5.0, np.inf)).all()
    lines, _ = usage(trajectory, route)
    assert lines.feed_length_mm == pytest.approx([10.0])
    assert lines.length_mm == pytest.approx([70.0])
    assert lines.feed_mm_s == pytest.approx([5.0])
    assert lines.feed_seconds == pytest.approx([np.diff(trajectory.motion.start_s)[down].sum()])


@pytest.mark.slow
@settings(max_examples=12)
@given(st.integers(0, 10_000))
def test_lines_and_places_share_out_the_whole(seed: int) -> None:
    route, limits = random_route(seed)
    trajectory = plan(route, limits)
    lines, slow = usage(trajectory, route)
    whole = trajectory.duration_s
    assert lines.seconds.sum() + lines.dwell_s.sum() == pytest.approx(whole, rel=1e-9)
    assert (lines.at_limit_s <= lines.seconds[:, None] * (1 + 1e-9) + 1e-12).all()
    # how well the limits are kept is for the judges of the planner to say
    assert (lines.most <= 1.01).all()
    assert slow.seconds.sum() <= lines.feed_seconds.sum() * (1 + 1e-9)
    assert (slow.slowest_mm_s < 0.5 * slow.feed_mm_s).all()
    assert (slow.lost_s >= 0.5 * slow.seconds * (1 - 1e-9)).all()
    assert (np.diff(slow.start_s) > 0.0).all()
    # the motion of a line is driven no faster than its feed; rounded corners may shorten the path
    near = lines.feed_length_mm - 8.0 * route.tolerance_mm.max()
    fed = np.isfinite(lines.feed_mm_s)
    assert (near[fed] <= lines.feed_seconds[fed] * lines.feed_mm_s[fed] * (1 + 1e-5)).all()


@pytest.mark.slow
@settings(max_examples=6)
@given(st.integers(0, 10_000))
def test_two_stretches_make_one_table(seed: int) -> None:
    route, limits = random_route(seed)
    other = replace(route, line=route.line + len(route.line) // 2)
    parts = [usage(plan(r, limits), r)[0] for r in (route, other)]
    both = LineUse.joined(parts)
    assert (np.diff(both.line) > 0).all()
    for name in ("seconds", "dwell_s", "length_mm", "feed_seconds", "feed_length_mm", "at_limit_s"):
        total = sum(getattr(p, name).sum() for p in parts)
        assert getattr(both, name).sum() == pytest.approx(total, rel=1e-9)
    assert both.lost_s().sum() == pytest.approx(sum(p.lost_s().sum() for p in parts), rel=1e-6, abs=1e-9)
    assert both.most.max() == max(p.most.max() for p in parts)


def test_nothing_has_a_table_too() -> None:
    empty = LineUse.joined([])
    assert len(empty) == 0
    assert summary((), empty, ())["duration_s"] == 0.0


def test_blocks_of_pieces_leave_no_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    route, limits = random_route(11)
    trajectory = plan(route, limits)
    lines, slow = usage(trajectory, route)
    monkeypatch.setattr("olp.trajectory.usage._BLOCK", 3)
    again, places = usage(trajectory, route)
    assert len(slow) == len(places) > 1
    for name in SlowStretches.__slots__:
        np.testing.assert_allclose(getattr(slow, name), getattr(places, name), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(lines.at_limit_s, again.at_limit_s, rtol=1e-12, atol=1e-12)


@given(st.integers(0, 10_000), st.floats(0.0, 1.0))
def test_partners_are_found_among_inserted_points(seed: int, density: float) -> None:
    r = np.random.default_rng(seed)
    step = r.normal(size=(r.integers(1, 80), 3)) * 10.0 ** r.uniform(-2, 2)
    point = np.concatenate((np.zeros((1, 3)), np.cumsum(step, axis=0)))

    def shifted(p: np.ndarray) -> np.ndarray:
        return p + 0.04 * np.sin(p[..., ::-1] / 300.0) + 0.02

    points, index = [shifted(point[0])], [0]
    for a, b in pairwise(point):
        if np.linalg.norm(b - a) > 3.0 and r.random() < density:
            shares = np.linspace(0.0, 1.0, int(r.integers(3, 5)))[1:-1]
            points += [shifted(a + s * (b - a)) for s in shares]
        index.append(len(points))
        points.append(shifted(b))
    result = partners(point, np.array(points))
    assert result is not None
    assert result.tolist() == index


def test_another_path_has_no_partners() -> None:
    point = np.array([[0.0, 0, 0], [10, 0, 0], [10, 10, 0]])
    assert partners(point, point[:2]) is None
    assert partners(point, point[[0, 2, 1]]) is None


def test_times_are_compared_line_by_line() -> None:
    nominal = route(np.array([[0.0, 0, 0], [100, 0, 0], [100, 50, 0]]), 20.0, 0.0)
    point = np.array([[0.0, 0, 0], [50, 0.01, 0], [100, 0.02, 0], [100, 50, 0]])
    corrected = route(point, np.array([20.0, 20.0, 5.0]), 0.0)
    sides = [([each], usage(plan(each, LIMITS), each)[0]) for each in (nominal, corrected)]
    rows = compare(*sides)
    assert rows is not None
    assert [row["line"] for row in rows] == [1, 0]
    (_, before), (_, after) = sides
    by_line = {row["line"]: (row["nominal_s"], row["corrected_s"]) for row in rows}
    assert by_line[0] == pytest.approx((before.seconds[0], after.seconds[:2].sum()))
    assert by_line[1] == pytest.approx((before.seconds[1], after.seconds[2]))
    assert compare(sides[1], sides[0]) is None
    assert compare(sides[0], ([corrected, corrected], after)) is None
