"""Unit factors to the base units: mm, s, rad, kg, degC. Used only at the edge of text."""

from __future__ import annotations

import math

MM_PER_INCH = 25.4
MM_PER_UM = 1e-3
RAD_PER_URAD = 1e-6
UM_PER_MM = 1e3
AXES = "XYZ"


def shifted(number: float | str, exponent: int) -> float:
    """A number times ten to `exponent`, by its decimal digits: 0.1 um is 1e-4 mm, not a neighbour of it.

    A text counts as it is written, so that every double can be written in another decimal unit and read back
    exactly. Raises ValueError where the text is no number.
    """
    text = number if isinstance(number, str) else repr(float(number))
    value = float(text)
    if not math.isfinite(value):
        return value
    digits, _, own = text.lower().partition("e")
    return float(f"{digits}e{int(own or 0) + exponent}")
