"""Doubts about the calibration of a machine of any joints: units, typing errors, another machine."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Sequence

import numpy as np

from olp.checks.base import finding
from olp.checks.doubt_calibration import (
    BOX_BEYOND,
    BOX_BEYOND_MM,
    LENGTHS,
    NOTICED_MM,
    NOTICED_RAD,
    PHASE_RAD,
    neighbours,
    standing_out,
    unit_between,
)
from olp.checks.doubt_units import UNMEASURABLE
from olp.core.arrays import Array, Index
from olp.core.units import AXES, RAD_PER_URAD, UM_PER_MM
from olp.core.values import dataclass
from olp.findings.catalogue import Finding
from olp.kinematics.chain import Kinematics
from olp.kinematics.errors import COMPONENTS, OWN, JointErrors
from olp.kinematics.machine import JointCalibration
from olp.kinematics.structure import Joint, Structure

#: mm; errors of the tip of a small machine that are plausible.
_FLOOR_MM = 0.5
#: Postures all over the calibrated values at which the error is computed.
_POSTURES = 200
#: Factor between units of angles.
_ANGLES = {"radians": float(np.degrees(1.0))}
#: Two turns and a half: values that are radians span less.
_RADIANS = 16.0
#: Numbers of one unit by which it is judged ...
_FEW = 3
#: ... and how many times those that are tiny in the other one has to be.
_OTHERS = 10.0


@dataclass(frozen=True, slots=True)
class _Sane:
    """What is plausible: errors of the tip as a share of the space that it reaches; angles in rad; play and
    cyclic errors in mm and rad. A whole calibration has no length or angle above `tiny` only where it is in
    another unit."""

    share: float
    angle_rad: float
    play_mm: float
    play_rad: float
    cyclic_mm: float
    cyclic_rad: float
    tiny_mm: float
    tiny_rad: float


#: Three slides that stand on each other keep their tip within 1 mm per m, as machines of three axes do.
_SLIDES = _Sane(1e-3, 10e-3, 1.0, 10e-3, 0.1, 1e-3, 0.5e-3, 0.5e-6)
#: Arms, platforms and other joints: zeros are off by up to 3 deg, gears by 5 mrad.
_OTHER = _Sane(1e-2, 50e-3, 2.0, 20e-3, 0.5, 5e-3, 1e-3, 2e-6)


def joint_doubts(
    calibration: JointCalibration,
    machines: Sequence[Kinematics],
    limit_mm: float,
    date: datetime.date | None,
) -> Iterator[Finding]:
    """All doubts about the calibration of a machine with some tools. `limit_mm` is its largest plausible
    error."""
    structure = machines[0].structure
    sane = _sane(structure)
    if date is not None and date < calibration.measured:
        what = f"calibration: measured = {calibration.measured}, after the day of the run, {date}"
        yield finding("OLP460", what)
    for name, errors in calibration.errors.joints.items():
        joint = structure.joints[name]
        yield from _angles(name, joint, errors, sane)
        yield from _play(name, joint, errors, sane)
        yield from _cyclic(name, joint, errors, sane)
        yield from _spikes(name, joint, errors)
    yield from _box(calibration, structure)
    yield from _units(calibration, structure, sane)
    yield from _sizes(calibration, machines, limit_mm)


def _sane(structure: Structure) -> _Sane:
    joints = [structure.joints[name] for name in structure.chain if name in structure.joints]
    return _SLIDES if sum(joint.kind == "linear" for joint in joints) >= len(AXES) else _OTHER


def _angles(name: str, joint: Joint, errors: JointErrors, sane: _Sane) -> Iterator[Finding]:
    stated = [("tilt", max(map(abs, errors.tilt_rad)))]
    if joint.kind == "rotary":
        stated.append(("zero", abs(errors.zero)))
    for curve in errors.curves:
        angles = curve.values.y[:, len(AXES) : OWN + (joint.kind == "rotary")]
        stated.append(("largest angle of a curve", float(np.abs(angles).max())))
    for what, angle in stated:
        if angle > sane.angle_rad:
            text = f"calibration: {what} of {name} is {angle / RAD_PER_URAD:.6g} urad"
            yield finding("OLP446", f"{text}; expected at most {sane.angle_rad / RAD_PER_URAD:.0f} urad")


def _play(name: str, joint: Joint, errors: JointErrors, sane: _Sane) -> Iterator[Finding]:
    rotary = joint.kind == "rotary"
    limit, scale, unit = _of_unit(rotary, sane.play_mm, sane.play_rad)
    if abs(errors.backlash) > limit:
        text = f"calibration: backlash of {name} is {errors.backlash * scale:.6g} {unit}"
        yield finding("OLP447", f"{text}; expected at most {limit * scale:.0f} {unit}")


def _cyclic(name: str, joint: Joint, errors: JointErrors, sane: _Sane) -> Iterator[Finding]:
    for wave in errors.harmonics:
        limit, scale, unit = _of_unit(_turns(wave.component, joint), sane.cyclic_mm, sane.cyclic_rad)
        travel = max(float(np.ptp(joint.travel)), 360.0 if joint.kind == "rotary" else 0.0)
        what = f"calibration: cyclic {COMPONENTS[wave.component]} of {name}"
        if abs(wave.amplitude) > limit:
            what += f" has an amplitude of {abs(wave.amplitude) * scale:.6g} {unit}"
            yield finding("OLP448", f"{what}; expected at most {limit * scale:g} {unit}")
        elif wave.period > travel:
            what += f" has a period of {wave.period:g} {joint.unit}"
            yield finding("OLP448", f"{what}; expected less than the travel, {travel:g} {joint.unit}")
        elif abs(wave.phase_rad) > PHASE_RAD:
            what += f" has a phase of {wave.phase_rad:g} rad"
            yield finding("OLP448", f"{what}; expected at most {PHASE_RAD:.4g}, a whole turn")


def _spikes(name: str, joint: Joint, errors: JointErrors) -> Iterator[Finding]:
    for curve in errors.curves:
        for column, component in enumerate(COMPONENTS):
            values = np.asarray(curve.values.y[:, column])
            noticed, scale, unit = _of_unit(_turns(column, joint), NOTICED_MM, NOTICED_RAD)
            k = standing_out(values, noticed)
            if k is not None:
                at = f"{name} = {float(curve.values.x[k]):g} {joint.unit}"
                beside = ", ".join(f"{value * scale:.4g}" for value in neighbours(values, k))
                what = f"calibration: {component} = {values[k] * scale:.6g} {unit} at {at} stands out"
                yield finding("OLP449", f"{what}; expected a value like its neighbours, {beside}")


def _turns(component: int, joint: Joint) -> bool:
    """Whether a component is an angle."""
    return joint.kind == "rotary" if component == OWN else component >= len(AXES)


def _of_unit(angle: bool, mm: float, rad: float) -> tuple[float, float, str]:
    """A limit, its scale in reports, and its unit there."""
    return (rad, 1.0 / RAD_PER_URAD, "urad") if angle else (mm, UM_PER_MM, "um")


def _box(calibration: JointCalibration, structure: Structure) -> Iterator[Finding]:
    for name, (low, high) in calibration.box.items():
        joint = structure.joints[name]
        least, most = joint.travel
        if not np.isfinite((least, most)).all() or most <= least:
            continue
        what = f"calibration: box of {name} is {low:g} to {high:g}, the travel {least:g} to {most:g}"
        what += f" {joint.unit}"
        box, travel = high - low, most - least
        rotary, slack = joint.kind == "rotary", max(BOX_BEYOND * travel, BOX_BEYOND_MM)
        unit = unit_between(box, travel, _ANGLES if rotary else LENGTHS)
        # hundreds of turns are many times a turn, too
        if unit and (not rotary or min(box, travel) < _RADIANS):
            yield finding("OLP452", f"{what}: one of them seems to be in {unit}; expected {joint.unit}")
        # a rotary axis may be calibrated over more than it turns
        elif not rotary and (low < least - slack or high > most + slack):
            yield finding("OLP452", f"{what}; expected values within the travel of this machine")


def _units(calibration: JointCalibration, structure: Structure, sane: _Sane) -> Iterator[Finding]:
    """All lengths, or all angles, a thousand times smaller than those of machines, and the others not."""
    lengths, angles = list[float](), list[float]()
    for name, errors in calibration.errors.joints.items():
        lengths += map(abs, errors.shift_mm)
        angles += map(abs, errors.tilt_rad)
        (angles if structure.joints[name].kind == "rotary" else lengths).append(abs(errors.zero))
        for curve in errors.curves:
            sizes = np.abs(curve.values.y).max(axis=0).tolist()
            lengths += sizes[: len(AXES)]
            angles += sizes[len(AXES) : OWN]
    for leg in calibration.errors.legs.values():
        lengths += map(abs, (*leg.base_mm, *leg.platform_mm, leg.length_mm))
    stated = [[size for size in sizes if size] for sizes in (lengths, angles)]
    ways = ((sane.tiny_mm, "um", UM_PER_MM), (sane.tiny_rad, "urad", 1.0 / RAD_PER_URAD))
    for own, (tiny, unit, scale), others, (large, *_) in zip(
        stated, ways, stated[::-1], ways[::-1], strict=True
    ):
        if len(own) >= _FEW and max(own) < tiny and max(others, default=0.0) > _OTHERS * large:
            text = f"calibration: its errors in {unit} are at most {max(own) * scale:.2g} {unit}"
            yield finding("OLP450", f"{text}, which is nothing beside its other errors; expected {unit}")


def _sizes(
    calibration: JointCalibration, machines: Sequence[Kinematics], limit_mm: float
) -> Iterator[Finding]:
    """Errors of the tip too large at calibrated values, or too small to be measured. A platform does not
    close at all of them: there what a program commands is judged alone."""
    structure = machines[0].structure
    if structure.platforms:
        return
    values = _postures(calibration, structure)
    off = np.array([np.linalg.norm(machine.deviation(values)[0], axis=1) for machine in machines]).max(axis=0)
    worst, reach = float(off.max()), _reach_mm(calibration, structure)
    if worst > limit_mm:
        at = values[int(off.argmax())].tolist()
        place = ", ".join(f"{name} {value:.4g}" for name, value in zip(structure.order, at, strict=True))
        what = f"calibration: the error is {worst * UM_PER_MM:.0f} um at {place}, among the calibrated values"
        yield finding("OLP445", f"{what}; at most {limit_mm * UM_PER_MM:.0f} um are expected of this machine")
    elif 0.0 < worst < UNMEASURABLE * reach:
        what = f"calibration: the error is at most {worst * UM_PER_MM:.2g} um at any calibrated values"
        yield finding("OLP451", f"{what}; expected more than {UNMEASURABLE * reach * UM_PER_MM:.2g} um")


def plausible_mm(calibration: JointCalibration, structure: Structure, stated_mm: float | None) -> float:
    """The largest plausible error of the tip: what the machine file states, else a share of its reach."""
    if stated_mm is not None:
        return stated_mm
    return max(_sane(structure).share * _reach_mm(calibration, structure), _FLOOR_MM)


def waypoint_doubts(off_mm: Array, line: Index, limit_mm: float) -> list[Finding]:
    """Errors (n,) mm of the tip at waypoints of these lines that are larger than plausible."""
    wild = off_mm > limit_mm
    if not wild.any():
        return []
    expected = f"at most {limit_mm * UM_PER_MM:.0f} um are expected of this machine"
    what = f"the error is up to {off_mm.max() * UM_PER_MM:.0f} um at {int(wild.sum())} waypoints; {expected}"
    return [finding("OLP409", what, line[wild].tolist())]


def _reach_mm(calibration: JointCalibration, structure: Structure) -> float:
    """The diagonal of the space that the tip reaches at calibrated values; of a platform about that of its
    legs."""
    if structure.platforms:
        spans = (np.ptp(joint.travel) for joint in structure.joints.values() if joint.kind != "rotary")
        return float(np.linalg.norm(sorted(map(float, spans))[-len(AXES) :]))
    tips = Kinematics(structure).nominal(_postures(calibration, structure)).position
    return float(np.linalg.norm(np.ptp(tips, axis=0)))


def _postures(calibration: JointCalibration, structure: Structure) -> Array:
    """(n, axes) values all over what is calibrated; axes without calibrated values are at the middle of their
    travel."""
    bounds = []
    for name, joint in structure.joints.items():
        least, most = joint.travel
        middle = 0.5 * (least + most) if np.isfinite((least, most)).all() else 0.0
        bounds.append(calibration.box.get(name, (middle, middle)))
    low, high = np.array(bounds).T
    share = np.random.default_rng(0).uniform(size=(_POSTURES, len(bounds)))
    return np.asarray(low + (high - low) * share)
