"""Unit factors to the base units: mm, s, rad, kg, degC. Used only at the edge of text."""

from __future__ import annotations

import math

#: mm per inch, exactly.
MM_PER_INCH = 25.4
#: mm per um.
MM_PER_UM = 1e-3
#: rad per urad.
RAD_PER_URAD = 1e-6
#: um per mm.
UM_PER_MM = 1e3
#: Linear axes in the order of rows.
AXES = "XYZ"

#: Endings of keys, the longer ones first, and their units.
_KEYS = {
    "_mm_s3": "mm/s3", "_mm_s2": "mm/s2", "_mm_s": "mm/s", "_mm": "mm", "_um": "um", "_nm": "nm",
    "_urad": "urad", "_mrad": "mrad", "_rad": "rad", "_deg": "deg", "_arcsec": "arcsec",
}  # fmt: skip
#: Neighbours of a number that are tried until one reads back exactly.
_NEIGHBOURS = 3


def unit_of_key(name: str) -> str | None:
    """The unit of length, angle or speed in which a key ends, such as "um"; None for any other key."""
    if "_per_" in name:
        return None
    return next((unit for ending, unit in _KEYS.items() if name.endswith(ending)), None)


def shifted(number: float | str, exponent: int) -> float:
    """A number times ten to `exponent`, by its decimal digits: 0.1 um is 1e-4 mm, not a neighbour of it.

    A text is taken by its digits as written, so that every double can be written in another decimal unit and
    read back exactly. Raises ValueError where the text is not a number.
    """
    text = number if isinstance(number, str) else repr(float(number))
    value = float(text)
    if not exponent or not math.isfinite(value):
        return value
    digits, _, own = text.lower().partition("e")
    return float(f"{digits}e{int(own or 0) + exponent}")


def in_unit(value: float, power: int) -> float:
    """The number of units of ten to `power` base units that reads back as `value`: 1e-4 mm is 0.1 um."""
    number = shifted(value, -power)
    low = high = number
    for _ in range(_NEIGHBOURS):
        for candidate in (low, high):
            if shifted(candidate, power) == value:
                return candidate
        low, high = math.nextafter(low, -math.inf), math.nextafter(high, math.inf)
    return number


def in_unit_text(value: float, power: int) -> str:
    """The shortest decimal of a double in units of ten to `power`; read as text it is the same double."""
    from decimal import Decimal

    text = format(Decimal(repr(float(value))).scaleb(-power), "f")
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return "0" if text in ("-0", "") else text
