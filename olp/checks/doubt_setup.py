"""Doubts about machine and job: tools, work offsets, temperatures, payloads."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from olp.checks.base import finding, first_lines
from olp.checks.state import tool_findings
from olp.core.machine import Machine, Setup, Vector
from olp.core.toolpath import Frame, Toolpath
from olp.errormodel.calibration import Calibration
from olp.findings.catalogue import Finding

#: mm; a tool vector below this is a length in metres. The shortest real ones are tips at the gauge point.
_METRES_MM = 1.0
#: A tool longer than so many times the travel of Z ...
_LONG = 2.0
#: ... and than this, in mm: spindle noses and heads of five axes reach 600 mm.
_LONG_MM = 700.0
#: mm per inch.
_INCH_MM = 25.4
#: Share by which two lengths of one tool differ at most: it is set again, or rounded.
_NEAR = 0.02
#: A tool is grossly unlike those of the calibration at so many times tool_within_mm.
_GROSS = 8.0
#: A work offset may lie outside the travel by this share of it, beside the longest tool: other zeros.
_BEYOND = 0.5
#: mm; the coarsest least increment: hobby controls and robots have 0.01.
_INCREMENT_MM = 0.1
#: mm/s; the fastest gantries have linear motors of 5 m/s. 6 m/min in mm/min are 6000.
_FAST_MM_S = 5500.0
#: s; an axis that needs longer for its whole travel at full speed has its speed in another unit.
_ACROSS_S = 1200.0
#: degC; scales and workpieces of a workshop. 68 degF is 20 degC, and so is 293 K.
_WORKSHOP_DEGC = (0.0, 50.0)
#: degC; sensors of a structure may sit on a motor.
_SENSOR_DEGC = (-20.0, 120.0)
#: kg; the heaviest payloads of large gantries. 30 kg in grams are more.
_HEAVY_KG = 20_000.0


def setup_doubts(path: Toolpath, setup: Setup, calibration: Calibration | None) -> list[Finding]:
    """Doubts about the tools and offsets that a path uses, and about what the job states."""
    lines = first_lines(path)
    frames = {number: path.frames[number] for number in lines}
    findings = [*_axes(setup.machine), *_temperatures(setup, calibration), *_start(setup)]
    findings += _payloads(frames, calibration)
    findings += _tools(path, lines, frames, setup, calibration)
    findings += _offsets(lines, frames, setup)
    return findings


def _name(frame: Frame) -> str:
    return "the tool in use" if frame.tool is None else f"tools.{frame.tool}"


def _tools(
    path: Toolpath,
    first: dict[int, int],
    frames: dict[int, Frame],
    setup: Setup,
    calibration: Calibration | None,
) -> Iterator[Finding]:
    machine = setup.machine
    known = [] if calibration is None else [c.tool_mm for c in calibration.curves]
    travel = float(np.ptp(machine.axes["Z"].travel_mm))
    most = max(_LONG * travel, _LONG_MM)
    gross = _GROSS * machine.sanity.tool_within_mm
    seen: set[tuple[float, ...]] = set()
    far = False
    for number, frame in frames.items():
        if frame.tool_mm in seen:
            continue
        seen.add(frame.tool_mm)
        size = float(np.linalg.norm(frame.tool_mm))
        lines = [first[number]]
        what = f"{_name(frame)}: its tip is {size:g} mm from the gauge point"
        mirrored = _mirrored(frame, known, setup)
        inches = [tool for tool in known if _in_inches(frame.tool_mm, tool)]
        if inches:
            own = float(np.linalg.norm(inches[0]))
            text = f"{what}, and {own:g} mm is the tool of the calibration: the same number in inches"
            yield finding("OLP454", text, lines)
        elif mirrored is not None:
            yield finding("OLP454", f"{what}, on the other side than {mirrored}: a wrong sign", lines)
        elif 0.0 < size < _METRES_MM or size > most:
            yield finding("OLP454", f"{what}; expected 0, or {_METRES_MM:g} to {most:g} mm", lines)
        elif known and min(_away(frame.tool_mm, tool) for tool in known) > gross:
            away = min(_away(frame.tool_mm, tool) for tool in known)
            text = f"{what}, {away:g} mm from that of every tool of the calibration; expected {gross:g} mm"
            far = True
            yield finding("OLP455", f"{text} at most", lines)
    if calibration is not None and not far:
        yield from tool_findings(path, calibration, machine.sanity)


def _away(one: tuple[float, ...], other: tuple[float, ...]) -> float:
    return float(np.abs(np.subtract(one, other)).max())


def _in_inches(tool: tuple[float, ...], known: tuple[float, ...]) -> bool:
    """Whether a tool is a known one in inches, or the other way round."""
    size, own = float(np.linalg.norm(tool)), float(np.linalg.norm(known))
    return own > 0.0 and any(abs(size - own * f) <= _NEAR * own * f for f in (_INCH_MM, 1.0 / _INCH_MM))


def _mirrored(frame: Frame, known: list[Vector], setup: Setup) -> str | None:
    """What says that the tip is on the other side of the gauge point, None where nothing does."""
    tool = None if frame.tool is None else setup.tool(frame.tool)
    if tool is not None and _opposite(frame.tool_mm, _negative(tool.length_mm)):
        return "its length says"
    if known and all(_opposite(frame.tool_mm, other) for other in known):
        return "the tool of the calibration"
    return None


def _opposite(tool: Vector, other: Vector) -> bool:
    size = float(np.linalg.norm(other))
    return size > _METRES_MM and _away(tool, _negative(other)) <= _NEAR * size


def _negative(vector: Vector) -> Vector:
    x, y, z = vector
    return (0.0 - x, 0.0 - y, 0.0 - z)


def _axes(machine: Machine) -> Iterator[Finding]:
    """Least increments that are no increments, and speeds that no axis has."""
    for name, axis in machine.axes.items():
        if axis.least_increment_mm > _INCREMENT_MM:
            what = f"axes.{name}.least_increment_mm = {axis.least_increment_mm:g}"
            yield finding("OLP465", f"{what}; expected at most {_INCREMENT_MM:g} mm")
        least = float(np.ptp(axis.travel_mm)) / _ACROSS_S
        if axis.velocity_mm_s is not None and not least <= axis.velocity_mm_s <= _FAST_MM_S:
            what = f"axes.{name}.velocity_mm_s = {axis.velocity_mm_s:g}"
            yield finding("OLP465", f"{what}; expected {least:.3g} to {_FAST_MM_S:g} mm/s")


def _offsets(first: dict[int, int], frames: dict[int, Frame], setup: Setup) -> Iterator[Finding]:
    longest = max((float(np.abs(f.tool_mm).max()) for f in frames.values()), default=0.0)
    seen: set[str] = set()
    for number, frame in frames.items():
        offset = setup.work_offset(frame.work_offset)
        if offset is None or frame.work_offset in seen:
            continue
        seen.add(frame.work_offset)
        for axis, place in zip("XYZ", offset.offset_mm, strict=True):
            low, high = setup.machine.axes[axis].travel_mm
            slack = _BEYOND * (high - low) + longest
            if not low - slack <= place <= high + slack:
                what = f"work_offsets.{frame.work_offset}.{axis}_mm = {place:g} is outside the travel"
                lines = [first[number]]
                yield finding("OLP456", f"{what}; expected {low:g} to {high:g} mm", lines)


def _start(setup: Setup) -> Iterator[Finding]:
    machine = setup.machine
    stated = {
        "job file: start_mm": setup.job.start_mm,
        "machine file: home_mm": machine.home_mm,
        "machine file: second_home_mm": machine.second_home_mm,
        "machine file: tool_change_mm": machine.tool_change_mm,
    }
    for key, places in stated.items():
        for axis, place in zip("XYZ", places, strict=True):
            low, high = machine.axes[axis].travel_mm
            slack = _BEYOND * (high - low)
            if place is not None and not low - slack <= place <= high + slack:
                what = f"{key}.{axis} = {place:g} is outside the travel"
                yield finding("OLP456", f"{what}; expected {low:g} to {high:g} mm")


def _temperatures(setup: Setup, calibration: Calibration | None) -> Iterator[Finding]:
    stated = {f"job file: temperatures_degC.{key}": v for key, v in setup.job.temperatures_degC.items()}
    if calibration is not None:
        stated["calibration: temperature_degC"] = calibration.temperature_degC
    sensors = setup.job.sensors_degC or {}
    for values, (low, high) in (
        (stated, _WORKSHOP_DEGC),
        ({f"job file: temperatures_degC.sensors.{k}": v for k, v in sensors.items()}, _SENSOR_DEGC),
    ):
        for key, value in values.items():
            if not low <= value <= high:
                yield finding("OLP457", f"{key} = {value:g}; expected {low:g} to {high:g} degC")


def _payloads(frames: dict[int, Frame], calibration: Calibration | None) -> Iterator[Finding]:
    heaviest = max((frame.payload_kg for frame in frames.values()), default=0.0)
    for what, value in (
        ("the payload of the job", heaviest),
        ("calibration: payload_kg", 0.0 if calibration is None else calibration.payload_kg),
    ):
        if value > _HEAVY_KG:
            yield finding("OLP459", f"{what} is {value:g} kg; expected at most {_HEAVY_KG:g} kg")
