"""ISO 9283: AP, RP, AT and RT worked by hand from the definitions of the standard."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.comparison.figures import Run
from olp.comparison.iso9283 import largest, repeated
from olp.comparison.pairing import pair
from olp.comparison.path import Path


def test_pose_accuracy_and_repeatability_by_hand() -> None:
    """Four cycles at one pose, commanded (10, 20, 30).

    Attained x: 10.01, 10.03, 10.02, 10.02; y: 20.00, 20.00, 20.02, 19.98; z: 30.00 each. Barycentre
    (10.02, 20.00, 30.00), so AP = 0.02. Distances from it: 0.01, 0.01, 0.02, 0.02; mean 0.015; deviations
    from the mean 0.005 each, S = sqrt(4 x 0.005^2 / 3) = 0.0057735; RP = 0.015 + 3 x 0.0057735 = 0.0323205.
    """
    attained = np.array([
        [[10.01, 20.00, 30.0]], [[10.03, 20.00, 30.0]], [[10.02, 20.02, 30.0]], [[10.02, 19.98, 30.0]],
    ])  # fmt: skip
    figures = repeated(np.array([[10.0, 20.0, 30.0]]), attained)
    assert figures.accuracy[0] == pytest.approx(0.02, abs=1e-12)
    assert figures.repeatability[0] == pytest.approx(0.015 + 3 * 0.005 * 2 / math.sqrt(3), abs=1e-12)
    assert figures.bias[0] == pytest.approx([0.02, 0.0, 0.0], abs=1e-12)


def test_the_worst_pose_counts_and_one_cycle_has_no_repeatability() -> None:
    command = np.zeros((2, 3))
    one = np.array([[[0.003, 0.004, 0.0], [0.0, 0.0, 0.001]]])
    figures = repeated(command, one)
    assert figures.accuracy == pytest.approx([0.005, 0.001])
    assert np.isnan(figures.repeatability).all()
    assert (largest(figures.accuracy).value_mm, largest(figures.accuracy).place) == (pytest.approx(0.005), 0)
    assert largest(figures.repeatability).place == -1


@pytest.mark.slow
def test_path_accuracy_and_repeatability_by_hand() -> None:
    """Three cycles along X, off by y = 0.010, 0.020 and 0.030 mm everywhere, and z = 0.

    In each normal plane: barycentre y = 0.020, so AT = 0.020. Distances from it 0.010, 0, 0.010; mean
    0.00666667; S = sqrt((2 x 0.00333333^2 + 0.00666667^2) / 2) = 0.0057735; RT = 0.0066667 + 3 S =
    0.0239872. Each cycle was sampled at other places, which must not change the figures.
    """
    path = Path.through(np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]))
    runs = []
    for cycle, (off, count) in enumerate(((0.01, 501), (0.02, 333), (0.03, 1201))):
        x = np.linspace(0.0, 100.0, count)
        points = np.column_stack((x, np.full(count, off), np.zeros(count)))
        runs.append(Run.of(str(cycle), path, points, pair(path, points, "forward"), 1.0))
    places = np.array([10.0, 33.3, 77.7])
    command, _ = path.at(places)
    figures = repeated(command, np.stack([run.at(path, places) for run in runs]))
    assert figures.accuracy == pytest.approx([0.02] * 3, abs=1e-9)
    mean = 0.02 / 3
    spread = math.sqrt((2 * (0.01 - mean) ** 2 + mean**2) / 2)
    assert figures.repeatability == pytest.approx([mean + 3 * spread] * 3, abs=1e-9)


def test_the_worst_place_of_a_path_counts() -> None:
    """Two cycles that part linearly: y = 0 and y = x / 1000. Barycentre and distances are x / 2000."""
    path = Path.through(np.array([[0.0, 0.0, 0.0], [100.0, 0.0, 0.0]]))
    x = np.linspace(0.0, 100.0, 1001)
    runs = []
    for slope in (0.0, 1e-3):
        points = np.column_stack((x, slope * x, 0 * x))
        runs.append(Run.of("", path, points, pair(path, points, "forward"), 1.0))
    places = np.array([20.0, 50.0, 90.0])
    command, _ = path.at(places)
    figures = repeated(command, np.stack([run.at(path, places) for run in runs]))
    assert figures.accuracy == pytest.approx(places / 2000, abs=1e-9)
    assert figures.repeatability == pytest.approx(places / 2000, abs=1e-6)
    assert largest(figures.accuracy).place == 2
