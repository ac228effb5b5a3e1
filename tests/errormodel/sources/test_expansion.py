"""Expansion of scales and workpiece: parts, dependence, the box, and positions that are not known."""

from __future__ import annotations

import numpy as np
import pytest

from olp.core.errors import UsageError
from olp.errormodel.sources.expansion import Thermal, ThermalExpansion

BOX = np.array([[0.0, 400.0], [0.0, 300.0], [-200.0, 0.0]])
#: At 21 degC while calibrating: scales of X and Z are 2 K warmer and 1.5 K cooler; the part is at 24 degC.
WARM = Thermal(
    scale_per_K=(10e-6, 0.0, 8e-6), fixed_at_mm=(100.0, 7.0, -50.0), workpiece_per_K=25e-6,
    clamped_at_mm=(40.0, 30.0, -20.0), calibrated_at_degC=21.0, scale_degC=(23.0, 50.0, 19.5),
    workpiece_degC=24.0,
)  # fmt: skip
POINTS = np.array([[300.0, 200.0, -150.0], [100.0, 30.0, -50.0]])
TOOL = np.array([5.0, -6.0, -70.0])
SCALES = np.array([[200.0 * 20e-6, 0.0, 100.0 * 12e-6], [0.0, 0.0, 0.0]])
PART = -100e-6 * np.array([[265.0, 164.0, -200.0], [65.0, -6.0, -100.0]])


def model(thermal: Thermal = WARM, *, hold: bool = False) -> ThermalExpansion:
    return ThermalExpansion.of(thermal, BOX, hold)


def test_scales_and_part_expand_by_hand() -> None:
    np.testing.assert_allclose(model().error(POINTS, TOOL), SCALES + PART, atol=1e-15)
    # one tool per point, and a payload that does not matter
    rows = np.array([[*TOOL, 9.0], [0.0, 0.0, 0.0, 0.0]])
    expected = [(SCALES + PART)[0], [-60e-4, 0.0, 30e-4]]
    np.testing.assert_allclose(model().error(POINTS, rows), expected, atol=1e-15)
    play = np.ones((2, 3))
    np.testing.assert_array_equal(model().error(POINTS, TOOL, play), model().error(POINTS, TOOL))


def test_each_axis_is_a_source() -> None:
    parts = dict(model().contributions(POINTS, TOOL))
    expected = {
        "scale expansion X": (0, SCALES), "scale expansion Z": (2, SCALES),
        "workpiece expansion X": (0, PART), "workpiece expansion Y": (1, PART),
        "workpiece expansion Z": (2, PART),
    }  # fmt: skip
    assert list(parts) == list(expected)
    for name, (j, value) in expected.items():
        only = np.zeros((2, 3))
        only[:, j] = value[:, j]
        np.testing.assert_allclose(parts[name], only, atol=1e-15)
    # where nothing moves there is no source
    fixed = np.array([[100.0, 0.0, -50.0]])
    scales = Thermal(
        scale_per_K=(1e-5, 0.0, 1e-5), fixed_at_mm=(100.0, 0.0, 0.0), scale_degC=(30.0, 30.0, 30.0)
    )
    assert [name for name, _ in model(scales).contributions(fixed, TOOL)] == ["scale expansion Z"]


@pytest.mark.parametrize(
    ("thermal", "depends"),
    [
        (WARM, [True, True, True]),
        (Thermal(scale_per_K=(1e-5, 1e-5, 0.0), scale_degC=(21.0, 20.0, 25.0)), [True, False, False]),
        (Thermal(workpiece_per_K=1e-5, workpiece_degC=19.0), [True, True, True]),
        (Thermal(workpiece_per_K=1e-5), [False, False, False]),
        (Thermal(), [False, False, False]),
    ],
)
def test_an_axis_without_expansion_may_be_unknown(thermal: Thermal, depends: list[bool]) -> None:
    one = model(thermal)
    assert one.depends_on.tolist() == np.diag(depends).tolist()
    unknown = np.full((1, 3), np.nan)
    np.testing.assert_array_equal(np.isnan(one.error(unknown, TOOL)), [depends])
    assert np.all(one.error(unknown, TOOL)[:, [not d for d in depends]] == 0.0)


def test_with_hold_it_is_taken_at_the_face_and_without_it_goes_on() -> None:
    outside = np.array([[500.0, 0.0, 0.0]])
    scale = Thermal(scale_per_K=(1e-5, 0.0, 0.0), scale_degC=(21.0, 20.0, 20.0))
    np.testing.assert_allclose(model(scale).error(outside, TOOL), [[5e-3, 0.0, 0.0]])
    np.testing.assert_allclose(model(scale, hold=True).error(outside, TOOL), [[4e-3, 0.0, 0.0]])


def test_it_turns_nothing_bends_nothing_and_has_no_backlash() -> None:
    one = model()
    assert one.rotation(POINTS).tolist() == [[0.0] * 3] * 2
    assert one.chord_bound(POINTS, TOOL).tolist() == [0.0, 0.0]
    assert one.backlash_at(POINTS) is None
    for call in (lambda: one.rotation(np.zeros(3)), lambda: one.chord_bound(np.zeros(3), TOOL)):
        with pytest.raises(UsageError, match="axis_mm has shape"):
            call()
