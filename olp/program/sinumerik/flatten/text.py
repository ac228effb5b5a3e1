"""Numbers of expressions as text."""

from __future__ import annotations

import math

from olp.core.errors import ProgramError

#: Decimals of numbers from expressions at most, and their significant digits less one.
_DECIMALS = 9


def shown(value: float) -> str:
    """A number from an expression: ten significant digits, and no exponent."""
    size = 0 if value == 0 else math.floor(math.log10(abs(value)))
    if size > _DECIMALS:
        raise ProgramError(f"the value {value:g} is larger than a word of a program", code="OLP540")
    text = f"{value:.{min(_DECIMALS, _DECIMALS - size)}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text
