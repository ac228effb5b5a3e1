"""A path that comes part by part is the path through all of its points."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from olp.comparison.path import Path, PathParts
from olp.core.errors import CannotCompute


@pytest.mark.parametrize("size", [1, 2, 3, 7, 50])
def test_a_path_in_parts_is_the_path_through_all_points(size: int) -> None:
    rng = np.random.default_rng(18)
    # points that repeat, within parts and across their ends, and stops on some of them
    points = np.repeat(rng.normal(size=(20, 3)), rng.integers(1, 5, 20), axis=0)
    count = len(points)
    line, cutting, stop = np.arange(count) * 3, rng.random(count) < 0.5, rng.random(count) < 0.4
    parts = PathParts()
    for a, b in pairwise((*range(0, count, size), count)):
        parts.put(points[a:b], line[a:b], cutting[a:b], stop[a:b])
    path, whole = parts.path(), Path.through(points, line, cutting, stop)

    # the first of points that repeat states the segment that ends there
    first = np.flatnonzero(np.append(True, (points[1:] != points[:-1]).any(axis=1)))
    for one in (path, whole):
        np.testing.assert_array_equal(one.vertex_mm, points[first])
        np.testing.assert_array_equal(one.line, line[first[1:]])
        np.testing.assert_array_equal(one.cutting, cutting[first[1:]])
        np.testing.assert_array_equal(one.vertex_mm[one.stops.vertex], points[stop])
        np.testing.assert_array_equal(one.stops.line, line[stop])
    np.testing.assert_array_equal(path.s_mm, whole.s_mm)
    steps = np.linalg.norm(np.diff(points[first], axis=0), axis=1)
    np.testing.assert_allclose(np.diff(whole.s_mm), steps, rtol=1e-12)


def test_a_path_of_one_place_is_refused() -> None:
    parts = PathParts()
    for _ in range(3):
        parts.put(np.ones((2, 3)), np.arange(2), np.ones(2, bool), np.zeros(2, bool))
    with pytest.raises(CannotCompute, match="fewer than two"):
        parts.path()
