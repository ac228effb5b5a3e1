"""Readings of one line from text files with columns, whose layout is an olp-line-profile-1 file.

schema = "olp-line-profile-1"
instrument = "laser, export of the shop"
delimiter = "semicolon"
decimal = "comma"
header_lines = 7
unit = "um"
sense = "actual-minus-commanded"
runs = "reversal"
[columns]
target = "Target"
value = "Error"
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Literal

import numpy as np

from olp.core.errors import InputError
from olp.core.machine import COMPONENTS
from olp.core.schema import Table, Text
from olp.core.schema_keys import Field, Known, refusal, rule
from olp.files.columns import instrument_text, place_in
from olp.files.measurements.line_runs import columns_as_runs, counted, trend, turns
from olp.files.measurements.readings import ANGULAR, SENSES, UNITS, Readings, parse_readings
from olp.files.measurements.renishaw import MARK, RTX, RecordingTable, line_of_recording, parse_rtx, read_rtx
from olp.files.measurements.rtl import is_stored_line, parse_rtl
from olp.files.problems import Problem, config_error, validate
from olp.files.toml_text import read_toml
from olp.files.write import PathLike, read_bytes
from olp.program.text.delimited import DELIMITERS, MM
from olp.program.text.rows import Form

Column = Text | Annotated[int, Field(ge=1)]
Direction = Annotated[int, Field(ge=-1, le=1)]

#: Marks between groups of three digits, by name.
_THOUSANDS = {"none": "", "point": ".", "comma": ",", "space": " ", "apostrophe": "'"}

#: Endings of measured lines in sections of text, each read by `parse_rtl`.
STORED_LINES = (".rtl", ".rta", ".rts")
#: Endings of files of instruments whose format is not public. Their programs export text.
WITHOUT_GRAMMAR = {
    ".pos": "a positioning measurement of Renishaw or Wyler",
    ".b5r": "a Renishaw ball-bar measurement",
    ".b20": "a Renishaw ball-bar measurement",
    ".lec": "a Renishaw compensation file",
    ".wyl": "a Wyler level measurement",
    ".lin": "an Agilent or API linear measurement",
}


class LineColumns(Table):
    target: Column = Field(description="the column of target positions: its name, or its number from 1")
    value: Column | list[Column] = Field(
        description="the column of readings, or a list of columns, one per run: names, or numbers from 1"
    )
    run: Column | None = Field(default=None, description="the column of run numbers")
    direction: Column | None = Field(default=None, description="the column of directions")
    axis: Column | None = Field(default=None, description="the column that names the axis of a row")


class LineProfile(Table):
    """olp-line-profile-1: the layout of an instrument's text files."""

    schema_: Literal["olp-line-profile-1"] = Field(
        alias="schema", description='the format, "olp-line-profile-1"'
    )
    instrument: Text | None = Field(
        default=None, description="the instrument or program that writes the files"
    )
    delimiter: Literal["comma", "semicolon", "tab", "space"] = Field(
        default="comma", description='"comma", "semicolon", "tab" or "space" (any blanks) between columns'
    )
    decimal: Literal["point", "comma"] = Field(
        default="point", description='"point" or "comma" as decimal mark'
    )
    thousands: Literal["none", "point", "comma", "space", "apostrophe"] = Field(
        default="none", description="the mark between groups of three digits"
    )
    header_lines: Annotated[int, Field(ge=0)] = Field(
        default=0, description="the number of lines before the names of columns, or before the data"
    )
    header: bool = Field(default=True, description="whether a line with the names of columns comes first")
    comment: Text = Field(default="#", description="the mark at the beginning of lines that hold no reading")
    end: Text | None = Field(default=None, description="the beginning of the line that ends the data")
    position_unit: Literal["mm", "um", "m", "inch"] = Field(
        default="mm", description="the unit of target positions"
    )
    unit: Literal["mm", "um", "nm", "rad", "mrad", "urad", "arcsec", "um/m", "mm/m"] = Field(
        description="the unit of readings"
    )
    holds: Literal["error", "position"] = Field(
        default="error", description='"error", or "position" where the reading is the position itself'
    )
    sense: Text | None = Field(
        default=None,
        description="the sign convention of errors, one of " + ", ".join(f'"{s}"' for s in SENSES),
    )
    component: Text | None = Field(
        default=None, description='the ISO 230-1 name of the error in these files, such as "EXX"'
    )
    axis: Text | None = Field(
        default=None, description="the axis whose rows are read, where a column names axes"
    )
    runs: Literal["column", "blank-line", "reversal", "one"] = Field(
        default="reversal",
        description='how a new run begins: in a "column", after a "blank-line", where targets turn back '
        '("reversal"), or never ("one")',
    )
    directions: list[Direction] | None = Field(
        default=None, description="1 or -1 for each column of readings, where there are several"
    )
    forward: list[Text] = Field(
        default=["1", "+1", "+", "forward", "positive"],
        description="texts in the direction column that mean approached in +",
    )
    backward: list[Text] = Field(
        default=["-1", "-", "reverse", "backward", "negative"],
        description="texts in the direction column that mean approached in -",
    )
    columns: LineColumns | None = Field(default=None, description="the table [columns]")
    recording: RecordingTable | None = Field(
        default=None, description="the table [recording], for dynamic recordings (.rtx)"
    )

    @rule("sense")
    @staticmethod
    def _known_sense(value: str | None, known: Known) -> str | None:
        if value is not None and value not in SENSES:
            raise refusal(f'= "{value}" is not a sign convention; expected one of {", ".join(SENSES)}')
        return value

    @rule("component")
    @staticmethod
    def _known_component(value: str | None, known: Known) -> str | None:
        if value is None:
            return None
        if value not in COMPONENTS:
            raise refusal(f'= "{value}" is not an ISO 230-1 name; expected a name such as EXX, EYX or EBX')
        unit = known.get("unit")
        if unit is not None and (unit in ANGULAR) != (value[1] in "ABC"):
            kind = "an angle" if value[1] in "ABC" else "a length"
            raise refusal(
                f'= "{value}" is {kind}, which unit = "{unit}" does not fit; expected both lengths or angles'
            )
        return value

    @rule("columns", "recording")
    @staticmethod
    def _fits(value: LineColumns | RecordingTable | None, known: Known) -> object:
        if known.get("decimal") == "comma" and known.get("delimiter") == "comma":
            raise refusal(
                "cannot be read, because commas are both between columns and in numbers; expected another "
                "delimiter"
            )
        if known.get("thousands") == known.get("decimal"):
            raise refusal("cannot be read, because decimal and thousands are the same; expected two marks")
        if known.get("holds") == "position" and known.get("unit") in ANGULAR:
            raise refusal('does not fit holds = "position" with a unit of angle; expected holds = "error"')
        if known.get("holds") == "position" and "commanded-minus-actual" in (known.get("sense") or ""):
            raise refusal(
                'contradicts sense, because a position minus its target is "actual-minus-commanded"; '
                "expected that, or sense left out"
            )
        if isinstance(value, LineColumns):
            several, signs = isinstance(value.value, list), known.get("directions")
            count = len(value.value) if isinstance(value.value, list) else 1
            if several and (signs is None or len(signs) != count or 0 in signs):
                raise refusal("names several columns of readings; expected directions, 1 or -1 for each")
            if known.get("runs") == "column" and value.run is None and not several:
                raise refusal('lacks run, but runs = "column"; name the column, or change the value of runs')
        return value


