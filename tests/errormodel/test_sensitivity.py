"""How uncertain numbers act on the tip, by hand: rows of several entries, and expansion."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from olp.errormodel.build import build
from olp.errormodel.calibration import Calibration, Curve, Thermal
from olp.errormodel.entry import Entry
from olp.errormodel.sensitivity import Expansion, Sensitivity
from olp.errormodel.uncertainty import EXPANSION_PER_K, Uncertainty, fingerprint, of_sigmas

X = np.array([0.0, 10.0, 40.0])
TILT = Entry("squareness", "B0Z", np.array([[2.0]]), np.array([0.5]))
BOX = np.array([[0.0, 40.0], [0.0, 300.0], [-200.0, 0.0]])


def calibration(**more: Any) -> Calibration:
    curves = (
        Curve("X", X, {"EXX": np.zeros(3)}, line_mm=(0.0, 20.0, -30.0), interpolation="linear"),
        Curve("Z", [-200.0, 0.0], {"EAZ": np.zeros(2)}, line_mm=(0.0, 0.0, 0.0), tool_mm=(0.0, 5.0, -70.0)),
    )
    return Calibration("m", BOX, datum_mm=(1.0, 2.0, 3.0), curves=curves, **more)


POINTS = np.array([[10.0, 30.0, -50.0], [25.0, 2.0, 3.0]])
TOOL = np.array([4.0, -6.0, -100.0])


def test_rows_of_several_entries_by_hand() -> None:
    """Columns: one of the factor, then those independent parts that have a variance, one after another."""
    roll = Entry("mean", "EAZ", np.array([[1e-6], [3e-6]]), np.zeros(2), np.array([-200.0, 0.0]))
    entries = (
        Entry("mean", "EXX", np.array([[1.0], [2.0], [4.0]]), np.array([0.0, 0.5, 0.0]), X),
        Entry("squareness", "A0Z", np.array([[2e-6]]), np.array([5e-6])),
        roll,
        Entry("backlash", "Y", np.array([[0.0]]), np.array([3e-3])),
    )
    known = Uncertainty(entries, "", "")
    sensitivity = Sensitivity.of(calibration(), "FXYZ", known)
    # 3 + 1 + 2 + 1 numbers; parts: 3 of EXX, 1 of A0Z, none of EAZ, 1 of Y
    assert sensitivity.first == (0, 3, 4, 6) and sensitivity.spare == (7, 10, -1, 11)
    assert sensitivity.columns == 6 and sensitivity.table.shape == (12, 6)
    play = np.array([[0.0, 1.0, 0.0], [0.0, -0.5, 0.0]])
    rows = sensitivity.rows(POINTS, TOOL, play)
    expected = np.zeros((3, 2, 6))
    # EXX: 2 at 10, 3 at 25 mm, and 0.5 and 0.25 of its own, in cells of 20 mm
    expected[0, 0, :3] = 2.0, 0.5 * 0.5**0.5, 0.5 * 0.5**0.5
    expected[0, 1, [0, 2, 3]] = 3.0, *(np.array([0.75, 0.25]) * 0.25 / np.hypot(0.75, 0.25))
    # A0Z: -(z - 3), row Y
    expected[1, :, 0] = 2e-6 * 53.0, 0.0
    expected[1, :, 4] = 5e-6 * 53.0, 0.0
    # EAZ on the tool alone: dY = -a (t_z - line_z), dZ = a (t_y - line_y)
    angle = np.array([2.5e-6, 3e-6])
    expected[1, :, 0] += -angle * (-100.0 + 70.0)
    expected[2, :, 0] = angle * (-6.0 - 5.0)
    expected[1, :, 5] = 3e-3 * -0.5 * play[:, 1]
    np.testing.assert_allclose(rows, expected, rtol=1e-6, atol=1e-12)
    # in the mean of both directions backlash is nothing; a tool per point is the same as one
    without = sensitivity.rows(POINTS, np.tile(TOOL, (2, 1)))
    expected[1, :, 5] = 0.0
    np.testing.assert_allclose(without, expected, rtol=1e-6, atol=1e-12)
    # what the control corrects is no part of it
    skipped = Sensitivity.of(calibration(), "FXYZ", known, skip=frozenset({"EXX", "EAZ"}))
    assert [entry.name for entry in skipped.entries] == ["A0Z", "Y"]
    assert skipped.first == (0, 1) and skipped.spare == (2, 3)
    # the equation of the paper knows no tool
    of_paper = Sensitivity.of(calibration(model="huddersfield"), "FXYZ", Uncertainty((roll,), "", ""))
    np.testing.assert_array_equal(of_paper.rows(POINTS, TOOL), np.zeros((3, 2, 1)))


def test_nothing_known_has_no_columns() -> None:
    sensitivity = Sensitivity.of(calibration(), "FXYZ", Uncertainty((), "", ""))
    assert sensitivity.columns == 0
    assert sensitivity.rows(POINTS, TOOL).shape == (3, 2, 0)


def test_expansion_acts_by_axis_position_and_by_place_of_the_part() -> None:
    thermal = Thermal(
        scale_per_K=(10e-6, 0.0, 8e-6), fixed_at_mm=(1.0, 2.0, 3.0), workpiece_per_K=23e-6,
        clamped_at_mm=(5.0, 6.0, 7.0),
    )  # fmt: skip
    warm = calibration(thermal=thermal, temperature_degC=22.0)
    known = Uncertainty((), "", "", temperature_K=0.5)
    expansion = Expansion.of(warm, known, {"X_scale": 30.0, "Y_scale": 19.0, "workpiece": 40.0})
    # Y has no coefficient, and is 3 K below the calibration: that of steel counts in full
    steel = EXPANSION_PER_K
    assert steel == 11.5e-6
    assert expansion.scale == pytest.approx((5e-6, np.hypot(0.5, 3.0) * steel, 4e-6))
    assert expansion.workpiece == pytest.approx(11.5e-6)
    assert expansion.unmodelled_K == 3.0
    assert (expansion.fixed_at_mm, expansion.clamped_at_mm) == (thermal.fixed_at_mm, thermal.clamped_at_mm)
    rows = Sensitivity.of(warm, "FXYZ", known, expansion=expansion).rows(POINTS, TOOL)
    assert rows.shape == (3, 2, 4)
    expected = np.zeros((3, 2, 4))
    for j in range(3):
        expected[j, :, j] = expansion.scale[j] * (POINTS[:, j] - thermal.fixed_at_mm[j])
        expected[j, :, 3] = -11.5e-6 * (POINTS[:, j] + TOOL[j] - thermal.clamped_at_mm[j])
    np.testing.assert_allclose(rows, expected, rtol=1e-6)
    # a part without coefficient, 4 K above 20 degC; the largest difference is stated
    plain = Expansion.of(calibration(), known, {"Y_scale": 19.0, "workpiece": 24.0})
    assert plain.unmodelled_K == 4.0
    assert plain.workpiece == pytest.approx(np.hypot(0.5, 4.0) * steel)
    assert plain.scale == pytest.approx((0.5 * steel, np.hypot(0.5, 1.0) * steel, 0.5 * steel))
    assert plain.fixed_at_mm == plain.clamped_at_mm == (0.0, 0.0, 0.0)


def test_expansion_comes_behind_the_other_unknowns() -> None:
    known = Uncertainty((TILT,), "", "", temperature_K=1.0)
    expansion = Expansion.of(calibration(), known, {})
    assert expansion.unmodelled_K == 0.0
    assert Expansion((0.0,) * 3, (0.0,) * 3, 0.0, (0.0,) * 3).unmodelled_K == 0.0
    sensitivity = Sensitivity.of(calibration(), "FXYZ", known, expansion=expansion)
    rows = sensitivity.rows(POINTS, TOOL)
    assert rows.shape == (3, 2, 6)
    np.testing.assert_allclose(rows[0, :, :2], np.outer(POINTS[:, 2] - 3.0, [2.0, 0.5]), rtol=1e-6)
    np.testing.assert_allclose(rows[0, :, 2], 11.5e-6 * POINTS[:, 0], rtol=1e-6)
    np.testing.assert_allclose(rows[2, :, 5], -11.5e-6 * (POINTS[:, 2] - 100.0), rtol=1e-6)


def test_rows_are_the_change_of_the_error_with_each_number() -> None:
    """Against differences of the exact model, on a chain whose table moves."""
    known = Uncertainty(
        (
            Entry("mean", "EAZ", np.array([[1e-6], [3e-6]]), np.zeros(2), np.array([-200.0, 0.0])),
            Entry("squareness", "C0Y", np.array([[2e-6]]), np.zeros(1)),
        ),
        "", "",
    )  # fmt: skip
    measured = Curve(
        "Z", [-200.0, 0.0], {"EAZ": [1e-6, 3e-6]}, line_mm=(0.0, 0.0, 0.0), tool_mm=(0.0, 5.0, -70.0),
        interpolation="linear",
    )  # fmt: skip
    for chain in ("FXYZ", "ZYFX", "XZFY"):
        moved = replace(calibration(), curves=(calibration().curves[0], measured), squareness={"C0Y": 2e-6})
        rows = Sensitivity.of(calibration(), chain, known).rows(POINTS, TOOL)
        np.testing.assert_allclose(rows[:, :, 0].T, build(moved, chain).error(POINTS, TOOL), atol=2e-9)


def test_standard_uncertainties_by_the_key_of_their_source() -> None:
    measured = calibration(squareness={"C0Y": 1e-5})
    known = of_sigmas(measured, {"curves": {"EXX": np.full(3, 2e-3)}, "squareness": {"C0Y": 4e-6}})
    assert known is not None
    assert [(e.kind, e.name, e.rest.tolist()) for e in known.entries] == [
        ("mean", "EXX", [2e-3] * 3), ("squareness", "C0Y", [4e-6]),
    ]  # fmt: skip
    assert known.fingerprint == fingerprint(measured)
    assert known.source.startswith("sigma columns: components are taken as independent")
    assert "the 16 parts of a curve" in known.source
    assert of_sigmas(measured, {}) is None
    assert of_sigmas(measured, {"squareness": {}, "curves": {"EYX": np.full(3, 2e-3)}}) is None


@pytest.mark.parametrize("grown", [False, True])
@pytest.mark.parametrize("touched", [False, True])
@pytest.mark.parametrize("rank", [0, 2])
def test_the_covariance_is_that_of_the_rows(rank: int, touched: bool, grown: bool) -> None:
    """Independent parts are added up without rows: the same as rows less those of touch-offs, squared."""
    rng = np.random.default_rng(rank)

    def entry(kind: str, name: str, *positions: float, period_mm: float = 0.0) -> Entry:
        count = len(positions) or (2 if period_mm else 1)
        size = 1e-3 if name[1:2] in "XYZ" else 1e-5
        factor = size * rng.normal(size=(count, rank))
        return Entry(kind, name, factor, size * rng.random(count), np.array(positions), period_mm)

    entries = (
        entry("mean", "EXX", *X), entry("half", "EXX", *X), entry("mean", "EAX", *X),
        entry("mean", "EAZ", -200.0, 0.0), entry("mean", "EBZ", -200.0, 0.0),
        entry("wave", "EBX", period_mm=7.0), entry("squareness", "B0Z"), entry("backlash", "Y"),
    )  # fmt: skip
    expansion = Expansion((1e-6, 2e-6, 0.0), (5.0, 0.0, 0.0), 3e-6, (1.0, 2.0, 3.0)) if grown else None
    sensitivity = Sensitivity.of(calibration(), "FXYZ", Uncertainty(entries, "", ""), expansion=expansion)
    points = rng.uniform(BOX[:, 0], BOX[:, 1], (40, 3))
    play, tool = rng.choice([-1.0, 0.5, 1.0], (40, 3)), TOOL + rng.normal(size=(40, 3))
    held = np.zeros((2, 3, sensitivity.columns), np.float32)
    if touched:
        held[1] = sensitivity.rows(points[:1], TOOL)[:, 0]
    frame = rng.integers(0, 2, 40)
    rows = sensitivity.rows(points, tool, play).astype(float) - held[frame].transpose(1, 0, 2)
    covariance, of_expansion = sensitivity.covariance(points, tool, play, held, frame)
    np.testing.assert_allclose(covariance, np.einsum("ink,jnk->nij", rows, rows), rtol=1e-4, atol=1e-12)
    largest = (rows[:, :, -4:] ** 2).sum(axis=(0, 2)) if grown else np.zeros(40)
    np.testing.assert_allclose(of_expansion, largest, rtol=1e-5, atol=1e-18)
