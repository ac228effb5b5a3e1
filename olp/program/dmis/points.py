"""Points of DMIS that are not stated as x, y, z: POL,r,angle,height and INCR,distance,i,j,k.

POL counts in the working plane (WKPLAN): the angle from its first axis to its second, the height along its
third. INCR goes a distance along a direction of length 1 from the point before.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.program.statement_rows import Point
from olp.program.text.statements import Field, Statement, shown

#: The form of a polar point whose angle is in the unit of angles.
POLAR = 1
#: The form of a polar point whose angle is in degrees.
POLAR_DEGREES = 2
#: The form of a point that counts from the one before.
INCREMENT = 3
FORMS = (b"POL", b"INCR")
#: planes of WKPLAN by their word, as in `PLANES`
WORKING_PLANES = {b"XYPLAN": 0, b"ZXPLAN": 1, b"YZPLAN": 2}
#: rad per unit of angles
ANGLES = {b"ANGDEC": float(np.pi / 180.0), b"ANGDMS": float(np.pi / 180.0), b"ANGRAD": 1.0}
_DMS = re.compile(rb"([+-]?)(\d+):(\d+)(?::(\d+\.?\d*|\.\d+))?\Z")
#: how far the length of a direction may be from 1
_UNIT = 1e-3


def restated(statement: Statement, major: bytes, fields: Sequence[Field]) -> Point:
    """A polar or incremental point. Raises ProgramError for words that are no numbers."""
    word = fields[0].text
    polar = word == b"POL"
    numbers = fields[1:]
    counts = ((3, 6) if major == b"PTMEAS" else (3,)) if polar else (4,)
    if len(numbers) not in counts or (major == b"PTMEAS" and not polar):
        what = (
            "r,angle,height" + (" and a direction" if major == b"PTMEAS" else "")
            if polar
            else ("a distance and i,j,k in a GOTO")
        )
        raise ProgramError(
            f"{shown(major)}/{shown(word)} has {len(numbers)} numbers; expected {what}",
            line=statement.line,
            code="OLP516",
        )
    values = [_value(f) for f in numbers]
    form = POLAR if polar else INCREMENT
    if polar and values[1] is None and (angle := _degrees(numbers[1].text)) is not None:
        values[1], form = angle, POLAR_DEGREES
    bad = next((f for f, v in zip(numbers, values, strict=True) if v is None), None)
    if bad is not None:
        raise ProgramError(
            f"{shown(major)} has {shown(bad.text) or 'nothing'} where a number is expected; "
            "its value is known at run time only",
            line=statement.line,
            code="OLP511",
        )
    stated = tuple(v for v in values if v is not None)
    first = Field(numbers[0].text, fields[0].start, numbers[0].end)
    if polar:
        return Point(
            statement.line, statement.begin, statement.end, (first, numbers[1], numbers[2]),
            form=form, values=stated[:3], lead=b"CART,",
        )  # fmt: skip
    size = float(np.linalg.norm(stated[1:]))
    if not abs(size - 1.0) < _UNIT:
        raise ProgramError(
            f"the direction of GOTO/INCR has length {size:.6g}; expected i,j,k of length 1",
            line=statement.line,
            code="OLP516",
        )
    last = Field(numbers[3].text, numbers[2].start, numbers[3].end)
    way = tuple(stated[0] * v / size for v in stated[1:])
    return Point(
        statement.line, statement.begin, statement.end, (first, numbers[1], last), form=form, values=way,
        lead=b"CART,",
    )  # fmt: skip


def cartesian(value: Array, form: Index, plane: int, angle_rad: float) -> Array:
    """(n, 3) x, y, z of points (n, 3) of each `form`; `plane` is the working plane, `angle_rad` the unit of
    angles."""
    polar = (form == POLAR) | (form == POLAR_DEGREES)
    if not polar.any():
        return value
    point = value.copy()
    radius, height = value[polar, 0], value[polar, 2]
    unit = np.where(form[polar] == POLAR_DEGREES, np.pi / 180.0, angle_rad)
    angle = value[polar, 1] * unit
    first, second, third = PLANES[plane]
    rows = np.flatnonzero(polar)
    point[rows, first] = radius * np.cos(angle)
    point[rows, second] = radius * np.sin(angle)
    point[rows, third] = height
    return point


def _value(field: Field) -> float | None:
    pair = field.number
    return None if pair is None else pair[0] / 10.0 ** pair[1]


def _degrees(text: bytes) -> float | None:
    """Degrees of `degrees:minutes:seconds`; None for anything else."""
    match = _DMS.match(text)
    if match is None:
        return None
    size = float(match[2]) + float(match[3]) / 60.0 + float(match[4] or 0) / 3600.0
    return -size if match[1] == b"-" else size
