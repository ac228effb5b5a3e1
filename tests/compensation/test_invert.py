"""The inverse of the error model: the tip comes to its place within 1 pm, or olp refuses."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from olp.compensation.invert import TOLERANCE_MM, invert
from olp.core.errors import NotInvertible
from olp.errormodel.base import ErrorModel
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic

BOX = np.array([[0.0, 600.0], [-200.0, 400.0], [-300.0, 100.0]])


def rough_machine(seed: int, slope: float, cyclic_mm: float) -> ErrorModel:
    """18 curves whose slopes are about `slope`, and a cyclic error of 2 mm pitch in X."""
    rng = np.random.default_rng(seed)
    curves = []
    for axis, (low, high) in zip("XYZ", BOX, strict=True):
        knots = np.linspace(low, high, 41)
        rise = rng.uniform(-slope, slope, (len(knots), 6)) * (knots[1] - knots[0])
        values = np.cumsum(rise * ([1.0] * 3 + [2e-3] * 3), axis=0)
        names = [f"E{d}{axis}" for d in "XYZABC"]
        columns = dict(zip(names, values.T, strict=True))
        curves.append(Curve(axis, knots, columns, line_mm=(0.0, 0.0, 0.0)))
    terms = (Cyclic("EXX", 2.0, cyclic_mm, 0.3),) if cyclic_mm else ()
    return build(Calibration("rough", BOX, curves=tuple(curves), cyclic=terms), "YFXZ")


@settings(max_examples=40)
@given(
    seed=st.integers(0, 10_000),
    slope=st.sampled_from([1e-6, 1e-4, 1e-3, 1e-2]),
    cyclic_mm=st.sampled_from([0.0, 1e-3, 0.02]),
    count=st.integers(1, 400),
)
@pytest.mark.slow
def test_the_tip_comes_to_its_place(seed: int, slope: float, cyclic_mm: float, count: int) -> None:
    model = rough_machine(seed, slope, cyclic_mm)
    target = np.random.default_rng(seed).uniform(BOX[:, 0], BOX[:, 1], (count, 3))
    tool = np.array([10.0, -20.0, -150.0])
    command = invert(model, target, tool)
    residual = np.abs(command + model.error(command, tool) - target).max()
    # sums of numbers of 1e3 mm carry 1e-13 mm
    assert residual <= TOLERANCE_MM + 1e-12


def test_an_error_that_grows_faster_than_the_position_is_refused() -> None:
    model = rough_machine(1, 1e-4, 1.0)
    target = np.random.default_rng(1).uniform(BOX[:, 0], BOX[:, 1], (50, 3))
    with pytest.raises(NotInvertible, match="grow as fast"):
        invert(model, target, np.zeros(3))
