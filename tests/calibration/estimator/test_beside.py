"""Readings at positions that no line read count what the curves hide there as noise."""

from __future__ import annotations

import numpy as np
import pytest
from cases.blunders import ALARMS, clean_fit
from cases.calibration import measurements_of
from judge import families, simulated

from olp.calibration.estimator.adjustment import fit
from olp.calibration.observations.points import Points, PointsState


def test_what_curves_hide_is_noise_of_points_with_their_lever_arms() -> None:
    """In a chain FXYZ the arm of X is tool, Y and Z, that of Y is tool and Z, that of Z the tool."""
    machine = families.machine(3, "screws")
    zero = (0.0, 0.0, 0.0)
    lines = simulated.all_lines(machine, 3, runs=2, line_mm=zero, tool=zero, count=(5, 5, 5))
    fitted = fit(measurements_of(lines), "FXYZ")
    position = np.random.default_rng(8).uniform(*machine.box.T, (6, 3))
    tool = np.array([80.0, -40.0, -200.0])
    state = PointsState(Points(position, tool, position + tool, 1e-3))
    (chunk,) = fitted.block(state).chunks()
    expected = np.full((6, 3), 1e-6)
    for axis, letter in enumerate("XYZ"):
        arm = tool + position * (np.arange(3) > axis)
        for name, hidden in fitted.prior.hidden.items():
            if name[2] == letter:
                turned = np.eye(3)["XYZABC".index(name[1]) % 3]
                moved = turned + 0.0 * arm if name[1] in "XYZ" else np.cross(turned, arm)
                expected += hidden.at(position[:, axis])[:, None] * moved**2
    spread = np.hypot(chunk.sigma, np.asarray(chunk.beside))
    assert spread.reshape(6, 3) == pytest.approx(np.sqrt(expected), rel=1e-9)
    assert spread.min() > 1.5e-3
    assert chunk.rows.shape == (18, fitted.parameters.size)


@pytest.mark.slow
def test_waves_of_screws_beside_targets_contradict_nothing() -> None:
    """Circles and diagonals read them, lines do not."""
    _, clean = clean_fit(77, "screws", "circles")
    assert not {finding.code for finding in clean.findings} & set(ALARMS)
