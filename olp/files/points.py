"""Reads files of measured points as a profile says."""

from __future__ import annotations

import hashlib
import io
import itertools
import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from olp.core.arrays import Array
from olp.core.errors import InputError
from olp.core.units import RAD_PER_URAD
from olp.core.values import dataclass
from olp.files.columns import place_in
from olp.files.point_profile import MEASURED, PointProfile, looked_at
from olp.files.write import PathLike, Reader, read_bytes
from olp.kinematics.poses import tilts
from olp.program.text.delimited import DELIMITERS, LOOK, MM, SECONDS, first_lines, stated_frame
from olp.program.text.rows import Form, decoded, form_of, no_number

#: Columns of an orientation, with their unit.
_ANGLE = re.compile(r"(?i)([ABC])[ _]*[\[(]?deg[\])]?|(R[XYZ])[ _]*[\[(]?urad[\])]?")


@dataclass(frozen=True, slots=True, eq=False)
class Points:
    """(n, 3) positions in mm, with times (n,) in s, names and program lines (n,) where the file has them.

    `frame` is the frame of the positions as the file states it, None where it does not. `rotation` (n, 3, 3)
    is the orientation of the tool where columns A_deg, B_deg, C_deg state it: R = Rz(C) Ry(B) Rx(A).
    `turn_rad` (n, 3) are rotation vectors from the nominal orientation, of columns RX_urad, RY_urad, RZ_urad.
    """

    file: str
    points_mm: Array
    time_s: Array | None
    names: tuple[str, ...] | None
    line: npt.NDArray[np.int64] | None
    frame: str | None
    profile: PointProfile
    sha256: str
    rotation: Array | None = None
    turn_rad: Array | None = None

    def __len__(self) -> int:
        return len(self.points_mm)


def read_points(
    path: PathLike, profile: PointProfile | None = None, read: Reader = read_bytes, *, oriented: bool = False
) -> Points:
    """The points of a file. Without a profile its layout is detected from its first rows.

    Raises InputError where the file cannot be read, its layout cannot be detected, or a row is wrong, with
    the line. Orientations are read where they are to be `oriented`.
    """
    return parse_points(read(path), str(path), profile, oriented=oriented)


def row_line(points: Points, row: int) -> int:
    """The line of a point in its file, counted from 1."""
    text = decoded(read_bytes(points.file))
    form = form_of(points.profile.layout)
    skip, _ = _header(text, form, points.profile.header)
    return next(itertools.islice(form.rows(text, skip), row, None))[0]


def layout_of(data: bytes) -> PointProfile | None:
    """The layout detected from the first rows of a file, None where it is ambiguous."""
    return looked_at(first_lines(data))


def parse_points(
    data: bytes, file: str, profile: PointProfile | None = None, *, oriented: bool = False
) -> Points:
    """As `read_points`, from the bytes of the file."""
    try:
        text = _lines(decoded(data))
    except InputError as error:
        raise error.in_file(file) from None
    layout = profile or layout_of(data)
    if not text.strip():
        raise InputError("holds no points; expected one row per point", file=file)
    if layout is None:
        raise InputError(
            "does not show which columns hold X, Y and Z; name them in the header, or give olp compare "
            "--column X=.. --column Y=.. --column Z=.., or a profile with --profile",
            file=file,
        )
    stated = stated_frame(list(itertools.islice(io.StringIO(text), LOOK)), file)
    form = form_of(layout.layout)
    skip, header = _header(text, form, layout.header)
    if next(form.rows(text, skip), None) is None:
        raise InputError("holds no points; expected one row per point", file=file)
    columns = {
        key: place_in(header, column, file) for key, column in layout.columns.given.items() if key in MEASURED
    }
    turning = _turning(header, file) if oriented else {}
    columns |= turning
    numbers = [key for key in columns if key != "name"]
    table = _table(text, file, layout, skip, [columns[key] for key in numbers])
    column = dict(zip(numbers, table.T, strict=True))
    time = column["t"] * SECONDS[layout.time_unit] if "t" in column else None
    if time is None and layout.sample_period_s is not None:
        time = np.arange(len(table)) * layout.sample_period_s
    names = None
    if "name" in columns:
        names = _texts(text, file, layout, skip, columns["name"])
    turns = np.column_stack([column[key] for key in turning]) if turning else None
    stated_turn = turns is not None and "RX" in turning
    return Points(
        file,
        np.column_stack([column[axis] for axis in "XYZ"]) * MM[layout.unit],
        time,
        names,
        column["line"].astype(np.int64) if "line" in column else None,
        stated or layout.frame,
        layout,
        hashlib.sha256(data).hexdigest(),
        tilts(np.radians(turns)) if turns is not None and not stated_turn else None,
        turns * RAD_PER_URAD if turns is not None and stated_turn else None,
    )


