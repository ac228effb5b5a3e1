"""Doubts about whole columns of a calibration: in another unit, of zeros, or with an offset."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from olp.checks.base import finding
from olp.core.arrays import Array, median
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.uncertainty import Uncertainty
from olp.findings.catalogue import Finding

#: Columns in another unit are smaller than the others by so much: 1000 less a span of values, ...
_OTHER_UNIT = 300.0
#: ... and by no more than this: inches are 25,400 times smaller. What is smaller is left of nothing.
_MOST_OTHER_UNIT = 100_000.0
#: mm; a column of lengths in another unit has no value above this.
_TINY_MM = 0.5e-3
#: rad; a column of angles in another unit has no value above this.
_TINY_RAD = 0.5e-6
#: A column and its own sigma column may be in units that differ by so much: inches and micrometres. An
#: adjustment has one unit.
_UNITS_APART = 25_400.0
#: Columns beside one, without which none is the odd one.
_OTHERS = 3
#: rad; angles of all axes, or all squareness, in mrad or degrees. Autocollimators resolve 0.05 urad.
_NO_ANGLE_RAD = 0.2e-6
#: rad; below this an angle is what an adjustment leaves of nothing.
_NOTHING_RAD = 1e-12
#: Over the diagonal of the box they are less than this share of the largest error of length. Machines of 5 um
#: have shares of 2 %.
_SHARE_OF_LENGTHS = 3e-3
#: Errors per length that no instrument measures: 0.1 um/m.
UNMEASURABLE = 1e-7
#: mm; an offset of a whole column above this shows no error of the machine.
_OFFSET_MM = 0.2
#: rad; the same of angles: an autocollimator that was not set to zero.
_OFFSET_RAD = 1e-3
#: An offset is so many times what the column varies by.
_OFFSET_SHARE = 10.0
#: Values of a column below which an offset is not told from its course.
_FEW = 3

_KINDS = (("XYZ", "errors", _TINY_MM), ("ABC", "angles", _TINY_RAD))
_EXPECTED = "expected columns in um and urad"


def unit_doubts(calibration: Calibration, uncertainty: Uncertainty | None) -> Iterator[Finding]:
    """All doubts about columns of curves, squareness and maps. What `uncertainty` says that no reading shows
    is small for that reason, and in no other unit."""
    sizes = {letters: _shown(_sizes(calibration, letters), "mean", uncertainty) for letters, *_ in _KINDS}
    for letters, what, tiny in _KINDS:
        axes = list(_axes_of_other_unit(sizes[letters], what, tiny))
        yield from axes or _columns_of_other_unit(sizes[letters], tiny)
    angle, length = (max(sizes[letters].values(), default=0.0) for letters in ("ABC", "XYZ"))
    nothing_mm = _SHARE_OF_LENGTHS * length
    yield from _no_angles(calibration, angle, nothing_mm)
    square = {name: abs(value) for name, value in calibration.squareness.items() if value}
    yield from _squareness(calibration, _shown(square, "squareness", uncertainty), nothing_mm)
    yield from _maps(calibration)
    yield from _offsets(calibration)


def columns(curve: Curve) -> Iterator[tuple[str, Array]]:
    """Every column with its component, that of each direction on its own."""
    parts: tuple[Mapping[str, Array], ...] = (curve.columns, curve.forward, curve.backward)
    for part in parts:
        yield from part.items()


def stated(name: str, value: float) -> str:
    """A value of a component with its unit, as files name it."""
    if name[1] in AXES:
        return f"{name}_um = {value * UM_PER_MM:.6g}"
    return f"{name}_urad = {value / RAD_PER_URAD:.6g}"


def _sizes(calibration: Calibration, letters: str) -> dict[str, float]:
    """The largest value of each component whose second letter is one of these, without those of zeros."""
    sizes: dict[str, float] = {}
    for curve in calibration.curves:
        for name, values in columns(curve):
            if name[1] in letters:
                sizes[name] = max(sizes.get(name, 0.0), float(np.abs(values).max()))
    return {name: size for name, size in sizes.items() if size}


def _shown(sizes: Mapping[str, float], kind: str, uncertainty: Uncertainty | None) -> dict[str, float]:
    """Those that are more than their standard uncertainty at half of their positions, or have none. A sigma
    column hides only what it would hide in a larger unit, too."""
    if uncertainty is None:
        return dict(sizes)
    factor = 1.0 if uncertainty.rank else _UNITS_APART
    known = {entry.name: median(entry.sigma) for entry in uncertainty.entries if entry.kind == kind}
    return {name: size for name, size in sizes.items() if factor * size > known.get(name, 0.0)}


def _axes_of_other_unit(sizes: Mapping[str, float], what: str, tiny: float) -> Iterator[Finding]:
    """Columns of one axis that are a thousand times smaller than those of both other axes."""
    largest = {axis: max((v for n, v in sizes.items() if n[2] == axis), default=0.0) for axis in AXES}
    for axis, size in largest.items():
        least = min(value for other, value in largest.items() if other != axis)
        if 0.0 < size < tiny and least > _OTHER_UNIT * size:
            text = f"calibration: the {what} of axis {axis} are {least / size:.0f} times smaller than those "
            yield finding("OLP450", f"{text}of the other axes; {_EXPECTED}")


def _columns_of_other_unit(sizes: Mapping[str, float], tiny: float) -> Iterator[Finding]:
    """One column that is a thousand times smaller than most others."""
    for name, size in sizes.items():
        others = [value for other, value in sizes.items() if other != name]
        if size >= tiny or len(others) < _OTHERS:
            continue
        ratio = median(np.array(others)) / size
        if _OTHER_UNIT < ratio < _MOST_OTHER_UNIT:
            text = f"calibration: largest {stated(name, size)}, {ratio:.0f} times smaller than other columns"
            yield finding("OLP450", f"{text}; {_EXPECTED}")


def _no_angles(calibration: Calibration, angle: float, nothing_mm: float) -> Iterator[Finding]:
    if _vanishing(angle, calibration, nothing_mm):
        text = f"calibration: the angles of all axes are at most {angle / RAD_PER_URAD:.2g} urad"
        yield finding("OLP450", f"{text}, which is nothing beside its other errors; {_EXPECTED}")


def _squareness(calibration: Calibration, sizes: Mapping[str, float], nothing_mm: float) -> Iterator[Finding]:
    largest = max(sizes.values(), default=0.0)
    if len(sizes) > 1 and _vanishing(largest, calibration, nothing_mm):
        text = f"calibration: every squareness is at most {largest / RAD_PER_URAD:.2g} urad"
        yield finding("OLP450", f"{text}; expected angles in urad that can be measured")


def _vanishing(angle: float, calibration: Calibration, nothing_mm: float) -> bool:
    """Whether an angle is stated and does nothing on this machine."""
    return _NOTHING_RAD < angle < _NO_ANGLE_RAD and angle * _span_mm(calibration) < nothing_mm


def _span_mm(calibration: Calibration) -> float:
    return float(np.linalg.norm(np.ptp(calibration.box_mm, axis=1)))


def _maps(calibration: Calibration) -> Iterator[Finding]:
    least = UNMEASURABLE * _span_mm(calibration)
    for one in calibration.maps:
        size = float(np.abs(one.values).max())
        if 0.0 < size < least:
            text = f"calibration: {one.name} has no deviation above {size * UM_PER_MM:.2g} um"
            yield finding("OLP451", f"{text}; expected more than {least * UM_PER_MM:.2g} um")


def zero_curves(calibration: Calibration) -> Iterator[Finding]:
    """Curves of nothing but zeros, as a skeleton has them. A fit, which names its sources, writes what it did
    not observe as zeros with their uncertainty."""
    if calibration.quality is not None and calibration.quality.sources:
        return
    for curve in calibration.curves:
        if not any(values.any() for _, values in columns(curve)):
            text = f"calibration: every value of a curve of axis {curve.axis} is zero"
            yield finding("OLP466", f"{text}; expected measured values, or no such curve")


def _offsets(calibration: Calibration) -> Iterator[Finding]:
    for curve in calibration.curves:
        for name, values in columns(curve):
            middle = median(values)
            limit = _OFFSET_MM if name[1] in AXES else _OFFSET_RAD
            varies = float(np.abs(values - middle).max())
            if len(values) >= _FEW and abs(middle) > max(limit, _OFFSET_SHARE * varies):
                text = f"calibration: all of {stated(name, middle)} and less than a tenth of that up or down"
                yield finding("OLP464", f"{text}; expected readings that were set to zero")
