"""Reads reported points from DMIS output (ISO 22093): feature actuals of points, and point data.

Only points can be corrected one by one: `FA(name)=FEAT/POINT,CART,x,y,z,i,j,k`, and `PTDATA` and `RAWDAT` in
the same form. Features of several touches, and tolerances evaluated from them, stay unchanged, with the
reason. Nominals (`F`, `T`) have no error of the machine.
"""

from __future__ import annotations

import re
from typing import NoReturn, TypeVar

import numpy as np

from olp.core.arrays import Array, Index
from olp.core.errors import InputError
from olp.program.dmis.dialect import DIALECT as DMIS
from olp.program.dmis.events import MACHINE_FRAME
from olp.program.text.numbers import Number, number
from olp.program.text.statements import Comment, Statement, chunks
from olp.results.dmis_columns import PlainPoints, plain_points
from olp.results.reported import Names, PointColumns, Reported, Stated, Unchanged, index_type, missing
from olp.results.table import stated_in

#: mm per unit of length
_UNITS = {b"MM": 1.0, b"CM": 10.0, b"M": 1000.0, b"INCH": 25.4, b"FEET": 304.8}
_HEAD = re.compile(rb"\s*(?:([A-Za-z]+)\s*\(\s*([^)]*?)\s*\)\s*=\s*)?([A-Za-z]\w*)\s*(?:/\s*|$)")
_LABEL = re.compile(rb"\s*([A-Za-z]+)\s*\(\s*([^)]*?)\s*\)")
_IS_DMIS = re.compile(
    rb"^\s*(?:(?:FA|F|TA|T|D|DA|DAT|S)\s*\([^)\n]*\)\s*=\s*\w|"
    rb"(?:DMISMN|DMISMD|FILNAM|UNITS|OUTPUT|PTDATA|RAWDAT|ENDFIL)\s*/?)",
    re.MULTILINE | re.IGNORECASE,
)
_MOTION = {b"GOTO", b"FROM", b"RAPID", b"PTMEAS", b"GOHOME", b"RMEAS", b"PATH"}
#: DMIS puts text in quotes, so no statement takes the rest of its line as text.
_NO_TEXT = re.compile(rb"(?!)")
T = TypeVar("T")
_COMPOSED = "its touches are not in it one by one; correct the touch points and evaluate the feature again"
_EVALUATED = "it was evaluated from values before correction; evaluate it again"
#: bytes that are searched for a statement of DMIS
_LOOK = 1 << 16


def is_dmis(data: bytes) -> bool:
    """Whether a text has statements of DMIS."""
    return _IS_DMIS.search(data[:_LOOK]) is not None


def _refuse_motion(major: bytes, line: int) -> NoReturn:
    raise InputError(
        f"{major.decode('latin-1')} makes this a part program, not a file of results; use olp correct",
        line=line,
    )


