"""What is skipped in a model."""

from __future__ import annotations

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration
from olp.errormodel.sources.maps import DeviationMap

BOX = np.array([[0.0, 100.0], [-300.0, 300.0], [-400.0, 0.0]])
POINTS = np.array([[25.0, 0.0, -100.0], [100.0, 30.0, 0.0]])
TOOL = np.array([5.0, -6.0, -70.0])


def test_names_to_skip_are_checked_and_named() -> None:
    with pytest.raises(ConfigError, match="component 'EXQ' to skip; expected ISO 230-1 names such as EXX"):
        build(Calibration("m", BOX), "FXYZ", skip_components=frozenset({"EXX", "EXQ", "C0Y"}))
    described = DeviationMap(tuple(BOX), np.ones((2, 2, 2, 3)), "total")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match='a map of kind "total" also holds C0Y, EXX, which the control'):
        build(Calibration("m", BOX, maps=(described,)), "FXYZ", skip_components=frozenset({"EXX", "C0Y"}))
    rest = DeviationMap(tuple(BOX), np.ones((2, 2, 2, 3)))  # type: ignore[arg-type]
    model = build(Calibration("m", BOX, maps=(rest,)), "FXYZ", skip_components=frozenset({"EXX"}))
    np.testing.assert_array_equal(model.error(POINTS, TOOL), np.ones((2, 3)))
    assert build(Calibration("m", BOX, maps=(described,)), "FXYZ").error(POINTS, TOOL).min() == 1.0
