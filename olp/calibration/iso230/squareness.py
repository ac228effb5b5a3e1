"""Squareness from straightness lines that share a square, from a precision square with an indicator, from a
square turned round, and from the sides and diagonals of a printed or drilled frame.

Each gives a reading in the sign convention of this package, with the position and tool vector that it holds
for. Elsewhere the angular errors of the axes between add to it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from olp.calibration.iso230.conventions import AXES_OF, LEAN
from olp.calibration.observations.lines import Line
from olp.calibration.observations.references import Square, sense_of
from olp.calibration.observations.squareness import SquarenessReading
from olp.core.errors import ConfigError, UsageError
from olp.core.machine import ZERO, Vector
from olp.core.units import AXES, RAD_PER_URAD
from olp.core.values import dataclass

#: Positions and tool vectors of the two lines of a pair are equal within this.
SAME_PLACE_MM = 1.0


@dataclass(frozen=True, slots=True)
class Slope:
    """The slope of a straightness line (rad) by least squares through all its readings, its standard
    uncertainty, and the ends of the line in mm."""

    slope: float
    sigma: float
    span_mm: tuple[float, float]


def slope_of(line: Line) -> Slope:
    """The slope of a straightness line. Its uncertainty is that of one reading (from repeated runs, or
    `line.sigma` where that is more; from the deviations of targets from the line where nothing was repeated).
    Raises ConfigError."""
    if line.quantity != "straightness":
        raise ConfigError(
            f"line {line.component} is not a straightness; expected one such as EYX", file=line.source
        )
    x = line.target_mm - line.target_mm.mean()
    spread = float(x @ x)
    if spread == 0.0:
        raise ConfigError(f"line {line.component}: one target; expected at least 2", file=line.source)
    slope = float(x @ line.value) / spread
    rest = line.value - line.value.mean() - slope * x
    groups = np.unique(
        np.column_stack((np.round(line.target_mm, 6), line.direction)), axis=0, return_inverse=True
    )[1]
    repeated = len(rest) - int(groups.max()) - 1
    if repeated > 0:
        inside = rest - (np.bincount(groups, rest) / np.bincount(groups))[groups]
        noise = math.sqrt(float(inside @ inside) / repeated)
    else:
        noise = math.sqrt(float(rest @ rest) / max(len(rest) - 2, 1))
    sigma = max(noise, line.sigma) / math.sqrt(spread)
    return Slope(slope, sigma, (float(line.target_mm.min()), float(line.target_mm.max())))


def component_of(first: Line, second: Line) -> str:
    """C0Y, B0Z or A0Z for two straightness lines such as EYX and EXY. Raises ConfigError."""
    pair = {(line.component[1], line.component[2]) for line in (first, second)}
    for name, axes in AXES_OF.items():
        a, b = (AXES[i] for i in axes)
        if pair == {(b, a), (a, b)}:
            return name
    raise ConfigError(
        f"lines {first.component} and {second.component} are no pair for squareness; expected the "
        "straightness of two axes in each other's direction, such as EZX and EXZ",
        file=second.source,
    )


def from_straightness_pair(first: Line, second: Line, square: Square) -> SquarenessReading:
    """Squareness from two straightness lines, in any order, read against the legs of one square.

    The lean of the later axis toward + of the earlier one is the sum of both slopes less the error of the
    square (the paper's figures 8 and 9). Both lines must be at the same position of the third axis, with one
    tool vector. Raises ConfigError.
    """
    component = component_of(first, second)
    earlier, later = AXES_OF[component]
    along = {line.axis: line for line in (first, second)}
    a, b = along[earlier], along[later]
    third = 3 - earlier - later
    for line in (a, b):
        if line.reference == "table":
            raise ConfigError(
                f"line {line.component} was read at a reflector fixed on the table, so angles of "
                f"{AXES[line.axis]} tilt it; use olp calibrate fit for both lines, which models that",
                file=line.source,
            )
    apart = abs(a.line_mm[third] - b.line_mm[third])
    lever_arms = max(abs(p - q) for p, q in zip(a.tool_mm, b.tool_mm, strict=True))
    if max(apart, lever_arms) > SAME_PLACE_MM:
        what = (
            f"are {apart:g} mm apart in {AXES[third]}"
            if apart > SAME_PLACE_MM
            else f"have tool vectors {lever_arms:g} mm apart"
        )
        raise ConfigError(
            f"lines {a.component} and {b.component} {what}, so angular errors would count as "
            "squareness; use olp calibrate fit for both lines, which models their lever arms",
            file=b.source,
        )
    one, other = slope_of(a), slope_of(b)
    lean = one.slope + other.slope - sense_of(a.turned) * square.error_rad
    place = [0.0, 0.0, 0.0]
    place[earlier], place[later], place[third] = b.line_mm[earlier], a.line_mm[later], a.line_mm[third]
    return SquarenessReading(
        component,
        LEAN[component] * lean,
        (place[0], place[1], place[2]),
        (one.span_mm, other.span_mm),
        a.tool_mm,
        math.hypot(one.sigma, other.sigma, square.sigma_rad),
        ", ".join(dict.fromkeys(s for s in (a.source, b.source) if s)),
    )


def indicator_sense(pointing: str, carried_by: str) -> str:
    """The value of the key `sense` in a file with an indicator's readings of the straightness along the
    direction in which it points, "+X" to "-Z". A reading grows as the plunger is pushed in.

    Carried by the tool, the indicator pushes against the square when the tool is too far in the direction
    of pointing. Standing on the workpiece and the square carried by the tool, it is the other way round.
    Raises UsageError.
    """
    if len(pointing) != 2 or pointing[0] not in "+-" or pointing[1] not in AXES:
        raise UsageError(f"pointing {pointing!r}; expected a sign and an axis, such as +X")
    if carried_by not in ("tool", "workpiece"):
        raise UsageError(f'carried by {carried_by!r}; expected "tool" or "workpiece"')
    same = (pointing[0] == "+") == (carried_by == "tool")
    return "actual-minus-commanded" if same else "commanded-minus-actual"


def from_turned_square(
    normal: SquarenessReading, turned: SquarenessReading
) -> tuple[SquarenessReading, Square]:
    """Squareness without the error of the square, and that error, from two readings made with it. For the
    second one the square is turned by 180 degrees about its later leg, which reverses its earlier leg.

    Both readings must take the square as perfect (`Square.error_rad` 0). Raises ConfigError.
    """
    if normal.component != turned.component:
        raise ConfigError(f"{normal.component} and {turned.component}; expected one component, read twice")
    mean = (normal.value_rad + turned.value_rad) / 2.0
    half = (normal.value_rad - turned.value_rad) / 2.0
    sigma = math.hypot(normal.sigma_rad, turned.sigma_rad) / 2.0
    reading = SquarenessReading(
        normal.component, mean, normal.line_mm, normal.span_mm, normal.tool_mm, sigma, normal.source
    )
    # a square of 90 degrees + e shows a lean that is too large by e; turned, too small by e
    return reading, Square("turned", LEAN[normal.component] * half, sigma)


def from_frame(
    component: str,
    diagonal_pp_mm: float,
    diagonal_np_mm: float,
    side_mm: float,
    *,
    line_mm: Vector,
    span_mm: tuple[tuple[float, float], tuple[float, float]],
    sigma_mm: float = 0.0,
    tool_mm: Vector = ZERO,
) -> SquarenessReading:
    """Squareness from a parallelogram that the machine drew, drilled or printed. Measured elsewhere are the
    diagonal that grows in both axes, the other one, and one side (any of the four). `sigma_mm` is the
    standard uncertainty of each length.

    The cotangent of its corner: (pp^2 - np^2) / (4 side other), where the other side follows from the
    parallelogram law, so a scale common to all three cancels. Raises ConfigError.
    """
    other = (diagonal_pp_mm**2 + diagonal_np_mm**2) / 2.0 - side_mm**2
    if min(diagonal_pp_mm, diagonal_np_mm, side_mm) <= 0.0 or other <= 0.0:
        raise ConfigError("frame: expected two diagonals and a side that form a parallelogram, in mm")
    cosine = (diagonal_pp_mm**2 - diagonal_np_mm**2) / (4.0 * side_mm * math.sqrt(other))
    if abs(cosine) >= 0.5:
        raise ConfigError("frame: its corners are far from 90 degrees; is a diagonal taken for a side?")
    lean = cosine / math.sqrt(1.0 - cosine * cosine)
    long = (diagonal_pp_mm + diagonal_np_mm) / 2.0
    sigma = sigma_mm * math.sqrt(2.0) * long / (2.0 * side_mm * math.sqrt(other))
    return SquarenessReading(component, LEAN[component] * lean, line_mm, span_mm, tool_mm, sigma)


def pairs_of(lines: Sequence[Line]) -> Iterator[tuple[Line, Line]]:
    """All pairs of straightness lines in each other's direction that name the same square."""
    for i, first in enumerate(lines):
        for second in lines[i + 1 :]:
            crossed = first.component[1:] == second.component[:0:-1]
            if (
                crossed
                and first.quantity == "straightness"
                and first.square
                and (first.square, first.turned) == (second.square, second.turned)
            ):
                yield first, second


def readings_toml(readings: Sequence[SquarenessReading]) -> str:
    """Tables [[squareness]] for a plan of measurements."""
    parts = []
    for r in readings:
        earlier, later = (AXES[i] for i in AXES_OF[r.component])
        place = ", ".join(
            f"{axis} = {value!r}" for axis, value in zip(AXES, map(float, r.line_mm), strict=True)
        )
        spans = ", ".join(
            f"{axis} = [{float(low)!r}, {float(high)!r}]"
            for axis, (low, high) in zip((earlier, later), r.span_mm, strict=True)
        )
        parts.append(
            f'[[squareness]]\ncomponent = "{r.component}"\nvalue_urad = {r.value_rad / RAD_PER_URAD:.4f}\n'
            f"sigma_urad = {max(r.sigma_rad / RAD_PER_URAD, 1e-4):.4f}\nline_mm = {{ {place} }}\n"
            f"span_mm = {{ {spans} }}\ntool_mm = {[float(v) for v in r.tool_mm]}\n"
        )
    return "\n".join(parts)
