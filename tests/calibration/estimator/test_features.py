"""Features of curves: steps at the joints of rails."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from olp.calibration.estimator.basis import Step
from olp.calibration.estimator.model import Model
from olp.calibration.observations.base import Noise
from olp.calibration.observations.lines import Line
from olp.calibration.observations.measurements import Measurements

AT = np.linspace(0.0, 1000.0, 9)


def steps(component: str, lines: list[Line]) -> list[tuple[float, float]]:
    """Between which targets a component may have a step."""
    model = Model.of(
        Measurements("mill", tuple(lines)), lines, [(line, Noise(line.sigma, 0.0, None)) for line in lines],
        "YFXZ", ((0.0, 1000.0),) * 3, (0.0, 0.0, 0.0), 16, lambda *_: None,
    )  # fmt: skip
    features = model.shapes[component].features
    return [(step.low_mm, step.high_mm) for step in features if isinstance(step, Step)]


@pytest.mark.slow
def test_a_step_of_an_angle_may_hide_that_of_a_displacement_read_on_the_table() -> None:
    """A joint of rails at 440 mm turns the table by 20 urad, and moves it by 8.8 um: a reflector on it shows
    neither."""
    turned = Line("ECY", AT, 20e-6 * (AT > 440.0), np.ones(9), np.ones(9), (0.0, 0.0, 0.0), sigma=2e-7)
    on_table = Line(
        "EXY", AT, np.zeros(9), np.ones(9), np.ones(9), (0.0, 0.0, 0.0), reference="table", sigma=2e-4
    )
    joint = [(375.0, 500.0)]
    assert steps("ECY", [turned, on_table]) == steps("EXY", [turned, on_table]) == joint
    assert steps("EXY", [turned, dataclasses.replace(on_table, reference="functional-point")]) == []