class _Reader:
    """One reading of one file: units, frame and sensor as they change from statement to statement."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.unit_mm: float | None = None
        self.frame = MACHINE_FRAME
        self.tool: str | None = None
        self.approach = float("nan")
        self.frames: list[str] = []
        self.tools: list[str | None] = []
        self.points = PointColumns()
        self.unchanged: list[Unchanged] = []
        self.stated: list[Stated] = []

    def statement(self, statement: Statement) -> None:
        head = _HEAD.match(statement.text)
        if head is None:
            return
        kind, label, major = (
            part.upper() if part and i != 1 else part for i, part in enumerate(head.groups())
        )
        rest, offset = statement.text[head.end() :], head.end()
        if kind == b"FA" and major == b"FEAT":
            self._actual(statement, (label or b"").decode("latin-1"), rest, offset)
        elif kind is None and major in (b"PTDATA", b"RAWDAT"):
            self._point(statement, major.decode(), rest, offset)
        elif kind == b"TA":
            name = f"TA({(label or b'').decode('latin-1')})"
            self.unchanged.append(Unchanged(statement.line, name, _EVALUATED))
        elif kind in (b"D", b"DA"):
            self.frame = (label or b"").decode("latin-1")
        elif kind is None:
            self._state(statement, major or b"", rest)

    def _state(self, statement: Statement, major: bytes, rest: bytes) -> None:
        words = [w.strip().upper() for w in rest.split(b",")]
        if major == b"UNITS":
            if words[0] not in _UNITS:
                raise InputError(
                    f"UNITS/{words[0].decode('latin-1')} is not a unit of length; "
                    "expected MM, CM, M, INCH or FEET",
                    line=statement.line,
                )
            self.unit_mm = _UNITS[words[0]]
        elif major in (b"RECALL", b"SNSLCT"):
            label = _LABEL.match(rest)
            if label is None:
                return
            kind, name = label[1].upper().decode("latin-1"), label[2].decode("latin-1")
            if major == b"SNSLCT":
                self.tool = name
            elif kind in ("D", "DA"):
                self.frame = name
        elif major == b"SNSET" and words[0] == b"APPRCH" and len(words) > 1:
            distance = number(words[1])
            self.approach = float("nan") if distance is None else distance.value * (self.unit_mm or 1.0)
        elif major == b"TECOMP" and b"ON" in words:
            text = statement.text.strip().decode("latin-1")
            self.stated.append(Stated(statement.line, "temperature", text))
        elif major in _MOTION:
            _refuse_motion(major, statement.line)

    def _actual(self, statement: Statement, label: str, rest: bytes, offset: int) -> None:
        name = f"FA({label})"
        kind, _, tail = rest.partition(b",")
        if kind.strip().upper() != b"POINT":
            what = kind.strip().upper().decode("latin-1")
            self.unchanged.append(Unchanged(statement.line, f"{name}, a {what},", _COMPOSED))
            return
        self._point(statement, name, tail, offset + len(kind) + 1)

    def _point(self, statement: Statement, name: str, rest: bytes, offset: int) -> None:
        system, _, tail = rest.partition(b",")
        if system.strip().upper() != b"CART":
            raise InputError(
                f"{name} is stated in {system.strip().decode('latin-1') or 'no coordinates'}; only Cartesian "
                "points (CART) are read; have the machine write them in CART",
                line=statement.line,
            )
        self._check_unit(name, statement.line)
        offset += len(system) + 1
        spans: list[tuple[int, int]] = []
        values: list[Number] = []
        for word in tail.split(b","):
            bare = word.strip()
            value = number(bare)
            if value is None:
                if len(values) < 3:
                    raise InputError(
                        f'{name}: "{bare.decode("latin-1")[:40]}" is not a number; expected x, y, z',
                        line=statement.line,
                    )
                break
            first = offset + word.index(bare)
            # the end is after the last byte, not before the next: a continuation may be between them
            spans.append((statement.place(first), statement.place(first + len(bare) - 1) + 1))
            values.append(value)
            offset += len(word) + 1
        if len(values) < 3:
            raise InputError(f"{name} has {len(values)} coordinates; expected x, y, z", line=statement.line)
        normal = [v.value for v in values[3:6]]
        span = np.array([spans[:3]])
        self._put(
            Names.of([name]), np.array([statement.line]), span[:, :, 0], span[:, :, 1],
            np.array([[v.value for v in values[:3]]]),
            np.array([normal]) if len(normal) == 3 else missing(1, 3),
        )  # fmt: skip

    def plain(self, points: PlainPoints, first_line: int) -> None:
        """Points of a chunk whose lines come after so many."""
        if not len(points.line):
            return
        line = points.line + first_line + 1
        self._check_unit(points.names[0], int(line[0]))
        names = Names.of(points.names)
        self._put(names, line, points.start, points.end, points.value, points.normal)

    def _check_unit(self, name: str, line: int) -> None:
        """Raise InputError where the unit of a point is not known."""
        if self.unit_mm is None:
            raise InputError(
                f"{name} comes before any UNITS statement, so its unit is not known; "
                "put a statement such as UNITS/MM,ANGDEC before it",
                line=line,
            )

    def _put(self, names: Names, line: Index, start: Index, end: Index, value: Array, normal: Array) -> None:
        """Points in the state of the reader: lines (n,), and (n, 3) of the others."""
        count, small = len(names), index_type(len(self.data))
        self.points.put(
            names, line=line.astype(np.int32), start=start.astype(small), end=end.astype(small), value=value,
            normal=normal, unit=np.full(count, self.unit_mm),
            frame=np.full(count, _index(self.frames, self.frame), np.int32),
            tool=np.full(count, _index(self.tools, self.tool), np.int32),
            approach=np.full(count, self.approach),
        )  # fmt: skip


def _index(known: list[T], value: T) -> int:
    if value not in known:
        known.append(value)
    return known.index(value)


def read_dmis(data: bytes) -> Reported:
    """The points of DMIS output. Raises InputError with the line of what is wrong."""
    reader = _Reader(data)
    for chunk in chunks(data):
        if len(chunk.point):
            _refuse_motion(b"GOTO", chunk.first_line + int(chunk.point[0]) + 1)
        plain, done = plain_points(chunk), 0
        chunk.others = np.setdiff1d(chunk.others, plain.line, assume_unique=True)
        goes_on = 0
        for statement in chunk.statements(_NO_TEXT):
            before = int(np.searchsorted(plain.line, statement.line - chunk.first_line - 1))
            reader.plain(plain.part(done, before), chunk.first_line)
            done = before
            if isinstance(statement, Comment):
                text = statement.text.rstrip()
                goes_on = statement.line + 1 if text.endswith(b"$") and text.strip() != b"$$" else 0
                continue
            if statement.line == goes_on:
                raise InputError(
                    "the comment before this statement ends in $, so the statement may be part of it; "
                    "take the $ off the comment, or begin this line with $$",
                    line=statement.line,
                )
            reader.statement(statement)
        reader.plain(plain.part(done, len(plain.line)), chunk.first_line)
    points = reader.points
    if not points.count:
        why = f" ({reader.unchanged[0].name} {reader.unchanged[0].reason})" if reader.unchanged else ""
        raise InputError(f"holds no points (FA(..)=FEAT/POINT or PTDATA){why}")
    remarks = ((match.start(), match[1]) for match in re.finditer(rb"\$\$([^\r\n]*)", data))
    return Reported(
        data=data,
        dialect=DMIS.name,
        axes_at_ram=DMIS.axes_at_ram,
        line=points.take("line"),
        start=points.take("start"),
        end=points.take("end"),
        value=points.take("value"),
        unit_mm=points.take("unit"),
        normal=points.take("normal"),
        frame=points.take("frame"),
        frames=tuple(reader.frames),
        tool=points.take("tool"),
        tools=tuple(reader.tools),
        stylus_mm=missing(points.count, 3),
        approach_mm=points.take("approach"),
        names=points.names(),
        comment=(b"$$ ", b""),
        point="surface",
        unchanged=tuple(reader.unchanged),
        stated=(*stated_in(data, remarks), *reader.stated),
        assumed=("DMIS output: points lie on the surface, their directions point out of it",),
    )
