"""Lever arms by hand: which coordinates move, and from where they count."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from olp.errormodel.calibration import Curve
from olp.errormodel.lever_arms import CROSS, LeverArm, Measurement, lever_arms_of, measured_as

DATUM = (10.0, 20.0, 30.0)
ENDS = [0.0, 100.0]
ALL = (0, 1, 2)


def curve(*names: str, **more: Any) -> Curve:
    options = {"line_mm": (1.0, 2.0, 3.0), "tool_mm": (4.0, 5.0, 6.0)} | more
    return Curve(names[0][2], ENDS, {name: [1.0, 1.0] for name in names}, **options)


def arms(
    *curves: Any, axis: str = "X", after: str = "YZ", carries: bool = False, tool_terms: bool = True
) -> Any:
    return lever_arms_of(curves, DATUM, axis, after, carries, tool_terms)


@pytest.mark.parametrize(
    ("measured", "options", "moves", "offset"),
    [
        # the axes behind count from the line, all coordinates from the tool; X is an argument
        (curve("EXX"), {}, (False, True, True), (4.0, 7.0, 9.0)),
        (curve("EXX"), {"after": "Z"}, (False, False, True), (4.0, 5.0, 9.0)),
        (curve("EXX"), {"after": ""}, (False, False, False), (4.0, 5.0, 6.0)),
        (curve("EXX"), {"tool_terms": False}, (False, True, True), (0.0, 2.0, 3.0)),
        (curve("EXX", line_mm=None), {}, (False, True, True), (4.0, 25.0, 36.0)),
        # an axis that carries the workpiece moves under a reflector that is fixed on it, from the datum on
        (curve("EXX"), {"carries": True}, (False, True, True), (4.0, 7.0, 9.0)),
        (curve("EXX", reference="table"), {"carries": True}, (True, True, True), (14.0, 7.0, 9.0)),
        (curve("EXX", reference="table"), {"carries": False}, (False, True, True), (4.0, 7.0, 9.0)),
        # tabled by the position of another axis, that one has no arm, and the own one may
        (Measurement(("EXX",), ("Z",), (1.0, 2.0, 3.0)), {}, (False, True, False), (0.0, 2.0, 0.0)),
        (
            Measurement(("EXX",), ("Z",), (1.0, 2.0, 3.0)), {"carries": True}, (True, True, False),
            (1.0, 2.0, 0.0),
        ),
        (Measurement(("EXX",), ("X", "Y", "Z")), {"carries": True}, (False, False, False), (0.0, 0.0, 0.0)),
    ],
)  # fmt: skip
def test_a_lever_arm_counts_from_where_its_axis_was_measured(
    measured: Any, options: dict[str, Any], moves: tuple[bool, ...], offset: tuple[float, ...]
) -> None:
    assert arms(measured, **options) == ((ALL, LeverArm(moves, offset)),)


def test_without_curves_a_lever_arm_counts_from_the_datum() -> None:
    assert arms() == ((ALL, LeverArm((False, True, True), (0.0, 20.0, 30.0))),)
    assert arms(carries=True) == arms()
    on_y = LeverArm((False, False, True), (0.0, 0.0, 30.0))
    assert arms(axis="Y", after="Z", carries=True) == ((ALL, on_y),)


def test_a_translation_counts_from_its_own_file_and_a_row_without_one_from_those_of_its_angles() -> None:
    straight = curve("EXX", "EAX")
    yaw = curve("ECX", line_mm=(0.0, 70.0, 80.0), tool_mm=(7.0, 8.0, 9.0))
    pitch = curve("EBX", line_mm=(0.0, 40.0, 50.0), tool_mm=(1.0, 1.5, 2.0))
    moves = (False, True, True)
    row_x = LeverArm(moves, (4.0, 7.0, 9.0))
    # row Y: EAX acts on its z and ECX on its x; the y, on which nothing acts, counts from the datum
    row_y = LeverArm(moves, (7.0, 20.0, 9.0))
    # row Z: EAX acts on its y and EBX on its x
    row_z = LeverArm(moves, (1.0, 7.0, 30.0))
    assert arms(straight, yaw, pitch) == (((0,), row_x), ((1,), row_y), ((2,), row_z))
    # rows with the same lever arm are one
    same = curve("EYX", "EZX")
    both = arms(straight, same)
    assert both == ((ALL, row_x),)


def test_coordinates_of_a_lever_arm() -> None:
    arm = LeverArm((True, False, True), (1.0, 2.0, 3.0))
    position = [np.array([10.0, 20.0]), np.array([30.0, 40.0]), np.array([50.0, 60.0])]
    x, y, z = arm.at(position, [100.0, 200.0, np.array([300.0, 400.0])])
    np.testing.assert_array_equal(x, [109.0, 119.0])
    assert y == 198.0
    np.testing.assert_array_equal(z, [347.0, 457.0])


def test_the_reach_of_a_lever_arm_is_its_largest_coordinate_in_the_box_with_any_tool() -> None:
    box = np.array([[-5.0, 10.0], [0.0, 1000.0], [-100.0, 20.0]])
    arm = LeverArm((True, False, True), (1.0, 2.0, 3.0))
    tools = np.array([[0.0, 0.0, 0.0], [-20.0, 7.0, 60.0]])
    # x: -5 - 1 - 20 = -26; y: 7 - 2 or -2; z: -103, or 20 + 60 - 3 = 77
    np.testing.assert_array_equal(arm.reach_mm(box, tools), [26.0, 5.0, 103.0])
    np.testing.assert_array_equal(arm.reach_mm(box, tools[:1]), [9.0, 2.0, 103.0])
    np.testing.assert_array_equal(arm.reach_mm(box, tools[1:]), [26.0, 5.0, 77.0])


def test_the_signs_are_those_of_the_cross_product() -> None:
    rng = np.random.default_rng(1)
    angles, arm = rng.normal(size=3), rng.normal(size=3)
    moved = np.zeros(3)
    for i, a, k, sign in CROSS:
        moved[i] += sign * angles[a] * arm[k]
    np.testing.assert_allclose(moved, np.cross(angles, arm))
    assert len(CROSS) == 6


def test_how_a_term_was_measured_is_as_of_the_curves_unless_it_is_stated() -> None:
    one = curve("EXX", reference="table")
    stated = {"tool_mm": (7.0, 7.0, 7.0)}
    assert measured_as([one], "X", {}) == (
        Measurement(("EXX",), ("X",), (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), "table"),
    )
    assert measured_as([one], "X", stated) == (
        Measurement(("EXX",), ("X",), (1.0, 2.0, 3.0), (7.0, 7.0, 7.0), "table"),
    )
    plain = Measurement((), ("Y",), None, (0.0, 0.0, 0.0), "functional-point")
    assert measured_as([], "Y", {}) == (plain,)
    assert measured_as([], "Y", {"reference": "table", "line_mm": (0.0, 1.0, 2.0)}) == (
        Measurement((), ("Y",), (0.0, 1.0, 2.0), (0.0, 0.0, 0.0), "table"),
    )
