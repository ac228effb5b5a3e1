"""Shapes of arcs: points and distances in mixed planes are those of each arc alone."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.core.arrays import Array
from olp.core.geometry import PLANES, ArcShapes, segment_distance

COUNT = 12


def shapes(seed: int) -> tuple[ArcShapes, Array, Array, Array, Array, Array]:
    """Arcs of all planes, and what they were made from."""
    rng = np.random.default_rng(seed)
    start, end, centre = (rng.uniform(-20, 20, (COUNT, 3)) for _ in range(3))
    plane, sweep = np.arange(COUNT) % 3, rng.uniform(-7, 7, COUNT)
    return ArcShapes.of(start, end, centre, plane, sweep), start, end, centre, plane, sweep


def test_points_are_worked_out_one_by_one() -> None:
    made, start, end, centre, plane, sweep = shapes(0)
    which, share = np.arange(COUNT).repeat(3), np.tile([0.0, 0.3, 1.0], COUNT)
    points = made.at(which, share)
    for point, i, s in zip(points, which.tolist(), share.tolist(), strict=True):
        first, second, third = PLANES[plane[i]]
        arm, last = start[i] - centre[i], end[i] - centre[i]
        angle = math.atan2(arm[second], arm[first]) + s * sweep[i]
        begin, final = math.hypot(arm[first], arm[second]), math.hypot(last[first], last[second])
        radius = begin + s * (final - begin)
        assert point[first] == pytest.approx(centre[i, first] + radius * math.cos(angle), abs=1e-12)
        assert point[second] == pytest.approx(centre[i, second] + radius * math.sin(angle), abs=1e-12)
        assert point[third] == pytest.approx(start[i, third] + s * (end[i, third] - start[i, third]))


@pytest.mark.parametrize("seed", range(3))
def test_distances_in_mixed_planes_are_those_of_one_plane(seed: int) -> None:
    made, start, end, centre, plane, sweep = shapes(seed)
    rng = np.random.default_rng(seed + 10)
    which, share = np.arange(COUNT), rng.uniform(0, 1, COUNT)
    point = made.at(which, share) + rng.uniform(-0.01, 0.01, (COUNT, 3))
    away = made.distance(point, which, share)
    for i in range(COUNT):
        one = slice(i, i + 1)
        alone = ArcShapes.of(start[one], end[one], centre[one], plane[one], sweep[one])
        assert alone.distance(point[one], np.array([0]), share[one])[0] == away[i]
    assert (away <= math.sqrt(3) * 0.01 + 1e-12).all()


def test_a_point_on_the_arc_has_no_distance_and_one_beyond_its_end_is_that_far() -> None:
    made = ArcShapes.of(
        np.array([[10.0, 0, 0]]),
        np.array([[0.0, 10, 0]]),
        np.zeros((1, 3)),
        np.array([0]),
        np.array([math.pi / 2]),
    )
    point = np.array([[10 * math.cos(0.4), 10 * math.sin(0.4), 0], [12.0, 0, 0], [0, 10, 3]])
    away = made.distance(point, np.zeros(3, np.int64), np.array([0.25, 0.0, 1.0]))
    assert away == pytest.approx([0.0, 2.0, 3.0], abs=1e-12)


@pytest.mark.parametrize("width", [2, 3])
def test_distances_from_segments_in_any_number(width: int) -> None:
    """More points than are computed at once, also to segments that many of them share; by dense samples."""
    rng = np.random.default_rng(width)
    start, end = rng.normal(size=(2, 50, width))
    end[7] = start[7]
    which = rng.integers(0, 50, 10_000)
    point = 2.0 * rng.normal(size=(len(which), width))
    distance = segment_distance(point, start, end, which)
    np.testing.assert_allclose(segment_distance(point, start[which], end[which]), distance)
    some = np.arange(0, len(which), 97)
    share = np.linspace(0.0, 1.0, 2001)[:, None, None]
    samples = start[which[some]] + share * (end - start)[which[some]]
    nearest = np.sqrt(((point[some] - samples) ** 2).sum(axis=2)).min(axis=0)
    np.testing.assert_allclose(distance[some], nearest, atol=2e-3)
    end[3] = np.nan
    assert np.isnan(segment_distance(start[3:4], start[3:4], end[3:4])).all()
