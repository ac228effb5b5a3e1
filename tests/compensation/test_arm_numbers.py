"""Numbers of targets of an arm: right ones keep their bytes, others get the digits that are wanted."""

from __future__ import annotations

import numpy as np
import pytest

from olp.compensation.joints.arm_numbers import StatedNumbers

TEXT = b"12.30 +7 .5"
SPANS = [[(0, 5), (6, 8), (9, 11)]]


@pytest.mark.parametrize(
    ("wanted", "texts"),
    [
        ((12.3049, 7.04, 0.54), (b"12.30", b"+7", b".5")),
        ((12.3051, 7.06, 0.56), (b"12.31", b"+7.1", b".6")),
        ((-12.3051, -7.06, -0.56), (b"-12.31", b"-7.1", b"-.6")),
    ],
)
def test_a_number_within_half_a_digit_keeps_its_bytes(
    wanted: tuple[float, ...], texts: tuple[bytes, ...]
) -> None:
    stated = StatedNumbers.of(TEXT, SPANS)
    (row,) = stated.written(np.array([wanted]), np.array([1, 1, 1]), np.full((1, 3), np.nan), [()])
    assert row.texts == texts
    kept = [text in (b"12.30", b"+7", b".5") for text in texts]
    assert row.values == tuple(np.where(kept, (12.3, 7.0, 0.5), wanted).tolist())
    assert row.right_for(row)


@pytest.mark.parametrize(("off", "text"), [(0.0, b"12.30"), (2.0, b"12.37")])
def test_how_far_an_orientation_is_off_decides_and_not_each_of_its_numbers(off: float, text: bytes) -> None:
    stated = StatedNumbers.of(TEXT, SPANS)
    (row,) = stated.written(np.array([[12.37, 7.0, 0.5]]), np.array([2, 0, 1]), np.full((1, 3), off), [()])
    assert row.texts[0] == text
