"""The component errors of one axis: table, directions, cyclic terms and bounds."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from olp.errormodel.bodies import Body, build_bodies
from olp.errormodel.calibration import Calibration, Curve, Cyclic

BOX = np.array([[0.0, 100.0], [-300.0, 300.0], [-400.0, 0.0]])
NONE: frozenset[str] = frozenset()
X = np.array([0.0, 25.0, 50.0, 100.0])


def body(axis: str = "X", chain: str = "FXYZ", skip: frozenset[str] = NONE, **parts: Any) -> Body:
    bodies = build_bodies(Calibration("m", BOX, **parts), chain, skip)
    return next(b for b in bodies if b.axis == "XYZ".index(axis))


def values(one: Body, q: list[float], play: float | None = None) -> list[Any]:
    states = None if play is None else np.full(len(q), play)
    six = one.components.evaluate(np.array(q), states)
    return [None if v is None else np.broadcast_to(v, (len(q),)).tolist() for v in six]


def curve(**more: Any) -> Curve:
    return Curve(
        "X", X, {"EYX": [1.0, 2.0, 4.0, 4.0], "EBX": [0.0, 0.0, 1e-3, 1e-3]}, interpolation="linear", **more
    )


def test_components_are_straight_between_their_positions_and_none_without_a_curve() -> None:
    one = body(curves=(curve(),))
    assert values(one, [0.0, 5.0, 60.0, 100.0, -9.0, 120.0]) == [
        None, pytest.approx([1.0, 1.2, 4.0, 4.0, 1.0, 4.0]), None,
        None, pytest.approx([0.0, 0.0, 1e-3, 1e-3, 0.0, 1e-3]), None,
    ]  # fmt: skip
    assert one.components.varies == (False, True, False, False, True, False)
    assert values(body("Y", curves=(curve(),)), [0.0]) == [None] * 6
    assert one.components.backlash_at(np.zeros(1)) is None
    assert (one.components.axis, one.components.backlash_mm) == (0, 0.0)


def test_what_is_skipped_or_zero_everywhere_is_none() -> None:
    assert values(body(curves=(curve(),), skip=frozenset({"EYX"})), [60.0])[1] is None
    zero = Curve("X", X, {"EXX": np.zeros(4), "EYX": [0.0, 0.0, 0.0, 1.0]})
    assert values(body(curves=(zero,)), [100.0]) == [None, [1.0], None, None, None, None]
    constant = body(curves=(Curve("X", X, {"EXX": np.full(4, 2.0)}),))
    assert values(constant, [7.0])[0] == [2.0]
    assert constant.components.varies == (False,) * 6
    assert constant.components.variation[0] is not None


def test_directions_are_a_mean_and_a_half_difference_with_the_play() -> None:
    """Forward 1, 3, 3, 3 and backward 5, 5, 5, 9: half differences -2, -1, -1, -3."""
    both = Curve("X", X, forward={"EXX": [1.0, 3.0, 3.0, 3.0]}, backward={"EXX": [5.0, 5.0, 5.0, 9.0]},
                 interpolation="linear")  # fmt: skip
    one = body(curves=(both,))
    q = [0.0, 25.0, 75.0]
    assert values(one, q)[0] == [3.0, 4.0, 5.0]
    assert values(one, q, 1.0)[0] == [1.0, 3.0, 3.0]
    assert values(one, q, -1.0)[0] == [5.0, 5.0, 7.0]
    assert values(one, q, 0.5)[0] == [2.0, 3.5, 4.0]
    # backward minus forward
    np.testing.assert_allclose(one.components.backlash_at(np.array(q)), [4.0, 2.0, 4.0])
    # the same in both directions has no play; a half difference without a mean has no mean
    same = body(curves=(Curve("X", X, forward={"EXX": X}, backward={"EXX": X}),))
    assert same.components.half == (None,) * 6 and same.components.backlash_at(np.zeros(1)) is None
    apart = body(curves=(Curve("X", X, forward={"EYX": X}, backward={"EYX": -X}, interpolation="linear"),))
    assert values(apart, [50.0]) == [None] * 6
    assert values(apart, [50.0], -1.0)[1] == [-50.0]
    assert apart.components.varies[1] and apart.components.backlash_at(np.zeros(1)) is None


def test_a_backlash_acts_on_its_own_axis_by_half_against_the_play() -> None:
    for axis, j in (("X", 0), ("Y", 1), ("Z", 2)):
        one = body(axis, backlash_mm=(4e-3, 6e-3, 8e-3))
        amount = (4e-3, 6e-3, 8e-3)[j]
        assert values(one, [0.0], 1.0) == [[-0.5 * amount] if d == j else None for d in range(6)]
        assert values(one, [0.0]) == [None] * 6
        assert one.components.backlash_at(np.zeros(1)) == amount
        assert one.components.varies == (False,) * 6


def test_sources_are_named_and_add_up() -> None:
    both = Curve("X", X, forward={"EYX": [1.0] * 4, "EBX": [3e-3] * 4},
                 backward={"EYX": [5.0] * 4, "EBX": [1e-3] * 4})  # fmt: skip
    terms = (Cyclic("EXX", 10.0, 2e-3), Cyclic("EXY", 10.0, 2e-3), Cyclic("EXX", 7.0, 0.0))
    one = body(curves=(both,), cyclic=terms, backlash_mm=(0.0, 0.0, 6e-3))
    q, play = np.array([2.5, 5.0]), np.array([1.0, -0.5])
    parts = one.components.sources(q, play)
    assert [name for name, _ in parts] == ["EYX", "EBX", "cyclic EXX", "backlash X"]
    for d in range(6):
        total = sum((np.zeros(2) + six[d] for _, six in parts if six[d] is not None), np.zeros(2))
        value = one.components.evaluate(q, play)[d]
        np.testing.assert_allclose(total, 0.0 if value is None else value, atol=1e-18)
    named = dict(parts)
    np.testing.assert_allclose(named["backlash X"][1], [-2.0, 1.0])
    np.testing.assert_allclose(named["backlash X"][4], [1e-3, -0.5e-3])
    np.testing.assert_allclose(named["cyclic EXX"][0], [2e-3, 0.0], atol=1e-15)
    assert [name for name, _ in one.components.sources(q, None)] == ["EYX", "EBX", "cyclic EXX"]
    (lost,) = body("Z", backlash_mm=(0.0, 0.0, 6e-3)).components.sources(q, play)
    assert lost[0] == "backlash Z"
    np.testing.assert_allclose(lost[1][2], [-3e-3, 1.5e-3])
    assert body("Y", curves=(both,)).components.sources(q, play) == []


def test_a_cyclic_term_adds_to_its_component_and_makes_it_vary() -> None:
    term = Cyclic("EBX", 8.0, 2e-5, 0.5 * math.pi)
    one = body(curves=(curve(),), cyclic=(term,))
    q = np.array([60.0, 62.0, 64.0])
    np.testing.assert_allclose(one.components.evaluate(q, None)[4], 1e-3 + 2e-5 * np.cos(2 * np.pi * q / 8.0))
    alone = body(cyclic=(term,))
    assert alone.components.varies == (False, False, False, False, True, False)
    wave = 2e-5 * np.cos(2 * np.pi * q / 8.0)
    np.testing.assert_allclose(alone.components.evaluate(q, None)[4], wave, atol=1e-18)
    assert body(cyclic=(term,), skip=frozenset({"EBX"})).components.cyclic == ()
    assert body("Y", cyclic=(term,)).components.cyclic == ()


def test_bounds_are_of_mean_half_difference_and_cyclic_terms() -> None:
    both = Curve("X", X, forward={"EXX": [0.0, 4.0, 0.0, 0.0]}, backward={"EXX": [0.0, 2.0, 0.0, 0.0]},
                 interpolation="linear")  # fmt: skip
    one = body(curves=(both,), cyclic=(Cyclic("EXX", 10.0, 0.5),))
    bound = one.components.variation[0]
    assert bound is not None
    # means to 3 and halves to 1 within 25 mm, and a sine
    assert bound.peak == pytest.approx(3.0 + 1.0 + 0.5)
    assert bound.slope == pytest.approx(4.0 / 25.0 + 0.1 * math.pi)
    assert [v is None for v in one.components.variation] == [False] + [True] * 5


def test_a_smooth_curve_is_resampled_to_a_ten_thousandth_of_a_micrometre() -> None:
    """And angles to as much on 1 m; on one grid for all files of an axis."""
    knots = np.array([0.0, 10.0, 30.0, 70.0, 100.0])
    length, angle = np.array([0.0, 2e-2, -1e-2, 3e-2, 0.0]), np.array([0.0, 5e-5, -4e-5, 6e-5, 0.0])
    q = np.linspace(0.0, 100.0, 4001)
    for columns in ({"EXX": length}, {"EBX": angle}, {"EXX": length, "EBX": angle}):
        one = body(curves=(Curve("X", knots, columns),)).components.evaluate(q, None)
        for d, (name, most) in enumerate((("EXX", 1e-7), ("EYX", 0), ("EZX", 0), ("EAX", 0), ("EBX", 1e-10))):
            if name in columns:
                away = np.abs(one[d] - PchipInterpolator(knots, columns[name])(q)).max()
                assert away <= most * (1.0 + 1e-6)
    # no finer than that: cells of sqrt(8 * tolerance / curvature), at the most
    table = body(curves=(Curve("X", knots, {"EXX": length}),)).components.table
    spline = PchipInterpolator(knots, length)
    curvature = max(abs(spline(x + side, 2)) for x in knots for side in (-1e-9, 1e-9) if 0 < x + side < 100)
    fine = math.sqrt(8e-7 / curvature)
    assert 0.5 * fine < table.step <= fine * (1.0 + 1e-6)


def test_files_of_one_axis_share_the_range_that_all_of_them_have() -> None:
    long = Curve("X", [-50.0, 50.0, 150.0], {"EXX": [0.0, 10.0, 20.0]}, interpolation="linear")
    short = Curve("X", [-10.0, 50.0, 110.0], {"EYX": [0.0, 6.0, 12.0]}, interpolation="linear")
    one = body(curves=(long, short))
    assert values(one, [-10.0, 0.0, 110.0, 140.0, -40.0])[:2] == [
        pytest.approx([4.0, 5.0, 16.0, 16.0, 4.0]), pytest.approx([0.0, 1.0, 12.0, 12.0, 0.0]),
    ]  # fmt: skip


def test_positions_that_differ_by_rounding_are_one() -> None:
    near = X + np.array([0.0, 5e-10, -5e-10, 0.0])
    one = body(curves=(curve(), Curve("X", near, {"EXX": [0.0, 1.0, 2.0, 3.0]}, interpolation="linear")))
    assert one.components.table.step == 25.0
    assert values(one, [37.5])[0] == pytest.approx([1.5])


# -- cyclic terms with lever arms of their own ---------------------------------------------------------------


@pytest.mark.parametrize(
    ("chain", "moved"),
    [
        # 10 urad about Y: row X by the z of the curve's line less that of the term, (-20 + 5) - (-90 + 60);
        # row Z by its x: -(7 - 1)
        ("FXYZ", {0: 15.0, 2: -6.0}),
    ],
)
def test_a_term_measured_elsewhere_moves_the_tip_by_the_difference_of_lines(
    chain: str, moved: dict[int, float]
) -> None:
    measured = Curve("X", BOX[0], {"EXX": [0.0, 0.0]}, line_mm=(0.0, 30.0, -20.0), tool_mm=(7.0, 0.0, 5.0))
    term = Cyclic("EBX", 8.0, 1e-5, 0.5 * math.pi, line_mm=(0.0, 44.0, -90.0), tool_mm=(1.0, 3.0, 60.0))
    one = body(chain=chain, curves=(measured,), cyclic=(term,))
    q = np.array([0.0, 4.0, 6.0])
    (acting,) = one.components.cyclic
    wave = 1e-5 * np.array([1.0, -1.0, 0.0])
    for i, value in enumerate(acting.six(q)):
        if i == 4:
            np.testing.assert_allclose(value, wave, atol=1e-18)
        elif i in moved:
            np.testing.assert_allclose(value, wave * moved[i], atol=1e-17)
        else:
            assert value is None
    bounds = dict(acting.variations(0.0, 100.0))
    assert sorted(bounds) == sorted([4, *moved])
    assert bounds[4].peak == pytest.approx(1e-5)
    for i, factor in moved.items():
        assert bounds[i].peak == pytest.approx(1e-5 * abs(factor))


def test_a_term_seen_from_a_table_has_an_arm_that_grows_with_its_axis() -> None:
    """X carries the workpiece: a turn about Z of 10 urad moves row Y by its x, q - 3 on the table."""
    measured = Curve("X", BOX[0], {"EXX": [0.0, 0.0]}, line_mm=(0.0, 0.0, 0.0))
    term = Cyclic("ECX", 8.0, 1e-5, 0.5 * math.pi, reference="table")
    one = body(chain="XFYZ", curves=(measured,), cyclic=(term,), datum_mm=(3.0, 0.0, 0.0))
    (acting,) = one.components.cyclic
    q = np.array([0.0, 8.0, 12.0])
    six = acting.six(q)
    np.testing.assert_allclose(six[1], 1e-5 * np.array([-3.0, 5.0, -9.0]), atol=1e-17)
    assert six[2] is None
    np.testing.assert_array_equal(six[0], 0.0)
    bounds = dict(acting.variations(0.0, 100.0))
    # at most 97 in the box, growing by 1 per mm
    assert bounds[1].peak == pytest.approx(97e-5)
    assert bounds[1].slope == pytest.approx(1e-5 * (97.0 * math.pi / 4.0 + 1.0))
    np.testing.assert_allclose(one.components.evaluate(q, None)[1], six[1])
    # curves on the table and a term at the tip: the other way round
    measured = Curve("X", BOX[0], {"EXX": [0.0, 0.0]}, line_mm=(0.0, 0.0, 0.0), reference="table")
    term = Cyclic("ECX", 8.0, 1e-5, 0.5 * math.pi, reference="functional-point")
    one = body(chain="XFYZ", curves=(measured,), cyclic=(term,), datum_mm=(3.0, 0.0, 0.0))
    np.testing.assert_allclose(one.components.cyclic[0].six(q)[1], -six[1])
