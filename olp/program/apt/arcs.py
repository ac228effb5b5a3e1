"""The five forms of arcs in cutter-location data.

Creo writes `CIRCLE/centre,normal,radius`, SolidWorks CAM `CIRCLE/centre,normal`, Autodesk
`MOVARC/centre,normal,radius,ANGLE,degrees`. The end is the next GOTO, and the turn is right-handed about the
normal. NX writes four numbers behind the radius, and its arcs turn clockwise about the vector (its manual).
One GOTO ends a CIRCLE: where a chord separates two arcs of a circle, Creo states the CIRCLE again.
CATIA writes `INDIRV/direction` and `TLON,GOFWD/(CIRCLE/centre,radius),ON,(LINE/centre,end)`, or CYLNDR with a
normal. The tool goes forward along the circle until it meets the line, with `2,INTOF` until the second time.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import ProgramError
from olp.core.geometry import PLANES
from olp.core.values import dataclass
from olp.program.program import ArcText
from olp.program.rs274.motion import SPIRAL_ABSOLUTE_MM, SPIRAL_RELATIVE, arc_geometry
from olp.program.statement_rows import StatementCollector
from olp.program.text.statements import Field, Statement

_GROUP = re.compile(rb"(?i)\(\s*(CIRCLE|CYLNDR|LINE)\s*/([^()]*)\)")
_AGAIN = re.compile(rb"(?i)2\s*,\s*INTOF\s*,")
_TOKEN = re.compile(rb"[^\s,]+")
#: a normal is an axis of the machine where one less the cosine between them is at most this
LEAN = 0.5e-12
_N = rb"\s*([+-]?(?:\d{1,12}\.?\d{0,12}|\.\d{1,12}))\s*"
#: CIRCLE of six numbers, seven, or more
_PLAIN = re.compile(
    rb"(?i)\s*CIRCLE\s*/" + rb",".join([_N] * 6) + rb"(?:," + _N + rb"((?:,[-+.\d\s]+)*))?,?\s*\Z"
)
#: numbers of a CIRCLE of NX: centre, vector, radius, tolerance, its inner share, diameter, corner radius
_NX_NUMBERS = 11
#: a CIRCLE with more numbers than this is not that of Creo or SolidWorks CAM
_KNOWN_NUMBERS = 7
#: a joint is tangent where the cosine between both directions is above this
_TANGENT = 1.0 - 1e-6
#: a stated angle may differ by this from the one that the points give, and by what 0.01 mm subtends
_ANGLE_RAD = 2e-3
#: number of the plane (G17, G18, G19) by the axis of its normal
_PLANE_OF = np.array([2, 1, 0])


@dataclass(frozen=True, slots=True)
class ArcForm:
    """One arc as read, in the unit of the program: `angle_rad` where it is stated. `begins` is the direction
    in which CATIA begins, and `second` whether the arc ends where it meets the line again. Not `confirmed`:
    no known program of that form shows that it turns right-handed about its normal."""

    text: ArcText
    line: int
    centre: tuple[float, ...]
    normal: tuple[float, ...]
    radius: float | None = None
    angle_rad: float | None = None
    turns: int = 1
    begins: tuple[float, ...] | None = None
    second: bool = False
    confirmed: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Resolved:
    """(m, 3) `centre` in mm on the machine, (m,) `plane` and signed `sweep` in rad."""

    centre: Array
    plane: Index
    sweep: Array


def _numbers(fields: Sequence[Field], least: int, statement: Statement, what: str) -> list[float]:
    pairs = [f.number for f in fields]
    count = next((i for i, n in enumerate(pairs) if n is None), len(pairs))
    if count < least:
        raise ProgramError(
            f"{what} has {count} numbers where {least} are expected; send the output of the APT processor",
            line=statement.line,
            code="OLP516",
        )
    return [n[0] / 10.0 ** n[1] for n in pairs[:count] if n is not None]


def circle(statement: Statement, collector: StatementCollector) -> ArcForm:
    """CIRCLE of Creo, NX and SolidWorks CAM."""
    plain = _PLAIN.match(statement.text)
    if plain is not None:
        return _plain_circle(statement, plain, collector)
    fields = statement.fields()
    values = _numbers(fields, 6, statement, "CIRCLE")
    turns = 1
    for word, number in itertools.pairwise(fields):
        if word.text == b"TIMES" and number.number is not None:
            # how many full circles come before the last part
            turns = max(int(number.number[0] / 10 ** number.number[1]), 1)
    a, b, c = (collector.word(f) for f in fields[:3])
    has_radius = len(values) > 6
    text = ArcText(
        statement.begin, statement.end, ((a, b, c),), collector.word(fields[6]) if has_radius else -1
    )
    return ArcForm(
        text, statement.line, tuple(values[:3]), _normal(values[3:6], len(values)),
        values[6] if has_radius else None, turns=turns, confirmed=_confirmed(len(values)),
    )  # fmt: skip


def _normal(vector: Sequence[float], count: int) -> tuple[float, ...]:
    """About which a CIRCLE of `count` numbers turns right-handed."""
    return tuple(-v for v in vector) if count == _NX_NUMBERS else tuple(vector)


def _confirmed(count: int) -> bool:
    """Whether it is known how a CIRCLE of `count` numbers turns."""
    return count <= _KNOWN_NUMBERS or count == _NX_NUMBERS


def _plain_circle(statement: Statement, match: re.Match[bytes], collector: StatementCollector) -> ArcForm:
    """A CIRCLE of numbers alone, separated by commas: nearly every CIRCLE is one."""
    groups = match.groups()
    values = [float(n) for n in groups[:6]]
    radius = groups[6]
    spans = [match.span(k) for k in ((1, 2, 3) if radius is None else (1, 2, 3, 7))]
    words = [
        collector.word(Field(statement.text[a:b], statement.place(a), statement.place(b - 1) + 1))
        for a, b in spans
    ]
    text = ArcText(
        statement.begin, statement.end, ((words[0], words[1], words[2]),), words[3] if radius else -1
    )
    count = _KNOWN_NUMBERS + (groups[7] or b"").count(b",")
    return ArcForm(
        text, statement.line, tuple(values[:3]), _normal(values[3:], count),
        None if radius is None else float(radius), confirmed=_confirmed(count),
    )  # fmt: skip


def movarc(statement: Statement, collector: StatementCollector) -> ArcForm:
    """MOVARC of Autodesk."""
    fields = statement.fields()
    values = _numbers(fields, 7, statement, "MOVARC")
    angle_word = next((i for i, f in enumerate(fields) if f.text == b"ANGLE"), -1)
    angle = fields[angle_word + 1].number if 0 < angle_word < len(fields) - 1 else None
    if angle is None:
        raise ProgramError(
            "MOVARC has no ANGLE; expected ANGLE and degrees", line=statement.line, code="OLP516"
        )
    a, b, c = (collector.word(f) for f in fields[:3])
    text = ArcText(
        statement.begin,
        statement.end,
        ((a, b, c),),
        collector.word(fields[6]),
        collector.word(fields[angle_word + 1]),
    )
    return ArcForm(
        text, statement.line, tuple(values[:3]), tuple(values[3:6]), values[6],
        float(np.radians(angle[0] / 10.0 ** angle[1])),
    )  # fmt: skip


def tlon(statement: Statement, collector: StatementCollector) -> tuple[ArcForm, list[Field]]:
    """TLON of CATIA, and the fields of its end. Raises ProgramError for any other drive along geometry."""
    groups = {m[1].upper(): _inside(statement, m) for m in _GROUP.finditer(statement.text)}
    major = statement.head()[1].replace(b" ", b"")
    kind = b"CIRCLE" if b"CIRCLE" in groups else b"CYLNDR"
    if major != b"TLON,GOFWD" or kind not in groups or b"LINE" not in groups:
        raise ProgramError(
            "this form of TLON is not read; expected TLON,GOFWD/(CIRCLE/…),ON,(LINE/…)",
            line=statement.line,
            code="OLP516",
        )
    size = 4 if kind == b"CIRCLE" else 7
    round_, straight = groups[kind], groups[b"LINE"]
    values = _numbers(round_, size, statement, kind.decode())
    line = _numbers(straight, 6, statement, "LINE")
    if max(abs(p - q) for p, q in zip(values[:2], line[:2], strict=True)) > 1e-3:
        raise ProgramError(
            "the LINE of TLON does not begin at the centre of its circle", line=statement.line, code="OLP530"
        )
    normal = (0.0, 0.0, 1.0) if kind == b"CIRCLE" else tuple(values[3:6])
    again = _AGAIN.search(statement.text)
    long = None if again is None else (statement.place(again.start()), statement.place(again.end() - 1) + 1)
    centres = tuple(
        (a, b, c) for a, b, c in ([collector.word(f) for f in fields[:3]] for fields in (round_, straight))
    )
    text = ArcText(
        statement.begin, statement.end, centres, collector.word(round_[size - 1]), whole=True, long=long
    )
    form = ArcForm(
        text, statement.line, tuple(values[:3]), normal, values[size - 1], second=again is not None
    )
    return form, straight[3:6]


def directed(form: ArcForm, statement: Statement, collector: StatementCollector) -> ArcForm:
    """An arc of CATIA with the direction that INDIRV says before it."""
    fields = statement.fields()
    values = _numbers(fields, 3, statement, "INDIRV")
    text = replace(form.text, begin=statement.begin, direction=tuple(collector.word(f) for f in fields[:3]))
    return replace(form, text=text, begins=tuple(values[:3]))


def _inside(statement: Statement, group: re.Match[bytes]) -> list[Field]:
    offset = group.start(2)
    return [
        Field(m[0].upper(), statement.place(offset + m.start()), statement.place(offset + m.end() - 1) + 1)
        for m in _TOKEN.finditer(group[2])
    ]


def resolved(
    forms: Sequence[ArcForm], start: Array, end: Array, line: Index, unit_mm: float, offset: Array,
    turn: Array | None,
) -> Resolved:  # fmt: skip
    """Arcs on the machine, from points `start` to `end` (m, 3), whose normals are axes of it. Raises
    ProgramError for an arc without a normal, and for one whose words contradict each other."""
    centre = np.array([f.centre for f in forms]) * unit_mm
    normal = np.array([f.normal for f in forms])
    if turn is not None:
        centre, normal = centre @ turn.T, normal @ turn.T
    centre = centre + offset
    size = np.sqrt((normal * normal).sum(axis=1))
    axis = np.abs(normal).argmax(axis=1)
    rows = np.arange(len(forms))
    along = normal[rows, axis]
    for i in np.flatnonzero(~(size > 0)).tolist():
        raise ProgramError(
            "the normal of an arc has no length; expected the direction about which it turns",
            line=forms[i].line,
            code="OLP516",
        )
    plane = _PLANE_OF[axis]
    axes = np.array(PLANES)[plane]
    clockwise = along < 0
    for i, form in enumerate(forms):
        if form.begins is not None:
            clockwise[i] = _catia(form, start[i], end[i], centre[i], axes[i], turn)
    words = np.full((len(forms), 5), np.nan)
    words[:, :3] = centre
    words[:, 4] = [f.turns for f in forms]
    centre_mm, sweep = arc_geometry(
        start, end, words, clockwise=clockwise, plane=plane, absolute=np.ones(len(forms), bool),
        offset=np.zeros((len(forms), 3)), line=np.array([f.line for f in forms]),
    )  # fmt: skip
    for i, form in enumerate(forms):
        _check(form, start[i], centre_mm[i], axes[i], float(sweep[i]), unit_mm)
    return Resolved(centre_mm, plane, sweep)


def joints(arcs: Resolved, start: Array, before: Array) -> Index:
    """(m,) of each arc: 1 where it continues the straight move from `before` to its start, -1 where it begins
    in the opposite direction, 0 where there is a corner, which shows neither."""
    rows = np.arange(len(start))
    axes = np.array(PLANES)[arcs.plane]
    arm = start - arcs.centre
    tangent = np.zeros_like(start)
    tangent[rows, axes[:, 0]] = -arm[rows, axes[:, 1]] * np.sign(arcs.sweep)
    tangent[rows, axes[:, 1]] = arm[rows, axes[:, 0]] * np.sign(arcs.sweep)
    come = start - before
    size = np.sqrt((tangent * tangent).sum(axis=1) * (come * come).sum(axis=1))
    with np.errstate(invalid="ignore", divide="ignore"):
        cosine = np.nan_to_num((tangent * come).sum(axis=1) / size)
    return np.where(np.abs(cosine) > _TANGENT, np.sign(cosine), 0.0).astype(np.int64)


def _catia(form: ArcForm, start: Array, end: Array, centre: Array, axes: Array, turn: Array | None) -> bool:
    """Whether the arc goes clockwise. It begins as INDIRV says, and has to meet the line where it ends."""
    direction = np.array(form.begins) if turn is None else turn @ np.array(form.begins)
    first, second = int(axes[0]), int(axes[1])
    arm = start - centre
    turning = float(arm[first] * direction[second] - arm[second] * direction[first])
    if not abs(turning) > 0.1 * float(np.hypot(arm[first], arm[second])) * float(
        np.hypot(*direction[[first, second]])
    ):
        raise ProgramError(
            "INDIRV does not say in which direction the arc turns; expected one along the arc at its start",
            line=form.line,
            code="OLP516",
        )
    to = end - centre
    angle = np.arctan2(to[second], to[first]) - np.arctan2(arm[second], arm[first])
    angle = float(angle if turning > 0 else -angle) % (2 * np.pi) or 2 * np.pi
    if (angle > np.pi) != form.second and abs(angle - np.pi) > 1e-3:
        times = "first" if not form.second else "second"
        raise ProgramError(
            f"the arc meets its line the {times} time on the other side of its centre, "
            "not at the end that the line states",
            line=form.line,
            code="OLP530",
        )
    return turning < 0


def _check(form: ArcForm, start: Array, centre: Array, axes: Array, sweep: float, unit_mm: float) -> None:
    """Refuse a stated radius or angle that is not that of the points."""
    first, second = int(axes[0]), int(axes[1])
    size = float(np.hypot(start[first] - centre[first], start[second] - centre[second]))
    if form.radius is not None:
        off = abs(abs(form.radius) * unit_mm - size)
        if off > max(SPIRAL_ABSOLUTE_MM, SPIRAL_RELATIVE * size):
            raise ProgramError(
                f"the arc states a radius of {abs(form.radius) * unit_mm:.4f} mm, "
                f"and its start is {size:.4f} mm from its centre",
                line=form.line,
                code="OLP530",
            )
    if form.angle_rad is not None:
        off = abs(abs(form.angle_rad) - abs(sweep))
        if min(off, abs(off - 2 * np.pi)) > _ANGLE_RAD + 0.01 / max(size, 1e-9):
            raise ProgramError(
                f"the arc states an angle of {np.degrees(form.angle_rad):.4f} degrees, "
                f"and its points give {np.degrees(abs(sweep)):.4f}",
                line=form.line,
                code="OLP530",
            )