def load_line_profile(path: PathLike) -> LineProfile:
    """The profile in a TOML file. Raises InputError, ConfigError with every problem and its line."""
    values, lines = read_toml(read_bytes(path), str(path))
    return validate(LineProfile, values, lines, str(path))


def read_line(path: PathLike, profile: LineProfile | None = None) -> Readings:
    """The readings of one file, as `profile` describes it. Without a profile, native CSV.

    A measured line in sections (.rtl) is read without one. Raises InputError where the file is of an
    instrument whose format is not public, and ConfigError with every problem and its line.
    """
    if profile is not None:
        return read_profiled(path, profile)
    ending = Path(path).suffix.lower()
    if ending == RTX:
        return read_rtx(path)
    if ending in WITHOUT_GRAMMAR:
        raise InputError(
            f"is {WITHOUT_GRAMMAR[ending]} by its name, and that format is not public; export the readings "
            "as text and describe its columns with a profile (--profile)",
            file=str(path),
        )
    data = read_bytes(path)
    return parse_rtl(data, str(path)) if ending in STORED_LINES else parse_readings(data, str(path))


def read_profiled(path: PathLike, profile: LineProfile) -> Readings:
    """The readings of a text file or a dynamic recording, by a profile. Raises as `read_line`."""
    data = read_bytes(path)
    if profile.recording is not None:
        recording = parse_rtx(data, str(path))
        return _in_sense(
            line_of_recording(recording, profile.recording, profile.unit, profile.holds), profile
        )
    if profile.columns is None and is_stored_line(data):
        return _in_sense(parse_rtl(data, str(path), profile.unit), profile)
    if data.startswith(MARK) and not is_stored_line(data):
        return read_rtx(path)
    return parse_line(data, str(path), profile)


