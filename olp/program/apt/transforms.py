"""Rigid transforms that a program of APT states: matrices of TRACUT and COPY, and shifts of TRANS.

A matrix is 12 numbers, three rows of a 3x4 matrix, or `TRANSL,x,y,z`, `XYROT,angle`, `YZROT,angle` and
`ZXROT,angle` (degrees, right-handed). `(MATRIX/…)` around it means nothing.
"""

from __future__ import annotations

import re

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ProgramError
from olp.core.machine import Vector
from olp.core.turns import Turn, rows_of
from olp.core.values import dataclass
from olp.program.frames import product
from olp.program.text.statements import Statement, number_of, shown

#: how far a stated matrix may be from a rotation: numbers of four decimals
_RIGID = 5e-4
#: axis of the rotation by its word
_ROTATIONS = {b"YZROT": 0, b"ZXROT": 1, b"XYROT": 2}
_GROUP = re.compile(rb"(?i)\A\(\s*MATRIX\s*/(.*)\)\Z", re.DOTALL)


@dataclass(frozen=True, slots=True)
class Rigid:
    """A point p of the program becomes `turn` p + `shift`, in the unit of the program. `turn` is None where
    nothing turns."""

    turn: Turn | None
    shift: Vector

    def placed(self, point: Array) -> Array:
        """(n, 3) points after the transform."""
        return np.asarray(self.directed(point) + np.array(self.shift), float)

    def directed(self, direction: Array) -> Array:
        """(n, 3) directions after the transform."""
        return direction if self.turn is None else np.asarray(direction @ np.array(self.turn).T, float)

    def then(self, other: Rigid) -> Rigid:
        """This transform, and another after it."""
        x, y, z = other.placed(np.array([self.shift]))[0].tolist()
        return Rigid(product(other.turn, self.turn), (x, y, z))


NOTHING = Rigid(None, (0.0, 0.0, 0.0))


def rigid(words: list[bytes], statement: Statement) -> Rigid:
    """The transform that words of a statement state. Raises ProgramError for anything but a rotation and a
    shift in numbers."""
    if len(words) == 1 and (group := _GROUP.match(words[0])):
        words = [w.strip() for w in group[1].split(b",")]
    pairs = [number_of(w) for w in words]
    numbers = [n[0] / 10.0 ** n[1] for n in pairs if n is not None]
    first = words[0].strip().upper() if words else b""
    stated = len(numbers) == len(words) - (0 if pairs[:1] and pairs[0] is not None else 1)
    if stated and len(numbers) == 12 == len(words):
        return _rotation(np.array(numbers).reshape(3, 4), statement)
    if stated and first == b"TRANSL" and len(numbers) in (2, 3):
        x, y, z = (*numbers, 0.0)[:3]
        return Rigid(None, (x, y, z))
    if stated and first in _ROTATIONS and len(numbers) == 1:
        return Rigid(about(_ROTATIONS[first], numbers[0]), (0.0, 0.0, 0.0))
    raise ProgramError(
        f"{shown(statement.head()[1])} does not state its transform in numbers; expected 12 numbers of a "
        "matrix, TRANSL,x,y,z or XYROT,angle; or have the CAM system write the moved points",
        line=statement.line,
        code="OLP523",
    )


def about(axis: int, degrees: float) -> Turn:
    """The rows of a rotation about an axis of the program, exact at quarter turns."""
    quarters = degrees / 90.0
    if quarters == round(quarters):
        cosine, sine = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[round(quarters) % 4]
    else:
        cosine, sine = float(np.cos(np.radians(degrees))), float(np.sin(np.radians(degrees)))
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[a, a] = matrix[b, b] = cosine
    matrix[a, b], matrix[b, a] = -sine, sine
    return rows_of(matrix)


def _rotation(matrix: Array, statement: Statement) -> Rigid:
    """The rotation nearest to stated numbers, whose last digits are rounded."""
    turn = matrix[:, :3]
    x, y, z = matrix[:, 3].tolist()
    if np.abs(turn @ turn.T - np.eye(3)).max() > _RIGID or np.linalg.det(turn) < 0:
        what = "mirrors" if np.linalg.det(turn) < 0 else "scales or shears"
        raise ProgramError(
            f"the matrix of {shown(statement.head()[1])} {what}, and only a rotation with a shift is read; "
            "have the CAM system write the moved points",
            line=statement.line,
            code="OLP523",
        )
    if (turn == np.eye(3)).all():
        return Rigid(None, (x, y, z))
    left, _, right = np.linalg.svd(turn)
    return Rigid(rows_of(left @ right), (x, y, z))
