"""Lengths, angles and speeds that people write with their unit: `0.002 in`, `2 arcsec`, `1.414 mm/m`.

A key of a file ends in its unit, and a bare number is in that unit. A text holds a number and a unit of its
own. Factors are exact, except where pi enters.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from fractions import Fraction

from olp.core.values import dataclass

#: What a slope between two directions is called; one of 1 mm/m is 1 mrad, as the linear model takes it.
_ANGLE = "angle"


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of a `dimension`: so many mm, mm/s, mm/s2, mm/s3, or rad; angles may have pi as a factor."""

    dimension: str
    size: Fraction
    of_pi: bool = False


_LENGTHS = {
    "m": Fraction(1000),
    "dm": Fraction(100),
    "cm": Fraction(10),
    "mm": Fraction(1),
    "um": Fraction(1, 1000),
    "nm": Fraction(1, 1_000_000),
    "in": Fraction(254, 10),
    "ft": Fraction(3048, 10),
    "thou": Fraction(254, 10_000),
    "uin": Fraction(254, 10_000_000),
}
_OTHER_NAMES = {
    "inch": "in", "inches": "in", '"': "in", "foot": "ft", "feet": "ft", "mil": "thou", "mils": "thou",
    "microinch": "uin", "micron": "um", "microns": "um", "micrometre": "um", "micrometer": "um",
}  # fmt: skip
_ANGLES = {
    "rad": Unit(_ANGLE, Fraction(1)),
    "mrad": Unit(_ANGLE, Fraction(1, 1000)),
    "urad": Unit(_ANGLE, Fraction(1, 1_000_000)),
    "deg": Unit(_ANGLE, Fraction(1, 180), of_pi=True),
    "arcmin": Unit(_ANGLE, Fraction(1, 180 * 60), of_pi=True),
    "arcsec": Unit(_ANGLE, Fraction(1, 180 * 3600), of_pi=True),
    "%": Unit(_ANGLE, Fraction(1, 100)),
    "ppm": Unit(_ANGLE, Fraction(1, 1_000_000)),
}
_OTHER_ANGLES = {
    "degree": "deg", "degrees": "deg", "\u00b0": "deg", "arcminute": "arcmin", "arcminutes": "arcmin",
    "arcsecond": "arcsec", "arcseconds": "arcsec", "microrad": "urad",
}  # fmt: skip
#: Times in s and their power, below a length.
_TIMES = {
    "s": ("velocity", Fraction(1)),
    "min": ("velocity", Fraction(60)),
    "s2": ("acceleration", Fraction(1)),
    "s3": ("jerk", Fraction(1)),
}
#: Units that are no ratio of two names: standard gravity, inches per minute.
_WHOLE = {
    "g": Unit("acceleration", Fraction(980665, 100)),
    "ipm": Unit("velocity", Fraction(254, 600)),
}

#: What a dimension is called, and examples of it.
EXAMPLES: Mapping[str, str] = {
    "length": '"0.002 in", "50 um" or "2 mm"',
    _ANGLE: '"2 arcsec", "0.1 mrad", "0.001 deg" or "1.4 mm/m"',
    "velocity": '"400 in/min" or "10 m/min"',
    "acceleration": '"2 m/s2" or "80 in/s2"',
    "jerk": '"20 m/s3"',
}
#: The units of a dimension, as messages list them.
_KNOWN = {
    "length": tuple(_LENGTHS),
    _ANGLE: (*_ANGLES, "mm/m", "um/m", "in/ft"),
    "velocity": ("mm/s", "mm/min", "m/min", "in/s", "in/min"),
    "acceleration": ("mm/s2", "m/s2", "in/s2", "g"),
    "jerk": ("mm/s3", "m/s3", "in/s3"),
}

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d{1,3})?"
_QUANTITY = re.compile(rf"\s*((?>{_NUMBER}))\s*(\S.*?)\s*")
_RATIO = re.compile(rf"([^\d\s/]+)\s*/\s*({_NUMBER})?\s*([^\d\s/][^\s/]*)")


def unit_named(name: str) -> Unit:
    """The unit of that name, such as "in", "arcsec" or "mm/m". Raises ValueError where there is none."""
    name = name.replace("\u00b5", "u").replace("\u03bc", "u").replace("^", "")
    name = name.replace("\u00b2", "2").replace("\u00b3", "3").strip()
    whole = _WHOLE.get(name) or _ANGLES.get(_OTHER_ANGLES.get(name, name))
    if whole is not None:
        return whole
    length = _length(name)
    return _ratio(name) if length is None else Unit("length", length)


def _length(name: str) -> Fraction | None:
    return _LENGTHS.get(_OTHER_NAMES.get(name, name))


def _ratio(name: str) -> Unit:
    """A length over a length, which is a slope, or over a time."""
    parts = _RATIO.fullmatch(name)
    above = None if parts is None else _length(parts[1])
    if parts is not None and above is not None:
        count = Fraction(parts[2] or 1)
        below = _length(parts[3])
        if below is not None and count > 0:
            return Unit(_ANGLE, above / (count * below))
        if parts[3] in _TIMES and parts[2] is None:
            dimension, seconds = _TIMES[parts[3]]
            return Unit(dimension, above / seconds)
    raise ValueError(f'"{name}" is not a unit')


def quantity(text: str, unit: str) -> float:
    """The number of a unit that a text states: 50.8 for "0.002 in" in "um". Raises ValueError, whose message
    completes a sentence that names the key: what is wrong, and what was expected."""
    wanted = unit_named(unit)
    examples = f"such as {EXAMPLES[wanted.dimension]}"
    parts = _QUANTITY.fullmatch(text)
    if parts is None:
        bare = re.fullmatch(rf"\s*{_NUMBER}\s*", text)
        hint = "leave out the quotes, or add a unit" if bare else "give a number and its unit"
        raise ValueError(f"expected a number in {unit}, or a text with its unit, {examples}; {hint}")
    if re.match(r",\d", parts[2]):
        raise ValueError(f"expected a number with a decimal point instead of the comma, {examples}")
    try:
        stated = unit_named(parts[2])
    except ValueError:
        known = ", ".join(_KNOWN[wanted.dimension])
        what = f'"{parts[2]}" is not a unit of {wanted.dimension}'
        raise ValueError(f"{what}; expected one of {known}, {examples}") from None
    if stated.dimension != wanted.dimension:
        article = "an" if stated.dimension[0] in "a" else "a"
        wrong = f'"{parts[2]}" is {article} {stated.dimension}'
        raise ValueError(f"{wrong}; expected a unit of {wanted.dimension}, {examples}")
    try:
        number = float(Fraction(parts[1]) * stated.size / wanted.size)
    except OverflowError:
        raise ValueError(f"expected a smaller number, {examples}") from None
    if stated.of_pi and not wanted.of_pi:
        return number * math.pi
    return number / math.pi if wanted.of_pi and not stated.of_pi else number


def pattern(unit: str) -> str:
    """A regular expression for texts that `quantity` may take in place of a number of a unit. A number and a
    name match it; which units there are is checked when the file is read."""
    return rf"^\s*{_NUMBER}\s*(?![eE][-+]?\d)[^\d\s,.].*$"