def parse_line(data: bytes, file: str, profile: LineProfile) -> Readings:
    """Readings from the bytes of a text file, by a profile with [columns]."""
    if profile.columns is None:
        raise InputError("the profile has no table [columns]; expected target and value in it", file=file)
    header, rows = _lines(instrument_text(data, file), profile)
    hint = "; check header_lines and delimiter of the profile"
    cells = {key: place_in(header, column, file, hint) for key, column in _wanted(profile.columns)}
    values = [key for key in cells if key.startswith("value")]
    table: list[tuple[int, float, list[float], float, int]] = []
    problems: list[Problem] = []
    block, seen = 0, False
    for line, row in rows:
        if row is None:
            block += seen
            seen = False
            continue
        if "axis" in cells and profile.axis is not None and _cell(row, cells["axis"]) != profile.axis:
            continue
        seen = True
        numbers = {key: _number(_cell(row, cells[key]), profile) for key in ("target", *values)}
        wrong = [f"column {cells[key] + 1}: {text}" for key, text in numbers.items() if isinstance(text, str)]
        run, sign = float(block), 0
        if "run" in cells:
            number = _number(_cell(row, cells["run"]), profile)
            run = number if isinstance(number, float) else 0.0
            if run != int(run) or run < 1:
                wrong.append(f'run = "{_cell(row, cells["run"])}"; expected an integer from 1')
        if "direction" in cells:
            text = _cell(row, cells["direction"])
            sign = _sign(text, profile)
            if not sign:
                known = ", ".join((*profile.forward, *profile.backward))
                wrong.append(f'direction "{text}" is not among {known}; set forward and backward')
        problems += [(line, text) for text in wrong]
        if not wrong:
            target = float(numbers["target"]) * MM[profile.position_unit]
            table.append((line, target, [float(numbers[key]) for key in values], run, sign))
    if not problems and len(table) < 2:
        problems = [(None, f"holds {len(table)} readings in these columns; expected at least 2")]
    if problems:
        raise config_error(problems, file)
    return _in_sense(_readings(table, file, profile, cells), profile)


