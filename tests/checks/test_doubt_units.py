"""Columns in another unit are told, with their uncertainty and without; what no reading shows is none."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest

from olp.checks.doubt_units import unit_doubts
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.entry import Entry, alone
from olp.errormodel.uncertainty import Uncertainty

AT = np.linspace(0.0, 1000.0, 9)
BEND = np.sin(np.arange(9.0))
BOX = np.array([[0.0, 1000.0]] * 3)
#: um or urad; all but ECZ.
SIZES = {
    "EXX": 40.0, "EYX": 12.0, "EZX": 9.0, "EAX": 30.0, "EBX": 25.0, "ECX": 50.0,
    "EYY": 30.0, "EXY": 10.0, "EZY": 8.0, "EAY": 20.0, "EBY": 15.0, "ECY": 40.0,
    "EZZ": 14.0, "EXZ": 9.0, "EYZ": 7.0, "EAZ": 12.0, "EBZ": 18.0,
}  # fmt: skip
SQUARE = {"C0Y": 60.0, "B0Z": 40.0, "A0Z": 25.0}
MIXED = [("EYX", 1e-3), ("EYX", 1 / 25400), ("EZZ", 1e-3), ("EZZ", 1 / 25400), ("EAX", 1e-3)]


def si(name: str, value: float) -> float:
    return value * (1e-3 if name[1] in "XYZ" else 1e-6)


def told(
    changed: Mapping[str, float] | None = None,
    sigma: Mapping[str, float] | None = None,
    *,
    adjusted: bool = False,
) -> list[str]:
    """What is told of sizes times `changed`, with standard uncertainties in um or urad of columns of their
    own, or as an adjustment states them."""
    sizes = {name: value * (changed or {}).get(name, 1.0) for name, value in {**SIZES, **SQUARE}.items()}
    curves = tuple(
        Curve(axis, AT, {name: si(name, sizes[name]) * BEND for name in SIZES if name[2] == axis})
        for axis in "XYZ"
    )
    square = {name: si(name, sizes[name]) for name in SQUARE}
    calibration = Calibration("mill", BOX, curves=curves, squareness=square)
    entries = [
        alone("mean", name, np.full(9, si(name, value)), AT)
        if name in SIZES
        else alone("squareness", name, si(name, value))
        for name, value in (sigma or {}).items()
    ]
    if adjusted:
        entries = [
            Entry(one.kind, one.name, one.rest[:, None], 0.0 * one.rest, one.position_mm) for one in entries
        ]
    uncertainty = Uncertainty(tuple(entries), "", "") if entries else None
    return [finding.message for finding in unit_doubts(calibration, uncertainty)]


@pytest.mark.parametrize(("name", "factor"), MIXED)
def test_a_column_in_another_unit_is_told_with_its_uncertainty_and_without(name: str, factor: float) -> None:
    mixed = {name: factor}
    usual = dict.fromkeys(SIZES, 1.0)
    for text in (
        told(mixed),
        # its sigma column is in the right unit, or in the same wrong one
        told(mixed, usual),
        told(mixed, {**usual, name: factor}),
        # readings in another unit scatter as little
        told(mixed, {**usual, name: factor}, adjusted=True),
    ):
        assert len(text) == 1
        assert f"largest {name}" in text[0]
    assert told(sigma=usual) == told(sigma=usual, adjusted=True) == told() == []


@pytest.mark.parametrize("name", ["EYX", "EZZ", "EAX"])
def test_a_column_that_no_reading_shows_is_small_for_that_reason(name: str) -> None:
    small = {name: 0.9e-3}
    usual = dict.fromkeys(SIZES, 0.3)
    value = SIZES[name] * 0.9e-3
    # values and uncertainty of an adjustment have one unit
    assert told(small, {**usual, name: 1.1 * value}, adjusted=True) == []
    assert len(told(small, {**usual, name: 0.9 * value}, adjusted=True)) == 1
    # a person may have written them in two
    assert told(small, {**usual, name: 26_000.0 * value}) == []
    assert len(told(small, {**usual, name: 25_000.0 * value})) == 1


def test_axes_angles_and_squareness_that_no_reading_shows_are_in_no_other_unit() -> None:
    of_z = {name: 1e-3 for name in SIZES if name[2] == "Z"}
    for mixed, hidden in (
        ({name: factor for name, factor in of_z.items() if name[1] in "XYZ"}, 60.0),
        ({name: factor for name, factor in of_z.items() if name[1] in "ABC"}, 90.0),
        ({name: 1e-3 for name in SIZES if name[1] in "ABC"}, 90.0),
        (dict.fromkeys(SQUARE, 1e-3), 1000.0),
    ):
        assert len(told(mixed)) == 1
        assert len(told(mixed, dict.fromkeys(mixed, 1e-3), adjusted=True)) == 1
        assert told(mixed, dict.fromkeys(mixed, hidden), adjusted=True) == []


def test_a_column_that_no_reading_shows_is_no_measure_of_others() -> None:
    """Without it too few columns are left to say which unit is the odd one."""
    others = ["EZX", "EXY", "EZY", "EXZ", "EYZ", "EZZ"]
    assert told({"EYX": 1e-3}, dict.fromkeys(others, 90.0), adjusted=True) == []
    assert len(told({"EYX": 1e-3}, dict.fromkeys(others[1:], 90.0), adjusted=True)) == 1
