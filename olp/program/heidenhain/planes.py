"""Tilted working planes of Heidenhain programs: what the forms of PLANE make of the coordinates.

Source: Heidenhain, TNC 640 User's Manual, chapter "The PLANE function: tilting the working plane".
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

import numpy as np

from olp.core.arrays import Array
from olp.core.errors import ProgramError
from olp.core.geometry import rotation_matrix
from olp.core.turns import Turn, rows_of
from olp.core.values import dataclass
from olp.program.heidenhain.statements import Statement
from olp.program.heidenhain.table import UNROLL
from olp.program.tilts import Branch

_NUMBER = r"[ \t]*([-+]?(?:\d+\.?\d*|\.\d+))"
_FORM = re.compile(rb"PLANE[ \t]+([A-Z]+)")
#: What each form states, in the order of the numbers.
_WORDS: Mapping[str, tuple[str, ...]] = {
    "SPATIAL": ("SPA", "SPB", "SPC"),
    "EULER": ("EULPR", "EULNU", "EULROT"),
    "VECTOR": ("BX", "BY", "BZ", "NX", "NY", "NZ"),
    "POINTS": tuple(f"P{k}{axis}" for k in (1, 2, 3) for axis in "XYZ"),
}
#: Sine by which two directions that are stated as square may be off.
_SQUARE = 1e-4
#: What follows the numbers.
_REST = re.compile(
    r"(?:[ \t]+(?P<turning>TURN|MOVE|STAY))?"
    r"(?P<way>(?:[ \t]+(?:DIST[ \t]*[\d.]+|MB[ \t]*(?:MAX|[\d.]+)|F[ \t]*(?:MAX|AUTO|[\d.]+)))*)"
    r"(?:[ \t]+(?:SEQ|SYM)(?P<branch>[-+]))?(?:[ \t]+(?P<free>TABLE|COORD)[ \t]+ROT)?[ \t]*"
)


@dataclass(frozen=True, slots=True)
class Plane:
    """A tilted plane: how its words are turned in the workpiece, None where they are not. `branch` is which
    of two positions the rotary axes take. With `turns` the control turns them at once. `ends`: PLANE RESET.
    `by_table`: TABLE ROT.
    """

    turn: Turn | None
    branch: Branch
    turns: bool
    ends: bool = False
    by_table: bool = False


def plane_of(statement: Statement, before: Turn | None) -> Plane:
    """The plane that a statement switches on, where `before` is in force. Raises ProgramError."""
    text = statement.upper.decode("latin-1")
    form = _FORM.match(statement.upper)
    name = "" if form is None else form[1].decode()
    rest = "" if form is None else text[form.end() :]
    if name == "RESET":
        return _with(np.eye(3), rest, statement, ends=True)
    if name == "RELATIV":
        match = re.match(rf"[ \t]+SP([ABC]){_NUMBER}(?=[ \t]|$)", rest)
        if match is not None:
            angle = [0.0, 0.0, 0.0]
            angle["ABC".index(match[1])] = float(match[2])
            base = np.eye(3) if before is None else np.array(before)
            return _with(base @ _spatial(*angle), rest[match.end() :], statement)
    elif name in _WORDS:
        pattern = "".join(rf"[ \t]+{word}{_NUMBER}" for word in _WORDS[name])
        match = re.match(pattern + r"(?=[ \t]|$)", rest)
        if match is not None:
            numbers = [float(number) for number in match.groups()]
            return _with(_MADE[name](*numbers), rest[match.end() :], statement)
    raise ProgramError(
        f"{statement.shown} is not read; expected PLANE SPATIAL, EULER, VECTOR, POINTS, RELATIV or RESET "
        "with numbers",
        line=statement.line,
        code="OLP512",
        word="PLANE",
    )


#: The parameters in which the control leaves the positions that it has found.
_FOUND = re.compile(r"(I?)([A-CU-W])[ \t]*([-+]?)(Q[LR]?\d+)")
_FOUND_IN = {"A": "Q120", "B": "Q121", "C": "Q122"}


def found_by_control(statement: Statement, plane: Plane | None) -> tuple[Plane, str]:
    """The letters of a block that moves rotary axes to the positions which the control has found for a plane.
    Raises ProgramError for other parameters."""
    letters = ""
    for counts, letter, sign, name in _FOUND.findall(statement.upper.decode("latin-1")):
        if plane is None or counts or sign == "-" or _FOUND_IN.get(letter) != name:
            raise ProgramError(
                f"{statement.shown} takes numbers from parameters; expected A+Q120, B+Q121, C+Q122 behind "
                "PLANE",
                line=statement.line,
                code="OLP511",
                hint=UNROLL,
            )
        letters += letter
    assert plane is not None
    return plane, letters


def _with(matrix: Array | None, rest: str, statement: Statement, *, ends: bool = False) -> Plane:
    match = _REST.fullmatch(rest)
    if match is None or matrix is None:
        why = f"has {rest.strip()!r}, which is not read" if match is None else "states no plane"
        raise ProgramError(
            f"{statement.shown} {why}; expected its directions square to each other, then TURN, MOVE or "
            "STAY, SEQ and TABLE ROT or COORD ROT",
            line=statement.line,
            code="OLP512",
            word="PLANE",
        )
    branch: Branch = 0 if match["branch"] is None else 1 if match["branch"] == "+" else -1
    turn = None if np.allclose(matrix, np.eye(3), rtol=0.0, atol=1e-12) else rows_of(matrix)
    return Plane(turn, branch, match["turning"] in ("TURN", "MOVE"), ends, match["free"] == "TABLE")


def _spatial(a: float, b: float, c: float) -> Array:
    """A about X, then B about Y, then C about Z of the workpiece; right angles are exact."""
    matrix = rotation_matrix((a, b, c))
    return np.where(np.abs(matrix) < 1e-15, 0.0, matrix)


def _euler(precession: float, nutation: float, rotation: float) -> Array:
    """About Z, then about the turned X, then about the turned Z."""
    return _spatial(0.0, 0.0, precession) @ _spatial(nutation, 0.0, 0.0) @ _spatial(0.0, 0.0, rotation)


def _vectors(*numbers: float) -> Array | None:
    """The X axis and the normal, square to each other."""
    base, normal = np.array(numbers[:3]), np.array(numbers[3:])
    sizes = np.linalg.norm(base), np.linalg.norm(normal)
    if not all(sizes):
        return None
    base, normal = base / sizes[0], normal / sizes[1]
    if abs(base @ normal) > _SQUARE:
        return None
    base = base - (base @ normal) * normal
    base /= np.linalg.norm(base)
    return np.stack((base, np.cross(normal, base), normal), axis=1)


def _points(*numbers: float) -> Array | None:
    """X from the first point to the second, and the third on the side of +Y."""
    first, second, third = np.array(numbers).reshape(3, 3)
    normal = np.cross(second - first, third - first)
    return _vectors(*(second - first), *normal)


_MADE: Mapping[str, Callable[..., Array | None]] = {
    "SPATIAL": _spatial,
    "EULER": _euler,
    "VECTOR": _vectors,
    "POINTS": _points,
}
