"""The chord bound of a chain, worked by hand; `test_chord` shows that it is never exceeded."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from olp.errormodel.bodies import build_bodies
from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Cyclic
from olp.errormodel.chain_bound import AxisBound, axis_bounds, chord_bound
from olp.errormodel.chord import LOWER_MM, UPPER_MM, bins

BOX = np.array([[0.0, 800.0], [-300.0, 300.0], [-400.0, 0.0]])
NO_TOOL = np.zeros((1, 3))


def at(values: np.ndarray, length_mm: float) -> float:
    return float(values[bins(np.array([length_mm]))[0]])


def test_the_bound_of_an_axis_is_read_off_its_tables() -> None:
    """min(curvature / 8 (d^2 + 2 h min(d, h)), smooth) + d (kinks + sum of change_k |delta_k|)."""
    smooth, kinks = 1e-2 * UPPER_MM, 1e-3 + 0.0 * UPPER_MM
    along_x, along_z = 2e-4 + 0.0 * UPPER_MM, np.where(UPPER_MM > 4.0, 3e-4, 7e-4)
    bound = AxisBound(1, 0.5, 8.0, smooth, kinks, (along_x, None, along_z))
    lengths = [np.array([10.0, 10.0, 10.0, 0.0]), np.array([0.25, 5.0, 1e-3, 0.0]), np.array([20.0] * 4)]
    # below the cell d^2 + 2 h d = 0.3125 exceeds what the table says, 2.8125e-3; 1e-3 mm does not: 1.001e-3
    small = 1e-6 + 2.0 * 0.5 * 1e-3
    table = [1e-2 * 0.28125, 1e-2 * 5.5, min(small, 1e-2 * float(at(UPPER_MM, 1e-3))), 0.0]
    cross = [
        0.25 * (1e-3 + 2e-4 * 10 + 7e-4 * 20),
        5 * (1e-3 + 2e-3 + 6e-3),
        1e-3 * (1e-3 + 2e-3 + 14e-3),
        0.0,
    ]
    np.testing.assert_allclose(bound.at(lengths), np.add(table, cross), rtol=1e-12)
    plain = AxisBound(1, 0.5, 1e-4, np.full(320, 9.0), None, (None, None, None))
    # d^2 + 2 h min(d, h): 0.0625 + 0.25, 25 + 0.5
    np.testing.assert_allclose(
        plain.at(lengths), np.array([0.3125, 25.5, small, 0.0]) * 1e-4 / 8.0, rtol=1e-12
    )
    np.testing.assert_allclose(
        chord_bound([plain, bound], np.array([[-10.0, -0.25, 20.0], [10.0, 5.0, -20.0]])),
        (bound.at(lengths) + plain.at(lengths))[:2], rtol=1e-12,
    )  # fmt: skip


def test_moves_beyond_one_block_are_bounded_too() -> None:
    bound = AxisBound(0, 1.0, 1e-3, np.full(320, 9.0), None, (None, None, None))
    delta = np.random.default_rng(2).normal(size=(20000, 3))
    d = np.abs(delta[:, 0])
    np.testing.assert_allclose(
        chord_bound([bound], delta), 1e-3 / 8.0 * (d * d + 2.0 * np.minimum(d, 1.0)), rtol=1e-12
    )


#: A kink of 4e-5 and of 5e-8 per mm at X 400; a turn about X of Z that does not change; backlash of Y.
def machine(angle: float = 1.0, **more: Any) -> Calibration:
    curves = (
        Curve(
            "X", [0.0, 400.0, 800.0],
            {"EXX": [0.0, 8e-3, 0.0], "EBX": [0.0, angle * 1e-5, 0.0]},
            line_mm=(0.0, 40.0, -100.0), tool_mm=(0.0, 0.0, -60.0), interpolation="linear",
        ),
        Curve("Z", [-400.0, 0.0], {"EAZ": [-3e-6 * angle] * 2}, tool_mm=(0.0, 7.0, -20.0)),
    )  # fmt: skip
    return Calibration("m", BOX, datum_mm=(100.0, -50.0, 0.0), curves=curves, **more)


TOOLS = np.array([[30.0, -5.0, -150.0], [-20.0, 15.0, -90.0]])
#: Arms of EBX: row X z + t_z + 160, row Z t_x (X does not move its own tip); of EAZ: t_z + 20 and t_y - 7.
REACH_X, REACH_Z = 390.0, 30.0


@pytest.mark.parametrize("chain", ["FXYZ", "XFYZ"])
def test_to_first_order_a_chain_departs_by_its_kinks_on_their_lever_arms(chain: str) -> None:
    bodies = build_bodies(machine(), chain, frozenset())
    bounds = axis_bounds(bodies, BOX, TOOLS, second_order=False)
    assert [bound.axis for bound in bounds] == [0]
    # what is tabled by X has no arm along X, whatever X carries
    rows = 4e-5 + 5e-8 * REACH_X, 5e-8 * REACH_Z
    kinks, change = 0.25 * math.hypot(*rows), 0.25 * 2.5e-8
    delta = np.array([[10.0, 7.0, -30.0], [0.0, 9.0, 9.0], [200.0, 0.0, 0.0]])
    expected = [10.0 * (kinks + change * 30.0), 0.0, 200.0 * kinks]
    np.testing.assert_allclose(chord_bound(bounds, delta), expected, rtol=1e-12)
    # from 400 mm on, EBX changes by no more than its range of 1e-5
    far = chord_bound(bounds, np.array([[512.0, 0.0, 1.0]]))
    np.testing.assert_allclose(far, 512.0 * (kinks + 0.25 * 1e-5 / 512.0), rtol=1e-12)


@pytest.mark.parametrize("angle", [1.0, 1000.0])
def test_second_order_terms_widen_arms_slopes_and_translations(angle: float) -> None:
    """By the formulas of `chain_bound`, with squareness and backlash as displacements."""
    calibration = machine(angle, squareness={"C0Y": -2e-4 * angle}, backlash_mm=(0.0, 0.05, 0.0))
    (bound,) = axis_bounds(build_bodies(calibration, "FXYZ", frozenset()), BOX, TOOLS, second_order=True)
    b, a, shear = 1e-5 * angle, 3e-6 * angle, 2e-4 * angle
    # (row, coordinate) of X: z and y (y + t_y - 40) move, x does not; of Z: the tool alone
    arms_x = np.array([[30.0, 345.0, 390.0]] * 3)
    arms_z = np.array([[30.0, 12.0, 130.0]] * 3)
    farthest = arms_x[0].sum() + arms_z[0].sum() + (30.0 + 15.0 + 550.0)
    total = a + b
    extra = 4.0 * total * (1.0 + total)
    slopes = 2e-5 + shear + (b / 400.0 * arms_x.sum() + b) + a
    displaced = 8e-3 + 0.05 + shear * 350.0 + b * arms_x.sum() + a * arms_z.sum()
    widened = displaced + extra * farthest
    jump_t, jump_b, change = 4e-5, 5e-8 * angle, 2.5e-8 * angle
    rows = jump_t * (1.0 + extra) + jump_b * (390.0 + widened), jump_b * widened, jump_b * (30.0 + widened)
    stretch = (extra + 2.0 * slopes) * change
    expected = 0.25 * (math.hypot(*rows) + stretch * (10.0 + 7.0) + (change + stretch) * 30.0)
    lengths = [np.array([10.0]), np.array([7.0]), np.array([30.0])]
    assert bound.at(lengths)[0] == pytest.approx(10.0 * expected, rel=1e-12)
    # of one tool it is less than between two of them
    bodies = build_bodies(calibration, "FXYZ", frozenset())
    own = [axis_bounds(bodies, BOX, tool[None], second_order=True)[0].at(lengths)[0] for tool in TOOLS]
    assert max(own) < 10.0 * expected
    model = build(calibration, "FXYZ")
    got = model.chord_bound(np.array([[-10.0, 7.0, 30.0]] * len(TOOLS)), TOOLS)
    np.testing.assert_allclose(got, own, rtol=1e-12)


def test_two_turns_on_one_moving_arm_join_as_one_length() -> None:
    """EBX and EAX on the arm z: changes 2e-8 and 1.5e-8 per mm."""
    curve = Curve(
        "X", BOX[0], {"EAX": [0.0, 1.2e-5], "EBX": [0.0, 1.6e-5]}, line_mm=(0.0, 0.0, 0.0),
        interpolation="linear",
    )  # fmt: skip
    bodies = build_bodies(Calibration("m", BOX, curves=(curve,)), "FXYZ", frozenset())
    (bound,) = axis_bounds(bodies, BOX, NO_TOOL, second_order=False)
    assert bound.kinks is None
    # along Y the arm of EAX on row Z alone
    expected = 10.0 * 0.25 * (2.5e-8 * 30.0 + 1.5e-8 * 7.0)
    np.testing.assert_allclose(chord_bound([bound], np.array([[10.0, 7.0, 30.0]])), [expected], rtol=1e-12)


def test_smooth_errors_count_by_curvature_on_their_arms() -> None:
    """A sine of 2 um along X and one of 5 urad about Y, 390 and 30 mm long."""
    terms = (
        Cyclic("EXX", 10.0, 2e-3),
        Cyclic("EBX", 10.0, 5e-6, 0.3, (0.0, 40.0, -100.0), (0.0, 0.0, -60.0)),
    )
    line = Curve("X", BOX[0], {"EYX": [0.0, 0.0]}, line_mm=(0.0, 40.0, -100.0), tool_mm=(0.0, 0.0, -60.0))
    bodies = build_bodies(Calibration("m", BOX, cyclic=terms, curves=(line,)), "FXYZ", frozenset())
    (bound,) = axis_bounds(bodies, BOX, TOOLS, second_order=False)
    size, rate = math.hypot(2e-3 + 5e-6 * 390.0, 5e-6 * 30.0), 2.0 * math.pi / 10.0
    assert bound.curvature == pytest.approx(size * rate**2)
    np.testing.assert_allclose(bound.smooth, np.minimum(size * rate**2 * UPPER_MM**2 / 8.0, 2.0 * size))
    assert bound.kinks is None
    change = 0.25 * np.minimum(5e-6 * rate, 1e-5 / LOWER_MM)
    np.testing.assert_allclose(bound.change[2], change)
    assert bound.change[:2] == (None, None)


def test_axes_that_do_not_bend_have_no_bound() -> None:
    still = Curve("X", BOX[0], {"EXX": [1e-3, 1e-3], "EBX": [1e-5, 1e-5]})
    bodies = build_bodies(Calibration("m", BOX, curves=(still,)), "FXYZ", frozenset())
    assert axis_bounds(bodies, BOX, NO_TOOL, second_order=True) == []
