"""A shop's own lines put into equation (1) of the paper (University of Huddersfield), as it does it.

Each curve is the mean of the runs of one line, straightness less its slope. Squareness is the sum of the
slopes of a pair of straightness lines less the error of their square, or a stated reading. The paper counts
lever arms from machine zero; they are right where they count from the lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from olp.calibration.iso230.conventions import AXES_OF, LEAN
from olp.calibration.observations.lines import Line, targets_of
from olp.calibration.observations.measurements import Measurements
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.arrays import Array
from olp.core.errors import CannotCompute
from olp.core.machine import ZERO, Vector
from olp.core.units import AXES
from olp.errormodel.calibration import Calibration, Curve
from olp.errormodel.huddersfield import CHAIN

#: The paper's name of each error, and the factor from its value there to the one here.
PAPER: Mapping[str, tuple[str, float]] = MappingProxyType(
    {
        "EXX": ("X_lin", 1.0), "EYX": ("X_str(Y)", 1.0), "EZX": ("X_str(Z)", 1.0),
        "EXY": ("Y_str(X)", 1.0), "EYY": ("Y_lin", 1.0), "EZY": ("Y_str(Z)", 1.0),
        "EXZ": ("Z_str(X)", 1.0), "EYZ": ("Z_str(Y)", 1.0), "EZZ": ("Z_lin", 1.0),
        "EAX": ("X_roll", -1.0), "EBX": ("X_pitch", 1.0), "ECX": ("X_yaw", -1.0),
        "EAY": ("Y_pitch", -1.0), "EBY": ("Y_roll", 1.0),
        "C0Y": ("XY_sqr", -1.0), "B0Z": ("XZ_sqr", 1.0), "A0Z": ("YZ_sqr", -1.0),
    }
)  # fmt: skip


def equation_1(measurements: Measurements, chain: str, box_mm: Array, *, placed: bool) -> Calibration:
    """The calibration that equation (1) makes of the lines: `model` "huddersfield", over a box (3, 2) in mm.

    Lever arms count from machine zero, or with `placed` from where the lines were taken. Raises
    CannotCompute for another chain, and where there is no line.
    """
    if chain != CHAIN:
        raise CannotCompute(f"equation (1) is for the chain {CHAIN}, and this machine is {chain}")
    lines = _longest(measurements.lines)
    if not lines:
        raise CannotCompute("equation (1) needs lines, and there are none")
    origin = _crossing(list(lines.values())) if placed else ZERO
    slopes: dict[str, float] = {}
    curves = []
    for axis, letter in enumerate(AXES):
        own = {name: line for name, line in lines.items() if name[2] == letter}
        targets = [targets_of(line) for line in own.values()]
        knots = np.unique(np.concatenate([*targets, box_mm[axis]]))
        columns = {}
        for name, line in own.items():
            target, value = _means(line)
            if line.quantity == "straightness":
                slopes[name] = float(np.polyfit(target, value, 1)[0])
                value = value - slopes[name] * target
            columns[name] = np.interp(knots, target, value) - np.interp(origin[axis], target, value)
        if columns:
            curves.append(Curve(letter, knots, columns, line_mm=origin, interpolation="linear"))
    return Calibration(
        measurements.machine, box_mm, "huddersfield", origin, tuple(curves),
        _squareness(measurements, lines, slopes), temperature_degC=measurements.temperature_degC,
    )  # fmt: skip


def in_the_papers_signs(calibration: Calibration) -> dict[str, float]:
    """The range of each curve (mm or rad), and the squareness in the paper's signs, by its names."""
    shown = {}
    for curve in calibration.curves:
        for name, values in curve.columns.items():
            if name in PAPER:
                shown[PAPER[name][0]] = float(np.ptp(values))
    for name, value in calibration.squareness.items():
        words, factor = PAPER[name]
        shown[words] = factor * value
    return shown


def _longest(lines: Sequence[Line]) -> dict[str, Line]:
    """The first of the longest lines of each component."""
    chosen: dict[str, Line] = {}
    for line in lines:
        known = chosen.get(line.component)
        if known is None or np.ptp(line.target_mm) > np.ptp(known.target_mm) + 1.0:
            chosen[line.component] = line
    return chosen


def _crossing(lines: Sequence[Line]) -> Vector:
    """Where most lines cross: the median position of each axis while the others moved."""
    place = []
    for axis in range(3):
        others = [line.line_mm[axis] for line in lines if line.axis != axis and line.quantity != "angle"]
        place.append(float(np.median(others)) if others else 0.0)
    return place[0], place[1], place[2]


def _means(line: Line) -> tuple[Array, Array]:
    """(m,) targets and the mean of both directions there, each direction with the same weight."""
    target = targets_of(line)
    place = np.argmin(np.abs(line.target_mm[:, None] - target), axis=1)
    total, sides = np.zeros(len(target)), np.zeros(len(target))
    for direction in (-1, 1):
        rows = line.direction == direction
        count = np.bincount(place[rows], minlength=len(target))
        sums = np.bincount(place[rows], line.value[rows], len(target))
        total += np.divide(sums, count, out=np.zeros(len(target)), where=count > 0)
        sides += count > 0
    return target, total / sides


def _squareness(
    measurements: Measurements, lines: Mapping[str, Line], slopes: Mapping[str, float]
) -> dict[str, float]:
    squares = {square.name: square.error_rad for square in measurements.squares}
    stated = {reading.component: reading.value_rad for reading in measurements.of(SquarenessReading)}
    found = {}
    for name, (i, j) in AXES_OF.items():
        first, second = f"E{AXES[j]}{AXES[i]}", f"E{AXES[i]}{AXES[j]}"
        pair = [lines[key].square for key in (first, second) if key in lines]
        if len(pair) == 2 and pair[0] is not None and pair[0] == pair[1]:
            found[name] = LEAN[name] * (slopes[first] + slopes[second] - squares.get(pair[0], 0.0))
        elif name in stated:
            found[name] = stated[name]
    return found
