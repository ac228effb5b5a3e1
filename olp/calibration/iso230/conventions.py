"""Sign conventions of squareness that controls, instruments and slicers use, in one table.

This package uses that of ISO 230-1: C0Y, B0Z and A0Z turn the line of the later axis right-handed about +Z,
+Y and +X. So a point moves by (-C0Y y + B0Z z, -A0Z z, 0). C0Y > 0 and A0Z > 0 make the
angle between the positive axes larger than 90 degrees, B0Z > 0 makes it smaller.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from olp.core.errors import UsageError
from olp.core.machine import SQUARENESS
from olp.core.values import dataclass

#: The two axes of each squareness, the earlier one first.
AXES_OF: Mapping[str, tuple[int, int]] = MappingProxyType({"C0Y": (0, 1), "B0Z": (0, 2), "A0Z": (1, 2)})
#: Factor from the lean of the later axis toward + of the earlier one to the squareness.
LEAN: Mapping[str, float] = MappingProxyType({"C0Y": -1.0, "B0Z": 1.0, "A0Z": -1.0})


@dataclass(frozen=True, slots=True)
class Convention:
    """`factor` by component: value in this package = factor * value there. `says` is what a positive value
    means."""

    says: str
    factor: Mapping[str, float]


def _table(says: str, c0y: float, b0z: float, a0z: float) -> Convention:
    return Convention(says, MappingProxyType(dict(zip(SQUARENESS, (c0y, b0z, a0z), strict=True))))


#: Small angles and tangents are equal here: a squareness acts as the factor of a shear, which is the tangent.
CONVENTIONS: Mapping[str, Convention] = MappingProxyType(
    {
        "iso": _table("right-handed turn of the later axis: C0Y, B0Z, A0Z", 1.0, 1.0, 1.0),
        "right-handed": _table(
            "CARTO Compensate, RIGHT_HANDED: XZ > 0 is an angle below 90 degrees", 1.0, 1.0, 1.0
        ),
        "larger-than-90": _table(
            "CARTO Compensate, LARGER_THAN_90: the angle is above 90 degrees", 1.0, -1.0, 1.0
        ),
        "acute": _table(
            "Klipper skew_correction, Marlin: the angle is below 90 degrees; the tangent", -1.0, 1.0, -1.0
        ),
        "obtuse": _table("RepRapFirmware M556: the angle is above 90 degrees; the tangent", 1.0, -1.0, 1.0),
        "symmetric-shear": _table(
            "half the angle on each axis: x moves by -W y and y by -W x; above 90 degrees", 2.0, -2.0, 2.0
        ),
    }
)


def to_iso(component: str, value: float, convention: str) -> float:
    """The squareness here from a value in another convention. Raises UsageError for an unknown name."""
    return _factor(component, convention) * value


def from_iso(component: str, value: float, convention: str) -> float:
    """The value of a squareness in another convention. Raises UsageError for an unknown name."""
    return value / _factor(component, convention)


def angle_words(component: str, value_rad: float) -> str:
    """The angle between the positive axes, such as "X to Y: 90 deg - 12.30 urad"."""
    first, second = ("XYZ"[i] for i in AXES_OF[component])
    more = -LEAN[component] * value_rad * 1e6
    return f"{first} to {second}: 90 deg {'-' if more < 0 else '+'} {abs(more):.2f} urad"


def lean_words(component: str, value_rad: float, sigma_rad: float) -> str:
    """To which side the later axis leans, such as "Y leans to +X", where its expanded uncertainty (k = 2)
    leaves no doubt."""
    first, second = ("XYZ"[i] for i in AXES_OF[component])
    if abs(value_rad) <= 2.0 * sigma_rad:
        return f"{second} to {first}: side not certain"
    return f"{second} leans to {'-' if LEAN[component] * value_rad < 0 else '+'}{first}"


def _factor(component: str, convention: str) -> float:
    if component not in SQUARENESS:
        raise UsageError(f"squareness {component!r}; expected one of {', '.join(SQUARENESS)}")
    if convention not in CONVENTIONS:
        raise UsageError(f"convention {convention!r}; expected one of {', '.join(CONVENTIONS)}")
    return CONVENTIONS[convention].factor[component]