def _turning(header: Sequence[str], file: str) -> dict[str, int]:
    """The columns of the orientation: those of A_deg, B_deg, C_deg, or of RX_urad, RY_urad, RZ_urad; none
    where the header does not name three. Raises InputError where it names all six."""
    found = [_ANGLE.fullmatch(name) for name in header]
    named = {str(m[1] or m[2]).upper(): place for place, m in enumerate(found) if m is not None}
    chosen = [keys for keys in (("A", "B", "C"), ("RX", "RY", "RZ")) if named.keys() >= set(keys)]
    if len(chosen) > 1:
        raise InputError(
            "states the orientation by A_deg, B_deg, C_deg and by RX_urad, RY_urad, RZ_urad; expected one of "
            "them",
            file=file,
        )
    return {key: named[key] for keys in chosen for key in keys}


def _lines(text: str) -> str:
    """A text with one kind of line ends."""
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _header(text: str, form: Form, named: bool) -> tuple[int, list[str]]:
    """The number of lines before the first row of data, and the names of columns where a row names them."""
    first = list(itertools.islice(form.lines(text), LOOK))
    for line, whole in first:
        if form.holds(whole):
            return (line, form.cells(whole)) if named else (line - 1, [])
    return len(first), []


def _texts(text: str, file: str, profile: PointProfile, skip: int, column: int) -> tuple[str, ...]:
    """The cells of a column."""
    texts = []
    for number, cells in form_of(profile.layout).rows(text, skip):
        if column >= len(cells):
            raise _too_short(cells, column, file, number, profile)
        texts.append(cells[column])
    return tuple(texts)


def _too_short(
    cells: Sequence[str], column: int, file: str, number: int, profile: PointProfile
) -> InputError:
    return InputError(
        f'{len(cells)} columns; expected at least {column + 1}; is the delimiter "{profile.delimiter}"?',
        file=file, line=number,
    )  # fmt: skip


def _table(text: str, file: str, profile: PointProfile, skip: int, columns: Sequence[int]) -> Array:
    """(n, k) numbers of the columns."""
    body = text.replace(",", ".") if profile.decimal == "comma" else text
    if profile.decimal == "comma" and profile.delimiter == "comma":
        raise InputError("has commas both between columns and in numbers; name another delimiter", file=file)
    # only whole lines are comments, not text behind a mark in a cell; emptied lines keep the line numbers
    body = re.sub(rf"(?m)^[ \t]*((#|{re.escape(profile.comment)}).*)?$", "", body)
    try:
        table = np.loadtxt(
            io.StringIO(body), delimiter=DELIMITERS[profile.delimiter], skiprows=skip, usecols=columns,
            comments=None, ndmin=2, quotechar='"',
        )  # fmt: skip
    except (ValueError, IndexError):
        raise _wrong_row(body, file, profile, skip, columns) from None
    bad = np.flatnonzero(~np.isfinite(table).all(axis=1))
    if len(bad):
        line = next(itertools.islice(form_of(profile.layout).rows(body, skip), int(bad[0]), None))[0]
        raise InputError("a number is not finite; remove the row, or measure it again", file=file, line=line)
    return np.asarray(table, float)


def _wrong_row(text: str, file: str, profile: PointProfile, skip: int, columns: Sequence[int]) -> InputError:
    for number, cells in form_of(profile.layout).rows(text, skip):
        for column in columns:
            if column >= len(cells):
                return _too_short(cells, column, file, number, profile)
            try:
                float(cells[column])
            except ValueError:
                return InputError(no_number(column, cells[column], profile.decimal), file=file, line=number)
    return InputError("cannot be read as a table; check the delimiter", file=file)
