"""Errors that are stated as a few numbers."""

from __future__ import annotations

import numpy as np
import pytest

from olp.core.errors import UsageError
from olp.errormodel.build import build
from olp.errormodel.known import KnownErrors

BOX = np.array([[-500.0, 500.0]] * 3)
NO_TOOL = np.zeros(3)


def error_um(known: KnownErrors, *place: float) -> list[float]:
    model = build(known.calibration("m", BOX), "FXYZ")
    return (model.error(np.array([place]), NO_TOOL)[0] * 1e3).round(6).tolist()


@pytest.mark.parametrize(
    ("skew", "place", "moved"),
    [
        ("XY=1.5mm/m", (0, 200, 0), [300, 0, 0]),  # Y leans toward +X: higher up the tool is farther along +X
        ("C0Y=-1500urad", (0, 200, 0), [300, 0, 0]),  # ISO 230-1: a positive rotation leans Y toward -X
        ("XZ=1.5mm/m", (0, 0, 200), [300, 0, 0]),
        ("B0Z=1500urad", (0, 0, 200), [300, 0, 0]),
        ("YZ=1.5mm/m", (0, 0, 200), [0, 300, 0]),
        ("A0Z=-1500urad", (0, 0, 200), [0, 300, 0]),
    ],
)
def test_a_lean_moves_the_tool_toward_plus(skew: str, place: tuple[float, ...], moved: list[float]) -> None:
    assert error_um(KnownErrors.of([skew]), *place) == pytest.approx(moved, abs=1e-3)


def test_a_scale_moves_farther_than_commanded() -> None:
    known = KnownErrors.of(scale=["Y=0.2mm/m"])
    there, here = error_um(known, 0, 300, 0), error_um(known, 0, 100, 0)
    assert np.subtract(there, here) == pytest.approx([0, 40, 0], abs=1e-6)


def test_backlash_is_that_of_its_axis() -> None:
    assert KnownErrors.of(backlash=["X=0.05mm", "z=2thou"]).backlash_mm == pytest.approx((0.05, 0.0, 0.0508))


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"skew": ["XY=1.414mm/m"]}, "Y leans toward +X by 1.414 mm per m (C0Y = -1414 urad)"),
        ({"skew": ["XZ=-1mm/m"]}, "Z leans toward -X by 1 mm per m (B0Z = -1000 urad)"),
        ({"skew": ["A0Z=-20urad"]}, "Z leans toward +Y by 0.02 mm per m (A0Z = -20 urad)"),
        ({"scale": ["X=-0.2%"]}, "X moves 2 mm per m less far than commanded"),
        ({"backlash": ["Z=50um"]}, "Z has a backlash of 50 um"),
    ],
)
def test_a_number_is_said_in_words(words: dict[str, list[str]], says: str) -> None:
    assert list(KnownErrors.of(**words).sentences()) == [says]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ({"skew": ["YX=1mm/m"]}, "expected NAME=VALUE with a name out of XY, XZ, YZ, C0Y"),
        ({"skew": ["1mm/m"]}, "expected NAME=VALUE"),
        ({"skew": ["XY=1"]}, "neither an angle nor a ratio"),
        ({"skew": ["XY=1mm/m", "C0Y=1urad"]}, "states C0Y a second time"),
        ({"scale": ["X=1%", "x=1%"]}, "states X a second time"),
        ({"scale": ["X=99.8%"]}, "by how much the axis moves too far"),
        ({"backlash": ["X=50urad"]}, "is not a length"),
        ({"backlash": ["A=50um"]}, "a name out of X, Y, Z"),
    ],
)
def test_what_cannot_be_read_is_refused(words: dict[str, list[str]], says: str) -> None:
    with pytest.raises(UsageError, match=says):
        KnownErrors.of(**words)


def test_height_counts_for_errors_that_depend_on_z() -> None:
    depends = [KnownErrors.of(["XZ=1mm/m"]), KnownErrors.of(["YZ=1mm/m"]), KnownErrors.of(scale=["Z=1mm/m"])]
    free = [KnownErrors.of(["XY=1mm/m"], ["X=1mm/m", "Y=1mm/m"], ["Z=1mm"])]
    assert [known.by_height for known in depends + free] == [True, True, True, False]
    assert not KnownErrors.of()
