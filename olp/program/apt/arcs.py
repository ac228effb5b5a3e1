"""The five forms of arcs in cutter-location data.

Creo and NX say `CIRCLE/centre,normal,radius…`, SolidWorks CAM `CIRCLE/centre,normal`, Autodesk
`MOVARC/centre,normal,radius,ANGLE,degrees`; the end is the next GOTO, and the turn is right-handed about the
normal. One GOTO ends a CIRCLE: Creo says the same one again where a chord has come between two arcs of it.
CATIA says `INDIRV/direction` and `TLON,GOFWD/(CIRCLE/centre,radius),ON,(LINE/centre,end)`, or CYLNDR with a
normal: forward along the circle until it meets the line, with `2,INTOF` for the second time.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.program.program import ArcText
from olp.program.rs274.motion import SPIRAL_ABSOLUTE_MM, SPIRAL_RELATIVE, arc_geometry
from olp.program.statement_rows import StatementCollector
from olp.program.text.statements import Field, Statement

_GROUP = re.compile(rb"(?i)\(\s*(CIRCLE|CYLNDR|LINE)\s*/([^()]*)\)")
_AGAIN = re.compile(rb"(?i)2\s*,\s*INTOF\s*,")
_TOKEN = re.compile(rb"[^\s,]+")
#: a normal is an axis of the machine where the sine between them is below this
_SQUARE = 1e-6
_N = rb"\s*([+-]?(?:\d{1,12}\.?\d{0,12}|\.\d{1,12}))\s*"
#: CIRCLE of six numbers, seven, or more
_PLAIN = re.compile(
    rb"(?i)\s*CIRCLE\s*/" + rb",".join([_N] * 6) + rb"(?:," + _N + rb"((?:,[-+.\d\s]+)*))?,?\s*\Z"
)
#: a joint is tangent where the cosine between both ways is above this
_TANGENT = 1.0 - 1e-6
#: an angle that is said may differ from the one that the points give by this, and by what 0.01 mm subtends
_ANGLE_RAD = 2e-3
#: number of the plane (G17, G18, G19) by the axis of its normal
_PLANE_OF = np.array([2, 1, 0])


@dataclass(frozen=True, slots=True)
class ArcForm:
    """One arc as read, in the unit of the program: `angle_rad` where it is said; `way` is the direction in
    which CATIA begins, and `second` whether the line counts when it is met again. Not `sure`: that it
    turns right-handed about its normal was not seen in a program of that form."""

    text: ArcText
    line: int
    centre: tuple[float, ...]
    normal: tuple[float, ...]
    radius: float | None = None
    angle_rad: float | None = None
    turns: int = 1
    way: tuple[float, ...] | None = None
    second: bool = False
    sure: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Resolved:
    """(m, 3) `centre` in mm on the machine, (m,) `plane` and signed `sweep` in rad."""

    centre: Array
    plane: Index
    sweep: Array


def _numbers(fields: Sequence[Field], least: int, statement: Statement, what: str) -> list[float]:
    found = [f.number for f in fields]
    count = next((i for i, n in enumerate(found) if n is None), len(found))
    if count < least:
        raise ProgramError(
            f"{what} has {count} numbers where {least} are expected; send the output of the APT processor",
            line=statement.line,
        )
    return [n[0] / 10.0 ** n[1] for n in found[:count] if n is not None]


def circle(statement: Statement, out: StatementCollector) -> ArcForm:
    """CIRCLE of Creo, NX and SolidWorks CAM."""
    plain = _PLAIN.match(statement.text)
    if plain is not None:
        return _plain_circle(statement, plain, out)
    fields = statement.fields()
    values = _numbers(fields, 6, statement, "CIRCLE")
    turns = 1
    for word, number in itertools.pairwise(fields):
        if word.text == b"TIMES" and number.number is not None:
            # how often the circle is passed whole, before the last part of it
            turns = max(int(number.number[0] / 10 ** number.number[1]), 1)
    a, b, c = (out.word(f) for f in fields[:3])
    has_radius = len(values) > 6
    text = ArcText(statement.begin, statement.end, ((a, b, c),), out.word(fields[6]) if has_radius else -1)
    return ArcForm(
        text, statement.line, tuple(values[:3]), tuple(values[3:6]), values[6] if has_radius else None,
        turns=turns, sure=len(values) < 8,
    )  # fmt: skip


def _plain_circle(statement: Statement, found: re.Match[bytes], out: StatementCollector) -> ArcForm:
    """A CIRCLE of numbers alone, parted by commas: nearly all there are."""
    said = found.groups()
    values = [float(n) for n in said[:6]]
    radius = said[6]
    spans = [found.span(k) for k in ((1, 2, 3) if radius is None else (1, 2, 3, 7))]
    words = [
        out.word(Field(statement.text[a:b], statement.place(a), statement.place(b - 1) + 1)) for a, b in spans
    ]
    text = ArcText(
        statement.begin, statement.end, ((words[0], words[1], words[2]),), words[3] if radius else -1
    )
    return ArcForm(
        text, statement.line, tuple(values[:3]), tuple(values[3:]), None if radius is None else float(radius),
        sure=not said[7],
    )  # fmt: skip


def movarc(statement: Statement, out: StatementCollector) -> ArcForm:
    """MOVARC of Autodesk."""
    fields = statement.fields()
    values = _numbers(fields, 7, statement, "MOVARC")
    at = next((i for i, f in enumerate(fields) if f.text == b"ANGLE"), -1)
    angle = fields[at + 1].number if 0 < at < len(fields) - 1 else None
    if angle is None:
        raise ProgramError("MOVARC says no ANGLE; expected ANGLE and degrees", line=statement.line)
    a, b, c = (out.word(f) for f in fields[:3])
    text = ArcText(
        statement.begin, statement.end, ((a, b, c),), out.word(fields[6]), out.word(fields[at + 1])
    )
    return ArcForm(
        text, statement.line, tuple(values[:3]), tuple(values[3:6]), values[6],
        float(np.radians(angle[0] / 10.0 ** angle[1])),
    )  # fmt: skip


def tlon(statement: Statement, out: StatementCollector) -> tuple[ArcForm, list[Field]]:
    """TLON of CATIA, and the fields of its end. Raises ProgramError for any other drive along geometry."""
    groups = {m[1].upper(): _inside(statement, m) for m in _GROUP.finditer(statement.text)}
    major = statement.head()[1].replace(b" ", b"")
    kind = b"CIRCLE" if b"CIRCLE" in groups else b"CYLNDR"
    if major != b"TLON,GOFWD" or kind not in groups or b"LINE" not in groups:
        raise ProgramError(
            "TLON drives the tool along geometry in a way that is not read; expected "
            "TLON,GOFWD/(CIRCLE/…),ON,(LINE/…)",
            line=statement.line,
        )
    size = 4 if kind == b"CIRCLE" else 7
    round_, straight = groups[kind], groups[b"LINE"]
    values = _numbers(round_, size, statement, kind.decode())
    line = _numbers(straight, 6, statement, "LINE")
    if max(abs(p - q) for p, q in zip(values[:2], line[:2], strict=True)) > 1e-3:
        raise ProgramError("the LINE of TLON does not begin at the centre", line=statement.line)
    normal = (0.0, 0.0, 1.0) if kind == b"CIRCLE" else tuple(values[3:6])
    again = _AGAIN.search(statement.text)
    long = None if again is None else (statement.place(again.start()), statement.place(again.end() - 1) + 1)
    centres = tuple(
        (a, b, c) for a, b, c in ([out.word(f) for f in fields[:3]] for fields in (round_, straight))
    )
    text = ArcText(statement.begin, statement.end, centres, out.word(round_[size - 1]), whole=True, long=long)
    form = ArcForm(
        text, statement.line, tuple(values[:3]), normal, values[size - 1], second=again is not None
    )
    return form, straight[3:6]


def directed(form: ArcForm, statement: Statement, out: StatementCollector) -> ArcForm:
    """An arc of CATIA with the direction that INDIRV says before it."""
    fields = statement.fields()
    values = _numbers(fields, 3, statement, "INDIRV")
    text = replace(form.text, begin=statement.begin, direction=tuple(out.word(f) for f in fields[:3]))
    return replace(form, text=text, way=tuple(values[:3]))


def _inside(statement: Statement, group: re.Match[bytes]) -> list[Field]:
    at = group.start(2)
    return [
        Field(m[0].upper(), statement.place(at + m.start()), statement.place(at + m.end() - 1) + 1)
        for m in _TOKEN.finditer(group[2])
    ]


def resolved(
    forms: Sequence[ArcForm], start: Array, end: Array, line: Index, unit_mm: float, offset: Array,
    turn: Array | None,
) -> Resolved:  # fmt: skip
    """Arcs on the machine, from points `start` to `end` (m, 3). Raises ProgramError for an arc in no plane of
    two axes, and for one whose words contradict each other."""
    centre = np.array([f.centre for f in forms]) * unit_mm
    normal = np.array([f.normal for f in forms])
    if turn is not None:
        centre, normal = centre @ turn.T, normal @ turn.T
    centre = centre + offset
    size = np.sqrt((normal * normal).sum(axis=1))
    axis = np.abs(normal).argmax(axis=1)
    rows = np.arange(len(forms))
    along = normal[rows, axis]
    for i in np.flatnonzero(~(size - np.abs(along) <= 0.5 * _SQUARE**2 * size) | ~(size > 0)).tolist():
        raise ProgramError(
            "an arc lies in no plane of two axes of the machine, which is not read; have the CAM system "
            "write it as GOTOs",
            line=forms[i].line,
        )
    plane = _PLANE_OF[axis]
    axes = np.array(PLANES)[plane]
    clockwise = along < 0
    for i, form in enumerate(forms):
        if form.way is not None:
            clockwise[i] = _catia(form, start[i], end[i], centre[i], axes[i], turn)
    words = np.full((len(forms), 5), np.nan)
    words[:, :3] = centre
    words[:, 4] = [f.turns for f in forms]
    found, sweep = arc_geometry(
        start, end, words, clockwise=clockwise, plane=plane, absolute=np.ones(len(forms), bool),
        offset=np.zeros((len(forms), 3)), line=np.array([f.line for f in forms]),
    )  # fmt: skip
    for i, form in enumerate(forms):
        _check(form, start[i], found[i], axes[i], float(sweep[i]), unit_mm)
    return Resolved(found, plane, sweep)


def joints(found: Resolved, start: Array, before: Array) -> Index:
    """(m,) of each arc 1 where it goes on as the straight move from `before` to its start goes, -1 where it
    turns right back, 0 where there is a corner, which tells nothing."""
    rows = np.arange(len(start))
    axes = np.array(PLANES)[found.plane]
    arm = start - found.centre
    way = np.zeros_like(start)
    way[rows, axes[:, 0]] = -arm[rows, axes[:, 1]] * np.sign(found.sweep)
    way[rows, axes[:, 1]] = arm[rows, axes[:, 0]] * np.sign(found.sweep)
    come = start - before
    size = np.sqrt((way * way).sum(axis=1) * (come * come).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.nan_to_num((way * come).sum(axis=1) / size)
    return np.where(np.abs(cosine) > _TANGENT, np.sign(cosine), 0.0).astype(np.int64)


def _catia(form: ArcForm, start: Array, end: Array, centre: Array, axes: Array, turn: Array | None) -> bool:
    """Whether the arc goes clockwise: begins as INDIRV says, and meets the line when it should."""
    way = np.array(form.way) if turn is None else turn @ np.array(form.way)
    first, second = int(axes[0]), int(axes[1])
    arm = start - centre
    turning = float(arm[first] * way[second] - arm[second] * way[first])
    if not abs(turning) > 0.1 * float(np.hypot(arm[first], arm[second])) * float(
        np.hypot(*way[[first, second]])
    ):
        raise ProgramError("INDIRV does not say which way round the arc goes", line=form.line)
    to = end - centre
    angle = np.arctan2(to[second], to[first]) - np.arctan2(arm[second], arm[first])
    angle = float(angle if turning > 0 else -angle) % (2 * np.pi) or 2 * np.pi
    if (angle > np.pi + 1e-6) != form.second and abs(angle - np.pi) > 1e-3:
        times = "first" if not form.second else "second"
        raise ProgramError(
            f"the arc meets its line the {times} time on the other side of its centre, not at the end that "
            "the line names",
            line=form.line,
        )
    return turning < 0


def _check(form: ArcForm, start: Array, centre: Array, axes: Array, sweep: float, unit_mm: float) -> None:
    """The radius and the angle that are said have to be those of the points."""
    first, second = int(axes[0]), int(axes[1])
    size = float(np.hypot(start[first] - centre[first], start[second] - centre[second]))
    if form.radius is not None:
        off = abs(abs(form.radius) * unit_mm - size)
        if off > max(SPIRAL_ABSOLUTE_MM, SPIRAL_RELATIVE * size):
            raise ProgramError(
                f"the arc says a radius of {abs(form.radius) * unit_mm:.4f} mm and starts {size:.4f} mm from "
                "its centre",
                line=form.line,
            )
    if form.angle_rad is not None:
        off = abs(abs(form.angle_rad) - abs(sweep))
        if min(off, abs(off - 2 * np.pi)) > _ANGLE_RAD + 0.01 / max(size, 1e-9):
            raise ProgramError(
                f"the arc says an angle of {np.degrees(form.angle_rad):.4f} degrees and its points one of "
                f"{np.degrees(abs(sweep)):.4f}",
                line=form.line,
            )