def _lines(text: str, profile: LineProfile) -> tuple[list[str], list[tuple[int, list[str] | None]]]:
    """Names of columns, and (line, cells) of each row; None for an empty line."""
    header: list[str] = []
    rows: list[tuple[int, list[str] | None]] = []
    waits = profile.header
    form = Form(DELIMITERS[profile.delimiter], (profile.comment,), loose=True)
    for number, line in form.lines(text):
        begin = line.lstrip()
        if number <= profile.header_lines or begin.startswith(form.comments):
            continue
        if profile.end is not None and begin.startswith(profile.end):
            break
        cells = form.cells(line) if begin else None
        if waits and cells is not None:
            header, waits = cells, False
        else:
            rows.append((number, cells))
    return header, rows


def _wanted(columns: LineColumns) -> Iterator[tuple[str, str | int]]:
    yield "target", columns.target
    several = columns.value if isinstance(columns.value, list) else [columns.value]
    yield from ((f"value{index}", column) for index, column in enumerate(several))
    for key in ("run", "direction", "axis"):
        column = getattr(columns, key)
        if column is not None:
            yield key, column


def _cell(row: Sequence[str], column: int) -> str:
    return row[column] if column < len(row) else ""


def _number(cell: str, profile: LineProfile) -> float | str:
    """The number in a cell, or what is wrong with it."""
    mark = "." if profile.decimal == "point" else ","
    group = _THOUSANDS[profile.thousands]
    whole = rf"\d{{1,3}}(?:{re.escape(group)}\d{{3}})+|\d+" if group else r"\d+"
    if re.fullmatch(
        rf"[-+]?(?:(?:{whole})(?:{re.escape(mark)}\d*)?|{re.escape(mark)}\d+)(?:[eE][-+]?\d+)?", cell
    ):
        plain = cell.replace(group, "") if group else cell
        return float(plain.replace(mark, "."))
    if not cell:
        return "is empty; leave the row out where the reading is missing"
    if re.fullmatch(r"[-+]?[\d.,' ]+", cell):
        marks = f'decimal = "{profile.decimal}" and thousands = "{profile.thousands}"'
        return f'"{cell}" does not fit {marks}; correct these keys of the profile'
    return f'"{cell[:40]}" is not a number'


def _sign(text: str, profile: LineProfile) -> int:
    folded = text.casefold()
    if folded in {word.casefold() for word in profile.forward}:
        return 1
    return -1 if folded in {word.casefold() for word in profile.backward} else 0


def _readings(
    table: list[tuple[int, float, list[float], float, int]],
    file: str,
    profile: LineProfile,
    cells: Mapping[str, int],
) -> Readings:
    """Rows (line, target in mm, readings, run or block, direction) with their runs and directions."""
    line = np.array([row[0] for row in table])
    target = np.array([row[1] for row in table])
    readings = np.array([row[2] for row in table])
    notes = []
    if profile.directions is not None and readings.shape[1] > 1:
        rows, column, run, direction = columns_as_runs(target, profile.directions)
        line, target, value = line[rows], target[rows], readings[rows, column]
        notes.append(f"{readings.shape[1]} columns are runs in directions {profile.directions}")
    else:
        value, block = readings[:, 0], np.array([row[3] for row in table])
        direction = np.array([row[4] for row in table], np.int64)
        if profile.runs == "reversal" and "run" not in cells:
            block = block * len(table) + turns(target)
        elif profile.runs == "one":
            block = np.zeros(len(table))
        if "direction" not in cells:
            direction = trend(target, block, line, file)
            notes.append("the direction of a run is that of its targets in their order")
        run = block.astype(np.int64) if "run" in cells else counted(block, direction)
    value = value * UNITS[profile.unit]
    if profile.holds == "position":
        value = value - target
    return Readings(
        file, target, value, run, direction, line, profile.component, profile.unit in ANGULAR,
        MappingProxyType({}), tuple(notes),
    )  # fmt: skip


def _in_sense(readings: Readings, profile: LineProfile) -> Readings:
    """Readings with the component of the profile, as actual minus commanded where the profile states its sign
    convention."""
    known = readings if profile.sense is None else readings.with_sense(profile.sense)
    return replace(known, component=profile.component or known.component)
