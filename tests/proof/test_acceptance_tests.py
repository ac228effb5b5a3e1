"""Predicted acceptance tests of machines whose error is known by hand."""

from __future__ import annotations

import numpy as np
import pytest

from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve
from olp.proof.acceptance_tests import predicted

DIGIT_MM = 1e-4
TOOL = np.zeros(3)
PLANES = ("XY", "YZ", "ZX")


def machine(
    side_mm: float = 3000.0, slope: float = 0.0, axis: str = "X", backlash_um: float = 0.0
) -> ErrorModel:
    """A cube from -1000 mm on in which one axis is too long by `slope` of its position."""
    box = np.tile([-1000.0, -1000.0 + side_mm], (3, 1))
    nodes = box[0]
    curves = (Curve(axis, nodes, {f"E{axis}{axis}": slope * nodes}, interpolation="linear"),)
    play = tuple(1e-3 * backlash_um * (name == axis) for name in "XYZ")
    return build(Calibration("m", box, curves=curves, backlash_mm=play), "FXYZ")  # type: ignore[arg-type]


@pytest.mark.parametrize(("side_mm", "radius_mm"), [(3000.0, 150.0), (375.0, 150.0), (250.0, 100.0)])
def test_a_circle_fits_into_the_box(side_mm: float, radius_mm: float) -> None:
    circles = predicted(machine(side_mm), TOOL, DIGIT_MM)["circles"]
    assert [c["plane"] for c in circles] == list(PLANES)
    for circle in circles:
        assert circle["radius_mm"] == radius_mm
        assert circle["centre_mm"] == pytest.approx([-1000.0 + side_mm / 2] * 3)
        assert len(circle["before"]["radial_um"]) == 720


@pytest.mark.parametrize("axis", "XYZ")
def test_an_axis_that_is_too_long_makes_an_ellipse(axis: str) -> None:
    """100 um/m over a radius of 150 mm: 15 um at the two ends of the axis, and nothing across it."""
    for circle in predicted(machine(slope=1e-4, axis=axis), TOOL, DIGIT_MM)["circles"]:
        before, after, plane = circle["before"], circle["after"], circle["plane"]
        size = 15.0 if axis in plane else 0.0
        assert before["G_ccw_um"] == pytest.approx(size, abs=0.01)
        assert before["G_cw_um"] == pytest.approx(size, abs=0.01)
        assert before["H_um"] == pytest.approx(0.0, abs=0.01)
        # digits of 0.1 um are left
        assert max(after["G_ccw_um"], after["G_cw_um"]) < 0.2
        quarters = [before["radial_um"][k] for k in (0, 180, 360, 540)]
        ends = [size, 0.0, size, 0.0] if plane[0] == axis else [0.0, size, 0.0, size]
        assert quarters == pytest.approx(ends, abs=0.01)


def test_backlash_is_the_hysteresis_of_a_circle() -> None:
    circles = predicted(machine(backlash_um=10.0), TOOL, DIGIT_MM)["circles"]
    assert [c["before"]["H_um"] for c in circles] == pytest.approx([10.0, 0.0, 10.0], abs=0.1)
    # half of it on both sides of the circle
    assert [c["before"]["G_ccw_um"] for c in circles] == pytest.approx([10.0, 0.0, 10.0], abs=0.2)


def test_diagonals_of_an_axis_that_is_too_long() -> None:
    """Eighteen steps of 4.8 % of 3000 mm at 100 um/m, seen along a diagonal: 259.2 um / sqrt(3)."""
    diagonals = predicted(machine(slope=1e-4), TOOL, DIGIT_MM)["diagonals"]
    assert [row["name"] for row in diagonals["rows"]] == ["PPP", "NPP", "PNP", "NNP"]
    for row in diagonals["rows"]:
        assert row["length_mm"] == pytest.approx(3000.0 * 3**0.5)
        assert row["before"]["E_um"] == pytest.approx(259.2 / 3**0.5, abs=0.01)
        assert row["before"]["B_um"] == pytest.approx(0.0, abs=0.01)
        deviation = row["before"]["deviation_um"]
        assert len(deviation) == 21
        assert deviation[0] == 0.0
        assert deviation[-1] == pytest.approx(288.0 / 3**0.5, abs=0.01)
        assert row["after"]["E_um"] < 0.3
    assert diagonals["before"]["E_um"] == pytest.approx(259.2 / 3**0.5, abs=0.01)


def test_backlash_is_the_reversal_error_of_a_diagonal() -> None:
    diagonals = predicted(machine(backlash_um=10.0), TOOL, DIGIT_MM)["diagonals"]
    assert diagonals["before"]["B_um"] == pytest.approx(10.0 / 3**0.5, abs=0.01)
    assert diagonals["before"]["E_um"] == pytest.approx(10.0 / 3**0.5, abs=0.01)
    assert diagonals["after"]["B_um"] < 0.3


def test_the_tool_is_stated_without_its_payload() -> None:
    assert predicted(machine(), np.array([1.0, 2.0, -3.0, 40.0]), DIGIT_MM)["tool_mm"] == [1.0, 2.0, -3.0]
