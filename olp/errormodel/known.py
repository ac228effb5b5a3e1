"""A few errors that a person knows as numbers: squareness, scale and backlash, without files."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field

from olp.core.arrays import Array
from olp.core.errors import UsageError
from olp.core.machine import SQUARENESS, ZERO, Vector
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.errormodel.calibration import Calibration, Curve

#: The squareness of two axes, and its value per lean of the later axis toward + of the earlier one.
_LEANS = {"XY": ("C0Y", -1.0), "XZ": ("B0Z", 1.0), "YZ": ("A0Z", -1.0)}
#: mm per mm; an axis that is off by more has another number of steps, or its whole ratio was stated.
_MOST_SCALE = 0.05
#: rad; axes that lean by more: the angle between them was stated.
_MOST_LEAN_RAD = 0.2

#: What a text is that cannot be read in a unit.
_WANTED = {
    "rad": "neither an angle nor a ratio of lengths; expected such as 1.4mm/m, 0.4mm/600mm or 300urad",
    "mm": "not a length; expected such as 0.05mm or 0.002in",
}
#: What is given as an example of such a value.
_SUCH = {"rad": "1.4mm/m", "mm": "0.05mm"}


@dataclass(frozen=True, slots=True)
class KnownErrors:
    """`squareness` C0Y, B0Z, A0Z in rad, `scale` by which each axis moves farther than commanded, and
    `backlash_mm` of each axis."""

    squareness: Mapping[str, float] = field(default_factory=dict)
    scale: Vector = ZERO
    backlash_mm: Vector = ZERO

    @staticmethod
    def of(skew: Iterable[str] = (), scale: Iterable[str] = (), backlash: Iterable[str] = ()) -> KnownErrors:
        """Errors as people write them: `skew` such as "XY=1.414mm/m", where Y leans toward +X, or
        "C0Y=-1414urad" with the sign of ISO 230-1; `scale` such as "X=0.2mm/m", where X moves too far;
        `backlash` such as "X=0.05mm". Raises UsageError."""
        squareness: dict[str, float] = {}
        for name, text, value in _pairs("skew", skew, (*_LEANS, *SQUARENESS), "rad"):
            own, sign = _LEANS.get(name, (name, 1.0))
            if abs(value) > _MOST_LEAN_RAD:
                raise UsageError(
                    f"skew {name}={text} is {math.degrees(value):.4g} deg; expected how far the angle "
                    "between the axes differs from 90 deg, such as 0.02deg or 0.4mm/600mm"
                )
            if own in squareness:
                raise UsageError(f"skew {name}={text} states {own} a second time; state each squareness once")
            squareness[own] = sign * value
        scales = _by_axis("scale", scale, "rad")
        if max(map(abs, scales)) > _MOST_SCALE:
            raise UsageError(
                f"a scale of {max(scales, key=abs):.4g} mm per mm; expected by how much the axis moves too "
                "far, such as -0.2% where it moves 99.8 mm instead of 100 mm"
            )
        return KnownErrors(squareness, scales, _by_axis("backlash", backlash, "mm"))

    def __bool__(self) -> bool:
        return bool(self.squareness or any(self.scale) or any(self.backlash_mm))

    @property
    def by_height(self) -> bool:
        """Whether the error depends on the position of Z."""
        return bool(self.squareness.get("B0Z") or self.squareness.get("A0Z") or self.scale[2])

    def calibration(self, machine: str, box_mm: Array) -> Calibration:
        """The calibration that states these errors and no others in a box (3, 2)."""
        curves = [
            Curve(axis, box_mm[i], {f"E{axis}{axis}": self.scale[i] * (box_mm[i] - box_mm[i].mean())})
            for i, axis in enumerate(AXES)
            if self.scale[i]
        ]
        return Calibration(
            machine, box_mm, curves=tuple(curves), squareness=self.squareness, backlash_mm=self.backlash_mm
        )

    def sentences(self) -> Iterator[str]:
        """What each number says of the machine, so that a wrong sign is seen."""
        for pair, (name, sign) in _LEANS.items():
            if name in self.squareness:
                lean = sign * self.squareness[name]
                toward = f"{'+' if lean >= 0 else '-'}{pair[0]}"
                iso = f"{name} = {self.squareness[name] / RAD_PER_URAD:.6g} urad"
                yield f"{pair[1]} leans toward {toward} by {abs(lean) * 1e3:.6g} mm per m ({iso})"
        for axis, scale in zip(AXES, self.scale, strict=True):
            if scale:
                farther = "farther" if scale > 0 else "less far"
                yield f"{axis} moves {abs(scale) * 1e3:.6g} mm per m {farther} than commanded"
        for axis, backlash in zip(AXES, self.backlash_mm, strict=True):
            if backlash:
                yield f"{axis} has a backlash of {backlash * UM_PER_MM:.6g} um"


def _by_axis(what: str, given: Iterable[str], unit: str) -> Vector:
    values = dict.fromkeys(AXES, 0.0)
    seen = set()
    for axis, text, value in _pairs(what, given, tuple(AXES), unit):
        if axis in seen:
            raise UsageError(f"{what} {axis}={text} states {axis} a second time; state each axis once")
        seen.add(axis)
        values[axis] = value
    return (values["X"], values["Y"], values["Z"])


def _pairs(
    what: str, given: Iterable[str], names: tuple[str, ...], unit: str
) -> Iterator[tuple[str, str, float]]:
    """Name, text and value in a unit of each NAME=VALUE; a slope is an angle."""
    from olp.core.quantities import quantity

    for each in given:
        name, equals, text = each.partition("=")
        name = name.strip().upper()
        if not equals or name not in names:
            raise UsageError(
                f"{what} {each!r}: expected NAME=VALUE with a name out of {', '.join(names)}, such as "
                f"{names[0]}={_SUCH[unit]}"
            )
        try:
            value = quantity(text, unit)
        except ValueError:
            comma = "; write a decimal point instead of the comma" if "," in text else ""
            raise UsageError(f"{what} {name}={text} is {_WANTED[unit]}{comma}") from None
        yield name, text.strip(), value
