"""Doubts about a calibration: zeros, units, typing errors, places, and how well it fits its readings."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping

import numpy as np

from olp.checks.base import finding
from olp.checks.doubt_units import columns, stated, unit_doubts, zero_curves
from olp.core.arrays import Array
from olp.core.machine import Machine
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.errormodel.calibration import PLACEHOLDER_DATE, Calibration
from olp.errormodel.uncertainty import Uncertainty
from olp.findings.catalogue import Finding

#: rad; squareness of a machine that a person aligned with a try square. 667 urad of a hobby router pass.
_SQUARE_RAD = 10e-3
#: rad; angular errors of an axis: 5 mm at the ends of a carriage of 1 m.
_ANGLE_RAD = 5e-3
#: mm; backlash that a person sees. Hobby routers have 0.3 mm.
_BACKLASH_MM = 1.0
#: Share of the travel that backlash may be: 0.5 mm on 100 mm.
_BACKLASH_SHARE = 5e-3
#: mm; backlash that the shortest axis may have.
_BACKLASH_LEAST_MM = 0.1
#: mm; peak of a cyclic error: that of a bent ball screw is 0.02 mm.
_CYCLIC_MM = 0.1
#: rad; peak of a cyclic angle: ten times that of a bent ball screw.
_CYCLIC_RAD = 1e-3
#: Error per way of a cyclic term: interpolation errors of encoders are 3 % of their period, so 0.2.
_CYCLIC_SLOPE = 0.2
#: rad; phases are stated within a turn: 90 is one in degrees.
PHASE_RAD = 2.0 * np.pi
#: A value stands out where it is so many times all others of its column ...
_STANDS_OUT = 8.0
#: ... or off its neighbours by so many times what any other value is.
_OFF = 25.0
#: mm; a length that stands out by less may be noise.
NOTICED_MM = 2e-3
#: rad; an angle that stands out by less may be noise.
NOTICED_RAD = 10e-6
#: Values of a column below which none can stand out: one of five is a sag.
_FEW = 7
#: How much of the travel calibrated boxes cover: 40 % at least in a wrong unit, so that the factor shows.
_COVERED = (0.4, 1.02)
#: Factors between units of lengths.
LENGTHS = {"inches": 25.4, "metres": 1000.0}
#: The box may reach beyond the travel by this share of it: rounded limits, overtravel.
BOX_BEYOND = 0.05
#: mm; and by this much, for short axes.
BOX_BEYOND_MM = 10.0
#: Positions of a curve may span so many times the larger of box and travel.
_CURVE_BEYOND = 3.0
#: A line or datum may lie outside box and travel by so many times the travel: other zeros of the axes.
_PLACE_BEYOND = 1.0
#: 1/K; expansion of scales: 0 for fused silica, 11.5e-6 for steel, 24e-6 for aluminium.
_SCALE_PER_K = (0.03e-6, 40e-6)
#: 1/K; of workpieces, plastics included.
_WORKPIECE_PER_K = (0.03e-6, 300e-6)


def calibration_doubts(
    calibration: Calibration,
    machine: Machine,
    date: datetime.date | None,
    uncertainty: Uncertainty | None,
    *,
    made: bool = True,
) -> Iterator[Finding]:
    """All doubts that a calibration and its machine raise, without a program; what only one that is `made`
    from readings states is not missed in others."""
    yield from list(_zeros(calibration)) or zero_curves(calibration)
    yield from _dates(calibration, date)
    if made:
        yield from _quality(calibration)
    yield from _angles(calibration)
    yield from _backlash(calibration, machine)
    yield from _cyclic(calibration, machine)
    yield from _columns(calibration)
    yield from unit_doubts(calibration, uncertainty)
    yield from _box(calibration, machine)
    yield from _places(calibration, machine)
    yield from _expansion(calibration)


def _zeros(calibration: Calibration) -> Iterator[Finding]:
    c, thermal = calibration, calibration.thermal
    numbers = (
        *c.squareness.values(), *c.backlash_mm, *(term.amplitude for term in c.cyclic),
        *(thermal.scale_per_K if thermal else ()), thermal.workpiece_per_K if thermal else 0.0,
    )  # fmt: skip
    tables = (*(v for curve in c.curves for _, v in columns(curve)), *(one.values for one in c.maps))
    others = (c.structure, c.compliance, c.beams, c.more)
    if any(numbers) or any(others) or any(values.any() for values in tables):
        return
    if tables or c.cyclic:
        yield finding("OLP440", "calibration: every value is zero, so nothing would be corrected")
    else:
        what = "calibration: it has no curves, maps or other errors, so nothing would be corrected"
        yield finding("OLP441", what)


def _dates(calibration: Calibration, date: datetime.date | None) -> Iterator[Finding]:
    measured = calibration.measured
    if measured == PLACEHOLDER_DATE:
        yield finding("OLP442", f"calibration: measured = {measured} is the date that olp init writes")
    elif date is not None and measured is not None and date < measured:
        yield finding("OLP460", f"calibration: measured = {measured}, after the day of the run, {date}")


def _quality(calibration: Calibration) -> Iterator[Finding]:
    if calibration.quality is None:
        what = "calibration: it has no [quality], so how well it fits its readings is not known"
        yield finding("OLP444", what)
        return
    failed = calibration.quality.failed()
    if failed:
        worst = failed[0]
        what = f"calibration: reduced chi-square of {worst.source} is {worst.reduced:.3g} with "
        what += f"{worst.freedom:.0f} degrees of freedom; expected about 1, and 4 at most"
        yield finding("OLP443", what, count=len(failed))


def _angles(calibration: Calibration) -> Iterator[Finding]:
    for name, angle in calibration.squareness.items():
        if abs(angle) > _SQUARE_RAD:
            yield _angle(f"squareness.{name}_urad", angle, _SQUARE_RAD)
    for curve in calibration.curves:
        for name, values in columns(curve):
            largest = float(np.abs(values).max())
            if name[1] not in AXES and largest > _ANGLE_RAD:
                yield _angle(f"largest {name}_urad", largest, _ANGLE_RAD)


def _angle(what: str, angle: float, limit: float) -> Finding:
    text = f"calibration: {what} = {angle / RAD_PER_URAD:.6g}"
    return finding("OLP446", f"{text}; expected at most {limit / RAD_PER_URAD:.0f} urad")


def _backlash(calibration: Calibration, machine: Machine) -> Iterator[Finding]:
    for axis, value in zip(AXES, calibration.backlash_mm, strict=True):
        share = max(_BACKLASH_SHARE * _travel(machine, axis), _BACKLASH_LEAST_MM)
        limit = min(_BACKLASH_MM, share)
        if abs(value) > limit:
            what = f"calibration: backlash.{axis}_um = {value * UM_PER_MM:.6g}"
            yield finding("OLP447", f"{what}; expected at most {limit * UM_PER_MM:.0f} um")


def _cyclic(calibration: Calibration, machine: Machine) -> Iterator[Finding]:
    for term in calibration.cyclic:
        name, linear = term.component, term.component[1] in AXES
        limit, scale, unit = (
            (_CYCLIC_MM, UM_PER_MM, "um") if linear else (_CYCLIC_RAD, 1.0 / RAD_PER_URAD, "urad")
        )
        size, travel = abs(term.amplitude), _travel(machine, name[2])
        what = f"calibration: cyclic {name}"
        if size > limit:
            text = f"{what}: amplitude_{unit} = {size * scale:.6g}; expected at most {limit * scale:g}"
        elif term.period_mm > travel:
            text = f"{what}: period_mm = {term.period_mm:g}; expected less than the travel, {travel:g} mm"
        elif abs(term.phase_rad) > PHASE_RAD:
            text = f"{what}: phase_rad = {term.phase_rad:g}; expected at most {PHASE_RAD:.4g}, a whole turn"
        elif linear and size * 2.0 * np.pi > _CYCLIC_SLOPE * term.period_mm:
            text = f"{what}: {size * scale:g} um in a period of {term.period_mm:g} mm; expected a longer one"
        else:
            continue
        yield finding("OLP448", text)


def _columns(calibration: Calibration) -> Iterator[Finding]:
    for curve in calibration.curves:
        for name, values in columns(curve):
            k = standing_out(values, NOTICED_MM if name[1] in AXES else NOTICED_RAD)
            if k is not None:
                scale = UM_PER_MM if name[1] in AXES else 1.0 / RAD_PER_URAD
                place = f"{curve.axis} = {curve.position_mm[k]:g} mm"
                what = f"calibration: {stated(name, values[k])} at {place} stands out"
                beside = ", ".join(f"{v * scale:.4g}" for v in neighbours(values, k))
                yield finding("OLP449", f"{what}; expected a value like its neighbours, {beside}")


def standing_out(values: Array, noticed: float) -> int | None:
    """The index of a value that is no continuation of its neighbours, None where there is none."""
    if len(values) < _FEW:
        return None
    size = np.abs(values)
    k = int(size.argmax())
    rest = float(np.delete(size, k).max())
    if size[k] > noticed and size[k] > _STANDS_OUT * rest:
        return k
    # off the mean of both neighbours; a spike of d shows as -d/2, d, -d/2
    off = values[1:-1] - 0.5 * (values[:-2] + values[2:])
    k = int(np.abs(off).argmax())
    others = np.delete(np.abs(off), [i for i in (k - 1, k, k + 1) if 0 <= i < len(off)])
    beside = [-2.0 * off[i] / off[k] for i in (k - 1, k + 1) if 0 <= i < len(off) and off[k]]
    spike = bool(beside) and min(beside) > 0.5
    if spike and others.size and abs(off[k]) > max(noticed, _OFF * float(others.max())):
        return k + 1
    return None


def neighbours(values: Array, k: int) -> list[float]:
    """The values on both sides of one, where there are any."""
    return [float(values[i]) for i in (k - 1, k + 1) if 0 <= i < len(values)]


def _box(calibration: Calibration, machine: Machine) -> Iterator[Finding]:
    for axis, (low, high) in zip(AXES, calibration.box_mm.tolist(), strict=True):
        least, most = machine.axes[axis].travel_mm
        box, travel = high - low, most - least
        unit = unit_between(box, travel, LENGTHS)
        stated = f"calibration: box_mm of {axis} is {low:g} to {high:g}, the travel {least:g} to {most:g} mm"
        slack = max(BOX_BEYOND * travel, BOX_BEYOND_MM)
        if unit:
            yield finding("OLP452", f"{stated}: one of them seems to be in {unit}; expected mm")
        elif low < least - slack or high > most + slack:
            yield finding("OLP452", f"{stated}; expected a box within the travel of this machine")


def unit_between(box: float, travel: float, units: Mapping[str, float]) -> str | None:
    """The one of the units, by their factors, in which a box would fit a travel better."""
    low, high = _COVERED
    for unit, factor in units.items():
        if any(low <= ratio * factor <= high for ratio in (box / travel, travel / box)):
            return unit
    return None


def _places(calibration: Calibration, machine: Machine) -> Iterator[Finding]:
    named = [("datum_mm", calibration.datum_mm, "")]
    for curve in calibration.curves:
        least, most = machine.axes[curve.axis].travel_mm
        low, high = calibration.box_mm[AXES.index(curve.axis)].tolist()
        span, expected = float(np.ptp(curve.position_mm)), max(most - least, high - low)
        if span > _CURVE_BEYOND * expected:
            what = f"calibration: the positions of a curve of {curve.axis} span {span:g} mm"
            yield finding("OLP453", f"{what}; expected about its travel, {expected:g} mm")
        if curve.line_mm is not None:
            named.append((f"line_mm of curve {curve.axis}", curve.line_mm, curve.axis))
    for key, vector, own in named:
        for k, (axis, place) in enumerate(zip(AXES, vector, strict=True)):
            least, most = machine.axes[axis].travel_mm
            low, high = min(least, calibration.box_mm[k, 0]), max(most, calibration.box_mm[k, 1])
            slack = _PLACE_BEYOND * (high - low)
            if axis != own and not low - slack <= place <= high + slack:
                what = f"calibration: {key} has {axis} = {place:g}, far outside the travel"
                yield finding("OLP453", f"{what}; expected {low:g} to {high:g} mm")


def _expansion(calibration: Calibration) -> Iterator[Finding]:
    thermal = calibration.thermal
    if thermal is None:
        return
    factors = [(f"{a}_scale_um_m_K", v, _SCALE_PER_K) for a, v in zip(AXES, thermal.scale_per_K, strict=True)]
    factors.append(("workpiece_um_m_K", thermal.workpiece_per_K, _WORKPIECE_PER_K))
    for key, value, (least, most) in factors:
        if value != 0.0 and not least <= abs(value) <= most:
            what = f"calibration: thermal.{key} = {value * 1e6:.6g}"
            yield finding("OLP458", f"{what}; expected 0, or {least * 1e6:g} to {most * 1e6:g} um/m/K")


def _travel(machine: Machine, axis: str) -> float:
    return float(np.ptp(machine.axes[axis].travel_mm))
