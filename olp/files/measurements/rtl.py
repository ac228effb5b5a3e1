"""Measured lines as Renishaw's programs store them (.rtl, .rta, .rts): sections of text, `NAME::` above each.

    TARGET DATA::    Target-count: 3, then Targets : and the positions in mm over one or more lines
    USER-TEXT::      Machine, Serial No, Date, Axis
    RUNS::           Run-count: 2
    DEVIATIONS::     Run Target Data: and rows of run, number of the target from 1, deviation

The layout is known from public readers and one public writer, not from the maker. Deviations of a linear
measurement (.rtl) are in um. For other measurements no reader agrees with another, so a profile states the
unit. The sign convention is never in the file.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType

import numpy as np

from olp.core.arrays import Index
from olp.core.errors import InputError
from olp.core.units import AXES
from olp.files.columns import finite, instrument_text
from olp.files.measurements.line_runs import counted, trend
from olp.files.measurements.readings import ANGULAR, UNITS, Readings
from olp.files.problems import Problem, config_error

#: The section that a measured line has, and a dynamic recording has not.
TARGETS = b"TARGET DATA::"
#: The type of file in the header whose deviations are lengths in um.
_LINEAR = "rtl"
_SECTION = re.compile(r"([A-Z][A-Z0-9 -]*?)\s*::")
_KEY = re.compile(r"([A-Za-z][\w -]*?)\s*:\s*(.*)")
_DATE = re.compile(r"(\d{4}-\d\d-\d\d)\b.*")
#: Lines by section: their numbers and texts without blanks around them.
_Sections = Mapping[str, list[tuple[int, str]]]


def is_stored_line(data: bytes) -> bool:
    """Whether the bytes are a measured line in sections."""
    return TARGETS in data


def parse_rtl(data: bytes, file: str, unit: str | None = None) -> Readings:
    """The readings of a measured line; `unit` is that of a profile, None for that of the type of file.

    Runs are in the order of the file; a run whose targets fall is a backward run. Machine, day and component
    are taken where the file states them. Raises InputError where the unit is not known or the file is cut
    off, ConfigError with every problem and its line.
    """
    sections = _sections(instrument_text(data, file))
    if "TARGET DATA" not in sections:
        raise InputError(
            'has no section "TARGET DATA::"; expected a measured line as Renishaw stores it, or text columns '
            "described by a profile (--profile)",
            file=file,
        )
    head, user = _keys(sections, "HEADER"), _keys(sections, "USER-TEXT")
    kind = head.get("file type", ("", 0))[0].lower()
    if unit is None and kind != _LINEAR:
        raise InputError(
            f'is a measurement of type "{kind}", and does not state the unit of its deviations; give a '
            "profile with the key unit (--profile, or the key profile of the plan)",
            file=file,
        )
    target = _targets(sections, file)
    line, run, place, value = _deviations(sections, file)
    _check_whole(sections, (len(target), run, place), line, file)
    position = target[place - 1]
    block = run.astype(np.float64)
    direction = trend(position, block, line, file)
    unit = unit or "um"
    axis = user.get("axis", ("", 0))[0].upper()
    linear = kind == _LINEAR and axis in tuple(AXES)
    notes = [
        f"deviations are read in {unit}; compare one with the display of the instrument",
        "the direction of a run is that of its targets in their order",
    ]
    return Readings(
        file, position, value * UNITS[unit], counted(block, direction), direction, line,
        f"E{axis}{axis}" if linear else None, unit in ANGULAR, MappingProxyType(_stated(user)), tuple(notes),
    )  # fmt: skip


def _sections(text: str) -> _Sections:
    sections: dict[str, list[tuple[int, str]]] = {}
    name = ""
    for number, raw in enumerate(text.splitlines(), 1):
        line = raw.strip()
        head = _SECTION.fullmatch(line)
        if head:
            name = head[1]
            sections.setdefault(name, [])
        elif line and name:
            sections[name].append((number, line))
    return sections


def _keys(sections: _Sections, name: str) -> dict[str, tuple[str, int]]:
    """(value, line) of each `Key: value` of a section, keys in small letters."""
    found = ((number, _KEY.fullmatch(line)) for number, line in sections.get(name, ()))
    return {match[1].lower(): (match[2].strip(), number) for number, match in found if match}


def _stated(user: Mapping[str, tuple[str, int]]) -> dict[str, tuple[str, int]]:
    """What the file says of itself, as the keys of a comment: machine and day."""
    keys = {}
    machine, line = user.get("machine", ("", 0))
    if machine:
        keys["machine"] = json.dumps(machine), line
    day, line = user.get("date", ("", 0))
    match = _DATE.fullmatch(day)
    if match:
        keys["measured"] = match[1], line
    return keys


def _count(sections: _Sections, section: str, key: str, file: str) -> int:
    text, line = _keys(sections, section).get(key, ("", 0))
    if not text.isdigit():
        raise InputError(
            f'states no number of {key.partition("-")[0]}s ("{key.capitalize()}: N" below "{section}::"); '
            "expected a measured line, copy the file again",
            file=file, line=line or None,
        )  # fmt: skip
    return int(text)


def _targets(sections: _Sections, file: str) -> np.ndarray:
    """(n,) positions in mm, in their order in the file."""
    count = _count(sections, "TARGET DATA", "target-count", file)
    values: list[float] = []
    problems: list[Problem] = []
    listing = False
    for number, line in sections["TARGET DATA"]:
        key = _KEY.fullmatch(line)
        if key:
            listing, line = key[1].lower() == "targets", key[2]
        for cell in line.split() if listing else ():
            value = finite(cell)
            if math.isnan(value):
                problems.append((number, f'target "{cell[:40]}"; expected a position in mm, such as 50.000'))
            values.append(value)
    if problems:
        raise config_error(problems, file)
    if len(values) != count or count < 2:
        raise InputError(
            f"holds {len(values)} targets, and states Target-count: {count}; expected 2 or more and the same "
            "number, copy the file again",
            file=file,
        )
    return np.array(values)


def _deviations(sections: _Sections, file: str) -> tuple[Index, Index, Index, np.ndarray]:
    """Line, run, number of the target, and deviation of each row."""
    rows: list[tuple[int, int, int, float]] = []
    problems: list[Problem] = []
    for number, line in _rows(sections):
        cells = line.split()
        whole = [int(cell) for cell in cells[:2] if cell.isdigit()]
        value = finite(cells[2]) if len(cells) == 3 else math.nan
        if len(whole) < 2 or math.isnan(value):
            problems.append((number, f'"{line[:40]}"; expected run, number of the target, and deviation'))
        else:
            rows.append((number, whole[0], whole[1], value))
    if problems:
        raise config_error(problems, file)
    if not rows:
        raise InputError('holds no deviations below "Run Target Data:"; copy the file again', file=file)
    number_of, run, place = (np.array([row[k] for row in rows], np.int64) for k in range(3))
    return number_of, run, place, np.array([row[3] for row in rows])


def _rows(sections: _Sections) -> Iterator[tuple[int, str]]:
    listing = False
    for number, line in sections.get("DEVIATIONS", ()):
        key = _KEY.fullmatch(line)
        if key:
            listing = key[1].lower() == "run target data"
        elif listing:
            yield number, line


def _check_whole(sections: _Sections, taken: tuple[int, Index, Index], line: Index, file: str) -> None:
    """Refuse a file in which a run lacks a target or has it twice, or that lacks a run."""
    targets, run, place = taken
    runs = _count(sections, "RUNS", "run-count", file)
    wrong = np.flatnonzero((place < 1) | (place > targets))
    if len(wrong):
        sentence = f"target {place[wrong[0]]}; expected a number from 1 to {targets}"
        raise config_error([(int(line[wrong[0]]), sentence)], file)
    found = dict.fromkeys(run.tolist())
    if len(found) != runs:
        raise InputError(
            f"holds {len(found)} runs, and states Run-count: {runs}; the file is cut off, copy it again",
            file=file,
        )
    for number in found:
        own = np.sort(place[run == number])
        if len(own) != targets or (own != np.arange(1, targets + 1)).any():
            first = int(line[run == number][0])
            sentence = f"run {number} has {len(own)} rows; expected each of the {targets} targets once"
            raise config_error([(first, sentence)], file)
