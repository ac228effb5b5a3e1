"""The largest between samples of arcs, of errors that are known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cases.paths import Known, arc, line, rapid, toolpath

from olp.core.arrays import Array
from olp.core.toolpath import Frame
from olp.proof.courses import peaks
from olp.proof.deviation import measure

FINE = 4001


def stretch(length: float, rate: float, phase: float, step: float) -> tuple[Array, float]:
    """Samples of a sine at equal steps of `step` at the most, and its largest size."""
    count = max(math.ceil(length / step), 4)
    angle, fine = (np.linspace(0, length, k) for k in (count + 1, FINE))
    return np.sin(rate * angle + phase), float(np.abs(np.sin(rate * fine + phase)).max())


@pytest.mark.parametrize(("rate", "miss"), [(1.0, 3e-4), (2.0, 2e-3)])
def test_the_peak_of_a_sine_is_found_between_its_samples(rate: float, miss: float) -> None:
    """All phases and lengths; with half of the steps of the samples themselves it would be missed by 0.3 %
    and 1.1 %."""
    drawn = [
        stretch(s, rate, phase, 0.3) for s in (0.2, 0.9, 1.2, 1.9, 6.2) for phase in np.arange(0, 3.1, 0.07)
    ]
    samples, largest = [d[0] for d in drawn], np.array([d[1] for d in drawn])
    count = np.array([len(s) for s in samples])
    for aside in (0.0, 0.5):
        got = peaks((np.concatenate(samples), np.full(count.sum(), aside)), count)
        assert np.abs(got / np.hypot(largest, aside) - 1).max() < miss
        sampled = np.hypot([np.abs(s).max() for s in samples], aside)
        assert (got >= sampled * (1 - 1e-12)).all()


def test_the_largest_is_that_of_both_directions_together() -> None:
    """A point that goes round at 2 um is 2 um away everywhere, and 3 um where it is 3 um aside half-way."""
    angle = 0.3 * np.arange(6)
    bulge = 6 - np.square(np.arange(6) - 2.5)
    one, other = np.append(2 * np.cos(angle), bulge), np.append(2 * np.sin(angle), np.zeros(6))
    assert peaks((one, other), np.array([6, 6])) == pytest.approx([2.0, 6.0], rel=1e-3)


def test_what_is_not_known_has_no_peak() -> None:
    values = np.array([1.0, 2, np.nan, 2, 1, 0, 0, 1, 0, 0])
    got = peaks((values, np.zeros(10)), np.array([5, 5]))
    assert np.isnan(got[0])
    assert got[1] == pytest.approx(1.0)


@pytest.mark.parametrize("plane", (0, 1, 2))
@pytest.mark.parametrize("sweep", (0.1, -0.7, 1.55, -3.0, 4.4, -2 * math.pi))
def test_an_error_that_grows_with_the_position(plane: int, sweep: float) -> None:
    """Squareness and scales over an arc of 80 mm radius, whose commands are 30 um wider at its end."""
    axes = ((0, 1, 2), (2, 0, 1), (1, 2, 0))[plane]
    rng = np.random.default_rng(int(10 * abs(sweep)) + plane)
    grows, shift = rng.uniform(-3e-4, 3e-4, (3, 3)), rng.uniform(-0.02, 0.02, 3)
    model = Known(lambda axis_mm: axis_mm @ grows + shift)

    def at(share: Array, more: float = 0.0) -> Array:
        place = np.zeros((len(share), 3))
        radius, angle = 80 + more * share, 1.0 + sweep * share
        place[:, axes[0]], place[:, axes[1]] = radius * np.cos(angle), radius * np.sin(angle)
        return place

    ends = np.array([0.0, 1.0])
    move = {"centre": (0.0, 0.0, 0.0), "sweep": sweep, "plane": plane}
    start = tuple(at(ends)[0].tolist())
    nominal, wider = (
        toolpath(rapid(*start), arc(*at(ends, more)[1], **move), start=start) for more in (0.0, 0.03)
    )
    got = measure(nominal, nominal.end_mm, wider, np.arange(2), np.ones(2, bool), model, 1e-4)
    share = np.linspace(0, 1, FINE)
    tip = at(share, 0.03)
    tip += tip @ grows + shift
    away = np.hypot(np.hypot(tip[:, axes[0]], tip[:, axes[1]]) - 80, tip[:, axes[2]])
    away[[0, -1]] = np.linalg.norm(tip[[0, -1]] - at(ends), axis=1)
    assert got.path[1] == pytest.approx(away.max(), rel=2e-3)


def test_an_arc_begins_with_its_own_tool() -> None:
    """The tool before it lies 3 um aside, which counts as for any cut; along the arc it would be more."""
    frames = (Frame(tool_mm=(0.0, 0.0, 300.0)), Frame(tool_mm=(0.0, 0.0, -300.0)))
    move = arc(5, 5, 0, centre=(5, 0, 0), sweep=-math.pi / 2, frame=1)
    path = toolpath(line(-9, 0, 0), line(0, 0, 0), move, line(9, 5, 0, frame=1), frames=frames)
    got = measure(path, path.end_mm, path, np.arange(4), np.ones(4, bool), Known(), 1e-4)
    assert got.path == pytest.approx([0.003] * 4, rel=1e-5)


def test_an_arc_the_other_way_round_is_far_off_all_along() -> None:
    """It lies on the circle of its nominal arc, but up to 135 degrees beyond the ends of that."""
    end = {"centre": (0.0, 0.0, 0.0)}
    nominal, wrong = (
        toolpath(rapid(10, 0, 0), arc(0, 10, 0, sweep=sweep, **end), start=(10, 0, 0))
        for sweep in (math.pi / 2, -1.5 * math.pi)
    )
    got = measure(nominal, nominal.end_mm, wrong, np.arange(2), np.ones(2, bool), Known(), 1e-4)
    assert got.path[1] > 15.0
