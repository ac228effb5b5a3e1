"""What the cells of a spline hide of a curve: laws, with the Brownian bridge as the judge of steps."""

from __future__ import annotations

import numpy as np
import pytest

from olp.calibration.estimator.basis import Scales, Spline
from olp.calibration.estimator.between import Hidden, hidden
from olp.calibration.observations.base import Noise
from olp.calibration.observations.lines import Line

LENGTH = 1100.0


def hides(scales: Scales, targets: int, cells: int, component: str = "EAX") -> Hidden:
    """What cells hide of a curve that so many targets over its length read, with almost no noise."""
    q = np.linspace(0.0, LENGTH, targets)
    line = Line(component, q, np.zeros(targets), np.ones(targets), np.ones(targets), (0.0, 0.0, 0.0))
    return hidden([(line, Noise(1e-9, 0.0, None))], Spline(0.0, LENGTH, cells), scales, 1e-3, 0.0)


def test_steps_are_open_as_a_brownian_bridge() -> None:
    """Between targets a gap apart a wandering value has the variance s^2 u (1 - u) gap: with few cells the
    hidden part is most of it, and no more than all of it."""
    found = hides(Scales(0.0, 0.0, 1e-4, 0.0), 12, 12)
    bridge = 1e-8 / 11.0 / 6.0
    assert 0.5 * bridge < np.mean(found.variance[4:-4]) < 1.02 * bridge


def test_more_cells_hide_less() -> None:
    scales = Scales(0.0, 0.0, 1e-4, 0.0)
    few, many, all_of_it = (np.mean(hides(scales, 12, cells).variance) for cells in (24, 48, 132))
    assert few > 1.3 * many
    assert all_of_it < 1e-6 * few


def test_nothing_is_hidden_at_targets_and_of_what_is_smooth() -> None:
    rough = hides(Scales(0.0, 0.0, 1e-4, 0.0), 12, 24)
    targets = np.linspace(0.0, LENGTH, 12)
    assert rough.at(targets).max() < 1e-3 * rough.variance.max()
    smooth = hides(Scales(1e-2, 0.0, 0.0, 0.0), 12, 24)
    assert smooth.variance.max() < 1e-3 * rough.variance.max()


def test_ripple_beside_a_target_is_another_one() -> None:
    """A wave of a screw is elsewhere a few millimetres on: three quarters of the variance of ripple. The mean
    square of a cubic B-spline is 151/315."""
    variance = 0.75e-10 * 151.0 / 315.0
    ripple = hides(Scales(0.0, 0.0, 0.0, 1e-5), 12, 24)
    inside = np.linspace(0.0, LENGTH, 12)[1:-1]
    assert ripple.at(inside) == pytest.approx(np.full(10, variance), rel=0.35)
    # under steps, what a target shows is its own ripple too
    both = hides(Scales(0.0, 0.0, 1e-4, 1e-5), 12, 24)
    assert both.at(inside) == pytest.approx(np.full(10, 2.0 * variance), rel=0.1)


@pytest.mark.parametrize("component", ["EXX", "EYX", "EAX"])
def test_nothing_is_hidden_at_the_datum(component: str) -> None:
    found = hides(Scales(0.0, 0.0, 1e-4, 1e-5), 8, 24, component)
    assert found.at(np.zeros(1))[0] < 1e-3 * found.variance.max()
