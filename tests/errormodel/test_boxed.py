"""The box of a model, and the arrays that a caller gives."""

from __future__ import annotations

import numpy as np
import pytest

from olp.core.errors import UsageError
from olp.errormodel.boxed import Boxed, as_points, as_tool, payload_of
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Thermal
from olp.errormodel.chain import RigidBody
from olp.errormodel.gridded import ComponentTable
from olp.errormodel.sources.maps import DeviationMap

BOX = np.array([[0.0, 100.0], [-300.0, 300.0], [-400.0, 0.0]])
TOOL = np.array([5.0, -6.0, -70.0])


def test_a_box_holds_its_faces() -> None:
    for hold in (False, True):
        boxed = Boxed(BOX, hold)
        points = np.array([[0.0, 300.0, -400.0], [-1.0, 301.0, 1.0], [np.nan, -301.0, -401.0]])
        np.testing.assert_array_equal(boxed.inside(points), [[True, True, True], [False] * 3, [False] * 3])
        clamped = [[0.0, 300.0, -400.0], [0.0, 300.0, 0.0], [np.nan, -300.0, -400.0]]
        np.testing.assert_array_equal(boxed.clamped(points), clamped if hold else points)
    with pytest.raises(UsageError, match=r"axis_mm has shape \(3,\); expected \(n, 3\), one row X, Y, Z"):
        Boxed(BOX, hold=True).inside(np.zeros(3))


def test_rows_of_a_caller() -> None:
    assert as_points([[1, 2, 3]]).dtype == np.float64
    for wrong in (np.zeros(3), np.zeros((2, 2)), np.zeros((1, 1, 3)), np.zeros((3, 4))):
        with pytest.raises(UsageError, match="play has shape"):
            as_points(wrong, "play")
    assert as_points(np.zeros((0, 3))).shape == (0, 3)


def test_tools_of_a_caller_with_and_without_a_payload() -> None:
    for given, vector, payload in (
        ([1, 2, 3], [1, 2, 3], 0.0),
        ([1, 2, 3, 4], [1, 2, 3], 4.0),
        ([[1, 2, 3], [5, 6, 7]], [[1, 2, 3], [5, 6, 7]], 0.0),
        ([[1, 2, 3, 4], [5, 6, 7, 8]], [[1, 2, 3], [5, 6, 7]], [4, 8]),
    ):
        np.testing.assert_array_equal(as_tool(given, 2), np.array(vector, float))
        np.testing.assert_array_equal(payload_of(given), payload)
        assert as_tool(given, 2).dtype == np.asarray(payload_of(given)).dtype == np.float64
    for wrong in (np.zeros(2), np.zeros(5), np.zeros((3, 3)), np.zeros((2, 2)), np.zeros((1, 4))):
        with pytest.raises(
            UsageError, match=r"expected \(3,\) or \(2, 3\), or a fourth column with the payload"
        ):
            as_tool(wrong, 2)


@pytest.mark.parametrize("chain", ["FXYZ", "XFYZ"])
def test_wrong_rows_are_named(chain: str) -> None:
    curve = Curve("X", BOX[0], {"EXX": [0.0, 1.0], "EBX": [0.0, 1e-5]})
    table = ComponentTable("X", ("X",), (BOX[0],), {"EZX": [0.0, 1e-3]})
    described = DeviationMap(tuple(BOX), np.ones((2, 2, 2, 3)))  # type: ignore[arg-type]
    warm = Thermal((1e-5, 0.0, 0.0), scale_degC=(25.0, 20.0, 20.0))
    for parts in ({"curves": (curve,)}, {"compliance": (table,)}, {"maps": (described,)}, {"thermal": warm}):
        model = build(Calibration("m", BOX, **parts), chain)  # type: ignore[arg-type]
        rows = np.zeros((2, 3))
        for call in (
            lambda m=model: m.error(np.zeros(3), TOOL),
            lambda m=model: m.rotation(np.zeros(3)),
            lambda m=model: m.inside(np.zeros((2, 2))),
            lambda m=model: list(m.contributions(np.zeros(3), TOOL)),
        ):
            with pytest.raises(UsageError, match="axis_mm has shape"):
                call()
        if "maps" not in parts:
            with pytest.raises(UsageError, match="tool_mm has shape"):
                model.error(rows, np.zeros(2))
        if "thermal" not in parts:
            with pytest.raises(UsageError, match="delta_mm has shape"):
                model.chord_bound(np.zeros(3), TOOL)
    model = build(Calibration("m", BOX, curves=(curve,)), chain)
    for call in (
        lambda: model.error(rows, TOOL, np.zeros(3)),
        lambda: model.rotation(rows, np.zeros(3)),
        lambda: list(model.contributions(rows, TOOL, np.zeros(3))),
    ):
        with pytest.raises(UsageError, match="play has shape"):
            call()


def test_the_model_that_holds_has_the_bodies_of_the_one_that_refuses() -> None:
    calibration = Calibration(machine="m", box_mm=BOX)
    refusing, holding = (build(calibration, "FXYZ", outside=outside) for outside in ("refuse", "hold"))
    assert isinstance(refusing, RigidBody)
    assert isinstance(holding, RigidBody)
    assert refusing.bodies is holding.bodies
    other = build(calibration, "YFXZ")
    assert isinstance(other, RigidBody)
    assert other.bodies[0].axis == 2
    assert other.bodies is not holding.bodies
