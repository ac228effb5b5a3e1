"""A calibration refuses what contradicts itself, and says everything that is wrong at once."""

from __future__ import annotations

import math

import numpy as np
import pytest

from olp.core.errors import ConfigError
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic, Thermal

BOX = np.array([[0.0, 100.0]] * 3)
X = [0.0, 50.0, 100.0]


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"axis": "W"}, "axis 'W'"),
        ({"position_mm": [0.0]}, "1 positions"),
        ({"position_mm": [0.0, 50.0, 50.0]}, "strictly increase"),
        ({"columns": {}}, "expected columns"),
        ({"forward": {"EXX": [0, 0, 0]}, "backward": {"EXX": [0, 0, 0]}}, "expected columns"),
        ({"columns": {}, "forward": {"EXX": [0, 0, 0]}}, "both directions"),
        ({"columns": {"EXY": [0, 0, 0]}}, "'EXY'"),
        ({"columns": {"EDX": [0, 0, 0]}}, "'EDX'"),
        ({"columns": {"EXX": [0, math.nan, 0]}}, "finite"),
        ({"columns": {"EXX": [0, 0]}}, "EXX"),
        ({"interpolation": "cubic"}, "'cubic'"),
        ({"reference": "floor"}, "'floor'"),
        ({"line_mm": (0.0, math.inf, 0.0)}, "line_mm"),
    ],
)
def test_a_bad_curve_is_refused(options: dict[str, object], expected: str) -> None:
    with pytest.raises(ConfigError, match=expected):
        Curve(**({"axis": "X", "position_mm": X, "columns": {"EXX": [0, 0, 0]}} | options))


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"box_mm": np.zeros((2, 2))}, "box_mm"),
        ({"box_mm": BOX[:, ::-1]}, "box_mm"),
        ({"box_mm": BOX * 2.0}, "expected all of the box"),
        ({"model": "soft"}, "'soft'"),
        ({"squareness": {"C0X": 0.0}}, "C0X"),
        ({"squareness": {"C0Y": math.nan}}, "C0Y"),
        ({"backlash_mm": (math.nan, 0.0, 0.0)}, "backlash_mm"),
        ({"backlash_mm": (1e-3, 0.0, 0.0)}, "direction column"),
    ],
)
def test_a_contradiction_is_refused(options: dict[str, object], expected: str) -> None:
    curve = Curve("X", X, forward={"EXX": [0, 0, 1e-3]}, backward={"EXX": [0, 0, 2e-3]})
    with pytest.raises(ConfigError, match=expected):
        Calibration(**({"machine": "m", "box_mm": BOX, "curves": (curve,)} | options))


def test_a_component_stands_once() -> None:
    curve = Curve("X", X, {"EXX": [0, 0, 1e-3]})
    with pytest.raises(ConfigError, match="EXX is in two curves"):
        Calibration("m", BOX, curves=(curve, curve))


def test_every_problem_is_named() -> None:
    with pytest.raises(ConfigError) as caught:
        Curve("X", [1.0, 0.0], {"EXY": [0, 0], "EXX": [0, math.nan]}, interpolation="cubic")
    assert len(caught.value.problems) == 4


@pytest.mark.parametrize("bad", [("EXW", 1.0, 1.0), ("EXX", 0.0, 1.0), ("EXX", 1.0, math.nan)])
def test_a_bad_cyclic_term_is_refused(bad: tuple[str, float, float]) -> None:
    with pytest.raises(ConfigError):
        Cyclic(*bad)


def test_a_bad_temperature_is_refused() -> None:
    with pytest.raises(ConfigError):
        Thermal(workpiece_degC=math.nan)


def test_values_are_frozen_copies() -> None:
    values = np.zeros(3)
    curve = Curve("X", X, {"EXX": values})
    values[0] = 1.0
    assert curve.columns["EXX"][0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        curve.columns["EXX"][0] = 1.0


def test_a_cyclic_angle_has_its_lever_arm() -> None:
    term = Cyclic("EAY", 8.0, 2e-5, 0.3)
    model = build(Calibration("m", BOX, cyclic=(term,)), "FXYZ")
    y = np.array([1.0, 3.0, 5.5])
    points = np.stack([np.zeros(3), y, np.full(3, 60.0)], axis=1)
    angle = 2e-5 * np.sin(2.0 * np.pi * y / 8.0 + 0.3)
    error = model.error(points, np.array([0.0, 7.0, -100.0]))
    np.testing.assert_allclose(error[:, 1], -angle * (60.0 - 100.0), atol=1e-7)
    np.testing.assert_allclose(error[:, 2], angle * 7.0, atol=1e-7)
